"""How steps gain by threads, stage by stage: measured at 1, 2, 4, ... threads, and what that says of more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .lines import step_seconds, threads_text

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


def seconds_of(result: Result) -> dict[str, float]:
    """Seconds per step: of each stage and in all."""
    profile = result["profile"]
    steps = max(profile["steps"], 1)
    return {**{stage: value / steps for stage, value in profile["seconds"].items()}, "in all": step_seconds(result)}


def serial_share(one: float, many: float, threads: int) -> float:
    """Share of the time on one thread that more threads do not shorten, by Amdahl: many = one (s + (1 - s) / threads).

    Memory that is no faster for more threads counts as such a share, too.
    """
    share = (many / one - 1 / threads) / (1 - 1 / threads)
    return min(max(share, 0.0), 1.0)


def waiting(one: float, many: float, threads: int) -> float:
    """Share of the threads' time in which they wait, or do slower what one thread does alone."""
    return max(0.0, 1 - one / (threads * many))


def rows(results: Mapping[int, Result]) -> list[dict[str, Any]]:
    """A row per stage and one for all: seconds per step by number of threads, gain, waiting, what MANY would gain."""
    measured = {count: seconds_of(result) for count, result in results.items()}
    most, one = max(measured), measured[1]
    out = []
    for stage, alone in one.items():
        if alone < NEGLIGIBLE * one["in all"]:
            continue
        row: dict[str, Any] = {"stage": stage}
        row |= {threads_text(count): values[stage] for count, values in measured.items()}
        row["gain"] = alone / measured[most][stage]
        row["waiting"] = waiting(alone, measured[most][stage], most)
        out.append(row)
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
    row: dict[str, Any] = {"stage": "triad"}
    row |= {threads_text(count): result["triad"] for count, result in results.items()}
    row["gain"] = results[1]["triad"] / results[max(results)]["triad"]
    row["waiting"] = waiting(results[1]["triad"], results[max(results)]["triad"], max(results))
    return row if max(results) >= MANY else {**row, FORETOLD: ""}
