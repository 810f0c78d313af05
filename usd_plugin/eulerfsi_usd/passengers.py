"""Passengers: what rides along with a solid or a collider. Which prims they are, and whether they can be."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from . import deformables
from .deform import points_move
from .given import PINS, targets
from .gprims import is_shape
from .issues import Issue, first_time, instance_above, is_enabled, listed, make_issue, scopes_of
from .pose import Pose, PoseError, transform_drivers
from .transforms import frames_of, moves, places

PASSENGERS = "eulerfsi:passengers"


def find_passengers(solid: Usd.Prim) -> list[Usd.Prim]:
    """What has points, and shapes, below a solid or named by its eulerfsi:passengers: in stage order, then as named."""
    ours = schema_prim(solid)
    pins = targets(ours, PINS)  # they move as the scene says
    below = [prim for prim in _points_below(solid) if prim.GetPath() not in pins]
    return list(dict.fromkeys(below + _named(ours)))


def schema_prim(solid: Usd.Prim) -> Usd.Prim:
    """The prim with the attributes of eulerfsi: the solid, or the sim mesh of a body of the standard."""
    body = deformables.body_at(solid)
    return body.ours if body else solid


def find_riders(collider: Usd.Prim) -> list[Usd.Prim]:
    """Those that follow the surface of a collider: named by it or, where its points move, below it.

    What is below it moves with its transform in any case, and may deform on its own. Raises PoseError.
    """
    below = [prim for prim in _points_below(collider) if not _deforms_itself(prim)]
    return list(dict.fromkeys((below if below and points_move(collider) else []) + _named(collider)))


def _named(body: Usd.Prim) -> list[Usd.Prim]:
    found = []
    for target in targets(body, PASSENGERS):
        prim = body.GetStage().GetPrimAtPath(target)
        if prim:
            found += ([prim] if _can_follow(prim) else []) + _points_below(prim)
    return found


def _deforms_itself(prim: Usd.Prim) -> bool:
    if is_shape(prim):
        return False
    points = UsdGeom.PointBased(prim).GetPointsAttr()
    return points.ValueMightBeTimeVarying() or (prim.IsA(UsdGeom.Mesh) and bool(Pose(prim, True).skeleton))


def _can_follow(prim: Usd.Prim) -> bool:
    if is_shape(prim):
        return _is_drawn(prim) and not scopes_of(prim)
    has_points = prim.IsA(UsdGeom.PointBased) and bool(UsdGeom.PointBased(prim).GetPointsAttr().HasAuthoredValue())
    return has_points and not scopes_of(prim)


def _points_below(prim: Usd.Prim) -> list[Usd.Prim]:
    return [child for child in _below(prim) if _can_follow(child)]


def _below(prim: Usd.Prim) -> list[Usd.Prim]:
    """All prims below one, but other solids (colliders, domains, emitters, forces) and what is below those."""
    if body := deformables.body_at(prim):
        return [child for child in deformables.below(prim) if child != body.sim]
    found = []
    below = iter(Usd.PrimRange(prim, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
    for child in below:
        if child == prim:
            continue
        if scopes_of(child):
            below.PruneChildren()
        else:
            found.append(child)
    return found


def check_passengers(solids: list[Usd.Prim], colliders: list[Usd.Prim]) -> list[Issue]:
    """Targets that exist and have points, points that are finite, transforms, each prim carried by one body."""
    issues: list[Issue] = []
    carriers: dict[Usd.Prim, Usd.Prim] = {}
    for body in [*solids, *colliders]:
        for target in targets(schema_prim(body), PASSENGERS):
            issues += _check_target(body, target)
        try:
            carried = find_passengers(body) if body in solids else find_riders(body)
        except PoseError:
            continue  # the checks of the collider say so
        issues += _check_left_behind(body, body in solids)
        for prim in carried:
            if carriers.get(prim, body) != body:
                limit = f"carried by one body only; {carriers[prim].GetPath()} carries it already"
                issues.append(make_issue(body, PASSENGERS, prim.GetPath(), limit, "ManyCarriers"))
            carriers.setdefault(prim, body)
            issues += _check_points(prim) + check_scale(prim)
            if not deformables.body_at(body):  # there the bind pose says where it is
                issues += _check_own_animation(prim, body)
    return issues


def _check_left_behind(body: Usd.Prim, is_solid: bool) -> list[Issue]:
    """Warns of what is drawn below a body that deforms and has no points that could ride along."""
    pins = targets(schema_prim(body), PINS)  # they move as the scene says
    left = [str(p.GetPath()) for p in _below(body) if _is_drawn(p) and not _can_follow(p) and p.GetPath() not in pins]
    if not left or not (is_solid or points_move(body)):
        return []
    value = listed(left)
    message = (
        f"{body.GetPath()}: does not carry {value}: only a Mesh, curves, Points and shapes such as a Sphere can follow"
    )
    limit = "a Mesh, curves, Points or a shape"
    return [Issue(left[0], "typeName", value, limit, message, "warning", "LeftBehind")]


def _is_drawn(prim: Usd.Prim) -> bool:
    drawn = prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.PointInstancer)
    return drawn and UsdGeom.Imageable(prim).ComputePurpose() != UsdGeom.Tokens.guide


def _check_target(solid: Usd.Prim, target: Sdf.Path) -> list[Issue]:
    prim = solid.GetStage().GetPrimAtPath(target)
    limit = "a Mesh, curves, Points or a shape, or a prim above such"
    if not prim:
        return [make_issue(solid, PASSENGERS, target, limit, "MissingTarget", "there is no such prim")]
    scopes = scopes_of(prim)
    if scopes and is_enabled(prim):
        return [make_issue(solid, PASSENGERS, target, limit, "WrongTarget", f"that prim is a {scopes[0]} itself")]
    if not _can_follow(prim) and not _points_below(prim):
        hint = f"a {prim.GetTypeName() or 'typeless prim'} without points"
        return [make_issue(solid, PASSENGERS, target, limit, "WrongTarget", hint)]
    return []


def _check_points(prim: Usd.Prim) -> list[Issue]:
    if prim.IsInstanceProxy():
        limit = f"false: {prim.GetPath()} inside it is carried and needs its own points"
        return [make_issue(instance_above(prim), "instanceable", True, limit, "InstancePassenger")]
    if is_shape(prim):
        return []
    points = UsdGeom.PointBased(prim).GetPointsAttr().Get(first_time(prim.GetStage()))
    points = np.asarray(points if points is not None else (), float).reshape(-1, 3)
    if len(points) == 0:
        return [make_issue(prim, "points", "empty", "the points that a solid carries", "MissingPoints")]
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if not len(bad):
        return []
    value = tuple(float(x) for x in points[bad[0]])
    limit = f"finite ({len(bad)} of {len(points)} points are not)"
    return [make_issue(prim, f"points[{bad[0]}]", value, limit, "NonFinitePoints")]


def check_scale(prim: Usd.Prim) -> list[Issue]:
    """What is given points in each frame has a space in each, which they are written in."""
    first, *frames = frames_of(prim.GetStage())
    frames = frames if moves(prim) else []
    for frame, place in zip(frames, places(prim, frames), strict=True):
        matrix = np.array(place)[:3, :3]
        sizes = np.sqrt((matrix * matrix).sum(axis=1))
        if abs(np.linalg.det(matrix)) <= 1e-12 * sizes.max() ** 3:
            value = f"a scale of 0 at frame {frame:g}"
            limit = "a transform with a volume in all frames: its points are written in that space"
            hint = "hide it by its visibility"
            return [make_issue(prim, "xformOpOrder", value, limit, "FlatTransform", hint)]
    return []


def _check_own_animation(prim: Usd.Prim, body: Usd.Prim) -> list[Issue]:
    """Warns of what animates a passenger beside what animates its carrier too."""
    time = first_time(prim.GetStage())
    after = -np.inf if time.IsEarliestTime() else time.GetValue()
    shared = transform_drivers(body)
    if prim.IsA(UsdGeom.Mesh):
        drivers = Pose(prim, True).drivers(after)
    else:
        varies = not is_shape(prim) and UsdGeom.PointBased(prim).GetPointsAttr().ValueMightBeTimeVarying()
        drivers = transform_drivers(prim, after) + (["its points"] if varies else [])
    drivers = [driver for driver in drivers if driver not in shared]
    if not drivers:
        return []
    value = " and ".join(drivers)
    start = frames_of(prim.GetStage())[0]
    message = (
        f"{prim.GetPath()}: is animated by {value}: {body.GetPath()} carries it from where it is at frame {start:g}"
    )
    return [Issue(str(prim.GetPath()), "xformOpOrder", value, "constant", message, "warning", "AnimatedPassenger")]
