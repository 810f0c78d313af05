"""Pins and colliders: from the stage through a run, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import make_scene, sphere, world_points
from eulerfsi.run.simulate import Options, simulate
from eulerfsi_usd import checks, gprims
from pxr import Gf, Sdf, Usd, UsdGeom

VOXEL = 0.05


@pytest.fixture
def held(tmp_path: Path) -> Path:
    """The small scene in vacuum; its ball is held by its top and rests beside a box that comes from the left."""
    stage = make_scene(
        tmp_path / "held.usda", smoke=False, voxel=VOXEL, velocity=(0.0, 0.0, 0.0), frames=(1, 7), parent=Gf.Matrix4d(1)
    )
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:ambientFluid").Set(False)
    ball = stage.GetPrimAtPath("/World/Ball")
    values = [1.0 if point[1] > 0.13 else 0.0 for point in sphere(0.15)[0]]
    primvar = UsdGeom.PrimvarsAPI(ball).CreatePrimvar("eulerfsi:pin", Sdf.ValueTypeNames.FloatArray, "vertex")
    primvar.Set(values)
    box = UsdGeom.Cube.Define(stage, "/World/Ram")
    box.CreateSizeAttr(0.2)
    move = box.AddTranslateOp()
    for frame in range(1, 8):
        move.Set(Gf.Vec3d(-0.45 + 0.04 * (frame - 1), -0.08, 0.0), frame)
    box.GetPrim().ApplyAPI("EulerFsiColliderAPI")
    stage.GetRootLayer().Save()
    return tmp_path / "held.usda"


def test_a_held_ball_is_pushed_by_a_box_that_comes(held: Path, tmp_path: Path, library) -> None:
    result = simulate(held, Options(output=tmp_path / "cache", progress="none"))
    stage = Usd.Stage.Open(str(result.root))
    first, last = (world_points(stage, "/World/Ball", frame) for frame in (1, 7))
    top = first[:, 1] > 0.13
    assert np.abs(last[top] - first[top]).max() < 1e-6
    # The box comes from x < 0 up to -0.11: the ball gives way.
    assert last[:, 0].min() > -0.11 - 0.5 * VOXEL
    assert last[:, 0].min() > first[:, 0].min() + 0.02
    steps = [json.loads(line) for line in (result.folder / "stats.jsonl").read_text().splitlines()]
    impulses = [step["pin_impulses"] for step in steps if step["event"] == "step"]
    pairs = [pair for line in steps for pair in line.get("contacts", {}).get("pairs", [])]
    assert {tuple(pair["solids"]) for pair in pairs} == {("/World/Ball", "/World/Ram")}
    assert impulses[-1]["/World/Ball"][1] > 0.0  # its weight
    assert sum(impulse["/World/Ram"][0] for impulse in impulses) > 0.0


def test_a_pin_follows_its_volume(held: Path, tmp_path: Path, library) -> None:
    stage = Usd.Stage.Open(str(held))
    stage.RemovePrim("/World/Ram")
    ball = stage.GetPrimAtPath("/World/Ball")
    ball.RemoveProperty("primvars:eulerfsi:pin")
    grip = UsdGeom.Sphere.Define(stage, "/World/Grip")
    grip.CreateRadiusAttr(0.12)
    move, turn = grip.AddTranslateOp(), grip.AddRotateYOp()
    for frame in range(1, 8):
        move.Set(Gf.Vec3d(0.01 * (frame - 1), 0.1, 0.0), frame)
        turn.Set(5.0 * (frame - 1), frame)
    ball.GetRelationship("eulerfsi:pins").SetTargets(["/World/Grip"])
    stage.GetRootLayer().Save()
    result = simulate(held, Options(output=tmp_path / "cache", progress="none"))
    cache = Usd.Stage.Open(str(result.root))
    first, last = (world_points(cache, "/World/Ball", frame) for frame in (1, 7))
    inside = np.linalg.norm(first - (0.0, 0.1, 0.0), axis=1) < 0.118
    angle = np.radians(30.0)
    wanted = first[inside] @ np.array(
        [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    ) + (0.06, 0, 0)
    assert inside.sum() > 20
    assert np.abs(last[inside] - wanted).max() < 1e-6
    resumed = simulate(held, Options(output=tmp_path / "cache", progress="none", resume=True))
    assert resumed.nothing_to_do


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("kind", [*gprims.SHAPES, "Plane"])
def test_gprims_are_closed_and_have_their_volume(kind: str, axis: str) -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/Shape", kind)
    if prim.HasAttribute("axis"):
        prim.GetAttribute("axis").Set(axis)
    points, counts, indices = gprims.surface_of(prim, Usd.TimeCode(1))
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    faces = [indices[start : start + count] for start, count in zip(starts, counts, strict=True)]
    edges = [(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)]
    assert len(set(edges)) == len(edges) and all((b, a) in set(edges) for a, b in edges)
    volume = sum(
        float(np.dot(points[face[0]], np.cross(points[face[k]], points[face[k + 1]]))) / 6.0
        for face in faces
        for k in range(1, len(face) - 1)
    )
    pi = np.pi
    wanted = {
        "Sphere": 4 / 3 * pi,
        "Cube": 8.0,
        "Cylinder": 2 * pi,
        "Cone": 2 / 3 * pi,
        "Capsule": pi * 0.5**2 * 1.0 + 4 / 3 * pi * 0.5**3,
        "Plane": 2.0 * 2.0 * 0.5,
    }
    assert volume == pytest.approx(wanted[kind], rel=0.01)
    if kind == "Plane":
        assert points[:, "XYZ".index(axis)].max() == 0.0


def faults(stage: Usd.Stage) -> list[tuple[str, str]]:
    return [(issue.code, issue.message) for issue in checks.check_stage(stage) if issue.severity == "error"]


def test_a_collider_with_a_hole_is_refused(held: Path, cli) -> None:
    stage = Usd.Stage.Open(str(held))
    points, counts, indices = sphere(0.05, 6)
    mesh = UsdGeom.Mesh.Define(stage, "/World/Bowl")
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreatePointsAttr(points + (0.2, 0.1, 0.1))
    mesh.CreateFaceVertexCountsAttr(counts[1:])
    mesh.CreateFaceVertexIndicesAttr(indices[counts[0] :])
    mesh.GetPrim().ApplyAPI("EulerFsiColliderAPI")
    stage.GetRootLayer().Save()
    result = cli("simulate", held, "--progress", "none")
    assert result.returncode == 3
    assert "/World/Bowl: the mesh has 3 open edges: must be 0: a collider is a closed mesh" in result.stderr


def test_volumes_of_pins_that_deform_are_refused(held: Path) -> None:
    stage = Usd.Stage.Open(str(held))
    points, counts, indices = sphere(0.12, 6)
    grip = UsdGeom.Mesh.Define(stage, "/World/Grip")
    grip.CreatePointsAttr().Set(points, 1)
    grip.GetPointsAttr().Set(1.1 * points, 4)
    grip.CreateFaceVertexCountsAttr(counts)
    grip.CreateFaceVertexIndicesAttr(indices)
    stage.GetPrimAtPath("/World/Ball").GetRelationship("eulerfsi:pins").SetTargets(["/World/Grip"])
    [(code, message)] = faults(stage)
    assert code == "ChangingPin" and f"{len(points)} values at frame 2, {len(points)} at frame 1" in message
    grip.GetPointsAttr().Clear()
    grip.GetPointsAttr().Set(points)
    assert faults(stage) == []
    size = grip.AddScaleOp()
    size.Set(Gf.Vec3f(1, 1, 1), 1)
    size.Set(Gf.Vec3f(1.5, 1, 1), 7)
    [(code, message)] = faults(stage)
    assert code == "StretchingMotion" and "a stretch by 1.083, 1, 1 from frame 1 to 2: must be rigid" in message


def test_faulty_pins_are_named(held: Path, cli) -> None:
    stage = Usd.Stage.Open(str(held))
    ball = stage.GetPrimAtPath("/World/Ball")
    primvar = UsdGeom.PrimvarsAPI(ball).GetPrimvar("eulerfsi:pin")
    count = len(primvar.Get())
    primvar.Set([0.0] * count)
    assert faults(stage)[0][0] == "EmptyPins"
    primvar.Set([1.0] * (count - 1))
    assert f"{count - 1} values, interpolation vertex: must be {count} values" in faults(stage)[0][1]
    primvar.GetAttr().Clear()
    primvar.Set([1.0] * count, 1)
    primvar.Set([0.0] * count, 5)
    [(code, message)] = faults(stage)
    assert code == "Animated" and "2 time samples: must be constant" in message
    ball.RemoveProperty("primvars:eulerfsi:pin")
    ball.GetRelationship("eulerfsi:pins").SetTargets(["/World/PhysicsScene"])
    [(code, message)] = faults(stage)
    assert code == "WrongTarget" and "it is a PhysicsScene" in message
    away = UsdGeom.Sphere.Define(stage, "/World/Away")
    away.CreateRadiusAttr(0.05)
    away.AddTranslateOp().Set(Gf.Vec3d(0.24, -0.4, 0.2))
    ball.GetRelationship("eulerfsi:pins").SetTargets(["/World/Away"])
    assert faults(stage) == []
    away.CreateRadiusAttr().Set(0.06, 3)
    away.GetRadiusAttr().Set(0.07, 4)
    assert "radius = 2 time samples: must be constant" in faults(stage)[0][1]
    away.GetRadiusAttr().Clear()
    away.GetRadiusAttr().Set(0.05)
    stage.GetRootLayer().Save()
    result = cli("simulate", held, "--progress", "none")
    assert result.returncode == 3
    named = "pin 1 (/World/Away) of solid 1 (/World/Ball)"
    assert f"/World/Ball: pinned by /World/Away: {named}: the region holds 0 nodes of the solid" in result.stderr
