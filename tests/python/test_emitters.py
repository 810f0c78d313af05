"""Emitters, jets and puffs: from the stage through a run, and what is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from conftest import author, box, content_hashes, make_scene, sphere
from eulerfsi.cli.report import validate
from eulerfsi.errors import EulerFsiError
from eulerfsi.run.simulate import Options, simulate
from eulerfsi.scene.read import read_scene
from eulerfsi_usd import checks
from pxr import Gf, Usd, UsdGeom

VOXEL = 0.05


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """The box of the small scene without ball and carpet, open at the top; gravity acts on nothing."""
    stage = make_scene(tmp_path / "room.usda", smoke=False, voxel=VOXEL, frames=(1, 3))
    stage.RemovePrim("/World/Ball")
    author(stage.GetPrimAtPath("/World/Domain"), wallYMax="open")
    stage.GetRootLayer().Save()
    return tmp_path / "room.usda"


def emit(path: Path, kind: str, **values: object) -> Usd.Stage:
    """Adds an emitter at the origin; a Mesh is a ball of radius 0.12. Returns the stage, saved."""
    stage = Usd.Stage.Open(str(path))
    prim = stage.DefinePrim("/World/Source", kind)
    if kind == "Mesh":
        points, counts, indices = sphere(0.12, 24)
        mesh = UsdGeom.Mesh(prim)
        mesh.CreatePointsAttr(points)
        mesh.CreateFaceVertexCountsAttr(counts)
        mesh.CreateFaceVertexIndicesAttr(indices)
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    elif kind == "Cube":
        prim.GetAttribute("size").Set(0.2)
    else:
        prim.GetAttribute("radius").Set(0.12)
        if prim.HasAttribute("height"):
            prim.GetAttribute("height").Set(0.2)
    prim.ApplyAPI("EulerFsiEmitterAPI")
    author(prim, **values)
    save(stage)
    return stage


def save(stage: Usd.Stage) -> None:
    stage.GetRootLayer().Save()


def run(path: Path, folder: Path, **options: object) -> tuple[Path, list[dict]]:
    """The cache of a scene and the lines of its statistics."""
    result = simulate(path, Options(output=folder, progress="none", threads=2, **options))
    return result.folder, [json.loads(line) for line in (result.folder / "stats.jsonl").read_text().splitlines()]


# Area of the shapes of emit() across y; round axes lie along z.
AREAS = {
    "Sphere": math.pi * 0.0144,
    "Mesh": math.pi * 0.0144,
    "Cube": 0.04,
    "Cylinder": 0.24 * 0.2,
    "Cone": 0.12 * 0.2,
    "Capsule": 0.24 * 0.2 + math.pi * 0.0144,
}


@pytest.mark.parametrize("kind", AREAS)
def test_every_closed_shape_is_a_jet_with_its_flux(kind: str, room: Path, tmp_path: Path, library) -> None:
    emit(room, kind, emitVelocity=True, velocity=Gf.Vec3d(0, 1.5, 0), smokeDensity=0.7)
    folder, events = run(room, tmp_path / "cache", frames="1-2")
    steps = [event for event in events if event["event"] == "step"]
    assert steps
    for step in steps:
        assert step["emitter_flux"]["/World/Source"] == pytest.approx(1.5 * AREAS[kind], rel=0.01)
    smoke = [event["fluid"]["smoke"] for event in events if event["event"] == "frame"]
    assert smoke[0] > 0.0  # the first frame shows it
    assert smoke[1] > smoke[0] + 0.9 * 0.7 * 1.5 * AREAS[kind] / 24
    assert (folder / "volumes").exists() or list(folder.rglob("*.vdb"))


@pytest.mark.parametrize("kind", ["Cone", "Mesh"])
def test_an_initial_fill_may_have_any_shape(kind: str, room: Path, tmp_path: Path, library) -> None:
    emit(room, kind, mode="initial", smokeDensity=0.5)
    _, events = run(room, tmp_path / "cache")
    smoke = [event["fluid"]["smoke"] for event in events if event["event"] == "frame"]
    volume = {"Cone": math.pi * 0.0144 * 0.2 / 3, "Mesh": 4 / 3 * math.pi * 0.12**3}[kind]
    assert smoke[0] == pytest.approx(0.5 * volume, rel=0.3)  # a few cells across
    assert smoke[-1] == pytest.approx(smoke[0], rel=0.01)


def puff(room: Path) -> Usd.Stage:
    """On from frame 2 to 4; its speed grows from 0 at frame 2 to 2.4 at frame 6, its smoke from 0.2 to 1."""
    stage = emit(room, "Cylinder", emitVelocity=True)
    prim = stage.GetPrimAtPath("/World/Source")
    for frame, on in ((1, False), (2, True), (4, False)):
        prim.GetAttribute("eulerfsi:enabled").Set(on, frame)
    for frame, share in ((2, 0.0), (6, 1.0)):
        prim.GetAttribute("eulerfsi:velocity").Set(Gf.Vec3d(0, 2.4 * share, 0), frame)
        prim.GetAttribute("eulerfsi:smokeDensity").Set(0.2 + 0.8 * share, frame)
    stage.SetEndTimeCode(7)
    save(stage)
    return stage


def test_a_puff_follows_its_samples(room: Path, tmp_path: Path, library) -> None:
    puff(room)
    assert not [issue.message for issue in checks.check_stage(Usd.Stage.Open(str(room)))]
    _, events = run(room, tmp_path / "cache")
    steps = [event for event in events if event["event"] == "step"]
    brought = {
        frame: sum(s["dt"] * s["emitter_flux"]["/World/Source"] for s in steps if s["frame"] == frame)
        for frame in range(2, 8)
    }
    area = AREAS["Cylinder"]
    assert brought[2] == 0.0
    assert brought[3] == pytest.approx(0.3 * area / 24, rel=0.01)  # mean speeds 0.3 and 0.9 m/s
    assert brought[4] == pytest.approx(0.9 * area / 24, rel=0.01)
    assert brought[5] == brought[6] == brought[7] == 0.0
    smoke = {event["frame"]: event["fluid"]["smoke"] for event in events if event["event"] == "frame"}
    assert smoke[1] == smoke[2] == 0.0
    assert 0.0 < smoke[3] < smoke[4]
    assert smoke[7] == pytest.approx(smoke[4], rel=0.05)  # the box is so small that the open side sees all of it


def test_held_samples_are_steps(room: Path, library) -> None:
    stage = puff(room)
    stage.SetInterpolationType(Usd.InterpolationTypeHeld)
    keys = read_scene(stage, room).emitters[0].keys
    assert [key["time"] * 24 for key in keys] == pytest.approx([0, 1, 1, 3, 3, 5, 5])
    assert [key["velocity"][1] for key in keys] == pytest.approx([0, 0, 0, 0, 0, 0, 2.4])
    assert [key["on"] for key in keys] == [0, 0, 1, 1, 0, 0, 0]


def test_a_run_with_a_puff_goes_on_where_it_stopped(room: Path, tmp_path: Path, library) -> None:
    puff(room)
    whole, _ = run(room, tmp_path / "whole")
    part, _ = run(room, tmp_path / "part", frames="1-3")
    part, _ = run(room, tmp_path / "part", resume=True)
    assert content_hashes(part) == content_hashes(whole)


def test_in_a_closed_box_a_jet_is_a_fan_and_the_user_is_told(room: Path, tmp_path: Path, cli) -> None:
    stage = emit(room, "Sphere", emitVelocity=True, velocity=Gf.Vec3d(0, 1.5, 0))
    author(stage.GetPrimAtPath("/World/Domain"), wallYMax="noSlip")
    save(stage)
    text = cli("validate", room).stdout
    assert "/World/Source.eulerfsi:emitVelocity = true" in text and "no open side" in text
    _, events = run(room, tmp_path / "cache")
    assert all(event["emitter_flux"]["/World/Source"] == 0.0 for event in events if event["event"] == "step")
    assert [event["fluid"]["kinetic_energy"] for event in events if event["event"] == "frame"][-1] > 0.0


def test_a_jet_inside_a_collider_is_told_of_once(room: Path, tmp_path: Path, cli) -> None:
    stage = emit(room, "Sphere", emitVelocity=True, velocity=(0.0, 1.5, 0.0))
    cover = box(stage, "/World/Cover", (0, 0, 0), (0.4, 0.4, 0.4), 1.0, "EulerFsiColliderAPI")
    save(stage)
    warning = "warning: /World/Source: frame 2: the emitter has a velocity but adds no fluid"
    assert cli("simulate", room, "-o", tmp_path / "covered").stderr.count(warning) == 1
    author(stage.GetPrimAtPath("/World/Source"), startTime=0.5 / 24)
    save(stage)
    late = cli("simulate", room, "-o", tmp_path / "late").stderr
    assert late.count(warning.replace("frame 2", "frame 3")) == late.count("adds no fluid") == 1  # not before it blows
    cover.GetAttribute("size").Set(0.25)  # a quarter of what it was: the jet looks out
    save(stage)
    assert "adds no fluid" not in cli("simulate", room, "-o", tmp_path / "free").stderr


def messages(path: Path) -> str:
    """What `validate` says of a scene that it refuses."""
    with pytest.raises(EulerFsiError) as error:
        validate(path, None, None, [], 2)
    return str(error.value)


def test_bad_emitters_are_refused(room: Path, library) -> None:
    stage = emit(room, "Mesh")
    prim = stage.GetPrimAtPath("/World/Source")
    move = UsdGeom.Xformable(prim).AddTranslateOp()
    move.Set(Gf.Vec3d(0.9, 0, 0))
    save(stage)
    text = messages(room)
    assert "/World/Source: the emitter reaches from" in text and "inside the domain /World/Domain" in text

    move.Set(Gf.Vec3d(0, 0, 0))
    mesh = UsdGeom.Mesh(prim)
    counts, indices = mesh.GetFaceVertexCountsAttr().Get(), mesh.GetFaceVertexIndicesAttr().Get()
    mesh.GetFaceVertexCountsAttr().Set(list(counts)[:-1])
    mesh.GetFaceVertexIndicesAttr().Set(list(indices)[:-3])
    save(stage)
    assert "/World/Source: the mesh has 3 open edges: must be 0: an emitter is a closed mesh" in messages(room)

    stage.RemovePrim("/World/Source")
    save(stage)
    stage = emit(room, "Sphere")
    stage.GetPrimAtPath("/World/Source").GetAttribute("radius").Set(0.01)
    save(stage)
    text = messages(room)
    assert "/World/Source: " in text and "holds 0 middles of cells" in text and "too small for voxels of 0.05 m" in text


def test_samples_that_do_not_count_are_a_warning_and_bad_ones_an_error(room: Path) -> None:
    stage = emit(room, "Cone", emitVelocity=True)
    prim = stage.GetPrimAtPath("/World/Source")
    for frame in (1, 2):
        prim.GetAttribute("eulerfsi:startTime").Set(0.1 * frame, frame)
        prim.GetAttribute("radius").Set(0.1 * frame, frame)
        prim.GetAttribute("eulerfsi:smokeDensity").Set(1.5 - frame, frame)
    found = {(issue.field, issue.severity, issue.value) for issue in checks.check_stage(stage)}
    assert found == {
        ("eulerfsi:startTime", "warning", "2 time samples"),
        ("xformOpOrder", "warning", "its radius"),
        ("eulerfsi:smokeDensity", "error", "-0.5"),
    }
    author(prim, mode="initial")
    fields = [issue.field for issue in checks.check_stage(stage) if issue.code == "Animated"]
    assert fields == ["eulerfsi:smokeDensity", "eulerfsi:startTime"]


def test_an_emitter_that_is_on_later_counts(room: Path, library) -> None:
    stage = puff(room)
    assert len(read_scene(stage, room).emitters) == 1
    attribute = stage.GetPrimAtPath("/World/Source").GetAttribute("eulerfsi:enabled")
    attribute.Clear()
    attribute.Set(False)
    assert read_scene(stage, room).emitters == []


def test_a_jet_pushes_a_soft_ball(tmp_path: Path, library) -> None:
    """From below, in a fluid as heavy as itself: it is pressed flat and moves up."""
    path = tmp_path / "blown.usda"
    stage = make_scene(path, smoke=False, voxel=0.04, frames=(1, 7), velocity=(0, 0, 0))
    author(stage.GetPrimAtPath("/World/Domain"), wallYMax="open", fluidDensity=1000.0)
    stage.GetPrimAtPath("/World/PhysicsScene").GetAttribute("physics:gravityMagnitude").Set(0.0)
    author(stage.GetPrimAtPath("/World/Ball"), youngsModulus=2000.0)
    stage.GetRootLayer().Save()
    stage = emit(path, "Cylinder", emitVelocity=True, velocity=Gf.Vec3d(0, 2, 0))
    prim = stage.GetPrimAtPath("/World/Source")
    UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(0, -0.33, 0))
    prim.GetAttribute("axis").Set("Y")
    save(stage)
    _, events = run(path, tmp_path / "cache")
    last = [event for event in events if event["event"] == "frame"][-1]["solids"]["/World/Ball"]
    velocity = np.array(last["momentum"]) / last["mass"]
    assert velocity[1] > 0.05 and np.abs(velocity[[0, 2]]).max() < 0.1 * velocity[1]
    low, high = np.array(last["extent_min"]), np.array(last["extent_max"])
    assert (high - low)[1] < 0.97 * (high - low)[0]
    assert last["volume_mesh"] == pytest.approx(last["rest_volume"], rel=0.01)


def move(stage: Usd.Stage, *keys: tuple[float, tuple[float, float, float]]) -> None:
    """The emitter's translation over time."""
    source = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Source"))
    op = (source.GetOrderedXformOps() or [source.AddTranslateOp()])[0]
    for frame, place in keys:
        op.Set(Gf.Vec3d(*place), frame)
    save(stage)


