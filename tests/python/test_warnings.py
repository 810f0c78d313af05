"""docs/warnings.md: every condition is told when it holds, nothing is told of a clean scene, --strict, --resume."""

from __future__ import annotations

import io
import json
import re
import shutil
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, author, box, content_hashes, make_scene, metric_stage, sphere
from eulerfsi.log import Log
from eulerfsi.run.conditions import CONDITIONS
from eulerfsi.run.measures import Watched
from eulerfsi.run.simulate import Options, load_scene, simulate
from eulerfsi.run.watch import Watch
from eulerfsi.scene.space import SimulationSpace
from eulerfsi.solver import binding
from events import events
from pxr import Sdf, Usd, UsdGeom, UsdPhysics
from test_resume import start, stop_after

BALL, DOMAIN = "/World/Ball", "/World/Domain"
# No solve can be this exact: "not_converged" in every frame.
NEVER = ("--set", "Domain.pressureTolerance=1e-15", "--set", "Domain.maxTimeStep=0.01")


def test_the_table_is_that_of_the_program():
    rows = re.findall(r"^\| (.*) \| (.*) \| (.*) \| `(\w+)` \|$", (ROOT / "docs/warnings.md").read_text(), re.M)
    assert rows == [(row.what, row.threshold, row.text, row.code) for row in CONDITIONS.values()]


def watched(**changes: Any) -> Watched:
    """A closed box of 1 m with cells of 0.1 m, an incompressible pinned ball in it."""
    domain = {"domain_min": [0.0] * 3, "domain_size": [1.0] * 3, "voxel_size": 0.1, "energy_ledger": True}
    domain |= {f"wall[{face}]": binding.WALLS["slip"] for face in range(6)} | {"velocity_tolerance": 0.0, "preset": 0}
    domain |= {f"wall_velocity[{face}]": [0.0] * 3 for face in range(6)} | changes.pop("domain", {})
    facts = {
        "fill": {BALL: 1.0},
        "pinned": set(),
        "drive": 0.0,
        "slow": 2.0,
        "moving_walls": False,
        "noise": 0.0,
        "fall": 0.0,
    }
    facts["space"] = SimulationSpace(np.eye(3), np.array([5.0, 0.0, 0.0]), 0.01)
    return Watched(DOMAIN, domain, **(facts | changes))


def step(**changes: Any) -> dict[str, Any]:
    """A step in which nothing is wrong."""
    line = {"dt": 0.01, "unconverged": 0, "velocity_residual": 0.001, "max_speed_solid": 1.0, "prescribed_work": {}}
    nothing = {"solid_kinetic": 0.0, "elastic": 0.0, "fluid_kinetic": 0.0, "potential": 0.0}
    change = {stage: dict(nothing) for stage in binding.ENERGY_STAGES}
    line["energy"] = {"at_start": nothing | {"solid_kinetic": 1.0}, "change": change, "source_work": 0.0}
    return {"event": "step", "repairs": {"repaired_cells": 0}, **line, **changes}


def frame(contacts: tuple[dict[str, Any], ...] = (), fluid: float = 1.0, **changes: Any) -> dict[str, Any]:
    """A frame in which nothing is wrong; changes: of the ball."""
    ball = {"elements": 1000, "extent_min": [0.4] * 3, "extent_max": [0.6] * 3, "center": [0.5] * 3, "false_edges": 0}
    ball |= {"volume_mesh": 0.008, "rest_volume": 0.008, **changes}
    return {"event": "frame", "solids": {BALL: ball}, "fluid": {"max_speed": fluid}, "contacts": {"pairs": contacts}}


def meeting(first: str, second: str, depth: float, exchanged: int = 0) -> tuple[dict[str, Any], ...]:
    pair = {"solids": [first, second], "surface_overlap": depth, "exchanged_vertices": exchanged}
    return (pair | ({"exchanged_place": [0.1, 0.2, -0.3]} if exchanged else {}),)


def energy(kinetic: float, potential: float = 0.0) -> dict[str, Any]:
    line = step()
    line["energy"]["at_start"] |= {"solid_kinetic": kinetic, "potential": potential}
    return line


