"""Two-dimensional scenes, from a stage to the numbers of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import author, box
from eulerfsi.errors import SceneError
from eulerfsi.run.simulate import Options, simulate
from eulerfsi.scene import checks
from eulerfsi.scene.read import read_scene
from pxr import UsdGeom
from slab_scenes import add_disc, disc, points_of, run, slab_stage

VOXEL = 1 / 32
SOFT = {"youngsModulus": 2e4, "poissonsRatio": 0.3}


def bounce(path: Path, cells: int) -> tuple[Path, list[dict]]:
    """A disc falls 2.4 cells to the floor and bounces, in vacuum."""
    stage = slab_stage(path, (1.0, 1.0), VOXEL, cells, frames=10, gravity=9.81, ambientFluid=False)
    add_disc(stage, "Disc", (0, -0.2), 0.2, max(3, cells) * VOXEL, **SOFT)
    return run(path, stage)


def test_a_disc_bounces_as_in_a_thicker_slab(tmp_path: Path) -> None:
    """The paths differ by less than 3 % of what the disc moves: the resolution is the same, the mesh in the thick slab
    ends on the walls. All vertices stay where they were across the slab, those beyond it, too."""
    folder, thin = bounce(tmp_path / "thin.usda", 1)
    _, thick = bounce(tmp_path / "thick.usda", 8)
    heights = np.array([[f["solids"]["/World/Disc"]["center"][1] for f in run] for run in (thin, thick)])
    assert np.ptp(heights[1]) > 0.15
    assert heights[1].argmin() < 7  # it has come back
    assert np.abs(heights[0] - heights[1]).max() < 0.03 * np.ptp(heights[1])
    momenta = np.array([[f["solids"]["/World/Disc"]["momentum"][1] for f in run] for run in (thin, thick)])
    assert momenta[0].max() / -momenta[0].min() == pytest.approx(momenta[1].max() / -momenta[1].min(), abs=0.03)
    first, last = points_of(folder, "Disc", 0), points_of(folder, "Disc", 10)
    np.testing.assert_array_equal(first[:, 2], last[:, 2])
    assert np.abs(first[:, 2]).max() == pytest.approx(1.5 * VOXEL)
    # Of the mesh rows of vertices above each other stay above each other.
    rows = last[1:-1].reshape(-1, 48, 3)[:, :, :2]
    assert np.abs(rows - rows[0]).max() < 1e-5


@pytest.mark.parametrize("fluid", [False, True])
def test_two_discs_that_meet_part_again(tmp_path: Path, fluid: bool) -> None:
    """With smoke between them where there is fluid; it keeps its amount."""
    path = tmp_path / "scene.usda"
    stage = slab_stage(path, (1.5, 1.0), VOXEL, frames=12, ambientFluid=fluid, vorticityConfinement=0.1)
    for name, side in (("Left", -1), ("Right", 1)):
        add_disc(stage, name, (0.3 * side, 0), 0.2, 2 * VOXEL, velocity=(-1.0 * side, 0, 0), **SOFT)
    if fluid:
        puff = box(stage, "/World/Puff", (0, 0, 0), (0.2, 2, 2), 1.0, "EulerFsiEmitterAPI")
        author(puff, mode="initial", smokeDensity=0.8)
    _, frames = run(path, stage)
    left, right = (frames[-1]["solids"][f"/World/{name}"] for name in ("Left", "Right"))
    speeds = [body["momentum"][0] / body["mass"] for body in (left, right)]
    assert speeds[0] < -0.6 and speeds[1] > 0.6
    assert left["center"][0] < -0.3 and right["center"][0] > 0.3
    assert min(f["solids"]["/World/Left"]["center"][0] for f in frames[1:]) < -0.15  # they have met
    for body in (left, right):
        assert body["momentum"][2] == 0.0
        assert body["mass"] == pytest.approx(1000 * np.pi * 0.04 * VOXEL, rel=0.01)
        assert body["volume_mesh"] == pytest.approx(np.pi * 0.04 * VOXEL, rel=0.01)
    if fluid:
        smoke = [frame["fluid"]["smoke"] for frame in frames]
        assert smoke[0] > 0.0 and smoke[-1] == pytest.approx(smoke[0], rel=1e-3)


def test_a_lid_drives_a_viscous_fluid_that_takes_a_soft_disc_along(tmp_path: Path) -> None:
    """Where Zhao, Freund and Moser's disc (2008) is after a second, see tests/unit/solve/test_viscosity.cpp."""
    path = tmp_path / "scene.usda"
    walls = {f"wall{side}": "noSlip" for side in ("XMin", "XMax", "YMin", "YMax")}
    stage = slab_stage(
        path, (1.0, 1.0), VOXEL, frames=24, cflFluid=2.0, fluidViscosity=0.01, wallVelocityYMax=(1.0, 0, 0), **walls
    )
    soft = {"youngsModulus": 0.26, "poissonsRatio": 0.3, "material": "stableNeoHookean"}
    add_disc(stage, "Disc", (0.1, 0), 0.2, 2 * VOXEL, density=1.0, **soft)
    _, frames = run(path, stage)
    center = frames[-1]["solids"]["/World/Disc"]["center"]
    np.testing.assert_allclose(center, (0.53028 - 0.5, 0.49217 - 0.5, 0.0), atol=0.004)


