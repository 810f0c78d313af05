"""The parameter table (parameters.toml) and the conversion of stage values to SI."""

from __future__ import annotations

import dataclasses
import functools
import math
import re
import tomllib
from typing import Any

from . import paths

NAMESPACE = "eulerfsi:"


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One row of the table. `default` and `hard` are SI; `field` is the member of the C definition.
    names: of values, which `--set` takes too; initial: it acts at the start alone."""

    scope: str
    name: str
    field: str
    type: str
    default: Any
    stage_unit: str = ""
    hard: tuple[float, float] = (-math.inf, math.inf)
    min_exclusive: bool = False
    tokens: tuple[str, ...] = ()
    names: dict[str, float] = dataclasses.field(default_factory=dict)
    usd_physics: bool = False
    unit: str = ""
    animated: bool = False
    initial: bool = False

    @property
    def attribute(self) -> str:
        """Name of the USD attribute."""
        return ("physics:" if self.usd_physics else NAMESPACE) + self.name

    def limit_text(self) -> str:
        """The hard limits in words, '' when there are none."""
        low, high = self.hard
        texts = []
        if low > -math.inf:
            texts.append(f"{'>' if self.min_exclusive else '>='} {low:g}")
        if high < math.inf:
            texts.append(f"<= {high:g}")
        return " and ".join(texts)


@functools.cache
def table() -> dict[str, dict[str, Parameter]]:
    """{"domain" | "solid" | "emitter" | "force": {name: Parameter}}, in the order of the file."""
    with open(paths.parameter_table(), "rb") as file:
        data = tomllib.load(file)
    result: dict[str, dict[str, Parameter]] = {}
    for scope, section in data.items():
        if not isinstance(section, dict) or "parameter" not in section:
            continue
        rows = {}
        for row in section["parameter"]:
            known = {f.name for f in dataclasses.fields(Parameter)}
            kept = {key: tuple(v) if key in ("hard", "tokens") else v for key, v in row.items() if key in known}
            rows[row["name"]] = Parameter(scope=scope, **kept)
        result[scope] = rows
    return result


@dataclasses.dataclass(frozen=True)
class StageUnits:
    """Size of the stage's units in SI."""

    meters_per_unit: float
    kilograms_per_unit: float

    def factor(self, stage_unit: str) -> float:
        """What a stage value is multiplied with to be SI. "m^1 kg^-2": powers of the stage's units;
        "degrees": to radians; "": as is. "local" (a length in the prim's own space) is left to the caller.
        """
        if stage_unit in ("", "local"):
            return 1.0
        if stage_unit == "degrees":
            return math.pi / 180.0
        result = 1.0
        for name, power in re.findall(r"(\w+)\^(-?\d+)", stage_unit):
            base = {"m": self.meters_per_unit, "kg": self.kilograms_per_unit}[name]
            result *= base ** int(power)
        return result
