"""Passengers: what rides along with a solid. Which prims they are, and whether they can be."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .issues import Issue, first_time, is_enabled, make_issue, scopes_of

CARRIED = "eulerfsi:carried"


def find_passengers(solid: Usd.Prim) -> list[Usd.Prim]:
    """Meshes, curves and points below a solid or named by its eulerfsi:carried, in stage order and then as named."""
    found = _points_below(solid)
    for target in carried_targets(solid):
        prim = solid.GetStage().GetPrimAtPath(target)
        if prim:
            found += ([prim] if _can_ride(prim) else []) + _points_below(prim)
    return list(dict.fromkeys(found))


def carried_targets(solid: Usd.Prim) -> list[Sdf.Path]:
    """Targets of eulerfsi:carried."""
    relationship = solid.GetRelationship(CARRIED)
    return relationship.GetTargets() if relationship else []


def _can_ride(prim: Usd.Prim) -> bool:
    has_points = prim.IsA(UsdGeom.PointBased) and bool(UsdGeom.PointBased(prim).GetPointsAttr().HasAuthoredValue())
    return has_points and not scopes_of(prim)


def _points_below(prim: Usd.Prim) -> list[Usd.Prim]:
    """Below other solids (domains, emitters) nothing belongs to this prim."""
    found = []
    below = iter(Usd.PrimRange(prim, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
    for child in below:
        if child == prim:
            continue
        if scopes_of(child):
            below.PruneChildren()
        elif _can_ride(child):
            found.append(child)
    return found


def check_passengers(solids: list[Usd.Prim]) -> list[Issue]:
    """Targets that exist and have points, points that are finite, each prim carried by one solid."""
    issues: list[Issue] = []
    carriers: dict[Usd.Prim, Usd.Prim] = {}
    for solid in solids:
        for target in carried_targets(solid):
            issues += _check_target(solid, target)
        for prim in find_passengers(solid):
            if prim in carriers:
                limit = f"carried by one solid only: {carriers[prim].GetPath()} carries it already"
                issues.append(make_issue(solid, CARRIED, prim.GetPath(), limit, "ManyCarriers"))
            carriers.setdefault(prim, solid)
            issues += _check_points(prim)
    return issues


def _check_target(solid: Usd.Prim, target: Sdf.Path) -> list[Issue]:
    prim = solid.GetStage().GetPrimAtPath(target)
    limit = "a Mesh, curves or Points, or a prim above such"
    if not prim:
        return [make_issue(solid, CARRIED, target, limit, "MissingTarget", "there is no such prim")]
    scopes = scopes_of(prim)
    if scopes and is_enabled(prim):
        return [make_issue(solid, CARRIED, target, limit, "WrongTarget", f"that prim is a {scopes[0]} itself")]
    if not _can_ride(prim) and not _points_below(prim):
        hint = f"a {prim.GetTypeName() or 'typeless prim'} without points"
        return [make_issue(solid, CARRIED, target, limit, "WrongTarget", hint)]
    return []


def _check_points(prim: Usd.Prim) -> list[Issue]:
    if prim.IsInstanceProxy():
        limit = "set instanceable = false: what is carried is given its own points"
        return [make_issue(prim, "instanceable", "an instance", limit, "InstancePassenger")]
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