def refusal(path: Path, stage) -> str:
    stage.GetRootLayer().Save()
    with pytest.raises(SceneError) as error:
        simulate(path, Options(output=path.with_suffix(".cache"), progress="none"))
    return str(error.value)


def test_a_disc_may_start_stretched(tmp_path: Path) -> None:
    """About the centre of what lies in the slab, as the checks see it, too: a bent cylinder has another one."""
    path = tmp_path / "scene.usda"
    stage = slab_stage(path, (1.0, 1.0), VOXEL, frames=2)
    points, *_ = disc(0.2, 9 * VOXEL)
    prim = add_disc(stage, "Disc", (0, 0), 0.2, 9 * VOXEL, stretch=(1.3, 0.9, 1.0), **SOFT)
    bent = points + np.outer(10 * points[:, 2] ** 2, (1.0, 0, 0))
    UsdGeom.Mesh(prim).GetPointsAttr().Set(bent)
    folder, _ = run(path, stage)
    start = points_of(folder, "Disc", 0)
    np.testing.assert_allclose(start[:, 1:], points[:, 1:] * (0.9, 1.0), atol=1e-6)
    center = (1.3 * bent - start)[:, 0] / 0.3
    np.testing.assert_allclose(center, center.mean(), atol=1e-5)
    section = 10 * (0.1 * 9 * VOXEL) ** 2  # where the faces cut it halfway between two rings
    assert center.mean() == pytest.approx(section, abs=2e-3)
    seen = read_scene(stage, path).solids[0].start.report["extent_max"][0]
    assert seen == pytest.approx(center.mean() + 1.3 * (0.2 + section - center.mean()), abs=2e-3)


def test_bad_slabs_are_refused(tmp_path: Path) -> None:
    stage = slab_stage(tmp_path / "a.usda", (1.0, 1.0), VOXEL)
    add_disc(stage, "Disc", (0, 0), 0.2, 0.5 * VOXEL)
    text = refusal(tmp_path / "a.usda", stage)
    assert "/World/Disc" in text and "must be through the 2-D domain /World/Domain, 0 to 0.03125" in text

    stage = slab_stage(tmp_path / "b.usda", (1.0, 1.0), VOXEL, wallZMin="noSlip")
    add_disc(stage, "Disc", (0, 0), 0.2, 0.5 * VOXEL)
    text = refusal(tmp_path / "b.usda", stage)
    assert "must hold at least 2 voxels; one edge may be 1 voxel between slip walls, which makes a 2-D scene" in text

    stage = slab_stage(tmp_path / "c.usda", (1.0, 1.0), VOXEL)
    add_disc(stage, "Disc", (0, 0), 0.2, 2 * VOXEL, velocity=(0, 0, 1.0))
    assert "/World/Disc: eulerfsi:velocity = 1 along the box's z: must be 0 in a 2-D domain" in refusal(
        tmp_path / "c.usda", stage
    )

    stage = slab_stage(tmp_path / "d.usda", (1.0, 1.0), VOXEL, wallVelocityXMin=(1.0, 0, 0))
    text = refusal(tmp_path / "d.usda", stage)
    assert "/World/Domain: eulerfsi:wallVelocityXMin: a net inflow of 0.03125 (volume per second)" in text

    stage = slab_stage(tmp_path / "e.usda", (1.0, 1.0), VOXEL, wallVelocityYMax=(2.0, 0, 0), wallXMax="open")
    author(stage.GetPrimAtPath("/World/Domain"), wallVelocityXMax=(0, 1.0, 0), wallVelocityZMin=(0, 0, 1.0))
    text = refusal(tmp_path / "e.usda", stage)
    assert "eulerfsi:wallVelocityYMax = (2, 0, 0) in the box's axes: must be 0 along a slip wall" in text
    assert "eulerfsi:wallVelocityXMax = (0, 1, 0) in the box's axes: must be 0 on a face that is open" in text
    assert "eulerfsi:wallVelocityZMin = (0, 0, 1) in the box's axes: must be 0 across a 2-D domain" in text


def test_thickness_and_overlap_are_those_of_the_section(tmp_path: Path) -> None:
    """A cylinder one voxel high is no thin feature; discs beside each other do not overlap."""
    stage = slab_stage(tmp_path / "a.usda", (1.0, 1.0), VOXEL)
    add_disc(stage, "A", (-0.21, 0), 0.2, VOXEL)
    add_disc(stage, "B", (0.21, 0), 0.2, 20 * VOXEL)
    stage.GetRootLayer().Save()
    scene = read_scene(stage, tmp_path / "a.usda")
    assert checks.check_scene(scene) == []
    assert scene.solids[0].report["thinnest_feature"] == pytest.approx(0.4, rel=0.02)
    assert scene.solids[1].report["solid_volume"] == pytest.approx(scene.solids[0].report["solid_volume"])
