"""Ranges that begin before frame 0: a run is that of any other range, and its cache is read back frame by frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import box, content_hashes, make_scene
from eulerfsi.cache import stats_file
from eulerfsi.log import Log
from eulerfsi.run.simulate import Options, Result, simulate
from pxr import Gf, Sdf, Usd, UsdGeom, UsdVol

pytestmark = pytest.mark.usefixtures("library")

BALL = "/World/Ball"
NAMES = {-3: "-003", -2: "-002", -1: "-001", 0: "0000", 1: "0001", 2: "0002"}


def run(scene: Path, folder: Path, **options) -> Result:
    return simulate(scene, Options(output=folder, progress="none", **options), Log())


def points(folder: Path, frame: int) -> np.ndarray:
    stage = Usd.Stage.Open(str(folder / "small.usda"))
    return np.array(UsdGeom.Mesh(stage.GetPrimAtPath(BALL)).GetPointsAttr().Get(frame))


def shot(path: Path, first: int) -> Path:
    """Six frames of the small scene with a table that rises, keyed from the first frame on."""
    stage = make_scene(path, frames=(first, first + 5), voxel=0.06)
    table = box(stage, "/World/Table", (0, -0.3, 0), (0.2, 0.1, 0.2), 1.0, "EulerFsiColliderAPI")
    lift = UsdGeom.Xformable(table).GetOrderedXformOps()[0]
    lift.Set(Gf.Vec3d(0, -0.3, 0), first)
    lift.Set(Gf.Vec3d(0, -0.28, 0), first + 5)
    stage.GetRootLayer().Save()
    return path


@pytest.fixture(scope="module")
def early(tmp_path_factory, library) -> Path:
    """Folder with a scene of frames -3 to 2 and its cache, begun with the first three and then resumed."""
    folder = tmp_path_factory.mktemp("early")
    scene = shot(folder / "small.usda", -3)
    run(scene, folder / "cache", frames="-3--1")
    assert Usd.Stage.Open(str(folder / "cache/small.usda")).GetEndTimeCode() == -1
    assert run(scene, folder / "cache", resume=True).resumed
    return folder


def test_content_is_that_of_the_same_scene_at_other_frames(early, tmp_path):
    run(shot(tmp_path / "small.usda", 1), tmp_path / "cache")
    later = {str(int(frame) - 4): hashes for frame, hashes in content_hashes(tmp_path / "cache").items()}
    assert content_hashes(early / "cache") == later
    assert [line["frame"] for line in stats_file.read(early / "cache") if line["event"] == "frame"] == [*NAMES]


def test_meshes_are_read_through_the_clips(early):
    cache = early / "cache"
    assert {path.name for path in (cache / "frames").iterdir()} == {
        "small.manifest.usda",
        *(f"small.{name}.usdc" for name in NAMES.values()),
    }
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (-3, 2)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(BALL))
    assert mesh.GetPointsAttr().GetTimeSamples() == [float(frame) for frame in NAMES]
    before = None
    for frame, name in NAMES.items():
        layer = Sdf.Layer.FindOrOpen(str(cache / f"frames/small.{name}.usdc"))
        written = np.array(layer.QueryTimeSample(f"{BALL}.points", frame))
        np.testing.assert_array_equal(np.array(mesh.GetPointsAttr().Get(frame)), written)
        if before is not None:
            assert not np.array_equal(written, before)
            between = np.array(mesh.GetPointsAttr().Get(frame - 0.5))
            np.testing.assert_allclose(between, (before + written) / 2, atol=1e-6)
        before = written


def test_volumes_are_read_by_openvdb(early, read_vdb):
    stage = Usd.Stage.Open(str(early / "cache/small.usda"))
    asset = UsdVol.OpenVDBAsset(stage.GetPrimAtPath("/World/smoke/density"))
    assert asset.GetFilePathAttr().GetTimeSamples() == [float(frame) for frame in NAMES]
    sums = []
    for frame, name in NAMES.items():
        path = Path(asset.GetFilePathAttr().Get(frame).resolvedPath)
        assert path == (early / f"cache/vdb/small.{name}.vdb").resolve()
        sums.append(read_vdb(path)["density"]["sum"])
    np.testing.assert_allclose(sums, sums[0], rtol=0.05)
    assert len(set(sums)) == 6


def test_checkpoints_are_named_taken_over_and_told(early, tmp_path, cli):
    told = cli("info", early / "cache").stdout
    assert "frames: 6 of -3-2 at 24 per second" in told and "checkpoints: -1, 2" in told
    assert sorted(path.name.split(".")[0] for path in (early / "cache/checkpoints").iterdir()) == ["-001", "0002"]
    done = cli("simulate", early / "small.usda", "--start-from", f"{early / 'cache'}:-1", "--frames", "-3--2")
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(points(tmp_path / "small_cache", -3), points(early / "cache", -1))


@pytest.mark.parametrize(
    "options",
    [
        ["--frames", "-3--2"],
        ["--frames=-3--2"],
        ["--start-frame", "-3", "--frames", "-3--2"],
        ["--start-frame=-3", "--frames=-3--2", "--threads", "1"],
    ],
)
def test_the_command_line_takes_them_in_every_spelling(early, tmp_path, cli, options):
    done = cli("simulate", early / "small.usda", *options, "--progress", "plain")
    assert done.returncode == 0, done.stderr
    assert "100% frame -2 of -3--2" in done.stdout and (tmp_path / "small_cache/preview.png").is_file()
    expected = content_hashes(early / "cache")
    assert content_hashes(tmp_path / "small_cache") == {frame: expected[frame] for frame in ("-3", "-2")}


def test_a_range_without_an_end_is_still_an_error_of_the_command_line(cli, early):
    done = cli("simulate", early / "small.usda", "--frames", "--resume")
    assert done.returncode == 2 and "--frames: expected one argument" in done.stderr


def test_the_plot_shows_the_frames(early, tmp_path, cli):
    done = cli("plot", "time", early / "cache", "-o", tmp_path / "time.svg")
    assert done.returncode == 0, done.stderr
    assert "<!-- −3 -->" in (tmp_path / "time.svg").read_text(encoding="utf-8")


def test_smoke_before_frame_0_is_warned_of(early, tmp_path, cli):
    told = cli("validate", early / "small.usda").stdout
    assert "frames -3-2 at 24 per second" in told
    assert "warning: stage: first frame -3: must be >= 0 for smoke in Blender" in told
    make_scene(tmp_path / "dry.usda", frames=(-3, 2), smoke=False, voxel=0.06)
    assert "Blender" not in cli("validate", "dry.usda").stdout
