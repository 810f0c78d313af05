"""Passengers: what is below a solid or named by it rides along, from the stage into the cache."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import make_scene, sphere, world_points
from eulerfsi.run.simulate import Options, simulate
from eulerfsi_usd import checks
from pxr import Gf, Usd, UsdGeom

VOXEL = 0.05


def add_eye(stage: Usd.Stage, path: str, place: tuple[float, float, float], radius: float = 0.02) -> UsdGeom.Mesh:
    """A small ball without a schema of its own."""
    points, counts, indices = sphere(radius, 4)
    eye = UsdGeom.Mesh.Define(stage, path)
    eye.CreatePointsAttr(points)
    eye.CreateFaceVertexCountsAttr(counts)
    eye.CreateFaceVertexIndicesAttr(indices)
    eye.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    eye.AddTranslateOp().Set(Gf.Vec3d(*place))
    return eye


def add_hair(stage: Usd.Stage, path: str) -> UsdGeom.BasisCurves:
    """Two straight hairs on top of the ball."""
    hair = UsdGeom.BasisCurves.Define(stage, path)
    hair.CreateTypeAttr(UsdGeom.Tokens.linear)
    hair.CreatePointsAttr([(0, 0.14, 0), (0, 0.2, 0), (0.02, 0.14, 0), (0.02, 0.2, 0)])
    hair.CreateCurveVertexCountsAttr([2, 2])
    hair.CreateWidthsAttr([0.01])
    hair.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    return hair


@pytest.fixture
def dressed(tmp_path: Path) -> Path:
    """The small scene; its ball has an eye below it, hair that it names, and turns."""
    stage = make_scene(tmp_path / "dressed.usda", smoke=False, voxel=VOXEL, velocity=(0.3, 0.0, 0.0), frames=(1, 6))
    ball = stage.GetPrimAtPath("/World/Ball")
    ball.GetAttribute("eulerfsi:angularVelocity").Set(Gf.Vec3d(0, 0, 180))
    ball.GetAttribute("eulerfsi:youngsModulus").Set(1e6)
    add_eye(stage, "/World/Ball/Eye", (0.12, 0.06, 0.0))
    add_hair(stage, "/World/Style/Hair")
    ball.GetRelationship("eulerfsi:passengers").SetTargets(["/World/Style"])
    stage.GetRootLayer().Save()
    return tmp_path / "dressed.usda"


def test_eyes_and_hair_ride_along(dressed: Path, tmp_path: Path, library) -> None:
    result = simulate(dressed, Options(output=tmp_path / "cache", progress="none"))
    stage = Usd.Stage.Open(str(result.root))
    ball = [world_points(stage, "/World/Ball", frame) for frame in (1, 6)]
    assert np.abs(ball[1] - ball[0]).max() > VOXEL
    for path in ("/World/Ball/Eye", "/World/Style/Hair"):
        before, after = (world_points(stage, path, frame) for frame in (1, 6))
        # Distances to the ball's own points are those of a body that turns rigidly.
        rest, now = (np.linalg.norm(p[:, None] - b[None], axis=2) for p, b in ((before, ball[0]), (after, ball[1])))
        assert np.abs(now - rest).max() < 0.1 * VOXEL, path
        prim = UsdGeom.PointBased(stage.GetPrimAtPath(path))
        speed = np.linalg.norm(np.asarray(prim.GetVelocitiesAttr().Get(6), float), axis=1)
        assert (speed > 0.2).all() and (speed < 2.5).all()
        assert np.allclose(prim.GetExtentAttr().Get(6)[0], np.asarray(prim.GetPointsAttr().Get(6)).min(axis=0))
    eye = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball/Eye"))
    assert len(eye.GetNormalsAttr().Get(6)) == len(eye.GetPointsAttr().Get(6))
    assert not UsdGeom.PointBased(stage.GetPrimAtPath("/World/Style/Hair")).GetNormalsAttr().Get(6)


def test_passengers_change_no_bit_of_the_solids(dressed: Path, tmp_path: Path, library) -> None:
    with_them = simulate(dressed, Options(output=tmp_path / "with", frames="1-3", progress="none"))
    stage = Usd.Stage.Open(str(dressed))
    stage.RemovePrim("/World/Ball/Eye")
    stage.GetPrimAtPath("/World/Ball").GetRelationship("eulerfsi:passengers").ClearTargets(True)
    stage.GetRootLayer().Export(str(tmp_path / "dressed_less.usda"))
    without = simulate(tmp_path / "dressed_less.usda", Options(output=tmp_path / "without", frames="1-3"))
    states = [
        [frame["state"] for frame in json.loads((result.folder / "manifest.json").read_text())["frames"].values()]
        for result in (with_them, without)
    ]
    assert states[0] == states[1]


def test_a_passenger_out_of_reach_of_the_material_follows_the_surface(dressed: Path, tmp_path: Path, library) -> None:
    stage = Usd.Stage.Open(str(dressed))
    far = add_eye(stage, "/World/Ball/Far", (0.0, 0.15 + 8 * VOXEL, 0.0))
    at_rest = np.asarray(far.GetPointsAttr().Get())
    stage.GetRootLayer().Save()
    result = simulate(dressed, Options(output=tmp_path / "cache", progress="none"))
    text = (result.folder / "log").read_text()
    assert "/World/Ball/Far: carried by /World/Ball: follows the surface of the solid: points[" in text
    stage = Usd.Stage.Open(str(result.root))
    far = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball/Far"))
    assert np.abs(np.asarray(far.GetPointsAttr().Get(1)) - at_rest).max() < 1e-6
    before, after = (world_points(stage, "/World/Ball/Far", frame) for frame in (1, 6))
    ball = [world_points(stage, "/World/Ball", frame) for frame in (1, 6)]
    rest, now = (np.linalg.norm(p[:, None] - b[None], axis=2) for p, b in ((before, ball[0]), (after, ball[1])))
    assert np.abs(after - before).max() > 6 * VOXEL  # it turns by 37.5 degrees
    assert np.abs(now - rest).max() < 0.2 * VOXEL
    places = [np.asarray(far.GetPointsAttr().Get(frame), float) for frame in (3, 4, 5)]
    speed, moved = np.asarray(far.GetVelocitiesAttr().Get(4), float), 12.0 * (places[2] - places[0])
    assert np.linalg.norm(speed - moved, axis=1).max() < 0.1 * np.linalg.norm(moved, axis=1).max()


def faults(stage: Usd.Stage) -> list[tuple[str, str]]:
    return [(issue.code, issue.message) for issue in checks.check_stage(stage) if issue.severity == "error"]


def test_faulty_passengers_are_named(dressed: Path) -> None:
    stage = Usd.Stage.Open(str(dressed))
    assert faults(stage) == []
    carried = stage.GetPrimAtPath("/World/Ball").GetRelationship("eulerfsi:passengers")
    for target, code, hint in (
        ("/World/Nobody", "MissingTarget", "there is no such prim"),
        ("/World/Domain", "WrongTarget", "that prim is a domain itself"),
        ("/World/PhysicsScene", "WrongTarget", "a PhysicsScene without points"),
    ):
        carried.SetTargets([target])
        [(found, message)] = faults(stage)
        assert found == code and hint in message and message.startswith(f"/World/Ball.eulerfsi:passengers = {target}")
    carried.SetTargets([])
    eye = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball/Eye"))
    eye.GetPointsAttr().Set([(0, 0, 0), (float("nan"), 0, 0)])
    assert faults(stage)[0][1].startswith("/World/Ball/Eye.points[1] = (nan, 0, 0): must be finite")
    eye.GetPointsAttr().Set([])
    assert faults(stage)[0][0] == "MissingPoints"


def test_a_prim_that_two_solids_carry_is_refused(dressed: Path) -> None:
    stage = Usd.Stage.Open(str(dressed))
    other = add_eye(stage, "/World/Other", (0.2, 0.1, 0.2), 0.06).GetPrim()
    other.ApplyAPI("EulerFsiSolidAPI")
    other.GetRelationship("eulerfsi:passengers").SetTargets(["/World/Style/Hair"])
    [(code, message)] = faults(stage)
    assert code == "ManyCarriers" and "/World/Ball carries it already" in message


def test_shapes_without_points_follow_by_their_transform(dressed: Path, tmp_path: Path, library) -> None:
    """A Cylinder, scaled and turned below an Xform, is where a Mesh of the same place is, and keeps its shape."""
    stage = Usd.Stage.Open(str(dressed))
    group = UsdGeom.Xform.Define(stage, "/World/Ball/Head")
    group.AddRotateXOp().Set(20.0)
    knob = UsdGeom.Cylinder.Define(stage, "/World/Ball/Head/Knob")
    knob.CreateRadiusAttr(0.5)
    knob.CreateHeightAttr(1.0)
    knob.AddTranslateOp().Set((0.12, 0.06, 0.0))
    knob.AddScaleOp().Set((0.04, 0.03, 0.05))
    eye = add_eye(stage, "/World/Ball/Head/Eye", (0.12, 0.06, 0.0))
    UsdGeom.Sphere.Define(stage, "/World/Ball/Guide").CreatePurposeAttr(UsdGeom.Tokens.guide)
    stage.GetRootLayer().Save()
    assert not [issue for issue in checks.check_stage(stage) if issue.code == "LeftBehind"]
    opened = Usd.Stage.Open(str(simulate(dressed, Options(output=tmp_path / "cache", progress="none")).root))
    matrices = {
        frame: np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(opened.GetPrimAtPath(knob.GetPath())))
        for frame in (1, 6)
    }
    source = np.array(UsdGeom.XformCache(1).GetLocalToWorldTransform(knob.GetPrim()))
    assert np.abs(matrices[1] - source).max() < 1e-6
    for frame, matrix in matrices.items():
        middle = world_points(opened, eye.GetPath(), frame).mean(axis=0)
        assert np.abs(matrix[3, :3] - middle).max() < 1e-3
        assert np.sqrt((matrix[:3, :3] ** 2).sum(axis=1)) == pytest.approx([0.04, 0.03, 0.05], rel=1e-5)
    cosine = (matrices[1][0, :3] @ matrices[6][0, :3]) / 0.04**2
    assert np.degrees(np.arccos(cosine)) == pytest.approx(180 * 5 / 24, abs=2.0)
    assert opened.GetPrimAtPath("/World/Ball/Guide").GetAttribute("xformOpOrder").Get() is None
