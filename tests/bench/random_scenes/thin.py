"""Random scenes of thin bodies: straps, sheets, ropes, rings and chains of 3 to 6 cells, and what meets them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from eulerfsi.solver.simulation import Simulation
from loop import thin_shapes
from loop.thin_shapes import Shape
from loop.watch import Given, Thin, Watch

from .contact import Body, ContactScene, reach_of, scene_values, weigh
from .draw import Draw, constant
from .scenes import ADDED_MASS, draw_poisson, draw_ratio


@dataclasses.dataclass(frozen=True)
class ThinScene(ContactScene):
    """Thin bodies in place, some of them held; shapes: with their traces, where they start."""

    shapes: tuple[Shape, ...] = dataclasses.field(default=(), compare=False, repr=False)
    given: tuple[Given, ...] = dataclasses.field(default=(), compare=False, repr=False)
    thick: float = 0.0  # cells

    @property
    def held(self) -> bool:
        """Something is pinned."""
        return bool(self.given)

    @property
    def words(self) -> str:
        return f"{self.thick:.1f} cells thick, {len(self.given)} pins, {super().words}"

    def company(self, simulation: Simulation) -> Watch:
        bodies = tuple((shape, values) for shape, (_, values) in zip(self.shapes, self.bodies(), strict=True))
        return Watch(simulation, Thin(bodies, self.given), self.spacing)


@dataclasses.dataclass
class Plan:
    """Shapes around the origin [m], their velocities, names, and what holds them; down: gravity acts."""

    shapes: list[Shape]
    names: list[str]
    velocities: list[np.ndarray]
    given: list[Given]
    gravity: bool = True
    floor: bool = False  # the lowest one lies near the floor


def make_thin_scene(seed: int, number: str) -> ThinScene:
    """The scene "t0", "t1", ... of a seed."""
    draw = Draw(seed, number)
    kind, size, thick = draw.one_of("thin"), draw.number("size"), draw.number("thin_cells")
    falls = kind == "rope" and draw.happens("thin_falls")
    across = thick * draw.number("thin_rope" if falls else "thin_slender")
    h = size / across
    plan = PLANS[kind](draw, size, thick * h, h)
    low = np.min([shape.points.min(axis=0) for shape in plan.shapes], axis=0)
    high = np.max([shape.points.max(axis=0) for shape in plan.shapes], axis=0)
    room = np.array([draw.number("thin_room", axis) for axis in "xyz"]) * h
    below = np.array([room[0], constant("gap") * h if plan.floor else room[1] + size / 3, room[2]])
    cells = np.ceil((high - low + below + room) / h).astype(int)
    shift = below - low
    shapes = tuple(shape.moved(shift) for shape in plan.shapes)
    given = tuple(dataclasses.replace(g, shape=g.shape.moved(shift)) for g in plan.given)
    pull = np.array([0.0, -draw.number("gravity_size"), 0.0]) if plan.gravity else np.zeros(3)
    ratio = draw_ratio(draw)
    parts, fastest = thin_bodies(draw, plan, shapes, ratio, pull, size)
    values = scene_values(draw, across, draw.number("thin_duration"), ratio, pull, ("slip",) * 6, parts, cells)
    values["box"] = tuple(map(float, cells * h))
    values["size"] = size
    return ThinScene(
        **values | {"center": parts[0].place},
        fastest=fastest,
        parts=parts,
        shapes=shapes,
        given=given,
        thick=thick,
    )


def thin_bodies(
    draw: Draw, plan: Plan, shapes: tuple[Shape, ...], ratio: float | None, pull: np.ndarray, size: float
) -> tuple[tuple[Body, ...], float]:
    """The solids, as stiff as the fastest impact asks for, and its speed [m/s]."""
    draws = [Draw(draw.seed, f"{draw.scene} solid {k}") for k in range(len(shapes))]
    alike = "link" in plan.names[0]
    densities, fluid = weigh(draws, ratio, alike)
    speeds = [float(np.linalg.norm(velocity)) for velocity in plan.velocities]
    moved = max([0.0, *(float(np.linalg.norm(given.velocity)) for given in plan.given)])
    fall = float(np.linalg.norm(pull)) * size * (constant("pile_fall") if plan.given else 1.0)
    fastest = max(math.sqrt(max(*speeds, moved) ** 2 + 2 * fall), constant("slowest") * size)
    energy = (max(densities) + ADDED_MASS * fluid) * fastest**2 / 2
    load = max(densities) * float(np.linalg.norm(pull)) * size
    friction = 0.0 if draw.happens("frictionless") else draw.number("friction")
    bodies = []
    for k, (shape, d) in enumerate(zip(shapes, draws, strict=True)):
        own = draw if alike else d
        modulus = max(energy / own.number("thin_pressure"), load / constant("thin_sag"))
        middle = (shape.points.min(axis=0) + shape.points.max(axis=0)) / 2
        bodies.append(
            Body(
                shape=plan.names[k],
                size=float(np.ptp(shape.points, axis=0).max()),
                place=tuple(map(float, middle)),
                density=densities[k],
                youngs_modulus=modulus,
                poissons_ratio=draw_poisson(own),
                compressible=own.happens("compressible"),
                material="stableNeoHookean" if own.happens("neo_hookean") else "corotational",
                friction=friction,
                velocity=tuple(map(float, plan.velocities[k])),
                spin=(0.0, 0.0, 0.0),
                impact_pressure=energy / modulus,
                reach=reach_of((shape.points, shape.triangles)),
                surface=(shape.points - middle, shape.triangles),
            )
        )
    return tuple(bodies), fastest


def thrown_at(draw: Draw, size: float, thick: float, h: float, top: float) -> tuple[Shape, str, np.ndarray]:
    """A ball or a rod above a height, and its velocity."""
    aside = np.array([draw.evenly("aside", "x") - 0.5, 0.0, draw.evenly("aside", "z") - 0.5]) * thick
    speed = draw.number("speed") * size
    if draw.happens("thin_pointed"):
        long = max(2.5 * thick, 12 * h)
        made, name = thin_shapes.rod(long, max(thick, 5 * h), 1.5 * h, h), "rod"
        high = long / 2
    else:
        high = draw.number("thin_ball") * thick
        made, name = thin_shapes.ball(high), "sphere"
    return made.moved(aside + [0, top + high + draw.number("apart") * h / 2, 0]), name, np.array([0.0, -speed, 0.0])


def clamped(size: float, wide: float, thick: float, h: float) -> tuple[Given, Given]:
    """Pins around both ends along x of what lies at the origin."""
    region = thin_shapes.plate((6 * h, 2 * thick, 2 * wide), thick / 2)
    low, high = (region.moved((side * size / 2, 0, 0)) for side in (-1, 1))
    return Given(low, 1), Given(high, 1)


def strap(draw: Draw, size: float, thick: float, h: float) -> Plan:
    """Clamped at both ends; something is thrown at it."""
    wide = draw.number("thin_wide") * thick
    return flat(draw, (size, thick, wide), h, "strap")


def sheet(draw: Draw, size: float, thick: float, h: float) -> Plan:
    """Clamped at two edges; something is thrown at it."""
    return flat(draw, (size, thick, size * draw.number("box_edge")), h, "sheet")


def flat(draw: Draw, edges: tuple[float, float, float], h: float, name: str) -> Plan:
    made = thin_shapes.plate(edges, h)
    other, words, velocity = thrown_at(draw, edges[0], edges[1], h, edges[1] / 2)
    held = list(clamped(edges[0], edges[2], edges[1], h))
    return Plan([made, other], [name, words], [np.zeros(3), velocity], held, draw.happens("thin_gravity"))


def rope(draw: Draw, size: float, thick: float, h: float) -> Plan:
    """Hangs a little bent above the floor and is let fall, or is clamped at both ends and something is thrown at it."""
    along = np.linspace(-0.5, 0.5, max(12, round(size / h)))
    wave = draw.number("thin_wave") * thick * np.sin(2 * np.pi * along + 2 * np.pi * draw.evenly("thin_wave", "phase"))
    if draw.happens("thin_falls"):
        center = np.stack([wave, size * along, np.roll(wave, len(along) // 4) * 0], axis=1)
        return Plan([thin_shapes.rope(center, thick, h)], ["rope"], [np.zeros(3)], [], True, True)
    center = np.stack([size * along, 0 * wave, 0 * wave], axis=1)
    other, words, velocity = thrown_at(draw, size, thick, h, thick / 2)
    held = list(clamped(size, thick, thick, h))
    return Plan([thin_shapes.rope(center, thick, h), other], ["rope", words], [np.zeros(3), velocity], held)


def ring(draw: Draw, size: float, thick: float, h: float) -> Plan:
    """Held from outside; a ball that is larger than its hole is pulled through it by a pin."""
    radius = (size - thick) / 2
    ball = (radius - thick / 2) / draw.number("thin_hole")
    start = np.array([0, ball + thick / 2 + h, 0])
    made = [thin_shapes.ring(radius, thick, h), thin_shapes.ball(ball, axis=1, beyond=100 * size).moved(start)]
    way, speed = 2 * start[1], draw.number("pin_speed") * size
    pull = Given(thin_shapes.ball(max(1.5 * h, ball / 3), 2).moved(start), 2, (0.0, -speed, 0.0), way / speed)
    held = Given(thin_shapes.ring(size / 2, max(2.4 * h, thick / 2), h / 2), 1)
    return Plan(made, ["ring", "sphere"], [np.zeros(3)] * 2, [held, pull], False)


def chain(draw: Draw, size: float, thick: float, h: float) -> Plan:
    """Links that hang from the first one, after a short fall."""
    inside, straight = thick + draw.number("thin_play") * h, draw.number("thin_straight") * thick
    high, one = straight + thick + inside, thin_shapes.link(thick, inside, straight, h)
    # of the centre line; two links away there has to be room, too
    fall = min(1.5 * h, (high - 3 * thick) / 3)
    down = np.array([0.0, -(high - thick - fall), 0.0])
    quarter = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    count = int(draw.number("thin_links"))
    made = [one.moved(k * down, quarter if k % 2 else None) for k in range(count)]
    top = thin_shapes.plate((3 * thick, 1.5 * thick, 3 * thick), thick / 2).moved((0, high / 2, 0))
    return Plan(made, ["link"] * count, [np.zeros(3)] * count, [Given(top, 1)])


PLANS = {"strap": strap, "sheet": sheet, "rope": rope, "ring": ring, "chain": chain}
