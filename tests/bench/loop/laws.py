"""The laws of rigid motion and contact: which experiments they need, and how their results are judged.

A law is a pair of functions, experiments(tier) and judge(results by experiment, tier) -> lines. Experiments
that several laws share are run once. Tiers: "quick" (coarse, minutes) and "full".
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from . import reference
from .experiment import FRAME, GRAVITY, RADIUS, Experiment
from .measure import Result, at_time, divergence_ratio, extremes, mechanical_energy, slope, volume_range
from .shapes import NARROWEST

Results = Mapping[Experiment, Result]


@dataclasses.dataclass
class Line:
    """A bar and what was measured: low <= measured <= high passes. low or high None: reported, not judged."""

    law: str
    bar: str
    measured: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    conditions: str = ""

    @property
    def verdict(self) -> str:
        if self.low is None or self.high is None:
            return "not judged"
        return "pass" if self.low <= self.measured <= self.high else "MISSED"


@dataclasses.dataclass(frozen=True)
class Law:
    """experiments(tier) -> runs; judge(results, tier) -> lines, noting its numbers in the results."""

    name: str
    experiments: Callable[[str], Sequence[Experiment]]
    judge: Callable[[Results, str], list[Line]]

    def lines(self, results: Results, tier: str) -> list[Line]:
        """What judge says of the runs that made a step, and a missed bar for every other one."""
        broken = [result for result in found(results, self.experiments(tier)) if not result.columns]
        rest = {run: result for run, result in results.items() if result.columns}
        missed = [Line(self.name, "makes a step", 0, "", 1, 1, conditions(result)) for result in broken]
        return missed + self.judge(rest, tier)


def found(results: Results, runs: Sequence[Experiment]) -> list[Result]:
    """The results of those runs that were made, in order."""
    return [results[run] for run in runs if run in results]


def resolved(run: Experiment) -> bool:
    """Whether no part of a solid that the pressure keeps is narrower than 4 cells, and none folds."""
    return not run.compressible and NARROWEST.get(run.shape, 0.0) >= 4 * run.spacing * (1 - 1e-9)


def out_of_bounds(result: Result) -> dict[str, int]:
    """Cells that were, by what was wrong, summed over the steps."""
    return {name: int(result[name].sum()) for name in ("clamped", "rejected", "broken", "repaired_cells")}


def conditions(result: Result, more: str = "") -> str:
    """Resolution, steps, what was set and what went wrong."""
    run, dt = result.run, result["dt"]
    parts = [run.choices, dict(run.settings).get("preset", "production"), f"{run.duration:.3g} s"]
    parts += [f"dt {dt.min():.3g}..{dt.max():.3g} s"] if dt.size else []
    parts += [f"{name}={value}" for name, value in run.settings if name != "preset"]
    parts += [more] if more else []
    parts += [f"NOT FINISHED: {result.failure}"] if result.failure else []
    return ", ".join(parts)


# --- a ball thrown down onto the floor -------------------------------------------------------------------------------

THROW = 2.03  # m/s, of the authors' ball
FLIGHT = 0.145  # s, before the ball reaches the floor
# The impact is at 0.17 s; the ball has left the floor by 0.36 s.
BOUNCE = Experiment(
    "bounce", box=(0.4, 0.8, 0.4), center=(0.2, 0.6, 0.2), velocity=(0, -THROW, 0), gravity=GRAVITY, duration=0.42
)


def bounce_runs(tier: str) -> list[Experiment]:
    runs = [dataclasses.replace(BOUNCE, across=across) for across in ((10, 20) if tier == "quick" else (10, 20, 40))]
    if tier == "full":
        runs.append(dataclasses.replace(runs[-1], scene="bounce, half steps", halved=True))
    return [dataclasses.replace(run, limit=7200.0) for run in runs]


def restitution(result: Result) -> float:
    """Largest speed upwards over largest speed downwards before it."""
    up = result.velocity[:, 1]
    return float(up.max() / -up.min()) if up.min() < 0 else np.nan


def clamps_after_rebound(result: Result) -> int:
    """Clamped and repaired cells from the step on in which the ball is fastest upwards: it has left the floor."""
    fastest = int(np.argmax(result.velocity[1:, 1])) if result.columns else 0
    return int(result["degenerate_cells"][fastest:].sum())


def judge_bounce(results: Results, tier: str) -> list[Line]:
    lines: list[Line] = []
    rebound: list[float] = []
    for result in found(results, bounce_runs(tier)):
        run = result.run
        result.numbers["restitution"] = restitution(result)
        rebound.append(result.numbers["restitution"])
        at = conditions(result, "every step halved" if run.halved else "")
        bar = 0.005 if run.across >= 40 else 0.01
        for kind in ("mesh", "cells"):
            worst = max(abs(v - 1) for v in volume_range(result, kind))
            if run.across < 20:  # the bar is for 20 and more
                lines.append(Line("bounce", f"|V/V0 - 1| by {kind}", worst, conditions=at))
            else:
                lines.append(Line("bounce", f"|V/V0 - 1| by {kind} <= {bar:g}", worst, "", 0, bar, at))
        lines.append(Line("bounce", "clamped cells after the rebound = 0", clamps_after_rebound(result), "", 0, 0, at))
        lines.append(Line("bounce", "clamped cells, whole run", result.clamps, conditions=at))
        lines.append(Line("bounce", "finished", float(result.finished), "", 1, 1, at))
        low, high = extremes(result, "det_f_interior")
        lines.append(Line("bounce", "lowest interior det F >= 0.5", low, "", 0.5, np.inf, at))
        lines.append(Line("bounce", "highest interior det F <= 2", high, "", 0, 2, at))
        lines.append(Line("bounce", "restitution", rebound[-1], conditions=at))
    if tier == "full" and len(rebound) == 4:
        coarse, middle, fine, half = rebound
        change = abs(fine - middle) / max(abs(middle - coarse), 1e-12)
        at = "10/20/40 across, every step halved at 40"
        lines.append(Line("bounce", "restitution converges: |e40 - e20| / |e20 - e10| < 1", change, "", 0, 1, at))
        halved = abs(half / fine - 1)
        lines.append(Line("bounce", "restitution with every step halved within 5 %", halved, "", 0, 0.05, at))
    return lines


PRESSED = 2e-5  # J: what the fluid's pressure on the falling ball comes to, and that grows


def judge_flight(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, bounce_runs(tier)):
        if result.times[-1] < FLIGHT:
            lines.append(Line("flight", "reaches its end", 0, "", 1, 1, conditions(result)))
            continue
        at = conditions(result, f"t = {FLIGHT:g} s")
        energy, times = result.with_start("elastic_energy"), result.times
        now = result.numbers["flight energy [J]"] = at_time(result, "elastic_energy", FLIGHT)
        lines.append(Line("flight", "elastic energy <= 1e-3 J", now, "J", 0, 1e-3, at))
        early, late = energy[times <= FLIGHT / 2].max(), energy[(times > FLIGHT / 2) & (times <= FLIGHT)].max()
        growth = result.numbers["flight growth"] = float(late / max(early, PRESSED))
        bar = f"not growing: its largest in the second half of the flight over the first (or {PRESSED:g} J) <= 1.1"
        lines.append(Line("flight", bar, growth, "", 0, 1.1, at))
    return lines


def judge_fall(results: Results, tier: str) -> list[Line]:
    exact, lines = reference.release_acceleration(1000.0, reference.ADDED_MASS_UNBOUNDED), []
    for result in found(results, bounce_runs(tier)):
        flying = result.times <= FLIGHT
        fall = -float(slope(result.times[flying], result.velocity[flying, 1])) / GRAVITY
        error = result.numbers["fall error"] = fall / exact - 1
        at = conditions(result, f"fitted to t = {FLIGHT:g} s")
        lines.append(Line("fall", f"free fall {exact:.4f} g within 0.2 %", error, "", -0.002, 0.002, at))
    return lines


def judge_divergence(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, [*bounce_runs(tier), *spin_runs(tier)]):
        run = result.run
        for where, name in (("", "everywhere"), ("_solid", "inside the solid")):
            ratio = divergence_ratio(result, where)
            at = conditions(result, f"{run.scene}, 2-norm, worst step")
            lines.append(Line("divergence", f"after/before {name} <= 0.02", ratio, "", 0, 0.02, at))
    return lines


# --- spin, release from rest, momentum -------------------------------------------------------------------------------


def spin_runs(tier: str) -> list[Experiment]:
    return [
        Experiment("spin", across=across, duration=0.2, dt=0.005, spin=(0, 0, 10.0), limit=3600.0)
        for across in ((20,) if tier == "quick" else (10, 20, 40))
    ]


def judge_spin(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, spin_runs(tier)):
        turning = result.with_start("angular_momentum")[:, 2]
        kept = result.numbers["spin kept"] = float(turning[-1] / turning[0])
        at = conditions(result, "10 rad/s")
        lines.append(Line("spin", "angular momentum kept, 0.95 to 1.005", kept, "", 0.95, 1.005, at))
    return lines


RATIOS = (1e-3, 0.1, 0.5, 1.3, 2.0, 10.0, 1000.0)


def release_runs(tier: str) -> list[Experiment]:
    """A ball in the middle of a cube of half-width 3 R, released from rest; five steps, or one of a frame."""
    steps = (0.005,) if tier == "quick" else (0.0005, 0.005, FRAME)
    return [
        Experiment(
            f"release, dt {dt:.3g}",
            across=across,
            box=(0.6, 0.6, 0.6),
            duration=min(5 * dt, FRAME),
            dt=dt,
            density_ratio=ratio,
            gravity=GRAVITY,
        )
        for across in ((16,) if tier == "quick" else (16, 32))
        for dt in steps
        for ratio in RATIOS
    ]


def judge_release(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, release_runs(tier)):
        run, ratio = result.run, result.run.density_ratio
        exact = reference.release_acceleration(ratio, reference.ADDED_MASS_CUBE_3R)
        speed = -result.velocity[:, 1] / GRAVITY
        first, mean = speed[1] / result.times[1], speed[-1] / result.times[-1]
        result.numbers |= {"C_m": (ratio - 1) / first - ratio, "first step": first / exact - 1, "all": mean / exact - 1}
        bar = 1e-3 if ratio >= 10 else 0.05 if run.across >= 32 else 0.1
        at = conditions(result, f"R/h {run.across / 2:g}, box of half-width 3 R, exact {exact:.4f} g")
        text = f"acceleration in the first step within {bar:g}, density {ratio:g}:1"
        lines.append(Line("added-mass", text, float(first / exact - 1), "", -bar, bar, at))
        if len(speed) > 2:
            text = f"mean acceleration over {len(speed) - 1} steps, density {ratio:g}:1"
            lines.append(Line("added-mass", text, float(mean / exact - 1), conditions=at))
    return lines


def momentum_runs(tier: str) -> list[Experiment]:
    return [
        Experiment(
            "drift in a periodic box",
            across=across,
            duration=0.1,
            dt=0.005,
            density_ratio=ratio,
            walls="periodic",
            center=(0.18, 0.2, 0.2),
            velocity=(0.4, 0.2, 0.0),
        )
        for across in ((10,) if tier == "quick" else (10, 20))
        for ratio in (1000.0, 5.0, 1.3)
    ]


def judge_momentum(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, momentum_runs(tier)):
        total = result.with_start("momentum") + result.with_start("fluid_momentum")
        scale = np.linalg.norm(result.start["momentum"])
        change = np.linalg.norm(np.diff(total, axis=0), axis=1) / scale
        worst = result.numbers["momentum error"] = float(change.max())
        at = conditions(result, f"change of solid + fluid over momentum of the solid; mean step {change.mean():.2g}")
        lines.append(Line("momentum", "error per step <= 1e-6", worst, "", 0, 1e-6, at))
        # Without what the solid's mass, counted in cells, makes of it.
        total = result.velocity * result.start["mass"] + result.with_start("fluid_momentum")
        even = np.linalg.norm(np.diff(total, axis=0), axis=1) / scale
        result.numbers["with the mass held"] = float(even.max())
        at = conditions(result, f"mean step {even.mean():.2g}")
        lines.append(Line("momentum", "error per step, mass of the solid held", float(even.max()), conditions=at))
    return lines


# --- rest ------------------------------------------------------------------------------------------------------------


def rest_runs(tier: str) -> list[Experiment]:
    """Solids that lie on the floor."""
    seconds = 2.0 if tier == "quick" else 10.0
    ball = Experiment("rest", box=(0.4, 0.36, 0.4), floor=0.0, gravity=GRAVITY, duration=seconds)
    bunny = dataclasses.replace(ball, shape="bunny")
    runs = [ball, bunny]
    if tier == "full":
        runs += [dataclasses.replace(run, across=20, limit=7200.0) for run in runs]
    return runs


def judge_rest(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, rest_runs(tier)):
        run = result.run
        if not result.finished:
            lines.append(Line("rest", "finished", 0, "", 1, 1, conditions(result)))
            continue
        late = result.times >= run.duration / 2
        times, at = result.times[late], conditions(result, "second half of the run")
        frames = np.arange(run.duration / 2, run.duration + FRAME / 2, FRAME)
        center = np.stack([np.interp(frames, times, axis) for axis in result.with_start("center")[late].T], axis=1)
        creep = float(np.linalg.norm(np.diff(center, axis=0), axis=1).max() / run.spacing)
        drift = float(np.linalg.norm(slope(frames, center)) * FRAME / run.spacing)
        result.numbers |= {"creep [h/frame]": creep, "drift [h/frame]": drift}
        energy = mechanical_energy(result)[late]
        weight = result.start["mass"] * GRAVITY * RADIUS
        growth = result.numbers["energy growth [mgR]"] = float((energy.max() - energy[0]) / weight)
        lines.append(Line("rest", "creep: largest move of the centre in a frame < 1e-3 h", creep, "h", 0, 1e-3, at))
        bar = "energy not growing: its largest above that at half time <= 1e-4 m g R"
        lines.append(Line("rest", bar, growth, "m g R", -np.inf, 1e-4, at))
        for kind in ("mesh", "cells"):
            worst = max(abs(v - 1) for v in volume_range(result, kind))
            lines.append(Line("rest", f"|V/V0 - 1| by {kind} <= 0.01", worst, "", 0, 0.01, conditions(result)))
    return lines
