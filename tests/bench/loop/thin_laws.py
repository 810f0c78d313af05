"""The law of thin bodies: nothing passes through anything, in the named cases of `thin_scenes`."""

from __future__ import annotations

import numpy as np

from .experiment import WATCHED, Experiment
from .laws import Line, Results, conditions, found
from .measure import Result
from .shapes import SIZE
from .thin_scenes import CASES, H

OVERLAP = 1.0  # cells
COULOMB = 1.001  # of what friction allows
IN_VACUUM = ("strap", "ring", "press")  # that are cheap enough to run twice
FLUIDS = (1000.0, None)  # density of the solids over the fluid's: as by default, vacuum


def watched_run(name: str, ratio: float | None) -> Experiment:
    """A case of experiment.WATCHED. ratio: density of the solids over the fluid's."""
    case = WATCHED[name]
    return Experiment(
        f"thin: {name}",
        shape=name,
        across=round(SIZE / H),
        box=tuple(H * cells for cells in case.cells),
        duration=case.duration,
        density_ratio=ratio,
        gravity=case.gravity,
        limit=1800.0,
        group=name,
    )


def thin_runs(tier: str) -> list[Experiment]:
    return [
        watched_run(name, ratio) for name in CASES for ratio in FLUIDS if ratio or tier == "full" or name in IN_VACUUM
    ]


def changed_sides(result: Result) -> np.ndarray:
    """Lines and vertices that are on another side than at the start, after every step."""
    return result["passed_lines"] + result["passed_vertices"]


def deepest(result: Result) -> np.ndarray:
    """Of any vertex in another solid or a collider, after every step [cells]."""
    depths = result["collider_overlap"]
    if "overlap" in result.columns:
        depths = np.maximum(depths, result["overlap"])
    return depths / result.run.spacing


def history(result: Result) -> str:
    """What is seen where it goes wrong: when vertices change sides, and overlap, rows and thickness just before."""
    passed, depths = changed_sides(result), deepest(result)
    at = int(np.argmax(passed > 0)) if (passed > 0).any() else int(np.argmax(depths))
    before = max(0, at - 1)
    words = "first passed" if (passed > 0).any() else "deepest"
    pairs = f" between {result['passed_pairs'][at]}" if (passed > 0).any() else ""
    return (
        f"{words}{pairs} at {result['time'][at]:.3g} s; a step before: {depths[before]:.2f} h deep, "
        f"{int(result['contact_rows'][before])} rows, thinnest {result['thinnest'][before]:.2f} of its thickness"
    )


def judge_thin(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, thin_runs(tier)):
        passed, depths = changed_sides(result), deepest(result)
        at = conditions(result, f"{result.run.scene}, {history(result)}")
        result.numbers |= {
            "deepest [h]": float(depths.max()),
            "thinnest": float(result["thinnest"].min()),
            "coulomb": float(result["coulomb"].max()),
            "rows pressed in [h]": float(result["contact_overlap"].max()),
        }
        lines.append(Line("thin", "sides exchanged, lines and vertices = 0", int(passed.max()), "", 0, 0, at))
        lines.append(Line("thin", "reaches its end", float(result.finished), "", 1, 1, at))
        bar = f"deepest vertex of one in another <= {OVERLAP:g} h"
        lines.append(Line("thin", bar, float(depths.max()), "h", 0, OVERLAP, at))
        bar = f"impulse of a pair over the most that its friction allows <= {COULOMB:g}"
        lines.append(Line("thin", bar, float(result["coulomb"].max()), "", 0, COULOMB, at))
        unconverged = int(result["unconverged"].sum())
        lines.append(Line("thin", f"unconverged steps of {result['dt'].size}", unconverged, "steps", conditions=at))
    return lines
