"""The objects of a mesh file, each of which becomes a solid.

They are those that the file names. Where it names none they are groups of pieces whose boxes do not overlap; crumbs,
much smaller than the largest, stay with the one that is nearest to them.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from ..errors import LibraryError, SceneError
from ..reasons import mesh_reason
from ..solver import simulation as solver
from ..solver.simulation import Mesh

_CRUMB = 0.05  # of the longest edge of the largest group


@dataclasses.dataclass(frozen=True)
class Object:
    """What becomes a solid. name: "" where it is the whole file."""

    name: str
    mesh: Mesh


def read_objects(file: Path, joined: bool = False) -> tuple[list[Object], list[str]]:
    """The objects of a file in the order of their faces, and a warning for each that is left out as it is flat.

    joined: the whole file is one. Raises SceneError.
    """
    if not file.is_file():
        raise SceneError(f"{file}: {'is a folder, not a mesh file' if file.is_dir() else 'no such file'}")
    try:
        mesh = solver.load_mesh(file)
    except LibraryError as error:
        raise SceneError(f"{file}: {mesh_reason(file, error)}") from error
    _demand_volume(str(file), mesh.points)
    if joined:
        return [Object("", mesh)], []
    if any(name for name, _ in mesh.objects):
        objects = named(mesh)
    else:
        pieces = split(mesh)
        objects = [Object(f"Part{i}", piece) for i, piece in enumerate(pieces, 1)] if len(pieces) > 1 else []
        objects = [] if any(_flat_axes(one.mesh.points) for one in objects) else objects
    solids = [one for one in objects if not _flat_axes(one.mesh.points)]
    flat = [
        f'warning: {file}: object "{one.name}" is flat, without extent along {" and ".join(axes)}: it is left out'
        for one in objects
        if (axes := _flat_axes(one.mesh.points))
    ]
    return (solids, flat) if len(objects) > 1 and solids else ([Object("", mesh)], [])


def named(mesh: Mesh) -> list[Object]:
    """The objects that a file names. Those whose open edges meet bound one volume: they are one, named as the first."""
    names, faces = zip(*mesh.objects, strict=True)
    number = np.repeat(np.arange(len(names)), faces)  # of the object of each face
    owner = np.repeat(np.arange(len(mesh.counts)), mesh.counts)
    group = _join_open_edges(mesh, number[owner], len(names))
    heads = np.unique(group)
    return [Object(names[k] or f"Part{k + 1}", _part(mesh, group[number] == k, owner)) for k in heads]


def _join_open_edges(mesh: Mesh, number: np.ndarray, count: int) -> np.ndarray:
    """(count,) the first of the objects that each one is joined with. number: (corners,) object of each corner."""
    ends = np.cumsum(mesh.counts)
    following = np.arange(1, len(mesh.indices) + 1)
    following[ends - 1] = ends - mesh.counts
    corners = np.stack([mesh.indices, mesh.indices[following]])
    edges = np.stack([corners.min(axis=0), corners.max(axis=0), number], axis=1)
    edges, faces = np.unique(edges, axis=0, return_counts=True)
    edges = edges[faces == 1]
    same = (edges[1:, :2] == edges[:-1, :2]).all(axis=1)
    group = np.arange(count)
    for a, b in np.unique(np.stack([edges[:-1, 2][same], edges[1:, 2][same]], axis=1), axis=0):
        first, second = sorted((group[a], group[b]))
        group[group == second] = first
    return group


def _demand_volume(name: str, points: np.ndarray) -> None:
    """Raises SceneError for points in a plane."""
    flat = _flat_axes(points)
    if flat:
        raise SceneError(f"{name}: the mesh is flat, without extent along {' and '.join(flat)}: a solid needs a volume")


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
