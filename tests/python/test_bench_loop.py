"""The laboratory `bench loop`: its shapes, its matrix, its verdicts, and one run from end to end."""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import signal
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

import bench_loop  # noqa: E402
from eulerfsi.solver import binding  # noqa: E402
from eulerfsi.solver.simulation import Surface  # noqa: E402
from loop import energy_laws, given_laws, measure, shapes, survival, table, wall_laws  # noqa: E402
from loop.experiment import Experiment  # noqa: E402
from loop.laws import Line  # noqa: E402
from loop.symmetry import mirror_gaps  # noqa: E402

VOLUMES = {  # m^3
    "ball": 4 / 3 * math.pi * 0.1**3,
    "box": 0.2 * 0.14 * 0.12,
    "torus": 2 * math.pi**2 * 0.07 * 0.03**2,
    "plate": 0.2 * 0.2 * 0.06,
    "u": 0.2 * 0.2 * 0.06 - 0.08 * 0.14 * 0.06,
}


@pytest.mark.parametrize("name", VOLUMES)
def test_shapes_are_closed_and_hold_their_volume(library, name: str) -> None:
    report = Surface(shapes.make_shape(name, 10, turn=0.6), 0.02).report
    assert report["closed"] == 1 and report["repaired"] == 0
    assert report["surface_volume"] == pytest.approx(VOLUMES[name], rel=6e-3)


def test_every_pair_of_choices_meets() -> None:
    rows = survival.pairwise(survival.FACTORS)
    for i, j in itertools.combinations(range(len(survival.FACTORS)), 2):
        assert {(row[i], row[j]) for row in rows} == set(itertools.product(survival.FACTORS[i], survival.FACTORS[j]))
    assert len(rows) <= 40 and rows == survival.pairwise(survival.FACTORS)


def test_crossings_give_the_period_of_a_damped_swing() -> None:
    times = np.linspace(0, 1, 400)
    found = measure.crossings(times, np.exp(-times) * np.cos(2 * np.pi * times / 0.25), 0.05)
    assert np.diff(found) == pytest.approx(np.full(len(found) - 1, 0.125), abs=1e-4)


def test_the_largest_rise_is_found_with_its_steps() -> None:
    rise = measure.largest_rise(np.array([5.0, 3.0, 4.0, 2.0, 2.5, 3.5, 1.0]))
    assert (rise.size, rise.begin, rise.end) == (1.5, 3, 5)
    assert measure.largest_rise(np.array([3.0, 2.0, 2.0])).size == 0


def test_mechanisms_hold_every_column_once() -> None:
    shape = (len(binding.ENERGY_STAGES), len(measure.FORMS))
    columns = np.random.default_rng(1).normal(size=shape)
    parts = energy_laws.by_mechanism(columns)
    empty = columns.copy()  # no stage but the solids' transport moves the fluid's energy
    empty[binding.ENERGY_STAGES.index("solid_transport"), measure.FORMS.index("fluid_kinetic")] = 0
    assert sum(parts.values()) == pytest.approx(empty.sum())


def energy_result(totals: list[float], outside: list[float]) -> measure.Result:
    """A run with these energies at the start of its steps, all of them kinetic, and this outside work in the steps."""
    at_start = np.zeros((len(totals), len(measure.FORMS)))
    at_start[:, 0] = totals
    change = np.zeros((len(totals), len(binding.ENERGY_STAGES), len(measure.FORMS)))
    change[:, binding.ENERGY_STAGES.index("external"), 0] = outside
    columns = {"energy_at_start": at_start, "energy_change": change}
    return measure.Result(Experiment("test"), "", {}, columns)


def test_energy_counts_less_outside_work() -> None:
    result = energy_result([1.0, 1.0, 3.0, 3.0], [0.0, 2.0, 0.0, 0.0])
    assert measure.total_energy(result) == pytest.approx([1.0, 0.0, 1.0, 1.0])  # half of it had been done at 1.0
    assert measure.largest_rise(measure.total_energy(energy_result([2.0, 1.0, 1.5], [0, 0, 0]))).size == 0.5


