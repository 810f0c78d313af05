"""How steps gain by threads, stage by stage: measured at 1, 2, 4, ... threads, and what that says of more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .lines import stage_seconds, step_seconds, threads_text

MANY = 16  # threads that are spoken of on machines that have fewer
FORETOLD = f"gain of {MANY}, foretold"
NEGLIGIBLE = 0.005  # of a step: stages below it have no row

Result = dict[str, Any]


def counts(processors: int) -> list[int]:
    """1, 2, 4, ... up to the number of processors, two at least."""
    out = [1, 2]
    while 2 * out[-1] <= processors:
        out.append(2 * out[-1])
    return out


def serial_share(one: float, many: float, threads: int) -> float:
    """Share of the time on one thread that more threads do not shorten, by Amdahl: many = one (s + (1 - s) / threads).

    Memory that is no faster for more threads counts as such a share, too.
    """
    share = (many / one - 1 / threads) / (1 - 1 / threads)
    return min(max(share, 0.0), 1.0)


def waiting(one: float, many: float, threads: int) -> float:
    """Share of the threads' time in which they wait, or do slower what one thread does alone."""
    return max(0.0, 1 - one / (threads * many))


def row_of(stage: str, seconds: Mapping[int, float]) -> dict[str, Any]:
    """Seconds by number of threads, and what the most gain and wait."""
    most = max(seconds)
    row: dict[str, Any] = {"stage": stage, **{threads_text(count): value for count, value in seconds.items()}}
    return {**row, "gain": seconds[1] / seconds[most], "waiting": waiting(seconds[1], seconds[most], most)}


def rows(results: Mapping[int, Result]) -> list[dict[str, Any]]:
    """A row per stage and one for all: seconds per step by number of threads, gain, waiting, what MANY would gain."""
    measured = {count: {**stage_seconds(result), "in all": step_seconds(result)} for count, result in results.items()}
    most, one = max(measured), measured[1]
    out = [
        row_of(stage, {count: values[stage] for count, values in measured.items()})
        for stage, alone in one.items()
        if alone >= NEGLIGIBLE * one["in all"]
    ]
    if most >= MANY:
        return out
    # The step is the sum of its stages, each of which has a share of its own.
    ahead = {}
    for row in out[:-1]:
        share = serial_share(one[row["stage"]], measured[most][row["stage"]], most)
        ahead[row["stage"]] = one[row["stage"]] * (share + (1 - share) / MANY)
        row[FORETOLD] = one[row["stage"]] / ahead[row["stage"]]
    listed = sum(one[stage] for stage in ahead)
    out[-1][FORETOLD] = listed / sum(ahead.values())
    return out


def triad_row(results: Mapping[int, Result]) -> dict[str, Any]:
    """The triad beside them: what memory gains by threads; nothing is foretold of it."""
    row = row_of("triad", {count: result["triad"] for count, result in results.items()})
    return row if max(results) >= MANY else {**row, FORETOLD: ""}
