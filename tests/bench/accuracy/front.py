"""The front of error against processor time: rows that none is better than in both; what became worse since a table."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Sequence

from .table import SOLVER, Row

MORE_ERROR, MORE_TIME, SPREADS = 0.02, 0.05, 3.0  # what counts as worse; spreads of repeats


def measured(rows: Sequence[Row]) -> list[Row]:
    """Rows with both an error and a time."""
    return [row for row in rows if row.error is not None and row.core_s is not None and not row.failure]


def front(rows: Sequence[Row]) -> list[Row]:
    """Rows that no other is at least as good as in both and better in one, the fastest first."""
    out: list[Row] = []
    for row in sorted(measured(rows), key=lambda r: (r.core_s, r.error)):
        if not out or row.error < out[-1].error:
            out.append(row)
    return out


def by_case(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of each case, in order."""
    out: dict[str, list[Row]] = {}
    for row in rows:
        out.setdefault(row.case, []).append(row)
    return out


def newest(rows: Sequence[Row]) -> list[Row]:
    """The solver's rows, of each case those of the commit and machine of its last row, seed 0, first repeats; and the
    peers'."""
    own = [row for row in rows if row.solver == SOLVER]
    last = {row.case: (row.commit, row.machine) for row in own}
    kept = [row for row in own if (row.commit, row.machine) == last[row.case] and row.seed == 0 and row.repeat == 1]
    return kept + [row for row in rows if row.solver != SOLVER]


def name_of(row: Row) -> str:
    """A run in words."""
    parts = [row.case, f"{row.cells:g} cells", row.preset or row.solver]
    parts += [row.step] if row.step != "default" else []
    parts += [f"tolerance {row.tolerance:g}"] if row.tolerance is not None else []
    parts += [f"seed {row.seed}"] if row.seed else []
    return ", ".join(parts)


@dataclasses.dataclass
class Comparison:
    """lines: what to print; worse: whether a bar is broken."""

    lines: list[str]
    worse: bool


def compare(before: Sequence[Row], now: Sequence[Row]) -> Comparison:
    """The front of an earlier table beside the same runs now. Both with errors (`fit.with_errors`)."""
    lines: list[str] = []
    here = {(row.machine, row.commit.partition("+")[0]) for row in now}
    there = {(row.machine, row.commit.partition("+")[0]) for row in before if row.solver == SOLVER}
    timed = bool(here) and there == here
    if not timed:
        lines.append("another machine or commit: errors, steps and iterations are compared, times are not")
    cases, worse = by_case([row for row in now if row.solver == SOLVER]), False
    for case, rows in by_case([row for row in before if row.solver == SOLVER and row.repeat == 1]).items():
        if case not in cases:
            continue
        new_front = front(cases[case])
        for old in front(rows):
            same = [row for row in cases[case] if row.identity == old.identity]
            if not same:
                lines.append(f"{name_of(old)}: was not made now")
                continue
            found, broken = changes(old, same, timed)
            worse = worse or broken
            better = [r for r in new_front if timed and dominates(r, same[0]) and r.identity != old.identity]
            if not found and better:
                found = [f"dominated by {name_of(better[0])}"]
            lines += [f"{name_of(old)}: {text}" for text in found]
    return Comparison(lines, worse)


def dominates(one: Row, other: Row) -> bool:
    """At least as good in both, better in one."""
    if None in (one.error, one.core_s, other.error, other.core_s):
        return False
    return (
        one.error <= other.error
        and one.core_s <= other.core_s
        and (one.error, one.core_s)
        != (
            other.error,
            other.core_s,
        )
    )


def changes(old: Row, same: Sequence[Row], timed: bool) -> tuple[list[str], bool]:
    """What is worse than in `old` in words, and whether a bar is broken. same: the repeats of that run now."""
    new = same[0]
    if new.failure or new.error is None:
        return [f"it fails now: {new.failure or 'no error was found'}"], True
    found, broken = [], False
    if new.error > old.error * (1 + MORE_ERROR) + 1e-12:
        found.append(f"error {old.error:.4g} -> {new.error:.4g}")
        broken = True
    if timed:
        times = [row.core_s for row in same if row.core_s is not None]
        spread = statistics.stdev(times) if len(times) > 2 else 0.0
        time = statistics.median(times)
        if time - old.core_s > max(MORE_TIME * old.core_s, SPREADS * spread):
            found.append(f"core seconds {old.core_s:.4g} -> {time:.4g} (spread {spread:.2g})")
            broken = True
    else:
        for name in ("steps", "velocity_iterations", "pressure_iterations"):
            was, now = getattr(old, name), getattr(new, name)
            if now > was * (1 + MORE_TIME) + 1:
                found.append(f"{name.replace('_', ' ')} {was} -> {now}")
    return found, broken
