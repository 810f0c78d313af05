"""Whether bodies have passed through each other, judged from the points of their surfaces alone.

Lines are laid along bodies at rest and carried by the mesh's vertices: two of them have passed where their Gauss
integral, the linking number of closed ones, has jumped by 1. Middle surfaces lie between pairs of vertices across the
thickness at rest: a vertex of another body has passed where it has crossed one, which its solid angle tells by a jump
of 4 pi and by no jump on a way around the edge, and is outside of the body again. What crosses it within a quarter of
the thickness from its rim goes around the edge, with an overlap that the law of depth judges.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence

import numpy as np

NEAR = 1.0  # thicknesses beyond a middle surface's bounding box within which vertices are followed
AT_RIM = 0.25  # thicknesses from the rim of a middle surface within which a vertex goes around it
MOST_PAIRS = 400_000  # of vertices and triangles, looked at at a time


@dataclasses.dataclass(frozen=True)
class Line:
    """A line in a body. rings: indices of the vertices whose mean a point of it is, in order along it.

    beyond: length by which an open line goes on straight at both ends [m].
    """

    rings: Sequence[np.ndarray]
    closed: bool = False
    beyond: float = 0.0

    def corners(self, points: np.ndarray) -> np.ndarray:
        """Of its polygon (n, 3); a closed one ends where it begins."""
        line = np.stack([points[ring].mean(axis=0) for ring in self.rings])
        if self.closed:
            return np.concatenate([line, line[:1]])
        if not self.beyond:
            return line
        first, last = line[0] - line[1], line[-1] - line[-2]
        ends = [end + self.beyond * way / np.linalg.norm(way) for end, way in ((line[0], first), (line[-1], last))]
        return np.concatenate([ends[:1], line, ends[1:]])


@dataclasses.dataclass(frozen=True)
class Middle:
    """The surface midway between pairs of vertices (n, 2) that lie across the thickness; triangles (m, 3) of pairs."""

    pairs: np.ndarray
    triangles: np.ndarray

    def corners(self, points: np.ndarray) -> np.ndarray:
        return (points[self.pairs[:, 0]] + points[self.pairs[:, 1]]) / 2

    @functools.cached_property
    def rim(self) -> np.ndarray:
        """Its edges with one triangle (k, 2)."""
        edges = np.sort(np.concatenate([self.triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
        edges, count = np.unique(edges, axis=0, return_counts=True)
        return edges[count == 1]

    def thickness(self, points: np.ndarray) -> np.ndarray:
        """At every pair (n,) [m]."""
        return np.linalg.norm(points[self.pairs[:, 0]] - points[self.pairs[:, 1]], axis=1)


@dataclasses.dataclass(frozen=True)
class Trace:
    """What is followed of a body: lines along it and middle surfaces in it."""

    lines: tuple[Line, ...] = ()
    middles: tuple[Middle, ...] = ()


def gauss_integral(one: np.ndarray, other: np.ndarray, between: int = 0) -> float:
    """Of two polygons of corners (n, 3), (m, 3): the linking number if both are closed (Klenin and Langowski 2000).

    between: 0, or of a polygon with itself, how many segments at least lie between two that count; each pair counts
    once, so that the integral of a closed polygon is half its writhe.
    """
    a, b = one[:-1, None], other[None, :-1]
    along, across = np.diff(one, axis=0)[:, None], np.diff(other, axis=0)[None]
    sides = [b - a, b + across - a, b + across - a - along, b - a - along]
    normals = [np.cross(sides[k], sides[(k + 1) % 4]) for k in range(4)]
    normals = [normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30) for normal in normals]
    angles = sum(
        np.arcsin(np.clip(np.einsum("ijk,ijk->ij", normals[k], normals[(k + 1) % 4]), -1, 1)) for k in range(4)
    )
    angles = np.where(np.einsum("ijk,ijk->ij", np.cross(across, along), sides[0]) < 0, -angles, angles)
    if between:
        angles = np.triu(angles, between + 1)
    return float(angles.sum() / (4 * np.pi))


def solid_angles(places: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Under which places (n, 3) see a surface (n,), signed by its side (van Oosterom and Strackee 1983)."""
    seen = np.empty(len(places))
    step = max(1, MOST_PAIRS // max(1, len(triangles)))
    for begin in range(0, len(places), step):
        part = places[begin : begin + step, None]
        a, b, c = (corners[triangles[:, k]][None] - part for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
        volume = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
        ab, bc, ca = (np.einsum("ijk,ijk->ij", u, v) for u, v in ((a, b), (b, c), (c, a)))
        seen[begin : begin + step] = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1)
    return seen


def to_segments(places: np.ndarray, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Distance of places (n, 3) to the nearest of some segments (n,) [m]; infinite where there are none."""
    way = ends - begins
    square = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    out = np.full(len(places), np.inf)
    for k, place in enumerate(places):
        along = np.clip(((place - begins) * way).sum(axis=1) / square, 0, 1)
        out[k] = np.linalg.norm(begins + along[:, None] * way - place, axis=1).min(initial=np.inf)
    return out


@dataclasses.dataclass
class Crossings:
    """The vertices of a body that have crossed a middle surface of another one, by net number of times.

    out: those that have been outside of it since.
    """

    middle: Middle
    thick: float  # m, at most, at rest
    seen: np.ndarray  # solid angles when last looked at; nan: not near
    net: np.ndarray
    out: np.ndarray

    @classmethod
    def begin(cls, middle: Middle, others: np.ndarray, count: int) -> Crossings:
        """others: points of the body that has the middle surface; count: vertices of the one that may cross it."""
        return cls(
            middle,
            float(middle.thickness(others).max()),
            np.full(count, np.nan),
            np.zeros(count, int),
            np.zeros(count, bool),
        )

    def follow(self, points: np.ndarray, others: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """Indices of the vertices that have passed. others, triangles: the body that has the middle surface."""
        corners = self.middle.corners(others)
        reach = (0.5 + NEAR) * self.thick
        low, high = corners.min(axis=0) - reach, corners.max(axis=0) + reach
        near = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
        now = np.full(len(points), np.nan)
        now[near] = solid_angles(points[near], corners, self.middle.triangles)
        change = np.nan_to_num(now - self.seen)
        jumped = np.flatnonzero(np.abs(change) > 2 * np.pi)
        rim = self.middle.rim
        jumped = jumped[to_segments(points[jumped], corners[rim[:, 0]], corners[rim[:, 1]]) > AT_RIM * self.thick]
        self.net[jumped] += np.sign(change[jumped]).astype(int)
        self.seen = now
        self.out &= self.net != 0
        asked = np.flatnonzero((self.net != 0) & ~self.out)
        if asked.size:
            self.out[asked] = solid_angles(points[asked], others, triangles) < 2 * np.pi
        return np.flatnonzero(self.out)


@dataclasses.dataclass(frozen=True)
class Passed:
    """What has changed sides so far, since the start: lines and vertices, and between which bodies, from 1."""

    lines: int = 0
    vertices: int = 0
    pairs: tuple[tuple[int, int], ...] = ()


def has_loop(trace: Trace) -> bool:
    """Two bodies that have one are judged by linking numbers alone."""
    return any(line.closed for line in trace.lines)


class Sides:
    """Follows bodies from one look at their surfaces, (points, triangles) in the order of the traces, to the next;
    between two a body must move by less than it is thick."""

    def __init__(self, traces: Sequence[Trace], surfaces: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        self.lines = [(k, line) for k, trace in enumerate(traces) for line in trace.lines]
        self.crossings = {
            (a, b, m): Crossings.begin(middle, surfaces[b][0], len(surfaces[a][0]))
            for b, trace in enumerate(traces)
            for m, middle in enumerate(trace.middles)
            for a in range(len(traces))
            if a != b and not (has_loop(traces[a]) and has_loop(trace))
        }
        count = len(self.lines)
        self.net = np.zeros((count, count), int)
        self.integrals = self.look_at_lines(surfaces)
        self.follow(surfaces)

    def look_at_lines(self, surfaces: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Gauss integrals of all lines (n, n), upper half."""
        corners = [line.corners(surfaces[k][0]) for k, line in self.lines]
        seen = np.zeros((len(corners),) * 2)
        for i, one in enumerate(corners):
            for j in range(i, len(corners)):
                seen[i, j] = gauss_integral(one, corners[j], between=int(i == j))
        return seen

    def follow(self, surfaces: Sequence[tuple[np.ndarray, np.ndarray]]) -> Passed:
        """The state now, since the start."""
        now = self.look_at_lines(surfaces)
        self.net += np.rint(now - self.integrals).astype(int)
        self.integrals = now
        tangled = np.argwhere(self.net)
        pairs = {tuple(sorted((self.lines[i][0] + 1, self.lines[j][0] + 1))) for i, j in tangled}
        passed: set[tuple[int, int]] = set()
        for (a, b, _), crossings in self.crossings.items():
            out = crossings.follow(surfaces[a][0], *surfaces[b])
            passed |= {(a, int(v)) for v in out}
            pairs |= {tuple(sorted((a + 1, b + 1)))} if out.size else set()
        return Passed(len(tangled), len(passed), tuple(sorted(pairs)))


def thinnest(traces: Sequence[Trace], points: Sequence[np.ndarray], rest: Sequence[np.ndarray]) -> float:
    """Least thickness at a pair of any middle surface over that at rest; 1 where there is none."""
    shares = [
        (middle.thickness(now) / middle.thickness(then)).min()
        for trace, now, then in zip(traces, points, rest, strict=True)
        for middle in trace.middles
    ]
    return float(min([1.0, *shares]))
