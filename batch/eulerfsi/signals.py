"""SIGINT and SIGTERM as a number that long work looks at."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from typing import Any


class Signals:
    """SIGTERM and SIGINT set `number`; the work looks at it now and then."""

    def __init__(self) -> None:
        self.number = 0

    def _note(self, number: int, _frame: Any) -> None:
        self.number = number

    @contextlib.contextmanager
    def installed(self) -> Iterator[Signals]:
        """Handles the signals inside the block (main thread only)."""
        old = {}
        for number in (signal.SIGTERM, signal.SIGINT):
            with contextlib.suppress(ValueError):  # not the main thread: the caller handles signals
                old[number] = signal.signal(number, self._note)
        try:
            yield self
        finally:
            for number, handler in old.items():
                signal.signal(number, handler)
