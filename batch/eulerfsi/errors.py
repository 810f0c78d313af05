"""Errors of the package, each with the exit code that the command line returns for it (docs/exit-codes.md)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

EXIT_OK = 0
EXIT_INTERNAL = 1
EXIT_USAGE = 2
EXIT_SCENE = 3
EXIT_DIVERGED = 4
EXIT_IO = 5
EXIT_STRICT = 6
EXIT_MISMATCH = 7
EXIT_JOBS = 8
EXIT_UNFINISHED = 75
EXIT_SIGHUP = 129
EXIT_SIGINT = 130
EXIT_SIGTERM = 143

# Every exit code: the word for it in events, and for --help. The launcher returns those of the set-up.
EXIT_CODES = {
    EXIT_OK: ("ok", "done"),
    EXIT_INTERNAL: ("internal", "internal error"),
    EXIT_USAGE: ("usage", "usage"),
    EXIT_SCENE: ("scene", "scene"),
    EXIT_DIVERGED: ("diverged", "diverged"),
    EXIT_IO: ("io", "disk or damage"),
    EXIT_STRICT: ("strict", "stopped by --strict"),
    EXIT_MISMATCH: ("mismatch", "a cache or checkpoint that does not fit the scene"),
    EXIT_JOBS: ("jobs", "some jobs of a wedge failed"),
    10: ("packages", "set-up: system packages"),
    11: ("python", "set-up: Python environment"),
    12: ("build", "set-up: build"),
    EXIT_UNFINISHED: ("unfinished", "not done yet, to be run again with --resume"),
    EXIT_SIGHUP: ("hangup", "SIGHUP"),
    EXIT_SIGINT: ("interrupted", "SIGINT (Ctrl-C)"),
    EXIT_SIGTERM: ("terminated", "SIGTERM"),
}


class EulerFsiError(Exception):
    """A failure with a message for the user. `exit_code`: what the command line returns.

    issues: what a check has found, where one did; each is a line of the message. prim, field: what the error is about,
    "" for nothing in particular.
    """

    exit_code = EXIT_INTERNAL

    def __init__(self, message: str, issues: Sequence[Any] = (), prim: str = "", field: str = "") -> None:
        super().__init__(message)
        self.issues = issues
        self.prim = prim
        self.field = field


class UsageError(EulerFsiError):
    """An option, a frame range or a `--set` name that cannot be used."""

    exit_code = EXIT_USAGE


class SceneError(EulerFsiError):
    """The scene cannot be simulated; the message names prim, field, value and limit."""

    exit_code = EXIT_SCENE


class DivergedError(EulerFsiError):
    """The state went bad and smaller steps did not help."""

    exit_code = EXIT_DIVERGED


class CacheIOError(EulerFsiError):
    """A file or folder cannot be read or written, or is damaged."""

    exit_code = EXIT_IO


class StrictError(EulerFsiError):
    """A condition of docs/warnings.md holds, and `--strict` stops the run."""

    exit_code = EXIT_STRICT


class MismatchError(EulerFsiError):
    """A cache or checkpoint is that of another scene, or cannot be continued as it is."""

    exit_code = EXIT_MISMATCH


class JobsError(EulerFsiError):
    """Some jobs of a wedge have failed; the others are done."""

    exit_code = EXIT_JOBS


class Cancelled(KeyboardInterrupt):
    """A signal stopped the work. `signal_number`: which one; `hint`: how to go on."""

    def __init__(self, signal_number: int, hint: str = "") -> None:
        super().__init__(f"stopped by signal {signal_number}" + (f"; {hint}" if hint else ""))
        self.signal_number = signal_number
        self.exit_code = 128 + signal_number


class Unfinished(Cancelled):
    """The work stopped before its end and shall be run again: `--max-wall-seconds`, `--requeue-on-signal`."""

    def __init__(self, message: str) -> None:
        KeyboardInterrupt.__init__(self, message)
        self.signal_number, self.exit_code = 0, EXIT_UNFINISHED


class LibraryError(EulerFsiError):
    """A call into the library failed. `status`: the EFSI_ERROR_* code."""

    # EfsiStatus -> exit code: argument, mesh and memory faults come from the scene.
    _EXIT_CODES = {2: EXIT_SCENE, 3: EXIT_SCENE, 4: EXIT_DIVERGED, 5: EXIT_IO, 6: EXIT_SCENE, 8: EXIT_MISMATCH}

    def __init__(self, status: int, message: str, prim: str = "") -> None:
        super().__init__(message, prim=prim)
        self.status = status
        self.exit_code = self._EXIT_CODES.get(status, EXIT_INTERNAL)


def exit_code(error: BaseException) -> int:
    """What the command line returns after an error."""
    if isinstance(error, (EulerFsiError, Cancelled)):
        return error.exit_code
    if isinstance(error, KeyboardInterrupt):
        return EXIT_SIGINT
    return EXIT_IO if isinstance(error, OSError) else EXIT_INTERNAL


def describe(error: BaseException) -> str:
    """What a user is told of an error; may have several lines."""
    if isinstance(error, OSError):
        return (f"{error.filename}: " if error.filename else "") + (error.strerror or str(error))
    if isinstance(error, KeyboardInterrupt):
        return str(error) or "stopped by signal 2"
    return str(error) if isinstance(error, EulerFsiError) else f"{type(error).__name__}: {error}"
