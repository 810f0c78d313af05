"""The solver: the C API by ctypes, simulations in SI units, mesh files."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = [  # noqa: F822 - imported when they are asked for
    "Mesh",
    "Simulation",
    "Surface",
    "estimate_memory",
    "load_mesh",
    "nearest_on_triangles",
    "slab_axis",
    "step_limits",
]


def __getattr__(name: str) -> Any:
    """Public names, imported when they are asked for: a start that needs none of them stays quick."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(".simulation", __name__), name)
