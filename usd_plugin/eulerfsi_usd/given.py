"""Pins and colliders: what moves as the scene says, and whether it can."""

from __future__ import annotations

import math

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .deform import check_shape_over_time, check_stretch
from .gprims import SHAPES, dimensions
from .issues import Issue, first_time, make_issue, read
from .pose import Pose
from .surface import check_surface, mesh_arrays
from .transforms import first_change, frames_of, motions, moves, stretched, turns

PINS, PIN_TO, PIN_PRIMVAR = "eulerfsi:pins", "eulerfsi:pinTo", "primvars:eulerfsi:pin"
_FLAT = 1e-6  # of the extent of a mesh: its thickness where its points lie in one plane
_HALF_TURN = 0.999 * math.pi
THICKNESS_OR_PLANE = "use a Plane for a floor or a wall, or give the mesh a thickness"  # what a flat collider needs


def targets(solid: Usd.Prim, name: str) -> list[Sdf.Path]:
    """Of a relationship."""
    relationship = solid.GetRelationship(name)
    return relationship.GetTargets() if relationship else []


def check_collider(prim: Usd.Prim) -> list[Issue]:
    """Shape and motion of a prim with EulerFsiColliderAPI whose values have been checked."""
    if prim.IsA(UsdGeom.Mesh):
        shape = check_surface(prim) or _check_flat(prim) or check_shape_over_time(prim)
    else:
        shape = _check_dimensions(prim)
    return shape + (check_stretch(prim) or _check_turns(prim))


def _check_flat(prim: Usd.Prim) -> list[Issue]:
    """A collider's Mesh encloses a volume: the points of its faces do not all lie in one plane."""
    points, counts, indices = mesh_arrays(prim)
    points = points[np.unique(indices)]
    away = points - points.mean(axis=0)
    sizes = np.linalg.svd(away, compute_uv=False) if len(points) > 3 else np.zeros(3)
    if sizes[-1] > _FLAT * sizes[0]:
        return []
    value = f"{len(points)} points in one plane ({len(counts)} face{'s' if len(counts) > 1 else ''})"
    return [make_issue(prim, "points", value, "a closed surface with a volume", "FlatCollider", THICKNESS_OR_PLANE)]


def _check_turns(prim: Usd.Prim) -> list[Issue]:
    """Less than half a turn from frame to frame: which way it turned does not follow from its places."""
    frames = frames_of(prim.GetStage())
    if not moves(prim) or len(frames) < 2:
        return []
    angles = turns(prim, frames)
    bad = np.flatnonzero(angles > _HALF_TURN)
    if not len(bad):
        return []
    value = f"a turn by {math.degrees(angles[bad[0]]):.4g} degrees from frame {frames[bad[0]]:g} to "
    value += f"{frames[bad[0] + 1]:g}"
    limit = "less than half a turn (180 degrees) between two frames"
    hint = "only whole frames are read, which do not tell more from less: place its time samples further apart, or "
    hint += "give the stage more time codes per second"
    return [make_issue(prim, "xformOpOrder", value, limit, "FastTurn", hint)]


def _check_volume(prim: Usd.Prim) -> list[Issue]:
    """Of a pin: its shape is the same in all frames, and moves rigidly."""
    shape = check_surface(prim) or _check_same_mesh(prim) if prim.IsA(UsdGeom.Mesh) else _check_dimensions(prim)
    return shape + check_motion(prim)


def _check_dimensions(prim: Usd.Prim) -> list[Issue]:
    """Of an implicit Gprim: above 0, and constant."""
    issues = []
    for name in dimensions(prim):
        attribute = prim.GetAttribute(name)
        value = read(prim, name)
        if not (math.isfinite(value) and value > 0.0):
            issues.append(make_issue(prim, name, value, "> 0", "EmptyShape"))
        if attribute.ValueMightBeTimeVarying():
            number = f"{attribute.GetNumTimeSamples()} time samples"
            issues.append(make_issue(prim, name, number, "constant: only its transform may be animated", "Animated"))
    return issues


