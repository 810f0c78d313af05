"""What a stage has for other programs: colliders of UsdPhysics, which count here, and textures, which do not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pxr import Sdf, Usd, UsdShade

from . import standard
from .given import check_collider
from .issues import Issue, all_prims, first_time, listed, scopes_of
from .parameters import prim_types
from .physics import check_friction


def check_foreign(stage: Usd.Stage) -> list[Issue]:
    """Faults of colliders of UsdPhysics; warnings, once for all prims, of what is none, and of missing textures."""
    issues = []
    for prim in physics_colliders(stage):
        faults = check_friction(prim) + check_collider(prim)
        way_out = f"; physics:{standard.COLLISION_ENABLED} = false takes it out"
        issues += [replace(fault, message=fault.message + way_out) for fault in faults]
    return issues + _check_colliders(stage) + _check_textures(all_prims(stage))


def physics_colliders(stage: Usd.Stage) -> list[Usd.Prim]:
    """Prims that PhysicsCollisionAPI makes colliders: shapes outside deformable bodies, without a schema of ours."""
    return [prim for prim in _collision_prims(stage) if _is_shape(prim)]


def _collision_prims(stage: Usd.Stage) -> list[Usd.Prim]:
    time = first_time(stage)
    return [
        prim
        for prim in all_prims(stage)
        if standard.has(prim, standard.COLLISION)
        and standard.value(prim, standard.COLLISION_ENABLED, time, True)
        and not any(standard.has(p, standard.BODY) or _is_ours(p) for p in _upwards(prim))
    ]


def _is_ours(prim: Usd.Prim) -> bool:
    return bool(scopes_of(prim))


def _upwards(prim: Usd.Prim) -> Iterable[Usd.Prim]:
    """It and the prims above it."""
    while prim and not prim.IsPseudoRoot():
        yield prim
        prim = prim.GetParent()


def _is_shape(prim: Usd.Prim) -> bool:
    return str(prim.GetTypeName()) in prim_types()["collider"]


def _is_dynamic(prim: Usd.Prim) -> bool:
    """Whether UsdPhysics would move it by forces."""
    time = first_time(prim.GetStage())
    body = next((p for p in _upwards(prim) if standard.has(p, standard.RIGID_BODY)), None)
    if body is None or not standard.value(body, standard.RIGID_ENABLED, time, True):
        return False
    return not standard.value(body, standard.KINEMATIC, time, False)


def _check_colliders(stage: Usd.Stage) -> list[Issue]:
    found = _collision_prims(stage)
    issues = []
    other = [prim for prim in found if not _is_shape(prim)]
    if other:
        limit = f"on a {', '.join(prim_types()['collider'])}"
        issues.append(_together(other, f"{standard.COLLISION} makes no collider here: must be {limit}", limit))
    dynamic = [prim for prim in found if _is_shape(prim) and _is_dynamic(prim)]
    if dynamic:
        limit = "static, or kinematic (physics:kinematicEnabled)"
        text = "a collider here, but nothing acts on it: rigid bodies move by their animation only; should be "
        issues.append(_together(dynamic, text + limit, limit))
    return issues


def _together(prims: list[Usd.Prim], text: str, limit: str) -> Issue:
    value = listed([prim.GetPath() for prim in prims])
    return Issue(str(prims[0].GetPath()), "apiSchemas", value, limit, f"{value}: {text}", "warning", "ForeignCollider")


def _check_textures(prims: Iterable[Usd.Prim]) -> list[Issue]:
    missing: dict[str, Usd.Attribute] = {}
    for prim in prims:
        for attribute in prim.GetAuthoredPropertiesInNamespace("inputs"):
            if isinstance(attribute, Usd.Attribute) and attribute.GetTypeName() == Sdf.ValueTypeNames.Asset:
                asset = attribute.Get(first_time(prim.GetStage()))
                if asset and asset.path and not _is_there(asset, attribute):
                    missing.setdefault(asset.path, attribute)
    if not missing:
        return []
    attribute = next(iter(missing.values()))
    path, name, value = str(attribute.GetPrimPath()), attribute.GetName(), listed([f"@{file}@" for file in missing])
    message = f"{path}.{name}: no such file: {value}: the simulation needs no textures, but the cache has none to show"
    return [Issue(path, name, value, "a file that exists", message, "warning", "MissingTexture")]


def _is_there(asset: Sdf.AssetPath, attribute: Usd.Attribute) -> bool:
    if not UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
        return bool(asset.resolvedPath)
    stack = attribute.GetPropertyStack(first_time(attribute.GetStage()))
    return bool(stack and UsdShade.UdimUtils.ResolveUdimPath(asset.path, stack[0].layer))
