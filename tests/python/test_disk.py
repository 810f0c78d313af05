"""The disk that a run will take: near to what it takes, and a run without room is refused before it begins."""

from __future__ import annotations

import json
import shutil

import pytest
from conftest import ROOT, make_scene
from eulerfsi.cache import cache as cache_module
from eulerfsi.cache.output import Output
from eulerfsi.errors import EXIT_IO
from eulerfsi.log import Log
from eulerfsi.run import disk
from eulerfsi.run.checkpoints import Checkpoints
from eulerfsi.run.simulate import Options, load_scene, simulate

pytestmark = pytest.mark.usefixtures("library")
OPTIONS = ("--progress", "none")


def test_what_is_predicted_is_near_to_what_a_cache_takes(tmp_path):
    make_scene(tmp_path / "small.usda", frames=(1, 12), voxel=0.03)
    scene, _ = load_scene(tmp_path / "small.usda", Options(), Log(), 0)
    simulate(tmp_path / "small.usda", Options(output=tmp_path / "cache", progress="none"), Log())
    real = cache_module.size(tmp_path / "cache")
    needed = disk.need(scene, Output(), 12, Checkpoints("10", "2").most(12))
    assert 0.6 * real < needed < 1.6 * real, f"{needed} predicted, {real} taken"
    less = disk.need(scene, Output(half=True, velocity=False), 12, 2)
    assert less < needed < disk.need(scene, Output(), 24, 3) < disk.need(scene, Output(), 24, 3, 24)


def test_smoke_that_spreads_takes_more_and_never_more_than_a_full_box(cli, tmp_path):
    path = ROOT / "examples" / "scenes" / "smoke_only.usda"
    options = Options(output=tmp_path / "cache", progress="none", settings=("/World/Domain.eulerfsi:voxelSize=0.05",))
    scene, _ = load_scene(path, options, Log(), 0)
    simulate(path, options, Log())
    real, frames = cache_module.size(tmp_path / "cache"), len(scene.frames)
    least, most = (disk.need(scene, Output(), frames, 3, full=full) for full in (False, True))
    assert 0.6 * real < least < 1.1 * real < most, f"{least} to {most} predicted, {real} taken"
    facts = json.loads(cli("validate", path, "--set", options.settings[0], "--json").stdout)
    assert (facts["disk"], facts["disk_full"]) == (least, most)


def test_most_checkpoints_at_once():
    assert Checkpoints("10", "2").most(12) == 3 and Checkpoints("1", "5").most(2) == 4
    assert Checkpoints("10", "all").most(100) == 12 and Checkpoints("60s", "all").most(100) == 100


def test_too_little_disk_is_refused_with_both_numbers(cli, tmp_path, monkeypatch):
    make_scene(tmp_path / "small.usda", frames=(1, 2))
    monkeypatch.setattr(disk, "free", lambda _folder: 3 << 10)
    done = cli("simulate", "small.usda", *OPTIONS)
    assert done.returncode == EXIT_IO
    assert "of disk, 3.0 KiB are free" in done.stderr and "--force" in done.stderr
    assert not (tmp_path / "small_cache" / "manifest.json").exists()
    assert cli("simulate", "small.usda", *OPTIONS, "--force").returncode == 0
    assert cli("simulate", "small.usda", *OPTIONS, "--resume").returncode == 0, "nothing is left to be written"
    assert cli("simulate", "small.usda", *OPTIONS, "--resume", "--frames", "1-4").returncode == EXIT_IO


def test_what_is_replaced_makes_room(cli, tmp_path, monkeypatch):
    make_scene(tmp_path / "small.usda", frames=(1, 2))
    assert cli("simulate", "small.usda", *OPTIONS).returncode == 0
    with open(tmp_path / "small_cache" / "frames" / "large.usdc", "wb") as file:
        file.truncate(1 << 30)
    monkeypatch.setattr(disk, "free", lambda _folder: 0)
    assert cli("simulate", "small.usda", *OPTIONS, "--overwrite").returncode == 0


def test_free_of_a_folder_that_is_not_there_yet(tmp_path):
    assert disk.free(tmp_path / "a" / "b") == pytest.approx(shutil.disk_usage(tmp_path).free, rel=0.2)
