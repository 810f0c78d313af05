"""The laws of elasticity: free oscillation, sustained load, squash. Initial shapes are set through the displacement."""

from __future__ import annotations

import dataclasses

import numpy as np

from . import reference
from .experiment import BULK_MODULUS, FRAME, RADIUS, SHEAR_MODULUS, Experiment
from .laws import Line, Results, conditions, found
from .measure import Result, crossings
from .shapes import SIZE

SHEAR_SPEED = float(np.sqrt(SHEAR_MODULUS / 1000.0))  # of a solid of 1000 kg/m^3 [m/s]
STEPS = 40  # a period
STRAIN = 0.05  # of the axis of the stretch
STRETCH = (1 + STRAIN, (1 + STRAIN) ** -0.5, (1 + STRAIN) ** -0.5)


def period(root: float) -> float:
    """Of the mode with x = omega R / c_s [s]."""
    return 2 * np.pi * RADIUS / (root * SHEAR_SPEED)


# --- free oscillation ------------------------------------------------------------------------------------------------


def oscillation_runs(tier: str) -> list[Experiment]:
    """A ball stretched along x at constant volume and let go, STEPS steps a period."""
    vacuum, fluid = period(reference.MODE_2_VACUUM), period(reference.MODE_2_EQUAL_DENSITY)
    free = Experiment(
        "oscillation",
        across=20,
        stretch=STRETCH,
        density_ratio=None,
        duration=10 * vacuum,
        dt=vacuum / STEPS,
        limit=7200.0,
    )
    wet = dataclasses.replace(free, density_ratio=1.0, box=(0.6, 0.6, 0.6), duration=6 * fluid, dt=fluid / STEPS)
    if tier == "quick":
        return [free, wet]
    return [dataclasses.replace(run, across=across) for run in (free, wet) for across in (10, 20, 40)]


def frequency_root(result: Result) -> float:
    """x = omega R / c_s from the sign changes of the stretch, nan when they span less than a period."""
    moments = result.with_start("second_moments")
    times = crossings(result.times, moments[:, 0] - (moments[:, 1] + moments[:, 2]) / 2, 0.05)
    periods = (len(times) - 1) // 2  # whole ones: a shifted middle makes one half longer and the other shorter
    if periods < 1:
        return np.nan
    return float(2 * np.pi * periods / (times[2 * periods] - times[0]) * RADIUS / SHEAR_SPEED)


def judge_oscillation(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, oscillation_runs(tier)):
        run = result.run
        dry = run.density_ratio is None
        exact, bar = (reference.MODE_2_VACUUM, 0.02) if dry else (reference.MODE_2_EQUAL_DENSITY, 0.04)
        error = result.numbers["frequency error"] = frequency_root(result) / exact - 1
        at = conditions(result, f"stretch {STRAIN:g}, {STEPS} steps a period")
        where = "in vacuum" if dry else "in equal-density fluid"
        lines.append(
            Line("oscillation", f"frequency {where} (x = {exact:.4f}) within {bar:g}", error, "", -bar, bar, at)
        )
        last = result.times[1:] > run.duration - period(exact)  # the sum wavers: u and v are half a step apart
        energy = (result["kinetic_energy"] + result["elastic_energy"])[last].mean()
        kept = result.numbers["energy kept"] = float(energy / result.start["elastic_energy"])
        if dry:
            bars = (0.9, 1.01) if run.across == 20 else (None, None)
            lines.append(Line("oscillation", "energy after 10 periods, 0.90 to 1.01", kept, "", *bars, at))
    return lines


# --- sustained load --------------------------------------------------------------------------------------------------

# Without the constraint the ball would shrink by p/K, p = beta R^2 / 5 the mean pressure of the load: 10 %.
LOAD = 0.1 * 5 * BULK_MODULUS / RADIUS**2  # N/m^4


def load_runs(tier: str) -> list[Experiment]:
    """Pulled towards its centre in vacuum for half a second, damped so that it comes to rest."""
    return [
        Experiment(
            "load", across=across, density_ratio=None, duration=0.5, dt=0.005, load=LOAD, damping=0.005, limit=7200.0
        )
        for across in ((10,) if tier == "quick" else (10, 20, 40))
    ]


def judge_load(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, load_runs(tier)):
        run = result.run
        at = conditions(result, f"beta {run.load:.3g} N/m^4, largest over the run")
        ranges = {"interior det F": result["det_f_interior"]}
        ranges |= {
            kind: result[f"volume_{kind}"][:, None] / result.start[f"volume_{kind}"] for kind in ("mesh", "cells")
        }
        for kind, values in ranges.items():
            strain = np.abs(values - 1).max(axis=1)
            last = values[result.times[1:] > 0.8 * run.duration].mean(axis=0) - 1
            lasting = result.numbers[f"strain by {kind}"] = float(np.abs(last).max()) if result.finished else np.nan
            bar = f"lasting volumetric strain by {kind} <= 1e-4"
            lines.append(Line("load", bar, lasting, "", 0, 1e-4, f"{at} {strain.max():.2g}"))
    return lines


# --- squash ----------------------------------------------------------------------------------------------------------

# Initial stretch and what differs from a ball in fluid between slip walls.
SQUASHES = {
    "squash a, half size, compressible": (
        (0.5, 0.5, 0.5),
        {"density_ratio": None, "compressible": True},
    ),
    "squash b, half height": ((1.0, 0.5, 1.0), {"walls": "openTop"}),
    "squash c, constant volume": ((2**0.5, 0.5, 2**0.5), {}),
}
NO_CFL = 1000.0


def squash_runs(tier: str) -> list[Experiment]:
    """dt = 1/24 with the CFL limit off: at the largest value that the solver takes."""
    return [
        Experiment(name, across=across, stretch=stretch, cfl=NO_CFL, duration=24 * FRAME, limit=3600.0, **other)
        for across in ((10,) if tier == "quick" else (10, 20))
        for name, (stretch, other) in SQUASHES.items()
    ]


def judge_squash(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, squash_runs(tier)):
        run = result.run
        left = float(result["misshape"][-1]) / SIZE if result.finished else np.nan
        result.numbers["misshape"] = left
        at = conditions(result, "largest distance of a vertex from the rest shape over 0.2 m")
        lines.append(Line("squash", f"{run.scene}: returns to rest within 1e-2 of its size", left, "", 0, 1e-2, at))
    return lines
