"""stats.jsonl: a JSON object a line, added frame by frame while others may read."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import CacheIOError

NAME = "stats.jsonl"
_TIMES = ("seconds", "profile")


def read(folder: Path) -> list[dict[str, Any]]:
    """The lines of a cache's file, in order of time. Raises CacheIOError.

    A last line without an end is left out: a run writes it at this moment, or was killed when it did.
    """
    path = folder / NAME
    try:
        text = path.read_bytes().decode("utf-8", errors="replace")
    except OSError as error:
        raise CacheIOError(f"{path}: {error.strerror}") from error
    return [_line(path, number, line) for number, line in enumerate(text.split("\n")[:-1], 1)]


class Extent:
    """What the file has so far: its lines, and a hash of them without the times, in which no two runs agree."""

    def __init__(self) -> None:
        self.lines = 0
        self._hash = hashlib.sha256()

    def add(self, line: dict[str, Any]) -> None:
        """A line, as JSON gives it back."""
        self.lines += 1
        self._hash.update(json.dumps({key: line[key] for key in line if key not in _TIMES}).encode() + b"\n")

    def facts(self) -> dict[str, Any]:
        """For the manifest."""
        return {"lines": self.lines, "sha256": self._hash.hexdigest()}


def append(folder: Path, lines: Iterable[dict[str, Any]], extent: Extent) -> None:
    """Adds lines, all or none, to the file and its extent. Raises CacheIOError."""
    path = folder / NAME
    finite = [_finite(line) for line in lines]
    data = memoryview("".join(json.dumps(line) + "\n" for line in finite).encode())
    try:
        with open(path, "ab", buffering=0) as file:
            end = file.tell()
            try:
                while data:
                    data = data[file.write(data) :]
            except OSError:
                file.truncate(end)
                raise
            os.fsync(file.fileno())
    except OSError as error:
        raise CacheIOError(f"{path}: cannot be written: {error.strerror}") from error
    for line in finite:
        extent.add(line)


def fault(folder: Path, part: dict[str, Any], whole: bool = False) -> str:
    """What is wrong with the beginning of the file, whose extent `part` was; "" where it is as it was.

    What comes later is that of a run that goes on, or was killed; whole: nothing may.
    """
    path = folder / NAME
    if not path.is_file():
        return "is missing"
    try:
        extent = _extent(path, part["lines"])
    except CacheIOError as error:
        return str(error).removeprefix(f"{path}: ")
    if extent.lines < part["lines"]:
        return f"is truncated: {extent.lines} of {part['lines']} lines"
    with open(path, "rb") as file:
        if whole and next(itertools.islice(file, part["lines"], None), b""):
            return f"has changed: it has more than the {part['lines']} lines that were written"
    return "" if extent.facts() == part else "has changed: its content is another one than was written"


def faults(folder: Path) -> list[str]:
    """What keeps the file from being read."""
    try:
        read(folder)
    except CacheIOError as error:
        return [str(error).removeprefix(f"{folder / NAME}: ")]
    return []


def go_back(folder: Path, checkpoint: dict[str, Any] | None) -> Extent:
    """Drops what was recorded after a checkpoint (None: everything); returns what stays. Raises CacheIOError."""
    path = folder / NAME
    if checkpoint is None or not path.is_file():
        path.unlink(missing_ok=True)
        return Extent()
    count = checkpoint["stats"]["lines"]
    with open(path, "rb") as file:
        length = sum(len(file.readline()) for _ in range(count))
    os.truncate(path, length)
    return _extent(path, count)


def _extent(path: Path, count: int) -> Extent:
    """Of the first lines. Raises CacheIOError."""
    extent = Extent()
    with open(path, "rb") as file:
        for number, text in enumerate(itertools.islice(file, count), 1):
            if text.endswith(b"\n"):
                extent.add(_line(path, number, text.decode("utf-8", errors="replace")))
    return extent


def _line(path: Path, number: int, text: str) -> dict[str, Any]:
    try:
        line = json.loads(text)
    except ValueError as error:
        raise CacheIOError(f"{path}: line {number}: is damaged: {error}") from error
    if not isinstance(line, dict):
        raise CacheIOError(f"{path}: line {number}: is damaged: it is no object")
    return line


def _finite(value: Any) -> Any:
    """The value with null for numbers that JSON does not know."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
