"""The points of a triangle mesh that are nearest to given points.

Component by component, as in `space`: the same bits on every machine.
"""

from __future__ import annotations

import numpy as np

_BLOCK = 128  # points that share one look at all triangles


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3) vector product."""
    x, y, z = (a[..., i] for i in range(3))
    u, v, w = (b[..., i] for i in range(3))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) scalar product of (..., 3) vectors, its terms added in order."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def nearest_on_triangles(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangle (n,) and weights of its corners (n, 3) of the nearest point of a mesh; of equally near ones the first.

    corners: (m, 3, 3) of triangles, m > 0, points: (n, 3), both finite and float64.
    """
    middles = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0
    radii = np.sqrt(np.max([_squared(corners[:, k] - middles) for k in range(3)], axis=0)) * (1.0 + 1e-12)
    triangle, weights = np.zeros(len(points), np.int64), np.zeros((len(points), 3))
    for block in _blocks(points):
        own = points[block]
        center = (own.min(axis=0) + own.max(axis=0)) / 2.0
        reach = np.sqrt(_squared(own - center).max())
        away = np.sqrt(_squared(middles - center))
        # A middle is a point of the mesh: no point of the block has a longer way to it than this.
        near = np.flatnonzero(away - radii <= (away.min() + 2.0 * reach) * (1.0 + 1e-12))
        between = np.sqrt(_squared(own[:, None] - middles[near]))
        least = between.min(axis=1, keepdims=True) * (1.0 + 1e-12)
        point, candidate = np.nonzero(between - radii[near] <= least)
        found = _weights_on(corners[near[candidate]], own[point])
        away = _squared(_combine(corners[near[candidate]], found) - own[point])
        order = np.lexsort((near[candidate], away, point))
        first = order[np.unique(point[order], return_index=True)[1]]
        triangle[block], weights[block] = near[candidate[first]], found[first]
    return triangle, weights


def _squared(vectors: np.ndarray) -> np.ndarray:
    return dot(vectors, vectors)


def _combine(corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return sum(weights[:, k : k + 1] * corners[:, k] for k in range(3))


def _blocks(points: np.ndarray) -> list[np.ndarray]:
    """Numbers of points that lie together, at most _BLOCK in each."""
    parts, blocks = [np.arange(len(points))], []
    while parts:
        part = parts.pop()
        if len(part) <= _BLOCK:
            blocks += [part] if len(part) else []
            continue
        axis = int(np.argmax(np.ptp(points[part], axis=0)))
        part = part[np.argsort(points[part, axis], kind="stable")]
        parts += [part[: len(part) // 2], part[len(part) // 2 :]]
    return blocks


def _weights_on(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3) of the corners of one triangle a point, for the nearest point of it; also of one without area."""
    sides = [corners[:, (k + 1) % 3] - corners[:, k] for k in range(3)]
    normal = cross(sides[0], -sides[2])
    double = dot(normal, normal)
    # Opposite to corner k lies the side that starts at the corner after it.
    inside = np.stack([dot(normal, cross(sides[(k + 1) % 3], points - corners[:, (k + 1) % 3])) for k in range(3)], 1)
    whole = (inside >= 0.0).all(axis=1) & (double > 0.0)
    weights = inside / np.where(whole, double, 1.0)[:, None]
    weights /= np.where(whole, weights.sum(axis=1), 1.0)[:, None]
    best = np.where(whole, -1.0, np.inf)
    for k in range(3):
        length = dot(sides[k], sides[k])
        along = dot(points - corners[:, k], sides[k]) / np.where(length > 0.0, length, 1.0)
        along = np.clip(along, 0.0, 1.0)
        edge = np.zeros_like(weights)
        edge[:, k], edge[:, (k + 1) % 3] = 1.0 - along, along
        away = _squared(_combine(corners, edge) - points)
        nearer = away < best
        best = np.where(nearer, away, best)
        weights = np.where(nearer[:, None], edge, weights)
    return weights
