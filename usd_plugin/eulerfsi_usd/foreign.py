"""What a stage has for other programs, where one may expect that it counts here: physics colliders, textures."""

from __future__ import annotations

from collections.abc import Iterable

from pxr import Sdf, Usd, UsdPhysics, UsdShade

from .issues import Issue, all_prims, first_time, listed, scopes_of


def check_foreign(stage: Usd.Stage) -> list[Issue]:
    """Warns, once for all prims, of colliders of UsdPhysics, and of textures that are missing."""
    prims = list(all_prims(stage))
    return _check_colliders(prims) + _check_textures(prims)


def _check_colliders(prims: Iterable[Usd.Prim]) -> list[Issue]:
    found = [prim for prim in prims if prim.HasAPI(UsdPhysics.CollisionAPI) and not scopes_of(prim)]
    found = [prim for prim in found if UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get() is not False]
    if not found:
        return []
    first, value = str(found[0].GetPath()), listed([prim.GetPath() for prim in found])
    limit = "EulerFsiColliderAPI too where solids and fluid shall meet it"
    message = (
        f"{value}: PhysicsCollisionAPI alone has no effect here: the schema that makes a closed Mesh, Sphere, Cube, "
        "Cylinder, Cone, Capsule or Plane a collider is EulerFsiColliderAPI"
    )
    return [Issue(first, "apiSchemas", value, limit, message, "warning", "ForeignCollider")]


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
