"""Smooth surfaces of meshes with a subdivision scheme: Catmull-Clark and Loop, refined, on the limit surface.

Catmull and Clark (1978), Loop (1987); sharp edges and corners as DeRose, Kass and Truong (1998): a sharpness counts one
level at a time, and a part of 1 mixes the sharp and the smooth rule. Open edges are sharp. A bilinear surface is its
polygons. New points are sums over the points of the level before, so that the same faces serve all points.
"""

from __future__ import annotations

import math

import numpy as np
from pxr import Usd, UsdGeom

SCHEMES = ("catmullClark", "loop")
_MOST_LEVELS, _MOST_FACES = 7, 1_000_000


class Refinement:
    """The refined faces of a cage. points(): where its points are on the limit surface, for points of the cage.

    Attributes: counts, indices of the faces; the points of the cage are the first ones.
    """

    def __init__(self, prim: Usd.Prim, time: Usd.TimeCode, count: int, levels: int) -> None:
        """count: points of the cage; the faces have been checked."""
        mesh = UsdGeom.Mesh(prim)
        self._loop = scheme_of(prim) == "loop"
        faces = [np.asarray(a.Get(time), np.int64) for a in (mesh.GetFaceVertexCountsAttr(), _indices(mesh))]
        faces = _without_holes(*faces, np.asarray(mesh.GetHoleIndicesAttr().Get(time) or (), np.int64))
        edges, sharpness = _creases(mesh, time)
        corners = _corners(mesh, time, count)
        self._levels = []
        kind = _LoopLevel if self._loop else _QuadLevel
        for _ in range(levels):
            level = kind(*faces, count, edges, sharpness, corners)
            self._levels.append(level)
            faces, count = (level.new_counts, level.new_indices), level.new_points
            edges, sharpness = level.new_edges, level.new_sharpness
            corners = np.concatenate([np.maximum(corners - 1.0, 0.0), np.zeros(count - len(corners))])
        self.counts, self.indices = faces
        self._last = kind(*faces, count, edges, sharpness, corners)

    def points(self, cage: np.ndarray) -> np.ndarray:
        """(n, 3) on the limit surface; cage: its points (m, 3)."""
        return self._last.limit(self.spread(cage))

    def spread(self, values: np.ndarray) -> np.ndarray:
        """(n, c) values at the refined points, before the limit; values: (m, c) at those of the cage."""
        for level in self._levels:
            values = level.refine(values)
        return values


def scheme_of(prim: Usd.Prim) -> str:
    """The scheme of a Mesh; none of other prims."""
    return str(UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get()) if prim.IsA(UsdGeom.Mesh) else "none"


def is_smooth(prim: Usd.Prim) -> bool:
    """Whether a Mesh is the cage of another surface."""
    return scheme_of(prim) in SCHEMES


def levels_for(longest: float, length: float, faces: int) -> int:
    """Levels after which no edge is longer than `length`, if that is affordable; at least one. longest: of the cage."""
    wanted = math.ceil(math.log2(max(longest / length, 1.0)))
    most = math.floor(math.log(max(_MOST_FACES / max(4 * faces, 1), 1.0), 4))
    return max(1, min(wanted, most, _MOST_LEVELS))


def _indices(mesh: UsdGeom.Mesh) -> Usd.Attribute:
    return mesh.GetFaceVertexIndicesAttr()


def _without_holes(counts: np.ndarray, indices: np.ndarray, holes: np.ndarray) -> list[np.ndarray]:
    kept = np.ones(len(counts), bool)
    kept[holes[(holes >= 0) & (holes < len(counts))]] = False
    return [counts[kept], indices[np.repeat(kept, counts)]]


