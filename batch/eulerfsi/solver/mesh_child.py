"""The child process that reads one mesh file: under a memory limit, and gone when its parent is.

`python -m eulerfsi.solver.mesh_child PATH DESCRIPTOR MEMORY PARENT` writes to the open file DESCRIPTOR one line of
JSON: {"points", "faces", "corners"}, counts with the arrays behind it (points float32 x y z, corners per face int32,
indices int32), and "objects", [name, faces] of each; or {"status", "message"} of a file that was refused.
`mesh_file.py` is the other side. It does without NumPy, which would take longer to import than most meshes to read.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from collections.abc import Iterator
from ctypes import byref, c_uint64, c_void_p
from typing import Any, BinaryIO

from .. import child
from ..errors import EulerFsiError, LibraryError
from . import binding, c_api


def main(arguments: list[str]) -> None:
    """Reads the file and writes the answer."""
    out, memory = child.begin(arguments[1:])
    with out:
        try:
            binding.library()
            child.limit(memory)
            _read(arguments[0], out)
        except LibraryError as error:
            _write_line(out, status=error.status, message=str(error))
        except EulerFsiError as error:
            _write_line(out, status=binding.ERROR_INTERNAL, message=str(error))
        except MemoryError:
            _write_line(out, status=binding.ERROR_MEMORY, message="not enough memory")


def _read(path: str, out: BinaryIO) -> None:
    lib, error, handle, view = binding.library(), c_api.Error(), c_void_p(), c_api.MeshView()
    binding.check_error(lib.efsi_mesh_load(os.fsencode(path), byref(handle), byref(error)), error)
    binding.check_error(lib.efsi_mesh_get_view(handle, byref(view)), error)
    counts = {"points": view.point_count, "faces": view.face_count, "corners": view.index_count}
    _write_line(out, **counts, objects=_objects(handle))
    for memory in _arrays(view):
        out.write(memory)


def _objects(handle: c_void_p) -> list[tuple[str, int]]:
    lib, error, count = binding.library(), c_api.Error(), c_uint64()
    size = ctypes.sizeof(c_api.MeshObject)
    binding.check_error(lib.efsi_mesh_get_objects(handle, None, size, 0, byref(count), byref(error)), error)
    found = (c_api.MeshObject * count.value)()
    status = lib.efsi_mesh_get_objects(handle, found, size, count, byref(count), byref(error))
    binding.check_error(status, error)
    return [(one.name.decode("utf-8", "replace"), one.face_count) for one in found]


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
