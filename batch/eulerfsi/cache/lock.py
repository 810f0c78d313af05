"""The lock of a cache folder: who writes to it now."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TextIO

from ..errors import UsageError

LOCK = ".lock"


class FolderLock:
    """Keeps a second run out of the folder; the system releases it when the process ends, however it ends."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / LOCK
        self._file = None

    def __enter__(self) -> FolderLock:
        try:
            import fcntl
        except ImportError:
            return self  # no such lock on this system
        self._file = open(self.path, "a+", encoding="utf-8")  # noqa: SIM115 - held for the whole run
        try:
            _acquire(self._file, fcntl.LOCK_EX)
        except OSError:
            self._file.seek(0)
            owner = self._file.read().strip() or "another process"
            self._file.close()
            raise UsageError(f"{self.path.parent}: {owner} is writing to this cache") from None
        self._file.truncate(0)
        self._file.write(f"process {os.getpid()} on {os.uname().nodename}\n")
        self._file.flush()
        return self

    def __exit__(self, *_exc: object) -> None:
        if self._file:
            self.path.unlink(missing_ok=True)
            self._file.close()


def _acquire(file: TextIO, kind: int) -> None:
    """Locks a file without waiting for a run; for one that asks `is_held` at this moment there is a second try."""
    import fcntl

    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        time.sleep(0.05)
        fcntl.flock(file, kind | fcntl.LOCK_NB)


def is_held(folder: Path) -> bool:
    """Whether a run writes to the folder at this moment."""
    try:
        import fcntl

        with open(folder / LOCK, encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (ImportError, OSError):
        return False
    return False
