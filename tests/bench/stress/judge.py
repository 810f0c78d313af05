"""The worst figures of a case's runs, and whether they pass: finished, energy, volume, speed, its bars, refusals."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from loop.energy_laws import share_of_rise
from loop.experiment import WATCHED
from loop.measure import Result

from .cases import Bar, Case

MOST_RISE, MOST_VOLUME, MOST_SPEED = 0.02, 0.05, 10.0  # of the largest energy; of the rest volume; reference speeds


@dataclasses.dataclass
class Line:
    """What is printed of a case."""

    case: Case
    passed: bool
    text: str


def reference_speed(result: Result) -> float:
    """Of a run: of the start, of what is given, of waves, of a fall through the box [m/s]."""
    run = result.run
    given = run.watched().given if run.group in WATCHED else ()
    pushed = max([0.0, *(float(np.linalg.norm(part.velocity)) for part in given)])
    started = max(float(np.linalg.norm(values.get("velocity", 0.0))) for _, values in run.bodies())
    density = run.solid()["density"]
    fall = (2 * run.gravity * run.box[1] * max(1.0, 1000.0 / density)) ** 0.5
    strained = (run.youngs_modulus / density) ** 0.5 if run.stretch or run.twist or run.scramble else 0.0
    return started + pushed + fall + strained + 1e-9


class Worst:
    """The worst value of every figure with the scene that it is of, and which bars are missed."""

    def __init__(self) -> None:
        self.values: dict[str, tuple[float, float, str]] = {}  # name: beyond the range by, value, scene
        self.faults: list[str] = []

    def see(self, bar: Bar, value: float, scene: str) -> None:
        beyond = max(value - bar.most, bar.least - value)
        if bar.name not in self.values or not beyond <= self.values[bar.name][0]:
            self.values[bar.name] = (beyond, value, scene)
        if not beyond <= 0:
            limit = f"> {bar.most:g}" if value > bar.most else f"< {bar.least:g}"
            self.faults.append(f"{scene}: {bar.name} {value:.3g} {limit}")

    def line(self, case: Case, finished: int, runs: int) -> Line:
        figures = ", ".join(f"{name} {value:.3g} ({scene})" for name, (_, value, scene) in self.values.items())
        text = f"{finished} of {runs} finish" + f"; worst {figures}" * bool(figures)
        return Line(case, not self.faults, "; ".join([text, *self.faults[:3]]))


def bars_of(case: Case, result: Result) -> list[Bar]:
    """What an experiment has to keep."""
    run = result.run
    closed = case.energy and ("open" not in run.face_kinds or run.gravity == 0)
    kept = case.volume and not run.compressible and not dict(run.settings).get("plastic_yield_stress")
    bars = [Bar("speed over reference", MOST_SPEED, of=lambda r: float(fastest(r) / reference_speed(r)))]
    if kept:
        bars.insert(0, Bar("volume off", MOST_VOLUME, of=volume_off))
    if closed:
        bars.insert(0, Bar("energy rise", MOST_RISE, of=share_of_rise))
    return [*bars, *case.bars]


def fastest(result: Result) -> float:
    """Of any solid [m/s]."""
    return max(float(v.max()) for name, v in result.columns.items() if name.startswith("max_speed_solid"))


def volume_off(result: Result) -> float:
    """Largest change of the volume of any solid, by its mesh."""
    names = [name for name in result.columns if name.startswith("volume_mesh")]
    return max(float(np.abs(result[name] / result.start[name] - 1).max()) for name in names)


def of_runs(case: Case, results: Sequence[Result]) -> Line:
    """Experiments of `bench loop`."""
    worst = Worst()
    for result in results:
        scene = f"{result.run.scene}, {result.run.shape}"
        if result.failure:
            worst.faults.append(f"{scene}: {result.failure}")
        for bar in bars_of(case, result) if result.columns else []:
            worst.see(bar, bar.of(result) if bar.of else np.nan, scene)
    return worst.line(case, sum(result.finished for result in results), len(results))


def of_measured(case: Case, answers: Sequence[dict[str, Any]]) -> Line:
    """Answers of `bench accuracy` to the runs of the case."""
    worst = Worst()
    for run, answer in zip(case.measured, answers, strict=True):
        scene = f"{run.cells:g} cells, steps to {run.largest_step:.3g} s"
        if answer["failure"]:
            worst.faults.append(f"{scene}: {answer['failure']}")
            continue
        measured = answer["measured"][run.case]
        for bar in case.bars:
            worst.see(bar, measured["error"] if bar.name == "error" else measured["numbers"][bar.name], scene)
    return worst.line(case, sum(not answer["failure"] for answer in answers), len(answers))


def of_refusals(case: Case, answers: dict[str, str]) -> Line:
    """answers: "" by name of a call that was refused, else what happened."""
    bad = [f"{name}: {text}" for name, text in answers.items() if text]
    return Line(case, not bad, "; ".join([f"{len(answers) - len(bad)} of {len(answers)} refused cleanly", *bad]))
