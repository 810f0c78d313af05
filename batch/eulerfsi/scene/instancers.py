"""PointInstancers whose prototypes are marked: every instance becomes a prim of its own for all that reads the stage.

The prims lie in a layer below the stage's session layer, beside their instancer, `<instancer>_instances/i<id>/<name>`,
with a reference to the prototype; the instancer does not draw these instances any more. The cache has a copy.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from eulerfsi_usd import standard
from eulerfsi_usd.issues import all_prims, first_time, is_enabled, is_ever_enabled, make_issue, scopes_of
from pxr import Sdf, Usd, UsdGeom

from ..errors import SceneError

MOST_BODIES = 255  # solids and colliders that the library takes
_MARK = "eulerfsiInstances"


def expand_instancers(stage: Usd.Stage) -> None:
    """Makes prims of the instances. Raises SceneError for more than the library takes, and what cannot be expanded."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.customLayerData = {_MARK: True}
    done: set[Sdf.Path] = set()
    bodies = 0
    while new := [p for p in _instancers(stage) if p.GetPath() not in done]:
        for prim in new:
            done.add(prim.GetPath())
            marked = {i: body for i, target in _prototypes(prim) if (body := _bodies_in(stage, target))}
            if not marked:
                continue
            numbers = _instances(prim, marked)
            bodies += sum(marked[kind] for _, _, kind in numbers if marked[kind] > 0)
            if bodies > MOST_BODIES:
                limit = f"at most {MOST_BODIES} solids and colliders in a scene"
                raise _fault(prim, "protoIndices", f"{bodies} solids and colliders by instance", limit, "TooManyBodies")
            _expand(stage, layer, prim, numbers)


def instances_layer(stage: Usd.Stage) -> Sdf.Layer | None:
    """The layer with the prims that were made; None without any."""
    for path in stage.GetSessionLayer().subLayerPaths:
        layer = Sdf.Layer.Find(path)
        if layer and _MARK in layer.customLayerData:
            return layer
    return None


def _fault(prim: Usd.Prim, field: str, value: object, limit: str, code: str) -> SceneError:
    issue = make_issue(prim, field, value, limit, code)
    return SceneError(issue.message, [issue])


def _instancers(stage: Usd.Stage) -> list[Usd.Prim]:
    return [prim for prim in all_prims(stage) if prim.IsA(UsdGeom.PointInstancer)]


def _prototypes(prim: Usd.Prim) -> Iterable[tuple[int, Sdf.Path]]:
    return enumerate(UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets())


def _bodies_in(stage: Usd.Stage, path: Sdf.Path) -> int:
    """Solids and colliders in a prototype; -1 where only emitters are; 0 where nothing is marked."""
    root = stage.GetPrimAtPath(path)
    count, emitters = 0, 0
    body = Sdf.Path.emptyPath
    for prim in Usd.PrimRange(root, Usd.PrimAllPrimsPredicate) if root else ():
        scopes = scopes_of(prim)
        emitters += "emitter" in scopes and is_ever_enabled(prim)
        ours = any(scope in scopes for scope in ("solid", "collider")) and is_enabled(prim)
        if standard.has(prim, standard.BODY):
            body = prim.GetPath()
        collides = standard.has(prim, standard.COLLISION) and not (body and prim.GetPath().HasPrefix(body))
        count += ours or standard.has(prim, standard.VOLUME_SIM) or collides
    return count or -min(emitters, 1)


def _instances(prim: Usd.Prim, marked: dict[int, int]) -> list[tuple[int, int, int]]:
    """(number in the arrays, id, prototype) of instances that are there at the start and have a marked prototype."""
    if prim.IsInstanceProxy():
        raise _fault(prim, "prototypes", "in an instance", "outside: set instanceable = false above it", "InInstance")
    instancer, time = UsdGeom.PointInstancer(prim), first_time(prim.GetStage())
    kinds = np.asarray(instancer.GetProtoIndicesAttr().Get(time) or (), np.int64)
    positions = instancer.GetPositionsAttr().Get(time) or ()
    if len(positions) != len(kinds):
        limit = f"{len(kinds)}, one per instance"
        raise _fault(prim, "positions", f"{len(positions)} values", limit, "BadInstancer")
    ids = instancer.GetIdsAttr().Get(time)
    ids = list(map(int, ids)) if ids is not None and len(ids) == len(kinds) else list(range(len(kinds)))
    if len(set(ids)) != len(ids):
        raise _fault(prim, "ids", "some more than once", "one of its own for each instance", "BadInstancer")
    shown = instancer.ComputeMaskAtTime(time)
    shown = list(shown) if len(shown) else [True] * len(kinds)
    return [(i, ids[i], int(kind)) for i, kind in enumerate(kinds) if shown[i] and int(kind) in marked]


