"""The laws of what is given and of what flows: a pin's reaction, a cantilever, a jet's flux, flow through a channel."""

from __future__ import annotations

import dataclasses
from math import cos, erfc, exp, sin

import numpy as np

from . import probes
from .experiment import FRAME, GRAVITY, Experiment
from .laws import Line, Results, conditions, found
from .shapes import SIZE

WITHIN = 0.01  # of weight, flux and velocity
BENDS = 0.02  # of the elastica


# --- what holds a bar that hangs is its weight -----------------------------------------------------------------------


def pin_runs(tier: str) -> list[Experiment]:
    bar = Experiment(
        "bar that hangs", shape="bar", box=(0.4, 0.6, 0.4), duration=1.0, gravity=GRAVITY, probe="bar that hangs"
    )
    return [dataclasses.replace(bar, density_ratio=ratio) for ratio in (None, 1000.0)]


def judge_pin(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, pin_runs(tier)):
        late = result["time"] > result.run.duration - FRAME
        force = result["impulse"][late].sum(axis=0) / result["dt"][late].sum()
        weight = float(result["mass"][-1]) * GRAVITY
        off = result.numbers["reaction over weight - 1"] = float(force[1] / weight - 1)
        at = conditions(result, f"{result.run.scene}, {weight:.4g} N, mean of the last frame")
        lines.append(Line("pin", f"reaction is the weight within {WITHIN:g}", off, "", -WITHIN, WITHIN, at))
    return lines


# --- a cantilever is the elastica ------------------------------------------------------------------------------------


def elastica(beta: float) -> tuple[float, float]:
    """Sag of the tip over the length and its angle [rad]: theta'' = -beta (1 - s) cos theta, by shooting."""
    parts = 1000

    def shoot(first: float) -> np.ndarray:
        y, ds = np.array([0.0, first, 0.0]), 1 / parts  # theta, theta', sag

        def rate(s: float, at: np.ndarray) -> np.ndarray:
            return np.array([at[1], -beta * (1 - s) * cos(at[0]), sin(at[0])])

        for i in range(parts):
            s = i * ds
            a = rate(s, y)
            b = rate(s + ds / 2, y + ds / 2 * a)
            c = rate(s + ds / 2, y + ds / 2 * b)
            y = y + ds / 6 * (a + 2 * b + 2 * c + rate(s + ds, y + ds * c))
        return y

    low, high = 0.0, beta
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (low, middle) if shoot(middle)[1] > 0 else (middle, high)
    theta, _, sag = shoot(low)
    return float(sag), float(theta)


def cantilever_runs(tier: str) -> list[Experiment]:
    """In a slab, in steps that its velocity solve follows; 8 cells over its height and, full, 12."""
    high = probes.BAR_HIGH / SIZE
    return [
        Experiment(
            "cantilever",
            shape="bar",
            across=round(cells / high),
            box=(probes.BAR_ROOT + probes.BAR_LONG + 0.1, 0.9, probes.BAR_HIGH / cells),
            duration=1.5,
            dt=1 / 240,
            density_ratio=None,
            gravity=GRAVITY,
            compressible=compressible,
            limit=3600.0,
            probe="cantilever",
        )
        for cells in ((8,) if tier == "quick" else (8, 12))
        for compressible in (False, True)
    ]


def judge_cantilever(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, cantilever_runs(tier)):
        run = result.run
        words = f"{probes.BAR_HIGH / run.spacing:.0f} cells high, beta {probes.BAR_BETA:g}"
        at = conditions(result, f"{'compressible, ' * run.compressible}{words}")
        for name, wanted in zip(("sag", "angle"), elastica(probes.BAR_BETA), strict=True):
            off = result.numbers[f"{name} over the elastica's - 1"] = float(result[name][-1] / wanted - 1)
            bar = f"{name} of the tip is that of the elastica ({wanted:.4g}) within {BENDS:g}"
            lines.append(Line("cantilever", bar, off, "", -BENDS, BENDS, at))
    return lines


# --- a jet's flux leaves through the open side -----------------------------------------------------------------------


def jet_runs(tier: str) -> list[Experiment]:
    """Until the jet has reached the side: the velocity that is seen is that after its transport, which has sources."""
    jet = Experiment("jet", shape="no solid", box=(0.6, 0.4, 0.4), duration=0.25, walls="openRight", probe="jet")
    return [dataclasses.replace(jet, across=across) for across in (5, 10)]


