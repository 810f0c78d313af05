"""What a command says of itself in a machine's words: events, reports, the state of a cache."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from conftest import author, environment, make_scene
from eulerfsi import progress
from eulerfsi.frames import FrameRange
from events import event, events
from pxr import Usd, UsdGeom


def start(scene: Path, folder: Path, *options: str) -> subprocess.Popen:
    command = [sys.executable, "-m", "eulerfsi", "simulate", scene, "-o", folder, "--progress", "json", *options]
    return subprocess.Popen(
        [str(c) for c in command], env=environment(), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def with_loose_faces(path: Path) -> None:
    """Turns a face of the ball, so that its surface is repaired."""
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    indices = list(mesh.GetFaceVertexIndicesAttr().Get())
    indices[0], indices[1] = indices[1], indices[0]
    mesh.GetFaceVertexIndicesAttr().Set(indices)
    stage.GetRootLayer().Save()


def test_a_run_tells_its_start_its_frames_its_warnings_and_its_end(cli, scene, tmp_path):
    with_loose_faces(scene)
    done = cli("simulate", scene, "--progress", "json", "-o", tmp_path / "out")
    found = events(done.stdout, done.returncode)
    kinds = [one["event"] for one in found if one["event"] not in ("step", "waiting")]
    assert kinds == ["warning", "start", "frame", "frame", "frame", "end"], done.stderr
    warning, begin, *frames, end = (one for one in found if one["event"] not in ("step", "waiting"))
    assert (warning["code"], warning["prim"], warning["field"]) == ("repaired_mesh", "/World/Ball", "points")
    manifest = json.loads((tmp_path / "out/manifest.json").read_text())
    assert begin["scene_hash"] == manifest["scene_hash"] and begin["folder"] == str(tmp_path / "out")
    assert (begin["first"], begin["last"], begin["done"], begin["cells"]) == (1, 3, 0, 2016)
    assert [frame["percent"] for frame in frames] == [33, 66, 100]
    assert frames[0]["eta"] is None and frames[-1]["eta"] == 0
    assert end["last_frame"] == 3
    again = cli("simulate", scene, "--progress", "json", "-o", tmp_path / "out", "--resume")
    assert [one["event"] for one in events(again.stdout, 0)] == ["warning", "start", "end"]


def test_a_scene_that_is_refused_has_an_error_for_every_fault_and_no_start(cli, scene):
    stage = Usd.Stage.Open(str(scene))
    author(stage.GetPrimAtPath("/World/Ball"), youngsModulus=-1.0, poissonsRatio=0.7)
    stage.GetRootLayer().Save()
    for command in ("simulate", "validate"):
        done = cli(command, scene, "--progress", "json")
        found = events(done.stdout, done.returncode)
        assert {one["event"] for one in found} == {"error", "end"}
        assert {(one["prim"], one["field"]) for one in found[:-1]} == {
            ("/World/Ball", "eulerfsi:youngsModulus"),
            ("/World/Ball", "eulerfsi:poissonsRatio"),
        }
    report = json.loads(cli("validate", scene, "--json").stdout)
    assert [{"event": "error", **one} for one in report["errors"]] == found[:-1]


def test_validate_and_info_have_the_same_words_for_programs(cli, scene, tmp_path):
    with_loose_faces(scene)
    done = cli("validate", scene, "--progress", "json")
    told = {one["event"]: one for one in events(done.stdout, done.returncode)}
    assert set(told) == {"warning", "start", "end"}
    report = json.loads(cli("validate", scene, "--json").stdout)
    assert report["errors"] == [] and {"event": "warning", **report["warnings"][0]} == told["warning"]
    same = ("scene", "scene_hash", "first", "last", "memory", "threads", "cells")
    assert {key: report[key] for key in same} == {key: told["start"][key] for key in same}
    about = json.loads(cli("info", scene, "--json").stdout)
    assert about["scene_hash"] == report["scene_hash"] and about["parameters"] == report["parameters"]
    assert json.loads(cli("info", "--json").stdout)["library"].startswith("0.")


@pytest.mark.usefixtures("library")
def test_a_killed_run_is_running_until_it_is_killed_and_then_stopped(cli, tmp_path):
    make_scene(tmp_path / "small.usda", frames=(1, 400), voxel=0.06)
    process = start(tmp_path / "small.usda", tmp_path / "cache")
    lines = []
    for line in process.stdout:
        lines.append(line)
        if event(line)["event"] == "frame":
            break
    state = lambda: json.loads(cli("info", tmp_path / "cache", "--json").stdout)["status"]  # noqa: E731
    assert state() == "running"
    process.send_signal(signal.SIGKILL)
    rest, _ = process.communicate(timeout=60)
    whole = rest[: rest.rfind("\n") + 1]  # the last line may be half a line
    assert {"start", "frame"} <= {one["event"] for one in events([*lines, *whole.splitlines()], None)}
    assert process.returncode == -signal.SIGKILL and state() == "stopped"


def test_steps_and_waiting_come_at_most_once_a_second(monkeypatch, capsys):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    told = progress.make_progress("json")
    facts = {"scene": "a.usda", "scene_hash": "0" * 64, "folder": None, "threads": 1, "memory": 1, "memory_limit": 2}
    told.start("simulate", FrameRange(1, 5), 1, **facts, cells=8)
    waiting = progress.Waiting(told, "examining the surface", "/World/Bunny")
    for tenth in range(40):
        now[0] = 100.0 + 0.1 * tenth
        told.between_steps(2, tenth / 40, 0.001 * tenth)
        waiting.at(tenth / 40)
    found = [event(line) for line in capsys.readouterr().out.splitlines()]
    steps = [one for one in found if one["event"] == "step"]
    assert [one["fraction"] for one in steps] == [0, 0.25, 0.5, 0.75]
    assert [one["eta"] for one in steps] == [None, 15.0, 14.0, 13.0]  # a frame takes four seconds
    assert len([one for one in found if one["event"] == "waiting"]) == 3


def test_the_time_left_follows_the_last_frames(monkeypatch, capsys):
    """Two frames of one second, two of three, the n-th weighs n; a run that goes on knows its own frames alone."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    facts = {"scene": "a.usda", "scene_hash": "0" * 64, "folder": None, "threads": 1, "memory": 1, "memory_limit": 2}
    done = {"time": 0.1, "seconds": 1.0, "steps": 3}
    for there, expected in ((0, [None, 3.0, 2.0, (1 + 2 + 9) / 6, 0.0]), (2, [2.0, (1 + 6) / 3, 0.0])):
        now[0] = 0.0
        told = progress.make_progress("json")
        told.start("simulate", FrameRange(1, 5), there, **facts, cells=8)
        for frame in range(1 + there, 6):
            now[0] += (0.0, 1.0, 1.0, 3.0, 3.0)[frame - 1]
            told.frame_done(frame, **done)
        found = [event(line) for line in capsys.readouterr().out.splitlines()]
        assert [one["eta"] for one in found if one["event"] == "frame"] == [e and round(e, 2) for e in expected]
        assert found[-1]["elapsed"] == now[0]


