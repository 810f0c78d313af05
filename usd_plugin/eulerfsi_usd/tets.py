"""Tetrahedra: their volumes, the surface around them, which of them holds a point.

Products are written out, so that the same mesh gives the same bits on every machine.
"""

from __future__ import annotations

import numpy as np

_FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))  # outwards where the volume is positive
_INSIDE = -1e-9  # the least weight of a point that lies in a tetrahedron
_AT_ONCE = 1_000_000  # pairs of points and tetrahedra


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3) vector product."""
    x, y, z = (a[..., i] for i in range(3))
    u, v, w = (b[..., i] for i in range(3))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) scalar product of (..., 3) vectors."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3, 3) product of matrices."""
    return sum(a[..., :, k, None] * b[..., None, k, :] for k in range(3))


def volumes(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """(m,) signed."""
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    return dot(b - a, cross(c - a, d - a)) / 6.0


def edges(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """(m, 3, 3) columns: the edges from the first corner."""
    return np.stack([points[tets[:, k]] - points[tets[:, 0]] for k in (1, 2, 3)], axis=-1)


def inverse(matrices: np.ndarray) -> np.ndarray:
    """(m, 3, 3) of matrices with a volume."""
    a, b, c = (matrices[..., k] for k in range(3))
    rows = np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=-2)
    return rows / dot(a, cross(b, c))[..., None, None]


def gradients(rest: np.ndarray, now: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """(m, 3, 3) F = dx/dX of each tetrahedron, rest and now: points (n, 3)."""
    return product(edges(now, tets), inverse(edges(rest, tets)))


def oriented(points: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """(m, 4) the same tetrahedra, corners in the order that makes their volumes positive."""
    turned = tets.copy()
    bad = volumes(points, tets) < 0.0
    turned[bad, 2], turned[bad, 3] = tets[bad, 3], tets[bad, 2]
    return turned


def boundary(tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces (k, 3) of one tetrahedron only, outwards, and whose they are (k,). tets: with positive volumes."""
    faces = np.concatenate([tets[:, face] for face in _FACES])
    owners = np.tile(np.arange(len(tets)), len(_FACES))
    a, b, c = np.sort(faces, axis=1).astype(np.int64).T
    points = int(tets.max(initial=0)) + 1
    keys = np.unique(a * points + b, return_inverse=True)[1] * points + c
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    once = np.sort(first[count == 1])
    return faces[once], owners[once]


def weights(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 4) of the corners (n, 4, 3), with which they add to the points (n, 3)."""
    return _weights(corners[:, 0], _to_weights(corners), points)


def _to_weights(corners: np.ndarray) -> np.ndarray:
    """(m, 3, 3) from places relative to the first corner to the weights of the others."""
    return inverse(np.stack([corners[:, k] - corners[:, 0] for k in (1, 2, 3)], axis=-1))


def _weights(first: np.ndarray, matrices: np.ndarray, points: np.ndarray) -> np.ndarray:
    x = points - first
    rest = [matrices[:, k, 0] * x[:, 0] + matrices[:, k, 1] * x[:, 1] + matrices[:, k, 2] * x[:, 2] for k in range(3)]
    return np.stack([1.0 - rest[0] - rest[1] - rest[2], *rest], axis=1)


class _Holders:
    """Which tetrahedron holds each of some points, from pairs that may: of several the first."""

    def __init__(self, corners: np.ndarray, wanted: np.ndarray) -> None:
        self._first, self._matrices, self._wanted = corners[:, 0], _to_weights(corners), wanted
        self.owner, self.weights = np.full(len(wanted), -1), np.zeros((len(wanted), 4))

    def try_pairs(self, point: np.ndarray, tet: np.ndarray) -> None:
        """Pairs of points and tetrahedra; a call has all of a point, or its tetrahedra come in their order."""
        share = _weights(self._first[tet], self._matrices[tet], self._wanted[point])
        holds = np.flatnonzero((share.min(axis=1) >= _INSIDE) & (self.owner[point] < 0))[::-1]
        self.owner[point[holds]], self.weights[point[holds]] = tet[holds], share[holds]  # the last assigned counts


def locate(points: np.ndarray, tets: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first tetrahedron that holds each wanted point, (n,), -1 for none, and the weights of its corners (n, 4)."""
    corners = points[tets]
    holders = _Holders(corners, wanted)
    low, high = corners.min(axis=1), corners.max(axis=1)
    origin, size = low.min(axis=0), max(float((high - low).mean()) / 2.0, 1e-30)
    shape = np.maximum(np.ceil((high.max(axis=0) - origin) / size).astype(int), 1)
    inside = np.flatnonzero(((wanted >= origin) & (wanted <= high.max(axis=0))).all(axis=1))
    place = np.minimum(((wanted[inside] - origin) / size).astype(int), shape - 1)
    ends = (np.minimum(((end - origin) / size).astype(int), shape - 1) for end in (low, high))
    box, at = _boxes(*ends)
    bins = (at[:, 0] * shape[1] + at[:, 1]) * shape[2] + at[:, 2]
    order = np.argsort(bins, kind="stable")
    bins, members = bins[order], box[order]
    cell = (place[:, 0] * shape[1] + place[:, 1]) * shape[2] + place[:, 2]
    first, last = np.searchsorted(bins, cell, "left"), np.searchsorted(bins, cell, "right")
    count = last - first
    for some in np.array_split(np.arange(len(inside)), 1 + int(count.sum()) // _AT_ONCE):
        who = np.repeat(some, count[some])
        step = np.arange(len(who)) - np.repeat(np.cumsum(count[some]) - count[some], count[some])
        tet = members[np.repeat(first[some], count[some]) + step]
        point = inside[who]
        boxed = ((wanted[point] >= low[tet]) & (wanted[point] <= high[tet])).all(axis=1)
        holders.try_pairs(point[boxed], tet[boxed])
    return holders.owner, holders.weights


def locate_nodes(
    points: np.ndarray, tets: np.ndarray, origin: np.ndarray, spacing: float, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of all nodes of a grid, x slowest: owners, weights, and the nodes (n, 3)."""
    index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    nodes = np.asarray(origin, float) + spacing * index
    corners = points[tets]
    holders = _Holders(corners, nodes)
    most = np.array(shape) - 1
    low = np.clip(np.ceil((corners.min(axis=1) - origin) / spacing - 1e-6).astype(int), 0, most)
    high = np.clip(np.floor((corners.max(axis=1) - origin) / spacing + 1e-6).astype(int), -1, most)
    some = np.flatnonzero((high >= low).all(axis=1))
    count = (high[some] - low[some] + 1).prod(axis=1)
    for part in np.array_split(some, 1 + int(count.sum()) // _AT_ONCE):
        box, at = _boxes(low[part], high[part])
        holders.try_pairs((at[:, 0] * shape[1] + at[:, 1]) * shape[2] + at[:, 2], part[box])
    return holders.owner, holders.weights, nodes


def _boxes(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells of boxes from low to high (m, 3), both included: whose they are, and where (k, 3)."""
    spans = high - low + 1
    count = spans.prod(axis=1)
    box = np.repeat(np.arange(len(low)), count)
    step = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
    k, rest = step % spans[box, 2], step // spans[box, 2]
    return box, low[box] + np.stack([rest // spans[box, 1], rest % spans[box, 1], k], axis=1)
