"""The memory that a simulation will need, and the voxel size that would fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from eulerfsi_usd.issues import Issue

from ..errors import SceneError
from ..solver import simulation as solver
from ..system import format_bytes

if TYPE_CHECKING:
    from .parts import Scene

# The library's counts of bytes end here.
_LARGEST = 2**64 - 1
# No advice leads to a grid of more cells.
MOST_CELLS = 1e9
# Bytes of a process beside its simulation: Python, USD, the picture. Measured 233 MiB, without matplotlib less.
PROCESS = 233 << 20


def cells(domain: Mapping[str, Any], voxel_size: float) -> float:
    """Cells of the domain's box at a voxel size [m]. domain: fields of EfsiSimulationDef."""
    return math.prod(edge / voxel_size for edge in domain["domain_size"])


def estimate(domain: Mapping[str, Any], meshes: Iterable[solver.Mesh], limit: int) -> tuple[int, float]:
    """(bytes that a simulation will need, smallest voxel size [m] that fits `limit` or 0).

    domain: fields of EfsiSimulationDef; meshes: of solids and colliders [m]; limit: bytes, 0 for none.
    """
    edges = [mesh.points.max(axis=0).astype(float) - mesh.points.min(axis=0) for mesh in meshes]
    edges = [np.minimum(e, domain["domain_size"]) for e in edges]  # what lies beyond a slab takes none
    volume = float(sum(e[0] * e[1] * e[2] for e in edges))
    return solver.estimate_memory({**domain, "memory_limit": limit}, volume)


def need(scene: Scene, limit: int) -> int:
    """Bytes that the simulation of a scene will need."""
    return estimate(scene.domain, [body.mesh for body in [*scene.solids, *scene.colliders]], limit)[0]


def demand(prim: str, domain: Mapping[str, Any], meshes: Iterable[solver.Mesh], limit: int, unit: float) -> None:
    """Raises SceneError where the simulation needs more than `limit` bytes. unit: metres per stage unit."""
    needed, fitting = estimate(domain, meshes, limit)
    if not limit or needed <= limit:
        return
    if fitting > 0:
        fitting = max(fitting, math.cbrt(math.prod(domain["domain_size"]) / MOST_CELLS))
    # Rounded up in the third digit, so that the number in the message does fit.
    digits = 10.0 ** (math.floor(math.log10(fitting / unit)) - 2) if fitting > 0 else 0
    suggested = math.ceil(fitting / unit / digits) * digits if digits else 0
    advice = f"; eulerfsi:voxelSize = {suggested:.3g} fits" if digits else ""
    amount = format_bytes(needed) if needed < _LARGEST else f"more than {format_bytes(_LARGEST)}"
    field, value = "eulerfsi:voxelSize", f"{domain['voxel_size'] / unit:.4g}"
    most = f"coarse enough for {format_bytes(limit)}"
    message = f"{prim}: {field} = {value} needs {amount} of memory: must be {most}{advice}"
    raise SceneError(message, [Issue(prim, field, value, most, message, "error", "TooLarge")])