def survived(run: Experiment) -> measure.Result:
    """Made up: nothing happens in four steps."""
    names = ("degenerate_cells", "retries", "false_edges", "clamped", "rejected", "broken", "repaired_cells")
    still = ("kinetic_energy", "elastic_energy", "fluid_energy", "fluid_carried", "mass", "volume_cells")
    columns = {name: np.zeros(4) for name in (*names, *still)}
    columns |= {name: np.ones((4, 2)) for name in ("det_f_interior", "det_f_before")}
    columns |= {"center": np.ones((4, 3)), "time": np.linspace(0.1, 0.4, 4), "dt": np.full(4, 0.1)}
    start = {name: columns[name][0] for name in (*still, "center")}
    energies = {"energy_at_start": np.ones((4, len(measure.FORMS)))}
    energies["energy_change"] = np.zeros((4, len(binding.ENERGY_STAGES), len(measure.FORMS)))
    return measure.Result(run, "", start, columns | energies)


def test_limbs_of_two_cells_keep_their_energy_when_they_land(library) -> None:
    """A U and its thin limbs, thrown at the floor: slivers that stay elements however strained add 0.58 and 0.9."""
    runs = (run for run in survival.survival_runs("quick") if run.shape == "u" and run.velocity[1] < 0)
    run = next(run for run in runs if run.density_ratio == 10.0)
    result = bench_loop.run_child(dataclasses.replace(run, duration=0.25))
    assert result.finished and energy_laws.share_of_rise(result) < 0.02
    assert result["max_speed_solid"].max() < 8.0  # it arrives at 2.5 m/s


def test_survival_asks_for_whole_meshes_energy_and_a_ledger_that_closes() -> None:
    def missed(results: dict[Experiment, measure.Result]) -> list[str]:
        return [line.bar for line in survival.judge_survival(results, "quick") if line.verdict == "MISSED"]

    made = {run: survived(run) for run in survival.survival_runs("quick")}
    assert missed(made) == []
    closed, opened = (next(result for run, result in made.items() if run.walls == w) for w in ("slip", "openTop"))
    opened.columns["energy_at_start"][2:, 0] += 1.0  # fluid that falls in
    assert missed(made) == []
    closed.columns["energy_at_start"][2:, 0] += 0.2
    bars = missed(made)
    assert len(bars) == 1 and "energy rises" in bars[0]
    closed.columns["elastic_energy"][3] = 0.1
    bars = missed(made)
    assert len(bars) == 2 and "gap" in bars[1]
    closed.columns["false_edges"][1] = 3
    bars = missed(made)
    assert len(bars) == 3 and "edge of the mesh" in bars[2]


def test_solids_are_thrown_at_walls_in_all_sizes_and_pressures_up_to_twice_the_modulus() -> None:
    quick, full = (wall_laws.wall_runs(tier) for tier in ("quick", "full"))
    assert {run.across for run in quick} == {10, 16} and {run.across for run in full} == {10, 16, 24, 40}
    assert len(quick) <= 24 and set(quick) <= set(full)
    for across in (10, 40):
        runs = [run for run in full if run.across == across]
        assert {round(wall_laws.pressure_of(run), 3) for run in runs} == {0.1, 0.5, 1.0, 2.0}
        assert {run.density_ratio for run in runs} == {None, 1000.0} and len({run.dt for run in runs}) == 2


