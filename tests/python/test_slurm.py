"""`submit --slurm`: the script, run by bash as slurmd would; with a SLURM itself: tests/slurm.sh."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import time
from pathlib import Path

import pytest

PROGRAM = """#!/bin/bash
# A program that says what it was called with, and ends as the file `code` says.
printf '%q ' "$@" >>"{folder}/calls"
echo >>"{folder}/calls"
trap 'echo "{{}}" >"{folder}/checkpoint"; exit 75' TERM
if [[ $1 == simulate && -e "{folder}/slow" ]]; then
  touch "{folder}/running"
  for _ in $(seq 100); do sleep 0.1; done
fi
exit $(cat "{folder}/$1" 2>/dev/null || echo 0)
"""


@pytest.fixture
def job(cli, scene, tmp_path):
    """Writes a script whose program and scontrol only note their calls; returns a function that starts it."""
    tools = tmp_path / "bin"
    tools.mkdir()
    (tools / "eulerfsi").write_text(PROGRAM.format(folder=tmp_path))
    (tools / "scontrol").write_text(f'#!/bin/sh\necho "scontrol $*" >>"{tmp_path}/calls"\n')
    for tool in tools.iterdir():
        tool.chmod(0o755)

    def start(*options: object, **variables: str) -> subprocess.Popen:
        done = cli("submit", scene, "--slurm", "job.sh", *options)
        assert done.returncode == 0 and "next: sbatch job.sh" in done.stdout, done.stderr
        path = f"{tools}{os.pathsep}{os.environ['PATH']}"
        return subprocess.Popen(["bash", "job.sh"], cwd=tmp_path, env={"PATH": path, **variables})

    return start


def calls(folder: Path) -> list[list[str]]:
    return [shlex.split(line) for line in (folder / "calls").read_text().splitlines()]


def test_a_task_of_an_array(job, tmp_path):
    variables = {
        "SLURM_ARRAY_TASK_ID": "2",
        "SLURM_JOB_ID": "12",
        "SLURM_ARRAY_JOB_ID": "10",
        "SLURM_CPUS_PER_TASK": "3",
    }
    vary = ["--vary", "Ball.velocity=(0,-1,0),(0, -2, 0)", "--threads", "3", "--timeout", "301", "--frames", "1-2"]
    assert job(*vary, **variables).wait(60) == 0
    run, verify = calls(tmp_path)
    cache = str(tmp_path / "small_wedge" / "Ball.velocity_0_-2_0")
    assert verify == ["verify", cache] and run[run.index("-o") + 1] == cache
    assert {"--resume", "--allow-restart", "--requeue-on-signal"} <= set(run)
    assert "Ball.velocity=(0, -2, 0)" in run and run[run.index("--threads") + 1] == "3" and "--frames=1-2" in run
    options = [
        line.removeprefix("#SBATCH --") for line in (tmp_path / "job.sh").read_text().splitlines() if "#SB" in line
    ]
    assert {"array=1-2", "requeue", "cpus-per-task=3", "signal=B:TERM@120", "time=6", "open-mode=append"} <= set(
        options
    )
    assert len(json.loads((tmp_path / "small_wedge" / "wedge.json").read_text())["jobs"]) == 2


@pytest.mark.parametrize(("command", "code"), [("simulate", 4), ("simulate", 75), ("simulate", 143), ("verify", 5)])
def test_its_exit_code_and_what_goes_back_to_the_queue(job, tmp_path, command, code):
    (tmp_path / command).write_text(str(code))
    again = code in (75, 143)
    assert job(SLURM_JOB_ID="7").wait(60) == (75 if again else code)
    assert (["scontrol", "requeue", "7"] in calls(tmp_path)) == again
    assert (calls(tmp_path)[-1][0] == "verify") == (command == "verify")


def test_a_signal_reaches_the_run_and_its_checkpoint_is_waited_for(job, tmp_path):
    (tmp_path / "slow").touch()
    process = job(SLURM_JOB_ID="12", SLURM_ARRAY_TASK_ID="3", SLURM_ARRAY_JOB_ID="10")
    until = time.monotonic() + 60
    while not (tmp_path / "running").exists() and time.monotonic() < until:
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 75 and (tmp_path / "checkpoint").exists()
    assert calls(tmp_path)[-1] == ["scontrol", "requeue", "10_3"]


def test_a_task_beyond_the_array(job):
    assert job("--vary", "Ball.density=500,1000", SLURM_ARRAY_TASK_ID="3", SLURM_JOB_ID="1").wait(60) == 2


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["-o", "my cache"], 2, "must have no space"),
        (["--parameter", "Threads=1"], 2, "belongs to --openjd"),
        (["--program", 'python "x'], 2, 'python "x: is no command: no closing quotation'),
        (["--timeout", "0"], 2, "must be a whole number of seconds >= 1"),
        (["--timeout", "299"], 2, "--timeout 299: must be at least 300 seconds"),
        (["--set", "Domain.voxelSize=-1"], 3, "must be > 0"),
    ],
)
def test_refused(cli, scene, tmp_path, options, code, message):
    done = cli("submit", scene, "--slurm", "job.sh", *options)
    assert done.returncode == code and message in done.stderr, done.stderr
    assert not (tmp_path / "job.sh").exists()


def test_the_folder_of_another_wedge(cli, scene, tmp_path):
    assert cli("submit", scene, "--slurm", "job.sh", "--vary", "Ball.density=500,1000").returncode == 0
    assert cli("submit", scene, "--slurm", "job.sh", "--vary", "Ball.density=500,1000").returncode == 0
    done = cli("submit", scene, "--slurm", "job.sh", "--vary", "Ball.density=500,2000")
    assert done.returncode == 7 and "the first that differs is job 2" in done.stderr
