# SPDX-License-Identifier: GPL-3.0-or-later
"""How thick an object is where it is thinnest, for the count of cells beside the voxel size."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from . import place

_SAMPLES = 400  # faces that are looked at
_SHARE = 5.0  # percent of them that may be thinner: edges and tips have no thickness
_SHELLS = 4  # surfaces that a ray may meet on its way out
_known: dict[str, tuple[int, float]] = {}  # by object: what its mesh was, and the result


def thinnest(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> float:
    """In units of the scene, with modifiers: from a face to the one behind it, along the normal. inf: without faces."""
    shown = obj.evaluated_get(depsgraph)
    mesh = shown.data if isinstance(shown.data, bpy.types.Mesh) else None
    if mesh is None or not mesh.polygons:
        return min(place.edges(obj)) if obj.type != "MESH" else float("inf")
    if obj.hide_viewport and obj.name_full in _known:  # as while its bake is shown: it has no modifiers then
        return _known[obj.name_full][1]
    stamp = _stamp(mesh, obj)
    if _known.get(obj.name_full, (None, 0.0))[0] != stamp:
        _known[obj.name_full] = (stamp, _measure(mesh, place.of(obj).to_3x3(), min(place.edges(obj))))
    return _known[obj.name_full][1]


def forget() -> None:
    """Another file is open, whose objects may have the same names."""
    _known.clear()


def _stamp(mesh: bpy.types.Mesh, obj: bpy.types.Object) -> int:
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    return hash((points.tobytes(), len(mesh.polygons), tuple(place.of(obj).to_scale())))


def _measure(mesh: bpy.types.Mesh, matrix: Matrix, most: float) -> float:
    shape = bmesh.new()
    shape.from_mesh(mesh)
    tree = BVHTree.FromBMesh(shape)
    shape.free()
    away, found = 1e-5 * max(most, *(abs(c) for c in mesh.vertices[0].co), 1e-6), []
    for polygon in list(mesh.polygons)[:: len(mesh.polygons) // _SAMPLES + 1]:
        behind = _behind(tree, polygon.center, -polygon.normal, away)
        if behind is not None:
            found.append((matrix @ (behind - polygon.center)).length)
    return min(most, float(np.percentile(found, _SHARE))) if found else most  # none: its normals point inwards


def _behind(tree: BVHTree, start: Vector, inwards: Vector, away: float) -> Vector | None:
    """Where a ray leaves the object; shells that it enters on the way, as an eye in its socket, do not count."""
    at = start
    for _ in range(_SHELLS):
        at, normal, _, _ = tree.ray_cast(at + away * inwards, inwards)
        if at is None or normal.dot(inwards) > 0.0:
            return at
    return None
