# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials by name (presets.json, put in by `./eulerfsi package blender`), in the names of Blender's properties."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from . import table


class Preset(NamedTuple):
    """A material. behaves: one line for artists; values: {name of the Blender property: SI value}."""

    label: str
    behaves: str
    values: dict[str, float | bool]


_DATA = json.loads(Path(__file__).with_name("presets.json").read_text(encoding="utf-8"))
SIZE = _DATA["size"]  # of the object that the moduli are for, in metres
KEPT = {table.snake(name) for name in _DATA["kept"]}  # properties that no preset sets
PRESETS = {
    name.upper(): Preset(entry["label"], entry["behaves"], {table.snake(n): v for n, v in entry["values"].items()})
    for name, entry in _DATA["presets"].items()
}
