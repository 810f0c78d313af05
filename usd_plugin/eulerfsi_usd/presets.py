"""Materials by name (presets.json): what sets the values of a solid in the Houdini asset and the Blender extension."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from .parameters import Value, load


@dataclass(frozen=True)
class Preset:
    """A material. behaves: one line for artists; values: {name of a row of the solid: value in SI}."""

    label: str
    behaves: str
    values: dict[str, float | bool]


@cache
def _data() -> dict:
    return json.loads(Path(__file__).with_name("presets.json").read_text(encoding="utf-8"))


DEFAULT_SIZE = float(_data()["size"])  # of the object that the moduli of the table are for, in metres


@cache
def presets() -> dict[str, Preset]:
    """{name: Preset}."""
    return {name: Preset(**entry) for name, entry in _data()["presets"].items()}


def values_of(name: str, size: float) -> dict[str, Value]:
    """{row: value} that a preset sets on a solid whose longest side is that many metres."""
    data, preset = _data(), presets()[name]
    result: dict[str, Value] = {}
    for row in load()["solid"].values():
        if row.name in data["kept"]:
            continue
        value = preset.values.get(row.name, row.default)
        factor = size / data["size"] if row.unit == "Pa" else 1.0
        result[row.name] = float(f"{value * factor:.3g}") if factor != 1.0 else value
    return result
