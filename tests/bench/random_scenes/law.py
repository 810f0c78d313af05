"""What a law is: a name, a bar, and a function that judges one record or says why it does not apply."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .record import Record

Verdict = tuple[float, float, float, str]  # measured, low, high, more
LAWS: dict[str, tuple[str, Callable[[Record], Verdict]]] = {}


class Moot(Exception):
    """The law says nothing about this record; the text says why."""


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
