"""The dandelion and the jellyfish: everything that they use acts, as numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt
from pxr import UsdGeom
from scene_run import Run
from test_scenes import mesh_volume

VOXEL = 0.02
COARSE = f"/World/Domain.voxelSize={VOXEL}"


def held(run: Run, path: str) -> np.ndarray:
    """Marks of the vertices that primvars:eulerfsi:pin holds."""
    return np.array(UsdGeom.PrimvarsAPI(run.stage.GetPrimAtPath(path)).GetPrimvar("eulerfsi:pin").Get()) > 0.5


def apart(run: Run, body: str, rider: str, frame: int) -> np.ndarray:
    """By how much riders are farther from, or nearer to, the four vertices nearest at frame 1 [voxels]."""
    rest, places = run.points(body, 1), run.points(rider, 1)
    near = np.argsort(np.linalg.norm(rest[None] - places[:, None], axis=2), axis=1)[:, :4]
    then, now = (
        np.linalg.norm(run.points(body, at)[near] - run.points(rider, at)[:, None], axis=2).mean(axis=1)
        for at in (1, frame)
    )
    return np.abs(now - then) / VOXEL


@pytest.mark.nightly
def test_dandelion_bends_in_gusts_and_the_wind_takes_the_ladybird_to_the_twig(tmp_path: Path) -> None:
    """Inflow, wind with noise and switched off, a mesh that emits, a plane, a pin by vertices, curves, points, laws."""
    flower, bird, ground = "/World/Dandelion/Flower", "/World/Ladybird/Body", 0.04
    run = Run("dandelion.usda", tmp_path / "cache", COARSE, frames="1-22")
    calm = Run("dandelion.usda", tmp_path / "calm", COARSE, "/World/Wind.noiseSpeed=0", frames="1-10")
    other = Run("dandelion.usda", tmp_path / "other", COARSE, f"{bird}.material=corotational", frames="1-10")
    rest, frames = run.points(flower, 1), list(run.frames)
    head = rest[:, 1] > 0.26

    def sway(of: Run, frame: int) -> np.ndarray:
        return (of.points(flower, frame) - rest)[head].mean(axis=0)

    assert sway(run, 10)[0] > 0.04, "the wind does not bend it"  # 0.087 at voxels from 1/75 on
    assert min(sway(run, frame)[0] for frame in frames[10:]) < -0.01, "it does not swing back when the wind is off"
    assert abs(sway(calm, 10)[2]) < 1e-4 and sway(run, 10)[2] > 0.001, "the noise does nothing"
    assert np.abs(other.points(bird, 10) - run.points(bird, 10)).max() > 0.01 * VOXEL, "its law does nothing"
    through = 1.0 * 0.54 * 0.32  # what comes in is what goes through every plane across [m3/s]
    for frame in frames[1:]:
        assert run.frames[frame]["fluid"]["momentum"][0] == pytest.approx(0.8 * through, rel=0.05)
    cloud = mesh_volume(run.stage.GetPrimAtPath("/World/Cloud"))
    assert run.frames[1]["fluid"]["smoke"] == pytest.approx(cloud, rel=0.15)
    assert run.frames[10]["fluid"]["smoke"] > 3.0 * cloud

    marks = held(run, flower)
    assert marks.sum() > 100
    bottoms, ways = [], []
    for frame in frames:
        assert np.array_equal(run.points(flower, frame)[marks], rest[marks]), f"frame {frame}"
        bottoms.append((run.points(bird, frame)[:, 1].min() - ground) / VOXEL)
        ways.append(run.points(bird, frame)[:, 0].mean())
    assert min(bottoms) > -0.25 and max(bottoms[:12]) < 0.5, "it is not on the plane"
    assert ways[9] - ways[0] > 0.1, "the wind does not take it along"
    assert max(ways) < 0.38 and ways[-1] < max(ways) - 0.02, "the twig does not throw it back"
    for body, rider in ((flower, "Dandelion/Down/Stems"), (flower, "Dandelion/Down/Seeds"), (bird, "Ladybird/Spots")):
        assert apart(run, body, f"/World/{rider}", 10).max() < 0.05
    for path in (flower, bird):
        assert run.volume_errors(path).max() < 0.01
    picture = plt.imread(run.folder / "preview.png")[..., :3]
    dots = (picture.min(axis=2) > 0.4) & (picture[..., 0] > picture[..., 2] + 0.01) & (np.ptp(picture, axis=2) < 0.04)
    assert 1000 < dots.sum() < 8000, "curves and points are not drawn"


@pytest.mark.nightly
def test_jellyfish_follows_the_hand_beads_meet_and_the_spring_lifts_the_pebble(tmp_path: Path) -> None:
    """A pin by vertices that is led, a radial and a constant force, one switched off, curves that ride along, a law.
    Volumes: docs/bars.md."""
    bell, pebble, beads = "/World/Jellyfish/Bell", "/World/Pebble", [f"/World/Bead{number}" for number in (1, 2, 3)]
    run = Run("jellyfish.usda", tmp_path / "cache", COARSE, frames="1-20")
    other = Run("jellyfish.usda", tmp_path / "other", COARSE, f"{bell}.material=corotational", frames="1-8")
    rest, marks, hand = run.points(bell, 1), held(run, bell), run.stage.GetPrimAtPath("/World/Hand")
    assert marks.sum() > 100
    flaps = []
    for frame in run.frames:
        now, then = (np.array(UsdGeom.XformCache(at).GetLocalToWorldTransform(hand))[3, :3] for at in (frame, 1))
        moved = run.points(bell, frame) - rest - (now - then)
        assert np.abs(moved[marks]).max() < 1e-6, f"frame {frame}"
        flaps.append(moved[rest[:, 1] < 0.33, 1].mean())
    assert max(flaps) > 0.01 and min(flaps) < -0.01, "its rim does not flap"
    assert np.abs(other.points(bell, 8) - run.points(bell, 8)).max() > 0.1 * VOXEL, "its law does nothing"
    assert apart(run, bell, "/World/Jellyfish/Rider/Tentacles", 8).max() < 1.0

    def velocity(path: str, frame: int) -> np.ndarray:
        return np.array(run.solid(path, frame)["momentum"]) / run.solid(path, frame)["mass"]

    # Each takes about half its volume of water along (a ball that nothing is near: exactly that).
    middle = np.array([-0.06, 0.0])
    for bead in beads:
        way = middle - np.array(run.solid(bead, 1)["center"])[[0, 2]]
        towards = velocity(bead, 2)[[0, 2]] @ way / np.linalg.norm(way)
        assert towards == pytest.approx(2.0 / (1.0 + 0.5) / 24, rel=0.3)
    assert max(len(frame.get("contacts", {}).get("pairs", [])) for frame in run.frames.values()) == 3, (
        "they do not meet"
    )
    lift, weight = 2500.0 * 9.0, (2500.0 - 1000.0) * 9.8
    assert velocity(pebble, 2)[1] == pytest.approx((lift - weight) / (2500.0 + 0.5 * 1000.0) / 24, rel=0.2)
    fall = velocity(pebble, 15)[1] - velocity(pebble, 14)[1]
    assert fall == pytest.approx(-weight / (2500.0 + 0.5 * 1000.0) / 24, rel=0.2)
    for path in (bell, pebble, *beads):
        by_mesh, by_cells = run.volume_errors(path).max(axis=0)
        assert by_mesh < 0.02 and by_cells < 0.025, path
