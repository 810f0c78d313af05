"""Runs that die, or run into a full or read-only disk, end as a run that was left alone (docs/recovery.md)."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import make_scene
from crashes import Ended, Runs, agree
from eulerfsi.cache.lock import LOCK, FolderLock, is_held
from eulerfsi.cache.manifest import FILE_NAME, Manifest
from eulerfsi.errors import CacheIOError

pytestmark = pytest.mark.usefixtures("library")

EVERY = 2  # frames between checkpoints
SHORT, LONG = "1-6", "1-26"
Simulate = Callable[..., Ended]


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """A folder with the scene."""
    folder = tmp_path_factory.mktemp("crashes")
    make_scene(folder / "small.usda", frames=(1, 26), voxel=0.06)
    return folder


@pytest.fixture(scope="module")
def runs(place) -> Iterator[Runs]:
    with Runs(place) as started:
        yield started


@pytest.fixture(scope="module")
def simulate(runs, place) -> Simulate:
    """Runs the scene into a folder, as a submitted job does."""

    def start(folder: Path, frames: str = SHORT, *options: object, **how: object) -> Ended:
        job = ["--resume", "--allow-restart", "--checkpoint-every", EVERY, "--progress", "none", "--frames", frames]
        return runs.run("simulate", place / "small.usda", "-o", folder, *job, *options, **{"below": folder, **how})

    return start


@pytest.fixture(scope="module")
def whole(simulate, place) -> Callable[[str], tuple[Path, int]]:
    """For a range, the cache of a run that was left alone, and how often it has changed a file."""
    made: dict[str, tuple[Path, int]] = {}

    def get(frames: str) -> tuple[Path, int]:
        if frames not in made:
            ended = simulate(place / frames, frames)
            assert ended.code == 0, ended.told
            made[frames] = (place / frames, ended.changes)
        return made[frames]

    return get


def check_loss(folder: Path) -> None:
    """A kill loses at most one interval, and leaves a manifest that is whole."""
    if not (folder / FILE_NAME).is_file():
        return  # before its first file
    manifest = Manifest.load(folder)
    checkpoint = manifest.usable_checkpoint()
    frame = checkpoint["frame"] if checkpoint else 0
    assert (manifest.last_frame or 0) - frame <= EVERY


@pytest.mark.parametrize(
    ("frames", "kills", "seed"),
    [(SHORT, 5, 1), *(pytest.param(LONG, 10, seed, marks=pytest.mark.nightly) for seed in range(2, 7))],
)
def test_kills_between_and_inside_writes(simulate, whole, tmp_path, frames, kills, seed):
    moments, changes = random.Random(seed), whole(frames)[1]
    for _ in range(kills):
        at = moments.randint(1, changes * 2 // kills)
        code = simulate(tmp_path / "cache", frames, at=at).code
        print(f"change {at}: exit code {code}")
        check_loss(tmp_path / "cache")
    assert simulate(tmp_path / "cache", frames).code == 0
    agree(tmp_path / "cache", whole(frames)[0])


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(5))
def test_kills_at_random_times(simulate, whole, tmp_path, seed):
    moments = random.Random(seed)
    for _ in range(5):
        simulate(tmp_path / "cache", LONG, seconds=moments.uniform(0.05, 1.5))
        check_loss(tmp_path / "cache")
    assert simulate(tmp_path / "cache", LONG).code == 0
    agree(tmp_path / "cache", whole(LONG)[0])


@pytest.mark.nightly
def test_every_change_of_a_first_frame_may_be_the_last(simulate, whole, place, tmp_path):
    first = place / "first"
    changes = simulate(first, "1-2").changes
    for at in range(1, changes + 1, 2):
        shutil.rmtree(tmp_path / "cache", ignore_errors=True)
        print(f"change {at}")
        assert simulate(tmp_path / "cache", "1-2", at=at).code == -9
        assert simulate(tmp_path / "cache", "1-2").code == 0
        agree(tmp_path / "cache", first)


def test_overwriting_that_is_killed_leaves_a_cache(simulate, runs, whole, place, tmp_path):
    folder = tmp_path / "cache"
    shutil.copytree(whole(SHORT)[0], folder)
    job = ["--overwrite", "--checkpoint-every", EVERY, "--progress", "none", "--frames", SHORT]
    assert runs.run("simulate", place / "small.usda", "-o", folder, *job, below=folder, at=12).code == -9
    ended = simulate(folder)
    assert ended.code == 0 and "is missing" in ended.told
    agree(folder, whole(SHORT)[0])


def test_out_of_time_again_and_again(simulate, whole, tmp_path):
    codes = [simulate(tmp_path / "cache", SHORT, "--max-wall-seconds", "1e-3").code for _ in range(3)]
    assert codes == [75, 75, 75]
    assert simulate(tmp_path / "cache").code == 0
    agree(tmp_path / "cache", whole(SHORT)[0])


def test_a_clock_that_jumps(simulate, whole, tmp_path):
    ended = simulate(tmp_path / "cache", SHORT, "--max-wall-seconds", "3600", "--wait", "10", jump=True)
    assert ended.code == 0
    agree(tmp_path / "cache", whole(SHORT)[0])
    years = {line[:4] for line in (tmp_path / "cache/log").read_text().splitlines()}
    assert len(years) > 2  # it did jump


@pytest.fixture
def disk(tmp_path) -> Iterator[Callable[[str], Path]]:
    """Mounts a small file system with options, or again with others; skips where this user may not."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = []

    def mount(options: str) -> Path:
        again = "remount," if mounted else ""
        command = ["mount", "-t", "tmpfs", "-o", again + options, "tmpfs", folder]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("no right to mount a file system")
        mounted.append(options)
        return folder

    yield mount
    if mounted:
        subprocess.run(["umount", folder], check=True)


