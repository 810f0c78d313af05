"""`simulate --start-from CACHE[:FRAME]`: solids that start as another run has left them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import author, content_hashes, make_scene
from eulerfsi.cli.main import main
from eulerfsi.errors import CacheIOError, MismatchError, UsageError
from eulerfsi.log import Log
from eulerfsi.run.simulate import Options, Result, simulate
from pxr import Usd, UsdGeom

pytestmark = pytest.mark.usefixtures("library")

BALL = "/World/Ball"


def run(scene: Path, folder: Path, **options) -> Result:
    return simulate(scene, Options(output=folder, progress="none", **options), Log())


def points(folder: Path, name: str, frame: int) -> np.ndarray:
    stage = Usd.Stage.Open(str(folder / name))
    return np.array(UsdGeom.Mesh(stage.GetPrimAtPath(BALL)).GetPointsAttr().Get(frame))


def solid(folder: Path, frame: int) -> dict:
    lines = map(json.loads, (folder / "stats.jsonl").read_text().splitlines())
    [facts] = [line["solids"][BALL] for line in lines if line["event"] == "frame" and line["frame"] == frame]
    return facts


@pytest.fixture(scope="module")
def fallen(tmp_path_factory, library) -> Path:
    """Folder with a scene of 13 frames and its cache, which has checkpoints of frames 11 and 13."""
    folder = tmp_path_factory.mktemp("fallen")
    make_scene(folder / "small.usda", frames=(1, 13), voxel=0.06)
    run(folder / "small.usda", folder / "cache")
    return folder


def alone(path: Path, **domain) -> Path:
    """The same ball in the same box without fluid, smoke and gravity, frames 5 to 20."""
    stage = make_scene(path, frames=(5, 20), voxel=0.06, smoke=False)
    author(stage.GetPrimAtPath("/World/Domain"), ambientFluid=False, **domain)
    stage.GetPrimAtPath("/World/PhysicsScene").GetAttribute("physics:gravityMagnitude").Set(0.0)
    stage.GetRootLayer().Save()
    return path


@pytest.mark.parametrize("frame", [None, 11])
def test_solids_go_on_in_another_scene(fallen: Path, tmp_path: Path, frame: int | None) -> None:
    """Shape and momentum are those of the frame, and what follows is the same again after a run that was stopped."""
    scene, text = alone(tmp_path / "alone.usda"), f"{fallen / 'cache'}" + (f":{frame}" if frame else "")
    run(scene, tmp_path / "cache", start_from=text)
    frame = frame or 13
    first = points(tmp_path / "cache", "alone.usda", 5)
    np.testing.assert_array_equal(first, points(fallen / "cache", "small.usda", frame))
    before, after = solid(fallen / "cache", frame), solid(tmp_path / "cache", 5)
    # In vacuum cells carry the solid from a smaller part on, and of these there are few across it.
    assert after["momentum"] == pytest.approx(before["momentum"], rel=1e-2, abs=1e-4)
    assert after["rest_volume_cells"] == before["rest_volume_cells"]
    assert not np.array_equal(first, points(tmp_path / "cache", "alone.usda", 6))

    run(scene, tmp_path / "again", start_from=text, frames="5-16")
    run(scene, tmp_path / "again", resume=True)  # its checkpoint will do
    assert content_hashes(tmp_path / "again") == content_hashes(tmp_path / "cache")


def test_what_cannot_be_taken_over_is_refused(fallen: Path, tmp_path: Path) -> None:
    cache, scene = fallen / "cache", alone(tmp_path / "alone.usda")
    with pytest.raises(UsageError, match=r"--start-from nowhere: nowhere contains no cache"):
        run(scene, tmp_path / "c", start_from="nowhere")
    with pytest.raises(
        UsageError, match=r"contains no checkpoint of frame 7; it has those of frames: 11 and 13\. A run"
    ):
        run(scene, tmp_path / "c", start_from=f"{cache}:7")
    with pytest.raises(MismatchError, match=r"alone.usda: --start-from .*voxel_size = 0.05: must be 0.06"):
        run(scene, tmp_path / "c", start_from=str(cache), settings=("/World/Domain.voxelSize=0.05",))
    moved = make_scene(tmp_path / "moved.usda", voxel=0.06)
    UsdGeom.Mesh(moved.GetPrimAtPath(BALL)).AddTranslateOp().Set((0.01, 0, 0))
    moved.GetRootLayer().Save()
    with pytest.raises(MismatchError, match=r"solid 1 \(/World/Ball\): its rest shape, where that lies, and"):
        run(tmp_path / "moved.usda", tmp_path / "c", start_from=str(cache))
    assert not (tmp_path / "c").exists(), "a refused run leaves nothing"


def test_a_cache_is_continued_only_from_its_own_start(fallen: Path, tmp_path: Path) -> None:
    scene, text = alone(tmp_path / "alone.usda"), str(fallen / "cache")
    run(scene, tmp_path / "c", start_from=text, frames="5-8")
    with pytest.raises(MismatchError, match=r"cannot resume, it was started from frame 13 of another cache"):
        run(scene, tmp_path / "c", start_from=f"{text}:11", resume=True)
    for checkpoint in (tmp_path / "c/checkpoints").iterdir():
        checkpoint.unlink()
    with pytest.raises(MismatchError, match=r"started from frame 13 of another cache: give the same option"):
        run(scene, tmp_path / "c", resume=True)
    run(scene, tmp_path / "c", resume=True, start_from=text, frames="5-8")


def test_a_damaged_checkpoint_is_refused_on_the_command_line(fallen: Path, tmp_path: Path, capsys) -> None:
    cache = tmp_path / "copy"
    (cache / "checkpoints").mkdir(parents=True)
    manifest = json.loads((fallen / "cache/manifest.json").read_text())
    shutil.copy(fallen / "cache/manifest.json", cache)
    for entry in manifest["checkpoints"]:
        (cache / entry["file"]).write_bytes(b"damaged")
    scene = alone(tmp_path / "alone.usda")
    with pytest.raises(CacheIOError):
        run(scene, tmp_path / "c", start_from=str(cache))
    code = main(["simulate", str(scene), "-o", str(tmp_path / "c"), "--start-from", str(cache), "--progress", "none"])
    assert code == 5 and "is missing or damaged" in capsys.readouterr().err
