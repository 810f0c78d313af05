"""`bench accuracy`: its table, sweeps, fits, fronts, comparison, refusals, and one case from end to end."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

import bench_accuracy  # noqa: E402
import bench_loop  # noqa: E402
import bench_skip  # noqa: E402
import bench_stress  # noqa: E402
from accuracy import (  # noqa: E402
    cases_contact,
    cases_coupled,
    cases_fluid,
    cases_solid,
    cases_transport,
    draw,
    fit,
    front,
    registry,
    report,
    sweep,
    table,
)
from accuracy.table import Row  # noqa: E402
from eulerfsi.errors import UsageError  # noqa: E402
from eulerfsi.solver.simulation import Simulation  # noqa: E402
from loop import experiment, thin_laws  # noqa: E402
from loop.measure import total_energy  # noqa: E402
from loop.shapes import SIZE  # noqa: E402
from stress import cases as stress_cases  # noqa: E402
from stress import judge  # noqa: E402

HERE = {"commit": "abc", "machine": "one"}


def row(case: str = "a", **values: object) -> Row:
    base = {"preset": "production", "core_s": 1.0, "value": 1.1, "reference": 1.0, "error": 0.1, "cells": 10}
    return Row(case=case, **base | HERE | values)


# --- the table -------------------------------------------------------------------------------------------------------


def test_rows_come_back_as_they_were_written(tmp_path: Path) -> None:
    path = tmp_path / "more" / "a.csv"
    rows = [
        row(numbers=table.text_of({"energy kept": 0.123456789, "centers": [1.0, 2.5], "lost": float("nan")})),
        row(tolerance=1e-6, error=None, reference=None, failure='diverged: "no", really', step="cfl 0.3"),
    ]
    for one in rows:
        table.append(path, one)
    assert table.read(path) == rows
    assert rows[0].number("energy kept") == 0.123457 and rows[0].number("lost") is None
    assert table.read(tmp_path / "none.csv") == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a,b\n1,2\n", "no table of `bench accuracy`"),
        ("", "no table of `bench accuracy`"),
        ("HEAD\nx,eulerfsi\n", "line 2: damaged: 2 fields, must be"),
        ("GOOD\nBAD", "line 3: damaged: core_s is 'fast', must be a number"),
        ("GOOD\nEMPTY", "line 3: damaged: steps is empty, must be a whole number"),
        ("GOOD\nNAN", "line 3: damaged: error is 'nan', must be a number"),
    ],
)
def test_damaged_and_foreign_tables_are_refused_in_one_line(tmp_path: Path, text: str, says: str) -> None:
    good = tmp_path / "good.csv"
    table.append(good, row())
    head, line = good.read_text().splitlines()
    bad = {name: line.split(",") for name in ("BAD", "EMPTY", "NAN")}
    bad["BAD"][table.COLUMNS.index("core_s")] = "fast"
    bad["EMPTY"][table.COLUMNS.index("steps")] = ""
    bad["NAN"][table.COLUMNS.index("error")] = "nan"
    text = text.replace("GOOD", f"{head}\n{line}").replace("HEAD", head)
    for name, fields in bad.items():
        text = text.replace(name, ",".join(fields))
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(UsageError, match=r"^\S+table\.csv: ") as refused:
        table.read(path)
    assert says in str(refused.value) and "\n" not in str(refused.value)


def test_a_folder_that_is_read_only_is_refused_before_the_first_run(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(table.os, "access", lambda path, mode: False)  # root may write everywhere
    with pytest.raises(UsageError, match="cannot be written"):
        table.demand_writable(tmp_path / "a.csv")


# --- sweeps ----------------------------------------------------------------------------------------------------------


def test_every_case_has_a_measure_and_three_resolutions() -> None:
    _, cases = sweep.load()
    for case in cases.values():
        if case.of:
            assert case.of in registry.MEASURES and not cases[case.of].of
        else:
            assert case.name in registry.MEASURES and len(case.cells) == 3 and case.max_step > 0 and case.across
    assert set(registry.MEASURES) == {name for name, case in cases.items() if not case.of}


def test_one_thing_at_a_time_differs_from_the_default() -> None:
    _, cases = sweep.load()
    runs = sweep.runs(cases["taylor_green_box"])
    assert len({run.row().identity for run in runs}) == len(runs) == 3 + 2 + 4 + 4 + 2 * 3
    for run in runs:
        changed = (run.preset != "production") + (run.step != "default") + (run.tolerance is not None)
        assert changed + (run.cells != 128) <= 1 or run.sweep == "preset"
    by_step = {run.step: run for run in runs if run.sweep == "step"}
    assert by_step["dt/4"].largest_step == pytest.approx(runs[0].largest_step / 4)
    assert by_step["cfl 0.3"].settings["cfl_fluid"] == 0.3
    assert by_step["cfl 0.3"].largest_step == pytest.approx(1 / 24)
    assert [run.cells for run in sweep.runs(cases["taylor_green_box"], quick=True)] == [64]
    by_step = {run.step: run for run in sweep.runs(cases["bounce_vacuum"]) if run.sweep == "step"}
    assert by_step["loss 0.05"].settings["step_tolerance"] == 0.05
    assert by_step["loss 0.05"].largest_step == pytest.approx(1 / 24)


def test_a_seed_draws_other_parameters_within_their_limits() -> None:
    _, cases = sweep.load()
    case = cases["taylor_green_decay"]
    assert case.parameters(0)["speed"] == 1.0 and case.parameters(7) == case.parameters(7) != case.parameters(8)
    for seed in range(1, 30):
        drawn = case.parameters(seed)
        assert 0.5 <= drawn["speed"] <= 2.0 and 50 <= drawn["reynolds"] <= 500 and drawn["turns"] == 1.0


def test_a_run_survives_its_way_to_another_process() -> None:
    _, cases = sweep.load()
    for run in sweep.runs(cases["single_vortex"], seed=3):
        assert registry.from_text(registry.to_text(run)) == run


# --- fits ------------------------------------------------------------------------------------------------------------


def test_orders_and_limits_of_a_power_are_found() -> None:
    sizes = [1 / 8, 1 / 12, 1 / 20]
    assert fit.slope(sizes, [3 * s**1.7 for s in sizes]) == pytest.approx(1.7)
    end, p = fit.limit(sizes, [0.8 - 2 * s**1.3 for s in sizes])
    assert (end, p) == (pytest.approx(0.8, abs=1e-9), pytest.approx(1.3, abs=1e-6))
    assert fit.limit(sizes, [0.8, 0.9, 0.85]) is None  # there and back
    assert fit.limit(sizes, [1.0, 1.1, 2.0]) is None  # runs away
    assert fit.slope(sizes, [0.1, 0.0, 0.1]) is None


def test_a_case_without_a_closed_form_is_measured_against_its_limit() -> None:
    rows = [row(cells=n, value=0.9 - 4 / n**2, reference=None, error=None) for n in (8, 12, 20)]
    odd = row(cells=12, value=0.81, reference=None, error=None, step="cfl 5", sweep="step")
    errors = [r.error for r in fit.with_errors([*rows, odd])]
    assert errors[:3] == pytest.approx([4 / n**2 / 0.9 for n in (8, 12, 20)], rel=1e-5)
    assert errors[3] == pytest.approx(0.1, rel=1e-6)
    found = fit.orders(fit.with_errors(rows))
    assert found.h == pytest.approx(2.0, abs=1e-4) and found.limit == pytest.approx(0.9, abs=1e-6)


def test_without_convergence_the_finest_run_is_the_reference_and_said_to_be() -> None:
    norm = "relative to Richardson's limit, restitution"
    rows = [row(cells=n, value=v, reference=None, error=None, norm=norm) for n, v in ((8, 0.5), (12, 0.9), (20, 0.8))]
    filled = fit.with_errors(rows)
    assert [r.error for r in filled] == [pytest.approx(0.375), pytest.approx(0.125), None]
    assert filled[0].norm == "relative to the finest run, restitution"


def test_orders_in_h_and_dt_come_from_their_own_sweeps() -> None:
    rows = [row(cells=n, error=2 / n, value=2 / n, core_s=n**3.0) for n in (8, 16, 32)]
    rows += [row(cells=16, step=f"dt/{k}", sweep="step", value=0.05 + 0.075 / k**2, error=0.1) for k in (2, 4)]
    found = fit.orders(rows)
    assert (found.h, found.cost) == (pytest.approx(1.0), pytest.approx(3.0))
    assert found.dt == pytest.approx(2.0, abs=1e-6)
    rounded = fit.orders([dataclasses.replace(r, error=1e-7) for r in rows])
    assert rounded.rounding and rounded.h is None
    short = row(cells=8, error=0.9, parameters='{"frames": "1-3"}')
    assert len(fit.resolution([*rows, short])) == 3
    there_and_back = [row(cells=n, error=e, value=e) for n, e in ((8, 0.1), (16, 0.02), (32, 0.05))]
    assert fit.orders(there_and_back).h is None


def test_scenes_are_measured_against_the_finest() -> None:
    def at(cells: int, shift: float) -> Row:
        centers = {"centers": [shift, 0.0, 0.0, 1.0, shift, 0.0]}
        return row("scene", cells=cells, reference=None, error=None, numbers=table.text_of(centers))

    errors = [r.error for r in fit.with_errors([at(50, 0.3), at(70, 0.1), at(100, 0.0)])]
    assert errors == [pytest.approx(0.3), pytest.approx(0.1), None]


# --- the front -------------------------------------------------------------------------------------------------------


def test_the_front_holds_what_nothing_beats() -> None:
    rows = [row(core_s=t, error=e) for t, e in ((1, 0.5), (2, 0.6), (3, 0.2), (3, 0.3), (9, 0.2), (10, 0.1))]
    rows.append(row(core_s=0.1, error=0.01, failure="it stopped"))
    assert [(r.core_s, r.error) for r in front.front(rows)] == [(1, 0.5), (3, 0.2), (10, 0.1)]


def repeats(one: Row, times: tuple[float, ...]) -> list[Row]:
    return [dataclasses.replace(one, repeat=k, core_s=t) for k, t in enumerate(times, 1)]


def test_a_comparison_names_what_grew_and_forgives_noise() -> None:
    old = row(core_s=10.0)
    for times, worse in (((10.4, 10.4, 10.4), False), ((11.0, 11.0, 11.0), True), ((9.0, 11.0, 13.0), False)):
        assert front.compare([old], repeats(old, times)).worse == worse
    for error, worse in ((0.1019, False), (0.103, True)):
        found = front.compare([old], [dataclasses.replace(old, error=error)])
        assert found.worse == worse and ("error 0.1 -> 0.103" in "".join(found.lines)) == worse
    assert front.compare([old], [dataclasses.replace(old, failure="diverged", error=None)]).worse


def test_a_point_that_another_run_now_beats_is_named_and_no_failure() -> None:
    old = row(core_s=10.0)
    better = row(core_s=5.0, error=0.05, cells=12)
    found = front.compare([old], [old, better])
    assert not found.worse and "dominated by a, 12 cells" in found.lines[0]


def test_on_another_machine_or_commit_times_are_not_compared() -> None:
    old = row(core_s=1.0, steps=100)
    for change in ({"machine": "two"}, {"commit": "def"}):
        found = front.compare([old], [dataclasses.replace(old, core_s=50.0, steps=200, **change)])
        assert (
            not found.worse and "another machine or commit" in found.lines[0] and "steps 100 -> 200" in found.lines[1]
        )
    changed = dataclasses.replace(old, commit="abc+12", core_s=50.0)  # the same commit, with changes
    assert front.compare([old], [changed]).worse


# --- refusals and pictures -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--case", "bounc"], "--case bounc: must be one of"),
        (["--group", "gas"], "--group gas: must be one of"),
        (["--sweep", "mesh"], "--sweep mesh: must be one of"),
        (["--seed", "-1"], "--seed -1: must be >= 0"),
        (["--compare", "no.csv"], "--compare no.csv: there is no such file"),
    ],
)
def test_options_are_refused_in_one_line(cli, arguments: list[str], says: str) -> None:
    done = cli("bench", "accuracy", *arguments)
    assert done.returncode == 2 and says in done.stderr and len(done.stderr.splitlines()) == 1


def test_a_case_that_shares_runs_is_made_on_those_of_the_other_one() -> None:
    _, cases = sweep.load()
    options = bench_accuracy.parse(["--case", "swing_vacuum,lamb_vacuum,csm1"], cases)
    assert [case.name for case in bench_accuracy.chosen(options, cases)] == ["lamb_vacuum", "csm1"]
    options = bench_accuracy.parse(["--group", "scenes"], cases)
    assert {case.group for case in bench_accuracy.chosen(options, cases)} == {"scenes"}
    old = [run.row(error=0.1, core_s=1.0) for run in sweep.runs(cases["csm1"], quick=True)]
    options = bench_accuracy.parse(["--case", "csm1", "--quick"], cases)
    assert [run.repeat for run in bench_accuracy.planned(options, cases, old)] == [1, 2, 3]


def test_an_absent_peer_is_refused_in_one_line(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(bench_accuracy, "PEERS", ROOT / "tests" / "bench" / "peers" / "none.py")
    with pytest.raises(UsageError, match="--peers: tests/bench/peers/none.py is missing"):
        bench_accuracy.main(["--peers", "--case", "poiseuille", "--output", str(tmp_path / "a.csv")])


def test_a_picture_shows_presets_and_peers_and_refuses_an_empty_table(tmp_path: Path, cli) -> None:
    source = tmp_path / "a.csv"
    with pytest.raises(UsageError, match="there is no such table"):
        draw.draw(source, tmp_path)
    table.append(source, row("poiseuille", error=None, value=None, failure="diverged"))
    with pytest.raises(UsageError, match="has no run with an error"):
        draw.draw(source, tmp_path)
    table.append(source, row("poiseuille", error=0.01))
    table.append(source, row("poiseuille", preset="paper2016", sweep="preset", error=0.02))
    table.append(source, row("poiseuille", solver="other 1.0", preset="", sweep="peer", error=0.5, load=0.9))
    (path,) = draw.draw(source, tmp_path / "pictures")
    assert path.name == "accuracy_viscous.png" and path.read_bytes().startswith(b"\x89PNG")
    done = cli("plot", "accuracy", "some_cache")
    assert done.returncode == 2 and "takes no cache" in done.stderr
    done = cli("plot", "step")
    assert done.returncode == 2 and "needs the folder of a cache" in done.stderr


def test_the_newest_rows_are_drawn_and_peers_of_any_time() -> None:
    rows = [row(commit="old"), row(solver="other 1.0", commit="1.0"), row(commit="new"), row(commit="new", seed=4)]
    assert [r.commit for r in front.newest(rows)] == ["new", "1.0"]
    rows.insert(0, row("poiseuille", commit="older"))  # each case by its own last row
    assert [r.commit for r in front.newest(rows)] == ["older", "new", "1.0"]


# --- what is measured ------------------------------------------------------------------------------------------------


def test_lambs_dipole_is_a_flow_without_a_jump() -> None:
    stream = cases_fluid.dipole(0.1, 1.0, (0.5, 0.5))
    inside, outside = (stream(np.array(0.5 + r), np.array(0.5 + r)) for r in (0.0707, 0.0708))
    assert inside == pytest.approx(outside, rel=5e-3)
    small, at = 1e-6, np.array(0.5)
    # In the frame that moves with the dipole its circle is a stream line: on it the flow along x is that of the pair.
    top = (stream(at, at + 0.1 + small) - stream(at, at + 0.1 - small)) / (2 * small)
    assert top == pytest.approx(-1.0, rel=1e-3)  # U a^2 / r^2, backwards beside it
    middle = (stream(at, at + small) - stream(at, at - small)) / (2 * small)
    assert middle == pytest.approx(1 - 1 / cases_fluid.bessel(0, np.array(3.8317)), rel=1e-3)


def test_shear_stress_beside_closed_forms() -> None:
    root, mu = np.sqrt(5.0), 0.5 / 1.25  # of a shear of 1; lambda is mu
    assert cases_solid.shear_stress("corotational", 1.0) == pytest.approx(mu * (2 - 2 / root + (root - 2) / root))
    assert cases_solid.shear_stress("stVenantKirchhoff", 1.0) == pytest.approx(mu * 2.5)  # mu (s + s^3) + lambda/2 s^3
    for law in cases_solid.PULLED:
        assert cases_solid.shear_stress(law, 1e-4) == pytest.approx(1e-4 * mu, rel=1e-3)


@pytest.mark.parametrize("law", cases_solid.PULLED)
def test_laws_of_a_pulled_bar_are_linear_at_first_and_stiffen_or_soften(law: str) -> None:
    pulled = cases_solid.PULLED[law]
    assert pulled(1.0) == pytest.approx(0.0, abs=1e-9)
    assert (pulled(1.001) - pulled(0.999)) / 0.002 == pytest.approx(1.0, abs=2e-3)
    small = 1e-3
    slope = (least_energy(law, 1.2 + small) - least_energy(law, 1.2 - small)) / (2 * small)
    assert pulled(1.2) == pytest.approx(slope, rel=1e-3)


def least_energy(law: str, along: float) -> float:
    """Of all stretches of the sides, over Young's modulus; Poisson's ratio 0 (docs/numerics/materials.md)."""
    sides = np.linspace(0.8, 1.2, 400001)
    total, volume, mu = along**2 + 2 * sides**2, along * sides**2, 0.5
    if law == "corotational":
        return float((mu * ((along - 1) ** 2 + 2 * (sides - 1) ** 2)).min())
    if law == "stVenantKirchhoff":
        return float((mu / 4 * ((along**2 - 1) ** 2 + 2 * (sides**2 - 1) ** 2)).min())
    m, k = 4 / 3 * mu, 5 / 6 * mu
    energy = m / 2 * (total - 3) + k / 2 * (volume - (1 + m / k - m / (4 * k))) ** 2 - m / 2 * np.log(total + 1)
    return float(energy.min())


def test_hertz_contact_is_timed_in_its_middle() -> None:
    assert cases_contact.middle_share(1e-6) == pytest.approx(1.0, abs=0.01)
    assert 0.5 < cases_contact.middle_share(0.05) < 0.75
    assert cases_contact.times_of(np.array([0.0, 1.0, 2.0]), np.array([-1.0, 0.0, 1.0]), 0.25) == pytest.approx(
        [0.5, 1.5]
    )


def test_a_step_at_the_wind_of_a_turn_carries_particles_around() -> None:
    turn = lambda x, y, z, t: [-y, x, 0 * z]  # noqa: E731
    at = np.array([[1.0], [0.0], [0.0]])
    moved = at[:, 0] + 0.1 * cases_transport.mean_velocity(turn, at, 0.0, 0.1)[:, 0]
    assert moved[:2] == pytest.approx([np.cos(0.1), np.sin(0.1)], abs=1e-6)


def test_the_meter_ends_a_run_that_costs_too_much(library) -> None:
    _, cases = sweep.load()
    run = dataclasses.replace(sweep.runs(cases["taylor_green_decay"], quick=True)[0], cells=32, limit=1e-4)
    answer = registry.carry_out(run)
    assert answer["failure"].startswith("over 0.0001 processor seconds") and not answer["measured"]
    assert answer["cost"]["steps"] == 1


def test_a_small_case_from_end_to_end(tmp_path: Path, library, capsys, monkeypatch) -> None:
    """Made, kept, not made again, compared with itself and with a better one."""
    monkeypatch.setattr(bench_accuracy, "REPEATS", 1)
    output = tmp_path / "a.csv"
    options = ["--case", "poiseuille", "--quick", "--output", str(output)]
    assert bench_accuracy.main(options) == 0
    (made,) = table.read(output)
    assert made.case == "poiseuille" and made.error < 1e-4 and made.core_s > 0 and made.peak_mb > 1
    assert made.steps >= 80 and made.pressure_iterations > 0 and made.machine == table.machine() and not made.failure
    assert "poiseuille, 12 cells, production: error" in capsys.readouterr().out
    assert bench_accuracy.main(options) == 0 and len(table.read(output)) == 1
    better = tmp_path / "better.csv"
    table.append(better, dataclasses.replace(made, error=made.error / 2))
    assert bench_accuracy.main([*options, "--compare", str(better)]) == 1
    assert "poiseuille, 12 cells, production: error" in capsys.readouterr().out.splitlines()[-1]
    assert bench_accuracy.main([*options, "--compare", str(output)]) == 0


def test_a_shared_run_gives_a_row_to_each_case(library) -> None:
    _, cases = sweep.load()
    run = sweep.runs(cases["lamb_vacuum"], quick=True)[0]
    run = dataclasses.replace(run, cells=6, max_step=4 * run.max_step)
    swing, frequency = bench_accuracy.rows_of(run, ["swing_vacuum"])[::-1]
    assert (frequency.case, swing.case) == ("lamb_vacuum", "swing_vacuum")
    assert frequency.core_s == swing.core_s and frequency.error < 0.1 and 0 < swing.value < 1
    assert swing.error == pytest.approx(1 - swing.value, abs=1e-6)


def test_the_table_of_the_soft_disc_is_whole() -> None:
    path = np.array(cases_coupled.json.loads(cases_coupled.DISC.read_text())["path"])
    assert path.shape == (28, 3) and (np.diff(path[:, 0]) > 0).all() and path[-1, 0] == 20.0


def test_a_summary_lists_cases_and_the_worst() -> None:
    rows = [row(cells=n, error=1 / n, case=case) for case in ("a", "b") for n in (8, 16, 32)]
    rows.append(row("c", error=0.5))
    lines = report.summary(rows)[-1].splitlines()
    assert [line.split()[0] for line in lines] == ["case", "a", "b", "c"]
    assert [r.case for r in report.worst(rows, 2)] == ["c", "a"]
    text = report.document([row("poiseuille", cells=n, error=1 / n) for n in (8, 16)])
    assert "## viscous" in text and "| poiseuille | 8 / 16 | 0.12 / 0.062 |" in text


# --- stress and skip -------------------------------------------------------------------------------------------------


def test_stress_judges_by_its_worst_run(library, capsys) -> None:
    run = dataclasses.replace(stress_cases.THROWN, across=6, duration=0.03)
    slow, still = bench_loop.run_child(run), bench_loop.run_child(dataclasses.replace(run, scene="still"))
    case = stress_cases.Case("S0", "thrown", (run,))
    line = judge.of_runs(case, [slow, still])
    assert line.passed and line.text.startswith("2 of 2 finish; worst energy rise")
    still.columns["max_speed_solid"] = still["max_speed_solid"] * 1000
    still.failure = "diverged"
    line = judge.of_runs(case, [slow, still])
    assert not line.passed and "1 of 2 finish" in line.text
    assert "still, ball: diverged" in line.text and "still, ball: speed over reference" in line.text


def test_stress_judges_runs_of_bench_accuracy_by_their_numbers() -> None:
    bars = (stress_cases.Bar("area off", 0.05), stress_cases.Bar("angular momentum kept", 1.02, 0.95))
    runs = stress_cases.accuracy_runs("tumbling", 9.0, {"cells": 6}, {"cells": 8}, turns=20)
    assert [run.cells for run in runs] == [6, 8] and runs[0].limit == 9.0 and runs[0].of["turns"] == 20
    case = stress_cases.Case("S0", "turned", measured=runs, bars=bars)

    def answer(area: float, kept: float, failure: str = "") -> dict:
        numbers = {"area off": area, "angular momentum kept": kept}
        return {"failure": failure, "measured": {} if failure else {"tumbling": {"error": 0.0, "numbers": numbers}}}

    line = judge.of_measured(case, [answer(0.01, 0.99), answer(0.02, 0.97)])
    assert line.passed and "2 of 2 finish; worst area off 0.02 (8 cells" in line.text
    assert "angular momentum kept 0.97 (8 cells" in line.text
    line = judge.of_measured(case, [answer(0.01, 0.94), answer(float("nan"), 1.0)])
    assert not line.passed and "kept 0.94 < 0.95" in line.text and "area off nan" in line.text
    line = judge.of_measured(case, [answer(0.01, 1.0), answer(0, 0, "over 9 processor seconds")])
    assert not line.passed and "1 of 2 finish" in line.text and "over 9 processor seconds" in line.text


def test_stress_judges_what_a_case_names_and_work_from_outside(library) -> None:
    run = dataclasses.replace(thin_laws.watched_run("press", None), duration=0.02)
    result = bench_loop.run_child(run)
    deep = stress_cases.Case("S0", "pressed", (run,), bars=(stress_cases.OVERLAP,))
    line = judge.of_runs(deep, [result])
    assert line.passed and "deepest overlap [h]" in line.text and result["prescribed_work"].sum() != 0
    result.columns["collider_overlap"] = result["collider_overlap"] + 2 * run.spacing
    assert "deepest overlap [h] 2" in judge.of_runs(deep, [result]).text
    assert not judge.of_runs(deep, [result]).passed
    before = total_energy(result)
    result.columns["prescribed_work"] = result["prescribed_work"] + 1.0
    assert np.allclose(before - total_energy(result), np.arange(len(before)) + 0.5)
    assert judge.of_runs(deep, [result]).text.startswith("1 of 1 finish; worst energy rise")


def test_a_twisted_start_keeps_volume_and_turns_its_ends(library) -> None:
    (run,) = stress_cases.twisted((90.0,))
    with Simulation(run.simulation()) as simulation:
        simulation.add_solid(run.mesh(), **run.solid())
        experiment.twist(simulation, run)
        low, high = experiment.det_f_ranges(simulation)["det_f_interior"]
        moved = simulation.surface(1)[0].astype(float) - run.middle
    assert 0.97 < low <= high < 1.03
    at_rest, end = run.mesh().points - run.middle, np.abs(run.mesh().points[:, 0] - run.middle[0] - 0.1) < 1e-6
    turned = np.arctan2(moved[end, 2], moved[end, 1]) - np.arctan2(at_rest[end, 2], at_rest[end, 1])
    assert np.median(np.rad2deg((turned + np.pi) % (2 * np.pi) - np.pi)) == pytest.approx(45, abs=3)


def test_a_scrambled_start_is_random_and_the_same_for_its_seed(library) -> None:
    seen = []
    for seed in (1, 1, 2):
        run = dataclasses.replace(stress_cases.FREE, scramble=seed, across=6)
        with Simulation(run.simulation()) as simulation:
            simulation.add_solid(run.mesh(), **run.solid())
            experiment.scramble(simulation, run)
            seen.append(simulation.field("solid_displacement", 1)[0].copy())
    assert (seen[0] == seen[1]).all() and (seen[0] != seen[2]).any()
    assert 0.9 * SIZE / 2 < np.abs(seen[0]).max() <= SIZE / 2


def test_values_and_shapes_that_are_none_are_refused(library, capsys) -> None:
    assert bench_stress.main(["--only", "S19,S24", "--jobs", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "2 of 2 refused cleanly" in lines[0] and "8 of 8 refused cleanly" in lines[1]
    with pytest.raises(UsageError, match="--only S99: must be one of"):
        bench_stress.main(["--only", "S99"])


def test_a_call_that_is_accepted_or_crashes_is_told() -> None:
    assert stress_cases.refusal(lambda: None) == "it was accepted"
    assert stress_cases.refusal(lambda: [][0]).startswith("IndexError")


def test_features_that_a_scene_lacks_cost_nothing(library, capsys, tmp_path: Path) -> None:
    assert bench_skip.main([]) == 0
    out = capsys.readouterr().out
    assert out.count(" pass") == 10 and "0 bars missed" in out
    with pytest.raises(UsageError, match="there is no such folder"):
        bench_skip.main(["--against", str(tmp_path / "none")])
    busy = {"tiles": {"smoke": 3}, "bytes": {"smoke": 9}, "memory_bytes": 1}
    assert bench_skip.row("smoke", busy, busy, ("smoke",))["verdict"] == "MISSED"
    idle = {"tiles": {"smoke": 0}, "bytes": {"smoke": 0}, "memory_bytes": 1}
    assert bench_skip.row("smoke", idle, idle, ("smoke",))["verdict"] == "MISSED"  # what never runs proves nothing
    assert bench_skip.row("smoke", idle, busy, ("smoke",))["verdict"] == "pass"