def judge_jet(results: Results, tier: str) -> list[Line]:
    lines = []
    wanted = probes.JET_SPEED * probes.JET_SIZE[1] * probes.JET_SIZE[2]
    for result in found(results, jet_runs(tier)):
        at = conditions(result, f"{wanted:.4g} m^3/s, mean over the run")
        for name in ("brought", "left"):
            mean = float(np.average(result[name], weights=result["dt"]))
            off = result.numbers[f"{name} over the flux - 1"] = mean / wanted - 1
            lines.append(
                Line("jet", f"volume {name} is the region's flux within {WITHIN:g}", off, "", -WITHIN, WITHIN, at)
            )
    return lines


# --- flow through a channel is a parabola ----------------------------------------------------------------------------

CHANNEL_HIGH = 0.3


def channel_runs(tier: str) -> list[Experiment]:
    return [
        Experiment(
            "channel",
            shape="no solid",
            across=round(SIZE / h),
            box=(8 * h, CHANNEL_HIGH, h),
            duration=4.0,
            dt=0.05,
            walls="channel",
            probe="channel",
        )
        for h in (0.025, 0.0125)
    ]


def judge_channel(results: Results, tier: str) -> list[Line]:
    lines = []
    nu = probes.CHANNEL_VISCOSITY / probes.CHANNEL_DENSITY
    middle = probes.CHANNEL_PUSH * CHANNEL_HIGH**2 / (8 * nu)
    for result in found(results, channel_runs(tier)):
        profile = result["profile"][-1]
        y = np.linspace(0, 1, len(profile))
        off = result.numbers["profile off"] = float(np.abs(profile / middle - 4 * y * (1 - y)).max())
        at = conditions(result, f"in the middle {middle:.4g} m/s, viscosity {probes.CHANNEL_VISCOSITY:g} Pa s")
        bar = f"Poiseuille's parabola within {WITHIN:g} of its largest velocity"
        lines.append(Line("channel", bar, off, "", 0, WITHIN, at))
    return lines


# --- a plate starts to move in a viscous fluid -----------------------------------------------------------------------

DRAG = 0.95
PLATE_CELL, PLATE_STEP = 1 / 80, 0.008  # m, s
PLATE_BOX = (1.2, 2.0)  # m: the fluid's layer comes to half a metre
HEAVY = 100.0  # densities of the fluid


def plate_runs(tier: str) -> list[Experiment]:
    plate = Experiment(
        "given plate",
        shape="plate",
        across=round(SIZE / PLATE_CELL),
        box=(*PLATE_BOX, PLATE_CELL),
        duration=10 * PLATE_STEP,
        dt=PLATE_STEP,
        walls="openAlongX",
        probe="given plate",
    )
    thrown = dataclasses.replace(plate, scene="thrown plate", probe="thrown plate")
    return [plate, *(dataclasses.replace(thrown, load=load) for load in (1.0, HEAVY))]


def stokes_drag(run: Experiment, times: np.ndarray) -> np.ndarray:
    """Impulse of the fluid on both sides of the plate so far [N s]: given its speed, or thrown (Stokes 1851)."""
    area = run.box[0] * run.box[2]
    density, viscosity, speed = probes.PLATE_DENSITY, probes.PLATE_VISCOSITY, probes.PLATE_SPEED
    if not run.load:
        return 4 * area * speed * np.sqrt(density * viscosity * times / np.pi)
    weight = run.load * density * probes.PLATE_CELLS * run.spacing
    x = 2 * np.sqrt(density * viscosity * times) / weight
    return area * weight * speed * (1 - np.array([exp(v * v) * erfc(v) for v in x]))


def judge_plate(results: Results, tier: str) -> list[Line]:
    """The drag on a given plate is its reported reaction: past an open face the fluid loses some momentum."""
    lines = []
    for result in found(results, plate_runs(tier)):
        run, drag = result.run, result["reaction"] if "reaction" in result.columns else result["drag"]
        share = drag / stokes_drag(run, result["time"])
        least, last = float(share.min()), float(share[-1])
        result.numbers |= {"least drag over the closed form": least, "in the end": last}
        density = f", {run.load:g} times as dense as the fluid" if run.load else ""
        at = conditions(result, f"{run.scene}{density}, in the first step {share[0]:.3g}, in the end {last:.3g}")
        bar = f"least drag so far over the closed form >= {DRAG:g} (backward Euler by itself: 0.89 in the first step)"
        lines.append(Line("plate", bar, least, "", DRAG, 2 - DRAG, at))
    return lines
