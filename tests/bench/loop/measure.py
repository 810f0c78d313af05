"""What a run shows: its series as arrays, and the numbers that the laws are about."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
from collections.abc import Sequence
from typing import Any

import numpy as np
from eulerfsi.solver import binding, c_api

from .experiment import Experiment

# Steps whose divergence before the projection is below this part of the run's largest say nothing about the ratio.
QUIET = 0.01
FORMS = [name for name, *_ in c_api.Energy._fields_]  # of energy, in the order of the ledger


@dataclasses.dataclass
class Result:
    """A finished experiment. numbers: what the laws measured on it, by name, for its row of the table."""

    run: Experiment
    failure: str
    start: dict[str, Any]
    columns: dict[str, np.ndarray]
    numbers: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def finished(self) -> bool:
        return not self.failure

    def __getitem__(self, name: str) -> np.ndarray:
        """A quantity after every step; the first index is the step. Empty when there was none."""
        return self.columns.get(name, np.zeros(0))

    def with_start(self, name: str) -> np.ndarray:
        """The same with the initial value in front; name: a quantity of the diagnostics."""
        return np.concatenate([np.array(self.start[name])[None], self[name]]) if self.columns else np.zeros(0)

    @property
    def times(self) -> np.ndarray:
        """Times [s] that belong to with_start."""
        return np.concatenate([[0.0], self["time"]])

    @property
    def clamps(self) -> int:
        """Cells whose F was clamped or whose map was not believed or made anew, summed over the steps."""
        return int(self["degenerate_cells"].sum())

    @property
    def retries(self) -> int:
        return int(self["retries"].sum())

    @property
    def velocity(self) -> np.ndarray:
        """Mean velocity of the solid, start and every step, (n, 3) [m/s]."""
        return self.with_start("momentum") / self.with_start("mass")[:, None]


def from_child(run: Experiment, answer: dict[str, Any]) -> Result:
    """The answer of `simulate` as arrays."""
    columns = {name: np.array(values) for name, values in answer.get("columns", {}).items()}
    return Result(run, answer["failure"], answer.get("start", {}), columns)


def run_process(run: Experiment, command: Sequence[str], text: str | None = None) -> Result:
    """What a process says of an experiment on its standard output; text: its standard input."""
    environment = {**os.environ, "OMP_WAIT_POLICY": "passive"}
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False, env=environment)
    if done.returncode == 0:
        return from_child(run, json.loads(done.stdout))
    last = (done.stderr.strip().splitlines() or [""])[-1]
    return from_child(run, {"failure": f"the process ended with code {done.returncode}: {last}"})


def extremes(result: Result, name: str) -> tuple[float, float]:
    """Lowest and highest of a column over the run, nan where det F has no sign that makes sense."""
    values = result[name]
    return (float(values.min()), float(values.max())) if values.size else (np.nan, np.nan)


def volume_range(result: Result, kind: str) -> tuple[float, float]:
    """Lowest and highest volume over the first one; kind: "mesh" or "cells"."""
    if not result.columns:
        return np.nan, np.nan
    ratio = result[f"volume_{kind}"] / result.start[f"volume_{kind}"]
    return float(ratio.min()), float(ratio.max())


def divergence_ratio(result: Result, where: str = "") -> float:
    """Largest divergence after over before the projection (2-norms) of the steps that are not quiet."""
    before, after = result[f"divergence_before{where}"], result[f"divergence_after{where}"]
    if not before.size:
        return np.nan
    loud = before > QUIET * before.max()
    return float((after[loud] / before[loud]).max()) if loud.any() else 0.0


def mechanical_energy(result: Result) -> np.ndarray:
    """Kinetic, elastic and potential energy of the solid at start and after every step [J]."""
    mass = result.start["mass"]
    height = result.with_start("center")[:, 1]
    return (
        result.with_start("kinetic_energy") + result.with_start("elastic_energy") + mass * result.run.gravity * height
    )


def ledger(result: Result) -> np.ndarray:
    """Columns of the energy ledger, (steps, stages, forms) [J]."""
    return result["energy_change"]


def total_energy(result: Result) -> np.ndarray:
    """All energy at the start of every step, u and v of one time, less outside work [J].

    Outside work is the stage "external" and that of what holds pins and colliders. Potential energy counts from its
    lowest. What the laboratory does between two steps stays in.
    """
    forms = result["energy_at_start"]
    work = ledger(result)[:, binding.ENERGY_STAGES.index("external")].sum(axis=1)
    if "prescribed_work" in result.columns:
        work = work + result["prescribed_work"]
    potential = forms[:, FORMS.index("potential")]
    return forms.sum(axis=1) - potential.min() - (np.cumsum(work) - work / 2)


def energy_at_begin(result: Result) -> np.ndarray:
    """All energy at the start of every step, u and v as the step before has left them [J]."""
    return result["energy_end"].sum(axis=1) - ledger(result).sum(axis=(1, 2))


def half_steps(result: Result) -> np.ndarray:
    """At the start of every step, what the energy of one time has more than that of the velocities as they are [J]."""
    return result["energy_at_start"].sum(axis=1) - energy_at_begin(result)


@dataclasses.dataclass
class Rise:
    """The largest rise of a series above its running minimum, and the steps between which it happens."""

    size: float
    begin: int
    end: int


def largest_rise(values: np.ndarray) -> Rise:
    """begin: index of the lowest value before the largest rise, end: of the value that is so much above it."""
    above = values - np.minimum.accumulate(values)
    end = int(np.argmax(above))
    return Rise(float(above[end]), int(np.argmin(values[: end + 1])), end)


def at_time(result: Result, name: str, time: float) -> float:
    """A scalar of the diagnostics, interpolated to a time [s]."""
    return float(np.interp(time, result.times, result.with_start(name))) if result.columns else np.nan


def slope(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes of a straight fit, one per column of values."""
    return np.polyfit(times, values, 1)[0] if len(times) > 1 else np.full(values.shape[1:], np.nan)


def crossings(times: np.ndarray, values: np.ndarray, least: float) -> np.ndarray:
    """Times at which values change sign, as long as they swing by `least` of their first value in between."""
    found: list[float] = []
    last = 0
    for i in range(len(values) - 1):
        if values[i] * values[i + 1] >= 0:
            continue
        if abs(values[last : i + 1]).max() < least * abs(values[0]):
            break
        found.append(times[i] + (times[i + 1] - times[i]) * values[i] / (values[i] - values[i + 1]))
        last = i + 1
    return np.array(found)
