"""`bench night`: a night in an hour. Small jobs through each engine, killed and requeued at random.

At the end every cache has the content hashes of one left alone, and no temporary file is left.

Engines: the command line itself, `wedge`, Open Job Description (openjd-cli), SLURM (as root, with Debian's packages).
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from eulerfsi.errors import UsageError
from eulerfsi.say import say

ROOT = Path(__file__).resolve().parents[2]
SCENE = ROOT / "examples" / "scenes" / "ball.usda"
_BETWEEN = (0.5, 4.0)  # seconds between two kills
_MARK = "EFSI_NIGHT"  # in the environment of every program of ours, for the killer


class Night:
    """One night. work: folder of all; jobs, frames: how many; draw: the random numbers of its seed."""

    def __init__(self, work: Path, jobs: int, frames: int, seed: int, seconds: float) -> None:
        self.work, self.jobs, self.seconds = work, jobs, seconds
        self.draw = random.Random(seed)
        self.values = [f"{1e4 * (1 + number):.0f}" for number in range(jobs)]
        self.scene = [str(SCENE), "--set", "Domain.voxelSize=0.05", "--frames", f"1-{frames}", "--threads", "1"]
        self.vary = ["--vary", f"Ball.youngsModulus={','.join(self.values)}"]
        self.environment = {**os.environ, _MARK: str(work), "OMP_WAIT_POLICY": "passive"}
        self.program = work / "eulerfsi"
        self.program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m eulerfsi "$@"\n')
        self.program.chmod(0o755)

    def folders(self, engine: str) -> list[Path]:
        """The caches of an engine, in the order of the values."""
        return [self.work / engine / f"Ball.youngsModulus_{value}" for value in self.values]

    def start(self, *command: object) -> subprocess.Popen:
        """A program whose output nobody reads."""
        words = [str(word) for word in command]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen(words, env=self.environment, cwd=self.work, **quiet)

    def runs(self) -> list[int]:
        """Processes of ours that simulate."""
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                words = (entry / "cmdline").read_bytes().split(b"\0")
                if b"simulate" in words and f"{_MARK}={self.work}".encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
        return found

    def strike(self) -> bool:
        """Kills or stops one run; whether there was one."""
        running = self.runs()
        if not running:
            return False
        with contextlib.suppress(ProcessLookupError):  # it has just ended
            os.kill(self.draw.choice(running), self.draw.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGTERM)))
        return True

    def disturb(self, is_over: Callable[[], bool], more: Callable[[], bool] = lambda: False) -> int:
        """Strikes at random until the work is over, or its time is; then waits. more: another way to disturb.

        Returns how often. Raises TimeoutError where the work does not end in four times its time.
        """
        begun, strikes = time.monotonic(), 0
        while not is_over():
            spent = time.monotonic() - begun
            if spent > 4 * self.seconds:
                raise TimeoutError(f"not over after {spent:.0f} s")
            time.sleep(self.draw.uniform(*_BETWEEN))
            if spent < self.seconds:
                strikes += more() if self.draw.random() < 0.3 else self.strike()
        return strikes

    # --- engines -------------------------------------------------------------------------------------------------

    def alone(self) -> int:
        """Nobody disturbs these."""
        if self.start(self.program, "wedge", *self.scene, *self.vary, "-o", self.work / "alone").wait():
            raise RuntimeError("the wedge that was left alone has failed")
        return 0

    def again_and_again(self, *command: object) -> int:
        """A program that is started again as long as it fails."""
        process = [self.start(*command)]

        def is_over() -> bool:
            if process[0].poll():
                process[0] = self.start(*command)
            return process[0].poll() == 0

        return self.disturb(is_over)

    def simulate(self) -> int:
        strikes = 0
        for value, folder in zip(self.values, self.folders("simulate"), strict=True):
            how = ("-o", folder, "--resume", "--allow-restart", "--requeue-on-signal", "--progress", "none")
            setting = ("--set", f"Ball.youngsModulus={value}")
            strikes += self.again_and_again(self.program, "simulate", *self.scene, *setting, *how)
        return strikes

    def wedge(self) -> int:
        folder = self.work / "wedge"
        return self.again_and_again(self.program, "wedge", *self.scene, *self.vary, "-o", folder, "--resume")

    def openjd(self) -> int:
        job, folder = self.work / "job", self.work / "openjd"
        submit = ("submit", *self.scene, *self.vary, "--openjd", job, "-o", folder, "--program", self.program)
        self.start(self.program, *submit).wait()
        given = ("-p", f"Scene={SCENE}", "-p", f"OutputFolder={folder}")
        command = Path(sys.executable).with_name("openjd")
        return self.again_and_again(command, "run", job / "template.json", *given)

    def slurm(self) -> int:
        script, folder = self.work / "job.sh", self.work / "slurm"
        submit = ("submit", *self.scene, *self.vary, "--slurm", script, "-o", folder, "--program", self.program)
        self.start(self.program, *submit).wait()
        with self._machine():
            self._call("sbatch", script)

            def is_over() -> bool:
                states = self._states()
                for job, state in states.items():
                    if state == "PENDING":  # else it waits two minutes
                        self._call("scontrol", "update", f"JobId={job}", "StartTime=now")
                    elif state in ("FAILED", "NODE_FAIL"):  # a run that was killed: the user's task again
                        self._call("scontrol", "requeue", job)
                return bool(states) and set(states.values()) == {"COMPLETED"}

            def requeue() -> bool:
                running = [job for job, state in self._states().items() if state == "RUNNING"]
                if running:
                    self._call("scontrol", "requeue", self.draw.choice(running))
                return bool(running)

            return self.disturb(is_over, requeue)

    def _call(self, *command: object) -> str:
        words = [str(word) for word in command]
        return subprocess.run(words, env=self.environment, capture_output=True, text=True, check=False).stdout

    def _states(self) -> dict[str, str]:
        """Task -> state."""
        found = {}
        for line in self._call("scontrol", "show", "--oneliner", "job").splitlines():
            facts = dict(word.partition("=")[::2] for word in line.split() if "=" in word)
            found[facts["JobId"]] = facts["JobState"]
        return found

    @contextlib.contextmanager
    def _machine(self) -> Iterator[None]:
        folder = self.work / "machine"
        folder.mkdir()
        command = ["bash", str(ROOT / "tests" / "slurm_machine.sh"), str(folder)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with subprocess.Popen(command, text=True, env=self.environment, **pipes) as machine:
            try:
                if not any(line == "ready\n" for line in iter(machine.stdout.readline, "")):
                    raise RuntimeError("the SLURM of this machine has not started")
                self.environment["SLURM_CONF"] = str(folder / "slurm.conf")
                yield
            finally:
                machine.stdin.close()
                machine.wait()

    # --- the morning ---------------------------------------------------------------------------------------------

    def differences(self, engine: str) -> list[str]:
        """What a cache has that one left alone has not: other hashes, files that should be gone."""
        found = []
        for cache, alone in zip(self.folders(engine), self.folders("alone"), strict=True):
            if _hashes(cache) != _hashes(alone):
                found.append(f"{cache}: other content hashes than the run left alone")
            found += [f"{path}: was left over" for path in cache.rglob(".*")]
        return found


def _hashes(cache: Path) -> dict[str, list[str]]:
    frames = json.loads((cache / "manifest.json").read_text())["frames"]
    return {
        number: [frame["state"], *(facts["content"] for facts in frame["files"].values())]
        for number, frame in frames.items()
    }


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="eulerfsi bench night", description=__doc__, allow_abbrev=False)
    parser.add_argument("--jobs", type=int, default=20, metavar="N", help="for each engine; default: 20")
    parser.add_argument("--frames", type=int, default=48, metavar="N", help="of a job; default: 48")
    parser.add_argument("--minutes", type=float, default=12, metavar="M", help="of kills, for an engine; default: 12")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument(
        "--engines", default="simulate,wedge,openjd,slurm", metavar="NAME,...", help="default: all four"
    )
    options = parser.parse_args(arguments)
    engines = options.engines.split(",")
    for engine in engines:
        if engine not in ("simulate", "wedge", "openjd", "slurm"):
            raise UsageError(f"--engines {engine}: must be simulate, wedge, openjd or slurm")
    bad = 0
    with tempfile.TemporaryDirectory(prefix="efsi-night-") as name:
        night = Night(Path(name), options.jobs, options.frames, options.seed, 60 * options.minutes)
        say("| engine | jobs | kills and requeues | minutes | caches that differ |\n|---|---|---|---|---|", sys.stdout)
        for engine in ("alone", *engines):
            begun = time.monotonic()
            strikes = getattr(night, engine)()
            wrong = night.differences(engine)
            minutes = (time.monotonic() - begun) / 60
            say(f"| {engine} | {options.jobs} | {strikes} | {minutes:.1f} | {len(wrong)} |", sys.stdout)
            for line in wrong:
                say(line, sys.stderr)
            bad += len(wrong)
    return 1 if bad else 0
