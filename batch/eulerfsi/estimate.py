"""How long a run takes: its steps from speeds, walls and stiffness, its seconds from a few real steps.

The number of steps follows the limits of the library's time step (sim/time_step.cpp): a step ends where a solid or
the fluid has moved so many cells, and near a wall where elastic waves pass a cell. What a solid does after it has met
a wall is not known without simulating, so that the number is a range.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

# Limits of the library's steps, in cells (kContactCfl, kContactPace, kContactReach there).
_CONTACT_CFL, _CONTACT_PACE = 0.4, 0.7
CONTACT_REACH = 2.0
# Periods of its slowest wave for which a solid that has met a wall strains fast enough to need short steps: at least
# and at most, by the examples and by scenes of `new`.
_RINGING = (2, 20)
# The fluid beside a solid is this much faster, at most.
_FLUID_PACE = 3.0
# Wall-clock seconds per cell and step on two cores, production: what `new` plans with.
SECONDS_PER_CELL_STEP = 4e-7


@dataclasses.dataclass(frozen=True)
class Body:
    """A solid in motion. speed: at the start [m/s]; fall: acceleration [m/s^2]; meets: seconds until it is near a wall,
    inf for never; wave: speed of shear waves [m/s]; size: longest edge [m]."""

    speed: float
    fall: float
    meets: float
    wave: float
    size: float


@dataclasses.dataclass(frozen=True)
class Plan:
    """A run: voxel size [m], seconds per frame, frames to simulate (without the first), limits of a step."""

    voxel: float
    frame: float
    frames: int
    bodies: Sequence[Body]
    gravity: float = 9.81
    cfl_solid: float = 1.8
    cfl_fluid: float = 5.0
    longest_step: float = math.inf
    fluid_speed: float = 0.0
    fluid: bool = True
    resolve_impacts: bool = True


def seconds_to_meet(distance: float, speed: float, acceleration: float) -> float:
    """Seconds until `distance` metres are covered, inf where that never happens; speed and acceleration along it."""
    if distance <= 0:
        return 0.0
    root = speed * speed + 2 * acceleration * distance
    if root < 0 or (acceleration <= 0 and speed <= 0):
        return math.inf
    return 2 * distance / (speed + math.sqrt(root)) if speed + math.sqrt(root) > 0 else math.inf


def steps(plan: Plan) -> tuple[float, float]:
    """(fewest, most) steps of the whole run."""
    fewest = most = 0.0
    for number in range(plan.frames):
        least, greatest = _longest_steps(plan, number * plan.frame, (number + 1) * plan.frame)
        fewest += max(1.0, math.ceil(plan.frame / greatest - 1e-6))
        most += max(1.0, math.ceil(plan.frame / least - 1e-6))
    return fewest, most


def _longest_steps(plan: Plan, begin: float, end: float) -> tuple[float, float]:
    """(shortest, longest) step that is to be expected between two times [s]."""
    h = plan.voxel
    shortest = longest = plan.longest_step
    speed = 0.0
    for body in plan.bodies:
        speed = max(speed, body.speed + body.fall * min(end, body.meets))
        if end <= body.meets:
            continue
        hit = body.speed + body.fall * body.meets
        rest, wave = time_to_move(0.0, plan.gravity, _CONTACT_CFL * h), _CONTACT_PACE * h / body.wave
        closing = time_to_move(hit, plan.gravity, _CONTACT_CFL * h)
        surely, maybe = (begin < body.meets + count * 2 * body.size / body.wave for count in _RINGING)
        wave = wave if plan.resolve_impacts else math.inf
        shortest = min(shortest, rest, *((closing, wave) if maybe else ()))
        longest = min(longest, rest, *((wave,) if surely else ()))
    free = time_to_move(speed, plan.gravity, plan.cfl_solid * h) if plan.bodies else math.inf
    shortest, longest = min(shortest, free), min(longest, free if not _all_met(plan, begin) else math.inf)
    if plan.fluid:
        fluid = max(plan.fluid_speed, speed)
        shortest = min(shortest, time_to_move(_FLUID_PACE * fluid, 0.0, plan.cfl_fluid * h))
        longest = min(longest, time_to_move(plan.fluid_speed, 0.0, plan.cfl_fluid * h))
    return shortest, longest


def _all_met(plan: Plan, time: float) -> bool:
    return bool(plan.bodies) and all(body.meets < time for body in plan.bodies)


def time_to_move(speed: float, acceleration: float, distance: float) -> float:
    """Longest t with (speed + acceleration t) t <= distance [s], as the library has it."""
    if acceleration > 0:
        return 2 * distance / (speed + math.sqrt(speed * speed + 4 * acceleration * distance))
    return distance / speed if speed > 0 else math.inf
