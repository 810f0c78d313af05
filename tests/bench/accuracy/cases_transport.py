"""Transport of a solid's map in a prescribed velocity, which is given before every step.

The solid is compressible, in vacuum and all but without stiffness, so that nothing else changes the velocity. Given is
that of the middle of the step, for which the transport traces particles back, and a constant: the solver moves the
centre by the mean velocity of where the solid is before the step, which has to be that of its particles over the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Mesh, Simulation
from loop import shapes

from .cases_coupled import disc_mesh
from .cases_fluid import nodes
from .meter import Failed, Measured, Meter
from .sweep import Run

NEXT_TO_NOTHING = 1e-6  # Pa
NO_LIMIT = 1000.0  # of the displacement per step: every step is as long as what was given is for
Wind = Callable[[np.ndarray, np.ndarray, np.ndarray, float], list[np.ndarray]]


def carried(run: Run, meter: Meter, mesh: Mesh, wind: Wind, end: float, deep: bool = False) -> dict[str, Any]:
    """Carries a solid to a time: its displacement there over its size, its volume, the largest |det F - 1| so far."""
    edge, worst, given = run.length, 0.0, 0.0
    values: dict[str, Any] = {
        "domain_size": (edge, edge, edge if deep else run.spacing),
        "voxel_size": run.spacing,
        "gravity": (0.0, 0.0, 0.0),
        "ambient_fluid": 0,
        "threads": 1,
        **{f"wall[{face}]": binding.WALLS["slip"] for face in range(6)},
    }
    with Simulation(values | {"cfl_solid": NO_LIMIT} | run.definition) as simulation:
        solid, _ = simulation.add_solid(mesh, density=1.0, youngs_modulus=NEXT_TO_NOTHING, compressible=1)
        start = simulation.solid_diagnostics(solid)
        rest = mesh.points.astype(float)

        def give(size: float) -> None:
            nonlocal given
            given = size
            field, place = simulation.field("solid_velocity", solid)
            now = np.stack(wind(*nodes(place, field.shape[1:]), simulation.time + size / 2))
            drift = drift_of(simulation, wind, size)
            simulation.set_field("solid_velocity", now + drift[:, None, None, None], solid)

        def look(info: dict[str, Any]) -> None:
            nonlocal worst
            if abs(info["dt"] - given) > 1e-9:
                raise Failed(f"a step took {info['dt']:.4g} s, its velocity was given for {given:.4g} s")
            worst = max(worst, abs(info["min_det_f"] - 1), abs(info["max_det_f"] - 1))

        meter.advance(simulation, end, run.largest_step, after=look, before=give)
        moved = simulation.surface(solid)[0].astype(float) - rest
        now = simulation.solid_diagnostics(solid)
    if not np.isfinite(moved).all():
        raise Failed("the displacement is not finite")
    return {
        "moved": moved,
        "points": rest,
        "volume": now["volume_mesh"] / start["volume_mesh"] - 1,
        "det F": worst,
    }


def drift_of(simulation: Simulation, wind: Wind, size: float) -> np.ndarray:
    """What the solid's particles move faster over a step, in the mean, than the wind blows in its middle [m/s]."""
    fraction, place = simulation.field("solid_fraction")
    inside = fraction[0] > 0
    weight = fraction[0][inside].astype(float)
    at = np.stack([axis[inside] for axis in nodes(place, fraction.shape[1:])])
    middle = np.stack(wind(*at, simulation.time + size / 2))
    return (mean_velocity(wind, at, simulation.time, size) - middle) @ weight / weight.sum()


def mean_velocity(wind: Wind, at: np.ndarray, time: float, size: float) -> np.ndarray:
    """Of particles over a step that begins at `time` (Runge and Kutta's fourth order)."""
    first = np.stack(wind(*at, time))
    second = np.stack(wind(*(at + size / 2 * first), time + size / 2))
    third = np.stack(wind(*(at + size / 2 * second), time + size / 2))
    fourth = np.stack(wind(*(at + size * third), time + size))
    return (first + 2 * second + 2 * third + fourth) / 6


def numbers_of(seen: dict[str, Any]) -> dict[str, float]:
    return {"volume off": seen["volume"], "largest |det F - 1|": seen["det F"]}


def root_mean_square(away: np.ndarray) -> float:
    return float(np.sqrt((away**2).sum(axis=1).mean()))


def rigid_turn(run: Run, meter: Meter) -> Measured:
    """A disc beside the middle goes once around it."""
    middle = run.length / 2
    wind = lambda x, y, z, t: [-(y - middle), x - middle, np.zeros_like(z)]  # noqa: E731
    mesh = disc_mesh((0.5, 0.75), 0.15, 0.0, run.spacing)
    seen = carried(run, meter, mesh, wind, 2 * np.pi)
    error = root_mean_square(seen["moved"]) / 0.3
    return Measured(error, 0.0, "RMS of u at the surface over the diameter", "one turn", error, numbers_of(seen))


def single_vortex(run: Run, meter: Meter) -> Measured:
    """LeVeque's vortex, which turns back at half time: u ends at 0."""
    period = run.of["period"]

    def wind(x: np.ndarray, y: np.ndarray, z: np.ndarray, t: float) -> list[np.ndarray]:
        now = np.cos(np.pi * t / period)
        u = np.sin(np.pi * x) ** 2 * np.sin(2 * np.pi * y) * now
        v = -np.sin(2 * np.pi * x) * np.sin(np.pi * y) ** 2 * now
        return [u, v, np.zeros_like(z)]

    seen = carried(run, meter, disc_mesh((0.5, 0.75), 0.15, 0.0, run.spacing), wind, period)
    error = root_mean_square(seen["moved"]) / 0.3
    return Measured(error, 0.0, "RMS of u at the surface over the diameter", f"T = {period:g}", error, numbers_of(seen))


def enright(run: Run, meter: Meter) -> Measured:
    """A ball in LeVeque's three-dimensional flow, which turns back at half time."""
    period = run.of["period"]

    def wind(x: np.ndarray, y: np.ndarray, z: np.ndarray, t: float) -> list[np.ndarray]:
        one, two = (lambda a: np.sin(np.pi * a) ** 2), (lambda a: np.sin(2 * np.pi * a))
        now = np.cos(np.pi * t / period)
        return [
            2 * one(x) * two(y) * two(z) * now,
            -two(x) * one(y) * two(z) * now,
            -two(x) * two(y) * one(z) * now,
        ]

    points, triangles = shapes.ball()
    mesh = Mesh(points * 1.5 + 0.35, np.full(len(triangles), 3), triangles.ravel())
    seen = carried(run, meter, mesh, wind, period, deep=True)
    error = root_mean_square(seen["moved"]) / 0.3
    return Measured(error, 0.0, "RMS of u at the surface over the diameter", f"T = {period:g}", error, numbers_of(seen))


CASES = {"rigid_turn": rigid_turn, "single_vortex": single_vortex, "enright": enright}
