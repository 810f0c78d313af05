"""How long a run takes: its steps from speeds, walls and stiffness, its seconds from real steps.

The number of steps follows the limits of the time step, those of the scene and those of the library (`step_limits`): a
step ends where a solid or the fluid has moved so many cells, and near a wall where elastic waves pass a cell. What a
solid does after it has met a wall is not known without simulating, so that the number is a range.
"""

from __future__ import annotations

import dataclasses
import io
import math
import statistics
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..log import Log
from ..scene.bodies import DEFAULT_DENSITY
from ..solver import binding
from ..solver.simulation import step_limits
from .build import build_simulation

if TYPE_CHECKING:
    from ..scene.parts import Scene, Solid

# Passages of a wave for which a solid that has met a wall may strain fast enough to need short steps, by the examples
# and by scenes of `new` and `bench estimate`; it need not at all.
_RINGING = 3
# The fluid beside a solid is this much faster, at most.
_FLUID_PACE = 3.0
# Wall-clock seconds per cell and step on two cores, production: what `new` plans with, before anything was tried.
SECONDS_PER_CELL_STEP = 4e-7
_SECONDS_PER_FRAME = 0.03  # written
# Before the scene is read, and for the picture at the end: of a small scene most of its time.
_SECONDS_AROUND = 1.3
# Trying real steps: seconds in all, and the step that is too long to begin with.
_TRIAL_SECONDS, _LONG_STEP = 4.0, 1.5
# A step later in the run against one of the first: pressure and contact take more, or less.
_DRIFT = (0.5, 1.2)
# The range that is told: the ends differ by this factor at most, and by that at least.
_WIDEST, _NARROWEST = 4.0, 3.0


@dataclasses.dataclass(frozen=True)
class Body:
    """A solid in motion. speed: at the start [m/s]; fall: acceleration [m/s^2]; meets: seconds until it is near a wall,
    inf for never; wave: speed of shear waves [m/s]; size: extent towards that wall [m]."""

    speed: float
    fall: float
    meets: float
    wave: float
    size: float


@dataclasses.dataclass(frozen=True)
class Plan:
    """A run: voxel size [m], seconds per frame, frames to simulate (without the first), limits of a step.

    fluid_speed: what emitters may drive the fluid to [m/s]. limits: fields of EfsiStepLimits.
    """

    voxel: float
    frame: float
    frames: int
    bodies: Sequence[Body]
    limits: Mapping[str, float]
    gravity: float = 9.81
    cfl_solid: float = 1.8
    cfl_fluid: float = 5.0
    longest_step: float = math.inf
    fluid_speed: float = 0.0
    fluid: bool = True


@dataclasses.dataclass
class Trial:
    """Real steps from the start of a run: seconds of each, the first also sets things up; time: simulated [s]."""

    seconds: list[float] = dataclasses.field(default_factory=list)
    time: float = 0.0


def seconds_to_meet(distance: float, speed: float, acceleration: float) -> float:
    """Seconds until `distance` metres are covered, inf where that never happens; speed and acceleration along it."""
    if distance <= 0:
        return 0.0
    root = speed * speed + 2 * acceleration * distance
    if root < 0 or (acceleration <= 0 and speed <= 0):
        return math.inf
    return 2 * distance / (speed + math.sqrt(root)) if speed + math.sqrt(root) > 0 else math.inf


def steps(plan: Plan, begin: float = 0.0) -> tuple[float, float]:
    """(fewest, most) steps of the run from `begin` on, a number of frames."""
    fewest = most = 0.0
    for number in range(math.floor(begin), plan.frames):
        part = min(1.0, number + 1 - begin)
        least, greatest = _steps_of(plan, number)
        fewest, most = fewest + part * least, most + part * greatest
    return fewest, most


def _steps_of(plan: Plan, number: int) -> tuple[float, float]:
    """(fewest, most) steps of a frame, counted from 0."""
    least, greatest = _longest_steps(plan, number * plan.frame, (number + 1) * plan.frame)
    return max(1.0, math.ceil(plan.frame / greatest - 1e-6)), max(1.0, math.ceil(plan.frame / least - 1e-6))