def thrown_result(pressure: float) -> measure.Result:
    """Made up: a ball that is pushed back by the floor and leaves it for good."""
    balls = (run for run in wall_laws.wall_runs("quick") if run.shape == "ball" and run.across == 10)
    run = next(run for run in balls if wall_laws.pressure_of(run) == pytest.approx(pressure))
    times = np.arange(0, 0.4, 0.005)
    speed = np.where(times < 0.1, -2.0, 1.5 - 2.0 * (times - 0.1))
    height = np.where(times < 0.1, 0.3 - 2.0 * times, 0.1 + 1.5 * (times - 0.1) - (times - 0.1) ** 2)
    count = len(times)
    center = np.stack([0 * height + 0.2, height, 0 * height + 0.2], axis=1)
    names = ("degenerate_cells", "false_edges", "misfit", "elastic_energy", "kinetic_energy", "max_plastic_strain")
    columns = {name: np.zeros(count) for name in names}
    columns |= {name: np.ones(count) for name in ("volume_mesh", "volume_cells")}
    columns |= {"mass": np.full(count, 4.0), "center": center, "extent_min": center - 0.1, "extent_max": center + 0.1}
    columns |= {"momentum": 4.0 * np.stack([0 * speed, speed, 0 * speed], axis=1)}
    columns |= {"angular_momentum": np.zeros((count, 3)), "second_moments": np.full((count, 3), 0.1**2 / 3)}
    columns["kinetic_energy"] = 2.0 * speed**2
    start = {name: values[0] for name, values in columns.items()}
    start |= {"thinnest_feature": 0.2, "surface_volume": 0.0042, "solid_volume": 0.0042}
    columns = {name: values[1:] for name, values in columns.items()}
    columns |= {"time": times[1:], "dt": np.diff(times), "det_f_interior": np.ones((count - 1, 2))}
    return measure.Result(run, "", start, columns)


def test_laws_of_walls_are_those_of_random_scenes_and_an_aim_beyond_the_modulus() -> None:
    def verdicts(result: measure.Result) -> dict[str, str]:
        lines = wall_laws.judge_walls({result.run: result}, "quick")
        return {line.bar.partition(":")[0]: line.verdict for line in lines}

    judged = verdicts(thrown_result(0.1))
    assert set(judged) == set(wall_laws.JUDGED) and judged.pop("ledger") == "not judged"  # it has none
    assert set(judged.values()) == {"pass"}
    for pressure, verdict in ((0.1, "MISSED"), (2.0, "not judged")):
        deep = thrown_result(pressure)
        deep.columns["extent_min"][19, 1] = -0.6 * deep.run.spacing
        assert verdicts(deep)["depth"] == verdict
    low = thrown_result(0.1)
    low.columns["center"][20:, 1] = 0.1 + 0.9 * (low.columns["center"][20:, 1] - 0.1)
    assert verdicts(low)["rebound"] == "MISSED"


def test_a_number_that_is_missing_misses_its_bar() -> None:
    assert Line("law", "bar", math.nan, low=0, high=1).verdict == "MISSED"
    assert Line("law", "bar", 1.0, low=0, high=1).verdict == "pass"
    assert Line("law", "bar", 1.1, low=0, high=1).verdict == "MISSED"


@pytest.mark.parametrize("text", ["voxel=1", "cfl_solid", "preset=unknown"])
def test_settings_that_do_not_exist_are_refused(text: str) -> None:
    with pytest.raises(SystemExit):
        bench_loop.parse(["--set", text])


def test_a_run_measures_what_happens_and_reports_what_goes_wrong(library) -> None:
    run = Experiment("fall", gravity=9.8, duration=0.02, dt=0.01, settings=(("cfl_solid", 0.5),))
    result = bench_loop.run_child(run)
    assert result.finished and result.clamps == 0
    assert result.times == pytest.approx([0.0, 0.01, 0.02])
    assert result.velocity[-1, 1] == pytest.approx(-0.196, rel=0.02)
    row = table.row(result)
    assert row["finished"] == "yes" and row["settings"] == "cfl_solid=0.5" and row["steps"] == "2"
    assert list(result["det_f_interior"][-1]) == pytest.approx([1, 1], abs=1e-3)
    assert list(result["det_f_before"][-1]) == pytest.approx([1, 1], abs=1e-3) and result["repaired_cells"].sum() == 0
    energy = measure.total_energy(result)
    assert energy.shape == (2,) and energy[1] == pytest.approx(energy[0], abs=2e-3)
    assert energy_laws.gap(result).max() < 1e-6
    assert set(energy_laws.losses(result)) == set(energy_laws.LOSSES)

    broken = bench_loop.run_child(dataclasses.replace(run, settings=(("voxel_size", -1.0),)))
    assert not broken.finished and "voxel_size" in broken.failure
    for law in bench_loop.LAWS:  # each says so for each of its runs
        runs = law.experiments("quick")
        lines = law.lines({run: broken for run in runs}, "quick")
        assert [line.verdict for line in lines] == ["MISSED"] * len(runs)
        assert law.lines({}, "quick") == []


