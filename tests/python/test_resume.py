"""A run that is stopped and taken up again has the same content as one that was not."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import content_hashes, environment, make_scene
from eulerfsi.cache import stats_file
from eulerfsi.errors import CacheIOError, MismatchError, UsageError
from eulerfsi.log import Log
from eulerfsi.run.simulate import Options, Result, simulate
from pxr import Usd

pytestmark = pytest.mark.usefixtures("library")

FRAMES = (1, 26)


def run(scene: Path, folder: Path, **options) -> Result:
    return simulate(scene, Options(output=folder, progress="none", **options), Log())


@pytest.fixture(scope="module")
def whole(tmp_path_factory, library) -> tuple[Path, dict]:
    """The scene, and the content of its uninterrupted cache."""
    folder = tmp_path_factory.mktemp("whole")
    make_scene(folder / "small.usda", frames=FRAMES, voxel=0.06)
    run(folder / "small.usda", folder / "cache")
    return folder / "small.usda", content_hashes(folder / "cache")


def start(scene: Path, folder: Path, *options: str) -> subprocess.Popen:
    """The command line in a process of its own, with JSON progress."""
    command = [sys.executable, "-m", "eulerfsi", "simulate", scene, "-o", folder, "--progress", "json", *options]
    return subprocess.Popen(
        [str(c) for c in command], env=environment(), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def stop_after(process: subprocess.Popen, frame: int, number: int, delay: float = 0.0) -> tuple[int, str]:
    """Sends a signal when the frame is reported; returns exit code and standard error."""
    for line in process.stdout:
        event = json.loads(line)
        if event["event"] == "frame" and event["frame"] >= frame:
            break
    time.sleep(delay)
    process.send_signal(number)
    _, errors = process.communicate(timeout=120)
    return process.returncode, errors


@pytest.mark.parametrize(
    ("number", "code", "delay"),
    [(signal.SIGHUP, 129, 0.0), (signal.SIGINT, 130, 0.02), (signal.SIGTERM, 143, 0.0), (signal.SIGTERM, 143, 0.02)],
)
def test_signal_leaves_a_checkpoint_and_resume_gives_the_same_content(whole, tmp_path, number, code, delay):
    scene, expected = whole
    returned, errors = stop_after(start(scene, tmp_path / "cache"), 8, number, delay)
    assert returned == code, errors
    assert "--resume" in errors
    manifest = json.loads((tmp_path / "cache/manifest.json").read_text())
    assert manifest["status"] == "interrupted" and 8 <= len(manifest["frames"]) < 26
    # No frame is lost: the checkpoint is the one made at the signal, not the last periodic one.
    assert manifest["checkpoints"][-1]["frame"] == len(manifest["frames"])
    assert Usd.Stage.Open(str(tmp_path / "cache/small.usda")).GetEndTimeCode() == len(manifest["frames"])
    assert not list((tmp_path / "cache").rglob(".writing-*")) and not (tmp_path / "cache/.lock").exists()

    assert run(scene, tmp_path / "cache", resume=True).resumed
    assert content_hashes(tmp_path / "cache") == expected
    assert Usd.Stage.Open(str(tmp_path / "cache/small.usda")).GetEndTimeCode() == 26
    steps = [json.loads(line) for line in (tmp_path / "cache/stats.jsonl").read_text().splitlines()]
    times = [s["time"] for s in steps if s["event"] == "step"]
    assert times == sorted(set(times))
    assert [s["frame"] for s in steps if s["event"] == "frame"] == list(range(1, 27))


def test_killed_run_is_taken_up_at_its_last_checkpoint(whole, tmp_path):
    scene, expected = whole
    returned, _ = stop_after(start(scene, tmp_path / "cache"), 14, signal.SIGKILL)
    assert returned == -signal.SIGKILL
    (tmp_path / "cache/frames/.writing-1-small.0015.usdc").write_bytes(b"half a frame")
    run(scene, tmp_path / "cache", resume=True)
    assert content_hashes(tmp_path / "cache") == expected
    assert not list((tmp_path / "cache").rglob(".writing-*"))
    assert "from frame 11" in (tmp_path / "cache/log").read_text()


def test_half_a_line_of_statistics_of_a_killed_run_is_dropped(whole, tmp_path):
    scene, expected = whole
    stop_after(start(scene, tmp_path / "cache"), 12, signal.SIGKILL)
    with open(tmp_path / "cache/stats.jsonl", "a", encoding="utf-8") as file:
        file.write('{"event": "step", "frame": 99, "ti')
    before = [line["frame"] for line in stats_file.read(tmp_path / "cache")]
    assert before and max(before) < 26
    run(scene, tmp_path / "cache", resume=True)
    assert content_hashes(tmp_path / "cache") == expected
    frames = [line["frame"] for line in stats_file.read(tmp_path / "cache") if line["event"] == "frame"]
    assert frames == list(range(1, 27))


def test_damaged_statistics_stop_a_resumed_run(whole, tmp_path):
    scene, expected = whole
    run(scene, tmp_path / "cache", frames="1-5")
    path = tmp_path / "cache/stats.jsonl"
    path.write_text("{]\n" + path.read_text())
    with pytest.raises(MismatchError, match=r"stats\.jsonl is damaged: --resume would drop 5 finished frames"):
        run(scene, tmp_path / "cache", resume=True, frames="1-6")
    run(scene, tmp_path / "cache", resume=True, frames="1-6", allow_restart=True)
    assert content_hashes(tmp_path / "cache") == {frame: h for frame, h in expected.items() if int(frame) <= 6}
    assert [line["frame"] for line in stats_file.read(tmp_path / "cache") if line["event"] == "frame"] == [*range(1, 7)]


def test_statistics_that_do_not_fit_on_the_disk_leave_no_half_line(tmp_path):
    lines = [{"event": "step", "time": 0.1 * i, "text": "x" * 3000} for i in range(20)]
    extent = stats_file.Extent()
    stats_file.append(tmp_path, lines[:2], extent)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20000, limit[1]))
    try:
        with pytest.raises(CacheIOError, match=r"stats\.jsonl: cannot be written: File too large"):
            stats_file.append(tmp_path, lines[2:], extent)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert stats_file.read(tmp_path) == lines[:2] and (tmp_path / stats_file.NAME).read_text().endswith("}\n")
    stats_file.append(tmp_path, lines[2:], extent)
    assert stats_file.read(tmp_path) == lines


@pytest.mark.parametrize(
    ("every", "keep", "frames"),
    [
        ("10", "2", [11, 12]),
        ("4", "all", [1, 5, 9, 12]),
        ("1", "3", [10, 11, 12]),
        ("1e9s", "all", None),
        ("3600s", "all", [1, 12]),
        ("0s", "all", list(range(1, 13))),
        ("0", "2", None),
        ("10", "0", None),
    ],
)
def test_checkpoints_follow_their_options(whole, tmp_path, every, keep, frames):
    scene, _ = whole
    options = {"frames": "1-12", "checkpoint_every": every, "keep_checkpoints": keep}
    if frames is None:
        with pytest.raises(UsageError, match="must be a"):
            run(scene, tmp_path / "cache", **options)
        return
    run(scene, tmp_path / "cache", **options)
    manifest = json.loads((tmp_path / "cache/manifest.json").read_text())
    assert [c["frame"] for c in manifest["checkpoints"]] == frames
    assert len(list((tmp_path / "cache/checkpoints").iterdir())) == len(frames)


def test_two_checkpoints_are_kept_every_ten_frames(whole):
    scene, _ = whole
    manifest = json.loads((scene.parent / "cache/manifest.json").read_text())
    assert [c["frame"] for c in manifest["checkpoints"]] == [21, 26]
    names = {p.relative_to(scene.parent / "cache").as_posix() for p in (scene.parent / "cache/checkpoints").iterdir()}
    assert names == {c["file"] for c in manifest["checkpoints"]}


@pytest.mark.parametrize("damage", ["frame", "checkpoint", "truncated checkpoint"])
def test_damaged_files_are_made_again(whole, tmp_path, damage):
    scene, expected = whole
    run(scene, tmp_path / "cache", frames="1-22", keep_checkpoints="all")
    manifest = json.loads((tmp_path / "cache/manifest.json").read_text())
    if damage == "frame":
        (tmp_path / "cache/vdb/small.0015.vdb").write_bytes(b"short")
    else:
        path = tmp_path / "cache" / manifest["checkpoints"][-1]["file"]
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2] if "truncated" in damage else b"x" * len(content))
    loss = "frame 15 is damaged: --resume would drop 10 finished frames and continue after frame 11;"
    if damage != "frame":
        loss = "the last checkpoint is damaged: --resume would drop 1 finished frame and continue after frame 21;"
    with pytest.raises(MismatchError, match=loss + " --allow-restart accepts that"):
        run(scene, tmp_path / "cache", resume=True)
    assert json.loads((tmp_path / "cache/manifest.json").read_text()) == manifest  # nothing has changed
    run(scene, tmp_path / "cache", resume=True, allow_restart=True)
    assert content_hashes(tmp_path / "cache") == expected


def test_longer_range_continues_the_same_cache(whole, tmp_path):
    scene, expected = whole
    run(scene, tmp_path / "cache", frames="1-5")
    run(scene, tmp_path / "cache", frames="1-7", resume=True)
    assert content_hashes(tmp_path / "cache") == {frame: h for frame, h in expected.items() if int(frame) <= 7}


def test_later_range_goes_on_from_the_checkpoint_before_it(whole, tmp_path):
    scene, expected = whole
    run(scene, tmp_path / "cache", frames="1-4")
    run(scene, tmp_path / "cache", frames="5-7", resume=True)
    assert content_hashes(tmp_path / "cache") == {frame: h for frame, h in expected.items() if int(frame) <= 7}


def test_range_that_begins_inside_the_cache_goes_on(whole, tmp_path):
    scene, expected = whole
    run(scene, tmp_path / "cache", frames="1-4")
    run(scene, tmp_path / "cache", frames="3-6", resume=True)
    assert content_hashes(tmp_path / "cache") == {frame: h for frame, h in expected.items() if int(frame) <= 6}


def test_other_first_frame_is_refused_by_name(whole, tmp_path):
    scene, _ = whole
    run(scene, tmp_path / "cache", frames="3-5", start=3)
    with pytest.raises(MismatchError, match=r"the first frame \(--start-frame\) was 3, is 1"):
        run(scene, tmp_path / "cache", frames="1-6", resume=True)
    with pytest.raises(UsageError, match="the last frame 26 comes before the first, 30"):
        run(scene, tmp_path / "other", start=30)


@pytest.mark.parametrize("how", [{}, {"resume": True}, {"overwrite": True}])
def test_later_range_without_a_checkpoint_before_it_is_refused_with_the_way_out(whole, tmp_path, how):
    scene, _ = whole
    if "overwrite" in how:
        run(scene, tmp_path / "cache", frames="1-4")
    with pytest.raises(UsageError) as error:
        run(scene, tmp_path / "cache", frames="5-7", **how)
    assert "--frames 5-7: the simulation starts at frame 1, and there is no checkpoint before" in str(error.value)
    assert "--frames 1-7" in str(error.value) and "--start-frame 5" in str(error.value)
    assert (tmp_path / "cache").exists() == ("overwrite" in how)  # and what was there is there still


def test_range_before_the_first_frame_is_refused_and_start_frame_starts_there(whole, tmp_path):
    scene, expected = whole
    with pytest.raises(UsageError, match="the simulation starts at frame 1; write --frames 1-3, or --start-frame 0"):
        run(scene, tmp_path / "cache", frames="0-3")
    run(scene, tmp_path / "cache", frames="0-3", start=0)
    earlier = {str(int(frame) - 1): hashes for frame, hashes in expected.items() if int(frame) <= 4}
    assert content_hashes(tmp_path / "cache") == earlier


def test_complete_cache_has_nothing_to_do(whole):
    scene, expected = whole
    before = (scene.parent / "cache/frames/small.0020.usdc").stat().st_mtime_ns
    assert run(scene, scene.parent / "cache", resume=True).nothing_to_do
    assert (scene.parent / "cache/frames/small.0020.usdc").stat().st_mtime_ns == before
    assert content_hashes(scene.parent / "cache") == expected


def test_resume_of_nothing_begins(whole, tmp_path):
    scene, expected = whole
    assert not run(scene, tmp_path / "cache", frames="1-2", resume=True).resumed
    assert content_hashes(tmp_path / "cache")["2"] == expected["2"]


def test_other_number_of_threads_may_continue(whole, tmp_path):
    scene, expected = whole
    run(scene, tmp_path / "cache", frames="1-12", threads=1)
    run(scene, tmp_path / "cache", resume=True, threads=2)
    assert content_hashes(tmp_path / "cache") == expected


def test_changed_scene_is_refused_with_the_parameter(whole, tmp_path):
    scene, _ = whole
    run(scene, tmp_path / "cache", frames="1-3")
    before = (tmp_path / "cache/manifest.json").read_text()
    with pytest.raises(MismatchError, match="/World/Ball: youngsModulus was 23333 Pa, is 50000 Pa"):
        run(scene, tmp_path / "cache", resume=True, settings=("Ball.youngsModulus=50000",))
    assert (tmp_path / "cache/manifest.json").read_text() == before


def test_second_run_in_the_same_folder_is_refused(whole, tmp_path):
    scene, _ = whole
    process = start(scene, tmp_path / "cache")
    try:
        assert json.loads(process.stdout.readline())["event"] == "start"
        process.send_signal(signal.SIGSTOP)  # it shall not end before the other begins
        other = start(scene, tmp_path / "cache", "--resume")
        _, errors = other.communicate(timeout=120)
        assert other.returncode == 5 and f"process {process.pid} on {os.uname().nodename} is writing" in errors
    finally:
        process.kill()
        process.communicate()
    assert os.path.exists(tmp_path / "cache/manifest.json")
