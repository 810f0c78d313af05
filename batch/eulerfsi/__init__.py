"""eulerfsi: batch tool and Python binding of libeulerfsi.

    from eulerfsi.solver import Simulation, load_mesh     # the solver, SI units
    from eulerfsi.simulate import load_scene, simulate    # USD scene in, cache out

The command line is `python -m eulerfsi`; see `eulerfsi.cli.main`.
"""

from . import paths

__version__ = "0.2.0"

paths.make_usd_plugin_importable()
