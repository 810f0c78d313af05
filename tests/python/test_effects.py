"""Pictures of what parameters do: the page is that of effects.toml, its rows are parameters, values have an effect."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from conftest import ROOT

pytest.importorskip("matplotlib")
sys.path.insert(0, str(ROOT / "examples" / "render"))

import effect_runs  # noqa: E402
import make_effects  # noqa: E402

EFFECTS = {effect["name"]: effect for effect in make_effects.effects()}
TABLE = json.loads((ROOT / "usd_plugin/eulerfsi_usd/parameters.json").read_text())["parameters"]


def test_page_is_made_from_the_table() -> None:
    assert make_effects.PAGE.read_text(encoding="utf-8") == make_effects.page()


def test_rows_are_parameters_and_their_values_differ() -> None:
    known = {f"{row['scope']}.{row['name']}" for row in TABLE}
    shown = {row for effect in EFFECTS.values() for row in effect["rows"]}
    assert shown <= known and {"solid.youngsModulus", "solid.density", "domain.voxelSize"} <= shown
    for effect in EFFECTS.values():
        values = [json.dumps({**variant, "label": ""}) for variant in effect["variants"]]
        assert len(set(values)) == len(values) >= 2, effect["name"]


def test_every_row_has_a_small_picture() -> None:
    files = list(make_effects.PICTURES.iterdir())
    assert {file.name for file in files} == {f"{name}.webp" for name in EFFECTS}
    assert max(file.stat().st_size for file in files) < 100_000


@pytest.mark.parametrize("name, least", [("youngs_modulus", 0.02), ("density", 0.08), ("temperature_buoyancy", 0.01)])
def test_what_is_said_is_seen(library, tmp_path, name, least) -> None:
    """Stiffer blocks are squeezed less, denser ones lie lower, hotter smoke is higher; and there is a picture of it."""
    effect = EFFECTS[name]
    if name == "temperature_buoyancy":
        effect = effect | {"frames": 10, "show": 10}
    runs = [effect_runs.run(effect, variant) for variant in effect["variants"]]
    states = [make_effects.chosen(effect, frames) for frames in runs]
    if name == "youngs_modulus":
        seen = [np.ptp(state.outline[:, 1]) for state in states]
    elif name == "density":
        seen = [-state.outline[:, 1].mean() for state in states]
    else:
        rows = np.arange(len(states[0].smoke)) / len(states[0].smoke)
        seen = [(state.smoke.sum(axis=1) * rows).sum() / state.smoke.sum() for state in states]
    assert np.diff(seen).min() > least, seen
    make_effects.draw(effect, runs, tmp_path / "picture.webp")
    assert 1_000 < (tmp_path / "picture.webp").stat().st_size < 100_000
