"""Smoke read back from the .vdb files of a cache, for clients that show it."""

from __future__ import annotations

from ctypes import byref, c_float, c_int32, c_uint32, c_void_p, sizeof
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from . import binding, c_api


class VolumeFile:
    """A .vdb file that this program has written, in memory; a context manager.

    Raises LibraryError with status ERROR_IO for a file that cannot be read, is damaged or of another program.
    """

    def __init__(self, path: str | Path) -> None:
        self._lib, self._handle, error = binding.library(), c_void_p(), c_api.Error()
        status = self._lib.efsi_vdb_open(str(path).encode(), byref(self._handle), byref(error))
        binding.check_error(status, error)

    def close(self) -> None:
        """Frees the memory; may be called again."""
        self._lib.efsi_vdb_destroy(self._handle)
        self._handle = c_void_p()

    def __enter__(self) -> VolumeFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self.close()

    def grid(self, name: str) -> dict[str, Any]:
        """Returns the fields of EfsiVdbGrid. ERROR_ARGUMENT for a grid that is not there.

        min, size: (3,) box of the active voxels; components: 1 or 3; transform: (4, 4) for column vectors, voxels to
        world space; active_count.
        """
        out, error = c_api.VdbGrid(), c_api.Error()
        status = self._lib.efsi_vdb_get_grid(self._handle, name.encode(), byref(out), sizeof(out), byref(error))
        binding.check_error(status, error)
        return {
            "min": np.array(out.min, int),
            "size": np.array(out.size, int),
            "components": int(out.components),
            "transform": np.reshape(out.transform, (4, 4)).astype(float),
            "active_count": int(out.active_count),
        }

    def read(
        self, name: str, low: np.ndarray | None = None, cells: np.ndarray | None = None, coarsen: int = 1
    ) -> np.ndarray:
        """Returns (x, y, z) or (x, y, z, 3) float32 values of a grid in cells of coarsen^3 voxels.

        low: first voxel, cells: numbers of cells; by default the box of the active voxels. A cell has the mean of its
        voxels, of a vector that of the active ones. ERROR_ARGUMENT for a grid that is not there or a box that is
        refused.
        """
        facts, error = self.grid(name), c_api.Error()
        low = facts["min"] if low is None else np.asarray(low, int)
        cells = -(-facts["size"] // max(1, coarsen)) if cells is None else np.asarray(cells, int)
        values = np.zeros((*cells[::-1], facts["components"]), np.float32)
        if values.size:
            first, box = (c_int32 * 3)(*low.tolist()), (c_uint32 * 3)(*cells.tolist())
            target = values.ctypes.data_as(c_void_p)
            status = self._lib.efsi_vdb_read(
                self._handle, name.encode(), first, box, coarsen, target, values.nbytes // sizeof(c_float), byref(error)
            )
            binding.check_error(status, error)
        values = values.transpose(2, 1, 0, 3)
        return values if facts["components"] > 1 else values[..., 0]