@pytest.mark.parametrize("kind", ["Sphere", "Mesh"])
def test_an_emitter_that_moves_leaves_smoke_along_its_way(kind: str, room: Path, tmp_path: Path, library) -> None:
    stage = emit(room, kind, smokeDensity=0.7)
    move(stage, (1, (-0.15, -0.1, 0)), (3, (0.15, -0.1, 0)))
    assert "AnimatedPrim" not in [issue.code for issue in checks.check_stage(stage)]
    emitter = read_scene(stage, room).emitters[0]
    assert len(emitter.stays) == 2 * 3 + 1  # 0.15 m a frame, voxels of 0.05 m, and where it rests
    low, high = emitter.extent()
    assert low[0] == pytest.approx(-0.15 - 0.12 + 0.025, abs=0.003) and high[0] == pytest.approx(0.27, abs=0.003)
    folder, events = run(room, tmp_path / "cache")
    frames = {event["frame"]: event["fluid"]["smoke"] for event in events if event["event"] == "frame"}
    swept = 0.7 * (
        4 / 3 * math.pi * 0.12**3 + math.pi * 0.0144 * 0.25
    )  # between the middles of the first and last part
    assert frames[3] == pytest.approx(swept, rel=0.12) and frames[1] < 0.6 * frames[3]
    again, _ = run(room, tmp_path / "again", frames="1-2")
    assert content_hashes(again) == {k: v for k, v in content_hashes(folder).items() if k in content_hashes(again)}