GOOD = [step(), step(), frame()]
REPAIRED = step(repairs={"repaired_cells": 10})
FAILED = step(unconverged=1, velocity_residual=0.02)
# Code: (the scene, lines that hold it at last, other, worst value), (the scene, lines that just do not).
CASES = {
    "overlap": (
        (watched(), [*GOOD, step(), frame(meeting(BALL, "/World/Rock", 1.0))], "/World/Rock", 1.0),
        (watched(), [*GOOD, step(), frame(meeting(BALL, "/World/Rock", 0.99))]),
    ),
    "overlap in a wall": (
        (watched(), [*GOOD, step(), frame(extent_min=[0.4, -0.15, 0.4])], "wallYMin", 1.5),
        (watched(domain={"wall[0]": 2}), [*GOOD, step(), frame(extent_min=[-0.01, -0.15, 0.4])]),
    ),
    "exchanged_sides": (
        (watched(), [*GOOD, step(), frame(meeting(BALL, "/World/Rock", 0.4, 3))], "/World/Rock", 3.0),
        (watched(), [*GOOD, step(), frame(meeting(BALL, "/World/Rock", 0.9, 0))]),
    ),
    "repaired_cells": (
        (watched(), [*GOOD, REPAIRED, step(), frame()], "", 0.01),
        (watched(), [*GOOD, step(repairs={"repaired_cells": 9}), frame()]),
    ),
    "volume": (
        (watched(), [*GOOD, step(), frame(volume_mesh=0.01), step(), frame(volume_mesh=0.007)], "", 0.125),
        (watched(fill={}), [*GOOD, step(), frame(volume_mesh=0.01), step(), frame(volume_mesh=0.01)]),
    ),
    "not_converged": (
        (watched(), [*GOOD, FAILED, FAILED, *[step()] * 18, frame()], "", 0.1),
        (watched(), [*GOOD, FAILED, step(), frame()]),
    ),
    "held_solid": (
        (watched(pinned={BALL}), [*GOOD, FAILED, frame()], "", 0.02),
        (watched(pinned={BALL}), [*GOOD, FAILED, frame(center=[0.5, 0.499, 0.5])]),
    ),
    "energy_rises": (
        (watched(), [*GOOD, energy(0.9), frame(), energy(0.95), energy(0.9201), frame()], "", 0.0201),
        (watched(), [*GOOD, energy(0.5, 0.5), frame(), energy(1.9, -0.9), energy(0.9), energy(1.9), frame()]),
    ),
    "false_edges": (
        (watched(), [*GOOD, step(), frame(false_edges=3), step(), frame(false_edges=2)], "", 2.0),
        (watched(), [*GOOD, step(), frame(false_edges=3), step(), frame(), step(), frame(false_edges=1)]),
    ),
    "folds": (
        (watched(), [*GOOD, *[step(), frame(meeting(BALL, BALL, 0.2))] * 2], "", 0.2),
        (watched(), [*GOOD, *[step(), frame(meeting(BALL, BALL, -0.1))] * 2]),
    ),
    "fast_fluid": (
        (watched(), [*GOOD, step(), frame(fluid=12.0), step(), frame(fluid=10.0)], "", 10.0),
        (watched(drive=2.0), [*GOOD, step(), frame(fluid=12.0), step(), frame(fluid=10.0)]),
    ),
}


def test_what_crosses_less_than_a_voxel_in_a_frame_is_not_fast() -> None:
    lines = [*GOOD, *[step(), frame(fluid=12.0)] * 2]
    assert [w["code"] for w in looked_at(watched(slow=11.9), lines)[0].warnings] == ["fast_fluid"]
    assert looked_at(watched(slow=12.1), lines)[0].warnings == []


def looked_at(scene: Watched, lines: list[dict[str, Any]]) -> tuple[Watch, str]:
    """A watch that has seen lines, numbered, and what it said on standard error."""
    said = io.StringIO()
    watch = Watch(scene, Log(said))
    for line in numbered(lines):
        if line["event"] == "step":
            watch.step(line)
        else:
            watch.frame(line)
    watch.sum_up()
    return watch, said.getvalue()


