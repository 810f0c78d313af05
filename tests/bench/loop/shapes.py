"""Closed triangle meshes of the laboratory's solids, made in numpy; faces counter-clockwise seen from outside.

Every shape is SIZE long on its longest side and centred at the origin of its bounding box [m].
"""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
from eulerfsi.solver.simulation import Mesh, load_mesh

SIZE = 0.2  # m
RADIUS = SIZE / 2  # of the ball [m]
SHAPES = ("ball", "box", "torus", "plate", "u", "bunny")
# Narrowest parts [m] of the shapes that do not fold when they are thrown.
NARROWEST = {"ball": SIZE, "box": 0.12, "torus": 0.06}
# The Stanford bunny as Debian's package glmark2-data installs it.
BUNNY = Path("/usr/share/glmark2/models/bunny.obj")


def make_shape(name: str, across: int, turn: float = 0.0) -> Mesh:
    """One of SHAPES. across: grid cells over SIZE (the plate is three of them thick); turn: about (1,1,1) [rad]."""
    h = SIZE / across
    if name == "ball":
        points, triangles = ball()
    elif name == "box":
        points, triangles = blocks(np.ones((20, 14, 12), bool), (0.01, 0.01, 0.01))
    elif name == "torus":
        points, triangles = torus(0.07, 0.03)
    elif name == "plate":
        points, triangles = blocks(np.ones((20, 3, 20), bool), (0.01, h, 0.01))
    elif name == "u":
        solid = np.ones((20, 20, 6), bool)
        solid[6:14, 6:] = False
        points, triangles = blocks(solid, (0.01, 0.01, 0.01))
    elif name == "bunny":
        points, triangles = bunny()
    else:
        raise ValueError(f"shape {name!r}: must be one of {', '.join(SHAPES)}")
    points = points @ rotation(turn).T
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    return Mesh(points, np.full(len(triangles), 3), triangles.ravel())


@functools.cache
def bunny() -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of the file, which a process of its own reads: once."""
    loaded = load_mesh(BUNNY)
    points = loaded.points.astype(float)
    return points * (SIZE / np.ptp(points, axis=0).max()), loaded.triangles()


def available(name: str) -> bool:
    """Whether a shape can be made here; the bunny is a file."""
    return name != "bunny" or BUNNY.is_file()


def rotation(turn: float) -> np.ndarray:
    """Rotation matrix about (1,1,1) by Rodrigues' formula; turn [rad]."""
    x, y, z = np.full(3, 1 / np.sqrt(3))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(turn) * cross + (1 - np.cos(turn)) * cross @ cross


def ball(levels: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """A subdivided icosahedron with exactly the volume of a ball of radius RADIUS."""
    golden = (1 + np.sqrt(5)) / 2
    points = np.array(
        [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden)]
        + [(0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]
    )
    triangles = np.array(
        [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6)]
        + [(7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10)]
        + [(8, 6, 7), (9, 8, 1)]
    )
    for _ in range(levels):
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middle = (index + len(points)).reshape(-1, 3)
        points = np.concatenate([points, points[unique].mean(axis=1)])
        (a, b, c), (ab, bc, ca) = triangles.T, middle.T
        corners = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(corner, axis=1) for corner in corners])
        points /= np.linalg.norm(points, axis=1)[:, None]
    scale = (4 / 3 * np.pi / volume(points, triangles)) ** (1 / 3)
    return RADIUS * scale * points, triangles


def torus(ring: float, tube: float, around: int = 96, across: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """A torus about the y axis; radii of ring and tube [m]."""
    u, v = np.meshgrid(2 * np.pi * np.arange(around) / around, 2 * np.pi * np.arange(across) / across, indexing="ij")
    out = ring + tube * np.cos(v)
    points = np.stack([out * np.cos(u), tube * np.sin(v), out * np.sin(u)], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    at = lambda a, b: (a % around) * across + b % across  # noqa: E731
    quads = np.stack([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)], axis=1)
    return points, split(quads)


def blocks(solid: np.ndarray, spacing: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Surface of a set of blocks. solid: (nx, ny, nz) bool; spacing: edge lengths of a block [m]. Sharp edges."""
    padded = np.pad(solid, 1)
    corner = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    quads = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            outside = np.roll(padded, -1 if side else 1, axis)
            cells = np.argwhere(padded & ~outside) - 1
            loop = corner if side else corner[::-1]
            quad = np.repeat(cells[:, None, :], 4, axis=1)
            quad[:, :, axis] += side
            quad[:, :, first] += loop[:, 0]
            quad[:, :, second] += loop[:, 1]
            quads.append(quad)
    corners = np.concatenate(quads)
    nodes, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return nodes * np.array(spacing), split(index.reshape(-1, 4))


def split(quads: np.ndarray) -> np.ndarray:
    """Every quad as two triangles."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Volume inside a closed surface [m^3]; positive when its faces look outwards."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def vertex_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """A third of the areas of the triangles around each vertex [m^2]."""
    a, b, c = (points[triangles[:, k]].astype(float) for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.bincount(triangles.ravel(), np.repeat(area / 3, 3), len(points))


def rigid_misfit(points: np.ndarray, rest: np.ndarray, weights: np.ndarray) -> float:
    """Largest distance of a point from the rest shape, turned to fit best in the weighted mean square [m].

    points, rest: (n, 3), each with its weighted centre at the origin [m]; weights: (n,), sum 1.
    """
    if not np.isfinite(points).all():
        return float("nan")
    left, _, right = np.linalg.svd(rest.T @ (points * weights[:, None]))
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return float(np.linalg.norm(points - rest @ left @ mirror @ right, axis=1).max())
