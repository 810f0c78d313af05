"""Public names of a run; see eulerfsi.run."""

from .run.build import build_simulation
from .run.simulate import Options, Result, load_scene, simulate

__all__ = ["Options", "Result", "build_simulation", "load_scene", "simulate"]
