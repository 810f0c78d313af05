"""Files that appear whole or not at all: written under a temporary name, flushed to disk, renamed."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf

from .errors import CacheIOError, LibraryError
from .reasons import usd_reason

TEMPORARY_PREFIX = ".writing-"


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Gives a temporary path in the same folder (same suffix); on success it becomes `path`, otherwise it is removed.

    Raises CacheIOError that names the file.
    """
    temporary = path.with_name(f"{TEMPORARY_PREFIX}{os.getpid()}-{path.name}")
    try:
        yield temporary
        with open(temporary, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        raise CacheIOError(f"{path}: cannot be written: {error.strerror or error}") from error
    except LibraryError as error:
        raise LibraryError(error.status, str(error).replace(str(temporary), str(path))) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Replaces a text file."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_tagged(path: Path, what: str, may_be_empty: bool = False, **tag: Any) -> dict[str, Any]:
    """The JSON object in a file, whose members `tag` say that it is `what`. may_be_empty: {} needs none.

    Raises OSError for a file that cannot be read, ValueError that says what is wrong with one that is read.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"is damaged: {error}") from error
    known = isinstance(data, dict) and all(data.get(key) == value for key, value in tag.items())
    if not known and not (may_be_empty and data == {}):
        raise ValueError(f"is not {what}")
    return data


def export_layer(layer: Sdf.Layer, path: Path) -> None:
    """Writes a USD layer. Raises OSError; USD itself raises or returns False."""
    try:
        written, reason = layer.Export(str(path)), ""
    except Tf.ErrorException as error:
        written, reason = False, f": {usd_reason(error)}"
    if not written:
        raise OSError(f"USD could not export it{reason}")


def sync_folder(folder: Path) -> None:
    """Makes renames in a folder durable, where the system can."""
    if hasattr(os, "O_DIRECTORY"):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def leftovers(folder: Path) -> list[Path]:
    """What killed runs left under temporary names; the library and USD put names of their own around them."""
    return sorted(folder.rglob(f"*{TEMPORARY_PREFIX}*"))


def remove_leftovers(folder: Path) -> None:
    """Removes what killed runs left."""
    for path in leftovers(folder):
        path.unlink(missing_ok=True)


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def fault(path: Path, facts: dict[str, int | str]) -> str:
    """What is wrong with a file that `record` has described; "" where it is as it was."""
    try:
        size = path.stat().st_size
        if size < facts["bytes"]:
            return f"is truncated: {size} of {facts['bytes']} bytes"
        if size > facts["bytes"]:
            return f"has changed: {size} bytes, {facts['bytes']} were written"
        return "" if digest(path) == facts["sha256"] else "has changed: its content is another one than was written"
    except (FileNotFoundError, NotADirectoryError):
        return "is missing"
    except OSError as error:
        return f"cannot be read: {error.strerror}"


def record(path: Path) -> dict[str, int | str]:
    """Size and hash of a file, as the manifest stores them."""
    return {"bytes": path.stat().st_size, "sha256": digest(path)}
