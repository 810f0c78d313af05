"""`--set PRIM.ATTR=VALUE`: one attribute of the scene changed for this run, on the stage's session layer."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from eulerfsi_usd import standard
from eulerfsi_usd.deformables import body_at, find_bodies
from pxr import Sdf, Usd

from ..errors import UsageError
from ..parameters import NAMESPACE, table
from .instancers import instances_layer
from .values import SOLID_API, applied_scopes

_TYPES = {
    "double": Sdf.ValueTypeNames.Double,
    "bool": Sdf.ValueTypeNames.Bool,
    "int": Sdf.ValueTypeNames.Int,
    "token": Sdf.ValueTypeNames.Token,
    "string": Sdf.ValueTypeNames.String,
    "asset": Sdf.ValueTypeNames.Asset,
    "vector": Sdf.ValueTypeNames.Vector3d,
    "point": Sdf.ValueTypeNames.Point3d,
}
_BOOLS = {"true": True, "1": True, "on": True, "false": False, "0": False, "off": False}


def apply_overrides(stage: Usd.Stage, settings: Iterable[str], option: str = "--set") -> dict[str, str]:
    """Applies settings in order; returns {"/Prim.attribute": value text}. option: where they come from, for messages.

    Raises UsageError that suggests the nearest names for an unknown prim or attribute.
    """
    applied: dict[str, str] = {}
    prims = [prim for prim in stage.TraverseAll() if applied_scopes(prim)]
    prims += [body.prim for body in find_bodies(stage) if not body.schemas]
    made = instances_layer(stage)
    prims.sort(key=lambda prim: bool(made and made.GetPrimAtPath(prim.GetPath())))  # by name the prototype comes first
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for setting in settings:
            target, equals, text = setting.partition("=")
            prim_name, dot, name = target.rpartition(".")
            where = f"{option} {setting}"
            if not (equals and dot and prim_name and name):
                raise UsageError(f"{where}: must read PRIM.ATTR=VALUE, for example Domain.voxelSize=0.01")
            prim = _find_prim(prims, prim_name.strip(), where, made)
            attribute = _set(prim, name.strip(), text.strip(), where)
            applied[f"{prim.GetPath()}.{attribute}"] = text.strip()
    return applied


def set_domain_parameter(stage: Usd.Stage, name: str, text: str) -> dict[str, str]:
    """One parameter of the scene's domain, as `--set` would; nothing where there is no domain (checked later)."""
    domains = [prim for prim in stage.TraverseAll() if "domain" in applied_scopes(prim)]
    return apply_overrides(stage, [f"{domains[0].GetPath()}.{name}={text}"]) if domains else {}


def _suggest(name: str, options: list[str]) -> str:
    near = difflib.get_close_matches(name, options, 3, 0.5)
    lowered = [option for option in options if option.lower() == name.lower()]
    near = list(dict.fromkeys(lowered + near))
    return f"; did you mean {' or '.join(near)}?" if near else f"; there are: {', '.join(options) or 'none'}"


def _find_prim(prims: list[Usd.Prim], name: str, where: str, made: Sdf.Layer | None) -> Usd.Prim:
    if name.startswith("/"):
        found = [prim for prim in prims if str(prim.GetPath()) == name]
    else:
        found = [prim for prim in prims if prim.GetName() == name]
        if found and made and not made.GetPrimAtPath(found[0].GetPath()):
            found = [prim for prim in found if not made.GetPrimAtPath(prim.GetPath())]
    if len(found) > 1:
        raise UsageError(
            f"{where}: give the path, several prims are named {name}: {', '.join(str(p.GetPath()) for p in found)}"
        )
    if not found:
        options = [str(p.GetPath()) if name.startswith("/") else p.GetName() for p in prims]
        raise UsageError(f"{where}: no domain, solid, emitter or force is named {name}{_suggest(name, options)}")
    return found[0]


def _set(prim: Usd.Prim, name: str, text: str, where: str) -> str:
    """Authors the value; returns the attribute's name."""
    known = {}
    body = body_at(prim)
    for scope in applied_scopes(prim) or (["solid"] if body else []):
        known.update(table()[scope])
    short = name.removeprefix(NAMESPACE)
    parameter = known.get(short) or next((p for p in known.values() if p.attribute == name), None)
    if parameter is None:
        raise UsageError(f"{where}: {prim.GetPath()} has no parameter {name}{_suggest(short, list(known))}")
    try:
        value = parameter.names[text] if text in parameter.names else _parse(parameter.type, text)
    except ValueError as error:
        names = f" nor one of {', '.join(parameter.names)}" if parameter.names else ""
        raise UsageError(f"{where}: {text!r} is not a value of type {parameter.type}{names}{error}") from None
    if parameter.type == "token" and text not in parameter.tokens:
        raise UsageError(f"{where}: {text!r} is not one of {', '.join(parameter.tokens)}")
    if not applied_scopes(prim):
        prim.AddAppliedSchema(SOLID_API)
    attribute = prim.GetAttribute(parameter.attribute)
    if not attribute:
        attribute = prim.CreateAttribute(parameter.attribute, _TYPES[parameter.type], custom=False)
    attribute.Set(value)
    if parameter.attribute == "physics:density" and prim.GetAttribute("physics:mass").HasAuthoredValue():
        prim.GetAttribute("physics:mass").Set(0.0)  # a mass would win over the density that was just asked for
    masses = body.sim.GetAttribute(f"physics:{standard.MASSES}") if body else None
    if parameter.attribute == "physics:density" and masses:
        masses.Set([])
    return parameter.attribute


def _parse(kind: str, text: str) -> Any:
    if kind in ("double", "int"):
        return _number(text, float if kind == "double" else int)
    if kind == "bool":
        if text.lower() not in _BOOLS:
            raise ValueError(" (true or false)")
        return _BOOLS[text.lower()]
    if kind in ("vector", "point"):
        parts = text.strip("()[]").replace(",", " ").split()
        if len(parts) != 3:
            raise ValueError(" (three numbers, for example 0,-2,0)")
        return tuple(_number(part, float) for part in parts)
    if kind == "asset":
        return Sdf.AssetPath(text)
    return text


def _number(text: str, kind: type[float] | type[int]) -> float | int:
    try:
        return kind(text)
    except ValueError:
        raise ValueError(" (a number)" if kind is float else " (a whole number)") from None
