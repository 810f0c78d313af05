"""Laws of solids that lie on each other: rest of stacks and heaps, Hertz's load."""

from __future__ import annotations

import dataclasses

import numpy as np

from . import groups
from .experiment import FRAME, GRAVITY, RADIUS, Experiment, of
from .laws import Line, Results, conditions, found
from .measure import Result, total_energy

SINKS, CREEPS, GROWS = 0.25, 1e-3, 1e-4  # cells, cells a frame, M g R
HERTZ = 0.05  # of the load
RESOLVED = 18.0  # R / h from which on it is judged
STILL = 0.05  # cells


def stack_runs(tier: str) -> list[Experiment]:
    seconds = 2.0 if tier == "quick" else 10.0
    lying = Experiment(
        "stack",
        shape="3 boxes",
        box=(0.4, 0.6, 0.4),
        duration=seconds,
        dt=0.01,
        density_ratio=None,
        gravity=GRAVITY,
        limit=3600.0,
        group="stack",
    )
    heavy = dataclasses.replace(lying, scene="heavy on soft, 100:1", shape="2 boxes", group="heavy on soft")
    runs = [lying, heavy]
    if tier == "full":
        runs += [dataclasses.replace(run, compressible=True) for run in runs]
        box = (3 * groups.HEAP_PITCH, 0.6, 3 * groups.HEAP_PITCH)
        runs.append(dataclasses.replace(lying, scene="heap", shape="20 bodies", across=16, box=box, group="heap"))
    return runs


def judge_stack(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, stack_runs(tier)):
        run, late = result.run, result["time"] >= result.run.duration / 2
        at = conditions(result, f"{run.scene}{', compressible' * run.compressible}, second half of the run")
        if not result.finished or not late.any():
            lines.append(Line("stack", "finished", 0, "", 1, 1, at))
            continue
        creep = result.numbers["creep [h/frame]"] = largest_creep(result)
        sunk = result.numbers["skin pressed in [h]"] = float(result["contact"][late].max())
        deep = result.numbers["overlap [h]"] = float(result["overlap"][late].max()) / run.spacing
        energy = total_energy(result)[result.times[:-1] >= run.duration / 2]
        masses = sum(result.start[of("mass", k)] for k in range(1, len(run.bodies()) + 1))
        growth = float((energy.max() - energy[0]) / (masses * GRAVITY * RADIUS))
        result.numbers["energy growth [MgR]"] = growth
        lines.append(
            Line("stack", f"creep: largest move of a centre in a frame < {CREEPS:g} h", creep, "h", 0, CREEPS, at)
        )
        lines.append(Line("stack", f"none sinks into another's skin by more than {SINKS:g} h", sunk, "h", 0, SINKS, at))
        lines.append(Line("stack", f"no vertex deeper in another solid than {SINKS:g} h", deep, "h", 0, SINKS, at))
        bar = f"energy not growing: its largest above that at half time <= {GROWS:g} M g R"
        lines.append(Line("stack", bar, growth, "M g R", -np.inf, GROWS, at))
    return lines


def largest_creep(result: Result) -> float:
    """Largest move of any solid's centre within a frame in the second half of the run [cells]."""
    run = result.run
    frames, worst = np.arange(run.duration / 2, run.duration + 1e-9, FRAME), 0.0
    for k in range(1, len(run.bodies()) + 1):
        path = result.with_start(of("center", k))
        center = np.stack([np.interp(frames, result.times, axis) for axis in path.T], axis=1)
        worst = max(worst, float(np.linalg.norm(np.diff(center, axis=0), axis=1).max()))
    return worst / run.spacing


def hertz_load(approach: float, thick: float = np.inf) -> float:
    """Load [N] that presses a sphere of RADIUS by `approach` [m] into a block (Hertz 1882).

    thick: height of the block on a floor without friction, which makes it stiffer (Dimitriadis et al. 2002, eq. 15, to
    the third order).
    """
    nu, approach = groups.BLOCK_POISSON, max(0.0, approach)
    modulus = groups.BLOCK_MODULUS / (1 - nu**2) / (1 + 1 / groups.STIFFER)
    half_space = 4 / 3 * modulus * np.sqrt(RADIUS) * approach**1.5
    alpha, beta = -0.347 * (3 - 2 * nu) / (1 - nu), 0.056 * (5 - 2 * nu) / (1 - nu)
    x = np.sqrt(RADIUS * approach) / thick
    first = -2 * alpha / np.pi * x
    third = -8 / np.pi**3 * (alpha**3 + 4 * np.pi**2 / 15 * beta) * x**3
    return half_space * (1 + first + first**2 + third)


def hertz_runs(tier: str) -> list[Experiment]:
    """A stiff sphere that weighs on a soft block, for approaches of about 0.05 R and 0.025 R."""
    ball = Experiment(
        "sphere on a block",
        shape="sphere",
        box=(0.4, 0.24, 0.4),
        duration=0.4,
        dt=0.01,
        density_ratio=None,
        gravity=GRAVITY,
        limit=3600.0,
        group="pressed",
    )
    loads = (8000.0,) if tier == "quick" else (8000.0, 3000.0)
    return [
        dataclasses.replace(ball, across=across, load=load)
        for across in ((18,) if tier == "quick" else (18, 36))
        for load in loads
    ]


def judge_hertz(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, hertz_runs(tier)):
        run, h = result.run, result.run.spacing
        height, late = result.with_start(of("center", 2))[:, 1], result.times >= run.duration / 2
        load, approach = float(result.start[of("mass", 2)] * GRAVITY), float(height[0] - np.median(height[late]))
        rise = float((height[late] - np.minimum.accumulate(height[late])).max()) / h
        result.numbers |= {"load [N]": load, "approach [R]": approach / RADIUS, "thrown up by [h]": rise}
        near = f"approach {approach / RADIUS:.4f} R, median of the second half of the run"
        at = conditions(result, f"R/h {RADIUS / h:g}, {load:.4g} N, {near}")
        wide = result.numbers["Hertz, half-space"] = float(hertz_load(approach) / load - 1)
        error = result.numbers["Hertz, block"] = float(hertz_load(approach, groups.BLOCK[1]) / load - 1)
        low, high = (-HERTZ, HERTZ) if RADIUS / h >= RESOLVED * (1 - 1e-9) else (None, None)
        bar = f"load by Hertz's law for a block as high as the radius, within {HERTZ:g}"
        lines.append(Line("hertz", bar, error, "", low, high, at))
        lines.append(Line("hertz", "load by Hertz's law for a half-space", wide, conditions=at))
        bar = f"it lies still: highest rise of the sphere in the second half of the run <= {STILL:g} h"
        lines.append(Line("hertz", bar, rise, "h", 0, STILL, at))
    return lines
