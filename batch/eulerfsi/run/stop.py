"""When a run stops before its last frame: a signal, or `--max-wall-seconds`."""

from __future__ import annotations

import math
import signal
import time

from ..errors import Cancelled, Unfinished, UsageError
from ..signals import Signals

_RESUME = "continue with --resume"


class Stop:
    """The reasons of one run; its clock starts here.

    max_wall_seconds: None for no limit; requeue: SIGTERM leads to the exit code that asks for another run.
    """

    def __init__(self, max_wall_seconds: float | None = None, requeue: bool = False) -> None:
        if max_wall_seconds is not None and not 0 < max_wall_seconds < math.inf:
            raise UsageError(f"--max-wall-seconds {max_wall_seconds:g}: must be a number > 0")
        self.signals = Signals()
        self._requeue, self._seconds = requeue, max_wall_seconds
        self._end = math.inf if max_wall_seconds is None else time.monotonic() + max_wall_seconds

    @property
    def by_signal(self) -> bool:
        """A signal has come."""
        return bool(self.signals.number)

    @property
    def out_of_time(self) -> bool:
        """The wall-clock time is used up."""
        return time.monotonic() >= self._end

    @property
    def is_due(self) -> bool:
        """The run shall stop."""
        return self.by_signal or self.out_of_time

    def error(self) -> Cancelled:
        """What ends the run."""
        if self.by_signal:
            return self.of_signal(Cancelled(self.signals.number, _RESUME))
        return Unfinished(f"stopped after {self._seconds:g} s by --max-wall-seconds; {_RESUME}")

    def of_signal(self, error: Cancelled) -> Cancelled:
        """The error of a signal, with the exit code that this run has for it."""
        if self._requeue and error.signal_number == signal.SIGTERM:
            return Unfinished(str(error))
        return error
