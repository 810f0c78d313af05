"""A wedge: one scene simulated with different values, a process and a cache for each job, and what came of them."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import eulerfsi_usd

from .. import __version__, files, paths
from ..cache import cache as cache_module
from ..cache.lock import LOCK, FolderLock
from ..errors import CacheIOError, Cancelled, EulerFsiError, JobsError, MismatchError, UsageError
from ..log import Log
from ..run.simulate import Options, load_scene
from ..scene import memory
from ..signals import Signals
from ..system import available_memory
from ..usd_messages import usd_messages
from . import summary
from .summary import Row
from .variations import Job

MANIFEST = "wedge.json"
_FORMAT = "eulerfsi-wedge"
_SPARE = 64 << 20  # bytes of a job beyond what it needs as measured
_POLL = 0.05  # seconds between two looks at the jobs


def prepare(folder: Path, scene: Path, jobs: Sequence[Job], attributes: dict[str, str], options: Options) -> None:
    """Writes the manifest into the folder. options: what all jobs share, with overwrite and resume.

    Raises UsageError for a wedge without --overwrite or --resume and for a folder with other things in it,
    MismatchError for the wedge of other jobs.
    """
    data = {
        "format": _FORMAT,
        "version": 1,
        "program": __version__,
        "scene": scene.name,
        "frames": options.frames,
        "start_frame": options.start,
        "settings": list(options.settings),
        "attributes": attributes,
        "jobs": [{"folder": job.folder, "values": job.values} for job in jobs],
    }
    path = folder / MANIFEST
    if path.is_file():
        before = load(folder)
        if not (options.overwrite or options.resume):
            raise UsageError(
                f"{folder}: already contains a wedge; continue it with --resume or replace it with --overwrite"
            )
        if options.resume:
            _check_same(folder, before, data)
        else:
            for job in before["jobs"]:
                cache_module.remove_old(folder / job["folder"])
    elif folder.is_dir() and any(entry.name != LOCK for entry in folder.iterdir()):
        raise UsageError(f"{folder}: is not empty and contains no wedge; choose another folder with -o")
    files.write_text(path, json.dumps(data, indent=1) + "\n")


def load(folder: Path) -> dict[str, Any]:
    """The manifest of a wedge. Raises CacheIOError."""
    path = folder / MANIFEST
    try:
        what = "the manifest of a wedge that this version reads"
        return files.read_tagged(path, what, format=_FORMAT, version=1)
    except OSError as error:
        raise CacheIOError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise CacheIOError(f"{path}: {error}") from error


def _check_same(folder: Path, before: dict[str, Any], now: dict[str, Any]) -> None:
    """Raises MismatchError that names what differs from the wedge in the folder."""
    for key in ("scene", "settings", "start_frame", "jobs"):
        if before.get(key) == now[key]:
            continue
        what = f"its {key.replace('_', ' ')} was {before.get(key)}, is {now[key]}"
        if key == "jobs":
            pairs = itertools.zip_longest(before[key], now[key])
            first = next(number for number, (old, new) in enumerate(pairs, 1) if old != new)
            what = f"it has {len(before[key])} jobs, now {len(now[key])}; the first that differs is job {first}"
        raise MismatchError(f"{folder}: cannot resume, the wedge is another one: {what}")


def largest_need(scene: Path, options: Options, jobs: Sequence[Job], attributes: dict[str, str]) -> int:
    """Bytes that the largest job takes. attributes: of `variations.check`.

    A scene is read for each combination of the domain's values alone, since nothing else changes the need much; one
    that is refused counts for nothing, its job will say why.
    """
    with open(os.devnull, "w", encoding="utf-8") as nowhere, usd_messages(lambda _text: None):
        needs: dict[tuple[str, ...], int] = {}
        for job in jobs:
            changed = tuple(
                setting
                for name, setting in zip(job.values, job.settings(), strict=True)
                if attributes[name].partition(".")[2] == "eulerfsi:voxelSize"
            )
            if changed in needs:
                continue
            wanted = dataclasses.replace(options, settings=(*options.settings, *changed))
            try:
                read, _ = load_scene(scene, wanted, Log(nowhere), 0)
                needs[changed] = memory.need(read, 0)
            except EulerFsiError:
                needs[changed] = 0
    return max(needs.values()) + memory.PROCESS + _SPARE


def jobs_at_once(jobs: int, threads: int, need: int, limit: int) -> int:
    """As many jobs as memory and processors allow, at least one."""
    return max(1, min(jobs, threads, limit // need))


class Wedge:
    """The jobs of one wedge, run in processes. `rows`: what came of each so far, one a job.

    arguments: of each `simulate`, beside scene, folder and values; threads: of all jobs together.
    """

    def __init__(self, scene: Path, folder: Path, jobs: Sequence[Job], arguments: Sequence[str]) -> None:
        self.scene, self.folder, self.jobs = scene, folder, jobs
        self.arguments = list(arguments)
        self.rows = [Row(job) for job in jobs]
        self._running: dict[int, _Process] = {}

    def run(self, at_once: int, threads: int, tell: Any) -> list[Row]:
        """Runs all jobs, `at_once` at a time, each with `threads`. tell(line): learns of each that ends.

        Raises JobsError when some have failed, Cancelled after a signal, which every running job gets too.
        """
        waiting = iter(range(len(self.jobs)))
        signals = Signals()
        with signals.installed(), self._none_left():
            left = True
            while left or self._running:
                while left and not signals.number and len(self._running) < at_once:
                    number = next(waiting, None)
                    if left := number is not None:
                        self._running[number] = _Process(self._command(self.jobs[number], threads))
                if signals.number:
                    left = False
                    for process in self._running.values():
                        process.stop()
                if self._collect(tell):
                    self.write()
                elif self._running:
                    time.sleep(_POLL)
        self.write()
        summary.draw(self.folder, self.rows)
        if signals.number:
            raise Cancelled(signals.number, "continue with --resume")
        failed = [row for row in self.rows if row.exit_code]
        if failed:
            first = failed[0]
            raise JobsError(
                f"{len(failed)} of {len(self.rows)} jobs failed, see {self.folder / summary.TABLE}; the first: "
                f"{first.job.folder}: {first.exit_code}, {first.reason}"
            )
        return self.rows

    def write(self) -> None:
        """The summary, as it is now."""
        summary.write(self.folder / summary.TABLE, self.rows)

    def _command(self, job: Job, threads: int) -> list[str]:
        settings = [word for setting in job.settings() for word in ("--set", setting)]
        words = ["simulate", str(self.scene), "-o", str(self.folder / job.folder), "--progress", "json"]
        words += ["--resume", "--allow-restart"]
        return [sys.executable, "-m", "eulerfsi", *words, "--threads", str(threads), *self.arguments, *settings]

    def _collect(self, tell: Any) -> bool:
        """Takes up the jobs that have ended; whether there were any."""
        ended = [number for number, process in self._running.items() if process.has_ended()]
        for number in ended:
            process, row = self._running.pop(number), self.rows[number]
            row.take(*process.result(), self.folder / row.job.folder)
            done = sum(1 for row in self.rows if row.exit_code is not None)
            tell(f"{done} of {len(self.rows)}: {row.job.folder}: {row.status}, {row.seconds:.1f} s")
        return bool(ended)

    @contextlib.contextmanager
    def _none_left(self) -> Iterator[None]:
        """No job outlives the block."""
        try:
            yield
        finally:
            for process in self._running.values():
                process.kill()


class _Process:
    """One job. Its output goes to files without a name: a pipe that is full would hold it up."""

    def __init__(self, command: Sequence[str]) -> None:
        self._out: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        self._err: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace")  # noqa: SIM115
        self._begun = time.monotonic()
        self._stopped = False
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=self._out,
            stderr=self._err,
            env=_environment(),
        )

    def has_ended(self) -> bool:
        return self._process.poll() is not None

    def stop(self) -> None:
        """Asks it, once, to write a checkpoint and end."""
        if not self._stopped:
            self._process.terminate()
            self._stopped = True

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def result(self) -> tuple[int, list[dict[str, Any]], str, float]:
        """Of a job that has ended: exit code, events, the last line on standard error, seconds."""
        seconds = time.monotonic() - self._begun
        self._out.seek(0)
        self._err.seek(0)
        events = [json.loads(line) for line in self._out if line.startswith("{") and line.endswith("}\n")]
        last = (self._err.read().strip().splitlines() or [""])[-1]
        self._out.close()
        self._err.close()
        code = self._process.returncode
        return (code if code >= 0 else 128 - code), events, last, seconds


def _environment() -> dict[str, str]:
    """That of a job, in which Python finds the packages of this process."""
    packages = [Path(eulerfsi_usd.__file__).parents[1], paths.PACKAGE.parent]
    return {**os.environ, "PYTHONPATH": os.pathsep.join([*map(str, packages), os.environ.get("PYTHONPATH", "")])}


def run(
    scene: Path,
    folder: Path,
    jobs: Sequence[Job],
    attributes: dict[str, str],
    options: Options,
    arguments: Sequence[str],
    threads: int,
    tell: Any,
) -> list[Row]:
    """Runs the jobs of a wedge into a folder: manifest, caches, wedge.csv, wedge.png.

    options: what all jobs share, with overwrite and resume; arguments: the same for `simulate`. Raises as `prepare`
    and `Wedge.run` do.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CacheIOError(f"{folder}: cannot be made: {error.strerror}") from error
    with FolderLock(folder):
        prepare(folder, scene, jobs, attributes, options)
        need, limit = largest_need(scene, options, jobs, attributes), available_memory()
        at_once = jobs_at_once(len(jobs), threads, need, limit)
        tell(f"{len(jobs)} jobs, {at_once} at once with {max(1, threads // at_once)} threads each, into {folder}")
        wedge = Wedge(scene, folder, jobs, arguments)
        wedge.write()
        return wedge.run(at_once, max(1, threads // at_once), tell)