def test_the_schema_refuses_what_is_no_event():
    end = {"event": "end", "status": "complete", "exit_code": 0, "last_frame": 3, "elapsed": 1.0, "error": None}
    assert event(json.dumps(end)) == end
    for wrong in ({**end, "exit_code": "0"}, {**end, "more": 1}, {**end, "event": "stop"}, {"event": "warning"}):
        with pytest.raises(jsonschema.ValidationError):
            event(json.dumps(wrong))


@pytest.mark.usefixtures("library")
def test_without_matplotlib_a_run_ends_well_and_says_that_there_is_no_picture(cli, scene, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    done = cli("simulate", scene)
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout.splitlines()[-1] == "preview: none; drawing it needs matplotlib"
    assert not (tmp_path / "small_cache/preview.png").exists()
    assert json.loads((tmp_path / "small_cache/manifest.json").read_text())["status"] == "complete"
    drawn = cli("plot", "step", tmp_path / "small_cache")
    assert drawn.returncode == 2 and "pip install matplotlib" in drawn.stderr


@pytest.mark.parametrize(
    ("mode", "lines"),
    [
        (
            "openjd",
            [
                "openjd_status: simulate: 1 of 4 frames are done",
                "openjd_progress: 37",
                "openjd_progress: 50",
                "openjd_status: frame 2 of 1-4 is done",
                "openjd_fail: frame 3: it diverged; and more",
            ],
        ),
        ("alf", ["ALF_PROGRESS 37%", "ALF_PROGRESS 50%"]),
    ],
)
def test_lines_for_render_farms(mode, lines, capsys):
    """As sessions of Open Job Description, and Alfred and Tractor, read them: whole lines, percent from 0 to 100."""
    told = progress.make_progress(mode)
    told.start("simulate", FrameRange(1, 4), 1)
    for fraction in (0.5, 0.501):
        told.between_steps(2, fraction, 0.01)
    told.frame_done(2)
    told.end("failed", 4, "frame 3: it diverged;\n  and more")
    out = capsys.readouterr().out.splitlines()
    assert sorted(out) == sorted(lines)
    assert all(line.startswith(("openjd_", "ALF_PROGRESS ")) for line in out)


def test_a_stopped_run_is_no_failure_for_a_farm(capsys):
    told = progress.make_progress("openjd")
    told.end("interrupted", 75, "stopped after 60 s by --max-wall-seconds")
    assert capsys.readouterr().out == "openjd_status: stopped after 60 s by --max-wall-seconds\n"
