"""The survival matrix: shapes x resolutions x steps x density ratios x walls.

Solids are thrown with spin at the floor, light ones at the ceiling, and drift to a side wall.
"""

from __future__ import annotations

import itertools

import numpy as np

from .energy_laws import CLOSES, MOST_RISE, share_of_gap, share_of_rise
from .experiment import FRAME, GRAVITY, Experiment
from .laws import Line, Results, conditions, found, out_of_bounds, resolved
from .measure import Result, extremes
from .shapes import SHAPES

FACTORS: tuple[tuple, ...] = (
    SHAPES,
    (1000.0, 10.0, 1.3, 0.5, 0.1),  # density solid : fluid
    (FRAME, 1 / 120, 1 / 480),  # largest step [s]
    (0.3, 1.8, 3.0),  # CFL
    ("slip", "noSlip", "open"),  # open: the wall that the solid moves away from; the others slip
)


def pairwise(factors: tuple[tuple, ...]) -> list[tuple]:
    """Few rows in which every two values of different factors meet; greedy, the same at every call."""
    rows = list(itertools.product(*factors))
    pairs = lambda row: {(i, row[i], j, row[j]) for i, j in itertools.combinations(range(len(row)), 2)}  # noqa: E731
    of_row = {row: pairs(row) for row in rows}
    missing, chosen = set().union(*of_row.values()), []
    while missing:
        best = max(rows, key=lambda row: len(of_row[row] & missing))
        chosen.append(best)
        missing -= of_row[best]
    return chosen


def survival_runs(tier: str) -> list[Experiment]:
    """quick: every pair of values, 10 across, 0.5 s. full: the whole product at 10 across and every pair at 20 across,
    2 s each, and every pair at 40 across for 0.5 s."""
    covers, product = pairwise(FACTORS), list(itertools.product(*FACTORS))
    plan = [(10, covers, 0.5)] if tier == "quick" else [(10, product, 2.0), (20, covers, 2.0), (40, covers, 0.5)]
    return [
        Experiment(
            "survival",
            shape,
            across,
            center=(0.2, 0.24 if ratio > 1 else 0.16, 0.2),
            turn=0.0 if shape == "ball" else 0.6,
            duration=seconds,
            dt=dt,
            density_ratio=ratio,
            gravity=GRAVITY,
            walls=("openTop" if ratio > 1 else "openBottom") if walls == "open" else walls,
            cfl=cfl,
            velocity=(0.5, -2.0 if ratio > 1 else 2.0, 0.0),
            spin=(2.0, 0.0, 5.0),
            limit=60.0 if tier == "quick" else 14400.0,
        )
        for across, rows, seconds in plan
        for shape, ratio, dt, cfl, walls in rows
    ]


def survives(result: Result) -> bool:
    """Finished with interior det F within 0.5 to 2."""
    low, high = extremes(result, "det_f_interior")
    return result.finished and low >= 0.5 and high <= 2


def judge_maps(some: list[Result], at: str) -> list[Line]:
    """What repairs would hide, of the runs whose solids are 4 cells thick or more and do not fold."""
    if not some:
        return []
    counts = [out_of_bounds(result) for result in some]
    total = {name: sum(count[name] for count in counts) for name in counts[0]}
    words = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in total.items())
    shapes = ", ".join(sorted({result.run.shape for result in some}))
    at = f"{len(some)} of {at}: {shapes}"
    low = min(float(result["det_f_before"][:, 0].min()) for result in some)
    high = max(float(result["det_f_before"][:, 1].max()) for result in some)
    bars = [
        ("lowest det F before repair >= 0.5", low, 0.5, np.inf),
        ("highest det F before repair <= 2", high, 0.0, 2.0),
    ]
    lines = [Line("survival", "cells out of bounds = 0", sum(total.values()), "cells", 0, 0, f"{at}; {words}")]
    return lines + [Line("survival", bar, value, "", least, most, at) for bar, value, least, most in bars]


def judge_energies(some: list[Result], at: str) -> list[Line]:
    """The law of energy and that of the ledger's columns, by the number of runs that miss them."""
    closed = [result for result in some if "open" not in result.run.face_kinds or result.run.gravity == 0]
    rises, gaps = [share_of_rise(result) for result in closed], [share_of_gap(result) for result in some]
    lines = []
    if rises:
        made = f"{len(closed)} of {at} (fluid that falls brings energy in through an open face); worst {max(rises):.3g}"
        bar = f"runs whose energy rises by more than {MOST_RISE:g} of its largest so far = 0"
        lines.append(Line("survival", bar, sum(rise > MOST_RISE for rise in rises), "runs", 0, 0, made))
    bar = f"largest gap between the ledger's columns and the diagnostics, over the largest energy so far, <= {CLOSES:g}"
    return [*lines, Line("survival", bar, max(gaps), "", 0, CLOSES, at)]


def judge_survival(results: Results, tier: str) -> list[Line]:
    lines = []
    made = found(results, survival_runs(tier))
    for across in sorted({result.run.across for result in made}):
        some = [result for result in made if result.run.across == across]
        at = f"{len(some)} runs, {across} across, {some[0].run.duration:g} s each"
        lost = sum(not result.finished for result in some)
        lines.append(Line("survival", "runs that did not finish = 0", lost, "runs", 0, 0, at))
        dirty = sum(result.finished and not survives(result) for result in some)
        lines.append(Line("survival", "finished with interior det F outside 0.5 to 2 = 0", dirty, "runs", 0, 0, at))
        low = np.nanmin([extremes(result, "det_f_interior")[0] for result in some])
        high = np.nanmax([extremes(result, "det_f_interior")[1] for result in some])
        lines.append(Line("survival", "lowest interior det F", float(low), conditions=at))
        lines.append(Line("survival", "highest interior det F", float(high), conditions=at))
        lines.append(
            Line("survival", "clamped cells, all reported", sum(r.clamps for r in some), "cells", conditions=at)
        )
        lines += judge_energies(some, at)
        for result in some:
            result.numbers |= {"energy made": share_of_rise(result), "false edges": float(result["false_edges"].max())}
        worst = int(max(result.numbers["false edges"] for result in some))
        torn = sum(result["false_edges"].any() for result in some)
        where = f"{at}; {worst} edges in the worst"
        bar = "runs with an edge of the mesh longer than 4 times what the largest stretch explains = 0"
        lines.append(Line("survival", bar, torn, "runs", 0, 0, where))
        lines += judge_maps([result for result in some if resolved(result.run)], at)
        lines.append(Line("survival", "repeated steps, all reported", sum(r.retries for r in some), "", conditions=at))
        for result in some:
            if not result.finished:
                lines.append(Line("survival", "not finished", result.times[-1], "s", conditions=conditions(result)))
    return lines
