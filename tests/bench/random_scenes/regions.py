"""Balls and boxes: regions of pins and jets, colliders."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from eulerfsi.solver.simulation import Mesh
from loop import shapes

BLOCKS = 12  # along an edge of a box's mesh


@dataclasses.dataclass(frozen=True)
class Region:
    """A ball or a box. edges: three, of a ball all its diameter [m]; turn: rows of its axes' rotation matrix."""

    kind: str  # sphere, box
    edges: tuple[float, float, float]
    middle: tuple[float, float, float]
    turn: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    @functools.cached_property
    def axes(self) -> np.ndarray:
        """Rotation matrix: columns are the edges' directions."""
        return np.array(self.turn)

    @functools.cached_property
    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Points [m] and triangles."""
        if self.kind == "sphere":
            points, triangles = shapes.ball(3)
            points = points / np.linalg.norm(points, axis=1)[:, None] / 2
        else:
            points, triangles = shapes.blocks(np.ones((BLOCKS,) * 3, bool), (1 / BLOCKS,) * 3)
            points = points - 0.5
        return (points * self.edges) @ self.axes.T + self.middle, triangles

    def mesh(self) -> Mesh:
        points, triangles = self.surface
        return Mesh(points, np.full(len(triangles), 3), triangles.ravel())

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed, of points (n, 3) from its surface, negative inside (n,) [m]."""
        local = (points - self.middle) @ self.axes
        if self.kind == "sphere":
            return np.linalg.norm(local, axis=1) - self.edges[0] / 2
        beyond = np.abs(local) - np.array(self.edges) / 2
        return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)

    def across(self, way: np.ndarray) -> float:
        """Area that it shows along a direction [m^2]."""
        if self.kind == "sphere":
            return np.pi * self.edges[0] ** 2 / 4
        faces = np.prod(self.edges) / np.array(self.edges)
        return float(faces @ np.abs(self.axes.T @ way) / np.linalg.norm(way))

    @property
    def volume(self) -> float:
        return float(np.prod(self.edges)) * (np.pi / 6 if self.kind == "sphere" else 1.0)

    def samples(self, along: int) -> np.ndarray:
        """Places in it, evenly, from its middle (n, 3) [m]. along: how many along an edge."""
        steps = (np.arange(along) + 0.5) / along - 0.5
        places = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
        if self.kind == "sphere":
            places = places[np.linalg.norm(places, axis=1) <= 0.5]
        return (places * self.edges) @ self.axes.T

    def placed(self) -> np.ndarray:
        """Matrix (4, 4) that makes it of the box or ball of edge 1 at the origin."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.axes * self.edges, self.middle
        return matrix

    def moved(self, shift: np.ndarray) -> Region:
        return dataclasses.replace(self, middle=tuple(map(float, np.add(self.middle, shift))))


@dataclasses.dataclass(frozen=True)
class Path:
    """A rigid motion that begins at time 0: straight ahead, and about a place that goes along; then it rests."""

    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m/s
    rate: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad/s
    pivot: tuple[float, float, float] = (0.0, 0.0, 0.0)  # at time 0
    until: float = 0.0  # s

    @property
    def moves(self) -> bool:
        return self.until > 0

    @property
    def turns(self) -> bool:
        return self.moves and any(self.rate)

    def pose(self, time: float) -> np.ndarray:
        """Matrix (4, 4) that places what is at rest."""
        way, pivot = min(time, self.until), np.array(self.pivot)
        return about(pivot, rotation(np.array(self.rate) * way), pivot + np.array(self.velocity) * way)

    def between(self, begin: float, end: float, time: float, middle: np.ndarray) -> np.ndarray:
        """Of a body that the solver moves from the pose at `begin` to that at `end`: its middle goes straight ahead at
        one speed while it turns at one rate, also where the path ends between the two."""
        if not begin < time < end:
            return self.pose(time)
        first, last, part = self.pose(begin), self.pose(end), (time - begin) / (end - begin)
        angle = np.array(self.rate) * (min(end, self.until) - min(begin, self.until))
        start, stop = (place(matrix, middle[None])[0] for matrix in (first, last))
        return about(middle, rotation(part * angle) @ first[:3, :3], start + part * (stop - start))


def about(pivot: np.ndarray, turn: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Matrix (4, 4) that turns about a place and brings that place to its target."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, target - turn @ pivot
    return pose


def rotation(turn: np.ndarray) -> np.ndarray:
    """Matrix of a turn by |turn| about its direction (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    if angle == 0:
        return np.eye(3)
    x, y, z = turn / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def place(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) moved by a pose."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def taken_back(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) that a pose has moved, where they were."""
    return (points - pose[:3, 3]) @ pose[:3, :3]
