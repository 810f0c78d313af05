# SPDX-License-Identifier: GPL-3.0-or-later
"""How large a simulation will be, while the voxel size is dragged: cells, memory, disk."""

from __future__ import annotations

import math
from collections.abc import Sequence

# Those of the library (estimate_memory); a test compares the results.
_BYTES_PER_CELL, _BYTES_PER_BAND_CELL = 150.0, 520.0
_BAND_MARGIN, _WINDOW_MARGIN = 6.0, 2.0
_BYTES_PER_SMOKE_VOXEL = (16.0, 8.0)  # density and velocity; with half floats
_BYTES_PER_VERTEX = 36.0  # points, velocities, normals


def cells(size: Sequence[float], voxel: float) -> int:
    """Cells of a box. size, voxel: metres."""
    return math.prod(max(1, math.ceil(edge / voxel - 1e-6)) for edge in size)


def memory(size: Sequence[float], voxel: float, boxes: Sequence[Sequence[float]], fluid: bool) -> float:
    """Bytes that a run needs. boxes: edges [m] of the bounding boxes of solids and colliders."""
    count = math.prod(math.ceil(edge / voxel) + 1.0 for edge in size)
    volume = sum(math.prod(min(a, b) for a, b in zip(box, size, strict=True)) for box in boxes)

    def around(margin: float) -> float:
        return (volume ** (1 / 3) / voxel + 2 * margin) ** 3 if volume > 0 else 0.0

    if not fluid:
        count = min(count, around(_WINDOW_MARGIN))
    return _BYTES_PER_CELL * count + _BYTES_PER_BAND_CELL * around(_BAND_MARGIN)


def disk(frames: int, count: int, vertices: int, smoke: bool, half: bool) -> float:
    """Bytes of a cache at most: a box that is full of smoke in every frame."""
    return frames * (_BYTES_PER_VERTEX * vertices + (_BYTES_PER_SMOKE_VOXEL[half] * count if smoke else 0.0))


def text(number: float) -> str:
    """Bytes for people."""
    for unit in ("B", "kB", "MB", "GB"):
        if number < 1000:
            return f"{number:.0f} {unit}" if unit == "B" else f"{number:.3g} {unit}"
        number /= 1000
    return f"{number:.3g} TB"
