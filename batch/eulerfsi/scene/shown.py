"""Values that a run used, as people read them: names as on a stage, units, tokens."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..parameters import Parameter, table
from ..solver import binding

# What a prim is, by a field that only such prims have; the first that fits.
_KINDS = {
    "domain": "voxel_size",
    "solid": "youngs_modulus",
    "force": "acts_on",
    "emitter": "mode",
    "passenger": "carried_by",
    "pin": "driver",
    "collider": "friction",
}
# Fields that are no parameters: they follow from prims.
_UNITS = {"domain_min": "m", "domain_size": "m", "gravity": "m/s^2"}


def kind_of(values: dict[str, Any]) -> str:
    """What a prim is. values: {field of the C definition: SI value}, as a manifest holds them."""
    return next((name for name, field in _KINDS.items() if field in values), "prim")


def parameter_rows(values: dict[str, Any]) -> tuple[str, list[tuple[str, str]]]:
    """What a prim is, and the name and text of every value that a run used."""
    kind = kind_of(values)
    return kind, [row for field, value in values.items() for row in shown(kind, field, value)]


def shown(kind: str, field: str, value: Any) -> list[tuple[str, str]]:
    """Name and text of a value; two of a transform. What has no row in the parameter table is named by its field."""
    if field == "transform":
        corner = np.reshape(value, (4, 4))
        edges = np.linalg.norm(corner[:3, :3], axis=0)
        return [("center", f"{_text(corner[:3, 3])} m"), ("edges", f"{_text(edges)} m")]
    row = row_of(kind, field)
    name, unit = (row.name, row.unit) if row else (field.replace("_", " "), _UNITS.get(field, ""))
    return [(name, f"{_text(_token(field, row, value))} {unit}".rstrip())]


def row_of(kind: str, field: str) -> Parameter | None:
    """The row of the parameter table."""
    return next((row for row in table().get(kind, {}).values() if row.field == field and field), None)


def _token(field: str, row: Parameter | None, value: Any) -> Any:
    """A number of the C API as the name that a stage has for it."""
    if field == "shape":
        return next(name for name, number in binding.REGION_SHAPES.items() if number == value)
    if row and row.type == "token":
        return row.tokens[value]
    return bool(value) if row and row.type == "bool" else value


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, (list, tuple, np.ndarray)):
        return f"({', '.join(f'{float(x):.6g}' for x in value)})"
    return f"{value:.6g}" if isinstance(value, (int, float)) else str(value)