def _longest_steps(plan: Plan, begin: float, end: float) -> tuple[float, float]:
    """(shortest, longest) step that is to be expected between two times [s]."""
    h, limits = plan.voxel, plan.limits
    shortest = longest = plan.longest_step
    speed = 0.0
    for body in plan.bodies:
        speed = max(speed, body.speed + body.fall * min(end, body.meets))
        if end <= body.meets:
            continue
        hit = body.speed + body.fall * body.meets
        rest = time_to_move(0.0, plan.gravity, limits["contact_cfl"] * h)
        closing = time_to_move(hit, plan.gravity, limits["contact_cfl"] * h)
        pace = max(limits["contact_pace"] * h, limits["contact_share"] * body.size)
        wave = pace / body.wave if limits["contact_pace"] else math.inf
        rings = begin < body.meets + _RINGING * 2 * body.size / body.wave
        shortest = min(shortest, rest, *((closing, wave) if rings else ()))
    if plan.bodies:
        far = limits["flight_cfl"]
        alone = len(plan.bodies) == 1 and end <= plan.bodies[0].meets
        shortest = min(shortest, time_to_move(speed, plan.gravity, (far if alone else plan.cfl_solid) * h))
        if not _all_met(plan, begin):
            longest = min(longest, time_to_move(speed, plan.gravity, far * h))
    if plan.fluid:
        fluid = max(plan.fluid_speed, _FLUID_PACE * speed)
        shortest = min(shortest, time_to_move(fluid, 0.0, plan.cfl_fluid * h))
    return shortest, longest


def _all_met(plan: Plan, time: float) -> bool:
    return bool(plan.bodies) and all(body.meets < time for body in plan.bodies)


def plan_of(scene: Scene) -> Plan:
    """The plan of a scene that was read and examined."""
    domain = scene.domain
    gravity = np.array(domain["gravity"], float)
    lightest = min((solid.values["density"] for solid in scene.solids), default=DEFAULT_DENSITY)
    limits = step_limits(domain, lightest)
    reach = limits["contact_reach"] * domain["voxel_size"]
    fluid = bool(domain["ambient_fluid"])
    heights = float(np.linalg.norm(domain["domain_size"]))
    lift, jet = 0.0, 0.0
    for emitter in scene.emitters:
        push = abs(domain["temperature_buoyancy"]) * np.abs(emitter.over_time("temperature")).max()
        lift = max(lift, float(push), abs(domain["smoke_buoyancy"]) * emitter.over_time("density").max())
        if emitter.values["has_velocity"]:
            jet = max(jet, float(np.linalg.norm(emitter.over_time("velocity"), axis=-1).max()))
    for force in scene.forces:
        values = force.values
        if values["kind"] == binding.FORCE_KINDS["wind"]:
            jet = max(jet, float(np.linalg.norm(values["wind_velocity"])) + values["noise_speed"])
    return Plan(
        voxel=domain["voxel_size"],
        frame=1 / scene.fps,
        frames=len(scene.frames) - 1,
        bodies=[_body(solid, domain, reach, gravity) for solid in scene.solids],
        gravity=float(np.linalg.norm(gravity)),
        cfl_solid=domain["cfl_solid"],
        cfl_fluid=domain["cfl_fluid"],
        longest_step=domain["max_time_step"] or math.inf,
        fluid_speed=math.hypot(jet, math.sqrt(2 * lift * heights)),
        fluid=fluid,
        limits=limits,
    )


def shear_modulus(values: Mapping[str, Any]) -> float:
    """Of the fields of EfsiSolidDef [Pa]."""
    return values["youngs_modulus"] / 2 / (1 + values["poissons_ratio"])


def _body(solid: Solid, domain: dict, reach: float, gravity: np.ndarray) -> Body:
    """A solid of a scene: it falls, or rises where the fluid is heavier, until it is `reach` metres from a wall."""
    low, high = np.array(domain["domain_min"]), np.add(domain["domain_min"], domain["domain_size"])
    values, report = solid.values, solid.start.report
    start, end = np.array(report["extent_min"]), np.array(report["extent_max"])
    velocity = np.array(values["velocity"], float)
    rho = values["density"]
    fluid = domain["fluid_density"] if domain["ambient_fluid"] else 0.0
    fall = gravity * ((rho - fluid) / (rho + fluid / 2))  # the added mass of a sphere
    meets, size = math.inf, float((end - start).max())
    for face, wall in enumerate(domain[f"wall[{face}]"] for face in range(6)):
        if wall not in (binding.WALLS["slip"], binding.WALLS["noSlip"]):
            continue
        axis, sign = face // 2, 1 if face % 2 else -1
        if sign * velocity[axis] <= 0 and sign * fall[axis] <= 0:
            continue  # a wall that it does not move towards presses nothing
        gap = (high[axis] - end[axis]) if face % 2 else (start[axis] - low[axis])
        distance = gap - reach
        when = seconds_to_meet(distance, sign * velocity[axis], sign * fall[axis])
        if when < meets:
            meets, size = when, float((end - start)[axis])
    turning = float(np.linalg.norm(values["angular_velocity"]) * np.linalg.norm(end - start) / 2)
    shear = shear_modulus(values)
    speed = float(np.linalg.norm(velocity)) + turning
    return Body(speed, float(np.linalg.norm(fall)), meets, math.sqrt(shear / rho), size)


