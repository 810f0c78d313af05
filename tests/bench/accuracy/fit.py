"""Observed orders, and errors of cases without a closed form: all from rows of the table."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence

import numpy as np

from .table import Row

LEAST, MOST = 0.1, 6.0  # orders that are looked for
ROUNDING = 1e-4  # errors below it are single precision's


def slope(sizes: Sequence[float], errors: Sequence[float]) -> float | None:
    """Order p of errors C size^p, by least squares of the logarithms; None for fewer than two or an error of 0."""
    pairs = [(s, abs(e)) for s, e in zip(sizes, errors, strict=True) if e]
    if len(pairs) < 2 or len(pairs) < len(sizes):
        return None
    logs = np.log(np.array(pairs))
    return float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])


def monotone(values: Sequence[float]) -> bool:
    """Whether they only fall or only rise: others follow no power."""
    return list(values) in (sorted(values), sorted(values, reverse=True))


def limit(sizes: Sequence[float], values: Sequence[float]) -> tuple[float, float] | None:
    """(value at size 0, order) of value = v + C size^p through three runs; None where they do not converge so."""
    if len(sizes) != 3:
        return None
    (a, va), (b, vb), (c, vc) = sorted(zip(sizes, values, strict=True), reverse=True)
    if va == vb or vb == vc or (va - vb) * (vb - vc) <= 0:
        return None
    wanted = (va - vb) / (vb - vc)
    ratio = lambda p: (a**p - b**p) / (b**p - c**p)  # noqa: E731 - grows with p
    low, high = LEAST, MOST
    if not ratio(low) <= wanted <= ratio(high):
        return None
    for _ in range(80):
        p = (low + high) / 2
        low, high = (p, high) if ratio(p) < wanted else (low, p)
    factor = (vb - vc) / (b**p - c**p)
    return vc - factor * c**p, p


@dataclasses.dataclass(frozen=True)
class Orders:
    """Of a case: p in h and dt. None: no power, or not three runs; rounding: errors are those of single precision."""

    h: float | None = None
    dt: float | None = None
    rounding: bool = False
    limit: float | None = None  # Richardson's, where there is no closed form
    cost: float | None = None  # core seconds grow with 1/h to this power


def resolution(rows: Sequence[Row]) -> list[Row]:
    """The sweep over resolutions of the solver's default, by cells; first repeats, of the parameters with most runs."""
    found = [
        r
        for r in rows
        if r.sweep == "resolution" and r.step == "default" and r.tolerance is None and not r.failure and r.repeat == 1
    ]
    kinds = [r.parameters for r in found]
    return sorted((r for r in found if r.parameters == max(kinds, key=kinds.count)), key=lambda r: r.cells)


def divided(rows: Sequence[Row]) -> tuple[list[float], list[Row]]:
    """Steps over the default and their rows, at the resolution that was swept: dt, dt/2, dt/4."""
    swept = [r for r in rows if r.sweep == "step" and r.step.startswith("dt/") and not r.failure and r.repeat == 1]
    if not swept:
        return [], []
    swept += [r for r in resolution(rows) if r.cells == swept[0].cells]
    size = {id(r): 1.0 if r.step == "default" else 1.0 / float(r.step[3:]) for r in swept}
    swept.sort(key=lambda r: -size[id(r)])
    return [size[id(r)] for r in swept], swept


def orders(rows: Sequence[Row]) -> Orders:
    """Of one case, from its own rows. rows: of one case, seed, commit and machine."""
    by_h = resolution(rows)
    sizes = [1.0 / r.cells for r in by_h]
    cost = slope([1.0 / s for s in sizes], [r.core_s or 0.0 for r in by_h]) if len(by_h) > 1 else None
    steps, by_dt = divided(rows)
    closed = bool(by_h) and all(r.reference is not None for r in by_h)
    rounding = closed and bool(by_h) and max(r.error or 0.0 for r in by_h) < ROUNDING
    if closed:
        errors = [r.error or 0.0 for r in by_h]
        p = None if rounding or len(by_h) < 3 or not monotone(errors) else slope(sizes, errors)
        end = None
    else:
        found = limit(sizes, [r.value for r in by_h]) if by_h else None
        end, p = found or (None, None)
    in_dt = limit(steps, [r.value for r in by_dt]) if len(by_dt) == 3 and not rounding else None
    return Orders(p, in_dt[1] if in_dt else None, rounding, end, cost)


def with_errors(rows: Sequence[Row]) -> list[Row]:
    """The rows, those without a reference with an error: against Richardson's limit, or the finest run's.

    Where the resolutions do not converge the finest one is the reference, and its own error is not known.
    """
    groups: dict[tuple, list[Row]] = {}
    for row in rows:
        groups.setdefault((row.case, row.seed, row.parameters, row.commit, row.machine), []).append(row)
    return [filled(row, groups[(row.case, row.seed, row.parameters, row.commit, row.machine)]) for row in rows]


def filled(row: Row, company: Sequence[Row]) -> Row:
    """A row with its error; company: rows of the same case, parameters, commit and machine."""
    if row.error is not None or row.failure or row.value is None:
        return row
    by_h = resolution([r for r in company if r.solver == "eulerfsi" or row.solver != "eulerfsi"])
    if not by_h:
        return row
    if (finest := json.loads(by_h[-1].numbers).get("centers")) is not None:
        own = json.loads(row.numbers).get("centers", [])
        same = row.identity == by_h[-1].identity
        return row if same or len(own) != len(finest) else dataclasses.replace(row, error=distance(own, finest))
    found = limit([1.0 / r.cells for r in by_h], [r.value for r in by_h])
    if found:
        return dataclasses.replace(row, error=abs(row.value / found[0] - 1))
    if row.identity == by_h[-1].identity or not by_h[-1].value:
        return row
    norm = row.norm.replace("Richardson's limit", "the finest run")
    return dataclasses.replace(row, error=abs(row.value / by_h[-1].value - 1), norm=norm)


def distance(points: Sequence[float], others: Sequence[float]) -> float:
    """Mean distance of points, x y z after x y z."""
    away = np.reshape(points, (-1, 3)) - np.reshape(others, (-1, 3))
    return float(np.linalg.norm(away, axis=1).mean())


def text(value: float | None) -> str:
    """An order for a table."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.2g}"