def _expand(stage: Usd.Stage, layer: Sdf.Layer, prim: Usd.Prim, numbers: list[tuple[int, int, int]]) -> None:
    """Authors the prims of one instancer, and hides what they stand for."""
    instancer, path = UsdGeom.PointInstancer(prim), prim.GetPath()
    name, count = f"{path.name}_instances", 1
    while stage.GetPrimAtPath(path.ReplaceName(name)):
        name, count = f"{path.name}_instances{count + 1}", count + 1
    home = path.ReplaceName(name)
    prototypes = dict(_prototypes(prim))
    if layer.identifier not in stage.GetSessionLayer().subLayerPaths:
        stage.GetSessionLayer().subLayerPaths.append(layer.identifier)
    with Usd.EditContext(stage, layer):
        group = UsdGeom.Xform.Define(stage, home)
        _copy_transform(UsdGeom.Xformable(prim), group)
        if UsdGeom.Imageable(prim).ComputeVisibility(first_time(stage)) == UsdGeom.Tokens.invisible:
            group.CreateVisibilityAttr(UsdGeom.Tokens.invisible)
        for number, identifier, kind in numbers:
            label = f"i{identifier}" if identifier >= 0 else f"i_{-identifier}"
            place = UsdGeom.Xform.Define(stage, home.AppendChild(label))
            _place(prim, place, number)
            body = stage.DefinePrim(place.GetPath().AppendChild(prototypes[kind].name))
            body.GetReferences().AddInternalReference(prototypes[kind])
        hidden = [identifier for _, identifier, _ in numbers]
        before = instancer.GetInvisibleIdsAttr().Get(first_time(stage)) or ()
        instancer.CreateInvisibleIdsAttr([*before, *hidden])


def _copy_transform(source: UsdGeom.Xformable, target: UsdGeom.Xformable) -> None:
    """The operations of the instancer, with their samples."""
    for operation in source.GetOrderedXformOps():
        attribute = operation.GetAttr()
        suffix = ":".join(operation.SplitName()[2:])
        copy = target.AddXformOp(operation.GetOpType(), operation.GetPrecision(), suffix, operation.IsInverseOp())
        if not operation.IsInverseOp():
            _copy_values(attribute, copy.GetAttr(), lambda value: value)
    target.SetResetXformStack(source.GetResetXformStack())


def _place(prim: Usd.Prim, target: UsdGeom.Xform, number: int) -> None:
    """Scale, then turn, then move, as the instancer's arrays say over time."""
    instancer = UsdGeom.PointInstancer(prim)
    float_turns = instancer.GetOrientationsfAttr()
    turns = float_turns if float_turns and float_turns.HasAuthoredValue() else instancer.GetOrientationsAttr()
    precision = UsdGeom.XformOp.PrecisionFloat if turns == float_turns else UsdGeom.XformOp.PrecisionHalf
    single = UsdGeom.XformOp.PrecisionFloat
    for attribute, add, kind in (
        (instancer.GetPositionsAttr(), target.AddTranslateOp, single),
        (turns, target.AddOrientOp, precision),
        (instancer.GetScalesAttr(), target.AddScaleOp, single),
    ):
        if (
            not attribute
            or not attribute.HasAuthoredValue()
            or not len(attribute.Get(first_time(prim.GetStage())) or ())
        ):
            continue

        def own(values: object, attribute: Usd.Attribute = attribute) -> object:
            if values is None or number >= len(values):
                value = f"{len(values or ())} values"
                limit = "as many in all frames: each instance is a body that stays"
                raise _fault(prim, attribute.GetName(), value, limit, "ChangingInstances")
            return values[number]

        _copy_values(attribute, add(kind).GetAttr(), own)


def _copy_values(source: Usd.Attribute, target: Usd.Attribute, own) -> None:
    """Default and samples, each as `own` has it."""
    times = source.GetTimeSamples()
    for time in times:
        target.Set(own(source.Get(time)), time)
    if not times:
        target.Set(own(source.Get()))