def try_steps(scene: Scene, threads: int, memory_limit: int) -> Trial:
    """The first steps of the scene on this machine; none where one would take long.

    Takes at most five seconds in all once the solids are in place. Raises LibraryError where the scene cannot start
    or its first steps fail.
    """
    trial, frame = Trial(), 1 / scene.fps
    cells = math.prod(edge / scene.domain["voxel_size"] for edge in scene.domain["domain_size"])
    if cells * SECONDS_PER_CELL_STEP * 2 / threads > _LONG_STEP:
        return trial
    end = (len(scene.frames) - 1) * frame * (1 - 1e-6)
    begun = time.monotonic()
    simulation = build_simulation(scene, threads, memory_limit, Log(io.StringIO())).simulation
    with simulation:
        while trial.time < end and time.monotonic() - begun + max(trial.seconds, default=0) < _TRIAL_SECONDS:
            step = time.monotonic()
            frames = math.floor(simulation.time / frame + 1e-6)  # done; what rounding leaves of one is no step
            simulation.step((frames + 1) * frame - simulation.time)
            trial.seconds.append(time.monotonic() - step)
            trial.time = simulation.time
    return trial


def per_step(trial: Trial, threads: int, cells: float) -> float:
    """Seconds of a step after those that were tried."""
    usual = trial.seconds[1:] or trial.seconds
    later = usual[len(usual) // 2 :]
    return statistics.median(later) if later else cells * SECONDS_PER_CELL_STEP * 2 / threads


def seconds(plan: Plan, trial: Trial, each: float, reading: float = 0.0) -> tuple[float, float, float]:
    """(fewest, likely, most) seconds of the whole run. each: of a step later on; reading: of the scene.

    The likely one is the geometric mean of what the steps may come to, and the range around it is no wider than it
    can be told honestly.
    """
    begin = trial.time / plan.frame if trial.seconds else 0.0
    fixed = _SECONDS_AROUND + reading + plan.frames * _SECONDS_PER_FRAME + sum(trial.seconds)
    low, high = (fixed + count * each * drift for count, drift in zip(steps(plan, begin), _DRIFT, strict=True))
    likely = math.sqrt(low * high)
    widest, narrowest = math.sqrt(_WIDEST), math.sqrt(_NARROWEST)
    low = min(max(low, likely / widest), likely / narrowest)
    return low, likely, max(min(high, likely * widest), likely * narrowest)


def describe(plan: Plan, trial: Trial, threads: int, cells: float, reading: float = 0.0) -> str:
    """One line for users. reading: seconds that it took to read the scene."""
    each = per_step(trial, threads, cells)
    low, likely, high = seconds(plan, trial, each, reading)
    fewest, most = (len(trial.seconds) + n for n in steps(plan, trial.time / plan.frame if trial.seconds else 0.0))
    tried = len(trial.seconds)
    how = f"from {tried} trial steps" if tried else "estimated from the number of cells"
    count = f"{fewest:,.0f} to {most:,.0f}" if most > 1.1 * fewest else f"{most:,.0f}"
    return (
        f"time: about {_duration(likely)} ({_duration(low)} to {_duration(high)}) for {plan.frames} "
        f"frames on {threads} threads; {count} steps of about {each:.2g} s, {how}"
    )


def _duration(value: float) -> str:
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if value >= 1.5 * size:
            return f"{value / size:.2g} {unit}"
    return f"{value:.2g} s"


def time_to_move(speed: float, acceleration: float, distance: float) -> float:
    """Longest t with (speed + acceleration t) t <= distance [s], as the library has it."""
    if acceleration > 0:
        return 2 * distance / (speed + math.sqrt(speed * speed + 4 * acceleration * distance))
    return distance / speed if speed > 0 else math.inf
