"""Meshes with a subdivision scheme: the limit surface is simulated, the cache moves the cage."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import author, make_scene
from eulerfsi.errors import SceneError
from eulerfsi_usd.subdivide import Refinement, levels_for
from pxr import Sdf, Usd, UsdGeom
from scene_run import Run
from standard_stages import build, new_stage, read, vec_array

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
TRIANGLES = [t for a, b, c, d in QUADS for t in ([a, b, c], [a, c, d])]
EDGES = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
LIMIT = 2.6204  # volume of the limit surface of a cube of volume 8


def cage(stage: Usd.Stage, path: str, half: float, faces: list = QUADS) -> UsdGeom.Mesh:
    """A cube without an opinion on its scheme, which is Catmull-Clark then."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(vec_array(CORNERS * half))
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr([i for face in faces for i in face])
    return mesh


def creased(mesh: UsdGeom.Mesh, sharpness: float) -> None:
    mesh.CreateCreaseIndicesAttr([i for edge in EDGES for i in edge])
    mesh.CreateCreaseLengthsAttr([2] * 12)
    mesh.CreateCreaseSharpnessesAttr([sharpness] * 12)


def volume(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> float:
    faces = indices.reshape(len(counts), -1)
    fans = np.concatenate([faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)])
    a, b, c = (points[fans[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def refined(mesh: UsdGeom.Mesh, levels: int) -> tuple[Refinement, np.ndarray]:
    refinement = Refinement(mesh.GetPrim(), Usd.TimeCode.Default(), 8, levels)
    return refinement, refinement.points(CORNERS)


def test_catmull_clark_is_on_the_limit_surface_from_the_first_level_on():
    stage = Usd.Stage.CreateInMemory()
    mesh = cage(stage, "/Cage", 1.0)
    errors = []
    for levels in (1, 2, 3, 4):
        refinement, points = refined(mesh, levels)
        assert points[:8] == pytest.approx(0.5 * CORNERS)  # the limit of a corner of valence 3
        middle = points[np.abs(points).max(axis=1).argmax()]
        assert np.abs(middle).max() == pytest.approx(0.8395, abs=1e-4)
        errors.append(LIMIT - volume(points, refinement.counts, refinement.indices))
    assert errors[3] < 0.3 * errors[2] < 0.1 * errors[1]
    assert errors[3] < 0.012


def test_loop_converges_and_is_affine():
    stage = Usd.Stage.CreateInMemory()
    mesh = cage(stage, "/Cage", 1.0, TRIANGLES)
    mesh.CreateSubdivisionSchemeAttr("loop")
    volumes = [volume(points, r.counts, r.indices) for r, points in (refined(mesh, levels) for levels in (3, 4, 5))]
    assert (volumes[2] - volumes[1]) < 0.3 * (volumes[1] - volumes[0])
    refinement, points = refined(mesh, 3)
    matrix = np.array([[1.0, 0.2, 0.0], [0.0, 0.7, 0.1], [0.3, 0.0, 1.5]])
    assert np.abs(refinement.points(CORNERS @ matrix + 2.0) - points @ matrix - 2.0).max() < 1e-12


def test_sharp_edges_keep_the_cube_and_half_sharp_ones_lie_between():
    stage = Usd.Stage.CreateInMemory()
    mesh = cage(stage, "/Cage", 1.0)
    creased(mesh, 10.0)
    refinement, points = refined(mesh, 4)
    assert volume(points, refinement.counts, refinement.indices) == pytest.approx(8.0)
    volumes = []
    for sharpness in (0.0, 0.5, 1.0, 2.0):
        creased(mesh, sharpness)
        refinement, points = refined(mesh, 4)
        volumes.append(volume(points, refinement.counts, refinement.indices))
    assert volumes[0] == pytest.approx(LIMIT, abs=0.02) and (np.diff(volumes) > 0.3).all() and volumes[-1] < 8.0


def test_levels_reach_the_length_where_that_is_affordable():
    assert levels_for(1.0, 0.3, 6) == 2 and levels_for(0.1, 0.3, 6) == 1
    assert 6 * 4 ** levels_for(1.0, 1e-6, 6) <= 1_000_000


def test_the_limit_surface_falls_and_the_cache_moves_the_points_of_the_cage(tmp_path):
    stage = new_stage(tmp_path / "smooth.usda", voxel=0.02)
    mesh = cage(stage, "/World/Cube", 0.12)
    mesh.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    stage.Save()
    scene, codes = read(tmp_path / "smooth.usda")
    assert not codes and len(scene.solids[0].mesh.points) > 300
    run = Run(tmp_path / "smooth.usda", tmp_path / "cache")
    assert run.solid("/World/Cube", 1)["rest_volume"] == pytest.approx(LIMIT * 0.12**3, rel=0.01)
    points = UsdGeom.Mesh(run.stage.GetPrimAtPath("/World/Cube")).GetPointsAttr()
    assert len(points.Get(3)) == 8 and np.abs(np.asarray(points.Get(1)) - CORNERS * 0.12).max() < 1e-6
    fall = np.asarray(points.Get(3)) - CORNERS * 0.12
    assert fall[:, 1] == pytest.approx(run.solid("/World/Cube", 3)["center"][1], abs=0.002) and fall[:, 1].max() < -0.02
    assert not UsdGeom.Mesh(run.stage.GetPrimAtPath("/World/Cube")).GetNormalsAttr().HasAuthoredValue()
    assert run.stage.GetPrimAtPath("/World/Cube").GetAttribute("subdivisionScheme").Get() == "catmullClark"


def test_pins_of_a_cage_hold_its_surface(tmp_path):
    stage = new_stage(tmp_path / "pinned.usda", voxel=0.03)
    mesh = cage(stage, "/World/Cube", 0.15)
    mesh.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    pin = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("eulerfsi:pin", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex)
    pin.Set((CORNERS[:, 1] > 0).astype(float).tolist())
    stage.Save()
    scene, _ = read(tmp_path / "pinned.usda")
    held = scene.pins[0].vertices
    height = scene.solids[0].mesh.points[:, 1]
    assert len(held) == len(height) and height[held].min() > -0.01 and height[~held].max() < 0.01


def test_a_cage_that_collides_or_deforms_does_so_as_it_is_drawn(tmp_path):
    stage = new_stage(tmp_path / "collider.usda", voxel=0.03)
    mesh = cage(stage, "/World/Cube", 0.1)
    mesh.GetPrim().ApplyAPI("EulerFsiColliderAPI")
    for frame, size in ((1, 0.1), (3, 0.15)):
        mesh.GetPointsAttr().Set(vec_array(CORNERS * size), frame)
    stage.Save()
    scene, _ = read(tmp_path / "collider.usda")
    collider = scene.colliders[0]
    for frame, size in ((1, 0.1), (3, 0.15)):
        assert np.abs(collider.points(frame)).max() == pytest.approx(0.8395 * size, rel=1e-3)
    build(scene).simulation.advance(1 / 24)


def test_the_same_cage_with_and_without_the_scheme(tmp_path):
    stage = make_scene(tmp_path / "ball.usda", smoke=False)
    ball = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    volumes = []
    for scheme in ("none", "bilinear", "catmullClark"):
        ball.GetSubdivisionSchemeAttr().Set(scheme)
        stage.Save()
        scene, codes = read(tmp_path / "ball.usda")
        assert "SubdivisionCage" not in codes
        volumes.append(scene.solids[0].report["solid_volume"])
    assert volumes[0] == volumes[1] and 0.9 * volumes[0] < volumes[2] < 0.99 * volumes[0]


def test_loop_needs_triangles(tmp_path):
    stage = new_stage(tmp_path / "loop.usda")
    mesh = cage(stage, "/World/Cube", 0.1)
    mesh.CreateSubdivisionSchemeAttr("loop")
    mesh.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    author(mesh.GetPrim(), friction=0.1)
    stage.Save()
    with pytest.raises(SceneError, match=r"/World/Cube.faceVertexCounts\[0\] = 4: must be 3 with subdivisionScheme"):
        read(tmp_path / "loop.usda")
