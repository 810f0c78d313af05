"""SIGHUP, SIGINT and SIGTERM: a number that long work looks at, or an exception."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

from .errors import Cancelled

NUMBERS = [getattr(signal, name) for name in ("SIGHUP", "SIGINT", "SIGTERM") if hasattr(signal, name)]
_AGAIN = 0.02  # seconds until a signal is looked at again


@contextlib.contextmanager
def _handled(handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Handles the signals inside the block (main thread only). A SIGHUP that `nohup` ignores stays so."""
    old = {}
    for number in NUMBERS:
        if number != signal.SIGINT and signal.getsignal(number) is signal.SIG_IGN:
            continue
        with contextlib.suppress(ValueError):  # not the main thread: the caller handles signals
            old[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, before in old.items():
            signal.signal(number, before)


@contextlib.contextmanager
def raised() -> Iterator[None]:
    """Inside the block a signal raises Cancelled; while a module is loaded, as soon as that is done."""

    def stop(number: int, frame: FrameType | None) -> None:
        if not _is_importing(frame):
            raise Cancelled(number)
        again = threading.Timer(_AGAIN, os.kill, (os.getpid(), number))
        again.daemon = True
        again.start()

    with _handled(stop):
        yield


def _is_importing(frame: FrameType | None) -> bool:
    """USD's loader of modules drops exceptions, and goes on with half a module."""
    while frame and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None


class Signals:
    """A signal sets `number`; the work looks at it now and then."""

    def __init__(self) -> None:
        self.number = 0

    def _note(self, number: int, _frame: Any) -> None:
        self.number = number

    @contextlib.contextmanager
    def installed(self) -> Iterator[Signals]:
        """Notes the signals inside the block."""
        with _handled(self._note):
            yield self