def test_a_jet_that_moves_brings_its_volume_and_has_its_motion_where_asked(room: Path, tmp_path: Path, library) -> None:
    stage = emit(room, "Sphere", emitVelocity=True, velocity=Gf.Vec3d(0, 1.5, 0))
    move(stage, (1, (-0.1, -0.1, 0)), (3, (0.1, -0.1, 0)))
    _, events = run(room, tmp_path / "cache")
    steps = [event for event in events if event["event"] == "step"]
    for frame in (2, 3):
        brought = sum(s["dt"] * s["emitter_flux"]["/World/Source"] for s in steps if s["frame"] == frame)
        assert brought == pytest.approx(1.5 * AREAS["Sphere"] / 24, rel=0.02)
    plain = read_scene(stage, room).emitters[0]
    assert np.abs(plain.over_time("velocity") - [0, 1.5, 0]).max() == 0.0
    author(stage.GetPrimAtPath("/World/Source"), addMotion=True)
    save(stage)
    moved = read_scene(stage, room).emitters[0]
    assert moved.over_time("velocity")[0] == pytest.approx([2.4, 1.5, 0.0])  # 0.1 m a frame
    assert moved.over_time("velocity")[-1] == pytest.approx([0.0, 1.5, 0.0])  # it rests
    author(stage.GetPrimAtPath("/World/Source"), emitVelocity=False)
    stage.GetPrimAtPath("/World/Source").GetAttribute("eulerfsi:velocity").Clear()
    save(stage)
    pushed = read_scene(stage, room).emitters[0]
    assert pushed.values["has_velocity"] and pushed.over_time("velocity")[0] == pytest.approx([2.4, 0.0, 0.0])


def test_an_emitter_may_come_into_the_box_later_but_not_never(room: Path, tmp_path: Path, library) -> None:
    stage = emit(room, "Sphere")
    move(stage, (1, (-0.6, -0.1, 0)), (2, (0.0, -0.1, 0)))
    _, events = run(room, tmp_path / "cache")
    frames = {event["frame"]: event["fluid"]["smoke"] for event in events if event["event"] == "frame"}
    assert frames[1] == 0.0 and frames[2] > 0.004
    move(stage, (1, (-0.6, 9, 0)), (2, (0.0, 9, 0)))
    assert "/World/Source: the emitter reaches from" in messages(room)


def test_an_emitter_with_too_many_places_is_refused(room: Path, library) -> None:
    stage = emit(room, "Mesh")
    move(stage, *[(frame, (0.05 * (-1) ** frame, 0, 0)) for frame in range(1, 300)])
    assert "/World/Source: moves through" in messages(room) and "must be at most 400" in messages(room)
