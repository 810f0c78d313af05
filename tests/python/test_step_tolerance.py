"""What docs/accuracy.md says of `eulerfsi:stepTolerance`: how balls, soft and hard, rebound from a floor."""

from __future__ import annotations

import re

import pytest
from conftest import ROOT, sphere
from eulerfsi.parameters import table
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Mesh, Simulation

SIZE, SPEED, FRAME, SHEAR = 0.2, 2.0, 1 / 24, 1 / 2.6
NAMES = table()["domain"]["stepTolerance"].names
TEXT = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
ROW = r"^\| (\d+) kPa \| .* \| 8 \| (-?[\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$"
TABLE = {1e3 * float(kilo): tuple(map(float, rest)) for kilo, *rest in re.findall(ROW, TEXT, re.MULTILINE)}
UNSURE = 0.1  # of a rebound, which the last bits of a hard impact decide


def rebound(modulus: float, **settings: float) -> float:
    """Speed after an impact in vacuum over that before it, 8 cells across, in steps of at most a frame."""
    points, counts, indices = sphere(SIZE / 2, 24)
    box = {"domain_min": (-0.3, -0.12, -0.3), "domain_size": (0.6, 0.8, 0.6), "gravity": (0.0, 0.0, 0.0)}
    with Simulation({"voxel_size": SIZE / 8, "ambient_fluid": 0, "threads": 1, **box, **settings}) as simulation:
        values = {"density": 1000.0, "youngs_modulus": modulus, "velocity": (0.0, -SPEED, 0.0)}
        solid, _ = simulation.add_solid(Mesh(points, counts, indices), **values)
        end = 0.02 / SPEED + max(10 * SIZE / (SHEAR * modulus / 1000.0) ** 0.5, FRAME)
        fastest = -SPEED
        while simulation.time < end - 1e-9:
            simulation.advance(FRAME)
            facts = simulation.solid_diagnostics(solid)
            fastest = max(fastest, facts["momentum"][1] / facts["mass"])
    return fastest / SPEED


@pytest.mark.parametrize("modulus", TABLE)
def test_rebounds_are_as_the_documentation_says(library, modulus: float) -> None:
    *told, short = TABLE[modulus]
    choices = {"preset": binding.PRESETS["fast"]}, *({"step_tolerance": NAMES[n]} for n in ("loose", "normal", "fine"))
    found = [rebound(modulus, **choice) for choice in choices]
    assert found == pytest.approx(told, abs=UNSURE)
    for values in (told, found):
        assert short - values[2] <= (0.11 if modulus <= 1e5 else 0.3)
        assert short - values[3] <= (0.03 if modulus <= 1e5 else 0.15)


def test_normal_is_what_production_does_by_itself(library) -> None:
    assert rebound(1e7) == rebound(1e7, step_tolerance=NAMES["normal"])


def test_the_table_has_soft_and_hard_balls() -> None:
    assert min(TABLE) == 2e4 and max(TABLE) == 1e8 and len(TABLE) == 5
