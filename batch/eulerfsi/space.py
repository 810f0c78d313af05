"""Simulation space: metres, the domain's own axes, its centre as origin. Points, vectors, transforms to and from the stage.

Row vectors as in USD: world = local * M. Only `to_world_matrix` is for column vectors, as the C API wants it.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from .errors import SceneError

# Cosine between two axes of a box above which its transform counts as sheared.
_SHEAR_LIMIT = 1e-4


@dataclasses.dataclass(frozen=True)
class SimulationSpace:
    """axes: (3, 3), rows are the simulation's x, y, z in world space, right-handed and orthonormal.

    center: (3,) world position of the simulation's origin, stage units.
    """

    axes: np.ndarray
    center: np.ndarray
    meters_per_unit: float

    def point_to_sim(self, world: np.ndarray) -> np.ndarray:
        """(..., 3) world positions [stage units] to simulation positions [m]."""
        return (np.asarray(world, float) - self.center) @ self.axes.T * self.meters_per_unit

    def point_to_world(self, sim: np.ndarray) -> np.ndarray:
        """(..., 3) simulation positions [m] to world positions [stage units]."""
        return np.asarray(sim, float) @ self.axes / self.meters_per_unit + self.center

    def vector_to_sim(self, world: np.ndarray) -> np.ndarray:
        """(..., 3) world vectors to the simulation's axes, length unchanged."""
        return np.asarray(world, float) @ self.axes.T

    def velocity_to_world(self, sim: np.ndarray) -> np.ndarray:
        """(..., 3) velocities [m/s] to world axes [stage units/s]."""
        return np.asarray(sim, float) @ self.axes / self.meters_per_unit

    def to_world_matrix(self) -> np.ndarray:
        """(4, 4) for column vectors: simulation space [m] to world space [stage units]."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes.T / self.meters_per_unit
        matrix[:3, 3] = self.center
        return matrix

    def from_local(self, local_to_world: np.ndarray) -> np.ndarray:
        """(4, 4) for row vectors: a prim's local space to simulation space."""
        world_to_sim = np.eye(4)
        world_to_sim[:3, :3] = self.axes.T * self.meters_per_unit
        world_to_sim[3, :3] = -self.center @ self.axes.T * self.meters_per_unit
        return np.asarray(local_to_world, float) @ world_to_sim


def domain_space(
    prim: str, local_to_world: np.ndarray, meters_per_unit: float
) -> tuple[SimulationSpace, np.ndarray, bool]:
    """Space of a domain prim, the scale along its axes, and whether its transform mirrors.

    A mirrored box is the same box: its x axis is turned around, and the caller swaps the x walls.
    Raises SceneError for shear or a zero scale, naming the prim.
    """
    linear = np.asarray(local_to_world, float)[:3, :3]
    scale = np.linalg.norm(linear, axis=1)
    if not np.isfinite(linear).all() or scale.min() < 1e-12 * max(scale.max(), 1e-300):
        raise SceneError(f"{prim}: scale {tuple(scale.tolist())} of the domain's transform must not be zero")
    axes = linear / scale[:, None]
    cosines = [abs(float(axes[i] @ axes[j])) for i, j in ((0, 1), (1, 2), (2, 0))]
    if max(cosines) > _SHEAR_LIMIT:
        raise SceneError(
            f"{prim}: the domain's transform is sheared (cosine {max(cosines):.3g} between two of its axes, limit "
            f"{_SHEAR_LIMIT:g}); use translation, rotation and scale along its own axes"
        )
    mirrored = bool(np.linalg.det(axes) < 0)
    if mirrored:
        axes = axes * np.array([[-1.0], [1.0], [1.0]])
    # The nearest rotation removes the rounding that the products of many transforms leave.
    left, _, right = np.linalg.svd(axes)
    axes = left @ right
    axes[np.abs(axes) < 1e-12] = 0.0
    center = np.asarray(local_to_world, float)[3, :3].copy()
    return SimulationSpace(axes, center, meters_per_unit), scale, mirrored
