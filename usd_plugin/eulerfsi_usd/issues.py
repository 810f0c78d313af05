"""What a check finds: one Issue per fault, and helpers that read values from a stage."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pxr import Gf, Sdf, Usd, UsdGeom

from .parameters import API_SCHEMAS, SCOPES

_LISTED = 3


@dataclass(frozen=True)
class Issue:
    """One fault of a scene.

    prim: path, "/" for the stage. field: attribute, metadata or schema. value: what was found, as text. limit: what is
    allowed, as text. message: a sentence that holds all of these. severity: "error" or "warning". code: short name of
    the rule.
    """

    prim: str
    field: str
    value: str
    limit: str
    message: str
    severity: str
    code: str


def make_issue(
    prim: Usd.Prim | None, field: str, value: object, limit: str, code: str, hint: str = "", severity: str = "error"
) -> Issue:
    """Issue with the message "<prim>.<field> = <value>: must be <limit>[ (<hint>; in <file other than the scene>)]"."""
    path = str(prim.GetPath()) if prim else "/"
    text = format_value(value)
    where = f"{path}.{field}" if prim else f"stage {field}"
    notes = [note for note in (hint, _written_in(prim, field) if prim else "") if note]
    message = f"{where} = {text}: must be {limit}" + (f" ({'; '.join(notes)})" if notes else "")
    return Issue(path, field, text, limit, message, severity, code)


def _written_in(prim: Usd.Prim, field: str) -> str:
    """The layer that an attribute has its value from, where that is another than the scene's own; else ""."""
    attribute = prim.GetAttribute(field)
    stack = attribute.GetPropertyStack(Usd.TimeCode.Default()) if attribute else []
    if not stack or stack[0].layer.anonymous or stack[0].layer == prim.GetStage().GetRootLayer():
        return ""
    return f"in {stack[0].layer.GetDisplayName()}"


def format_value(value: object) -> str:
    """Short text of a value: "missing" for None, 6 digits for numbers."""
    if value is None:
        return "missing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Sdf.AssetPath):
        return f"@{value.path}@"
    if isinstance(value, (tuple, list, Gf.Vec3d, Gf.Vec3f, Gf.Vec3h, Gf.Vec3i)):
        return f"({', '.join(format_value(x) for x in value)})"
    return str(value)


def listed(names: Sequence[object]) -> str:
    """The first of many names, and how many more there are."""
    more = len(names) - _LISTED
    return ", ".join(map(str, names[:_LISTED])) + (f" and {more} more" if more > 0 else "")


def all_prims(stage: Usd.Stage) -> Iterable[Usd.Prim]:
    """Prims that are there, those inside instances too, in stage order; not what only a PointInstancer shows.

    That is what lies below it, and prototypes elsewhere that are invisible.
    """
    found, hidden = [], set()
    prims = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)))
    for prim in prims:
        if prim.IsA(UsdGeom.PointInstancer):
            prims.PruneChildren()
            hidden |= set(UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets())
        found.append(prim)
    hidden = {path for path in hidden if _is_invisible(stage.GetPrimAtPath(path))}
    return [prim for prim in found if not any(prim.GetPath().HasPrefix(path) for path in hidden)]


def _is_invisible(prim: Usd.Prim) -> bool:
    time = first_time(prim.GetStage()) if prim else None
    return bool(prim) and UsdGeom.Imageable(prim).ComputeVisibility(time) == UsdGeom.Tokens.invisible


def instance_above(prim: Usd.Prim) -> Usd.Prim:
    """The outermost instance that an instance proxy lies in: what is to be made no instance to author the proxy."""
    above = prim
    while above.IsInstanceProxy():
        above = above.GetParent()
    return above


def scopes_of(prim: Usd.Prim) -> list[str]:
    """Scopes whose schema is applied to the prim, whether or not the plug-in was registered in time."""
    applied = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
    return [scope for scope in SCOPES if API_SCHEMAS[scope] in applied]


def first_time(stage: Usd.Stage) -> Usd.TimeCode:
    """Time at which the scene is read: its first time code."""
    authored = stage.HasAuthoredTimeCodeRange()
    return Usd.TimeCode(stage.GetStartTimeCode()) if authored else Usd.TimeCode.EarliestTime()


def read(prim: Usd.Prim, name: str) -> object:
    """Value of an attribute at the first time, None where it has neither an opinion nor a fallback."""
    attribute = prim.GetAttribute(name)
    return attribute.Get(first_time(prim.GetStage())) if attribute else None


def slab_axis(domain: Usd.Prim) -> int | None:
    """The axis along which a domain is one voxel thick between slip walls: a 2-D scene; None: there is none."""
    edges, matrix = domain_box(domain)
    voxel = read(domain, "eulerfsi:voxelSize")
    if not isinstance(voxel, (int, float)) or not 0.0 < voxel < math.inf:
        return None
    for axis in (2, 1, 0):
        thin = abs(edges[axis] * matrix.GetRow3(axis).GetLength() / voxel - 1.0) < 1e-4
        walls = {read(domain, f"eulerfsi:wall{'XYZ'[axis]}{side}") for side in ("Min", "Max")}
        if thin and walls == {"slip"}:
            return axis
    return None


def is_enabled(prim: Usd.Prim) -> bool:
    """False when eulerfsi:enabled is authored and off."""
    return read(prim, "eulerfsi:enabled") is not False


def is_ever_enabled(prim: Usd.Prim) -> bool:
    """False when it is off at the start and no time sample switches it on."""
    attribute = prim.GetAttribute("eulerfsi:enabled")
    samples = attribute.GetTimeSamples() if attribute else []
    return is_enabled(prim) or any(attribute.Get(time) for time in samples)


def domain_box(prim: Usd.Prim) -> tuple[tuple[float, float, float], Gf.Matrix4d]:
    """Edge lengths of the domain's box in its local space (centred at the origin) and its local-to-world matrix."""
    if prim.IsA(UsdGeom.Cube):
        size = float(read(prim, "size"))
        edges = (size, size, size)
    else:
        edges = tuple(float(x) for x in read(prim, "eulerfsi:size") or (0.0, 0.0, 0.0))
    return edges, UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(first_time(prim.GetStage()))
