"""How far a command is: a bar on a terminal, plain lines for farms, events for programs (docs/progress.md)."""

from __future__ import annotations

import abc
import contextlib
import json
import os
import re
import sys
import time
from collections.abc import Iterator
from typing import Any, TextIO

from tqdm import tqdm

from . import __version__, errors
from .frames import FrameRange
from .say import say

MODES = ("auto", "plain", "json", "openjd", "alf", "none")
EVENTS_VERSION = 1
_APART = 1.0  # seconds between two events `step`, and between two lines of one work


class Progress:
    """One command, from its start to its end; tells only what work takes longer than a second.

    frames: those of the run, once it has started; last_frame: the last one on disk.
    """

    def __init__(self, out: TextIO | None = None, err: TextIO | None = None) -> None:
        self.out, self.err = out or sys.stdout, err or sys.stderr
        self.frames = FrameRange(0, 0)
        self.last_frame: int | None = None

    @contextlib.contextmanager
    def told(self) -> Iterator[Progress]:
        """Tells how the block ends."""
        try:
            yield self
        except BaseException as error:
            self.error(error)
            stopped = isinstance(error, KeyboardInterrupt)
            self.end("interrupted" if stopped else "failed", errors.exit_code(error), errors.describe(error))
            raise
        self.end("complete", errors.EXIT_OK, None)

    def waiting(self, what: str, prim: str, fraction: float) -> None:
        """A part 0..1 of some work before the first step is done."""
        say(f"{prim}: {what}, {100 * fraction:.0f} %", self.err)

    def warning(self, message: str, code: str, prim: str, field: str, **facts: float) -> None:
        """Something is wrong that the run survives. code: name of the rule; prim, field: "" for none.

        facts: value, limit and frame of a condition (docs/warnings.md).
        """

    def start(self, command: str, frames: FrameRange, done: int, **facts: Any) -> None:
        """The scene is read; `done` of its frames are present already."""
        self.frames = frames
        if done:
            self.last_frame = frames.first + done - 1

    def between_steps(self, frame: int, fraction: float, seconds: float) -> None:
        """Inside frame `frame`, with `fraction` of it done. seconds: simulated so far."""

    def frame_done(self, frame: int, **facts: Any) -> None:
        """Frame `frame` is on disk."""
        self.last_frame = frame

    def error(self, error: BaseException) -> None:
        """The command ends with an error."""

    def end(self, status: str, exit_code: int, error: str | None) -> None:
        """The command is over."""


class _Percent(Progress, abc.ABC):
    """A line whenever the whole percent changes."""

    _percent = -1

    def between_steps(self, frame: int, fraction: float, seconds: float) -> None:
        done = frame - self.frames.first + min(max(fraction, 0.0), 1.0)
        percent = int(100 * done / len(self.frames))
        if percent > self._percent:
            self._percent = percent
            self._tell(percent, frame)

    def frame_done(self, frame: int, **facts: Any) -> None:
        super().frame_done(frame)
        self.between_steps(frame, 1.0, 0.0)

    @abc.abstractmethod
    def _tell(self, percent: int, frame: int) -> None:
        """Writes the line."""


class _Plain(_Percent):
    """Lines "25% frame 12 of 1-48"."""

    def _tell(self, percent: int, frame: int) -> None:
        say(f"{percent}% frame {frame} of {self.frames}", self.out)


class _Alf(_Percent):
    """Lines "ALF_PROGRESS 25%", as Alfred and Tractor read them."""

    def _tell(self, percent: int, frame: int) -> None:
        say(f"ALF_PROGRESS {percent}%", self.out)


class _OpenJd(_Percent):
    """Lines that a session of Open Job Description reads: progress, status, and why the run has failed."""

    def start(self, command: str, frames: FrameRange, done: int, **facts: Any) -> None:
        super().start(command, frames, done)
        self._status(f"{command}: {done} of {len(frames)} frames are done")

    def frame_done(self, frame: int, **facts: Any) -> None:
        super().frame_done(frame)
        self._status(f"frame {frame} of {self.frames} is done")

    def end(self, status: str, exit_code: int, error: str | None) -> None:
        text = " ".join((error or "").split())
        if status == "failed":
            say(f"openjd_fail: {text}", self.out)
        else:
            self._status(text or status)

    def _status(self, text: str) -> None:
        say(f"openjd_status: {text}", self.out)

    def _tell(self, percent: int, frame: int) -> None:
        say(f"openjd_progress: {percent}", self.out)


class _Bar(Progress):
    """A bar on standard error."""

    _bar: tqdm | None = None

    def start(self, command: str, frames: FrameRange, done: int, **facts: Any) -> None:
        super().start(command, frames, done)
        self._bar = tqdm(total=len(frames), initial=done, unit="frame", file=sys.stderr, dynamic_ncols=True)

    def between_steps(self, frame: int, fraction: float, seconds: float) -> None:
        self._bar.set_postfix_str(f"frame {frame}, {100 * fraction:.0f}%")

    def frame_done(self, frame: int, **facts: Any) -> None:
        super().frame_done(frame)
        self._bar.update(1)

    def end(self, status: str, exit_code: int, error: str | None) -> None:
        if self._bar is not None:
            self._bar.close()


