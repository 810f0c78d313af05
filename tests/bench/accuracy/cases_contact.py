"""Contact: restitution, two balls, Hertz at rest and in an impact, an incline, a stopping distance. Lengths [m]."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Simulation
from loop import contact_laws, groups, laws
from loop.experiment import GRAVITY, POISSONS_RATIO, RADIUS, Experiment
from loop.shapes import SIZE, blocks, make_shape

from .cases_coupled import laboratory, scaled_modulus
from .meter import Failed, Measured, Meter
from .sweep import Run

MIDDLE = 0.05  # of the impulse of an impact, at either end of it, that is not looked at
APART = 2.0  # cells between two balls at the start


def thrown(run: Run, **more: Any) -> Experiment:
    """The laboratory's ball, one cell above the floor in vacuum without gravity, thrown down."""
    speed = run.of["speed"]
    return Experiment(
        "thrown at a floor",
        across=run.cells,
        box=(0.4, 0.5, 0.4),
        floor=SIZE / run.cells,
        density_ratio=None,
        velocity=(0.0, -speed, 0.0),
        youngs_modulus=scaled_modulus(run),
        duration=SIZE / run.cells / speed + run.of["duration"],
        **more,
    )


def bounce_vacuum(run: Run, meter: Meter) -> Measured:
    """Restitution of the mean velocity; its limit in h is Richardson's."""
    result = laboratory(run, meter, thrown(run))
    up = result.velocity[:, 1]
    if up[-1] <= 0:
        raise Failed("the ball has not left the floor")
    value = float(up.max() / run.of["speed"])
    numbers = {"largest |V/V0 - 1|": float(np.abs(result["volume_mesh"] / result.start["volume_mesh"] - 1).max())}
    return Measured(value, None, "relative to Richardson's limit, restitution", "once off the floor", numbers=numbers)


def bounce_fluid(run: Run, meter: Meter) -> Measured:
    """The bounce of `bench loop`: in light fluid, with gravity."""
    result = laboratory(run, meter, dataclasses.replace(laws.bounce_runs("quick")[0], across=run.cells))
    return Measured(laws.restitution(result), None, "relative to Richardson's limit, restitution", "whole run")


def middle_share(part: float, steps: int = 4000) -> float:
    """Of Hertz's time of contact the share in which the momentum goes from `part` to 1 - `part` of its change."""
    dt, x, v, speeds = 3.3 / steps, 0.0, 1.0, [1.0]  # x'' = -x^1.5 from v = 1; it parts after 3.218
    while x >= 0 and len(speeds) < 2 * steps:
        v -= dt / 2 * max(x, 0.0) ** 1.5
        x += dt * v
        v -= dt / 2 * max(x, 0.0) ** 1.5
        speeds.append(v)
    return float(np.diff(times_of(np.arange(len(speeds)) * dt, np.array(speeds), part))[0] / (len(speeds) * dt))


def times_of(times: np.ndarray, speeds: np.ndarray, part: float) -> np.ndarray:
    """When a velocity has made `part` and 1 - `part` of its change from the first to the last value."""
    done = np.maximum.accumulate((speeds - speeds[0]) / (speeds[-1] - speeds[0]))
    return np.interp([part, 1 - part], done, times)


def hertz_impact(run: Run, meter: Meter) -> Measured:
    """Time in contact with the floor of a compressible ball, by Hertz: 5.0869 R (rho / E*)^0.4 v^-0.2.

    From 5 to 95 % of the change of momentum: begin and end of a contact are too soft to be seen.
    """
    result = laboratory(run, meter, thrown(run, compressible=True))
    speed, up = run.of["speed"], result.velocity[:, 1]
    if up[-1] <= 0:
        raise Failed("the ball has not left the floor")
    off = int(np.argmax(up))
    begin, end = times_of(result.times[: off + 1], up[: off + 1], MIDDLE)
    modulus = scaled_modulus(run) / (1 - POISSONS_RATIO**2)
    exact = 5.086919 * RADIUS * (1000.0 / modulus) ** 0.4 * speed**-0.2
    value = float(end - begin) / middle_share(MIDDLE)
    numbers = {"restitution": float(up[off] / speed)}
    return Measured(value, exact, "relative, time in contact", "5 to 95 % of the impulse", numbers=numbers)


def hertz_static(run: Run, meter: Meter) -> Measured:
    """The load of `bench loop`'s sphere on a block by Hertz's law for a block of that height; `cells` over a radius."""
    base = contact_laws.hertz_runs("quick")[0]
    result = laboratory(run, meter, dataclasses.replace(base, across=2 * run.cells))
    height, late = result.with_start("center@2")[:, 1], result.times >= base.duration / 2
    load = float(result.start["mass@2"] * GRAVITY)
    approach = float(height[0] - np.median(height[late]))
    found = float(contact_laws.hertz_load(approach, groups.BLOCK[1]))
    numbers = {"approach over R": approach / RADIUS}
    return Measured(found, load, "relative, load by Hertz's law", "median of the second half", numbers=numbers)


