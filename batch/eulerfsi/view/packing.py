"""Arrays as text for the page: differences, bytes of a value apart, deflated, base64; data.js undoes it."""

from __future__ import annotations

import base64
import zlib

import numpy as np

LEVELS = 65535  # of a coordinate


class Blobs:
    """Packed arrays, by number. `size`: characters so far."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self.size = 0

    def add(self, data: bytes) -> int:
        """Deflates; returns the number."""
        self.texts.append(base64.b64encode(zlib.compress(data, 9)).decode("ascii"))
        self.size += len(self.texts[-1])
        return len(self.texts) - 1

    def integers(self, values: np.ndarray) -> int:
        """Whole numbers below 2^31, any shape; neighbours should be close."""
        steps = np.diff(values.ravel().astype(np.int64), prepend=0)
        codes = np.where(steps < 0, -2 * steps - 1, 2 * steps).astype("<u4")
        return self.add(codes.view(np.uint8).reshape(-1, 4).T.tobytes())

    def points(self, frames: np.ndarray, low: np.ndarray, size: np.ndarray) -> int:
        """(frames, points, 3) coordinates in a box, as 16-bit fractions of it; each frame less the one before."""
        scale = np.where(size > 0, LEVELS / np.where(size > 0, size, 1.0), 0.0)
        whole = np.clip(np.rint((frames - low) * scale), 0, LEVELS).astype(np.uint16).reshape(len(frames), -1)
        steps = np.diff(whole, axis=0, prepend=np.zeros((1, whole.shape[1]), np.uint16))
        apart = np.stack([steps & 255, steps >> 8], axis=1).astype(np.uint8)
        return self.add(apart.tobytes())

    def densities(self, roots: np.ndarray) -> int:
        """(x, y, z) bytes; each less the one before it along x."""
        rows = np.ascontiguousarray(roots.T)  # x varies fastest
        return self.add(np.diff(rows, axis=2, prepend=np.uint8(0)).tobytes())
