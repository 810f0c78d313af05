"""Attribute values of a stage at one time, in SI, and which prims have which of the schemas."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from eulerfsi_usd.issues import all_prims
from eulerfsi_usd.parameters import API_SCHEMAS
from pxr import Usd, UsdGeom, UsdPhysics

from ..parameters import Parameter, StageUnits, table
from ..solver import binding

DOMAIN_API, SOLID_API, EMITTER_API, FORCE_API = (
    API_SCHEMAS[scope] for scope in ("domain", "solid", "emitter", "force")
)
APIS = {api: scope for scope, api in API_SCHEMAS.items()}
_TOKENS = {
    "preset": binding.PRESETS,
    "material": binding.MATERIALS,
    "mode": binding.EMITTER_MODES,
    "kind": binding.FORCE_KINDS,
    "actsOn": binding.ACTS_ON,
}


def applied_scopes(prim: Usd.Prim) -> list[str]:
    """Scopes of the parameter table ("domain", "solid", "emitter", "force") whose API is applied to the prim."""
    schemas = prim.GetAppliedSchemas()
    return [scope for api, scope in APIS.items() if api in schemas]


def find_prims(stage: Usd.Stage, scope: str) -> list[Usd.Prim]:
    """Prims of one scope in stage order, instance proxies included."""
    return [prim for prim in all_prims(stage) if scope in applied_scopes(prim)]


def stage_units(stage: Usd.Stage) -> StageUnits:
    """Units of a stage."""
    return StageUnits(UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage))


class Reader:
    """Reads attribute values at one time and converts them to SI.

    voxel: size of the grid's cells [m], to which smooth surfaces are refined; 0: they stay cages.
    """

    def __init__(self, units: StageUnits, time: Usd.TimeCode, voxel: float = 0.0) -> None:
        self.units = units
        self.time = time
        self.voxel = voxel

    def value(self, prim: Usd.Prim, parameter: Parameter) -> Any:
        """The authored value in SI, or the table's default (which is SI already) where nothing is authored."""
        attribute = prim.GetAttribute(parameter.attribute)
        if not attribute or not attribute.HasAuthoredValue():
            return parameter.default
        raw = attribute.Get(self.time)
        if parameter.type == "token":
            return str(raw)
        if parameter.type in ("bool", "asset") or raw == -math.inf:  # -inf: "use the default"
            return parameter.default if raw == -math.inf else raw
        factor = self.units.factor(parameter.stage_unit)
        return [float(c) * factor for c in raw] if parameter.type == "vector" else float(raw) * factor

    def fields(self, prim: Usd.Prim, scope: str) -> dict[str, Any]:
        """{C field: SI value} of the parameters that map to one; vectors stay in world axes."""
        result = {}
        for parameter in table()[scope].values():
            if not parameter.field or parameter.usd_physics:
                continue
            value = self.value(prim, parameter)
            if parameter.type == "token":
                value = binding.WALLS[value] if parameter.name.startswith("wall") else _TOKENS[parameter.name][value]
            elif parameter.type == "bool":
                value = int(value)
            result[parameter.field] = value
        return result

    def authored(self, prim: Usd.Prim, name: str) -> Any:
        """Authored value of any attribute, None where there is none."""
        attribute = prim.GetAttribute(name)
        return attribute.Get(self.time) if attribute and attribute.HasAuthoredValue() else None

    def local_to_world(self, prim: Usd.Prim) -> np.ndarray:
        """(4, 4) for row vectors, at this reader's time."""
        return np.array(UsdGeom.XformCache(self.time).GetLocalToWorldTransform(prim))
