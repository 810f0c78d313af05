"""Thin bodies with what is followed of them (`sides.Trace`): straps, sheets, rods, ropes, links, rings, balls.

Closed triangle meshes with faces outwards, centred at the origin [m].
"""

from __future__ import annotations

import dataclasses

import numpy as np

from . import shapes
from .sides import Line, Middle, Trace

INNER = 0.55  # of a tube's radius: half the width of the middle surfaces in it, so that what slides along it stays out


@dataclasses.dataclass(frozen=True)
class Shape:
    """A surface and its trace."""

    points: np.ndarray
    triangles: np.ndarray
    trace: Trace = Trace()

    def moved(self, shift: np.ndarray, turn: np.ndarray | None = None) -> Shape:
        """Turned about the origin first."""
        points = self.points if turn is None else self.points @ np.asarray(turn).T
        return dataclasses.replace(self, points=points + np.asarray(shift))


def outwards(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    return triangles if shapes.volume(points, triangles) > 0 else triangles[:, ::-1]


def patch(rows: int, columns: int, closed: bool = False) -> np.ndarray:
    """Triangles of a grid of rows x columns points, row by row; closed: the last row joins the first."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rows - (not closed)), np.arange(columns - 1), indexing="ij"))
    at = lambda a, b: a % rows * columns + b  # noqa: E731
    return shapes.split(np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], axis=1))


def plate(size: tuple[float, float, float], edge: float) -> Shape:
    """A box, thin along y; its middle surface ends a mesh's edge before its sides. edge: of the mesh, about [m].

    The middle surface has every second vertex, or fewer: as many as it takes for edges of half the thickness.
    """
    count = np.maximum(3, np.rint(np.array(size) / edge)).astype(int)
    points, triangles = shapes.blocks(np.ones(count, bool), tuple(np.array(size) / count))
    points = points - np.array(size) / 2
    nodes = np.rint((points / size + 0.5) * count).astype(int)
    index = {tuple(node): k for k, node in enumerate(nodes)}
    wide = max(2 * edge, size[1] / 2)
    rows, columns = (
        np.unique(np.rint(np.linspace(1, n - 1, 1 + max(1, round((n - 2) * s / n / wide)))).astype(int))
        for n, s in ((count[0], size[0]), (count[2], size[2]))
    )
    pairs = np.array([(index[i, 0, k], index[i, count[1], k]) for i in rows for k in columns])
    return Shape(points, triangles, Trace(middles=(Middle(pairs, patch(len(rows), len(columns))),)))


def ball(radius: float, levels: int = 3, axis: int | None = None, beyond: float = 0.0) -> Shape:
    """axis: of a line through it that goes on `beyond` at both ends."""
    points, triangles = shapes.ball(levels)
    points = points * (radius / shapes.RADIUS)
    if axis is None:
        return Shape(points, triangles)
    slices = np.minimum(4, ((points[:, axis] / radius + 1) / 0.4).astype(int))
    line = Line([np.flatnonzero(slices == k) for k in range(5)], beyond=beyond)
    return Shape(points, triangles, Trace(lines=(line,)))


def frames(center: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across a curve (n, 3) that turn as little as can be."""
    ways = np.gradient(center, axis=0)
    if closed:
        ways = np.roll(center, -1, axis=0) - np.roll(center, 1, axis=0)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    first = np.empty_like(ways)
    across = np.eye(3)[np.abs(ways[0]).argmin()] if not closed else np.linalg.svd(center - center.mean(axis=0))[2][2]
    for k, way in enumerate(ways):
        across = across - (across @ way) * way
        first[k] = across = across / np.linalg.norm(across)
    return first, np.cross(ways, first)


def tube(center: np.ndarray, radius: float | np.ndarray, around: int = 16, closed: bool = False) -> Shape:
    """Around a curve (n, 3), flat at its ends; closed curves must be plane. radius: one, or of every point.

    around: multiple of 4. It has a line along it and two middle surfaces that cross in it.
    """
    count, one_other = len(center), frames(center, closed)
    radii = np.broadcast_to(radius, count)
    angle = 2 * np.pi * np.arange(around) / around
    out = np.cos(angle)[None, :, None] * one_other[0][:, None] + np.sin(angle)[None, :, None] * one_other[1][:, None]
    points = (center[:, None] + radii[:, None, None] * out).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count - (not closed)), np.arange(around), indexing="ij"))
    at = lambda a, b: a % count * around + b % around  # noqa: E731
    triangles = shapes.split(np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], axis=1))
    if not closed:
        k = np.arange(around)
        points = np.concatenate([points, center[[0, -1]]])
        low = np.stack([np.full(around, count * around), at(0, k), at(0, k + 1)], axis=1)
        high = np.stack([np.full(around, count * around + 1), at(count - 1, k + 1), at(count - 1, k)], axis=1)
        triangles = np.concatenate([triangles, low, high])
    rings = np.arange(count * around).reshape(count, around)
    middles = tuple(Middle(*strip(rings, quarter, closed)) for quarter in (0, around // 4))
    return Shape(points, outwards(points, triangles), Trace((Line(list(rings), closed),), middles))


def strip(rings: np.ndarray, first: int, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of vertices across a tube that is cut along the direction `first` of its cross-section, and triangles."""
    around = rings.shape[1]
    turns = [k for k in range(1, around // 2) if abs(np.cos(2 * np.pi * k / around)) < INNER]
    pairs = [(ring[(first + k) % around], ring[(first - k) % around]) for ring in rings for k in turns]
    return np.array(pairs), patch(len(rings), len(turns), closed)


def link(wire: float, inside: float, straight: float, edge: float) -> Shape:
    """An oval link of a chain in the xy plane, long along y. wire: its diameter; inside: width of its hole [m]."""
    radius = (wire + inside) / 2
    bend, along = max(8, round(np.pi * radius / edge)), max(1, round(straight / edge))
    turn, side = np.pi * np.arange(bend) / bend, straight * np.arange(along) / along - straight / 2
    top = np.stack([radius * np.cos(turn), straight / 2 + radius * np.sin(turn)], axis=1)
    left = np.stack([np.full(along, -radius), -side], axis=1)
    half = np.concatenate([top, left])
    around = np.concatenate([half, -half])
    center = np.concatenate([around, np.zeros((len(around), 1))], axis=1)
    return tube(center, wire / 2, max(12, 4 * round(np.pi * wire / edge / 4)), closed=True)


def ring(radius: float, wire: float, edge: float) -> Shape:
    """A round ring about the y axis. radius: of its centre line."""
    turn = np.linspace(0, 2 * np.pi, round(2 * np.pi * radius / edge), endpoint=False)
    center = radius * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    return tube(center, wire / 2, max(12, 4 * round(np.pi * wire / edge / 4)), closed=True)


def rope(center: np.ndarray, wire: float, edge: float) -> Shape:
    """Along an open curve (n, 3)."""
    return tube(center, wire / 2, max(12, 4 * round(np.pi * wire / edge / 4)))


def rod(long: float, thick: float, tip: float, edge: float) -> Shape:
    """Down along y, round, with a cone whose end is round: its radius is `tip`, its half angle a third of pi / 2."""
    half, end = np.pi / 6, thick / 2
    # From the lowest point up: the ball of radius tip, the cone that touches it, the rod.
    touch = np.linspace(0.25, 1, 4) * (np.pi / 2 - half)
    low = np.stack([tip * np.sin(touch), tip - tip * np.cos(touch)], axis=1)
    cone_high = low[-1, 1] + (end - low[-1, 0]) / np.tan(half)
    cone = np.linspace(low[-1], (end, cone_high), max(3, round((cone_high - low[-1, 1]) / edge)))[1:]
    shaft = np.linspace(cone[-1], (end, long), max(3, round((long - cone_high) / edge)))[1:]
    profile = np.concatenate([low, cone, shaft])
    center = np.zeros((len(profile), 3))
    center[:, 1] = profile[:, 1] - long / 2
    made = tube(center, profile[:, 0], max(12, 4 * round(np.pi * thick / edge / 4)))
    points = made.points.copy()
    points[-2, 1] = -long / 2  # the lowest point
    return dataclasses.replace(made, points=points)
