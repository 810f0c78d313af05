"""docs/exit-codes.md, row by row: a command that ends so, and what its events say."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import ROOT, environment, make_scene
from eulerfsi import errors
from eulerfsi.run import run as run_module
from events import event, events

ROWS = re.findall(r"^\| (\d+) \| (\w+) \| (.*) \|$", (ROOT / "docs/exit-codes.md").read_text(), re.M)
TABLE = {int(code): (word, when) for code, word, when in ROWS}

Cli = Callable[..., subprocess.CompletedProcess]


def test_the_table_is_that_of_the_program():
    assert {code: word for code, (word, _) in TABLE.items()} == {
        code: word for code, (word, _) in errors.EXIT_CODES.items()
    }


def ends_with(done: subprocess.CompletedProcess, code: int, message: str = "") -> None:
    """The exit code, that of the events, and the word in the last error that no rule has found."""
    assert done.returncode == code and message in done.stderr, done.stderr
    found = events(done.stdout, code)
    words = [one["code"] for one in found if one["event"] == "error" and one["prim"] is None]
    assert words in ([], [TABLE[code][0]])


def test_0_done(cli, scene):
    ends_with(cli("simulate", scene, "--frames", "1-2", "--progress", "json"), 0)


def test_1_internal(cli, scene, monkeypatch):
    def fail(_self: object) -> None:
        raise ZeroDivisionError("a fault of ours")

    monkeypatch.setattr(run_module.Run, "_frames", fail)
    ends_with(cli("simulate", scene, "--progress", "json"), 1, "error: internal; please report this")


def test_2_usage(cli, scene, tmp_path):
    ends_with(cli("simulate", scene, "--frames", "1-9x2", "--progress", "json"), 2, "step leaves frames out")
    ends_with(cli("validate", scene, "--set", "Domain.voxels=1", "--progress", "json"), 2, "voxels")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").touch()
    ends_with(cli("simulate", scene, "-o", tmp_path / "mine", "--progress", "json"), 2, "not empty")
    assert cli("simulate", scene, "--frame", "1-2", "--progress", "json").returncode == 2  # without events


def test_3_scene(cli, scene):
    ends_with(cli("simulate", "none.usda", "--progress", "json"), 3, "no such file")
    ends_with(cli("validate", scene, "--set", "Domain.voxelSize=-1", "--progress", "json"), 3, "must be > 0")


def test_4_diverged(cli, scene):
    shot = ["--set", "Ball.velocity=(0, -1000, 0)", "--set", "Ball.compressible=1", "--frames", "1-12"]
    done = cli("simulate", scene, *shot, "--progress", "json")
    ends_with(done, 4, "diverged at time")
    error, end = map(event, done.stdout.splitlines()[-2:])
    assert end["last_frame"] >= 1 and error["prim"] == "/World/Ball", error


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """A folder of a megabyte; skips where this user may not mount."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", folder], capture_output=True).returncode:
        pytest.skip("no right to mount a file system")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_5_full_disk(cli, tmp_path, small_disk):
    make_scene(tmp_path / "long.usda", frames=(1, 100), voxel=0.06)
    done = cli("simulate", "long.usda", "-o", small_disk / "cache", "--progress", "json", "--force")
    ends_with(done, 5, "No space left on device")
    last = event(done.stdout.splitlines()[-1])["last_frame"]
    told = cli("info", small_disk / "cache")
    assert told.returncode == 0 and f"frames: {last} of 1-100" in told.stdout and ", running" not in told.stdout


def test_5_damage(cli, scene, tmp_path):
    cli("simulate", scene)
    (tmp_path / "small_cache/frames/small.0002.usdc").write_bytes(b"broken")
    for options in ([], ["--json"]):
        assert cli("info", tmp_path / "small_cache", *options).returncode == 5
    (tmp_path / "small_cache/manifest.json").write_text("{")
    assert cli("info", tmp_path / "small_cache").returncode == 5
    ends_with(cli("simulate", scene, "--resume", "--progress", "json"), 5, "is damaged")


def test_6_strict(cli, scene):
    never = ["--set", "Domain.pressureTolerance=1e-15", "--set", "Domain.maxTimeStep=0.01"]  # solves do not converge
    ends_with(cli("simulate", scene, *never, "--strict", "--progress", "json"), 6, "stopped by --strict after frame 2")


def test_7_mismatch(cli, scene, tmp_path):
    cli("simulate", scene, "--frames", "1-2")
    other = ["--set", "Ball.youngsModulus=50000", "--progress", "json"]
    done = cli("simulate", scene, "--resume", *other)
    ends_with(done, 7, "youngsModulus was 23333 Pa, is 50000 Pa")
    assert event(done.stdout.splitlines()[-2])["prim"] == "/World/Ball"
    start = ["--start-from", "small_cache", "-o", tmp_path / "other", "--progress", "json"]
    ends_with(cli("simulate", scene, "--set", "Domain.voxelSize=0.06", *start), 7, "--start-from small_cache")


