"""How far a run is: a bar on a terminal, plain lines for farms, JSON lines for programs."""

from __future__ import annotations

import json
import sys
import time
from typing import Any, TextIO

from tqdm import tqdm

from .frames import FrameRange
from .say import say

MODES = ("auto", "plain", "json", "none")


class Waiting:
    """Tells how far work is that takes longer than a second: "/World/Bunny: examining the surface, 35 %".

    At most one line a second, on `err` (standard error).
    """

    def __init__(self, what: str, err: TextIO | None = None) -> None:
        self._what, self._err, self._next = what, err or sys.stderr, time.monotonic() + 1

    def at(self, fraction: float) -> None:
        """A part 0..1 of the work is done."""
        now = time.monotonic()
        if now >= self._next:
            self._next = now + 1
            say(f"{self._what}, {100 * fraction:.0f} %", self._err)


class Progress:
    """Reports frames of one run. mode: one of MODES; auto is a bar on a terminal and plain lines elsewhere.

    plain: "25% frame 12 of 1-48", a new line whenever the whole percent changes. json: one object per event, "event"
    being start, frame or end. Everything goes to `out`, flushed; a bar goes to standard error.
    """

    def __init__(self, mode: str, frames: FrameRange, out: TextIO | None = None) -> None:
        self.out = out or sys.stdout
        self.frames = frames
        self.mode = ("bar" if sys.stderr.isatty() and self.out.isatty() else "plain") if mode == "auto" else mode
        self._percent = -1
        self._bar: tqdm | None = None

    def start(self, done: int, **facts: Any) -> None:
        """Begins with `done` frames present already."""
        if self.mode == "json":
            self._json(event="start", first=self.frames.first, last=self.frames.last, done=done, **facts)
        elif self.mode == "bar":
            self._bar = tqdm(total=len(self.frames), initial=done, unit="frame", file=sys.stderr, dynamic_ncols=True)

    def between_steps(self, frame: int, fraction: float) -> None:
        """Inside frame `frame`, with `fraction` of it done."""
        if self.mode == "plain":
            self._plain(frame, fraction)
        elif self._bar is not None:
            self._bar.set_postfix_str(f"frame {frame}, {100 * fraction:.0f}%")

    def frame_done(self, frame: int, **facts: Any) -> None:
        """Frame `frame` is on disk."""
        if self.mode == "json":
            percent = 100 * (frame - self.frames.first + 1) // len(self.frames)
            self._json(event="frame", frame=frame, percent=percent, **facts)
        elif self.mode == "plain":
            self._plain(frame, 1.0)
        elif self._bar is not None:
            self._bar.update(1)

    def end(self, status: str, **facts: Any) -> None:
        """The run is over."""
        if self._bar is not None:
            self._bar.close()
        if self.mode == "json":
            self._json(event="end", status=status, **facts)

    def _plain(self, frame: int, fraction: float) -> None:
        done = frame - self.frames.first + min(max(fraction, 0.0), 1.0)
        percent = int(100 * done / len(self.frames))
        if percent > self._percent:
            self._percent = percent
            self._print(f"{percent}% frame {frame} of {self.frames}")

    def _json(self, **event: Any) -> None:
        self._print(json.dumps(event))

    def _print(self, line: str) -> None:
        if not say(line, self.out):
            self.mode = "none"
