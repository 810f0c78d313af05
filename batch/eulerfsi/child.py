"""A child process that does what a file of strangers could make go wrong: read it, under limits of memory and time.

Both sides of it: `run` starts `python -m MODULE ARGUMENTS... DESCRIPTOR MEMORY PARENT`, `begin` is what such a module
calls first. A child that takes all memory, crashes or goes on for ever costs its parent one message. This module does
without NumPy and USD, which take long to import.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import BinaryIO

from . import paths
from .errors import EulerFsiError

SECONDS, SECONDS_PER_MEGABYTE = 10.0, 1.0  # that reading a file may take
_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def time_limit(size: float) -> float:
    """Seconds that reading so many bytes may take, on a machine with nothing else to do."""
    return max(SECONDS, SECONDS_PER_MEGABYTE * size / 1e6)


def run(
    module: str, arguments: Sequence[str], memory: int, seconds: float, answer: BinaryIO, noise: BinaryIO
) -> int | None:
    """Exit code of the child, None when its time was up. It is gone when this returns or raises.

    answer: the file whose descriptor it gets; noise: takes what it writes to standard error.
    """
    if not sys.executable:
        raise EulerFsiError("files are read by a second Python process, and the interpreter of this one is unknown")
    # The child shall find what this process found, whatever the environment says.
    places = [str(paths.PACKAGE.parent), *(place for place in sys.path if os.path.isabs(place))]
    child = subprocess.Popen(
        [sys.executable, "-P", "-m", module, *arguments, str(answer.fileno()), str(memory), str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=noise,
        pass_fds=(answer.fileno(),),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(places)},
        start_new_session=True,  # Ctrl-C reaches this process alone, which ends the child
    )
    try:
        return _wait(child, seconds)
    finally:
        child.kill()
        child.wait()


def _wait(child: subprocess.Popen, seconds: float) -> int | None:
    """Its exit code, None when its time was up: later only where a busy machine has not let it run that long."""
    patience, before = seconds, -1.0
    while True:
        try:
            return child.wait(patience)
        except subprocess.TimeoutExpired:
            runs, taken = _state(child.pid)
            if taken >= seconds or not (runs or taken > before):
                return None
            patience, before = 0.5, taken


def _state(process: int) -> tuple[bool, float]:
    """(whether a process wants to run or has just ended, seconds of processor time that it had)."""
    with open(f"/proc/{process}/stat", encoding="ascii", errors="replace") as file:
        words = file.read().rpartition(")")[2].split()
    return words[0] in "RZ", (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def last_line(noise: BinaryIO) -> str:
    """Of what a child wrote to standard error."""
    noise.seek(0)
    return noise.read().decode("utf-8", "replace").strip().rpartition("\n")[2]


def begin(words: Sequence[str]) -> tuple[BinaryIO, int]:
    """In the child. words: the last three of its arguments. Returns (the file to answer in, bytes it may take)."""
    descriptor, memory, parent = map(int, words)
    _end_with(parent)
    return open(descriptor, "wb"), memory


def _end_with(parent: int) -> None:
    """A parent that is killed cannot end its child: the kernel does."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


def limit(memory: int) -> None:
    """At most `memory` bytes beyond what this process takes already, no core file, first to be killed."""
    with open("/proc/self/statm", encoding="ascii") as file:
        base = int(file.read().split()[0]) * resource.getpagesize()
    for kind, value in (
        (resource.RLIMIT_AS, base + memory),
        (resource.RLIMIT_FSIZE, memory),
        (resource.RLIMIT_CORE, 0),
    ):
        least = min([value, *(limit for limit in resource.getrlimit(kind) if limit != resource.RLIM_INFINITY)])
        resource.setrlimit(kind, (least, least))
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:
        file.write("1000")
