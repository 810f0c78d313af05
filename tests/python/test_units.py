"""One scene in several units, axes and under a scaled, rotated parent: the same motion in world space."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import make_scene
from eulerfsi.log import Log
from eulerfsi.run.simulate import Options, simulate
from pxr import Gf, Usd, UsdGeom

pytestmark = pytest.mark.usefixtures("library")

FRAMES = (1, 13)  # twelve frames after the first
PARENT = (
    Gf.Matrix4d().SetScale(2.5)
    * Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 2, 3), 50.0))
    * Gf.Matrix4d().SetTranslate(Gf.Vec3d(30.0, -4.0, 12.0))
)
VARIANTS = {
    "metres": {},
    "centimetres": {"meters_per_unit": 0.01},
    "centimetres_z_up": {"meters_per_unit": 0.01, "up": "Z", "kilograms_per_unit": 0.001},
    "parent": {"meters_per_unit": 0.01, "parent": PARENT},
}


@pytest.fixture(scope="module")
def caches(tmp_path_factory, library):
    folder = tmp_path_factory.mktemp("units")
    result = {}
    for name, facts in VARIANTS.items():
        scene = folder / f"{name}.usda"
        make_scene(scene, frames=FRAMES, voxel=0.05, **facts)
        simulate(scene, Options(output=folder / name, progress="none"), Log())
        result[name] = Usd.Stage.Open(str(folder / name / f"{name}.usda"))
    return folder, result


def to_common(stage: Usd.Stage, world: np.ndarray) -> np.ndarray:
    """World positions of a variant to the metres and axes of the plain scene."""
    root = np.array(UsdGeom.XformCache(1).GetLocalToWorldTransform(stage.GetPrimAtPath("/World")))
    scale = np.sqrt((root[0, :3] ** 2).sum())
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    # Rotation and translation of the parent undone; its scale was divided out of the scene's own lengths.
    return (world - root[3, :3]) @ (root[:3, :3] / scale).T * unit


def world_points(stage: Usd.Stage, frame: float, name: str = "points") -> np.ndarray:
    prim = stage.GetPrimAtPath("/World/Ball")
    matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(prim))
    local = np.array(prim.GetAttribute(name).Get(frame), float)
    return local @ matrix[:3, :3] + (matrix[3, :3] if name == "points" else 0)


@pytest.mark.parametrize("name", [name for name in VARIANTS if name != "metres"])
def test_solid_is_at_the_same_place_after_twelve_frames(caches, name):
    _, stages = caches
    expected = to_common(stages["metres"], world_points(stages["metres"], 13))
    found = to_common(stages[name], world_points(stages[name], 13))
    assert abs(expected[:, 1].mean()) > 0.05  # it did move
    assert np.abs(found - expected).max() < 1e-4 * 0.7


@pytest.mark.parametrize("name", list(VARIANTS))
def test_smoke_is_at_the_same_place_after_twelve_frames(caches, read_vdb, name):
    folder, stages = caches
    grids = {n: read_vdb(folder / n / "vdb" / f"{n}.0013.vdb") for n in ("metres", name)}
    plain, other = grids["metres"]["density"], grids[name]["density"]
    centroid = to_common(stages[name], other["centroid"])
    np.testing.assert_allclose(centroid, to_common(stages["metres"], plain["centroid"]), atol=1e-4 * 0.7)
    assert other["sum"] == pytest.approx(plain["sum"], rel=1e-3)
    assert other["voxel_size"] * UsdGeom.GetStageMetersPerUnit(stages[name]) == pytest.approx(0.05, rel=1e-6)


@pytest.mark.parametrize("name", list(VARIANTS))
def test_volume_prim_adds_no_transform_to_the_grids(caches, name):
    _, stages = caches
    matrix = UsdGeom.XformCache(5).GetLocalToWorldTransform(stages[name].GetPrimAtPath("/World/smoke"))
    np.testing.assert_allclose(np.array(matrix), np.eye(4), atol=1e-9)


@pytest.mark.parametrize("name", list(VARIANTS))
def test_density_scale_is_per_metre(caches, name):
    """Full smoke has the same optical depth in all of them: the box is as long."""
    _, stages = caches
    scale = stages[name].GetPrimAtPath("/World/smoke").GetAttribute("eulerfsi:densityScale").Get()
    assert scale * 0.7 == pytest.approx(10.0, rel=1e-5)


@pytest.mark.parametrize("name", list(VARIANTS))
def test_velocities_are_in_stage_units_and_world_axes(caches, read_vdb, name):
    folder, stages = caches
    unit = UsdGeom.GetStageMetersPerUnit(stages[name])
    speed = {
        n: np.linalg.norm(world_points(stages[n], 5, "velocities").mean(axis=0))
        * UsdGeom.GetStageMetersPerUnit(stages[n])
        for n in ("metres", name)
    }
    assert speed[name] == pytest.approx(speed["metres"], rel=1e-3) and speed["metres"] > 0.1
    grids = {n: read_vdb(folder / n / "vdb" / f"{n}.0005.vdb")["vel"] for n in ("metres", name)}
    assert grids[name]["sum"] * unit == pytest.approx(grids["metres"]["sum"], rel=1e-3)
    turned = to_common(stages[name], grids[name]["total"]) - to_common(stages[name], np.zeros(3))
    np.testing.assert_allclose(turned, grids["metres"]["total"], atol=2e-3 * grids["metres"]["sum"])
