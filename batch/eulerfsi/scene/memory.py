"""The memory that a simulation will need, and the voxel size that would fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..errors import SceneError
from ..solver import simulation as solver
from ..system import format_bytes

# The library's counts of bytes end here.
_LARGEST = 2**64 - 1
# No advice leads to a grid of more cells.
MOST_CELLS = 1e9


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


def demand(prim: str, domain: Mapping[str, Any], meshes: Iterable[solver.Mesh], limit: int, unit: float) -> None:
    """Raises SceneError where the simulation needs more than `limit` bytes. unit: metres per stage unit."""
    need, fitting = estimate(domain, meshes, limit)
    if not limit or need <= limit:
        return
    if fitting > 0:
        fitting = max(fitting, math.cbrt(math.prod(domain["domain_size"]) / MOST_CELLS))
    # Rounded up in the third digit, so that the number in the message does fit.
    digits = 10.0 ** (math.floor(math.log10(fitting / unit)) - 2) if fitting > 0 else 0
    suggested = math.ceil(fitting / unit / digits) * digits if digits else 0
    advice = f"; eulerfsi:voxelSize = {suggested:.3g} fits" if digits else ""
    amount = format_bytes(need) if need < _LARGEST else f"more than {format_bytes(_LARGEST)}"
    raise SceneError(
        f"{prim}: eulerfsi:voxelSize = {domain['voxel_size'] / unit:.4g} needs {amount} of memory: "
        f"must be coarse enough for {format_bytes(limit)}{advice}"
    )
