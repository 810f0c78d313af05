# SPDX-License-Identifier: GPL-3.0-or-later
"""A bake: a process of its own, and what its folder tells of it. Knows nothing of Blender.

Whether a bake runs is read from the folder (locks, manifest, events), never from the .blend file, so that a bake goes
on when Blender ends and is found again when the file is opened. The process of a bake holds a lock on its events from
its start to its end; the lock in cache/ is that of any run, also of one outside Blender.

    <folder>/owner.json     which scene of which file it belongs to, the settings that made it, and those asked for last
    <folder>/export/        meshes as the host wrote them; scene.usdc, which the solver's Python makes of them
    <folder>/cache/         of the solver
    <folder>/events.jsonl   its events (`--progress json`), messages.txt what it says to people
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import IO, Any

SOLVER = Path(__file__).with_name("solver")
_RUNNER = Path(__file__).with_name("runner") / "run.py"
OWNER, EVENTS, MESSAGES = "owner.json", "events.jsonl", "messages.txt"
RUNNING = ("preparing", "running")
_STOPPED = ("interrupted", "terminated", "hangup", "unfinished")  # errors that are none: the state of the bake says it


class JobError(Exception):
    """A bake cannot be started or stopped; the message is for artists."""


@dataclasses.dataclass
class Told:
    """What the events of a process say so far."""

    start: dict[str, Any] | None = None
    end: dict[str, Any] | None = None
    percent: float = 0.0
    frame: int | None = None
    eta: float | None = None
    waiting: str = ""
    findings: list[dict[str, Any]] = dataclasses.field(default_factory=list)

    def take(self, event: dict[str, Any]) -> None:
        kind = event.get("event")
        if kind == "start":
            self.start, self.waiting = event, ""
        elif kind == "waiting":
            self.waiting = f"{event['what']} of {event['prim']}: {100 * event['fraction']:.0f} %"
        elif kind == "step":
            self.frame, self.eta = event["frame"], event["eta"]
            self.percent = self._percent(event["frame"], event["fraction"])
        elif kind == "frame":
            self.frame, self.eta = event["frame"], event["eta"]
            self.percent = self._percent(event["frame"], 1.0)
        elif kind in ("warning", "error") and event.get("code") not in _STOPPED:
            self.findings.append({**event, "level": kind})
        elif kind == "end":
            self.end = event

    def _percent(self, frame: int, fraction: float) -> float:
        first, last = self.start["first"], self.start["last"]
        return 100.0 * (frame - first + fraction) / (last - first + 1)


class Job:
    """A process that simulates or validates, or one that another Blender has started."""

    def __init__(self, folder: Path, process: subprocess.Popen | None = None) -> None:
        self.folder, self.process = folder, process
        self.told = Told()
        self._offset = 0

    def read(self) -> bool:
        """Takes new events in; whether there were any."""
        try:
            with open(self.folder / EVENTS, "rb") as file:
                if os.fstat(file.fileno()).st_size < self._offset:  # another bake has begun
                    self.told, self._offset = Told(), 0
                file.seek(self._offset)
                lines = file.read()
        except OSError:
            return False
        whole = lines[: lines.rfind(b"\n") + 1]
        self._offset += len(whole)
        for line in whole.splitlines():
            try:
                self.told.take(json.loads(line))
            except ValueError:
                continue  # a line that something else has printed
        return bool(whole)

    @property
    def alive(self) -> bool:
        """Whether its process runs."""
        if self.process:
            return self.process.poll() is None
        return baking(self.folder) or lock_held(self.folder / "cache")

    def stop(self) -> None:
        """Asks it to stop: it writes a checkpoint first. Raises JobError."""
        if self.process:
            if self.process.poll() is None:
                self.process.send_signal(signal.SIGINT)
            return
        number = lock_owner(self.folder / "cache")
        if number is None:
            raise JobError("the bake still reads the scene, or runs on another machine: wait, or stop it there")
        os.kill(number, signal.SIGINT)

    def wait(self) -> int:
        """Until it ends; its exit code."""
        code = self.process.wait()
        self.read()
        return code


def start(folder: Path, version: str, arguments: list[str], stage: str) -> Job:
    """Starts the solver: writes the stage from the export, then runs one command line. Raises JobError."""
    if not (SOLVER / "eulerfsi").is_dir():
        raise JobError(f"the solver is missing ({SOLVER}): install the extension again, for this version of Blender")
    task = {"version": version, "export": str(folder / "export"), "stage": stage, "arguments": arguments}
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment |= {"PYTHONPATH": str(SOLVER), "PYTHONDONTWRITEBYTECODE": "1"}
    with open(folder / EVENTS, "ab") as events, open(folder / MESSAGES, "ab") as messages:
        _lock(events, folder)
        events.truncate(0)
        messages.truncate(0)
        (folder / "task.json").write_text(json.dumps(task, indent=1))
        process = subprocess.Popen(
            [sys.executable, "-s", str(_RUNNER), str(folder / "task.json")],
            stdin=subprocess.DEVNULL,
            stdout=events,
            stderr=messages,
            env=environment,
            start_new_session=True,  # Ctrl-C in Blender's terminal is Blender's; a bake outlives it
        )
    return Job(folder, process)


def _lock(events: IO[bytes], folder: Path) -> None:
    """Until the process that inherits the file ends. Raises JobError where another one has it."""
    try:
        fcntl.flock(events, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise JobError(f"{folder}: another Blender bakes here: wait for it, or cancel it") from error
    except OSError:
        return  # a disk without locks


def baking(folder: Path) -> bool:
    """Whether the process of a bake runs, of this Blender or of another."""
    return _held(folder / EVENTS)


def lock_held(cache: Path) -> bool:
    """Whether a run writes to the cache at this moment, from Blender or not."""
    return _held(cache / ".lock")


def _held(path: Path) -> bool:
    try:
        with open(path, "rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def lock_text(cache: Path) -> str:
    """Who writes to the cache: "process 12 on host", "" where that is not known."""
    try:
        return (cache / ".lock").read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def lock_owner(cache: Path) -> int | None:
    """Process that writes to the cache, where it runs on this machine."""
    words = lock_text(cache).split()
    return int(words[1]) if len(words) == 4 and words[3] == os.uname().nodename else None


@dataclasses.dataclass
class Cache:
    """What is on disk. status: none, complete, failed, interrupted, stopped, running, damaged, strict."""

    status: str = "none"
    first: int = 0
    last: int = 0
    frames: list[int] = dataclasses.field(default_factory=list)
    smoke: list[int] = dataclasses.field(default_factory=list)
    checkpoints: list[int] = dataclasses.field(default_factory=list)
    bytes: int = 0
    grids: list[str] = dataclasses.field(default_factory=list)


_read: dict[Path, tuple[tuple[int, int], Cache]] = {}


def look(folder: Path) -> Cache:
    """The cache of a bake's folder; its manifest is read again when it has changed."""
    path = folder / "cache" / "manifest.json"
    try:
        facts = path.stat()
    except OSError:
        return Cache()
    stamp = (facts.st_mtime_ns, facts.st_size)
    if path not in _read or _read[path][0] != stamp:
        _read[path] = (stamp, _parse(path))
    found = dataclasses.replace(_read[path][1])
    if lock_held(folder / "cache"):
        found.status = "running"
    elif found.status == "running":
        found.status = "stopped"  # its process has ended without a word
    return found


