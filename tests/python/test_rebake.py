"""`simulate --rebake-from N`: frames up to N stay, later ones are those of a run that had the change from N on."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import author, box, content_hashes, make_scene
from eulerfsi.cli.info import info
from eulerfsi.errors import CacheIOError, MismatchError, UsageError
from eulerfsi.log import Log
from eulerfsi.run.simulate import Options, Result, simulate
from eulerfsi.solver.volume_file import VolumeFile
from pxr import Gf, Sdf, Usd, UsdGeom
from standard_stages import add_body, new_stage, vec_array

pytestmark = pytest.mark.usefixtures("library")

LAST, CHANGE = 8, 3
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "scenes"


def run(scene: Path, folder: Path, **options) -> Result:
    every = {"checkpoint_every": "1", "keep_checkpoints": "all"}
    return simulate(scene, Options(output=folder, progress="none", **every, **options), Log())


def manifest(folder: Path) -> dict:
    return json.loads((folder / "manifest.json").read_text())


def files_until(folder: Path, frame: int) -> dict[str, bytes]:
    frames = manifest(folder)["frames"]
    return {name: (folder / name).read_bytes() for n in frames if int(n) <= frame for name in frames[n]["files"]}


def moving_scene(
    path: Path, *, puff_until: int | None = None, lift_until: int = LAST, moved: float = 0.0, dip: float = 0.0
) -> Path:
    """The small scene with an emitter that is on until a frame, and a floor that rises until another, but dips at 2."""
    stage = make_scene(path, frames=(1, LAST), voxel=0.06)
    puff = box(stage, "/World/Puff", (0.1, -0.2, 0.0), (0.15, 0.15, 0.15), 1.0, "EulerFsiEmitterAPI")
    author(puff, mode="continuous", smokeDensity=0.5)
    if puff_until is not None:
        enabled = puff.GetAttribute("eulerfsi:enabled")
        enabled.Set(True, 1)
        enabled.Set(False, puff_until)
    floor = box(stage, "/World/Lift", (moved, -0.42, 0.0), (0.3, 0.1, 0.3), 1.0, "EulerFsiColliderAPI")
    translate = UsdGeom.XformCommonAPI(UsdGeom.Xformable(floor))
    for frame in range(1, LAST + 1):
        height = -0.42 + 0.01 * min(frame - 1, lift_until - 1) - (dip if frame == 2 else 0.0)
        translate.SetTranslate(Gf.Vec3d(moved, height, 0.0), frame)
    stage.GetRootLayer().Save()
    return path


@pytest.fixture(scope="module")
def baked(tmp_path_factory, library) -> tuple[Path, Path]:
    """Scene and cache with a checkpoint of every frame. Tests copy the cache."""
    folder = tmp_path_factory.mktemp("baked")
    scene = moving_scene(folder / "moving.usda")
    run(scene, folder / "cache")
    return scene, folder / "cache"


def copy_of(folder: Path, target: Path) -> Path:
    return Path(shutil.copytree(folder, target))


@pytest.mark.parametrize("frame", [1, CHANGE, LAST - 1])
def test_without_a_change_it_gives_the_same_bits(baked: tuple[Path, Path], tmp_path: Path, frame: int) -> None:
    scene, cache = baked
    folder = copy_of(cache, tmp_path / "cache")
    run(scene, folder, rebake_from=frame)
    assert content_hashes(folder) == content_hashes(cache)
    assert not manifest(folder)["stretches"]
    lines = [json.loads(line) for line in (folder / "stats.jsonl").read_text().splitlines()]
    assert [line["frame"] for line in lines if line["event"] == "frame"] == list(range(1, LAST + 1))


def test_a_range_may_begin_where_the_rebake_does(baked: tuple[Path, Path], tmp_path: Path) -> None:
    scene, cache = baked
    folder = copy_of(cache, tmp_path / "cache")
    run(scene, folder, rebake_from=CHANGE, frames=f"{CHANGE + 1}-{LAST}")
    assert content_hashes(folder) == content_hashes(cache)


@pytest.mark.parametrize("change", [{"puff_until": CHANGE + 1}, {"lift_until": CHANGE}])
def test_later_frames_are_those_of_a_run_that_had_the_change(
    baked: tuple[Path, Path], tmp_path: Path, change: dict
) -> None:
    """Both changes begin after the frame, so that a run of the changed scene has had it from there on."""
    _, cache = baked
    scene = moving_scene(tmp_path / "moving.usda", **change)
    run(scene, tmp_path / "whole")
    folder = copy_of(cache, tmp_path / "cache")
    before = files_until(folder, CHANGE)
    run(scene, folder, rebake_from=CHANGE)
    assert files_until(folder, CHANGE) == before
    whole, rebaked = content_hashes(tmp_path / "whole"), content_hashes(folder)
    assert {n: whole[n] for n in whole if int(n) > CHANGE} == {n: rebaked[n] for n in rebaked if int(n) > CHANGE}
    assert rebaked[str(LAST)] != content_hashes(cache)[str(LAST)]


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["ball", "heap", "struck"])
def test_examples_made_anew_without_a_change_have_the_same_bits(tmp_path: Path, name: str) -> None:
    """Frame by frame: state, meshes and smoke, made anew from frames 3, 12 and 24."""
    scene, coarse = EXAMPLES / f"{name}.usda", ("/World/Domain.eulerfsi:voxelSize=0.02",)
    run(scene, cache := tmp_path / "cache", frames="1-25", settings=coarse)
    before = content_hashes(cache)
    assert len({str(hashes) for hashes in before.values()}) == 25, "every frame is another one"
    for frame in (3, 12, 24):
        kept = files_until(cache, frame)
        first_new = manifest(cache)["frames"][str(frame + 1)]["files"]
        written = {file: (cache / file).stat().st_mtime_ns for file in first_new}
        run(scene, cache, frames="1-25", settings=coarse, rebake_from=frame)
        assert all((cache / file).stat().st_mtime_ns > written[file] for file in first_new), "later frames are new"
        assert files_until(cache, frame) == kept
        assert content_hashes(cache) == before, f"from frame {frame}"


def test_a_parameter_that_changes_is_in_the_manifest(baked: tuple[Path, Path], tmp_path: Path) -> None:
    scene, cache = baked
    folder = copy_of(cache, tmp_path / "cache")
    softer = {"settings": ("/World/Ball.eulerfsi:youngsModulus=9000",)}
    run(scene, folder, rebake_from=5, **softer)
    data = manifest(folder)
    assert [stretch["last"] for stretch in data["stretches"]] == [5]
    assert data["stretches"][0]["parameters"]["/World/Ball"]["youngs_modulus"] == pytest.approx(23333)
    assert data["parameters"]["/World/Ball"]["youngs_modulus"] == 9000
    assert any("frames up to 5 were made with other values" in line for line in info(folder).lines)
    # Once more from an earlier frame: the one from 5 on is gone.
    run(scene, folder, rebake_from=CHANGE, **softer)
    assert [stretch["last"] for stretch in manifest(folder)["stretches"]] == [CHANGE]
    # Back to what it was.
    run(scene, folder, rebake_from=CHANGE)
    assert not manifest(folder)["stretches"]
    assert content_hashes(folder) == content_hashes(cache)


def test_a_rebake_that_stops_is_resumed(baked: tuple[Path, Path], tmp_path: Path) -> None:
    """Also from the checkpoint of the frame before the change, which belongs to other parameters."""
    scene, cache = baked
    softer = {"settings": ("/World/Ball.eulerfsi:youngsModulus=9000",)}
    run(scene, whole := copy_of(cache, tmp_path / "whole"), rebake_from=CHANGE, **softer)
    folder = copy_of(cache, tmp_path / "cache")
    run(scene, folder, rebake_from=CHANGE, frames=f"1-{CHANGE + 1}", **softer)
    with pytest.raises(MismatchError, match="the scene has changed"):
        run(scene, folder, resume=True)
    (folder / manifest(folder)["checkpoints"][-1]["file"]).unlink()
    run(scene, folder, resume=True, allow_restart=True, **softer)
    assert content_hashes(folder) == content_hashes(whole)
    assert Usd.Stage.Open(str(folder / "moving.usda")).GetEndTimeCode() == LAST


def test_what_cannot_be_made_anew_is_refused_by_name(baked: tuple[Path, Path], tmp_path: Path) -> None:
    scene, cache = baked
    folder = copy_of(cache, tmp_path / "cache")
    before = files_until(folder, LAST), manifest(folder)

    def refused(error: type[Exception], text: str, path: Path = scene, frame: int = CHANGE, **options) -> None:
        with pytest.raises(error, match=text):
            run(path, folder, rebake_from=frame, **options)
        assert (files_until(folder, LAST), manifest(folder)) == before

    refused(UsageError, rf"--rebake-from {LAST}: must be from 1 to {LAST - 1}", frame=LAST)
    refused(UsageError, "--rebake-from 0: must be", frame=0)
    refused(UsageError, "--start-from: must not be given with --rebake-from", start_from=str(cache))
    refused(MismatchError, r"voxel_size = 0\.05: must be 0\.06", settings=("/World/Domain.eulerfsi:voxelSize=0.05",))
    refused(MismatchError, "/World/Lift: its mesh is another one", moving_scene(tmp_path / "a.usda", moved=0.02))
    refused(
        MismatchError,
        "/World/Lift: its pose in frame 3 is another one",
        moving_scene(tmp_path / "b.usda", lift_until=2),
    )
    early = moving_scene(tmp_path / "d.usda", dip=0.01)  # and back at frame 3
    refused(MismatchError, "/World/Lift: its pose in frame 2 is another one", early)
    refused(MismatchError, r"ambient_fluid = 0: must be 1", settings=("/World/Domain.eulerfsi:ambientFluid=0",))
    two = Usd.Stage.Open(str(moving_scene(tmp_path / "c.usda")))
    Sdf.CopySpec(two.GetRootLayer(), "/World/Lift", two.GetRootLayer(), "/World/Lift2")
    two.GetRootLayer().Save()
    refused(MismatchError, "/World/Lift2 is new: bodies cannot come or go", tmp_path / "c.usda")
    with pytest.raises(UsageError, match="contains no cache"):
        run(scene, tmp_path / "none", rebake_from=2)

    few = tmp_path / "few"
    simulate(scene, Options(output=few, progress="none"), Log())
    with pytest.raises(MismatchError, match=r"no checkpoint of that frame; frames with one: 1, 8"):
        run(scene, few, rebake_from=4)
    damaged = folder / f"frames/moving.{2:04d}.usdc"
    damaged.write_bytes(damaged.read_bytes()[:-5])
    with pytest.raises(CacheIOError, match="--rebake-from 3: frame 2 is missing or damaged"):
        run(scene, folder, rebake_from=CHANGE)


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        (
            "Ball.velocity=(0,0,1)",
            r"velocity was \(0, -2, 0\) m/s, is \(0, 0, 1\) m/s: it acts at the start alone",
        ),
        ("Ball.angularVelocity=(0,180,0)", r"angularVelocity was \(0, 0, 0\) rad/s, is \(0, 3.14159, 0\) rad/s: it"),
        ("Ball.stretch=(1,1.1,1)", r"stretch was \(1, 1, 1\), is \(1, 1.1, 1\): it acts at the start alone"),
        ("Carpet.smokeDensity=0.2", r"smokeDensity was 0.8, is 0.2: it acts at the start alone"),
        ("Carpet.enabled=false", r"is gone: it acts at the start alone"),
        ("Puff.mode=initial", r"mode was continuous, is initial: it acts at the start alone"),
        ("Puff.startTime=0.05", r"startTime was 0 s, is 0.05 s: it acts up to frame 3 alone"),
    ],
)
def test_a_value_that_acts_before_the_frame_alone_is_refused_by_name(
    baked: tuple[Path, Path], tmp_path: Path, setting: str, text: str
) -> None:
    scene, cache = baked
    folder = copy_of(cache, tmp_path / "cache")
    before = files_until(folder, LAST), manifest(folder)
    prim = "/World/" + setting.partition(".")[0]
    with pytest.raises(MismatchError, match=f"--rebake-from {CHANGE}: {prim}: {text}") as caught:
        run(scene, folder, rebake_from=CHANGE, settings=(setting,))
    gone = setting == "Carpet.enabled=false"
    assert caught.value.prim == prim
    assert caught.value.field == ("" if gone else "eulerfsi:" + setting.partition(".")[2].partition("=")[0])
    assert (files_until(folder, LAST), manifest(folder)) == before


def test_what_acts_later_too_is_not_refused(baked: tuple[Path, Path], tmp_path: Path) -> None:
    """An emitter that lasts until another time, and a key that changes what follows it."""
    scene, cache = baked
    folder = copy_of(cache, tmp_path / "cache")
    run(scene, folder, rebake_from=CHANGE, settings=("Puff.endTime=0.1",))
    assert content_hashes(folder)[str(LAST)] != content_hashes(cache)[str(LAST)]
    run(scene, folder, rebake_from=CHANGE, settings=("Carpet.mode=continuous",))
    run(scene, folder, rebake_from=CHANGE)  # and back, though the carpet is an initial one again
    assert content_hashes(folder) == content_hashes(cache)
    keys = copy_of(cache, tmp_path / "keys")
    with pytest.raises(MismatchError, match="/World/Puff: its time samples have changed: it acts up to frame 3"):
        run(_blinking(tmp_path / "early", (1, 0), (2, 1)), keys, rebake_from=CHANGE)
    run(_blinking(tmp_path / "late", (1, 1), (3, 0)), keys, rebake_from=CHANGE)
    assert content_hashes(keys)[str(LAST)] != content_hashes(cache)[str(LAST)]


def _blinking(folder: Path, *keys: tuple[int, int]) -> Path:
    folder.mkdir()
    path = moving_scene(folder / "moving.usda")
    stage = Usd.Stage.Open(str(path))
    for frame, on in keys:
        stage.GetPrimAtPath("/World/Puff").GetAttribute("eulerfsi:enabled").Set(bool(on), frame)
    stage.GetRootLayer().Save()
    return path


def test_another_start_of_a_body_of_the_standard_is_refused(tmp_path: Path) -> None:
    """Points that start with velocities of their own, which no parameter holds."""

    def spinning(rate: float) -> Path:
        (folder := tmp_path / f"{rate:g}").mkdir(exist_ok=True)
        if (path := folder / "spin.usda").exists():
            return path
        stage = new_stage(path, voxel=0.05)
        points = np.asarray(UsdGeom.TetMesh(sim := add_body(stage)).GetPointsAttr().Get(), float)
        UsdGeom.TetMesh(sim).CreateVelocitiesAttr(vec_array(np.cross([0, 0, rate], points)))
        stage.Save()
        return path

    run(spinning(3.0), tmp_path / "cache")
    run(spinning(3.0), tmp_path / "cache", rebake_from=2)
    with pytest.raises(
        MismatchError, match="/World/Jelly: where its points start, or how they move then, has changed: it acts"
    ):
        run(spinning(4.0), tmp_path / "cache", rebake_from=2)


def test_options_of_the_output(baked: tuple[Path, Path], tmp_path: Path, cli) -> None:
    """Half floats, a threshold, a region and no velocity: read back, kept in the manifest, the same when resumed."""
    scene, cache = baked
    name = f"vdb/moving.{LAST:04d}.vdb"
    with VolumeFile(cache / name) as file:
        full, whole = file.grid("density"), file.read("density")
        assert file.grid("vel")["components"] == 3
        coarse = file.read("density", coarsen=2)
    assert whole.shape == tuple(full["size"])
    assert coarse.sum() * 8 == pytest.approx(whole.sum(), rel=1e-5)
    options = ["--half", "--smoke-threshold", "0.2", "--no-velocity", "--region", "-0.3,-0.5,-0.3,0,0,0.3"]
    done = cli("simulate", scene, "-o", "small", "--frames", "1-4", *options)
    assert done.returncode == 0, done.stderr
    assert cli("simulate", scene, "-o", "small", "--resume").returncode == 0
    assert manifest(tmp_path / "small")["output"]["half"] is True
    with VolumeFile(tmp_path / "small" / name) as file:
        part, values = file.grid("density"), file.read("density")
        with pytest.raises(Exception, match="has no grid 'vel'; its grids: density"):
            file.grid("vel")
    assert np.all((values == 0) | (values > 0.2))
    ends = part["transform"][:3, 3] + part["transform"][0, 0] * (part["min"] + part["size"] - 1)
    assert ends[0] < 0 and 0 < part["active_count"] < full["active_count"]
    assert (tmp_path / "small" / name).stat().st_size < 0.5 * (cache / name).stat().st_size
    stage = Usd.Stage.Open(str(tmp_path / "small/moving.usda"))
    assert not [prim for prim in stage.Traverse() if prim.GetName() == "vel"]

    other = cli("simulate", scene, "-o", "small", "--resume", "--smoke-threshold", "0.3")
    assert other.returncode == 7 and "cannot resume, the cache was started with another output: half" in other.stderr
    for option, text in (
        ("--region=1,2,3", "must be six numbers"),
        ("--region=0,0,0,1,1,0", "must be six numbers"),
        ("--region=1,0,0,2,1,1", "must overlap the domain, which lies in -0.3,-0.5,-0.3,0.3,0.2,0.3"),
        ("--smoke-threshold=-1", "must be a number >= 0"),
        ("--smoke-threshold=nan", "must be a number >= 0"),
    ):
        done = cli("simulate", scene, "-o", "bad", option)
        assert done.returncode == 2 and text in done.stderr
