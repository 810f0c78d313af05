"""Simulation space: metres, the domain's own axes, its centre as origin; transforms to and from the stage.

Row vectors as in USD: world = local * M. Only `to_world_matrix` is for column vectors, as the C API wants it.
Products are written out component by component: a matrix product of a linear algebra library may round differently
on another processor, and the same scene must give the same bits on every machine of a farm.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ..errors import SceneError

# Cosine between two axes of a box above which its transform counts as sheared.
_SHEAR_LIMIT = 1e-4


def transform_vectors(vectors: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(..., 3) row vectors times the upper-left 3x3 of a matrix, in double."""
    v = np.asarray(vectors, float)
    return v[..., 0:1] * matrix[0, :3] + v[..., 1:2] * matrix[1, :3] + v[..., 2:3] * matrix[2, :3]


def transform_points(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(..., 3) points times a (4, 4) matrix for row vectors, in double."""
    return transform_vectors(points, matrix) + matrix[3, :3]


def determinant(linear: np.ndarray) -> float:
    """Of the upper-left 3x3."""
    a, b, c = (linear[i, :3] for i in range(3))
    cross = (b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0])
    return float(a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2])


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def orthonormal_rows(linear: np.ndarray) -> np.ndarray:
    """(3, 3) rows of unit length, each made perpendicular to those before it (Gram-Schmidt); keeps the handedness."""
    rows: list[np.ndarray] = []
    for row in np.asarray(linear, float)[:3, :3]:
        for other in rows:
            row = row - _dot(row, other) * other
        rows.append(row / np.sqrt(_dot(row, row)))
    result = np.stack(rows)
    result[np.abs(result) < 1e-12] = 0.0
    return result


@dataclasses.dataclass(frozen=True)
class SimulationSpace:
    """axes: (3, 3), rows are the simulation's x, y, z in world space, right-handed and orthonormal.

    center: (3,) world position of the simulation's origin, stage units.
    """

    axes: np.ndarray
    center: np.ndarray
    meters_per_unit: float

    def point_to_world(self, sim: np.ndarray) -> np.ndarray:
        """(..., 3) simulation positions [m] to world positions [stage units]."""
        return transform_vectors(sim, self.axes) / self.meters_per_unit + self.center

    def velocity_to_world(self, sim: np.ndarray) -> np.ndarray:
        """(..., 3) velocities [m/s] to world axes [stage units/s]."""
        return transform_vectors(sim, self.axes) / self.meters_per_unit

    def vector_to_sim(self, world: np.ndarray) -> np.ndarray:
        """(..., 3) world vectors to the simulation's axes, length unchanged."""
        return transform_vectors(world, self.axes.T)

    def to_world_matrix(self) -> np.ndarray:
        """(4, 4) for column vectors: simulation space [m] to world space [stage units]."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes.T / self.meters_per_unit
        matrix[:3, 3] = self.center
        return matrix

    def from_local(self, local_to_world: np.ndarray) -> np.ndarray:
        """(4, 4) for row vectors: a prim's local space to simulation space."""
        world = np.asarray(local_to_world, float)
        matrix = np.eye(4)
        matrix[:3, :3] = self.vector_to_sim(world[:3, :3]) * self.meters_per_unit
        matrix[3, :3] = self.vector_to_sim(world[3, :3] - self.center) * self.meters_per_unit
        return matrix


def domain_space(
    prim: str, local_to_world: np.ndarray, meters_per_unit: float
) -> tuple[SimulationSpace, np.ndarray, bool]:
    """Space of a domain prim, the scale along its axes, and whether its transform mirrors.

    A mirrored box is the same box: its x axis is turned around, and the caller swaps the x walls.
    Raises SceneError for shear or a zero scale, naming the prim.
    """
    linear = np.asarray(local_to_world, float)[:3, :3]
    scale = np.sqrt((linear * linear).sum(axis=1))
    if not np.isfinite(linear).all() or scale.min() <= 1e-12 * scale.max():
        raise SceneError(f"{prim}: scale {tuple(scale.tolist())} of the domain's transform must not be zero")
    axes = linear / scale[:, None]
    cosine = max(abs(_dot(axes[i], axes[j])) for i, j in ((0, 1), (1, 2), (2, 0)))
    if cosine > _SHEAR_LIMIT:
        raise SceneError(
            f"{prim}: the domain's transform is sheared (cosine {cosine:.3g} between two of its axes, limit "
            f"{_SHEAR_LIMIT:g}); use translation, rotation and scale along its own axes"
        )
    mirrored = determinant(axes) < 0
    if mirrored:
        axes = axes * np.array([[-1.0], [1.0], [1.0]])
    center = np.asarray(local_to_world, float)[3, :3].copy()
    return SimulationSpace(orthonormal_rows(axes), center, meters_per_unit), scale, mirrored
