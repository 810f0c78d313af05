"""Points that follow a surface which deforms: bound to it where it is at rest, and where that leaves them.

A point x is bound to the nearest point P of the surface, which keeps its place on its triangle. What lies between them
turns and grows as the surface around P does:

    x' = P' + s R (x - P),

R the rotation that fits best how the triangles around the three corners turn, s^2 by how much their area grows, both
weighted by area and linear on the triangle, so that what is joined stays joined.
"""

from __future__ import annotations

import numpy as np
from eulerfsi_usd.tets import cross, dot

from ..solver.simulation import nearest_on_triangles

_SQUARINGS = 10  # of the matrix whose largest eigenvector is the rotation: 2^10 steps of a power iteration


class Binding:
    """Points (n, 3) bound to a surface: rest (k, 3) and triangles (m, 3), of which at least one has an area."""

    def __init__(self, rest: np.ndarray, triangles: np.ndarray, points: np.ndarray) -> None:
        triangles = triangles[_frame(rest, triangles)[3] > 0.0]
        nearest, self._weights = nearest_on_triangles(rest[triangles], points)
        held, self._corners = np.unique(triangles[nearest], return_inverse=True)
        self._corners = self._corners.reshape(-1, 3)
        self._held, self.surface_points = held, len(rest)
        number = np.full(len(rest), len(held))
        number[held] = np.arange(len(held))
        self._around = triangles[(number[triangles] < len(held)).any(axis=1)]
        self._number = number[self._around]
        self._duals = self._rest_duals(rest)
        self._area = self._sum_around(self._duals[3])
        self._offsets = points - self._on_surface(rest)

    def points(self, now: np.ndarray) -> np.ndarray:
        """(n, 3) where they are while the surface's points (k, 3) are here."""
        turn, growth = self._change(now)
        share = lambda values: sum(  # noqa: E731
            self._weights[:, k].reshape(-1, *[1] * (values.ndim - 1)) * values[self._corners[:, k]] for k in range(3)
        )
        rotation = nearest_rotation(share(turn))
        offsets = self._offsets * np.sqrt(share(growth))[:, None]
        return self._on_surface(now) + sum(rotation[:, :, k] * offsets[:, k : k + 1] for k in range(3))

    def carried(self, now: np.ndarray, velocities: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Where they are, and their velocities: how far they come while the surface goes on for `seconds`."""
        way = 0.5 * seconds * np.asarray(velocities, float)
        before, after = self.points(now - way), self.points(now + way)
        return self.points(np.asarray(now, float)), (after - before) / seconds

    def _on_surface(self, surface: np.ndarray) -> np.ndarray:
        held = surface[self._held]
        return sum(self._weights[:, k : k + 1] * held[self._corners[:, k]] for k in range(3))

    def _rest_duals(self, rest: np.ndarray) -> tuple[np.ndarray, ...]:
        """Per triangle, times twice its area: what its two sides and its normal are multiplied with; and that area."""
        first, second, normal, area = _frame(rest, self._around)
        return cross(second, normal), cross(normal, first), area[:, None] * normal, area

    def _sum_around(self, values: np.ndarray) -> np.ndarray:
        """(held, ...) sum over the triangles around each point that is held, in their order."""
        flat = values.reshape(len(values), -1)
        owners = self._number.ravel()
        sums = [np.bincount(owners, np.repeat(column, 3), len(self._held) + 1)[:-1] for column in flat.T]
        return np.stack(sums, axis=1).reshape(-1, *values.shape[1:])

    def _change(self, now: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Around each point that is held: the mean deformation gradient (3, 3), and the area over that at rest."""
        first, second, normal, area = _frame(now, self._around)
        gradient = sum(
            side[:, :, None] * dual[:, None, :]
            for side, dual in zip((first, second, normal), self._duals[:3], strict=True)
        )
        return self._sum_around(gradient) / self._area[:, None, None], self._sum_around(area) / self._area


def _frame(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, ...]:
    """Two sides of each triangle, its unit normal (0 where it has no area), and twice its area."""
    first, second = (points[triangles[:, k]] - points[triangles[:, 0]] for k in (1, 2))
    normal = cross(first, second)
    area = np.sqrt(dot(normal, normal))
    return first, second, normal / np.where(area > 0.0, area, 1.0)[:, None], area


def nearest_rotation(matrices: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotations R with the largest trace of R^T M; the quaternion is an eigenvector (Horn 1987).

    Every M has one; where all fit equally well, as of 0, it is the one that does not turn.
    """
    m = [[matrices[:, i, j] for j in range(3)] for i in range(3)]
    a, b, c = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    d, e, f = m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]
    x, y, z = m[0][0], m[1][1], m[2][2]
    power = np.stack([x + y + z, a, b, c, a, x - y - z, d, e, b, d, y - x - z, f, c, e, f, z - x - y], -1)
    power = power.reshape(-1, 4, 4)
    size = np.sqrt(sum(power[:, i, j] ** 2 for i in range(4) for j in range(4)))
    power = power / np.where(size > 0.0, size, 1.0)[:, None, None] + np.eye(4)  # no eigenvalue is negative
    for _ in range(_SQUARINGS):
        power = sum(power[:, :, k, None] * power[:, k, None, :] for k in range(4))
        power = power / (power[:, 0, 0] + power[:, 1, 1] + power[:, 2, 2] + power[:, 3, 3])[:, None, None]
    column = np.argmax(np.stack([power[:, k, k] for k in range(4)]), axis=0)
    quaternion = power[np.arange(len(power)), :, column]
    quaternion = quaternion / np.sqrt(sum(quaternion[:, k] ** 2 for k in range(4)))[:, None]
    w, x, y, z = (quaternion[:, k] for k in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