def numbered(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    frames = [sum(line["event"] == "frame" for line in lines[:k]) + 1 for k in range(len(lines))]
    return [{**line, "frame": number} for line, number in zip(lines, frames, strict=True)]


def test_exchanged_sides_are_told_with_their_place_in_the_stage():
    watch, said = looked_at(*CASES["exchanged_sides"][0][:2])
    assert "have come out at (15, 20, -30) on another side than they went in" in said
    assert watch.warnings[0]["place"] == [15.0, 20.0, -30.0]
    lines = [*GOOD, step(), frame(meeting(BALL, "/World/Rock", 0.4, 3))]
    del lines[-1]["contacts"]["pairs"][0]["exchanged_place"]
    watch, said = looked_at(watched(), lines)  # of an older run
    assert "3 vertices of it and /World/Rock have come out on another side" in said and "place" not in watch.warnings[0]


def test_every_condition_has_a_case():
    assert {name.split()[0] for name in CASES} == set(CONDITIONS)


@pytest.mark.parametrize("name", CASES)
def test_a_condition_is_told_when_it_holds_and_not_before(name):
    (scene, lines, other, worst), (innocent, just_not) = CASES[name]
    watch, said = looked_at(scene, lines)
    last = sum(line["event"] == "frame" for line in lines)
    found = [(w["code"], w["other"], w["frame"], w["worst_frame"]) for w in watch.warnings]
    assert (name.split()[0], other, last, last) in found, said
    told = next(w for w in watch.warnings if w["code"] == name.split()[0])
    assert told["worst"] == pytest.approx(worst) and told["worst"] >= told["limit"]
    assert f"warning: {told['prim']}: frame {last}: " in said and f"{told['prim']}: since frame {last}: " in said
    assert looked_at(innocent, just_not)[0].warnings == []


def test_a_condition_is_told_once_a_prim_and_at_the_end_with_its_worst():
    deep = [line for depth in (1.2, 3.0, 2.0) for line in (step(), frame(meeting(BALL, "/World/Rock", depth)))]
    _, said = looked_at(watched(), deep)
    first, last = said.splitlines()
    assert first.startswith(f"warning: {BALL}: frame 1: it is 1.2 cells deep in /World/Rock (limit 1): ")
    assert last == f"warning: {BALL}: since frame 1: overlap (/World/Rock): at worst 3, limit 1, in frame 2"


def test_work_from_outside_is_no_rise():
    risen = [energy(1.0), frame(), energy(2.0), frame()]
    pushed = [energy(1.0), {**energy(1.5), "prescribed_work": {BALL: 1.0}}, frame(), energy(2.0), frame()]
    assert looked_at(watched(), pushed)[0].warnings == []
    assert [w["code"] for w in looked_at(watched(), risen)[0].warnings] == ["energy_rises"]
    open_box = watched(domain={"wall[3]": binding.WALLS["open"]})
    assert looked_at(open_box, risen)[0].warnings == []


def test_a_solid_that_was_stretched_to_another_volume_is_judged_once_it_has_its_own():
    swelling = [line for volume in (0.004, 0.006, 0.0079) for line in (step(), frame(volume_mesh=volume))]
    assert looked_at(watched(fill={BALL: 0.5}), swelling)[0].warnings == []
    again = [*swelling, step(), frame(volume_mesh=0.004), step(), frame(volume_mesh=0.004)]
    assert [w["frame"] for w in looked_at(watched(fill={BALL: 0.5}), again)[0].warnings] == [5]


@pytest.mark.parametrize("name", CASES)
def test_a_watch_that_goes_on_from_any_line_ends_as_one_that_saw_all(name):
    (scene, lines, *_), _ = CASES[name]
    lines = numbered([*lines, *lines])
    whole = Watch(scene, Log(io.StringIO()))
    whole.replay(lines)
    for cut in range(len(lines)):
        said = io.StringIO()
        parts = Watch(scene, Log(said))
        parts.replay(json.loads(json.dumps(lines[:cut])))
        assert said.getvalue() == ""
        parts.replay(lines[cut:])
        assert parts.warnings == whole.warnings


def solid(stage: Usd.Stage, path: str, points: np.ndarray, counts: list[int], indices: list[int]) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr(counts)
    mesh.CreateFaceVertexIndicesAttr(indices)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    return mesh


def test_a_ball_as_heavy_as_what_it_falls_on_is_stiff_goes_through_and_the_run_ends_with_4(cli, tmp_path):
    stage = metric_stage(tmp_path / "heavy.usda", (1, 12))
    UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    author(box(stage, DOMAIN, (0, 0.2, 0), (0.4, 0.4, 0.4), 1.0, "EulerFsiDomainAPI"), voxelSize=0.02)
    points, counts, indices = sphere(1.0, 16)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    faces = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    block = solid(stage, "/World/Block", corners * (0.16, 0.08, 0.16) + (0, 0.09, 0), [4] * 6, faces)
    ball = solid(stage, BALL, 0.08 * points + (0, 0.27, 0), counts, indices)
    author(block.GetPrim(), youngsModulus=1e4)
    author(ball.GetPrim(), youngsModulus=1e5)
    UsdPhysics.MassAPI.Apply(ball.GetPrim()).CreateDensityAttr(1e4)
    stage.GetRootLayer().Save()
    done = cli("simulate", tmp_path / "heavy.usda", "-o", tmp_path / "cache")
    assert done.returncode == 4
    through = (
        r"solid \d \((.*)\) has passed through solid \d \((.*)\): its vertex \d+ has come out at "
        r"\((\S+), (\S+), (\S+)\), on another side than it went in"
    )
    *solids, x, y, z = re.search(through, done.stderr).groups()
    assert set(solids) == {BALL, "/World/Block"}
    place = np.array([float(x), float(y), float(z)])
    assert (np.abs(place - (0, 0.1, 0)) < (0.2, 0.14, 0.2)).all(), "it is where the two are"
    manifest = json.loads((tmp_path / "cache/manifest.json").read_text())
    assert manifest["status"] == "failed" and 4 <= len(manifest["frames"]) < 12


def test_a_bar_of_steel_whose_solve_gives_up_is_told(cli, tmp_path):
    stage = metric_stage(tmp_path / "bar.usda", (1, 2))
    UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    author(box(stage, DOMAIN, (0, 0, 0), (1.2, 0.6, 0.6), 1.0, "EulerFsiDomainAPI"), voxelSize=0.02, ambientFluid=False)
    points, counts, indices = sphere(0.5, 20)
    bar = solid(stage, "/World/Bar", points * (0.9, 0.1, 0.1), counts, indices)
    author(bar.GetPrim(), youngsModulus=2e11, poissonsRatio=0.45)
    pin = UsdGeom.PrimvarsAPI(bar).CreatePrimvar("eulerfsi:pin", Sdf.ValueTypeNames.FloatArray, "vertex")
    pin.Set([float(x < -0.4) for x in points[:, 0]])
    stage.GetRootLayer().Save()
    done = cli("simulate", tmp_path / "bar.usda", "-o", tmp_path / "cache")
    (kept,) = warnings_of(tmp_path / "cache")
    assert (kept["code"], kept["prim"], kept["frame"], kept["limit"]) == ("held_solid", "/World/Bar", 2, 0.01)
    assert "/World/Bar: frame 2: it is pinned and does not move" in done.stderr


@pytest.fixture(scope="module")
def wrong(tmp_path_factory, library) -> tuple[Path, Path]:
    """A scene with a warning, and its whole cache."""
    folder = tmp_path_factory.mktemp("wrong")
    make_scene(folder / "small.usda", frames=(1, 12), voxel=0.06)
    simulate(folder / "small.usda", Options(output=folder / "cache", settings=NEVER[1::2], progress="none"))
    return folder / "small.usda", folder / "cache"


def warnings_of(folder: Path) -> list[dict[str, Any]]:
    return json.loads((folder / "manifest.json").read_text())["warnings"]


def test_a_clean_scene_has_no_warning(cli, scene, tmp_path):
    done = cli("simulate", scene, "--set", "Domain.energyLedger=true", "--frames", "1-12", "--progress", "json")
    assert done.returncode == 0 and done.stderr == ""
    assert [one for one in events(done.stdout, 0) if one["event"] == "warning"] == []
    assert warnings_of(tmp_path / "small_cache") == []
    assert "warning" not in cli("info", tmp_path / "small_cache").stdout


def test_the_manifest_info_and_the_events_have_the_warnings(cli, wrong, tmp_path):
    scene, _ = wrong
    done = cli("simulate", scene, *NEVER, "--frames", "1-3", "-o", tmp_path / "cache", "--progress", "json")
    first, last = [one for one in events(done.stdout, 0) if one["event"] == "warning"]
    (kept,) = warnings_of(tmp_path / "cache")
    assert {"code": "not_converged", "prim": DOMAIN, "frame": 2, "limit": 0.1, "value": 1.0}.items() <= first.items()
    assert (last["code"], last["prim"], last["frame"], last["value"]) == ("not_converged", DOMAIN, 2, 1.0)
    expected = {"code": "not_converged", "prim": DOMAIN, "other": "", "frame": 2, "value": 1.0, "limit": 0.1}
    assert kept == {**expected, "worst": 1.0, "worst_frame": 2}
    assert json.loads(cli("info", tmp_path / "cache", "--json").stdout)["warnings"] == [kept]
    assert f"warning: {last['message']}" in cli("info", tmp_path / "cache").stdout


@pytest.mark.parametrize("how", ["between frames", "inside a frame"])
def test_a_resumed_run_ends_with_the_warnings_of_a_whole_one_and_repeats_none(wrong, tmp_path, how):
    scene, whole = wrong
    options = {"output": tmp_path / "cache", "settings": NEVER[1::2], "progress": "none"}
    if how == "between frames":
        simulate(scene, Options(**options, frames="1-5"))
    else:
        stop_after(start(scene, tmp_path / "cache", *NEVER), 4, signal.SIGTERM, 0.02)
    assert len(warnings_of(tmp_path / "cache")) == 1
    simulate(scene, Options(**options, resume=True))
    assert warnings_of(tmp_path / "cache") == warnings_of(whole) != []
    assert content_hashes(tmp_path / "cache") == content_hashes(whole)
    assert (tmp_path / "cache/log").read_text().count("frame 2: 100 % of the frame's steps") == 1


def test_what_is_made_again_warns_again(wrong, tmp_path):
    scene, whole = wrong
    shutil.copytree(whole, tmp_path / "cache")
    manifest = json.loads((tmp_path / "cache/manifest.json").read_text())
    for checkpoint in manifest["checkpoints"]:
        (tmp_path / "cache" / checkpoint["file"]).unlink()
    (tmp_path / "cache/frames/small.0003.usdc").unlink()
    options = {"output": tmp_path / "cache", "settings": NEVER[1::2], "progress": "none", "allow_restart": True}
    simulate(scene, Options(**options, resume=True))
    assert warnings_of(tmp_path / "cache") == warnings_of(whole)


def test_strict_stops_after_the_frame_and_the_run_goes_on_without_it(cli, wrong, tmp_path):
    scene, whole = wrong
    run = ["simulate", scene, *NEVER, "-o", tmp_path / "cache", "--progress", "json"]
    done = cli(*run, "--strict")
    found = events(done.stdout, 6)
    assert done.returncode == 6 and "stopped by --strict after frame 2 (not_converged)" in done.stderr
    assert found[-1]["last_frame"] == 2 and [one["code"] for one in found if one["event"] == "error"] == ["strict"]
    manifest = json.loads((tmp_path / "cache/manifest.json").read_text())
    assert manifest["status"] == "strict" and manifest["checkpoints"][-1]["frame"] == 2
    assert ", stopped by --strict," in cli("info", tmp_path / "cache").stdout
    again = cli(*run, "--strict", "--resume")
    assert again.returncode == 6 and [one for one in events(again.stdout, 6) if one["event"] == "frame"] == []
    assert cli(*run, "--resume").returncode == 0
    assert content_hashes(tmp_path / "cache") == content_hashes(whole)
    assert warnings_of(tmp_path / "cache") == warnings_of(whole)
    assert cli(*run, "--strict", "--resume").returncode == 6


def test_strict_lets_a_clean_run_end(cli, scene):
    assert cli("simulate", scene, "--strict", "--progress", "json").returncode == 0


def test_what_is_watched_of_a_scene(tmp_path, library):
    make_scene(tmp_path / "small.usda", smoke=True)
    settings = ("Domain.wallVelocityXMin=(0,3,4)", "Domain.smokeBuoyancy=2", "Domain.fluidViscosity=0.1")
    scene, _ = load_scene(tmp_path / "small.usda", Options(settings=settings), Log(io.StringIO()), 2**33)
    found = Watched.of(scene)
    assert found.fill == {BALL: 1.0} and found.moving_walls and found.drive == pytest.approx(5.0)
    assert found.pinned == set()