def _check_same_mesh(prim: Usd.Prim) -> list[Issue]:
    """Faces and points are the same in all frames."""
    mesh = UsdGeom.Mesh(prim)
    skeleton = Pose(prim, True).skeleton
    if skeleton:
        limit = "none: the volume of a pin is animated by transforms only"
        return [make_issue(prim, "skel:skeleton", skeleton, limit, "DeformingPin")]
    changed = first_change(
        prim, (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetPointsAttr())
    )
    if changed:
        limit = "the same in all frames: the volume of a pin is animated by transforms only"
        return [make_issue(prim, *changed, limit, "ChangingPin")]
    return []


def check_motion(prim: Usd.Prim) -> list[Issue]:
    """Of what a pin follows: rigid in all frames, less than half a turn from frame to frame."""
    if not moves(prim):
        return []
    first, *frames = frames_of(prim.GetStage())
    found = motions(prim, frames, first)
    bad = np.flatnonzero(stretched(found))
    if not len(bad):
        return _check_turns(prim)
    sizes = np.sqrt((found[bad[0], :3, :3] ** 2).sum(axis=1))  # along the axes of the world
    value = f"a stretch by {', '.join(f'{size:.4g}' for size in sizes)} from frame {first:g} to {frames[bad[0]]:g}"
    limit = "rigid: rotations and translations, with one scale in all frames"
    return [make_issue(prim, "xformOpOrder", value, limit, "StretchingMotion")]


def check_pins(solid: Usd.Prim) -> list[Issue]:
    """Vertices, volumes and motions that hold parts of a solid."""
    issues = _check_primvar(solid)
    for target in targets(solid, PINS):
        prim = solid.GetStage().GetPrimAtPath(target)
        limit = f"a {', '.join(SHAPES)} or closed Mesh"
        if not prim or not (prim.IsA(UsdGeom.Mesh) or str(prim.GetTypeName()) in SHAPES):
            hint = f"it is a {prim.GetTypeName() or 'typeless prim'}" if prim else "there is no such prim"
            issues.append(make_issue(solid, PINS, target, limit, "WrongTarget", hint))
            continue
        issues += _check_volume(prim)
    for target in targets(solid, PIN_TO):
        prim = solid.GetStage().GetPrimAtPath(target)
        if not prim or not prim.IsA(UsdGeom.Xformable):
            issues.append(make_issue(solid, PIN_TO, target, "a prim with a transform", "WrongTarget"))
            continue
        issues += check_motion(prim)
    if len(targets(solid, PIN_TO)) > 1:
        number = f"{len(targets(solid, PIN_TO))} targets"
        issues.append(make_issue(solid, PIN_TO, number, "one target", "ManyTargets"))
    return issues


def pinned_vertices(solid: Usd.Prim, time: Usd.TimeCode) -> np.ndarray | None:
    """(points,) true where the primvar holds a vertex; None where it is not authored."""
    primvar = UsdGeom.PrimvarsAPI(solid).GetPrimvar("eulerfsi:pin")
    if not primvar or not primvar.HasAuthoredValue():
        return None
    values = np.asarray(primvar.ComputeFlattened(time) or (), float)
    return values > 0.5


def _check_primvar(solid: Usd.Prim) -> list[Issue]:
    time = first_time(solid.GetStage())
    held = pinned_vertices(solid, time)
    if held is None:
        if targets(solid, PIN_TO):
            return [make_issue(solid, PIN_PRIMVAR, None, "authored where eulerfsi:pinTo is", "MissingPins")]
        return []
    primvar = UsdGeom.PrimvarsAPI(solid).GetPrimvar("eulerfsi:pin")
    has_points = solid.IsA(UsdGeom.PointBased)
    count = len(UsdGeom.PointBased(solid).GetPointsAttr().Get(time) or ()) if has_points else 0
    if primvar.GetInterpolation() not in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying) or len(held) != count:
        value = f"{len(held)} values, interpolation {primvar.GetInterpolation()}"
        return [make_issue(solid, PIN_PRIMVAR, value, f"{count} values, one per vertex", "BadPins")]
    if not held.any():
        return [make_issue(solid, PIN_PRIMVAR, "at most 0.5 everywhere", "above 0.5 at a vertex", "EmptyPins")]
    if primvar.ValueMightBeTimeVarying():
        number = f"{primvar.GetAttr().GetNumTimeSamples()} time samples"
        return [make_issue(solid, PIN_PRIMVAR, number, "constant: the pinned vertices may not be animated", "Animated")]
    return []
