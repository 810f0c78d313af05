"""`bench table`: what it prints, and what it refuses before anything is simulated."""

from __future__ import annotations

import re
import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

import bench_table  # noqa: E402

pytestmark = pytest.mark.usefixtures("library")


def test_tables_have_the_paper_s_row_and_ours(cli, tmp_path):
    table = tmp_path / "table.md"
    done = cli("bench", "table", "--only", "cheb", "--frames", "1-3", "--scale", "0.1", "--output", table)
    assert done.returncode == 0, done.stderr
    lines = table.read_text().splitlines()
    assert sum(line.startswith("| cheb | paper | 120 x 100 x 80 |") for line in lines) == 1
    (ours,) = [line for line in lines if line.startswith("| cheb | here |")]
    assert re.match(r"\| cheb \| here \| \d+ x \d+ x \d+ \| 0\.0417 \|", ours) and ours.count("|") == 13
    parameters = [line for line in lines if line.startswith("| cheb | ") and line.count("|") == 5]
    assert len(parameters) == 1  # table 1
    (effort,) = [line for line in lines if line.startswith("| cheb | ") and line.endswith("no bar |")]
    assert effort.count("|") == 10 and float(effort.split("|")[4]) > 0


def test_a_scene_that_is_a_cell_thick_stays_so_at_any_resolution(tmp_path):
    path = bench_table.scene_at("circles", 0.025, tmp_path)
    assert path.parent == tmp_path and "xformOp:scale = (1, 0.5, 0.025)" in path.read_text()
    assert bench_table.scene_at("ball", 0.025, tmp_path) == bench_table.SCENES / "ball.usda"
    assert bench_table.scene_at("circles", 0.01, tmp_path) == bench_table.SCENES / "circles.usda"  # as it is


def test_bars_are_judged_on_every_machine_but_seconds_only_on_a_quiet_one():
    effort = bench_table.Effort(10, 10, 100.0, 5.0, 1.0, 0.1, 9.0)
    bar = bench_table.Bar(velocity=90, pressure=8, seconds=5)
    assert effort.missed(bar, quiet=False) == ["velocity"]
    assert effort.missed(bar, quiet=True) == ["velocity", "seconds"]
    assert bench_table.Effort(10, 10, 90.0, 8.0, 1.0, 0.1, 5.0).missed(bar, quiet=True) == []


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--frames", "3-1"], 2, "runs backwards"),
        (["--frames", "1"], 2, "a cache needs at least 2"),
        (["--output", "missing/table.md"], 5, "missing"),
        (["--only", "nobody"], 2, "--only nobody: must be of"),
    ],
)
def test_bad_options_are_refused_first(cli, tmp_path, arguments, code, message):
    (tmp_path / "missing").write_text("a file, no folder")
    done = cli("bench", "table", *arguments)
    assert done.returncode == code and message in done.stderr and not done.stdout


@pytest.mark.nightly
def test_solves_of_solids_that_meet_stay_below_their_bars(tmp_path):
    """The party at a quarter of the paper's resolution, first impacts: iterations per step of the worst frame."""
    effort = bench_table.Effort.of(bench_table.run("party", 0.02, "production", "1-4", tmp_path / "cache"))
    assert effort.steps > 10 and effort.overlap > 0, "nothing has touched"
    assert not effort.missed(bench_table.BARS["party", 0.25], quiet=False), effort
