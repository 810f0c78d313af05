"""Bodies of the cases as finite elements and as particles: hexahedra, tetrahedra, points of a lattice."""

from __future__ import annotations

import itertools

import numpy as np

CORE = 0.5  # half the edge of the ball's inner block over the radius
BULGE = 0.4  # how round that block is: 0 a cube, 1 a ball

Cells = np.ndarray  # (n, 8) nodes of hexahedra; corner 4 a + 2 b + c lies at a, b, c of 0, 1 along the cell's axes


def ball_blocks(across: int) -> tuple[np.ndarray, Cells]:
    """A ball of radius 1: a round block of across/2 cells along each axis within six shells of across/4 layers.

    across: a multiple of 4.
    """
    if across % 4:
        raise ValueError(f"{across} elements over the diameter: must be a multiple of 4")
    inner, layers = across // 2, across // 4
    line = np.linspace(-1, 1, inner + 1)
    points, cells, count = [], [], 0

    def add(block: np.ndarray) -> None:
        nonlocal count
        cells.append(grid_cells(block.shape[:3]) + count)
        points.append(block.reshape(-1, 3))
        count += points[-1].shape[0]

    add(core_point(np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1)))
    for axis, side in itertools.product(range(3), (-1.0, 1.0)):
        first, second = (a for a in range(3) if a != axis)
        face = np.empty((inner + 1, inner + 1, 3))
        face[..., axis] = side
        face[..., first], face[..., second] = np.meshgrid(line, line, indexing="ij")
        outer = face.copy()
        for other in (first, second):
            outer[..., other] = np.tan(np.pi / 4 * face[..., other])
        outer /= np.linalg.norm(outer, axis=-1, keepdims=True)
        part = np.linspace(0, 1, layers + 1)[:, None, None, None]
        add((1 - part) * core_point(face) + part * outer)
    return merged(np.concatenate(points), np.concatenate(cells))


def core_point(point: np.ndarray) -> np.ndarray:
    """Where a point of the cube [-1, 1]^3 lies in the inner block."""
    length = np.linalg.norm(point, axis=-1, keepdims=True)
    round_ = np.abs(point).max(axis=-1, keepdims=True) / np.where(length == 0, 1, length)
    return CORE * point * (1 - BULGE + BULGE * round_ * np.sqrt(1.5))


def grid_cells(shape: tuple[int, ...]) -> Cells:
    """Cells of a block of nodes."""
    index = np.arange(np.prod(shape)).reshape(shape)
    ends = ((slice(None, -1), slice(1, None)),) * 3
    return np.stack([index[corner].ravel() for corner in itertools.product(*ends)], axis=1)


def merged(points: np.ndarray, cells: Cells) -> tuple[np.ndarray, Cells]:
    """Nodes at the same place become one."""
    _, first, index = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    return points[first], index.ravel()[cells]


def tetrahedra(points: np.ndarray, cells: Cells) -> np.ndarray:
    """Six in every cell along its diagonal from corner 0 to 7, (6 n, 4), volumes positive.

    Conforming: the blocks of a ball share faces whose axes run the same way.
    """
    parts = []
    for order in itertools.permutations((4, 2, 1)):
        parts.append(cells[:, [0, order[0], order[0] + order[1], 7]])
    tets = np.concatenate(parts)
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    turned = np.linalg.det(edges) < 0
    tets[turned] = tets[turned][:, [0, 2, 1, 3]]
    return tets


def volume(points: np.ndarray, tets: np.ndarray) -> float:
    return float(np.abs(np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]])).sum() / 6)


def ball(radius: float, across: int) -> tuple[np.ndarray, Cells, np.ndarray]:
    """Nodes, hexahedra and tetrahedra of a ball about the origin; the tetrahedra have exactly its volume."""
    points, cells = ball_blocks(across)
    tets = tetrahedra(points, cells)
    scale = (4 / 3 * np.pi / volume(points, tets)) ** (1 / 3)
    return radius * scale * points, cells, tets


def beam(length: float, height: float, across: int) -> tuple[np.ndarray, Cells, np.ndarray]:
    """Nodes, hexahedra and tetrahedra of a beam from x = 0 on, its section centred at y = z = 0."""
    along = round(length / height * across)
    shape = (along + 1, across + 1, across + 1)
    axes = [np.linspace(0, length, along + 1)] + [np.linspace(-height / 2, height / 2, across + 1)] * 2
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = grid_cells(shape)
    return points, cells, tetrahedra(points, cells)


def lattice(low: np.ndarray, high: np.ndarray, spacing: float) -> np.ndarray:
    """Centres of the cells of a lattice of two points per `spacing` that fills a box."""
    step = spacing / 2
    axes = [a + step * (np.arange(round((b - a) / step)) + 0.5) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def ball_points(radius: float, spacing: float) -> np.ndarray:
    """Points of a lattice within a ball about the origin, eight per cell."""
    points = lattice(np.full(3, -radius), np.full(3, radius), spacing)
    return points[np.linalg.norm(points, axis=1) < radius]
