"""When a run writes checkpoints, and how many it keeps: `--checkpoint-every`, `--keep-checkpoints`."""

from __future__ import annotations

import re
import time

from ..errors import UsageError


class Checkpoints:
    """The plan of one run. One checkpoint follows the first frame, one the last.

    every: "N" frames or "Ts" for seconds of wall-clock time; keep: "N" or "all". Raises UsageError.
    """

    def __init__(self, every: str, keep: str) -> None:
        if not re.fullmatch(r"0*[1-9]\d*|(\d+\.?\d*|\.\d+)s", every):
            raise UsageError(
                f"--checkpoint-every {every}: must be a number of frames >= 1, or of seconds with an s: 10, 60s"
            )
        if keep != "all" and not re.fullmatch(r"0*[1-9]\d*", keep):
            raise UsageError(f"--keep-checkpoints {keep}: must be a whole number >= 1, or all")
        self._seconds = float(every[:-1]) if every.endswith("s") else None
        self._frames = int(every) if self._seconds is None else 0
        self.keep = None if keep == "all" else int(keep)
        self._last = time.monotonic()

    def most(self, frames: int) -> int:
        """Checkpoints that lie on disk at once in a run of so many frames: those that are kept, and a new one."""
        made = frames if self._seconds is not None else 2 + frames // self._frames
        return made if self.keep is None else min(made, self.keep + 1)

    def due(self, count: int) -> bool:
        """Whether one is written after `count` frames since the first."""
        if self._seconds is None:
            return count % self._frames == 0
        now = time.monotonic()
        if now - self._last < self._seconds:
            return False
        self._last = now
        return True
