"""How far the fields of a run are from their own mirror images."""

from __future__ import annotations

import numpy as np
from eulerfsi.solver.simulation import Simulation

MIRRORED = (0, 2)  # axes across whose middle plane the box, the solid and its motion are the same


def gap(field: np.ndarray, axis: int) -> float:
    """Largest difference between a field (components, nx, ny, nz) and its mirror image across the middle of `axis`.

    A field of three components is a vector: its component along the axis changes sign.
    """
    image = np.flip(field, axis + 1).copy()
    if len(field) == 3:
        image[axis] *= -1
    return float(np.abs(field - image).max()) if field.size else 0.0


def corners_of(cells: np.ndarray) -> np.ndarray:
    """(nx + 1, ny + 1, nz + 1) bool: the corners of the cells that are set. cells: (nx, ny, nz) bool."""
    nodes = np.zeros([n + 1 for n in cells.shape], bool)
    for place in np.ndindex(2, 2, 2):
        nodes[tuple(slice(lower, lower + n) for lower, n in zip(place, cells.shape, strict=True))] |= cells
    return nodes


def mirror_gaps(simulation: Simulation) -> dict[str, float]:
    """Largest gaps across the middle planes: of the volume fractions, of the velocity of solid 1 at the corners of
    cells that are more than half solid, on both sides, and of the fluid's [m/s]; and the largest speed component there
    [m/s].
    """
    fraction = simulation.field("solid_fraction")[0]
    fluid, grid = simulation.field("velocity")
    own, band = simulation.field("solid_velocity", 1)
    lower = np.rint((np.array(band["origin"]) - np.array(grid["origin"])) / band["spacing"]).astype(int)
    solid = np.zeros_like(fluid)
    solid[(slice(None), *(slice(at, at + n) for at, n in zip(lower, own.shape[1:], strict=True)))] = own
    inside = corners_of(fraction[0] > 0.5)
    solid *= inside
    return {
        "mirror_fraction": max(gap(fraction, axis) for axis in MIRRORED),
        "mirror_solid": max(gap(solid * np.flip(inside, axis), axis) for axis in MIRRORED),
        "mirror_fluid": max(gap(fluid, axis) for axis in MIRRORED),
        "mirror_speed": float(max(np.abs(solid).max(), np.abs(fluid).max())),
    }
