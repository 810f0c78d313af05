"""The law of the mirror: what is its own mirror image stays that."""

from __future__ import annotations

import dataclasses

import numpy as np

from .experiment import GRAVITY, Experiment
from .laws import Line, Results, conditions, found
from .measure import Result

MOST_FRACTION = 1e-6
MOST_IN_FLIGHT = 1e-4  # of the largest speed so far
MOST_IN_IMPACT = 1e-2  # of the same, until AFTER the rebound
AFTER = 0.1  # s
FLIGHT = 0.1  # s: before the ball reaches the floor
# A ball in the middle of a box that is symmetric about the planes x = 0 and z = 0, over cell counts along x and z.
FALL = Experiment("mirror", center=(0, 0.35, 0), velocity=(0, -1.5, 0), gravity=GRAVITY, duration=0.36, mirror=True)


def over(across: int, cells: tuple[int, int]) -> Experiment:
    """The fall in a box of so many cells along x and z: the middle plane lies on nodes, or on cell centres if odd."""
    h = FALL.spacing * FALL.across / across
    box = (cells[0] * h, round(0.6 / h) * h, cells[1] * h)
    return dataclasses.replace(FALL, across=across, box=box, corner=(-box[0] / 2, 0.0, -box[2] / 2))


def mirror_runs(tier: str) -> list[Experiment]:
    runs = [over(10, (20, 20)), over(10, (21, 20))]
    if tier == "full":
        runs += [over(13, (26, 27)), over(16, (32, 36))]
    return runs


def worst(result: Result, first: float, last: float) -> float:
    """Largest gap of a speed over the largest speed so far, of the steps that end in (first, last] s."""
    during = (result["time"] > first) & (result["time"] <= last + 1e-9)
    gaps = np.maximum(result["mirror_solid"], result["mirror_fluid"]) / np.maximum.accumulate(result["mirror_speed"])
    return float(gaps[during].max()) if during.any() else np.nan


def judge_mirror(results: Results, tier: str) -> list[Line]:
    lines: list[Line] = []
    for result in found(results, mirror_runs(tier)):
        box = tuple(round(size / result.run.spacing) for size in result.run.box)
        at = conditions(result, f"{box[0]} x {box[1]} x {box[2]} cells")
        rebound = float(result.times[int(np.argmax(result.velocity[:, 1]))])
        start = float(result.start["mirror_fraction"])
        lines.append(Line("mirror", "volume fractions of the mesh <= 1e-6", start, "", 0, MOST_FRACTION, at))
        moving = float(result["mirror_fraction"].max())
        lines.append(Line("mirror", "volume fractions, whole run", moving, conditions=at))
        flight, impact = worst(result, 0, FLIGHT), worst(result, FLIGHT, rebound + AFTER)
        lines.append(Line("mirror", "speeds in flight <= 1e-4", flight, "", 0, MOST_IN_FLIGHT, at))
        lines.append(Line("mirror", "speeds to 0.1 s after the rebound <= 1e-2", impact, "", 0, MOST_IN_IMPACT, at))
        lines.append(Line("mirror", "speeds later", worst(result, rebound + AFTER, np.inf), conditions=at))
    return lines
