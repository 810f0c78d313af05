"""The lock of a cache folder: who writes to it now."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TextIO

from ..errors import CacheIOError

try:
    import fcntl
except ImportError:  # no such lock on this system
    fcntl = None

LOCK = ".lock"
_AGAIN = 0.05  # seconds between two tries; a reader that asks `is_held` is gone by then
_WAIT_AGAIN = 0.5  # the same, of a run that waits for another


class FolderLock:
    """Keeps a second run out of the folder, which is made where it is missing.

    The system releases the lock when the process ends, however it ends: a file that is left over locks nothing,
    whatever process, host and time it names. wait: seconds for which another run is waited for; tell: learns of that,
    and of what a run that was killed has left.
    """

    def __init__(self, folder: Path, wait: float = 0.0, tell: Callable[[str], None] = lambda _text: None) -> None:
        self.folder, self.path = folder, folder / LOCK
        self._wait, self._tell = wait, tell
        self._file: TextIO | None = None
        self._made = False

    def __enter__(self) -> FolderLock:
        try:
            self._enter()
            self._sign()
        except OSError as error:
            self._leave()
            raise CacheIOError(f"{self.path}: cannot be written: {error.strerror or error}") from error
        except BaseException:
            self._leave()
            raise
        return self

    def __exit__(self, *_exc: object) -> None:
        self._leave()

    def _enter(self) -> None:
        """Takes the lock. Raises CacheIOError that names who has it."""
        until, waits = time.monotonic() + max(self._wait, _AGAIN), False
        while not self._try():
            owner = _owner(self.path)
            left = until - time.monotonic()
            if left <= 0:
                how = f" after {self._wait:g} s of --wait" if self._wait else "; --wait SECONDS waits for it"
                raise CacheIOError(f"{self.folder}: {owner} is writing to this cache{how}")
            if self._wait and not waits:
                self._tell(f"{self.folder}: waiting for {owner}, at most {self._wait:g} s")
                waits = True
            time.sleep(min(left, _WAIT_AGAIN if self._wait else _AGAIN))

    def _try(self) -> bool:
        """One try; False where another run has the lock, or has just removed its file."""
        self._made |= not self.folder.exists()  # a run that was waited for may have removed what it had made
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            file = open(self.path, "a+", encoding="utf-8")  # noqa: SIM115 - held for the whole run
        except FileNotFoundError:
            return False  # it did so at this moment
        try:
            if fcntl:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.close()
            return False
        except OSError as error:
            self._tell(f"{self.folder}: not locked against a second run: {error.strerror}")
        self._file = file
        if self._is_ours():
            return True
        self._file = None
        file.close()
        return False

    def _is_ours(self) -> bool:
        """Whether the path still leads to the file that is open."""
        with contextlib.suppress(FileNotFoundError):
            return self._file is not None and os.path.samestat(os.fstat(self._file.fileno()), os.stat(self.path))
        return False

    def _sign(self) -> None:
        self._file.seek(0)
        before = self._file.read().strip()
        if before:
            self._tell(f"{self.folder}: {before} was writing to this cache and has not ended by itself")
        self._file.truncate(0)
        self._file.write(f"process {os.getpid()} on {os.uname().nodename}\n")
        self._file.flush()

    def _leave(self) -> None:
        if self._file:
            if self._is_ours():
                self.path.unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # what could not be written of it is of no use
                self._file.close()
            self._file = None
        if self._made:
            with contextlib.suppress(OSError):  # it is not empty
                self.folder.rmdir()


def _owner(path: Path) -> str:
    with contextlib.suppress(OSError):
        return path.read_text(encoding="utf-8", errors="replace").strip() or "another process"
    return "another process"


def is_held(folder: Path) -> bool:
    """Whether a run writes to the folder at this moment."""
    try:
        with open(folder / LOCK, encoding="utf-8") as file:
            if fcntl:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
