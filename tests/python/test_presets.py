"""Materials by name."""

from __future__ import annotations

import pytest
from eulerfsi_usd.parameters import load
from eulerfsi_usd.presets import presets, values_of


@pytest.mark.parametrize("name", ["rubber", "jelly", "flesh", "foam", "clay"])
def test_a_preset_sets_rows_within_their_limits(name: str) -> None:
    rows, preset = load()["solid"], presets()[name]
    assert preset.label and preset.behaves and not preset.behaves.endswith(".")
    for row, value in preset.values.items():
        assert rows[row].type == ("bool" if isinstance(value, bool) else "double")
        assert isinstance(value, bool) or rows[row].allows(value)
    values = values_of(name, 0.2)
    assert preset.values.items() <= values.items() and set(values) <= set(rows)
    assert {row: rows[row].default for row in set(values) - set(preset.values)}.items() <= values.items()


def test_moduli_grow_with_the_object_and_nothing_else_does() -> None:
    small, large = values_of("clay", 0.2), values_of("clay", 0.6)
    assert large["youngsModulus"] == 3 * small["youngsModulus"] == 300000.0
    assert large["plasticYieldStress"] == 3 * small["plasticYieldStress"]
    assert {k: v for k, v in large.items() if load()["solid"][k].unit != "Pa"}.items() <= small.items()


def test_a_preset_leaves_motion_and_surface_alone() -> None:
    kept = {"enabled", "surfaceFile", "velocity", "angularVelocity", "stretch", "contactStiffness"}
    assert set(values_of("jelly", 1.0)) == set(load()["solid"]) - kept
