"""`bench output`: the table of what each option of the output costs, of a small scene."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
from conftest import ROOT, make_scene

pytestmark = pytest.mark.usefixtures("library")


def number(cell: str) -> float:
    """1,234 or 56 % as a number; nan for -."""
    word = cell.strip(" %").replace(",", "")
    return float("nan" if word == "-" else word)


def test_rows_say_what_is_saved_and_what_is_lost(tmp_path: Path, monkeypatch, capsys) -> None:
    """Centimetres: errors of velocities are in m/s all the same. The page gets the rows in place of its own."""
    scene = tmp_path / "small.usda"
    make_scene(scene, meters_per_unit=0.01, frames=(1, 4), voxel=0.05)
    loaded = runpy.run_path(str(ROOT / "tests" / "bench" / "bench_output.py"))
    page = tmp_path / "output.md"
    page.write_text(f"before\n\n{loaded['HEAD']}\n|---|\n| stale |\n\nafter\n")
    monkeypatch.setitem(loaded["main"].__globals__, "PAGE", page)
    assert loaded["main"](["--scene", str(scene), "--frame", "4", "--page"]) == 0
    text = page.read_text()
    assert text.startswith("before\n\n| written") and text.endswith("|\n\nafter\n") and "stale" not in text
    assert capsys.readouterr().out.startswith("2,016 cells, density to ")
    lines = [line.strip("| ").split("|") for line in text.splitlines() if "%" in line]
    rows = {re.split(r" -?\d+,", name.strip(" `"))[0]: [number(cell) for cell in rest] for name, *rest in lines}
    default, exact = rows["nothing: the default"], rows["--smoke-threshold 0"]
    assert default[1] == 100 and 0 < default[3] <= 1e-3 and default[4] == 0
    assert exact[3:] == [0, 0] and exact[0] > default[0]
    assert rows["--smoke-threshold 0.1"][0] < default[0] and 0.01 < rows["--smoke-threshold 0.1"][3] <= 0.1
    half = rows["--half --smoke-threshold 0"]
    assert half[0] < exact[0] and 0 < half[3] <= 0.8 * 2**-11 and 0 < half[4] < 0.01
    assert rows["--no-velocity"][0] < 0.6 * default[0]
    assert rows["--region"][0] < default[0] and rows["--region"][3] <= 1e-3
