"""The run's log: every message with its time in the cache's `log`, warnings on standard error as well."""

from __future__ import annotations

import contextlib
import datetime
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from .errors import CacheIOError
from .say import say


class Log:
    """Keeps messages until `open` names the file, so that nothing is written for a scene that is refused.

    tell(message, code, prim, field, **facts): learns of every warning.
    """

    def __init__(self, err: TextIO | None = None) -> None:
        self._err = err or sys.stderr
        self.tell: Callable[..., Any] | None = None
        self._file: TextIO | None = None
        self._path = Path()
        self._pending: list[str] = []
        self._warned: set[str] = set()

    def open(self, path: Path, *heading: str) -> None:
        """Appends to a file from now on: the heading, then what was kept. Raises CacheIOError."""
        self._path, kept = path, self._pending
        self._pending = []
        try:
            self._file = open(path, "a", encoding="utf-8")  # noqa: SIM115 - lives as long as the run
        except OSError as error:
            raise CacheIOError(f"{path}: cannot be written: {error.strerror}") from error
        for line in heading:
            self._write("info", line)
        self._append("".join(kept))

    def close(self) -> None:
        """Closes the file."""
        if self._file:
            with contextlib.suppress(OSError):  # what a full disk has refused was told
                self._file.close()
            self._file = None

    def info(self, text: str) -> None:
        """A message for the file only."""
        self._write("info", text)

    def warning(self, text: str, code: str = "Other", prim: str = "", field: str = "", **facts: float) -> None:
        """A message for the file and standard error; one that was given before is not repeated there.

        code: short name of the rule; prim, field: what it is about, "" for nothing in particular; facts: value,
        limit and frame of a condition (docs/warnings.md).
        """
        self._write("warning", text)
        if text not in self._warned:
            self._warned.add(text)
            say(f"warning: {text}", self._err)
            if self.tell:
                self.tell(text, code, prim, field, **facts)

    def error(self, text: str) -> None:
        """A message for the file; the command line prints the error itself."""
        self._write("error", text)

    def _write(self, level: str, text: str) -> None:
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        line = f"{now} {level}: {text}\n"
        if self._file:
            self._append(line)
        else:
            self._pending.append(line)

    def _append(self, text: str) -> None:
        try:
            self._file.write(text)
            self._file.flush()
        except OSError as error:
            raise CacheIOError(f"{self._path}: cannot be written: {error.strerror}") from error
