"""How deep surfaces are in each other."""

from __future__ import annotations

import numpy as np

Surface = tuple[np.ndarray, np.ndarray]  # points (n, 3) [m], triangles (m, 3)
CHUNK = 2_000_000  # pairs looked at at a time


def deepest_vertex(surfaces: list[Surface]) -> float:
    """Largest depth of a vertex of one closed surface in another one, 0 for none [m].

    The depth is measured to the plane of the nearest vertex, so to the fineness of the mesh; a vertex counts where the
    surface winds around it.
    """
    deepest = 0.0
    for a, (points, _) in enumerate(surfaces):
        for b, (others, triangles) in enumerate(surfaces):
            if a != b:
                deepest = max(deepest, deepest_in(points, others, triangles))
    return deepest


def deepest_in(points: np.ndarray, others: np.ndarray, triangles: np.ndarray) -> float:
    """Of points in a surface [m]."""
    near = points[((points > others.min(axis=0)) & (points < others.max(axis=0))).all(axis=1)]
    if not len(near):
        return 0.0
    normals = vertex_normals(others, triangles)
    depths = np.empty(len(near))
    step = max(1, CHUNK // len(others))
    for begin in range(0, len(near), step):
        part = near[begin : begin + step]
        squares = (part**2).sum(axis=1)[:, None] - 2 * part @ others.T + (others**2).sum(axis=1)
        nearest = squares.argmin(axis=1)
        depths[begin : begin + step] = np.einsum("ij,ij->i", others[nearest] - part, normals[nearest])
    inside = np.flatnonzero(depths > 0)
    for at in inside[np.argsort(-depths[inside])]:
        if winding(near[at], others, triangles) > 0.5:
            return float(depths[at])
    return 0.0


def vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals out of a surface at its vertices, by the areas of their triangles (n, 3)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas, normals = np.cross(b - a, c - a), np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, triangles[:, k], areas)
    return normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]


def winding(point: np.ndarray, points: np.ndarray, triangles: np.ndarray) -> float:
    """How often a surface winds around a point: 1 inside, 0 outside (van Oosterom and Strackee 1983)."""
    a, b, c = (points[triangles[:, k]] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = (np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a)))
    ab, bc, ca = dots
    return float(np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum() / (2 * np.pi))
