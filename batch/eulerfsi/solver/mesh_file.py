"""Mesh files, each read by a child process.

The readers behind the library were not made for damaged or hostile files: one can take all memory, crash or go on for
very long. In a child process that costs one message.
"""

from __future__ import annotations

import json
import os
import signal
import tempfile
from pathlib import Path
from typing import BinaryIO

import numpy as np

from .. import child
from ..errors import EulerFsiError, LibraryError
from ..system import available_memory, format_bytes
from . import binding

FORMATS = ("obj", "ply", "stl", "off", "gltf", "glb", "fbx", "dae", "3ds")

Content = tuple[np.ndarray, np.ndarray, np.ndarray, list[tuple[str, int]]]


def read(path: str | Path, memory_limit: int | None = None) -> Content:
    """Points (n, 3) float32 in the file's own units, corners per face (faces,) int32, indices (corners,) int32, and
    name and number of faces of each object.

    memory_limit: bytes that reading may take, default what a simulation may. Raises LibraryError that names the file
    for one that is missing or refused, needs more memory or time than that, or makes the reader crash.
    """
    memory, seconds = memory_limit or available_memory(), time_limit(path)
    with tempfile.TemporaryFile() as answer, tempfile.TemporaryFile() as noise:
        code = child.run("eulerfsi.solver.mesh_child", [os.fspath(path)], memory, seconds, answer, noise)
        if code is None:
            message = f"{path}: not read within {seconds:.0f} s; the file is most likely damaged"
            raise LibraryError(binding.ERROR_MESH, message)
        if code == -signal.SIGKILL:
            raise LibraryError(
                binding.ERROR_MEMORY, f"{path}: the process reading it was killed; the machine may be out of memory"
            )
        if code < 0:
            name = signal.strsignal(-code) or f"signal {-code}"
            raise LibraryError(
                binding.ERROR_MESH, f"{path}: the process reading it crashed ({name}); the file is most likely damaged"
            )
        if code > 0:
            last = child.last_line(noise)
            raise EulerFsiError(f"{path}: the process reading it failed with code {code}: {last}")
        answer.seek(0)
        return _content(path, answer, memory)


def time_limit(path: str | Path) -> float:
    """Seconds that reading may take: a second per megabyte, at least ten. The arrays of a .gltf lie beside it."""
    path = Path(path)
    beside = path.parent.glob("*.bin") if path.suffix.lower() == ".gltf" else ()
    try:
        size = sum(file.stat().st_size for file in (path, *beside))
    except OSError:
        size = 0  # the reader tells what is wrong
    return child.time_limit(size)


def _content(path: str | Path, answer: BinaryIO, memory: int) -> Content:
    facts = json.loads(answer.readline())
    if facts.get("status") == binding.ERROR_MEMORY:
        message = f"{path}: needs more than {format_bytes(memory)} of memory to be read, the limit of this run"
        raise LibraryError(binding.ERROR_MEMORY, message)
    if "status" in facts:
        raise LibraryError(facts["status"], facts["message"])
    points = np.fromfile(answer, np.float32, 3 * facts["points"]).reshape(-1, 3)
    counts = np.fromfile(answer, np.int32, facts["faces"])
    indices = np.fromfile(answer, np.int32, facts["corners"])
    if (len(points), len(counts), len(indices)) != (facts["points"], facts["faces"], facts["corners"]):
        raise EulerFsiError(f"{path}: the process reading it returned fewer values than announced")
    return points, counts, indices, [(name, faces) for name, faces in facts["objects"]]
