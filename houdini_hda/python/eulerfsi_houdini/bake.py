"""Runs of the eulerfsi command line tool: in the background, or in the foreground with progress in Houdini."""

from __future__ import annotations

import json
import os
import selectors
import shlex
import signal
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from typing import IO, Any

import hou

from . import values
from .faults import Fault

# What Houdini sets for its own Python and libraries would break the tool's.
FOREIGN_VARIABLES = ("PYTHONHOME", "PYTHONPATH", "PXR_PLUGINPATH_NAME", "LD_LIBRARY_PATH")
MODES = {"overwrite": ["--overwrite"], "resume": ["--resume"]}
_POLL = 0.25  # seconds between two looks whether the user has interrupted

_started: dict[str, subprocess.Popen[bytes]] = {}  # by cache folder, of this session of Houdini


def command_line(node: hou.OpNode, scene: str) -> list[str]:
    """Arguments of the eulerfsi tool."""
    frames = values.frames(node)
    arguments = [values.text(node, "command"), "simulate", scene, "-o", values.text(node, "output")]
    arguments += ["--frames", f"{frames[0]}-{frames[-1]}", "--progress", "json"]
    threads, mode = values.whole(node, "threads"), values.text(node, "mode")
    if threads:
        arguments += ["--threads", str(threads)]
    arguments += ["--rebake-from", str(values.whole(node, "rebakefrom"))] if mode == "rebake" else MODES.get(mode, [])
    return arguments + shlex.split(values.text(node, "options"))


def start(node: hou.OpNode, arguments: list[str], log: str, events: int | IO[bytes]) -> subprocess.Popen[bytes]:
    """The process; messages for people go to the log. Raises Fault."""
    environment = {key: value for key, value in os.environ.items() if key not in FOREIGN_VARIABLES}
    try:
        with open(log, "wb") as messages:
            # Ctrl-C in the terminal of Houdini is Houdini's; a bake outlives it.
            return subprocess.Popen(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=events,
                stderr=messages,
                env=environment,
                start_new_session=True,
            )
    except OSError as error:
        name = error.filename or arguments[0]
        raise Fault(f"{node.path()}.command = {arguments[0]}: {name}: {error.strerror}") from error


def log_of(scene: str) -> str:
    return os.path.splitext(scene)[0] + ".log"


def in_background(node: hou.OpNode, scene: str) -> subprocess.Popen[bytes]:
    """Starts a run and returns its process. Events go to a file beside the scene. Raises Fault."""
    folder = values.text(node, "output")
    if (before := _started.get(folder)) is not None and before.poll() is None:
        raise Fault(f"{folder}: a run of this session writes to it: wait for it, or cancel it")
    with open(os.path.splitext(scene)[0] + ".events", "wb") as events:
        process = start(node, command_line(node, scene), log_of(scene), events)
    _started[folder] = process
    return process


def in_foreground(node: hou.OpNode, scene: str) -> None:
    """Runs to the end, with a bar; Escape stops it with a checkpoint. Raises Fault, hou.OperationInterrupted."""
    process = start(node, command_line(node, scene), log_of(scene), subprocess.PIPE)
    told = Told()
    with process, hou.InterruptableOperation(f"Simulating {node.path()}", open_interrupt_dialog=True) as operation:
        try:
            for event in _events(process):
                told.take(event)
                operation.updateProgress(told.fraction)
        except hou.OperationInterrupted:
            process.send_signal(signal.SIGINT)
            for event in _events(process):
                told.take(event)
            raise
    if process.returncode:
        raise Fault(
            *(told.errors or [f"{node.path()}: the solver ended with code {process.returncode}: {log_of(scene)}"])
        )


def run_to_end(node: hou.OpNode, arguments: list[str], log: str) -> tuple[int, str]:
    """Exit code and standard output of a command that writes one report. Raises Fault."""
    process = start(node, arguments, log, subprocess.PIPE)
    output, _ = process.communicate()
    return process.returncode, output.decode("utf-8", "replace")


class Told:
    """What the events of a run say so far."""

    def __init__(self) -> None:
        self.errors: list[str] = []
        self.fraction = 0.0
        self.text = "starts"
        self._first, self._count = 1, 1

    def take(self, event: dict[str, Any]) -> None:
        kind = event.get("event")
        if kind == "start":
            self._first, self._count = event["first"], event["last"] - event["first"] + 1
        elif kind in ("step", "frame"):
            done = event["frame"] - self._first + event.get("fraction", 1.0)
            self.fraction = done / self._count
            self.text = f"frame {event['frame']}, {100 * self.fraction:.0f} %"
        elif kind == "error":
            self.errors.append(event["message"])
        elif kind == "end":
            self.text = event["error"] or event["status"]


def parse(line: bytes) -> dict[str, Any]:
    """An event, {} for a line that is none."""
    try:
        found = json.loads(line)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _events(process: subprocess.Popen[bytes]) -> Iterator[dict[str, Any]]:
    """Events until the process closes its output; an empty one when nothing comes for a while."""
    assert process.stdout is not None
    rest = b""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while True:
            if not selector.select(_POLL):
                yield {}
                continue
            read = os.read(process.stdout.fileno(), 65536)
            if not read:
                return
            *lines, rest = (rest + read).split(b"\n")
            for line in lines:
                yield parse(line)


def cancel(node: hou.OpNode) -> str:
    """Asks the run in the cache folder to stop: it writes a checkpoint first. What was done, in words."""
    folder = values.text(node, "output")
    process = _started.get(folder)
    if process is not None and process.poll() is None:
        process.send_signal(signal.SIGINT)
        return f"{folder}: stops with a checkpoint; Mode Resume continues"
    owner = _owner(folder)
    if owner is None:
        return f"{folder}: no run of this machine writes to it"
    os.kill(owner, signal.SIGINT)
    return f"{folder}: process {owner} stops with a checkpoint; Mode Resume continues"


def _owner(folder: str) -> int | None:
    """The process that holds the lock of a cache, where it runs on this machine: "process 12 on host"."""
    import fcntl  # not on Windows, where no solver runs

    path = os.path.join(folder, ".lock")
    try:
        with open(path, encoding="utf-8") as file:
            words = file.read().split()
            with suppress(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
                return None
    except OSError:
        return None
    return int(words[1]) if len(words) == 4 and words[3] == os.uname().nodename else None


def files_of(folder: str, scene: str) -> list[str]:
    """Files of a cache, as its manifest lists them: first the layer that opens it."""
    with open(os.path.join(folder, "manifest.json"), encoding="utf-8") as file:
        manifest = json.load(file)
    names = [os.path.splitext(os.path.basename(scene))[0] + ".usda"]
    for _, entry in sorted(manifest["frames"].items(), key=lambda item: int(item[0])):
        names += sorted(entry["files"])
    return [os.path.join(folder, name) for name in names]
