"""Runs that are killed: processes with the program loaded, forked for every run, so that fifty of them cost little."""

from __future__ import annotations

import ctypes
import dataclasses
import faulthandler
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from conftest import ROOT, environment

# A process with threads cannot be forked: its children would wait for threads that they do not have.
_NO_THREADS = {"OPENBLAS_NUM_THREADS": "1", "PXR_WORK_THREAD_LIMIT": "1"}


_LONGEST = 300.0  # seconds of a run; then it says where it hangs


@dataclasses.dataclass
class Ended:
    """How a run has ended: its exit code (negative: the signal), what it said, changes of files that were counted."""

    code: int
    told: str
    changes: int


def contents(folder: Path) -> dict[str, Any]:
    """All that a cache holds, by file, in which two runs must agree: all but the log and the times of stats.jsonl."""
    found: dict[str, Any] = {}
    for path in folder.rglob("*"):
        if path.is_file() and path.name != "log":
            found[path.relative_to(folder).as_posix()] = path.read_bytes()
    lines = [json.loads(line) for line in found.pop("stats.jsonl", b"").splitlines()]
    found["statistics"] = [{k: v for k, v in line.items() if k not in ("seconds", "profile")} for line in lines]
    return found


def agree(folder: Path, other: Path) -> None:
    """Asserts that two caches hold the same; names the files that differ."""
    first, second = contents(folder), contents(other)
    differ = [name for name in sorted({*first, *second}) if first.get(name) != second.get(name)]
    assert not differ, f"{folder}: {', '.join(differ)}"


class Runs:
    """Starts command lines in forked processes; a context manager. folder: for the compiled shim."""

    def __init__(self, folder: Path) -> None:
        shim = folder / "crash.so"
        command = ["cc", "-shared", "-fPIC", "-O1", "-o", shim, ROOT / "tests/python/crash.c", "-ldl"]
        subprocess.run(command, check=True)
        self._server = subprocess.Popen(
            [sys.executable, __file__],
            env={**environment(), "LD_PRELOAD": str(shim), **_NO_THREADS},
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def __enter__(self) -> Runs:
        return self

    def __exit__(self, *_exc: object) -> None:
        self._server.stdin.close()
        self._server.wait(60)

    def run(
        self, *arguments: object, below: Path = Path("/nowhere"), at: int = 0, seconds: float = 0.0, jump: bool = False
    ) -> Ended:
        """`eulerfsi ARGUMENTS`.

        Killed at change number `at` of a file below a folder, or after some seconds, 0: never; jump: the clock jumps.
        """
        wanted = {"arguments": list(map(str, arguments)), "below": str(below), "at": at, "seconds": seconds}
        self._server.stdin.write(json.dumps({**wanted, "jump": jump}) + "\n")
        self._server.stdin.flush()
        return Ended(**json.loads(self._server.stdout.readline()))


def _serve() -> None:
    sys.path[:0] = [str(ROOT / "batch"), str(ROOT / "usd_plugin")]
    import matplotlib.pyplot  # noqa: F401
    from eulerfsi.cli import main, report, verify  # noqa: F401

    assert len(os.listdir("/proc/self/task")) == 1
    for line in sys.stdin:
        print(json.dumps(_one(**json.loads(line))), flush=True)


def _one(arguments: list[str], below: str, at: int, seconds: float, jump: bool) -> dict[str, Any]:
    told, counted = (os.memfd_create(name) for name in ("told", "counted"))
    child = os.fork()
    if child == 0:
        _run(arguments, below, at, jump, told, counted)
    timer = threading.Timer(seconds, os.kill, (child, signal.SIGKILL)) if seconds else None
    if timer:
        timer.start()
    _, status = os.waitpid(child, 0)
    if timer:
        timer.cancel()
    text = [os.pread(file, 1 << 20, 0).decode() for file in (told, counted)]
    os.close(told)
    os.close(counted)
    return {"code": os.waitstatus_to_exitcode(status), "told": text[0], "changes": int(text[1] or 0)}


def _run(arguments: list[str], below: str, at: int, jump: bool, told: int, counted: int) -> None:
    """In the child: does not return."""
    from eulerfsi.cli.main import main

    os.dup2(told, 1)
    os.dup2(told, 2)
    faulthandler.dump_traceback_later(_LONGEST, exit=True, file=told)
    shim = ctypes.CDLL(None)
    shim.crash_at(below.encode(), ctypes.c_long(at))
    if jump:
        shim.crash_clock()
    try:
        code = main(arguments)
    except SystemExit as leave:
        code = leave.code
    sys.stdout.flush()
    shim.crash_changes.restype = ctypes.c_long
    os.write(counted, str(shim.crash_changes()).encode())
    os._exit(code)


if __name__ == "__main__":
    _serve()
