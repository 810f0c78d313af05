"""The shared library, with the prototypes and structures of `c_api`, which is generated from the C headers."""

from __future__ import annotations

import ctypes
import functools
import os
from collections.abc import Callable
from ctypes import Structure, byref, c_int32, sizeof
from typing import TypeVar

from .. import paths
from ..errors import EulerFsiError, LibraryError
from . import c_api
from .c_api import StatusCode

OK = StatusCode["ok"]
ERROR_INTERNAL, ERROR_ARGUMENT = StatusCode["error_internal"], StatusCode["error_argument"]
ERROR_MESH, ERROR_DIVERGED = StatusCode["error_mesh"], StatusCode["error_diverged"]
ERROR_IO, ERROR_MEMORY = StatusCode["error_io"], StatusCode["error_memory"]
ERROR_CANCELLED, ERROR_CHECKPOINT = StatusCode["error_cancelled"], StatusCode["error_checkpoint"]
LOG_INFO, LOG_WARNING = c_api.LogLevel["info"], c_api.LogLevel["warning"]


# A vector iterates over its components, as lists and numpy expect.
c_api.Vec3.__iter__ = lambda self: iter((self.x, self.y, self.z))


def tokens(enum: dict[str, int]) -> dict[str, int]:
    """An enum by its tokens on a stage: "no_slip" -> "noSlip"."""
    words = {name: name.split("_") for name in enum}
    return {first + "".join(map(str.capitalize, rest)): enum[name] for name, (first, *rest) in words.items()}


PRESETS, WALLS, MATERIALS = tokens(c_api.Preset), tokens(c_api.Wall), tokens(c_api.Material)
REGION_SHAPES, EMITTER_MODES = tokens(c_api.RegionShape), tokens(c_api.EmitterMode)
FORCE_KINDS, ACTS_ON = tokens(c_api.ForceKind), tokens(c_api.ActsOn)
FIELDS = c_api.Field
STAGES, ENERGY_STAGES = tuple(c_api.Stage), tuple(c_api.EnergyStage)

Struct = TypeVar("Struct", bound=Structure)


def define(kind: type[Struct]) -> Struct:
    """A definition with its defaults; kind: c_api.SolidDef and the like."""
    definition = kind()
    name = next(name for name, struct in c_api.STRUCTURES.items() if struct is kind)
    initialise = "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_") + "_init"
    getattr(library(), initialise)(byref(definition), sizeof(definition))
    return definition


def read(kind: type[Struct], call: Callable[..., int], *arguments: object) -> tuple[int, Struct]:
    """Status and result of a function that ends with a struct and its size."""
    out = kind()
    return call(*arguments, byref(out), sizeof(out)), out


@functools.cache
def library() -> ctypes.CDLL:
    """The shared library with its prototypes set. Raises EulerFsiError that names every place looked at."""
    candidates = paths.library_candidates()
    found = next((path for path in candidates if path.is_file()), None)
    if found is None:
        places = "\n  ".join(map(str, candidates))
        raise EulerFsiError(
            f"the shared library was not found; build it or set EULERFSI_LIBRARY. Looked at:\n  {places}"
        )
    try:
        # Threads that spin while they wait stall each other on a busy machine; read when the OpenMP runtime is loaded.
        os.environ.setdefault("OMP_WAIT_POLICY", "passive")
        lib = ctypes.CDLL(str(found))
    except OSError as error:
        raise EulerFsiError(f"{found}: cannot be loaded: {error}") from error
    for name, (result, arguments) in c_api.FUNCTIONS.items():
        function = getattr(lib, name, None)
        if function is None:
            raise EulerFsiError(f"{found}: lacks the function {name}; library and package are of different versions")
        function.argtypes = arguments
        function.restype = result
    lib.efsi_path = str(found)
    return lib


def status_text(status: int) -> str:
    """Short English name of a status."""
    return library().efsi_status_text(status).decode("utf-8", "replace")


def check_error(status: int, error: c_api.Error) -> None:
    """Raises LibraryError for a failed call that fills an EfsiError."""
    if status != OK:
        raise LibraryError(status, error.message.decode("utf-8", "replace") or status_text(status))


def library_version() -> str:
    """Version of the loaded library, "major.minor.patch"."""
    numbers = [c_int32() for _ in range(3)]
    library().efsi_version(*(ctypes.byref(n) for n in numbers))
    return ".".join(str(n.value) for n in numbers)
