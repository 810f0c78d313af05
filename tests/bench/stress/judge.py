"""The worst figures of a case's runs, and whether they pass: finished, energy, volume, speed, refusals."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from loop.energy_laws import share_of_rise
from loop.measure import Result, volume_range

from .cases import Case

MOST_RISE, MOST_VOLUME, MOST_SPEED = 0.02, 0.05, 10.0  # of the largest energy; of the rest volume; reference speeds


@dataclasses.dataclass
class Line:
    """What is printed of a case."""

    case: Case
    passed: bool
    text: str


def reference_speed(result: Result) -> float:
    """Of a run: of the start, of waves, of a fall through the box [m/s]."""
    run = result.run
    density = run.solid()["density"]
    fall = (2 * run.gravity * run.box[1] * max(1.0, 1000.0 / density)) ** 0.5
    strained = (run.youngs_modulus / density) ** 0.5 if run.stretch else 0.0
    return float(np.linalg.norm(run.velocity) + fall + strained + 1e-9)


def of_runs(case: Case, results: Sequence[Result]) -> Line:
    """The worst of the runs, with the scene that it is of."""
    faults, worst = [], {}
    for result in results:
        run = result.run
        if result.failure:
            faults.append(f"{run.scene}: {result.failure}")
        if not result.columns:
            continue
        closed = case.energy and ("open" not in run.face_kinds or run.gravity == 0)
        kept = case.volume and not run.compressible and not dict(run.settings).get("plastic_yield_stress")
        figures = {
            "energy rise": (share_of_rise(result), MOST_RISE if closed else None),
            "volume": (max(abs(v - 1) for v in volume_range(result, "mesh")), MOST_VOLUME if kept else None),
            "speed over reference": (float(result["max_speed_solid"].max()) / reference_speed(result), MOST_SPEED),
        }
        for name, (value, bar) in figures.items():
            if bar is None:
                continue
            if name not in worst or not value <= worst[name][0]:
                worst[name] = (value, f"{run.scene}, {run.shape}")
            if not value <= bar:
                faults.append(f"{run.scene}: {name} {value:.3g} > {bar:g}")
    finished = sum(result.finished for result in results)
    figures = ", ".join(f"{name} {value:.2g} ({where})" for name, (value, where) in worst.items())
    text = (
        f"{finished} of {len(results)} finish; worst {figures}" if figures else f"{finished} of {len(results)} finish"
    )
    return Line(case, not faults, "; ".join([text, *faults[:3]]))


def of_refusals(case: Case, answers: dict[str, str]) -> Line:
    """answers: "" by name of a call that was refused, else what happened."""
    bad = [f"{name}: {text}" for name, text in answers.items() if text]
    return Line(case, not bad, "; ".join([f"{len(answers) - len(bad)} of {len(answers)} refused cleanly", *bad]))
