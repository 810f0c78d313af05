"""How the transforms above a prim move it from one frame to another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from pxr import Gf, Usd, UsdGeom

from .pose import transform_drivers

RIGID = 1e-4  # by which a motion may stretch
_RATES = 4  # times within a frame at which the rate of a turn is looked at
_INSTANT = 1e-3  # of a frame: a turn in it is its rate


def frames_of(stage: Usd.Stage) -> list[float]:
    """Whole frames of the stage's range; its first time alone where it has none, or ends before it starts."""
    if not stage.HasAuthoredTimeCodeRange():
        return [1.0]
    first, last = math.ceil(stage.GetStartTimeCode()), math.floor(stage.GetEndTimeCode())
    return [float(frame) for frame in range(first, max(first, last) + 1)]


def key_frames(stage: Usd.Stage, attributes: Iterable[Usd.Attribute]) -> list[float]:
    """The first frame, and whole frames after it that show all that these attributes do, whatever is simulated.

    Those beside their time samples and halfway between two; of one that varies without samples those of the range.
    """
    first, *frames = frames_of(stage)
    found = set()
    for attribute in attributes:
        times = attribute.GetTimeSamples()
        if not times and attribute.ValueMightBeTimeVarying():
            found.update(frames)
        for before, time in zip([first, *times], times, strict=False):
            middle = float(round((before + time) / 2))
            found.update(
                (float(math.floor(time)), float(math.ceil(time)), *([middle] if before < middle < time else []))
            )
    return [first, *sorted(frame for frame in found if frame > first)]


def place_attributes(prim: Usd.Prim) -> Iterable[Usd.Attribute]:
    """Of the transforms that place a prim, its own and those above it."""
    while prim and not prim.IsPseudoRoot():
        xform = UsdGeom.Xformable(prim)
        yield from (operation.GetAttr() for operation in (xform.GetOrderedXformOps() if xform else ()))
        prim = None if xform and xform.GetResetXformStack() else prim.GetParent()


def places(prim: Usd.Prim, frames: Iterable[float]) -> Iterable[Gf.Matrix4d]:
    """Frame by frame from the prim's space into the world."""
    cache = UsdGeom.XformCache()  # one for all frames: what it finds once of each transform takes longer than its value
    for frame in frames:
        cache.SetTime(Usd.TimeCode(frame))
        yield cache.GetLocalToWorldTransform(prim)


def motions(prim: Usd.Prim, frames: Iterable[float], start: float) -> np.ndarray:
    """(frames, 4, 4) for row vectors: where each puts, in world space, what is in the world at the first frame."""
    before, *after = places(prim, [start, *frames])
    back = before.GetInverse()
    return np.array([np.array(back * place) for place in after]).reshape(-1, 4, 4)


def turns(prim: Usd.Prim, frames: Sequence[float]) -> np.ndarray:
    """(frames - 1,) angles [rad] by which its transform turns it from frame to frame, full turns included.

    What it does within a frame is the sum of its rates at a few times; where it is not rigid there, as between two
    matrices that USD mixes, its places in the frames are all that counts.
    """
    start, steps = frames[0], len(frames) - 1
    ends = motions(prim, frames, start)
    least = _angles(_rotation_vectors(ends[1:], ends[:-1]))
    within = (np.arange(_RATES) + 0.5) / _RATES
    times = (np.array(frames[:-1])[:, None] + within).ravel()
    before, after = (motions(prim, (times + sign * _INSTANT).tolist(), start) for sign in (-0.5, 0.5))
    rates = _rotation_vectors(after, before).reshape(steps, _RATES, 3) / (_INSTANT * _RATES)
    rigid = ~(stretched(before) | stretched(after)).reshape(steps, _RATES).any(axis=1)
    return np.maximum(least, np.where(rigid, _angles(rates.sum(axis=1)), 0.0))


def _rotation_vectors(after: np.ndarray, before: np.ndarray) -> np.ndarray:
    """(n, 3) axis times angle, at most half a turn, between motions (n, 4, 4)."""
    turn = np.einsum("nij,nik->njk", before[:, :3, :3], after[:, :3, :3])
    axis = 0.5 * np.stack([turn[:, i, j] - turn[:, j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
    sine, cosine = _angles(axis), 0.5 * (np.trace(turn, axis1=1, axis2=2) - 1.0)
    half = (sine < 1e-12) & (cosine < 0.0)  # about whatever axis
    axis[half], sine[half] = (1e-12, 0.0, 0.0), 1e-12
    return axis * (np.arctan2(sine, cosine) / np.where(sine > 0.0, sine, 1.0))[:, None]


def _angles(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt((vectors * vectors).sum(axis=1))


def motion_text(prim: Usd.Prim) -> str:
    """All values of the transforms that place a prim: equal texts are equal motions, whatever frames are simulated."""
    return "\n".join(
        f"{attribute.GetPath()} {time} {attribute.Get(time)}"
        for attribute in place_attributes(prim)
        for time in attribute.GetTimeSamples() or [Usd.TimeCode.Default()]
    )


def moves(prim: Usd.Prim) -> bool:
    """Whether its place in the world is animated."""
    return bool(transform_drivers(prim))


def first_change(prim: Usd.Prim, attributes: Iterable[Usd.Attribute]) -> tuple[str, str] | None:
    """Name of the first of these attributes that is not the same in all frames, and what it is; None: all are."""
    start, *frames = frames_of(prim.GetStage())
    for attribute in attributes:
        first = attribute.Get(start)
        for frame in frames if attribute.ValueMightBeTimeVarying() else ():
            now = attribute.Get(frame)
            if now is not None and np.array_equal(np.asarray(now), np.asarray(first)):
                continue
            value = f"{len(now or ())} values at frame {frame:g}, {len(first)} at frame {start:g}"
            return attribute.GetName(), value
    return None


def stretched(motions: np.ndarray) -> np.ndarray:
    """(n,) bool: which of the motions (n, 4, 4) are not rigid."""
    linear = motions[:, :3, :3]
    off = np.abs(linear @ linear.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    return ~((off <= RIGID) & (np.linalg.det(linear) > 0.0))
