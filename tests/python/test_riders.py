"""Passengers of colliders: what is below one whose points move, or named by it, follows its surface."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from conftest import content_hashes, make_scene, sphere, world_points
from eulerfsi.errors import MismatchError
from eulerfsi.run.simulate import Options, simulate
from eulerfsi_usd import checks
from eulerfsi_usd.pose import Pose
from figures import BODY as FIGURE
from figures import make_figure
from pxr import Gf, Sdf, Usd, UsdGeom

BODY = "/World/Body"
FRAMES = (1, 5)


def body_points(frame: int) -> np.ndarray:
    """A ball that bulges to one side, leans and is carried off: points (n, 3)."""
    points = sphere(0.12, 8)[0]
    way = (frame - 1) / 4
    points[:, 0] *= 1.0 + 0.3 * way * np.sin(20.0 * points[:, 1])
    points[:, 2] += 0.25 * way * points[:, 1]
    return points + (0.02 * way, 0.0, 0.0)


def turned(points: np.ndarray, frame: int) -> np.ndarray:
    """Rigid: around an axis of its own, and away."""
    turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 2, 0.5), 11.0 * (frame - 1)))
    matrix = np.array(turn)
    return points @ matrix[:3, :3] + (0.01 * (frame - 1), -0.004 * (frame - 1), 0.0)


def add_mesh(stage: Usd.Stage, path: str, points: np.ndarray, counts: list, indices: list) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr(counts)
    mesh.CreateFaceVertexIndicesAttr(indices)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    return mesh


def make_body(path: Path, points_at) -> Usd.Stage:
    """A collider in vacuum at the lower side of a box whose points move and whose transform does; a ball above it."""
    stage = make_scene(path, smoke=False, voxel=0.1, velocity=(0.0, 0.0, 0.0), frames=FRAMES, parent=Gf.Matrix4d(1))
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:ambientFluid").Set(False)
    body = add_mesh(stage, BODY, points_at(1), *sphere(0.12, 8)[1:])
    for frame in range(FRAMES[0], FRAMES[1] + 1):
        body.GetPointsAttr().Set(points_at(frame), frame)
    move, turn = body.AddTranslateOp(), body.AddRotateYOp()
    for frame in FRAMES:
        move.Set(Gf.Vec3d(0.01 * frame, -0.32, 0.0), frame)
        turn.Set(3.0 * frame, frame)
    body.GetPrim().ApplyAPI("EulerFsiColliderAPI")
    return stage


def run(stage: Usd.Stage, folder: Path) -> Usd.Stage:
    """The stage that opens the cache."""
    stage.GetRootLayer().Save()
    scene = Path(stage.GetRootLayer().realPath)
    return Usd.Stage.Open(str(simulate(scene, Options(output=folder, progress="none")).root))


def test_a_piece_of_the_surface_stays_on_it(tmp_path: Path, library) -> None:
    stage = make_body(tmp_path / "body.usda", body_points)
    rest = world_points(stage, BODY, 1)
    piece = np.arange(0, len(rest), 3)
    group = UsdGeom.Xform.Define(stage, "/World/Clothes")
    group.AddRotateZOp().Set(33.0)
    group.AddScaleOp().Set(Gf.Vec3f(2.0, 0.5, 1.25))
    to_local = np.linalg.inv(np.array(UsdGeom.XformCache(1).GetLocalToWorldTransform(group.GetPrim())))
    buttons = UsdGeom.Points.Define(stage, "/World/Clothes/Buttons")
    buttons.CreatePointsAttr(rest[piece] @ to_local[:3, :3] + to_local[3, :3])
    stage.GetPrimAtPath(BODY).CreateRelationship("eulerfsi:passengers", False).SetTargets([group.GetPath()])
    result = run(stage, tmp_path / "cache")
    size = np.ptp(rest, axis=0).max()
    moved = np.abs(world_points(result, BODY, 5) - rest).max()
    assert moved > 0.2 * size
    for frame in range(FRAMES[0], FRAMES[1] + 1):
        off = world_points(result, str(buttons.GetPath()), frame) - world_points(stage, BODY, frame)[piece]
        assert np.abs(off).max() < 1e-6 * size, frame


def test_what_turns_rigidly_by_its_points_turns_what_rides_on_it(tmp_path: Path, library) -> None:
    start = sphere(0.12, 8)[0]
    stage = make_body(tmp_path / "body.usda", lambda frame: turned(start, frame))
    points, counts, indices = sphere(0.05, 6)
    place = np.array((0.03, 0.15, 0.02))
    add_mesh(stage, f"{BODY}/Hat", points + place, counts, indices)
    hair = UsdGeom.BasisCurves.Define(stage, f"{BODY}/Hair")
    hair.CreateTypeAttr(UsdGeom.Tokens.linear)
    strands = np.array([(0.1, 0.05, 0), (0.14, 0.09, 0), (0.1, 0, 0.05), (0.2, 0, 0.05)])
    hair.CreatePointsAttr(strands)
    hair.CreateCurveVertexCountsAttr([2, 2])
    result = run(stage, tmp_path / "cache")
    for path, rest in ((f"{BODY}/Hat", points + place), (f"{BODY}/Hair", strands)):
        size = np.ptp(rest, axis=0).max()
        for frame in range(FRAMES[0], FRAMES[1] + 1):
            prim = UsdGeom.PointBased(result.GetPrimAtPath(path))
            off = np.asarray(prim.GetPointsAttr().Get(frame), float) - turned(rest, frame)
            assert np.abs(off).max() < 1e-6 * size, (path, frame)


def test_they_have_normals_extent_and_velocities(tmp_path: Path, library) -> None:
    drift = np.array((0.024, 0.0, -0.012))  # per frame
    start = sphere(0.12, 8)[0]
    stage = make_body(tmp_path / "body.usda", lambda frame: start + drift * (frame - 1))
    points, counts, indices = sphere(0.05, 6)
    add_mesh(stage, f"{BODY}/Hat", points + (0, 0.13, 0), counts, indices)
    result = run(stage, tmp_path / "cache")
    hat = UsdGeom.Mesh(result.GetPrimAtPath(f"{BODY}/Hat"))
    for frame in range(FRAMES[0], FRAMES[1] + 1):
        velocities = np.asarray(hat.GetVelocitiesAttr().Get(frame), float)
        assert np.abs(velocities - 24.0 * drift).max() < 1e-4 * 24.0 * np.abs(drift).max(), frame
        normals = np.asarray(hat.GetNormalsAttr().Get(frame), float)
        away = points / np.linalg.norm(points, axis=1)[:, None]
        assert (normals * away).sum(axis=1).min() > math.cos(math.radians(15))
        now = np.asarray(hat.GetPointsAttr().Get(frame))
        assert np.allclose(hat.GetExtentAttr().Get(frame), [now.min(axis=0), now.max(axis=0)])


def test_velocities_are_those_of_the_frames_beside(tmp_path: Path, library) -> None:
    """At rest until frame 2, then faster and faster, and at rest from frame 4 on."""
    start, places = sphere(0.12, 8)[0], {1: 0.0, 2: 0.0, 3: 0.01, 4: 0.03, 5: 0.03}
    stage = make_body(tmp_path / "body.usda", lambda frame: start + (places[frame], 0.0, 0.0))
    add_mesh(stage, f"{BODY}/Hat", sphere(0.05, 6)[0] + (0, 0.13, 0), *sphere(0.05, 6)[1:])
    result = run(stage, tmp_path / "cache")
    hat = UsdGeom.Mesh(result.GetPrimAtPath(f"{BODY}/Hat"))
    for frame, speed in {1: 0.0, 2: 0.24, 3: 0.36, 4: 0.48, 5: 0.0}.items():
        velocities = np.asarray(hat.GetVelocitiesAttr().Get(frame), float)
        assert np.abs(velocities - (speed, 0.0, 0.0)).max() < 1e-5, frame


@pytest.mark.parametrize("growth", (0.5, 2.0))
def test_what_grows_by_its_points_makes_what_rides_on_it_grow(growth: float, tmp_path: Path, library) -> None:
    start = sphere(0.12, 8)[0]
    stage = make_body(tmp_path / "body.usda", lambda frame: start * (1 + (growth - 1) * (frame - 1) / 4))
    points, counts, indices = sphere(0.05, 6)
    add_mesh(stage, f"{BODY}/Hat", points + (0, 0.13, 0), counts, indices)
    result = run(stage, tmp_path / "cache")
    now = np.asarray(UsdGeom.Mesh(result.GetPrimAtPath(f"{BODY}/Hat")).GetPointsAttr().Get(5), float)
    assert np.abs(now - growth * (points + (0, 0.13, 0))).max() < 1e-6 * growth * 0.1


@pytest.mark.parametrize("stretch", ((1.0, 1.0, 1.0), (1.4, 1.4, 1.4)))
def test_points_that_are_named_follow_a_transform_too(stretch: tuple, tmp_path: Path, library) -> None:
    """A collider without points of its own; what turns and grows by its transform takes along what it names."""
    stage = make_body(tmp_path / "body.usda", body_points)
    stage.RemovePrim(BODY)
    cube = UsdGeom.Cube.Define(stage, BODY)
    cube.CreateSizeAttr(0.2)
    move, turn, size = cube.AddTranslateOp(), cube.AddRotateXYZOp(), cube.AddScaleOp()
    for frame, way in ((1, 0.0), (5, 1.0)):
        move.Set(Gf.Vec3d(0.1 * way, -0.35, 0.02), frame)
        turn.Set(Gf.Vec3f(20.0 * way, 0.0, 30.0 * way), frame)
        size.Set(Gf.Vec3f(*(1 + way * (s - 1) for s in stretch)), frame)
    cube.GetPrim().ApplyAPI("EulerFsiColliderAPI")
    lamp = UsdGeom.Points.Define(stage, "/World/Lamp")
    rest = np.array([(0.05, -0.2, 0.0), (0.0, -0.22, 0.05), (0.03, -0.24, -0.02), (0.12, -0.36, 0.0)])
    lamp.CreatePointsAttr(rest)
    cube.GetPrim().CreateRelationship("eulerfsi:passengers", False).SetTargets([lamp.GetPath()])
    result = run(stage, tmp_path / "cache")
    before, after = (
        np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(stage.GetPrimAtPath(BODY))) for frame in (1, 5)
    )
    motion = np.linalg.inv(before) @ after
    wanted = rest @ motion[:3, :3] + motion[3, :3]
    assert np.abs(wanted - rest).max() > 0.05
    assert np.abs(world_points(result, "/World/Lamp", 5) - wanted).max() < 1e-6 * np.ptp(rest, axis=0).max()


def test_what_is_below_a_skinned_collider_follows_and_what_deforms_itself_does_not(tmp_path: Path, library) -> None:
    stage = make_figure(tmp_path / "figure.usda")
    body = stage.GetPrimAtPath(FIGURE)
    body.RemoveAPI("EulerFsiSolidAPI")
    body.ApplyAPI("EulerFsiColliderAPI")
    skin = UsdGeom.Mesh(body).GetPointsAttr().Get()
    top = int(np.argmax([p[1] for p in skin]))
    eye = add_mesh(stage, f"{FIGURE}/Eye", *sphere(0.03, 4))
    start = Pose(body, True).points(Usd.TimeCode(1))[top]
    eye.AddTranslateOp().Set(Gf.Vec3d(*start))
    tail = add_mesh(stage, f"{FIGURE}/Tail", *sphere(0.03, 4))
    for frame in (1, 2):
        tail.GetPointsAttr().Set(sphere(0.03 * frame, 4)[0], frame)
    result = run(stage, tmp_path / "cache")
    now = Pose(body, True).points(Usd.TimeCode(2))[top]
    assert np.linalg.norm(now - start) > 0.01
    points = np.asarray(UsdGeom.Mesh(result.GetPrimAtPath(f"{FIGURE}/Eye")).GetPointsAttr().Get(2), float)
    assert np.abs(points[[0, -1]].mean(axis=0) - (now - start)).max() < 0.002  # its middle is that vertex
    assert not result.GetPrimAtPath(f"{FIGURE}/Tail").GetAttribute("velocities").HasAuthoredValue()


def test_a_run_that_is_resumed_writes_the_same(tmp_path: Path, library) -> None:
    stage = make_body(tmp_path / "body.usda", body_points)
    hat = add_mesh(stage, f"{BODY}/Hat", *sphere(0.05, 6))
    hat.AddTranslateOp().Set(Gf.Vec3d(0, 0.13, 0))
    run(stage, tmp_path / "whole")
    scene = tmp_path / "body.usda"
    simulate(scene, Options(output=tmp_path / "parts", frames="1-3", progress="none"))
    assert simulate(scene, Options(output=tmp_path / "parts", resume=True, progress="none")).resumed
    assert content_hashes(tmp_path / "whole") == content_hashes(tmp_path / "parts")
    hat.GetPointsAttr().Set(sphere(0.06, 6)[0])
    stage.GetRootLayer().Save()
    with pytest.raises(MismatchError, match="the scene has changed"):
        simulate(scene, Options(output=tmp_path / "parts", frames="1-6", resume=True, progress="none"))


def test_validate_and_info_say_what_rides_on_what(tmp_path: Path, cli) -> None:
    stage = make_body(tmp_path / "body.usda", body_points)
    add_mesh(stage, f"{BODY}/Hat", *sphere(0.05, 6))
    add_mesh(stage, "/World/Ball/Eye", *sphere(0.05, 6))
    run(stage, tmp_path / "cache")
    checked = cli("validate", tmp_path / "body.usda").stdout
    for line in (
        f"{BODY}: collider, 224 triangles, friction 0, moves and deforms",
        f"{BODY}/Hat: follows the surface of {BODY}, 62 points",
        "/World/Ball/Eye: follows /World/Ball, 62 points",
    ):
        assert line in checked.splitlines()
    for number in range(9):
        add_mesh(stage, f"/World/Ball/Freckle{number}", *sphere(0.01, 3))
    stage.GetRootLayer().Save()
    many = "/World/Ball/Eye and 9 more: each follows /World/Ball, 188 points in all"
    assert many in cli("validate", tmp_path / "body.usda").stdout.splitlines()
    told = [" ".join(line.split()) for line in cli("info", tmp_path / "cache").stdout.splitlines()]
    at = told.index(f"{BODY}: collider")
    assert told[at + 1] == "friction 0"
    at = told.index(f"{BODY}/Hat: passenger")
    assert told[at + 1] == f"carried by {BODY}"


def test_what_cannot_follow_is_named(tmp_path: Path, library) -> None:
    stage = make_body(tmp_path / "body.usda", body_points)
    body = stage.GetPrimAtPath(BODY)
    hat = add_mesh(stage, f"{BODY}/Hat", *sphere(0.05, 6))
    assert issues(stage) == []
    size = hat.AddScaleOp()
    for frame, scale in ((1, 1.0), (3, 0.0), (5, 1.0)):
        size.Set(Gf.Vec3f(1.0, scale, 1.0), frame)
    (code, message), (animated, warning) = issues(stage)
    assert code == "FlatTransform" and f"{BODY}/Hat.xformOpOrder = a scale of 0 at frame 3: must be" in message
    assert animated == "AnimatedPassenger" and f"is animated by the transform of {BODY}/Hat" in warning
    size.GetAttr().Clear()
    body.CreateRelationship("eulerfsi:passengers", False).SetTargets(["/World/Nobody", "/World/Ball"])
    assert [code for code, _ in issues(stage)] == ["MissingTarget", "WrongTarget"]
    body.GetRelationship("eulerfsi:passengers").SetTargets([])
    stage.GetPrimAtPath("/World/Ball").CreateRelationship("eulerfsi:passengers", False).SetTargets([f"{BODY}/Hat"])
    [message] = [message for code, message in issues(stage) if code == "ManyCarriers"]
    assert "/World/Ball carries it already" in message


def test_what_has_no_points_is_left_behind_with_a_warning(tmp_path: Path, library) -> None:
    stage = make_body(tmp_path / "body.usda", body_points)
    UsdGeom.PointInstancer.Define(stage, f"{BODY}/Studs")
    UsdGeom.PointInstancer.Define(stage, "/World/Ball/Beads")
    UsdGeom.Sphere.Define(stage, "/World/Ball/Region").CreatePurposeAttr(UsdGeom.Tokens.guide)
    UsdGeom.Sphere.Define(stage, "/World/Ball/Hand").CreateRadiusAttr(0.1)
    stage.GetPrimAtPath("/World/Ball").GetRelationship("eulerfsi:pins").SetTargets(["/World/Ball/Hand"])
    assert [code for code, _ in issues(stage)] == ["LeftBehind"] * 2
    found = [message for _, message in issues(stage)]
    assert found[0].startswith("/World/Ball: does not carry /World/Ball/Beads: only a Mesh, curves, Points")
    assert found[1].startswith(f"{BODY}: does not carry {BODY}/Studs")
    stage.GetPrimAtPath(BODY).GetAttribute("points").Clear()  # what does not deform takes along by its transform
    stage.GetPrimAtPath(BODY).GetAttribute("points").Set(body_points(1))
    assert len(issues(stage)) == 1


def test_a_shape_without_points_rides_on_a_collider_that_deforms(tmp_path: Path, library) -> None:
    stage = make_body(tmp_path / "body.usda", body_points)
    top = int(body_points(1)[:, 1].argmax())
    for kind, name in ((UsdGeom.Sphere, "Button"), (UsdGeom.Points, "Dot")):
        prim = kind.Define(stage, f"{BODY}/{name}")
        prim.AddTranslateOp().Set(Gf.Vec3d(*map(float, body_points(1)[top])))
    UsdGeom.Sphere(stage.GetPrimAtPath(f"{BODY}/Button")).CreateRadiusAttr(0.01)
    UsdGeom.Points(stage.GetPrimAtPath(f"{BODY}/Dot")).CreatePointsAttr([(0, 0, 0)])
    opened = run(stage, tmp_path / "cache")
    for frame in FRAMES:
        matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(opened.GetPrimAtPath(f"{BODY}/Button")))
        assert matrix[3, :3] == pytest.approx(world_points(opened, f"{BODY}/Dot", frame)[0], abs=2e-3)
        assert matrix[3, :3] == pytest.approx(world_points(opened, BODY, frame)[top], abs=2e-3)


def test_an_instance_below_a_collider_that_deforms_is_refused(tmp_path: Path, library) -> None:
    stage = make_body(tmp_path / "body.usda", body_points)
    add_mesh(stage, "/Hats/Top/Brim", *sphere(0.05, 6))
    hat = stage.DefinePrim(f"{BODY}/Hat")
    hat.GetReferences().AddInternalReference("/Hats/Top")
    hat.SetInstanceable(True)
    [(code, message)] = issues(stage)
    assert code == "InstancePassenger"
    wanted = f"{BODY}/Hat.instanceable = true: must be false: {BODY}/Hat/Brim inside it is carried and needs its own"
    assert message.startswith(wanted)
    hat.SetInstanceable(False)
    assert issues(stage) == []


def test_what_is_inside_an_instance_is_checked_too(tmp_path: Path, library) -> None:
    """A whole character brought in as an instance: its collider acts, what rides on it cannot be given points."""
    stage = make_body(tmp_path / "body.usda", body_points)
    layer = stage.GetRootLayer()
    for path in ("/Character", "/World/Hero"):
        stage.DefinePrim(path, "Xform")
    Sdf.CopySpec(layer, BODY, layer, "/Character/Body")
    stage.RemovePrim(BODY)
    add_mesh(stage, "/Character/Body/Hat", *sphere(0.05, 6))
    stage.GetPrimAtPath("/Character").SetSpecifier(Sdf.SpecifierClass)
    hero = stage.GetPrimAtPath("/World/Hero")
    hero.GetReferences().AddInternalReference("/Character")
    hero.SetInstanceable(True)
    assert [code for code, _ in issues(stage)] == ["InstancePassenger"]
    stage.GetPrimAtPath("/Character/Body").GetAttribute("eulerfsi:friction").Set(-1.0)
    assert "OutOfRange" in [code for code, _ in issues(stage)]
    stage.GetPrimAtPath("/Character/Body").GetAttribute("eulerfsi:friction").Set(0.1)
    hero.SetInstanceable(False)
    assert issues(stage) == []


def issues(stage: Usd.Stage) -> list[tuple[str, str]]:
    """Code and message of what the checks say of passengers and colliders."""
    return [(issue.code, issue.message) for issue in checks.check_stage(stage)]
