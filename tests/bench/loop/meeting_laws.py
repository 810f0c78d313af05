"""Laws of solids that meet a wall or each other: Coulomb's law in every step, overlap at speed, angular momentum."""

from __future__ import annotations

import numpy as np

from . import groups
from .experiment import FRAME, GRAVITY, Experiment, of
from .laws import Line, Results, conditions, found
from .measure import Result
from .shapes import SIZE

# --- friction at a wall ----------------------------------------------------------------------------------------------

ANGLES, FRICTION, SPEED, MODULUS = (30, 50, 60), 0.4, 2.0, 2e5  # degrees from the normal; m/s; Pa
FRICTION_BAR = 1.001
PUSHES = 1e-3  # of the momentum: a normal impulse below this says nothing about the ratio


def friction_runs(tier: str) -> list[Experiment]:
    """In vacuum, where the floor alone changes the ball's momentum beside its weight."""
    return [
        Experiment(
            f"oblique fall, {angle} degrees",
            box=(3 * SIZE, 2 * SIZE, 1.6 * SIZE),
            center=(0.7 * SIZE, 0.75 * SIZE, 0.8 * SIZE),
            duration=0.2,
            density_ratio=None,
            gravity=GRAVITY,
            velocity=(SPEED * float(np.sin(np.deg2rad(angle))), -SPEED * float(np.cos(np.deg2rad(angle))), 0.0),
            youngs_modulus=MODULUS,
            compressible=compressible,
            friction=FRICTION,
        )
        for angle in ANGLES
        for compressible in (False, True)
    ]


def floor_impulses(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """Normal and magnitude of the tangential impulse of the floor in every step [N s]."""
    pushed = np.diff(result.with_start("momentum"), axis=0)
    mass = result.start["mass"]
    normal = pushed[:, 1] + mass * result.run.gravity * result["dt"]
    return normal, np.linalg.norm(pushed[:, [0, 2]], axis=1)


def judge_friction(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, friction_runs(tier)):
        normal, along = floor_impulses(result)
        least = PUSHES * float(result.start["mass"]) * SPEED
        counts = (normal > least) | (along > FRICTION * least)
        over = along[counts] / (FRICTION * np.maximum(normal[counts], least))
        worst = float(over.max()) if over.size else np.nan
        whole = float(along.sum() / (FRICTION * normal[counts].sum()))
        result.numbers |= {"friction over mu normal": worst, "of all steps together": whole}
        at = conditions(result, f"{result.run.scene}{', compressible' * result.run.compressible}, {counts.sum()} steps")
        bar = f"impulse of friction over mu times the normal one, any step, <= {FRICTION_BAR:g}"
        lines.append(Line("friction", bar, worst, "", 0, FRICTION_BAR, at))
        lines.append(Line("friction", "the same of all steps together", whole, conditions=at))
    return lines


# --- two balls that meet ---------------------------------------------------------------------------------------------

OVERLAP, GROWTH, LEAST = 0.75, 1.1, 0.25  # cells; of that at the lowest resolution, if it is not less than LEAST cells
SPIN = 1e-4


def meeting(group: str, across: int, ratio: float | None, compressible: bool) -> Experiment:
    return Experiment(
        group,
        shape="2 balls",
        across=across,
        box=(0.5, 0.36, 0.34) if group == "meet head on" else (0.5, 0.36, 0.3),
        duration=0.035 if group == "meet head on" else 0.08,
        dt=FRAME,
        density_ratio=ratio,
        compressible=compressible,
        limit=1800.0,
        group=group,
    )


def overlap_runs(tier: str) -> list[Experiment]:
    return [
        meeting("meet head on", across, ratio, compressible)
        for ratio, compressible in ((None, False), (None, True), *([(1000.0, False)] if tier == "full" else []))
        for across in (10, 16, 24)
    ]


def judge_overlap(results: Results, tier: str) -> list[Line]:
    lines, coarse = [], {}
    for result in found(results, overlap_runs(tier)):
        run = result.run
        deep = result.numbers["overlap [h]"] = float(result["overlap"].max()) / run.spacing
        key = (run.density_ratio, run.compressible)
        at = conditions(result, f"{groups.MEET_SPEED:g} m/s{', compressible' * run.compressible}")
        bar = f"deepest vertex of one in the other <= {OVERLAP:g} h"
        lines.append(Line("overlap", bar, deep, "h", 0, OVERLAP, at))
        coarse.setdefault(key, deep)
        if run.across == 24:
            bar = f"over that at 10 cells, or over {LEAST:g} h, <= {GROWTH:g}"
            lines.append(Line("overlap", bar, deep / max(LEAST, coarse[key]), "", 0, GROWTH, at))
    return lines


def spin_runs(tier: str) -> list[Experiment]:
    return [
        meeting("meet off centre", across, None, compressible)
        for across in ((10, 16) if tier == "quick" else (10, 16, 24))
        for compressible in (False, True)
    ]


def whole_spin(result: Result) -> np.ndarray:
    """Angular momentum of both about their common centre of mass (steps + 1, 3) [N m s]."""
    bodies = range(1, len(result.run.bodies()) + 1)
    seen = lambda name, k: result.with_start(of(name, k))  # noqa: E731
    masses = [result.start[of("mass", k)] for k in bodies]
    middle = sum(m * seen("center", k) for m, k in zip(masses, bodies, strict=True)) / sum(masses)
    return sum(seen("angular_momentum", k) + np.cross(seen("center", k) - middle, seen("momentum", k)) for k in bodies)


def judge_spin(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, spin_runs(tier)):
        run, spin = result.run, whole_spin(result)
        touching = np.flatnonzero(result["active_rows"] > 0)
        first = int(touching[0]) if touching.size else 0
        change = np.linalg.norm(spin - spin[first], axis=1) / np.linalg.norm(spin[first])
        before, worst, left = float(change[: first + 1].max()), float(change[first:].max()), float(change[-1])
        result.numbers |= {"angular momentum": worst, "in the end": left, "before contact": before}
        words = f"{groups.ASIDE:g} R beside{', compressible' * run.compressible}"
        words += f", in the end {left:.2g}, before {before:.2g}"
        at = conditions(result, f"{words}, {touching.size} steps with contact")
        bar = f"relative change of both solids' angular momentum since they meet <= {SPIN:g}"
        lines.append(Line("off-centre", bar, worst, "", 0, SPIN, at))
    return lines