class _Json(Progress):
    """Events, an object a line, as docs/progress.schema.json has them."""

    def __init__(self, out: TextIO | None = None, err: TextIO | None = None) -> None:
        super().__init__(out, err)
        self._begun = self._since = time.monotonic()  # of the command, and of the frame that is simulated
        self._next = 0.0  # when a `step` may be told
        self._done = 0  # frames that this command has simulated
        self._seconds = 0.0  # that they took, of the n-th n times

    def waiting(self, what: str, prim: str, fraction: float) -> None:
        super().waiting(what, prim, fraction)
        self._tell("waiting", what=what, prim=prim, fraction=fraction)

    def warning(self, message: str, code: str, prim: str, field: str, **facts: float) -> None:
        self._tell("warning", **finding(message, code, prim, field), **facts)

    def start(self, command: str, frames: FrameRange, done: int, **facts: Any) -> None:
        super().start(command, frames, done)
        self._since = time.monotonic()
        versions = {"version": EVENTS_VERSION, "program": __version__, "host": os.uname().nodename}
        numbers = {"first": frames.first, "last": frames.last, "done": done}
        self._tell("start", **versions, command=command, **numbers, **facts)

    def between_steps(self, frame: int, fraction: float, seconds: float) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _APART
            self._tell("step", frame=frame, fraction=fraction, time=seconds, eta=self._eta(frame - 1, fraction))

    def frame_done(self, frame: int, **facts: Any) -> None:
        super().frame_done(frame)
        now = time.monotonic()
        if frame > self.frames.first:  # what comes before the first step is no pace
            self._done += 1
            self._seconds += self._done * (now - self._since)
        self._since = now
        percent = 100 * (frame - self.frames.first + 1) // len(self.frames)
        self._tell("frame", frame=frame, percent=percent, **facts, elapsed=self._elapsed(), eta=self._eta(frame))

    def error(self, error: BaseException) -> None:
        for facts in findings(error):
            self._tell("error", **facts)

    def end(self, status: str, exit_code: int, error: str | None) -> None:
        facts = {"last_frame": self.last_frame, "elapsed": self._elapsed(), "error": error}
        self._tell("end", status=status, exit_code=exit_code, **facts)

    def _elapsed(self) -> float:
        """Seconds since the command began."""
        return round(time.monotonic() - self._begun, 3)

    def _eta(self, frame: int, fraction: float = 0.0) -> float | None:
        """Seconds until the last frame, of which `frame` and a part of the next are done, at the pace of the frames so
        far: the n-th counts n times, since those to come are more like the last ones. None: nothing was simulated."""
        seconds = self._seconds + (self._done + 1) * (time.monotonic() - self._since)
        weight = (self._done + 1) * (self._done / 2 + fraction)  # 1 + 2 + ..., and that part of the next
        return round((self.frames.last - frame - fraction) * seconds / weight, 2) if weight > 0 else None

    def _tell(self, event: str, **facts: Any) -> None:
        say(json.dumps({"event": event, **facts}), self.out)


def finding(message: str, code: str, prim: str, field: str) -> dict[str, Any]:
    """A warning or an error for programs, the code of its rule in the style of the other names: thin_feature."""
    code = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", code).lower()
    return {"code": code, "prim": prim or None, "field": field or None, "message": message}


def findings(error: BaseException) -> list[dict[str, Any]]:
    """An error for programs: what a check has found, else the exit code's word and the message."""
    found = [finding(i.message, i.code, i.prim, i.field) for i in getattr(error, "issues", ())]
    word, _ = errors.EXIT_CODES[errors.exit_code(error)]
    prim, field = (getattr(error, name, "") for name in ("prim", "field"))
    return found or [finding(errors.describe(error), word, prim, field)]


_KINDS = {"plain": _Plain, "bar": _Bar, "json": _Json, "openjd": _OpenJd, "alf": _Alf, "none": Progress}


def make_progress(mode: str, out: TextIO | None = None) -> Progress:
    """mode: one of MODES; auto is a bar on a terminal and plain lines elsewhere."""
    if mode == "auto":
        mode = "bar" if sys.stderr.isatty() and (out or sys.stdout).isatty() else "plain"
    return _KINDS[mode](out)


class Waiting:
    """Work that may take longer than a second: from then on it is told how far it is, at most once a second."""

    def __init__(self, progress: Progress, what: str, prim: str) -> None:
        self._progress, self._what, self._prim = progress, what, prim
        self._next = time.monotonic() + _APART

    def at(self, fraction: float) -> None:
        """A part 0..1 of the work is done."""
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _APART
            self._progress.waiting(self._what, self._prim, fraction)
