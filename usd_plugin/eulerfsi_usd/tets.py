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
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    once = np.sort(first[count == 1])
    return faces[once], owners[once]


def weights(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 4) of the corners (n, 4, 3), with which they add to the points (n, 3)."""
    a, b, c, d = (corners[:, k] for k in range(4))
    matrix = inverse(np.stack([b - a, c - a, d - a], axis=-1))
    x = points - a
    rest = np.stack([dot(matrix[:, k], x) for k in range(3)], axis=1)
    return np.concatenate([1.0 - rest.sum(axis=1, keepdims=True), rest], axis=1)


def locate(points: np.ndarray, tets: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first tetrahedron that holds each wanted point, (n,), -1 for none, and the weights of its corners (n, 4)."""
    owner, found = np.full(len(wanted), -1), np.zeros((len(wanted), 4))
    corners = points[tets]
    low, high = corners.min(axis=1), corners.max(axis=1)
    origin, size = low.min(axis=0), max(float((high - low).mean()), 1e-30)
    shape = np.maximum(np.ceil((high.max(axis=0) - origin) / size).astype(int), 1)
    inside = np.flatnonzero(((wanted >= origin) & (wanted <= high.max(axis=0))).all(axis=1))
    place = np.minimum(((wanted[inside] - origin) / size).astype(int), shape - 1)
    bins, members = _bins(((low - origin) / size).astype(int), ((high - origin) / size).astype(int), shape)
    cell = (place[:, 0] * shape[1] + place[:, 1]) * shape[2] + place[:, 2]
    first, last = np.searchsorted(bins, cell, "left"), np.searchsorted(bins, cell, "right")
    count = last - first
    for some in np.array_split(np.arange(len(inside)), 1 + int(count.sum()) // _AT_ONCE):
        who = np.repeat(some, count[some])
        step = np.arange(len(who)) - np.repeat(np.cumsum(count[some]) - count[some], count[some])
        tet = members[np.repeat(first[some], count[some]) + step]
        point = inside[who]
        boxed = ((wanted[point] >= low[tet]) & (wanted[point] <= high[tet])).all(axis=1)
        tet, point = tet[boxed], point[boxed]
        share = weights(corners[tet], wanted[point])
        holds = np.flatnonzero((share >= _INSIDE).all(axis=1))[::-1]  # the last that is assigned counts
        owner[point[holds]], found[point[holds]] = tet[holds], share[holds]
    return owner, found


def _bins(low: np.ndarray, high: np.ndarray, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells that boxes of cells (m, 3) touch, in their order, and the box of each."""
    high = np.minimum(high, shape - 1)
    spans = high - np.minimum(low, high) + 1
    count = spans.prod(axis=1)
    box = np.repeat(np.arange(len(low)), count)
    step = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
    k = step % spans[box, 2]
    j = step // spans[box, 2] % spans[box, 1]
    i = step // (spans[box, 2] * spans[box, 1])
    at = np.minimum(low, high)[box] + np.stack([i, j, k], axis=1)
    cell = (at[:, 0] * shape[1] + at[:, 1]) * shape[2] + at[:, 2]
    order = np.argsort(cell, kind="stable")
    return cell[order], box[order]
