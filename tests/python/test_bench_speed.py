"""`bench speed`: its sums and ratios, what it refuses, and a run of some of its groups from end to end."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

import bench_speed  # noqa: E402
from speed import case, kernels, lines, peer, scaling  # noqa: E402
from speed.child import top_of_smoke  # noqa: E402
from speed.lines import Line  # noqa: E402


def result(seconds: list[float], triad: float = 0.5, **more) -> dict:
    """A run with a step of each of these times, two to a frame, on 1000 cells."""
    steps = [{"frame": n // 2 + 1, "seconds": s, "processor": 2 * s, "dt": 0.01} for n, s in enumerate(seconds)]
    return {"steps": steps, "triad": triad, "cells": 1000, "threads": 2, **more}


def test_times_are_means_per_step_and_frame_and_count_in_triads() -> None:
    run = result([1.0, 2.0, 3.0, 4.0])
    assert lines.step_seconds(run) == 2.5 and lines.frame_seconds(run) == 5.0 and lines.core_seconds(run) == 5.0
    line = lines.timed("a time < 4", 2.5, run, "", 4.0)
    assert line.triads == 5.0 and line.verdict == "pass"
    assert lines.timed("a time < 2", 2.5, run, "", 2.0).verdict == "MISSED"
    assert lines.per_cell("of a cell", 2.5, run, "").measured == pytest.approx(2500)


def test_a_line_without_a_bar_is_not_judged_and_a_missing_number_misses_its_bar() -> None:
    assert Line("bar", math.nan, low=0, high=1).verdict == "MISSED"
    assert Line("bar", 2.0).verdict == "not judged"


@pytest.mark.parametrize(
    ("triads", "share"), [((1.0, 0.8), 1.5 / 1.25), ((1.0, 0.5), 1.5 / lines.TRIAD_GAIN_CAP), ((1.0, 1.0), 1.5)]
)
def test_threads_are_held_to_what_the_triad_gains_up_to_a_cap(triads, share) -> None:
    one, two = result([3.0], triads[0]), result([2.0], triads[1])
    assert lines.thread_share([one], [two])[0] == pytest.approx(share)


def test_what_more_threads_gain_follows_from_what_two_leave_of_each_stage() -> None:
    """A stage that halves, one that stays: 16 threads make (1 / 16 + 1) of 2 s, and half of the time one waits."""

    def run(halves: float) -> dict:
        profile = {"steps": 2, "seconds": {"pressure_solve": 2 * halves, "check": 2.0, "smoke": 1e-6}}
        return result([halves + 1.0, halves + 1.0], profile=profile)

    assert scaling.counts(2) == [1, 2] and scaling.counts(1) == [1, 2] and scaling.counts(20) == [1, 2, 4, 8, 16]
    pressure, check, in_all = scaling.rows({1: run(1.0), 2: run(0.5)})
    assert (pressure["stage"], pressure["gain"], pressure["waiting"]) == ("pressure_solve", 2.0, 0.0)
    assert (check["gain"], check["waiting"], check[scaling.FORETOLD]) == (1.0, 0.5, 1.0)
    assert pressure[scaling.FORETOLD] == pytest.approx(16.0)
    assert in_all["2 threads"] == 1.5 and in_all[scaling.FORETOLD] == pytest.approx(2 / (1 + 1 / 16))
    assert scaling.FORETOLD not in scaling.rows({1: run(1.0), 16: run(1 / 16)})[-1]  # measured, not foretold


def test_runs_that_take_turns_are_compared_pair_by_pair() -> None:
    # A disturbance that hits both runs of a pair leaves the ratio, one that hits a single run is outvoted.
    assert lines.ratio([1.0, 10.0, 1.0], [2.0, 20.0, 2.0]) == 0.5
    assert lines.ratio([1.0, 9.0, 1.0], [2.0, 2.0, 2.0]) == 0.5


def test_roofline_is_the_triad_for_a_triad_and_goes_by_bytes_and_medians() -> None:
    measured = {
        "cells": [10, 10, 10],
        "threads": 2,
        "kernels": [
            {"name": "triad", "bytes": 12, "median": 1e-6, "best": 5e-7},
            {"name": "slow", "bytes": 24, "median": 4e-6, "best": 1e-9},
        ],
    }
    triad, slow = kernels.roofline(measured)
    assert triad["share of the triad"] == 1 and triad["GB/s"] == pytest.approx(12) and triad["triads"] == 1
    assert slow["share of the triad"] == pytest.approx(0.5) and slow["ns per cell"] == pytest.approx(4)
    assert slow["triads"] == pytest.approx(4)


def test_tiles_with_solid_are_counted_where_the_grid_is_no_multiple_of_a_tile() -> None:
    fraction = np.zeros((17, 8, 9))
    assert lines.tiles_with_solid(fraction) == 0
    fraction[16, 0, 8] = fraction[0, 7, 7] = fraction[7, 0, 0] = 0.1
    assert lines.tiles_with_solid(fraction) == 2
    profile = {"steps": 2, "tiles": {"all": 12, "few": 2, "none": 0}}
    rows = {row["stage"]: row["more than hold a solid"] for row in lines.tile_rows(profile, 2)}
    assert rows == {"all": 4, "few": 0}


def test_a_larger_box_stands_on_the_same_floor_around_the_same_axis() -> None:
    low, size = case.grown([-0.3, -0.5, 0.0], [0.6, 0.7, 0.4], 2.0)
    assert low == pytest.approx([-0.6, -0.5, -0.2]) and size == pytest.approx([1.2, 1.4, 0.8])
    assert case.cells_of({"domain_size": [0.6, 0.7, 0.6], "voxel_size": 0.005}) == [120, 140, 120]
    assert case.cells_of({"domain_size": [1.0, 1.0, 1.01], "voxel_size": 0.25}) == [4, 4, 5]


def test_top_of_smoke_is_its_highest_cell() -> None:
    density = np.zeros((4, 8, 4))
    assert top_of_smoke(density) == 0
    density[3, 5, 0] = 1
    assert top_of_smoke(density) == 6 / 8


def test_the_peer_is_compared_by_cell_and_step() -> None:
    output = 'Blender 3.4.1\nMANTAFLOW {"cells": 2000, "frames": 2, "steps": 4, "wall": 8, "processor": 16, '
    baked = peer.read(output + '"bytes": 10, "top": 0.5}\nBlender quit\n')
    ours = result([1.0, 1.0], writing=1.0, fields={"smoke_density": np.ones((1, 4, 4, 4))})
    found = {line.bar: line.measured for line in peer.compare([ours, ours], baked)}
    assert found["Mantaflow: core time per cell and step"] == pytest.approx(16e6 / 8000)
    assert found["ours: core time per cell and step"] == pytest.approx(2e6 / 1000)
    assert found["ours / Mantaflow: core time per cell and step"] == pytest.approx(1.0)
    assert found["ours / Mantaflow: core time per cell and step, with a .vdb of every frame"] == pytest.approx(1.25)
    assert found["ours / Mantaflow: wall time per cell and step"] == pytest.approx(1.0)


def test_a_peer_that_fails_or_is_absent_says_so(monkeypatch, capsys) -> None:
    with pytest.raises(SystemExit, match="(?s)no result.*No module named"):
        peer.read("Blender 3.4.1\nModuleNotFoundError: No module named 'x'\n")
    monkeypatch.setenv("PATH", "")
    assert bench_speed.main(["--quick", "--only", "peer"]) == 0
    assert capsys.readouterr().out.startswith("blender is not installed: apt-get install")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "ball,balls"], "balls: must be some of ball, paper"),
        (["--only", "against"], "--only against: needs --against DIR"),
        (["--rounds", "0"], "--rounds 0: must be at least 1"),
    ],
)
def test_unknown_groups_are_refused(arguments, message, capsys) -> None:
    with pytest.raises(SystemExit):
        bench_speed.parse(arguments)
    assert message in capsys.readouterr().err


def test_groups_by_default_leave_out_the_peer_and_add_the_other_checkout(tmp_path) -> None:
    assert bench_speed.parse([]).groups == list(bench_speed.groups.GROUPS)
    assert bench_speed.parse(["--against", str(tmp_path)]).groups == [*bench_speed.groups.GROUPS, "against"]
    with pytest.raises(SystemExit, match="there is no such library; run ./eulerfsi setup in"):
        case.environment(tmp_path)


def test_some_groups_from_end_to_end(library, tmp_path, capsys) -> None:
    command = ["--quick", "--only", "smoke,roofline,vacuum", "--output", str(tmp_path / "speed.md")]
    assert bench_speed.main(command) == 0
    printed, written = capsys.readouterr().out, (tmp_path / "speed.md").read_text()
    for text in ("Smoke only 32^3: core time per cell and step", "pressure operator: share of", "no fluid: bytes"):
        assert text in printed and text in written
    assert "## Roofline, 2 threads" in written and "| smoke transport |" in written
    run = case.run_case(case.Case("plume", case.plume(16, 1e-3), frames=3, warm=1, keep=("smoke_density",)))
    assert run["profile"]["steps"] == len(run["steps"]) and {step["frame"] for step in run["steps"]} == {2, 3}
    assert run["cells"] == 16**3 and run["triad"] > 0 and top_of_smoke(run["fields"]["smoke_density"][0]) > 0.1