@pytest.mark.parametrize(
    "kilobytes",
    [200, *(pytest.param(size, marks=pytest.mark.nightly) for size in (4, 8, 16, 32, 64, 96, 128, 160, 240, 280, 320))],
)
def test_a_full_disk_is_named_and_the_run_goes_on_with_more(simulate, whole, disk, kilobytes):
    folder = disk(f"size={kilobytes}k") / "cache"
    ended = simulate(folder, SHORT, "--force")
    assert ended.code == 5 and "No space left on device" in ended.told and str(folder) in ended.told
    check_loss(folder)
    disk("size=8m")
    assert simulate(folder).code == 0
    agree(folder, whole(SHORT)[0])


def test_a_read_only_disk_is_named_and_nothing_is_lost(simulate, whole, disk):
    folder = disk("size=8m") / "cache"
    simulate(folder, "1-3")
    disk("ro")
    ended = simulate(folder)
    assert ended.code == 5 and f"{folder}: output folder:" in ended.told and "not writable" in ended.told
    disk("rw,size=8m")
    assert simulate(folder).code == 0
    agree(folder, whole(SHORT)[0])


def test_a_lock_of_another_host_that_is_gone_locks_nothing(simulate, whole, tmp_path):
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / LOCK).write_text("process 99 on node7\n")
    os.utime(tmp_path / "cache" / LOCK, (time.time() + 1e6,) * 2)
    ended = simulate(tmp_path / "cache")
    assert ended.code == 0 and "process 99 on node7 was writing to this cache" in ended.told
    agree(tmp_path / "cache", whole(SHORT)[0])


def test_a_second_run_is_refused_by_name_or_waits(simulate, tmp_path):
    folder = tmp_path / "cache"
    with FolderLock(folder):
        assert is_held(folder)
        owner = f"process {os.getpid()} on {os.uname().nodename}"
        for options in ([], ["--wait", "0.2"]):
            ended = simulate(folder, "1-2", *options)
            assert ended.code == 5 and f"{folder}: {owner} is writing to this cache" in ended.told
        with pytest.raises(CacheIOError, match="--wait SECONDS"), FolderLock(folder):
            pass
        assert is_held(folder)
        process = subprocess.Popen(["sleep", "0"])
        process.wait()
    assert not folder.exists()  # it is as before
    for never in ("nan", "inf"):
        assert simulate(folder, "1-2", "--wait", never).code == 2


def test_a_run_that_waits_begins_when_the_other_has_ended(tmp_path):
    told: list[str] = []
    first = FolderLock(tmp_path / "cache")
    first.__enter__()

    def tell(text: str) -> None:
        told.append(text)
        first.__exit__()

    with FolderLock(tmp_path / "cache", 30.0, tell):
        assert "waiting for process" in told[0] and "at most 30 s" in told[0]
        assert is_held(tmp_path / "cache")
    assert not (tmp_path / "cache").exists()


def test_a_file_system_without_locks_is_told(tmp_path, monkeypatch):
    def refuse(*_arguments: object) -> None:
        raise OSError(37, "No locks available")

    told: list[str] = []
    monkeypatch.setattr("eulerfsi.cache.lock.fcntl.flock", refuse)
    with FolderLock(tmp_path, 0.0, told.append):
        pass
    assert told == [f"{tmp_path}: not locked against a second run: No locks available"]
