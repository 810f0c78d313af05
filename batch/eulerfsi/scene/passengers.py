"""What rides along: with a solid, as the solver says, or with a collider, whose surface it follows."""

from __future__ import annotations

from typing import Any

import numpy as np
from eulerfsi_usd import gprims
from eulerfsi_usd.passengers import find_riders
from pxr import Usd, UsdGeom

from ..errors import SceneError
from ..solver import simulation as solver
from .bodies import posed_mesh
from .follow import Binding
from .parts import Collider, Deformation, Passenger, Rider, Solid
from .space import SimulationSpace, determinant, transform_points
from .tet_bodies import bind_pose_of, place_at_rest
from .values import Reader


def read_passenger(reader: Reader, space: SimulationSpace, solid: Solid, prim: Usd.Prim) -> Passenger:
    """Where a prim is while the solid is in its rest shape: both as posed at the start, or in their bind poses."""
    points, shape = _shape(reader, prim)
    local = shape["local"]
    bind = bind_pose_of(prim, solid.tets.body) if solid.tets else None
    placed = _place(reader, space, solid.path, prim, points if bind is None else bind)
    if solid.tets:
        placed = place_at_rest(solid.tets, placed, bind is not None)
    return Passenger(**shape, solid=solid.path, mesh=solver.Mesh(placed, local.counts, local.indices))


def read_riders(reader: Reader, space: SimulationSpace, collider: Collider, stage: Usd.Stage) -> list[Rider]:
    """What follows the surface of a collider, bound to it where both are at the start."""
    body, first, riders = stage.GetPrimAtPath(collider.path), collider.motion.first, []
    place = Deformation(collider.path, stage, space, first, True, collider.refinement)
    for prim in find_riders(body):
        points, shape = _shape(reader, prim)
        placed = _place(reader, space, collider.path, prim, points)
        binding = Binding(place.points(first), collider.mesh.triangles(), placed)
        riders.append(Rider(**shape, collider=collider.path, place=place, binding=binding))
    return riders


def _shape(reader: Reader, prim: Usd.Prim) -> tuple[np.ndarray, dict[str, Any]]:
    """Points (n, 3) in its own space as posed, and the fields of Carried."""
    is_mesh, counts, indices, subdivision = prim.IsA(UsdGeom.Mesh), None, None, ""
    if gprims.is_shape(prim):
        surface = solver.Mesh(*gprims.surface_of(prim, reader.time))
        shape = dict(path=str(prim.GetPath()), local=surface, subdivision="", left_handed=False, rigid=True)
        return surface.points.astype(float), shape
    if is_mesh:
        _, points, counts, indices = posed_mesh(reader, prim)
        subdivision = str(UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get())
    else:
        points = np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get(reader.time), float)
    local = solver.Mesh(points, np.array(counts or (), int), np.array(indices or (), int))
    if is_mesh and (local.counts.sum() != len(local.indices) or (local.indices >= len(local.points)).any()):
        raise SceneError(
            f"{prim.GetPath()}: faceVertexCounts, faceVertexIndices and points of the mesh are inconsistent"
        )
    left_handed = is_mesh and reader.authored(prim, "orientation") == UsdGeom.Tokens.leftHanded
    return points, dict(path=str(prim.GetPath()), local=local, subdivision=subdivision, left_handed=left_handed)


def _place(reader: Reader, space: SimulationSpace, carrier: str, prim: Usd.Prim, points: np.ndarray) -> np.ndarray:
    """(n, 3) in simulation space at the start."""
    to_sim = space.from_local(reader.local_to_world(prim))
    if determinant(to_sim) == 0:
        raise SceneError(f"{prim.GetPath()}: the transform of the passenger of {carrier} has a zero scale")
    return transform_points(points, to_sim)
