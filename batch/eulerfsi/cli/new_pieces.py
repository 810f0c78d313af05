"""The objects of a mesh file: groups of pieces whose boxes do not overlap, each of which becomes a solid.

Crumbs, much smaller than the largest, stay with the object that is nearest to them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import LibraryError, SceneError
from ..reasons import mesh_reason
from ..solver import simulation as solver
from ..solver.simulation import Mesh

_CRUMB = 0.05  # of the longest edge of the largest group


def read_objects(file: Path) -> list[Mesh]:
    """The objects of a file, in the order of their first points. Raises SceneError."""
    if not file.is_file():
        raise SceneError(f"{file}: {'is a folder, not a mesh file' if file.is_dir() else 'no such file'}")
    try:
        mesh = solver.load_mesh(file)
    except LibraryError as error:
        raise SceneError(f"{file}: {mesh_reason(file, error)}") from error
    demand_volume(str(file), mesh.points)
    objects = split(mesh)
    return [mesh] if any(_is_flat(part.points) for part in objects) else objects


def demand_volume(name: str, points: np.ndarray) -> None:
    """Raises SceneError for points in a plane."""
    flat = _flat_axes(points)
    if flat:
        raise SceneError(f"{name}: the mesh is flat, without extent along {' and '.join(flat)}: a solid needs a volume")


def _is_flat(points: np.ndarray) -> bool:
    return bool(_flat_axes(points))


def _flat_axes(points: np.ndarray) -> list[str]:
    size = np.ptp(points.astype(float), axis=0)
    return [axis for axis, edge in zip("xyz", size, strict=True) if not edge > 1e-6 * size.max()]


def split(mesh: Mesh) -> list[Mesh]:
    """Parts that no face joins, together where their boxes overlap."""
    _, welded = np.unique(mesh.points, axis=0, return_inverse=True)
    owner = np.repeat(np.arange(len(mesh.counts)), mesh.counts)
    corner = welded.ravel()[mesh.indices]
    label = _labels(corner, owner, len(mesh.counts))
    groups = _join_boxes(mesh, label, owner)
    if groups.max() == 0:
        return [mesh]
    return [_part(mesh, groups == number, owner) for number in range(groups.max() + 1)]


def _labels(corner: np.ndarray, owner: np.ndarray, faces: int) -> np.ndarray:
    """(faces,) number of the piece of each face, in the order of their first faces."""
    points = np.arange(corner.max() + 1)
    while True:
        face = np.full(faces, len(points))
        np.minimum.at(face, owner, points[corner])
        lower = points.copy()
        np.minimum.at(lower, corner, face[owner])
        lower = np.minimum(lower, lower[lower])
        if np.array_equal(lower, points):
            _, first, label = np.unique(face, return_index=True, return_inverse=True)
            return np.argsort(np.argsort(first, kind="stable"), kind="stable")[label]
        points = lower


def _join_boxes(mesh: Mesh, label: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(faces,) number of the group of each face: pieces whose boxes overlap, those of groups too, are one."""
    count = label.max() + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, label[owner], mesh.points[mesh.indices])
    np.maximum.at(high, label[owner], mesh.points[mesh.indices])
    group = np.arange(count)
    changed = True
    while changed:
        changed = False
        for number in range(count):
            if group[number] != number:
                continue
            meets = ((low <= high[number]) & (high >= low[number])).all(axis=1) & (group == np.arange(count))
            others = np.flatnonzero(meets & (np.arange(count) != number))
            if len(others):
                low[number] = np.minimum(low[number], low[others].min(axis=0))
                high[number] = np.maximum(high[number], high[others].max(axis=0))
                group[np.isin(group, others)] = number
                changed = True
    heads = np.flatnonzero(group == np.arange(count))
    length, middle = (high - low).max(axis=1), (high + low) / 2
    large = heads[length[heads] >= _CRUMB * length[heads].max()]
    for crumb in np.setdiff1d(heads, large):
        away = ((middle[large] - middle[crumb]) ** 2).sum(axis=1)
        group[group == crumb] = large[away.argmin()]
    _, group = np.unique(group, return_inverse=True)
    return group[label]


def _part(mesh: Mesh, chosen: np.ndarray, owner: np.ndarray) -> Mesh:
    used, indices = np.unique(mesh.indices[chosen[owner]], return_inverse=True)
    return Mesh(mesh.points[used], mesh.counts[chosen], indices.ravel())
