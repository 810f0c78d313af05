"""The parameter table as the schema shows it (parameters.json, generated from libeulerfsi/parameters.toml)."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

NAMESPACE = "eulerfsi:"
DENSITY_SCALE = "eulerfsi:densityScale"  # of the Volume of a cache: extinction of smoke of density 1 [1/m]
SCOPES = ("domain", "solid", "emitter", "force", "collider")
API_SCHEMAS = {scope: f"EulerFsi{scope.title()}API" for scope in SCOPES}

Value = bool | float | str | tuple[float, float, float]


@dataclass(frozen=True)
class Parameter:
    """One row of the table.

    `default` and the limits are SI; a hard limit other than 0 belongs to a quantity without stage units, so limits hold
    for values on a stage too. `least`: the least value other than 0; `names`: of values. `usd_type` is the Sdf type
    name of the attribute; `animated`: its time samples count.
    """

    scope: str
    name: str
    type: str
    usd_type: str
    default: Value
    hard_min: float
    hard_max: float
    min_exclusive: bool
    least: float
    tokens: tuple[str, ...]
    names: dict[str, float]
    unit: str
    stage_unit: str
    usd_physics: bool
    animated: bool
    label: str
    doc: str

    @property
    def attribute(self) -> str:
        """Name of the USD attribute."""
        return f"physics:{self.name}" if self.usd_physics else NAMESPACE + self.name

    @property
    def depends_on_stage_units(self) -> bool:
        """The default is a length or a density, so the fallback of the schema is -inf: "use the default"."""
        return self.type == "double" and self.stage_unit not in ("", "degrees") and self.default != 0.0

    def limit_text(self) -> str:
        """Hard limits in words, such as "> 0 and <= 4"; "finite" where there are none."""
        if self.least:
            return f"0, or >= {self.least:g} and <= {self.hard_max:g}"
        low = "" if self.hard_min == -math.inf else f"{'>' if self.min_exclusive else '>='} {self.hard_min:g}"
        high = "" if self.hard_max == math.inf else f"<= {self.hard_max:g}"
        return " and ".join(text for text in (low, high) if text) or "finite"

    def allows(self, value: float) -> bool:
        """True when a number (or one component of a vector) is finite and within the hard limits."""
        above = value > self.hard_min if self.min_exclusive else value >= self.hard_min
        return math.isfinite(value) and above and not 0 < value < self.least and value <= self.hard_max


def _limits(row: dict) -> tuple[float, float]:
    low, high = row.get("hard", (None, None))
    return (-math.inf if low is None else low, math.inf if high is None else high)


@cache
def load() -> dict[str, dict[str, Parameter]]:
    """{scope: {name: Parameter}} in the order of the table."""
    data = json.loads(Path(__file__).with_name("parameters.json").read_text(encoding="utf-8"))
    table: dict[str, dict[str, Parameter]] = {scope: {} for scope in SCOPES}
    for row in data["parameters"]:
        low, high = _limits(row)
        table[row["scope"]][row["name"]] = Parameter(
            scope=row["scope"],
            name=row["name"],
            type=row["type"],
            usd_type=row["usd_type"],
            default=tuple(row["default"]) if row["type"] == "vector" else row["default"],
            hard_min=low,
            hard_max=high,
            min_exclusive=row.get("min_exclusive", False),
            least=row.get("least", 0.0),
            tokens=tuple(row.get("tokens", ())),
            names=row.get("names", {}),
            unit=row.get("unit", ""),
            stage_unit=row.get("stage_unit", ""),
            usd_physics=row.get("usd_physics", False),
            animated=row.get("animated", False),
            label=row["label"],
            doc=row["doc"],
        )
    return table


@cache
def prim_types() -> dict[str, tuple[str, ...]]:
    """Prim types that the schema of each scope applies to."""
    data = json.loads(Path(__file__).with_name("parameters.json").read_text(encoding="utf-8"))
    return {scope: tuple(types) for scope, types in data["prim_types"].items()}


def stage_attributes(scope: str) -> dict[str, Parameter]:
    """{attribute name: Parameter} of the attributes that the schema of one scope adds."""
    return {row.attribute: row for row in load()[scope].values() if not row.usd_physics}


@cache
def stage_relationships(scope: str) -> tuple[str, ...]:
    """Names of the relationships that the schema of one scope adds."""
    data = json.loads(Path(__file__).with_name("parameters.json").read_text(encoding="utf-8"))
    return tuple(NAMESPACE + name for name in data["relationships"][scope])