def two_balls(run: groups.Place) -> groups.Bodies:
    """Two equal balls that meet head-on along x; the experiment's load is the speed of each."""
    out = []
    for side in (-1, 1):
        points, triangles = make_shape("ball", 10).points, make_shape("ball", 10).triangles()
        center = np.array(run.box) / 2 + [side * (RADIUS + APART / 2 * run.spacing), 0.0, 0.0]
        values = {"density": 1000.0, "youngs_modulus": run.youngs_modulus, "poissons_ratio": POISSONS_RATIO}
        out.append((groups.mesh_of(points, triangles, center), values | {"velocity": (-side * run.load, 0.0, 0.0)}))
    return out


groups.GROUPS["two balls"] = two_balls


def meeting_balls(run: Run, meter: Meter) -> Measured:
    """Relative speed after over before; what both together gain of momentum."""
    speed = run.of["speed"]
    meeting = Experiment(
        "two balls",
        shape="2 balls",
        across=run.cells,
        box=(0.7, 0.3, 0.3),
        density_ratio=None,
        youngs_modulus=scaled_modulus(run),
        duration=APART * SIZE / run.cells / (2 * speed) + run.of["duration"],
        load=speed,
        group="two balls",
    )
    result = laboratory(run, meter, meeting)
    first, second = (result.with_start(name)[:, 0] for name in ("momentum", "momentum@2"))
    apart = (second - first) / result.start["mass"]
    if apart[-1] <= 0:
        raise Failed("the balls have not parted")
    gained = float(np.abs(first + second).max() / (result.start["mass"] * speed))
    value = float(apart.max() / (2 * speed))
    numbers = {"momentum gained": gained}
    return Measured(value, None, "relative to Richardson's limit, restitution", "once apart", numbers=numbers)


def block(run: Run, meter: Meter, slope: float, speed: float, end: float) -> np.ndarray:
    """Way [m] of a block on a floor that is tilted by `slope` [rad], thrown along it; one value per step."""
    h, size = run.spacing, np.array([1.0, 0.5, 1.0]) * run.length
    values: dict[str, Any] = {
        "domain_size": (run.of["way"] + 3 * run.length, 1.2 * run.length, 2 * run.length),
        "voxel_size": h,
        "gravity": (GRAVITY * np.sin(slope), -GRAVITY * np.cos(slope), 0.0),
        "ambient_fluid": 0,
        "threads": 1,
        **{f"wall[{face}]": binding.WALLS["slip"] for face in range(6)},
    }
    parts = np.array([run.cells, max(1, run.cells // 2), run.cells])
    points, triangles = blocks(np.ones(parts, bool), tuple(size / parts))
    mesh = groups.mesh_of(points, triangles, np.array([run.length, size[1] / 2, run.length]))
    way = []
    with Simulation(values | run.definition) as simulation:
        solid, _ = simulation.add_solid(
            mesh,
            density=1000.0,
            youngs_modulus=groups.STACK_MODULUS,
            poissons_ratio=0.3,
            rayleigh_beta=groups.DAMPING,
            friction=run.of["friction"],
            velocity=(speed, 0.0, 0.0),
        )
        start = simulation.solid_diagnostics(solid)["center"][0]
        look = lambda _info: way.append(simulation.solid_diagnostics(solid)["center"][0] - start)  # noqa: E731
        meter.advance(simulation, end, run.largest_step, after=look)
    return np.array(way)


def incline(run: Run, meter: Meter) -> Measured:
    """x = g (sin - mu cos) t^2 / 2."""
    slope, mu, way = np.radians(run.of["slope"]), run.of["friction"], run.of["way"]
    pull = GRAVITY * (np.sin(slope) - mu * np.cos(slope))
    end = float(np.sqrt(2 * way / pull))
    value = float(block(run, meter, slope, 0.0, end)[-1])
    return Measured(value, way, "relative, way down the slope", f"t = {end:.3g} s")


def stopping(run: Run, meter: Meter) -> Measured:
    """v^2 / (2 mu g)."""
    mu, way = run.of["friction"], run.of["way"]
    speed = float(np.sqrt(2 * mu * GRAVITY * way))
    found = block(run, meter, 0.0, speed, 1.5 * speed / (mu * GRAVITY))
    creep = float(found[-1] - found[int(0.8 * len(found))])
    return Measured(float(found[-1]), way, "relative, way", "until it lies", numbers={"creep at the end [m]": creep})


CASES = {
    "bounce_vacuum": bounce_vacuum,
    "bounce_fluid": bounce_fluid,
    "hertz_impact": hertz_impact,
    "hertz_static": hertz_static,
    "two_balls": meeting_balls,
    "incline": incline,
    "stopping": stopping,
}
