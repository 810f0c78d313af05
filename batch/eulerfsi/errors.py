"""Errors of the package, each with the exit code that the command line returns for it."""

from __future__ import annotations

EXIT_OK = 0
EXIT_INTERNAL = 1
EXIT_USAGE = 2
EXIT_SCENE = 3
EXIT_DIVERGED = 4
EXIT_IO = 5
EXIT_SIGINT = 130
EXIT_SIGTERM = 143


class EulerFsiError(Exception):
    """A failure with a message for the user. `exit_code`: what the command line returns."""

    exit_code = EXIT_INTERNAL


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
    """A file or folder cannot be read or written."""

    exit_code = EXIT_IO


class Cancelled(EulerFsiError):
    """A signal stopped the run. `signal_number`: which one; `hint`: how to go on."""

    def __init__(self, signal_number: int, hint: str = "") -> None:
        super().__init__(f"stopped by signal {signal_number}" + (f"; {hint}" if hint else ""))
        self.signal_number = signal_number
        self.exit_code = 128 + signal_number


class LibraryError(EulerFsiError):
    """A call into the library failed. `status`: the EFSI_ERROR_* code."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status
        # EfsiStatus -> exit code: argument, mesh and memory faults come from the scene.
        self.exit_code = {2: EXIT_SCENE, 3: EXIT_SCENE, 4: EXIT_DIVERGED, 5: EXIT_IO, 6: EXIT_SCENE, 8: EXIT_IO}.get(
            status, EXIT_INTERNAL
        )
