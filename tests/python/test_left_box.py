"""A solid that leaves the domain through an open wall: the run goes on, and the cache hides the solid."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import content_hashes, make_scene
from eulerfsi.cache import stats_file
from eulerfsi.run.simulate import Options, simulate
from pxr import Usd, UsdGeom
from test_passengers import add_eye

BALL, EYE = "/World/Ball", "/World/Ball/Eye"
FRAMES = (1, 12)


@pytest.fixture
def thrown(tmp_path: Path) -> Path:
    """The small scene without smoke; its ball, which the scene hides in its first frame, is thrown out."""
    stage = make_scene(tmp_path / "thrown.usda", smoke=False, velocity=(2.0, 0.0, 0.0), frames=FRAMES)
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:wallXMax").Set("open")
    add_eye(stage, EYE, (0.12, 0.06, 0.0))
    shown = UsdGeom.Imageable(stage.GetPrimAtPath(BALL)).CreateVisibilityAttr()
    shown.Set("invisible", 1)
    shown.Set("inherited", 2)
    stage.GetRootLayer().Save()
    return tmp_path / "thrown.usda"


def warnings(folder: Path) -> list[str]:
    return [line for line in (folder / "log").read_text().splitlines() if "has left the box" in line]


def test_the_run_goes_on_and_the_ball_is_hidden(thrown: Path, tmp_path: Path, library) -> None:
    result = simulate(thrown, Options(output=tmp_path / "cache", progress="none"))
    lines = stats_file.read(result.folder)
    assert sum(line["retries"] for line in lines if line["event"] == "step") == 0
    masses = {line["frame"]: line["solids"][BALL]["mass"] for line in lines if line["event"] == "frame"}
    left = min(frame for frame, mass in masses.items() if mass == 0.0)
    assert 2 < left < FRAMES[1] and not any(masses[frame] for frame in range(left, FRAMES[1] + 1))
    (line,) = warnings(result.folder)
    assert f"{BALL}: frame {left}: by " in line and "through wallXMax" in line
    stage = Usd.Stage.Open(str(result.root))
    for path in (BALL, EYE):
        prim = UsdGeom.Imageable(stage.GetPrimAtPath(path))
        shown = {frame: prim.ComputeVisibility(frame) for frame in (1, 2, left - 1, left, FRAMES[1])}
        assert list(shown.values()) == ["invisible", "inherited", "inherited", "invisible", "invisible"], path


def test_a_run_that_is_resumed_warns_once_and_writes_the_same(thrown: Path, tmp_path: Path, library) -> None:
    whole = simulate(thrown, Options(output=tmp_path / "whole", progress="none"))
    simulate(thrown, Options(output=tmp_path / "parts", frames="1-10", progress="none"))
    assert len(warnings(tmp_path / "parts")) == 1
    parts = simulate(thrown, Options(output=tmp_path / "parts", resume=True, progress="none"))
    assert parts.resumed and len(warnings(parts.folder)) == 1
    assert content_hashes(whole.folder) == content_hashes(parts.folder)
    stages = [Usd.Stage.Open(str(run.root)) for run in (whole, parts)]
    shown = [stage.GetAttributeAtPath(f"{BALL}.visibility").GetTimeSamples() for stage in stages]
    assert shown[0] == shown[1] != []


def test_a_run_that_starts_from_there_has_no_ball(thrown: Path, tmp_path: Path, library) -> None:
    simulate(thrown, Options(output=tmp_path / "first", progress="none"))
    options = Options(start_from=str(tmp_path / "first"), settings=("/World/Domain.wallXMax=slip",), frames="1-3")
    options.output, options.progress = tmp_path / "second", "none"
    result = simulate(thrown, options)
    assert len(warnings(result.folder)) == 1
    stage = Usd.Stage.Open(str(result.root))
    prim = UsdGeom.Imageable(stage.GetPrimAtPath(BALL))
    assert [prim.ComputeVisibility(frame) for frame in (1, 2, 3)] == ["invisible"] * 3
