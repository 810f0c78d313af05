"""The solver: the C API by ctypes, simulations in SI units, mesh files."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_PUBLIC = {"Mesh": ".simulation", "Simulation": ".simulation", "Surface": ".simulation", "load_mesh": ".simulation"}


def __getattr__(name: str) -> Any:
    """Public names, imported when they are asked for: a start that needs none of them stays quick."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name], __name__), name)
