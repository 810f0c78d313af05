"""The smoke of a cache for the page: square roots of densities in bytes, on a grid of at most so many cells."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CacheIOError, LibraryError
from ..solver.volume_file import VolumeFile
from .packing import Blobs

MOST_CELLS = 420_000  # of a frame: about 75 cubed
_GRID = "density"
_DENSE = 98.0  # percentile of the densities that counts as dense
_DEPTH = 13.0  # optical depth of that over the longest edge of the domain
_FLAT_DEPTH = 2.0  # of a slab, from front to back
_VISIBLE = 1e-3


@dataclasses.dataclass(frozen=True)
class Volumes:
    """The files of the frames shown, None for one without, and the box of voxels that holds the smoke of all."""

    files: Sequence[Path | None]
    low: np.ndarray
    size: np.ndarray
    transform: np.ndarray  # (4, 4) for column vectors, voxels to world space

    def factor(self, most: int) -> int:
        """Edge in voxels of the cells of a grid with at most so many."""
        coarsen = 1
        while np.prod(-(-self.size // coarsen)) > most:
            coarsen += 1
        return coarsen


def _open(path: Path) -> VolumeFile:
    try:
        return VolumeFile(path)
    except LibraryError as error:
        raise CacheIOError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from error


def find_volumes(files: Sequence[Path | None]) -> Volumes | None:
    """Looks at every file; None where no frame has smoke. Raises CacheIOError that names the file."""
    low, high, transform = None, None, None
    for path in files:
        if path is None:
            continue
        with _open(path) as volume:
            grid = volume.grid(_GRID)
        if not grid["active_count"]:
            continue
        transform = grid["transform"]
        end = grid["min"] + grid["size"]
        low = grid["min"] if low is None else np.minimum(low, grid["min"])
        high = end if high is None else np.maximum(high, end)
    return None if low is None else Volumes(files, low, high - low, transform)


def pack_smoke(volumes: Volumes, coarsen: int, to_page: np.ndarray, flat: bool, blobs: Blobs) -> dict[str, Any]:
    """What the page knows of the smoke. to_page: (4, 4) for column vectors, world space to the page's."""
    cells = -(-volumes.size // coarsen)
    frames, dense = [], 0.0
    for path in volumes.files:
        values = None
        if path is not None:
            with _open(path) as volume:
                values = volume.read(_GRID, volumes.low, cells, coarsen)
        highest = float(values.max()) if values is not None and values.size else 0.0
        if highest <= 0:
            frames.append(None)
            continue
        roots = np.rint(255 * np.sqrt(np.clip(values / highest, 0, 1))).astype(np.uint8)
        seen = values[values > _VISIBLE * highest]
        dense = max(dense, float(np.percentile(seen, _DENSE)))
        frames.append({"blob": blobs.densities(roots), "scale": highest})
    box = np.eye(4)  # the unit cube to voxels
    box[range(3), range(3)] = cells * coarsen
    box[:3, 3] = volumes.low - 0.5
    matrix = to_page @ volumes.transform @ box
    depth = np.linalg.norm(matrix[:3, :3], axis=0).min() if flat else 1.0
    return {
        "cells": cells.tolist(),
        "matrix": matrix.T.ravel().tolist(),
        "frames": frames,
        "thickness": (_FLAT_DEPTH if flat else _DEPTH) / (depth * max(dense, 1e-12)),
        "flat": flat,
    }
