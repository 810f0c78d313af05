# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameter table of the solver (parameters.json, put in by `./eulerfsi package blender`), as Blender shows it."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

SCOPES = ("domain", "solid", "emitter", "force", "collider")
# What the object itself says: the size of a box, the surface of a mesh, whether it has a role.
FROM_OBJECT = {("domain", "size"), ("solid", "surfaceFile"), ("solid", "enabled"), ("collider", "enabled")}
_TINY = 1e-6  # stands for a lower limit that is not allowed itself


@cache
def rows(scope: str) -> dict[str, dict[str, Any]]:
    """{name of the Blender property: row of the table} of one scope, in the order of the table."""
    data = json.loads(Path(__file__).with_name("parameters.json").read_text(encoding="utf-8"))
    return {
        snake(row["name"]): row
        for row in data["parameters"]
        if row["scope"] == scope and (scope, row["name"]) not in FROM_OBJECT
    }


def is_advanced(row: dict[str, Any]) -> bool:
    """Whether an artist rarely needs it: shown below "Advanced"."""
    return row.get("advanced", False)


def snake(name: str) -> str:
    """ "voxelSize" -> "voxel_size"."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def shown_unit(row: dict[str, Any]) -> str:
    """Unit in which Blender shows a value: SI, and degrees."""
    return "degrees/s" if row.get("stage_unit") == "degrees" else row.get("unit", "")


def label(row: dict[str, Any]) -> str:
    """Name beside the value."""
    unit = shown_unit(row)
    return f"{row['label']} ({unit})" if unit else row["label"]


def limits(row: dict[str, Any]) -> dict[str, float]:
    """Arguments min, max, soft_min, soft_max of a number's property."""
    low, high = row["hard"]
    result = {"soft_min": row["soft"][0], "soft_max": row["soft"][1]}
    if low is not None:
        result["min"] = low + _TINY if row.get("min_exclusive") else low
    if high is not None:
        result["max"] = high
    result["soft_min"] = max(result["soft_min"], result.get("min", result["soft_min"]))
    return result


def named(name: str) -> str:
    """Name of the property that shows the values of a number by name."""
    return f"{name}_by_name"


def choices(row: dict[str, Any]) -> list[tuple[str, str, float | None]]:
    """(identifier, label, value) of a number whose values have names: its default, those, and None for any other."""
    names = [(word.upper(), word.capitalize(), value) for word, value in row["names"].items()]
    return [("DEFAULT", "Default", row["default"]), *names, ("CUSTOM", "Custom", None)]


def choice_of(row: dict[str, Any], value: float) -> int:
    """Number of the choice that a value is."""
    found = [number for number, (_, _, choice) in enumerate(choices(row)) if choice == plain(value)]
    return found[0] if found else len(choices(row)) - 1


def plain(value: Any) -> Any:
    """A property's value for JSON. Blender has single precision: 0.3 is 0.30000001192 there, and becomes 0.3 again."""
    if isinstance(value, bool | str | int):
        return value
    if isinstance(value, float):
        return float(f"{value:.7g}")
    return [float(f"{component:.7g}") for component in value]
