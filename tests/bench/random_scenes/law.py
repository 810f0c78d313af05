"""What a law is: a name, a bar, and a function that judges one record or says why it does not apply."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .record import Record

DEPTH, DEPTH_AT_REST = 0.5, 0.25  # cells
REST_TIME, REST_SPEED = 0.1, 0.01  # s, of the fastest speed
TOUCHING = 0.5  # cells from a wall or a collider at which a body at rest lies on it
Verdict = tuple[float, float, float, str]  # measured, low, high, more
LAWS: dict[str, tuple[str, Callable[[Record], Verdict]]] = {}


class Moot(Exception):
    """The law says nothing about this record; the text says why."""


def rest(record: Record, gone: str = "it leaves through an open face") -> np.ndarray:
    """(steps,) which steps are the last REST_TIME. Raises Moot where a solid moves then or has left the box."""
    if not record.whole[-1]:
        raise Moot(gone)
    late = record.times[1:] >= record.times[-1] - REST_TIME
    speeds = np.max([np.linalg.norm(solid.velocity[1:], axis=1) for solid in record.solids], axis=0)
    if record.times[-1] < 2 * REST_TIME or (speeds[late] > REST_SPEED * record.scene.fastest).any():
        raise Moot("not at rest in the end")
    return late


def of_each(judge: Callable[[Record], Verdict]) -> Callable[[Record], Verdict]:
    """The worst verdict over the solids; moot where it is for all."""

    def worst(record: Record) -> Verdict:
        verdicts, reasons = [], []
        for number, solid in enumerate(record.solids, 1):
            try:
                measured, low, high, more = judge(solid)
            except Moot as reason:
                reasons.append(reason)
                continue
            where = f"solid {number}, {more}" if len(record.solids) > 1 else more
            verdicts.append((measured, low, high, where))
        if not verdicts:
            raise reasons[0]
        return max(verdicts, key=lambda v: max(v[1] - v[0], v[0] - v[2]) if np.isfinite(v[0]) else np.inf)

    return worst


def of_one(judge: Callable[[Record], Verdict]) -> Callable[[Record], Verdict]:
    """Moot where another solid can disturb what it looks at."""

    def alone(record: Record) -> Verdict:
        if len(record.solids) > 1:
            raise Moot("several solids")
        return judge(record)

    return alone


def law(name: str, bar: str) -> Callable[[Callable[[Record], Verdict]], Callable[[Record], Verdict]]:
    def keep(judge: Callable[[Record], Verdict]) -> Callable[[Record], Verdict]:
        LAWS[name] = (bar, judge)
        return judge

    return keep
