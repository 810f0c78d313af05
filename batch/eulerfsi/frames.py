"""Frame ranges: what `--frames` accepts, and how files are numbered."""

from __future__ import annotations

import dataclasses

import fileseq

from .errors import UsageError

MOST_FRAMES = 1_000_000


@dataclasses.dataclass(frozen=True)
class FrameRange:
    """Whole frames first..last, both included. Frame f shows the time (f - first)/fps."""

    first: int
    last: int

    def __len__(self) -> int:
        return self.last - self.first + 1

    def __iter__(self):
        return iter(range(self.first, self.last + 1))

    def __str__(self) -> str:
        return f"{self.first}-{self.last}"


def file_number(frame: int) -> str:
    """The frame in names of files, as USD's value clips (C's %04d) expand ####: 0012, -003."""
    return f"{frame:04d}"


def parse_frames(text: str) -> FrameRange:
    """Reads `a-b` (fileseq syntax). A simulation needs every frame, so steps and gaps are refused.

    Raises UsageError with the text, the fault and what to write instead.
    """
    where = f"--frames {text!r}"
    if ":" in text:
        raise UsageError(
            f"{where}: ':' means a stagger in one convention and a step in another, and a simulation needs every "
            "frame; write first-last, for example 1-48"
        )
    if "x" in text or "y" in text:
        raise UsageError(f"{where}: a step leaves frames out, and a simulation needs every frame; write first-last")
    try:
        frames = [int(f) for f in fileseq.FrameSet(text)] if "." not in text else []
    except ValueError:
        frames = []
    if not frames:
        raise UsageError(f"{where}: not a frame range; write first-last with whole numbers, for example 1-48")
    if frames != list(range(frames[0], frames[-1] + 1)):
        if frames == sorted(frames, reverse=True):
            raise UsageError(f"{where}: runs backwards; write {frames[-1]}-{frames[0]}")
        missing = sorted(set(range(min(frames), max(frames) + 1)) - set(frames))
        gap = f"frame {missing[0]} is missing" if missing else "frames are out of order"
        raise UsageError(f"{where}: not contiguous ({gap}); write {min(frames)}-{max(frames)}")
    return check_frames(FrameRange(frames[0], frames[-1]), where)


def demand_start(wanted: FrameRange, first: int, checkpoint: int | None) -> None:
    """Raises UsageError when frames are wanted that nothing leads up to.

    first: where the simulation starts; checkpoint: frame of the cache's checkpoint that it goes on from, None for none:
    what comes before that is in the cache.
    """
    if wanted.first <= first or checkpoint is not None:
        return
    raise UsageError(
        f"--frames {wanted}: the simulation starts at frame {first}, and there is no checkpoint before frame "
        f"{wanted.first} to continue from: write --frames {first}-{wanted.last}, or --start-frame {wanted.first} to "
        "start there, or --resume with the folder (-o) of a cache that reaches it"
    )


def check_frames(frames: FrameRange, where: str) -> FrameRange:
    """Limits of every range: forwards, two frames at least, not more than any film has."""
    if frames.last < frames.first:
        raise UsageError(f"{where}: the last frame {frames.last} comes before the first, {frames.first}")
    if frames.last - frames.first >= MOST_FRAMES:  # len() of more than 2^63 fails
        raise UsageError(f"{where}: {frames.last - frames.first + 1} frames: must be at most {MOST_FRAMES}")
    if len(frames) < 2:
        raise UsageError(f"{where}: {len(frames)} frame; a cache needs at least 2 (the first is the initial state)")
    return frames
