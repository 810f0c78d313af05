"""stats.jsonl: a JSON object a line, added frame by frame while others may read."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .. import files
from ..errors import CacheIOError

NAME = "stats.jsonl"


def read(folder: Path) -> list[dict[str, Any]]:
    """The lines of a cache's file, in order of time. Raises CacheIOError.

    A last line without an end is left out: a run writes it at this moment, or was killed when it did.
    """
    path = folder / NAME
    try:
        text = path.read_bytes().decode("utf-8", errors="replace")
    except OSError as error:
        raise CacheIOError(f"{path}: {error.strerror}") from error
    result = []
    for number, line in enumerate(text.split("\n")[:-1], 1):
        try:
            result.append(json.loads(line))
        except ValueError as error:
            raise CacheIOError(f"{path}: line {number}: is damaged: {error}") from error
    return result


def append(folder: Path, lines: Iterable[dict[str, Any]]) -> None:
    """Adds lines, all or none. Raises CacheIOError."""
    path = folder / NAME
    data = memoryview(_text(lines).encode())
    try:
        with open(path, "ab", buffering=0) as file:
            end = file.tell()
            try:
                while data:
                    data = data[file.write(data) :]
            except OSError:
                file.truncate(end)
                raise
    except OSError as error:
        raise CacheIOError(f"{path}: cannot be written: {error.strerror}") from error


def trim(folder: Path, time: float) -> None:
    """Drops what was recorded after `time`, and a last line without an end. Raises CacheIOError."""
    if (folder / NAME).is_file():
        files.write_text(folder / NAME, _text(line for line in read(folder) if line["time"] <= time))


def _text(lines: Iterable[dict[str, Any]]) -> str:
    return "".join(json.dumps(_finite(line)) + "\n" for line in lines)


def _finite(value: Any) -> Any:
    """The value with null for numbers that JSON does not know."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