def test_75_out_of_time(cli, scene):
    done = cli("simulate", scene, "--max-wall-seconds", "0.001", "--progress", "json")
    ends_with(done, 75, "stopped after 0.001 s by --max-wall-seconds; continue with --resume")
    assert cli("verify", "small_cache").returncode == 75
    cli("simulate", scene, "--resume")
    assert cli("verify", "small_cache").returncode == 0


def launcher(folder: Path, *missing: str) -> tuple[Path, dict[str, str]]:
    """A copy of the launcher alone in a folder, where some programs are missing, and its environment."""
    tools = folder / "bin"
    tools.mkdir()
    for program in Path("/usr/bin").iterdir():
        if program.name not in ("apt-get", "sudo", *missing):
            (tools / program.name).symlink_to(program)
    for name in ("c++", "cmake", "ninja"):
        if name not in missing:
            (tools / name).unlink(missing_ok=True)
            (tools / name).write_text("#!/bin/sh\nexit 1\n")
            (tools / name).chmod(0o755)
    shutil.copy(ROOT / "eulerfsi", folder)
    (folder / "requirements.txt").write_text("this is no requirement\n")
    return folder / "eulerfsi", {"PATH": str(tools), "HOME": str(folder)}


def set_up(program: Path, environment: dict[str, str]) -> tuple[int, str]:
    done = subprocess.run([program, "setup"], env=environment, text=True, capture_output=True, check=False)
    return done.returncode, done.stderr


def test_10_packages(tmp_path):
    code, told = set_up(*launcher(tmp_path, "cmake"))
    assert code == 10 and "'cmake' is missing" in told


def test_11_python(tmp_path):
    program, environment = launcher(tmp_path)
    code, told = set_up(program, {**environment, "PYTHONHOME": "/nowhere"})  # no Python starts
    assert code == 11 and "Python 3.11 to 3.14 with its venv module is needed" in told


def test_12_build(tmp_path):
    program, environment = launcher(tmp_path)
    (tmp_path / ".venv/bin").mkdir(parents=True)
    (tmp_path / ".venv/bin/python").symlink_to(sys.executable)
    stamp = "{ cat requirements.txt; readlink -f .venv/bin/python; } | sha256sum >.venv/.stamp"
    subprocess.run(["bash", "-c", f"cd '{tmp_path.resolve()}' && {stamp}"], env=environment, check=True)
    code, told = set_up(program, environment)
    assert code == 12 and "CMake could not configure the build" in told


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(
    ("number", "requeue"),
    [(signal.SIGHUP, False), (signal.SIGINT, True), (signal.SIGTERM, False), (signal.SIGTERM, True)],
)
def test_129_130_143_signals(tmp_path, number, requeue):
    requeue = ["--requeue-on-signal"] if requeue else []
    make_scene(tmp_path / "small.usda", frames=(1, 400), voxel=0.06)
    command = [sys.executable, "-m", "eulerfsi", "simulate", "small.usda", "--progress", "json", *requeue]
    pipes = {"text": True, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(command, cwd=tmp_path, env=environment(), **pipes)
    first = process.stdout.readline()
    while '"waiting"' in first.splitlines()[-1]:  # on a busy machine the scene is still being read
        first += process.stdout.readline()
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    code = 75 if requeue and number == signal.SIGTERM else 128 + number
    ends_with(subprocess.CompletedProcess(command, process.returncode, first + out, err), code, "--resume")


def test_signals_become_exceptions_only_when_usd_is_loaded(tmp_path):
    """An exception that meets USD while it is loaded is dropped, and the run goes on."""
    look = "lambda: sys.exit(7 if 'pxr.UsdSkel' in sys.modules else 1)"
    start = f"import sys; from eulerfsi import signals; signals.raised = {look}; from eulerfsi.cli.main import main"
    for command in (["simulate", "none.usda"], ["validate", "none.usda"]):
        done = subprocess.run([sys.executable, "-c", f"{start}; main({command})"], cwd=tmp_path, env=environment())
        assert done.returncode == 7


@pytest.mark.usefixtures("library")
def test_130_ctrl_c_while_the_program_is_loaded_gives_no_traceback(tmp_path):
    make_scene(tmp_path / "small.usda", frames=(1, 400), voxel=0.06)
    # As the launcher starts it.
    assert 'exec env --block-signal=HUP,INT,TERM "$python" -m eulerfsi' in (ROOT / "eulerfsi").read_text()
    program = ["env", "--block-signal=HUP,INT,TERM", sys.executable, "-m", "eulerfsi", "simulate", "small.usda"]
    for delay in (0.01, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5):
        process = subprocess.Popen(
            [*program, "--overwrite"],
            cwd=tmp_path,
            env=environment(),
            text=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background job ignores it
        )
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=60)
        assert process.returncode in (130, -signal.SIGINT), told  # the latter is `env`, on a slow machine
        assert "Traceback" not in told and told.startswith("stopped by signal 2") == (process.returncode == 130)
