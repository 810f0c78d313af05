"""Colliders whose points move: by time samples, joints and blend shapes, or a transform that stretches them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import content_hashes, make_scene, sphere, world_points
from eulerfsi.run.simulate import Options, simulate
from eulerfsi.scene.read import open_stage, read_scene
from eulerfsi_usd import checks, transforms
from eulerfsi_usd.pose import Pose
from figures import BODY, make_figure
from pxr import Gf, Usd, UsdGeom

VOXEL = 0.05
ROCK = "/World/Rock"


def rock_points(frame: int, grow: float = 0.12) -> np.ndarray:
    """A ball below the one that is free, whose upper half rises: points (n, 3)."""
    points = sphere(0.12, 8)[0]
    points[:, 1] += np.clip(points[:, 1] / 0.12, 0.0, 1.0) * grow * (frame - 1) / 6
    return points + (0.0, -0.24, 0.0)


@pytest.fixture
def rising(tmp_path: Path) -> Path:
    """A ball in vacuum over a rock that grows by 0.12 m in 6 frames while it goes to the right by 0.03 m."""
    path = tmp_path / "rising.usda"
    stage = make_scene(path, smoke=False, voxel=VOXEL, velocity=(0.0, 0.0, 0.0), frames=(1, 7), parent=Gf.Matrix4d(1))
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:ambientFluid").Set(False)
    _, counts, indices = sphere(0.12, 8)
    rock = UsdGeom.Mesh.Define(stage, ROCK)
    rock.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    rock.CreateFaceVertexCountsAttr(counts)
    rock.CreateFaceVertexIndicesAttr(indices)
    move = rock.AddTranslateOp()
    for frame in range(1, 8):
        rock.CreatePointsAttr().Set(rock_points(frame), frame)
        move.Set(Gf.Vec3d(0.005 * (frame - 1), 0.0, 0.0), frame)
    rock.GetPrim().ApplyAPI("EulerFsiColliderAPI")
    stage.GetRootLayer().Save()
    return path


def faults(stage: Usd.Stage) -> list[tuple[str, str]]:
    return [(issue.code, issue.message) for issue in checks.check_stage(stage) if issue.severity == "error"]


def test_points_that_rise_lift_a_ball(rising: Path, tmp_path: Path, library, cli) -> None:
    checked = cli("validate", rising)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    result = simulate(rising, Options(output=tmp_path / "cache", progress="none"))
    stage = Usd.Stage.Open(str(result.root))
    first, last = (world_points(stage, "/World/Ball", frame) for frame in (1, 7))
    top = rock_points(7)[:, 1].max()
    assert top > first[:, 1].min() + 0.5 * VOXEL  # it would be in the ball
    away = np.hypot(last[:, 0] - 0.03, last[:, 2])
    over = last[away < 0.1]  # above the half ellipsoid, or in it
    height = -0.24 + 0.24 * np.sqrt(1.0 - (away[away < 0.1] / 0.12) ** 2)
    assert (over[:, 1] - height).min() > -0.5 * VOXEL
    lines = [json.loads(line) for line in (result.folder / "stats.jsonl").read_text().splitlines()]
    steps = [line for line in lines if line["event"] == "step"]
    assert sum(step["pin_impulses"][ROCK][1] for step in steps) > 0.0
    assert sum(step["prescribed_work"][ROCK] for step in steps) > 0.0


def test_a_run_that_is_resumed_is_the_same(rising: Path, tmp_path: Path, library) -> None:
    whole = simulate(rising, Options(output=tmp_path / "whole", progress="none"))
    simulate(rising, Options(output=tmp_path / "parts", progress="none", frames="1-4"))
    parts = simulate(rising, Options(output=tmp_path / "parts", progress="none", resume=True))
    assert parts.resumed
    ends = [world_points(Usd.Stage.Open(str(run.root)), "/World/Ball", 7) for run in (whole, parts)]
    assert np.array_equal(*ends)


def test_points_that_change_end_a_resume(rising: Path, tmp_path: Path, library, cli) -> None:
    simulate(rising, Options(output=tmp_path / "cache", progress="none", frames="1-3"))
    stage = Usd.Stage.Open(str(rising))
    UsdGeom.Mesh(stage.GetPrimAtPath(ROCK)).GetPointsAttr().Set(rock_points(7, 0.1), 7)
    stage.GetRootLayer().Save()
    result = cli("simulate", rising, "--output", tmp_path / "cache", "--resume", "--progress", "none")
    assert result.returncode != 0
    assert "scene" in result.stderr


def test_a_collider_is_where_its_points_and_its_transform_say(rising: Path, library) -> None:
    stage = open_stage(rising)
    collider = read_scene(stage, rising, 0, 1).colliders[0]
    assert collider.motion.moves and collider.shape and not collider.shape.stretched
    domain = collider.motion.space
    for frame in (1, 4, 7):
        wanted = rock_points(frame) + (0.005 * (frame - 1), 0.0, 0.0)
        assert np.abs(domain.point_to_world(collider.points(frame)) - wanted).max() < 1e-6


def test_a_transform_that_stretches_moves_the_points(rising: Path, tmp_path: Path, library) -> None:
    stage = Usd.Stage.Open(str(rising))
    rock = UsdGeom.Mesh(stage.GetPrimAtPath(ROCK))
    rock.GetPointsAttr().Clear()
    rock.GetPointsAttr().Set(rock_points(1))
    size = rock.AddScaleOp()
    size.Set(Gf.Vec3f(1, 1, 1), 1)
    size.Set(Gf.Vec3f(1.3, 1, 1), 7)
    stage.GetRootLayer().Save()
    assert faults(stage) == []
    collider = read_scene(open_stage(rising), rising, 0, 1).colliders[0]
    assert not collider.motion.moves and collider.shape.stretched
    wanted = rock_points(1) * (1.3, 1, 1) + (0.03, 0, 0)
    assert np.abs(collider.motion.space.point_to_world(collider.points(7)) - wanted).max() < 1e-6
    simulate(rising, Options(output=tmp_path / "cache", progress="none", frames="1-3"))
    size.Set(Gf.Vec3f(-1, 1, 1), 7)
    [(code, message)] = faults(stage)
    assert code == "InvertedCollider" and "a volume of 0 at frame 4 over that at frame 1: must be > 0" in message


def test_a_skinned_mesh_is_a_collider(tmp_path: Path, library) -> None:
    stage = make_figure(tmp_path / "figure.usda")
    prim = stage.GetPrimAtPath(BODY)
    prim.RemoveAPI("EulerFsiSolidAPI")
    prim.ApplyAPI("EulerFsiColliderAPI")
    stage.GetRootLayer().Save()
    assert faults(stage) == []
    collider = read_scene(open_stage(tmp_path / "figure.usda"), tmp_path / "figure.usda", 0, 1).colliders[0]
    assert collider.shape
    first, second, third = (collider.points(frame) for frame in (1, 2, 3))
    assert 0.005 < np.linalg.norm(second - first, axis=1).max() < 0.05  # it bends by 4 degrees
    assert np.abs(third - second).max() < 1e-6
    result = simulate(tmp_path / "figure.usda", Options(output=tmp_path / "cache", progress="none", frames="1-2"))
    lines = [json.loads(line) for line in (result.folder / "stats.jsonl").read_text().splitlines()]
    assert any(line["prescribed_work"][BODY] != 0.0 for line in lines if line["event"] == "step")


def test_points_that_repeat_pay_nothing(rising: Path, library) -> None:
    stage = Usd.Stage.Open(str(rising))
    attribute = UsdGeom.Mesh(stage.GetPrimAtPath(ROCK)).GetPointsAttr()
    for frame in range(1, 8):
        attribute.Set(rock_points(1), frame)
    stage.GetRootLayer().Save()
    assert read_scene(open_stage(rising), rising, 0, 1).colliders[0].shape is None


def test_faces_and_numbers_of_points_that_change_are_refused(rising: Path, cli) -> None:
    stage = Usd.Stage.Open(str(rising))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(ROCK))
    _, counts, indices = sphere(0.12, 8)
    count = len(rock_points(1))
    mesh.GetPointsAttr().Set(rock_points(5)[:-1], 5)
    stage.GetRootLayer().Save()
    result = cli("validate", rising)
    assert result.returncode != 0
    text = f"{ROCK}.points = {count - 1} points at frame 5, {count} at frame 1: must be the same number in all frames"
    assert text in result.stdout + result.stderr and "in rising.usda" in result.stdout + result.stderr
    mesh.GetPointsAttr().Set(rock_points(5), 5)
    mesh.GetFaceVertexCountsAttr().Clear()
    mesh.GetFaceVertexCountsAttr().Set(counts, 1)
    mesh.GetFaceVertexCountsAttr().Set(counts[:-1], 4)
    [(code, message)] = faults(stage)
    assert code == "ChangingCollider"
    assert f"{ROCK}.faceVertexCounts = {len(counts) - 1} values at frame 4, {len(counts)} at frame 1" in message
    mesh.GetFaceVertexCountsAttr().Clear()
    mesh.GetFaceVertexCountsAttr().Set(counts)
    mesh.GetFaceVertexIndicesAttr().Clear()
    mesh.GetFaceVertexIndicesAttr().Set(indices, 1)
    mesh.GetFaceVertexIndicesAttr().Set(indices[::-1], 6)
    assert faults(stage)[0][0] == "ChangingCollider"


def test_points_that_are_not_finite_or_turn_inside_out_are_named(rising: Path) -> None:
    stage = Usd.Stage.Open(str(rising))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(ROCK))
    points = rock_points(5)
    points[3, 1] = np.nan
    mesh.GetPointsAttr().Set(points, 5)
    [(code, message)] = faults(stage)
    assert code == "NonFinitePoints" and f"{ROCK}.points[3]" in message and "finite at frame 5" in message
    mesh.GetPointsAttr().Set(rock_points(5) * (1, -1, 1), 5)
    [(code, message)] = faults(stage)
    assert code == "InvertedCollider" and "at frame 5" in message and "of the same sign" in message


def test_a_run_that_ends_before_the_points_move_can_go_on(rising: Path, tmp_path: Path, library) -> None:
    stage = Usd.Stage.Open(str(rising))
    points = UsdGeom.Mesh(stage.GetPrimAtPath(ROCK)).GetPointsAttr()
    for frame in range(1, 8):
        points.Set(rock_points(max(1, frame - 3)), frame)
    stage.GetRootLayer().Save()
    whole = simulate(rising, Options(output=tmp_path / "whole", progress="none"))
    simulate(rising, Options(output=tmp_path / "parts", progress="none", frames="1-3"))
    parts = simulate(rising, Options(output=tmp_path / "parts", progress="none", resume=True))
    assert parts.resumed
    assert content_hashes(whole.folder) == content_hashes(parts.folder)


def test_places_over_time_are_those_of_each_frame() -> None:
    """One cache for all frames says what a new one for each does, also below what does not move and above a reset."""
    stage = Usd.Stage.CreateInMemory()
    above = UsdGeom.Xform.Define(stage, "/Above")
    move, turn = above.AddTranslateOp(), above.AddRotateYOp()
    UsdGeom.Xform.Define(stage, "/Above/Still").AddScaleOp().Set(Gf.Vec3f(2, 3, 4))
    rock = UsdGeom.Xform.Define(stage, "/Above/Still/Rock")
    sway = rock.AddRotateXOp()
    apart = UsdGeom.Xform.Define(stage, "/Above/Apart")
    apart.AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    apart.SetResetXformStack(True)
    for frame in range(-2, 9):
        move.Set(Gf.Vec3d(0.1 * frame, 0, 0.02 * frame * frame), frame)
        turn.Set(7.0 * frame, frame)
        sway.Set(3.0 * frame, frame + 0.5)
    frames = [-2.0, 0.0, 3.0, 7.25, 1.0]
    for prim in (above.GetPrim(), rock.GetPrim(), apart.GetPrim()):
        alone = [UsdGeom.XformCache(Usd.TimeCode(frame)).GetLocalToWorldTransform(prim) for frame in frames]
        assert list(transforms.places(prim, frames)) == alone
        wanted = [np.array(alone[0].GetInverse() * place) for place in alone]
        np.testing.assert_array_equal(transforms.motions(prim, frames, frames[0]), wanted)
    assert transforms.motions(rock.GetPrim(), [], 0.0).shape == (0, 4, 4)


def test_checks_of_a_long_scene_look_up_its_transforms_once_a_prim(rising: Path, monkeypatch) -> None:
    """What is found once of a prim, its transforms and its skinning, is not found again in each frame."""
    made = {"XformCache": 0, "Pose": 0}
    new_cache, new_pose = UsdGeom.XformCache, Pose.__init__

    def cache(*arguments):
        made["XformCache"] += 1
        return new_cache(*arguments)

    def pose(self, *arguments, **options):
        made["Pose"] += 1
        new_pose(self, *arguments, **options)

    def count(last: int) -> dict[str, int]:
        made.update(dict.fromkeys(made, 0))
        stage = Usd.Stage.Open(str(rising))
        stage.SetEndTimeCode(last)
        assert not faults(stage)
        read_scene(stage, rising)
        return dict(made)

    monkeypatch.setattr(UsdGeom, "XformCache", cache)
    monkeypatch.setattr(Pose, "__init__", pose)
    few = count(7)
    assert few == count(300) and few["XformCache"] > 0 and few["Pose"] > 0


def test_a_face_of_many_corners_counts_with_all_of_its_fan(rising: Path) -> None:
    """A prism of one hexagon above, one below and six walls that turns inside out."""
    stage = Usd.Stage.Open(str(rising))
    angles = np.radians(60.0 * np.arange(6))
    ring = np.stack([np.cos(angles), np.zeros(6), -np.sin(angles)], axis=1) * 0.1
    points = np.concatenate([ring - (0, 0.05, 0), ring + (0, 0.05, 0)])
    walls = [[i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    rock = UsdGeom.Mesh(stage.GetPrimAtPath(ROCK))
    rock.GetFaceVertexCountsAttr().Set([6, 6, *[4] * 6])
    rock.GetFaceVertexIndicesAttr().Set([5, 4, 3, 2, 1, 0, 6, 7, 8, 9, 10, 11, *sum(walls, [])])
    for frame in range(1, 8):
        rock.GetPointsAttr().Set(points * (1.0 if frame < 5 else 0.5), frame)
    assert not faults(stage)
    rock.GetPointsAttr().Set(points * (1, -1, 1), 5)
    volume = 1.5 * np.sqrt(3.0) * 0.1**2 * 0.1
    [(code, message)] = faults(stage)
    assert code == "InvertedCollider"
    assert f"a volume of {-volume:.4g} at frame 5, {volume:.4g} at frame 1: must be a volume of the same" in message
