"""Rows in words: one run, and a table of the cases with their observed orders."""

from __future__ import annotations

import json
from collections.abc import Sequence

from loop.table import markdown, text

from . import fit, front, sweep
from .table import SOLVER, Row


def line(row: Row) -> str:
    """One run as it is printed."""
    head = f"{front.name_of(row)}: "
    if row.failure:
        return f"{head}failed: {row.failure}"
    error = f"value {row.value:.5g}" if row.error is None else f"error {row.error:.3g}"
    numbers = json.loads(row.numbers)
    kept = ", ".join(f"{k} {v:.4g}" for k, v in numbers.items() if isinstance(v, (int, float)))
    cost = f"{row.core_s:.3g} core s, {row.steps} steps"
    return head + "; ".join(filter(None, [f"{error} ({row.norm})", kept, cost])) + (" [loaded]" if row.loaded else "")


def cells(rows: Sequence[Row]) -> dict[str, str]:
    """The line of one case. rows: of one case, with errors."""
    own = [row for row in rows if row.solver == SOLVER]
    by_h, order = fit.resolution(own), fit.orders(own)
    errors = ["-" if row.error is None else f"{row.error:.2g}" for row in by_h]
    failed = sum(bool(row.failure) for row in own)
    return {
        "case": rows[0].case,
        "cells": " / ".join(f"{row.cells:.3g}" for row in by_h),
        "error": " / ".join(errors) + (" (rounding)" if order.rounding else ""),
        "norm": by_h[0].norm if by_h else "",
        "core s": " / ".join(f"{row.core_s:.2g}" for row in by_h),
        "order in h": fit.text(order.h),
        "order in dt": fit.text(order.dt),
        "limit": fit.text(order.limit) if order.limit is None else f"{order.limit:.4g}",
        "cost, power of 1/h": fit.text(order.cost),
        "failed": str(failed) if failed else "",
    }


def summary(rows: Sequence[Row]) -> list[str]:
    """The cases as lines of a table."""
    lines = [cells(of_case) for of_case in front.by_case(rows).values()]
    return ["", text(lines)] if lines else []


def document(rows: Sequence[Row]) -> str:
    """The same as a Markdown file, a table a group, with the three worst; of rows as `front.newest` gives them."""
    _, cases = sweep.load()
    own = [row for row in rows if row.solver == SOLVER]
    loaded = sum(row.loaded for row in own)
    commits = ", ".join(dict.fromkeys(row.commit for row in own))
    machines = "; ".join(dict.fromkeys(row.machine for row in own))
    parts = [
        "# Error against run time",
        f"`./eulerfsi bench accuracy`; solver of commit {commits}; {machines}, one thread; {len(own)} runs, "
        f"{loaded} of them beside others that kept more than half a processor busy. Three "
        "resolutions each at the default step; [columns and cases](../accuracy/README.md), "
        "[what they show](../../../docs/accuracy.md).",
    ]
    by_case = front.by_case(own)
    for group in dict.fromkeys(case.group for case in cases.values()):
        lines = [cells(by_case[name]) for name, case in cases.items() if case.group == group and name in by_case]
        if lines:
            parts += [f"## {group}", markdown(lines, lines[0])]
    parts.append("Largest errors of the finest runs: " + "; ".join(line(row) for row in worst(own)) + ".")
    return "\n\n".join(parts) + "\n"


def worst(rows: Sequence[Row], count: int = 3) -> list[Row]:
    """The runs at the default with the largest errors, one a case."""
    found = {case: fit.resolution(of_case) for case, of_case in front.by_case(rows).items()}
    finest = [by_h[-1] for by_h in found.values() if by_h and by_h[-1].error is not None]
    return sorted(finest, key=lambda row: -(row.error or 0.0))[:count]