def _creases(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> tuple[np.ndarray, np.ndarray]:
    """(k, 2) sharp edges and their sharpness."""
    indices, lengths, values = (
        np.asarray(a.Get(time) or (), kind)
        for a, kind in (
            (mesh.GetCreaseIndicesAttr(), np.int64),
            (mesh.GetCreaseLengthsAttr(), np.int64),
            (mesh.GetCreaseSharpnessesAttr(), float),
        )
    )
    per_edge = len(values) != len(lengths)
    edges, sharpness, at, edge = [], [], 0, 0
    for number, length in enumerate(lengths):
        chain = indices[at : at + length]
        for a, b in zip(chain[:-1], chain[1:], strict=True):
            edges.append(sorted((int(a), int(b))))
            sharpness.append(values[edge if per_edge else number])
            edge += 1
        at += length
    return np.array(edges, np.int64).reshape(-1, 2), np.array(sharpness, float)


def _corners(mesh: UsdGeom.Mesh, time: Usd.TimeCode, count: int) -> np.ndarray:
    sharpness = np.zeros(count)
    indices = np.asarray(mesh.GetCornerIndicesAttr().Get(time) or (), np.int64)
    values = np.asarray(mesh.GetCornerSharpnessesAttr().Get(time) or (), float)
    sharpness[indices[: len(values)]] = values[: len(indices)]
    return sharpness


class _Level:
    """Faces of one level: edges, what is sharp, and how points of the next one follow."""

    def __init__(
        self,
        counts: np.ndarray,
        indices: np.ndarray,
        count: int,
        edges: np.ndarray,
        sharpness: np.ndarray,
        corners: np.ndarray,
    ) -> None:
        self.counts, self.indices, self.count = counts, indices, count
        ends = np.cumsum(counts)
        place = np.arange(len(indices)) - np.repeat(ends - counts, counts)
        first, size = np.repeat(ends - counts, counts), np.repeat(counts, counts)
        self.owner = np.repeat(np.arange(len(counts)), counts)
        self.following = indices[first + (place + 1) % size]
        self.before = first + (place - 1) % size
        keys = np.minimum(indices, self.following) * count + np.maximum(indices, self.following)
        unique, self.edge = np.unique(keys, return_inverse=True)
        self.ends = np.stack([unique // count, unique % count], axis=1)
        self.faces_at_edge = np.bincount(self.edge, minlength=len(unique))
        self.sharp = np.where(self.faces_at_edge == 2, 0.0, np.inf)
        given = np.searchsorted(unique, edges[:, 0] * count + edges[:, 1]) if len(edges) else np.zeros(0, int)
        known = given < len(unique)
        known[known] = unique[given[known]] == (edges[:, 0] * count + edges[:, 1])[known]
        np.maximum.at(self.sharp, given[known], sharpness[known])
        self._set_vertices(corners)
        self.new_points = count
        self._number_new()

    def _set_vertices(self, corners: np.ndarray) -> None:
        """How many edges meet at a point, how many are sharp, and how far the sharp rule counts."""
        at = lambda values=None: sum(  # noqa: E731
            np.bincount(self.ends[:, k], values, self.count) for k in range(2)
        )
        sharp = (self.sharp > 0.0).astype(float)
        self.valence, number = at(), at(sharp)
        total = at(np.where(np.isinf(self.sharp), 1e9, self.sharp))
        mean = np.minimum(total / np.maximum(number, 1.0), 1.0)
        self.crease = np.where(number == 2, mean, 0.0)
        alone = self.valence == 2  # a corner of an open surface
        self.corner = np.where((number > 2) | ((number == 2) & alone), mean, 0.0)
        self.corner = np.maximum(self.corner, np.minimum(corners, 1.0))
        self.crease = np.where(self.corner > 0.0, 0.0, self.crease)
        self.used = self.valence > 0

    def _number_new(self) -> None:
        """Each scheme's own: numbers the points that a level adds."""
        raise NotImplementedError

    def child_edges(self, offset: int) -> None:
        """The two halves of every sharp edge. offset: number of the first point on an edge."""
        kept = np.flatnonzero((self.sharp > 1.0) & (self.faces_at_edge == 2))
        middle = offset + kept
        self.new_edges = np.concatenate([np.stack([self.ends[kept, k], middle], axis=1) for k in range(2)])
        self.new_sharpness = np.tile(self.sharp[kept] - 1.0, 2)

    def around(self, values: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """(count, c) sums over the other ends of the edges at each point."""
        total = np.zeros((self.count, values.shape[1]))
        for k in range(2):
            other = values[self.ends[:, 1 - k]]
            other = other if weights is None else other * weights[:, None]
            total += _sum(self.ends[:, k], other, self.count)
        return total

    def mixed(self, values: np.ndarray, smooth: np.ndarray, own: float) -> np.ndarray:
        """(count, c) by the rules of smooth and sharp points. own: weight of a point on a sharp line."""
        sharp = (self.sharp > 0.0).astype(float)
        line = own * values + (1.0 - own) / 2.0 * self.around(values, sharp)
        crease, corner = self.crease[:, None], self.corner[:, None]
        result = (1.0 - crease - corner) * smooth + crease * line + corner * values
        return np.where(self.used[:, None], result, values)


def _sum(owners: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    return np.stack([np.bincount(owners, column, count) for column in values.T], axis=1)


class _QuadLevel(_Level):
    """Catmull-Clark: a point per point, edge and face."""

    def _number_new(self) -> None:
        edges, faces = len(self.ends), len(self.counts)
        self.new_points = self.count + edges + faces
        self.child_edges(self.count)
        quads = np.stack(
            [
                self.indices,
                self.count + self.edge,
                self.count + edges + self.owner,
                self.count + self.edge[self.before],
            ],
            axis=1,
        )
        self.new_counts, self.new_indices = np.full(len(quads), 4), quads.ravel()

    def _face_points(self, values: np.ndarray) -> np.ndarray:
        return _sum(self.owner, values[self.indices], len(self.counts)) / self.counts[:, None]

    def refine(self, values: np.ndarray) -> np.ndarray:
        """(new points, c)."""
        faces = self._face_points(values)
        middle = (values[self.ends[:, 0]] + values[self.ends[:, 1]]) / 2.0
        smooth = middle / 2.0 + _sum(self.edge, faces[self.owner], len(self.ends)) / 4.0
        sharp = np.minimum(self.sharp, 1.0)[:, None]
        edges = (1.0 - sharp) * smooth + sharp * middle
        n = np.maximum(self.valence, 1.0)[:, None]
        ring = _sum(self.indices, faces[self.owner], self.count) / n
        own = (ring + (self.around(values) / n + values) + (n - 3.0) * values) / n
        return np.concatenate([self.mixed(values, own, 0.75), edges, faces])

    def limit(self, values: np.ndarray) -> np.ndarray:
        """(count, c) where the points of this level, all quads, end up."""
        n = np.maximum(self.valence, 1.0)[:, None]
        corners = values[self.indices].reshape(-1, 4, values.shape[1])
        opposite = np.roll(corners, 2, axis=1).reshape(-1, values.shape[1])
        smooth = (n * n * values + 4.0 * self.around(values) + _sum(self.indices, opposite, self.count)) / (n * (n + 5))
        return self.mixed(values, smooth, 2.0 / 3.0)


class _LoopLevel(_Level):
    """Loop, of triangles: a point per point and edge."""

    def _number_new(self) -> None:
        self.new_points = self.count + len(self.ends)
        self.child_edges(self.count)
        corner = self.indices.reshape(-1, 3)
        middle = (self.count + self.edge).reshape(-1, 3)
        around = [np.stack([corner[:, k], middle[:, k], middle[:, k - 1]], axis=1) for k in range(3)]
        triangles = np.concatenate([*around, middle])
        self.new_counts, self.new_indices = np.full(len(triangles), 3), triangles.ravel()

    def _share(self) -> np.ndarray:
        n = np.maximum(self.valence, 1.0)
        return ((5.0 / 8.0 - (3.0 / 8.0 + np.cos(2.0 * np.pi / n) / 4.0) ** 2) / n)[:, None]

    def refine(self, values: np.ndarray) -> np.ndarray:
        """(new points, c)."""
        ends = values[self.ends[:, 0]] + values[self.ends[:, 1]]
        opposite = _sum(self.edge, values[self.indices[self.before]], len(self.ends))
        sharp = np.minimum(self.sharp, 1.0)[:, None]
        edges = (1.0 - sharp) * (3.0 / 8.0 * ends + opposite / 8.0) + sharp * ends / 2.0
        share = self._share()
        own = (1.0 - self.valence[:, None] * share) * values + share * self.around(values)
        return np.concatenate([self.mixed(values, own, 0.75), edges])

    def limit(self, values: np.ndarray) -> np.ndarray:
        """(count, c) where the points of this level end up."""
        n = np.maximum(self.valence, 1.0)[:, None]
        share = 1.0 / (3.0 / (8.0 * self._share()) + n)
        smooth = (1.0 - n * share) * values + share * self.around(values)
        return self.mixed(values, smooth, 2.0 / 3.0)
