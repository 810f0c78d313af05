"""The command line: commands, exit codes, progress, what is refused and what the end says."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import content_hashes, environment, make_scene, write_obj
from eulerfsi import system
from eulerfsi.cli.main import main
from pxr import Usd, UsdGeom


def lines(text: str) -> list[str]:
    return text.splitlines()


def test_simulate_ends_with_the_folder_how_to_open_it_and_the_picture(cli, scene, tmp_path):
    done = cli("simulate", scene)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "small_cache"  # the default: ./<scene>_cache
    last = lines(done.stdout)[-3:]
    assert last[0].split() == ["cache:", str(folder)]
    assert str(folder / "small.usda") in last[1] and last[2].split() == ["preview:", str(folder / "preview.png")]
    assert (folder / "preview.png").is_file()


def test_module_runs_as_a_process(scene, tmp_path):
    command = [sys.executable, "-m", "eulerfsi", "simulate", scene, "--frames", "1-2", "--set", "Domain.voxelSize=-1"]
    done = subprocess.run(command, cwd=tmp_path, env=environment(), text=True, capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (3, "")
    assert "voxelSize = -1: must be > 0" in done.stderr


@pytest.mark.parametrize("mode", ["json", "plain"])
def test_run_goes_on_when_nobody_listens_any_more(library, scene, tmp_path, mode):
    command = [sys.executable, "-m", "eulerfsi", "simulate", scene, "--progress", mode]
    process = subprocess.Popen(command, cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline()
    process.stdout.close()
    process.stderr.read()
    assert process.wait(timeout=120) == 0
    assert json.loads((tmp_path / "small_cache/manifest.json").read_text())["status"] == "complete"


def test_plain_progress_is_whole_percents_that_grow(cli, scene):
    done = cli("simulate", scene, "--progress", "plain")
    percents = [int(line.split("%")[0]) for line in lines(done.stdout) if "% frame" in line]
    assert percents == sorted(set(percents)) and percents[-1] == 100
    assert "\r" not in done.stdout


def test_auto_progress_is_plain_without_a_terminal(cli, scene):
    assert "100% frame 3 of 1-3" in lines(cli("simulate", scene).stdout)


def test_no_progress_leaves_the_end_message(cli, scene):
    assert len(lines(cli("simulate", scene, "--progress", "none").stdout)) == 3


def test_frames_threads_preset_and_set_reach_the_run(cli, scene, tmp_path):
    options = [
        "--start-frame",
        "5",
        "--frames",
        "5-6",
        "--threads",
        "1",
        "--preset",
        "paper2016",
        "--set",
        "Domain.voxelSize=0.06",
    ]
    done = cli("simulate", scene, *options, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    manifest = json.loads((tmp_path / "out/manifest.json").read_text())
    assert list(manifest["frames"]) == ["5", "6"] and manifest["frames"]["5"]["time"] == 0.0
    domain = manifest["parameters"]["/World/Domain"]
    assert domain["preset"] == 1 and domain["voxel_size"] == 0.06
    assert "1 threads" in (tmp_path / "out/log").read_text()


def test_names_of_a_tolerance_and_the_fast_preset_reach_the_run(cli, scene, tmp_path):
    options = ["--frames", "1-2", "--preset", "fast", "--set", "Domain.voxelSize=0.06"]
    note = "note: /World/Domain: the preset fast is for layout: its long steps damp solids"
    for tolerance, out in ((0.0, tmp_path / "out"), (0.05, tmp_path / "fine")):
        chosen = ("--set", "Domain.stepTolerance=fine") if tolerance else ()
        done = cli("simulate", scene, *options, *chosen, "-o", out)
        assert done.returncode == 0, done.stderr
        domain = json.loads((out / "manifest.json").read_text())["parameters"]["/World/Domain"]
        assert domain["preset"] == 2 and domain["step_tolerance"] == tolerance
        assert done.stderr.count(note) == (out / "log").read_text().count(note) == (not tolerance)
    wrong = cli("simulate", scene, *options, "--set", "Domain.stepTolerance=slow", "-o", tmp_path / "wrong")
    assert wrong.returncode == 2 and "'slow' is not" in wrong.stderr
    assert all(name in wrong.stderr for name in ("loose", "normal", "fine"))
    little = cli("simulate", scene, "--set", "Domain.stepTolerance=1e-9", "-o", tmp_path / "wrong")
    text = "/World/Domain.eulerfsi:stepTolerance = 1e-09: must be 0, or >= 0.001 and <= 10"
    assert little.returncode == 3 and text in little.stderr
    assert not (tmp_path / "wrong").exists()


def test_content_does_not_depend_on_the_number_of_threads(cli, scene, tmp_path):
    for threads in (1, 2, 3, 8):
        assert cli("simulate", scene, "--threads", threads, "-o", tmp_path / str(threads)).returncode == 0
    hashes = [content_hashes(tmp_path / str(threads)) for threads in (1, 2, 3, 8)]
    assert all(other == hashes[0] for other in hashes)
    assert len({tuple(h) for h in hashes[0].values()}) == 3  # frames differ from each other


def test_folder_with_a_cache_is_refused_without_a_word_about_it(cli, scene, tmp_path):
    assert cli("simulate", scene).returncode == 0
    before = (tmp_path / "small_cache/manifest.json").read_text()
    again = cli("simulate", scene)
    assert again.returncode == 2 and "--resume" in again.stderr and "--overwrite" in again.stderr
    assert (tmp_path / "small_cache/manifest.json").read_text() == before
    replaced = cli("simulate", scene, "--overwrite", "--frames", "1-2")
    assert replaced.returncode == 0
    assert sorted(p.name for p in (tmp_path / "small_cache/frames").glob("*.usdc")) == [
        "small.0001.usdc",
        "small.0002.usdc",
    ]


def test_folder_with_other_things_is_never_touched(cli, scene, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").write_text("all of it")
    for option in ([], ["--overwrite"], ["--resume"]):
        done = cli("simulate", scene, "-o", tmp_path / "mine", *option)
        assert done.returncode == 2 and "not empty" in done.stderr
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.txt"]


def test_overwrite_keeps_what_is_not_the_caches(cli, scene, tmp_path):
    cli("simulate", scene)
    (tmp_path / "small_cache/notes.txt").write_text("keep")
    assert cli("simulate", scene, "--overwrite").returncode == 0
    assert (tmp_path / "small_cache/notes.txt").read_text() == "keep"


def test_a_solid_torn_to_shreds_ends_with_4_and_keeps_the_good_frames(cli, scene, tmp_path):
    shot = ["--set", "Ball.velocity=(0, -1000, 0)", "--set", "Ball.compressible=1", "--frames", "1-12"]
    done = cli("simulate", scene, *shot)
    assert done.returncode == 4, done.stderr
    assert re.search(r"diverged at time .*: solid 1 \(/World/Ball\) has (lost its shape|vanished)", done.stderr)
    manifest = json.loads((tmp_path / "small_cache/manifest.json").read_text())
    assert manifest["status"] == "failed" and 1 <= len(manifest["frames"]) < 12


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulate", "{scene}", "--frame", "1-2"], "unrecognized arguments"),
        (["simulate", "{scene}", "--progress", "loud"], "invalid choice"),
        (["simulate", "{scene}", "--frames", "1-9x2"], "step leaves frames out"),
        (["simulate", "{scene}", "--frames", "1-3,7-9"], "frame 4 is missing"),
        (["simulate", "{scene}", "--threads", "0"], "0: must be a whole number >= 1"),
        (["simulate", "{scene}", "--threads", "many"], "many: must be a whole number >= 1"),
        (["simulate", "{scene}", "--preset", "quick"], "must be one of production, paper2016, fast"),
        (["simulate", "{scene}", "--set", "Domain.voxelsize=1"], "did you mean voxelSize"),
        (["simulate", "{scene}", "--resume", "--overwrite"], "not allowed with"),
        (["simulate"], "SCENE"),
        (["dance"], "invalid choice"),
        ([], "COMMAND"),
    ],
)
def test_usage_errors_exit_with_2_and_leave_nothing(cli, scene, tmp_path, arguments, message):
    done = cli(*[a.replace("{scene}", str(scene)) for a in arguments])
    assert done.returncode == 2
    assert message in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["small.usda"]


def test_validate_reports_without_simulating(cli, scene, tmp_path):
    done = cli("validate", scene)
    assert done.returncode == 0, done.stderr
    assert "12 x 14 x 12 = 2,016 cells" in done.stdout
    assert "/World/Ball: solid" in done.stdout and "memory: about" in done.stdout and "time:" in done.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["small.usda"]


def test_info_about_program_scene_and_cache(cli, scene, tmp_path):
    program = cli("info")
    assert program.returncode == 0 and "threads: " in program.stdout and "library 0." in program.stdout
    assert "/World/Carpet: initial emitter" in cli("info", scene).stdout
    cli("simulate", scene)
    cache = cli("info", tmp_path / "small_cache")
    assert cache.returncode == 0 and "frames: 3 of 1-3" in cache.stdout and "complete" in cache.stdout
    (tmp_path / "small_cache/frames/small.0002.usdc").write_bytes(b"broken")
    broken = cli("info", tmp_path / "small_cache")
    assert broken.returncode == 5
    assert broken.stderr == f"error: {tmp_path / 'small_cache'}: damaged or missing frames: 2\n"
    assert broken.stdout and cache.stdout.startswith(broken.stdout)


def test_new_writes_a_scene_that_simulates(cli, tmp_path):
    (tmp_path / "meshes").mkdir()
    write_obj(tmp_path / "meshes/ball.obj", 0.2)
    done = cli("new", "shots/two.usda", "--solid", "meshes/ball.obj", "--solid", "meshes/ball.obj")
    assert done.returncode == 0, done.stderr
    stage = Usd.Stage.Open(str(tmp_path / "shots/two.usda"))
    paths = [str(p.GetPath()) for p in stage.GetDefaultPrim().GetChildren()]
    assert paths == [f"/World/{name}" for name in ("PhysicsScene", "Domain", "Ball", "Ball2", "Carpet")]
    assert stage.GetPrimAtPath("/World/Ball").GetAttribute("eulerfsi:surfaceFile").Get().path == "./../meshes/ball.obj"
    report = cli("validate", "shots/two.usda")
    assert report.returncode == 0 and "warning" not in report.stdout, report.stderr + report.stdout
    run = cli("simulate", "shots/two.usda", "--frames", "1-2", "--set", "Domain.voxelSize=0.05")
    assert run.returncode == 0, run.stderr
    opened = Usd.Stage.Open(str(tmp_path / "two_cache/two.usda"))
    assert UsdGeom.Mesh(opened.GetPrimAtPath("/World/Ball2/surface")).GetPointsAttr().Get(2)


def test_new_without_smoke_and_what_it_refuses(cli, tmp_path):
    write_obj(tmp_path / "ball.obj")
    assert cli("new", "dry.usda", "--solid", "ball.obj", "--smoke", "none").returncode == 0
    assert "Carpet" not in (tmp_path / "dry.usda").read_text()
    assert cli("new", "dry.usda", "--solid", "ball.obj").returncode == 2  # exists
    assert cli("new", "other.txt", "--solid", "ball.obj").returncode == 2
    missing = cli("new", "other.usda", "--solid", "none.obj")
    assert missing.returncode == 3 and "none.obj: no such file" in missing.stderr
    assert not (tmp_path / "other.usda").exists()


def test_version_and_help_exit_with_0(capsys):
    for option in ("--version", "--help"):
        with pytest.raises(SystemExit) as caught:
            main([option])
        assert caught.value.code == 0
    assert "Exit codes" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({"cpu.max": "max 100000"}, None),
        ({"cpu.max": "150000 100000"}, 2),
        ({"job/cpu.max": "100000 100000", "cpu.max": "max 100000"}, 1),
        ({"cpu/cpu.cfs_quota_us": "100000", "cpu/cpu.cfs_period_us": "100000"}, 1),
    ],
)
def test_threads_follow_the_cgroup(tmp_path: Path, monkeypatch, files, expected):
    monkeypatch.setattr(system.os, "sched_getaffinity", lambda _pid: set(range(8)))
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text + "\n")
    (tmp_path / "membership").write_text("0::/job\n2:cpu,cpuacct:/\n")
    assert system.available_threads(tmp_path, tmp_path / "membership") == (expected or 8)


@pytest.mark.parametrize(("text", "limited"), [("1000000", True), ("max", False), (str(2**62), False)])
def test_memory_follows_the_cgroup(tmp_path: Path, text, limited):
    (tmp_path / "job").mkdir()
    (tmp_path / "job/memory.max").write_text(text + "\n")
    (tmp_path / "membership").write_text("0::/job\n")
    found = system.available_memory(tmp_path, tmp_path / "membership")
    assert (found == 1000000) == limited and found > 0


def test_scene_in_centimetres_reports_in_its_own_units(cli, tmp_path):
    make_scene(tmp_path / "cm.usda", meters_per_unit=0.01)
    done = cli("simulate", "cm.usda", "--set", "Domain.voxelSize=0.0001")
    assert done.returncode == 3 and "eulerfsi:voxelSize = 0.0001" in done.stderr and "fits" in done.stderr