@pytest.mark.parametrize("name", ["jet", "channel"])
def test_laws_of_what_flows_are_kept_and_name_the_preset(library, name: str) -> None:
    law = next(law for law in bench_loop.LAWS if law.name == name)
    run = law.experiments("quick")[0]
    lines = law.lines({run: bench_loop.run_child(run)}, "quick")
    assert lines and all(line.verdict == "pass" and ", production, " in line.conditions for line in lines)


def test_without_the_volume_source_a_solid_keeps_the_volume_it_has(library) -> None:
    pressed = Experiment("squash", stretch=(1.0, 0.5, 1.0), walls="openTop", duration=0.25)
    for source, low, high in ((1, 1.5, 2.1), (0, 0.95, 1.05)):
        result = bench_loop.run_child(dataclasses.replace(pressed, settings=(("volume_source", source),)))
        assert result.finished and low < measure.volume_range(result, "mesh")[1] < high


def test_the_elastica_has_the_tabulated_end() -> None:
    assert given_laws.elastica(2.0) == pytest.approx((0.238507, 0.321594), abs=1e-5)


def test_an_interrupt_keeps_the_runs_that_are_finished(library, tmp_path) -> None:
    command = [sys.executable, ROOT / "tests/bench/bench_loop.py", "--only", "jet,channel", "--jobs", "1"]
    table_file = tmp_path / "table.md"
    with subprocess.Popen(
        [*command, "--output", table_file], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ
    ) as bench:
        assert bench.stderr.readline().startswith("1/")
        bench.send_signal(signal.SIGTERM)
        answer = bench.communicate(timeout=120)[0]
    assert "were not made: interrupted" in answer
    rows = [line for line in table_file.read_text().splitlines() if line.startswith(("| jet |", "| channel |"))]
    assert "interrupted" in table_file.read_text() and rows


class _Mirrored:
    """A simulation of 4^3 cells whose solid, half of every cell and moving along y, is its mirror image but for what a
    test changes."""

    def __init__(self) -> None:
        self.fraction = np.full((1, 4, 4, 4), 0.6)
        self.solid, self.fluid = np.zeros((3, 5, 5, 5)), np.zeros((3, 5, 5, 5))
        self.solid[1] = -1.0

    def field(self, name: str, solid: int = 0) -> tuple[np.ndarray, dict[str, Any]]:
        values = {"solid_fraction": self.fraction, "velocity": self.fluid, "solid_velocity": self.solid}[name]
        return values.copy(), {"origin": (0.0, 0.0, 0.0), "spacing": 0.1}


def test_a_cell_that_is_half_solid_on_one_side_alone_is_no_gap_of_velocities() -> None:
    simulation: Any = _Mirrored()
    assert all(mirror_gaps(simulation)[f"mirror_{field}"] == 0.0 for field in ("fraction", "solid", "fluid"))
    simulation.fraction[0, 0] = (0.5 + 1e-6, 0.5 - 1e-6, 0.5 + 1e-6, 0.5 - 1e-6)
    gaps = mirror_gaps(simulation)
    assert gaps["mirror_solid"] == 0.0
    assert gaps["mirror_fraction"] > 0.09
    simulation.solid[1, 2, 2, 2] += 0.1  # in the middle
    simulation.solid[1, 1, 2, 2] += 0.1
    assert mirror_gaps(simulation)["mirror_solid"] == pytest.approx(0.1)
    assert mirror_gaps(simulation)["mirror_speed"] == 1.0
