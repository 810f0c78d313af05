"""The child process that reads one mesh file: under a memory limit, and gone when its parent is.

`python -m eulerfsi.solver.mesh_child PATH DESCRIPTOR MEMORY PARENT` writes to the open file DESCRIPTOR one line of
JSON: {"points", "faces", "corners"}, counts with the arrays behind it (points float32 x y z, corners per face int32,
indices int32), or {"status", "message"} of a file that was refused. `mesh_file.py` is the other side. It does without
NumPy, which would take longer to import than most meshes to read.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import resource
import signal
import sys
from collections.abc import Iterator
from ctypes import byref, c_void_p
from typing import Any, BinaryIO

from ..errors import EulerFsiError, LibraryError
from . import binding, c_api

_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def main(arguments: list[str]) -> None:
    """Reads the file and writes the answer."""
    path, descriptor, memory, parent = arguments[0], *map(int, arguments[1:])
    _end_with(parent)
    with open(descriptor, "wb") as out:
        try:
            binding.library()
            _limit(memory)
            _read(path, out)
        except LibraryError as error:
            _write_line(out, status=error.status, message=str(error))
        except EulerFsiError as error:
            _write_line(out, status=binding.ERROR_INTERNAL, message=str(error))
        except MemoryError:
            _write_line(out, status=binding.ERROR_MEMORY, message="not enough memory")


def _end_with(parent: int) -> None:
    """A parent that is killed cannot end its child: the kernel does."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


def _limit(memory: int) -> None:
    """At most `memory` bytes beyond what interpreter and library take already, no core file, first to be killed."""
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


def _read(path: str, out: BinaryIO) -> None:
    lib, error, handle, view = binding.library(), c_api.Error(), c_void_p(), c_api.MeshView()
    binding.check_error(lib.efsi_mesh_load(os.fsencode(path), byref(handle), byref(error)), error)
    binding.check_error(lib.efsi_mesh_get_view(handle, byref(view)), error)
    _write_line(out, points=view.point_count, faces=view.face_count, corners=view.index_count)
    for memory in _arrays(view):
        out.write(memory)


def _arrays(view: c_api.MeshView) -> Iterator[ctypes.Array]:
    """The library's own memory, array by array. Its views of files have packed points and counts of corners."""
    assert view.point_stride == 12 and view.face_vertex_counts
    for address, size in (
        (view.points, 12 * view.point_count),
        (view.face_vertex_counts, 4 * view.face_count),
        (view.face_vertex_indices, 4 * view.index_count),
    ):
        yield (ctypes.c_char * size).from_address(address)


def _write_line(out: BinaryIO, **facts: Any) -> None:
    out.write(json.dumps(facts).encode() + b"\n")


if __name__ == "__main__":
    main(sys.argv[1:])
