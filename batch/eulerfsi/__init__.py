"""eulerfsi: batch tool and Python binding of libeulerfsi.

    from eulerfsi import Simulation, load_mesh            # the solver, SI units
    from eulerfsi.simulate import load_scene, simulate    # USD scene in, cache out

The command line is `python -m eulerfsi`; see `eulerfsi.cli.main`.
"""

from importlib import import_module
from typing import Any

from . import paths

__version__ = "0.2.0"
__all__ = ["Mesh", "Simulation", "Surface", "load_mesh"]  # noqa: F822 - imported when they are asked for

paths.make_usd_plugin_importable()


def __getattr__(name: str) -> Any:
    """Public names, imported when they are asked for: a start that needs none of them stays quick."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(".solver", __name__), name)
