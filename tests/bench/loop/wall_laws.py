"""The laws of walls: solids thrown at a floor, softer and softer, judged by laws of random scenes."""

from __future__ import annotations

import dataclasses

import numpy as np
from random_scenes import judge
from random_scenes.record import TOUCH, Record
from random_scenes.scenes import Scene
from random_scenes.solids import center_of_volume

from .experiment import FRAME, RADIUS, Experiment
from .laws import Line, Results, conditions, found
from .measure import Result
from .shapes import SIZE
from .survival import pairwise

JUDGED = ("finished", "depth", "clear", "rebound", "shape", "energy", "ledger")  # of random_scenes.judge.LAWS
SPEED, GRAVITY = 2.0, 2.0  # m/s; m/s^2: so little that the softest solid carries its weight
DENSITY = 1000.0  # kg/m^3
MOST_PRESSURE = 1.0  # Young's moduli: more is an aim
FACTORS = (
    (("ball", 0.0), ("box", 0.0), ("box", 0.6)),  # and how it is turned [rad]
    (0.1, 0.5, 1.0, 2.0),  # rho v^2 / 2 over Young's modulus
    (FRAME, 1 / 240),  # largest step [s]
    (None, 1000.0),  # density solid : fluid
)


def wall_runs(tier: str) -> list[Experiment]:
    """At every size every two values of different factors meet."""
    sizes = (10, 16) if tier == "quick" else (10, 16, 24, 40)
    return [thrown(across, *row) for across in sizes for row in pairwise(FACTORS)]


def thrown(across: int, how: tuple[str, float], pressure: float, dt: float, ratio: float | None) -> Experiment:
    """Down at a floor that is two cells below it, until it is well off it again; in vacuum, where room costs nothing,
    until it has swung out."""
    (shape, turn), modulus = how, DENSITY * SPEED**2 / 2 / pressure
    return Experiment(
        f"thrown at a floor, rho v^2/2 = {pressure:g} E{', turned' * (turn > 0)}",
        shape,
        across,
        box=(2 * SIZE, (6 if ratio is None else 3) * SIZE, 2 * SIZE),
        floor=2 * SIZE / across,
        turn=turn,
        duration=(0.6 if ratio is None else 0.15) + 8 * RADIUS / float(np.sqrt(modulus / DENSITY)),
        dt=dt,
        density_ratio=ratio,
        gravity=GRAVITY,
        velocity=(0.0, -SPEED, 0.0),
        youngs_modulus=modulus,
        limit=7200.0,
    )


def pressure_of(run: Experiment) -> float:
    """rho v^2 / 2 over Young's modulus."""
    return DENSITY * SPEED**2 / 2 / run.youngs_modulus


def as_scene(run: Experiment) -> Scene:
    """The run as the laws of random scenes see it."""
    mesh = run.mesh()
    points, triangles = mesh.points.astype(float), mesh.triangles()
    reach = np.linalg.norm(points - center_of_volume(points, triangles), axis=1).max()
    same = {field.name: getattr(run, field.name) for field in dataclasses.fields(Experiment)}
    return Scene(
        **same | {"shape": "sphere" if run.shape == "ball" else run.shape},
        size=SIZE,
        faces=run.face_kinds,
        pull=(0.0, -run.gravity, 0.0),
        impact_pressure=pressure_of(run),
        fastest=SPEED,
        reach=float(reach),
    )


def least_misfit(record: Record) -> float:
    """While it is off the walls after it has met one, and may swing, over the size; nan: it never is."""
    touching = record.gaps.min(axis=1) <= TOUCH
    free = ~touching & np.logical_or.accumulate(touching)
    return float(record.series("misfit")[free].min()) / SIZE if free.any() else np.nan


def judge_walls(results: Results, tier: str) -> list[Line]:
    lines = []
    for result in found(results, wall_runs(tier)):
        run, beyond = result.run, pressure_of(result.run) > MOST_PRESSURE * (1 + 1e-9)
        seen = Result(as_scene(run), result.failure, result.start, result.columns)
        result.numbers["least misfit"] = least_misfit(Record(seen))
        for line in (line for line in judge.judge(seen) if line.law in JUDGED):
            aim = " (an aim)" * (beyond and line.law != "ledger")
            low, high = (None, None) if aim or np.isnan(line.measured) else (line.low, line.high)
            more = "" if line.law == "finished" else line.conditions
            at = conditions(result, ", ".join(filter(None, [run.scene, more])))
            result.numbers[line.law] = line.measured
            lines.append(Line("walls", f"{line.law}: {line.bar}{aim}", line.measured, "", low, high, at))
    return lines