def _parse(path: Path) -> Cache:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        fps, first = data["fps"], data["first"]
        whole = [c["frame"] for c in data["checkpoints"] if abs(c["time"] * fps - (c["frame"] - first)) < 1e-6]
        entries = {int(frame): entry["files"] for frame, entry in data["frames"].items()}
        return Cache(
            data["status"],
            first,
            data["last"],
            sorted(entries),
            sorted(frame for frame, files in entries.items() if any(name.endswith(".vdb") for name in files)),
            sorted(set(whole)),
            sum(facts["bytes"] for files in entries.values() for facts in files.values()),
            data["grids"],
        )
    except (OSError, ValueError, KeyError, TypeError):
        return Cache("damaged")


_SCALE = re.compile(r"^\s*custom float eulerfsi:densityScale = (\S+)$", re.MULTILINE)


def density_scale(folder: Path) -> float:
    """Extinction of smoke of density 1 [1/m], as the Volume prim has it. Raises OSError, ValueError."""
    layer = folder / "cache" / "scene.usda"  # read as text: not every Blender has a pxr
    found = _SCALE.search(layer.read_text(encoding="utf-8"))
    if not found:
        raise ValueError(f"{layer}: no Volume has eulerfsi:densityScale")
    return float(found[1])


def has_copy(folder: Path) -> bool:
    """Whether a cache whose manifest is damaged can be taken up again, by the copy as of its last checkpoint."""
    return (folder / "cache" / "manifest.backup.json").is_file()


def free(folder: Path) -> None:
    """Deletes a bake: only what bakes write. Raises JobError, OSError."""
    if baking(folder) or lock_held(folder / "cache"):
        raise JobError(f"{folder}: a bake writes to it: cancel it first")
    demand_ours(folder)
    for name in ("cache", "export"):
        if (folder / name).is_dir():
            shutil.rmtree(folder / name)
    for name in (OWNER, EVENTS, MESSAGES, "task.json"):
        (folder / name).unlink(missing_ok=True)
    if folder.is_dir() and not any(folder.iterdir()):
        with contextlib.suppress(OSError):  # it may be a disk of its own
            folder.rmdir()


def demand_ours(folder: Path) -> None:
    """Raises JobError where the folder holds what no bake has written."""
    cache = folder / "cache"
    others = [path.name for path in cache.iterdir() if path.name != ".lock"] if cache.is_dir() else []
    if others and not (cache / "manifest.json").exists():
        raise JobError(f"{cache} holds other files ({others[0]}): choose another folder in Cache")


def owner(folder: Path) -> dict[str, Any]:
    """Which scene a bake belongs to; {} where nobody has baked."""
    try:
        return json.loads((folder / OWNER).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def made_with(folder: Path, told: Told) -> dict[str, Any] | None:
    """Settings of the frames that are there: those of the last start, unless it was refused."""
    facts = owner(folder)
    return facts["asked"] if told.start and "asked" in facts else facts.get("settings")
