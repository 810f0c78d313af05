"""Random scenes with everything: solids that yield, a pin, a collider, a jet and a viscous fluid, each by chance."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from eulerfsi.solver.simulation import Simulation
from loop.overlap import winding

from .company import Company, Held, Jet
from .contact import (
    Body,
    ContactScene,
    Plastic,
    draw_solids,
    draw_walls,
    enclose,
    find_place,
    make_bodies,
    scene_values,
    span,
    thrown,
)
from .draw import Draw, constant
from .regions import Path, Region, place
from .scenes import draw_gravity, draw_ratio
from .solids import Made, center_of_volume

SAMPLES = 5  # along an edge of it
NO_TRIANGLES = np.zeros((0, 3), int)


@dataclasses.dataclass(frozen=True)
class EverythingScene(ContactScene):
    """One solid or two, the first of them pinned, if one is."""

    pin: Held | None = None
    collider: Held | None = None
    jet: Jet | None = None
    viscosity: float = 0.0  # of the fluid [Pa s]

    @property
    def words(self) -> str:
        parts = {"pin": self.pin, "collider": self.collider, "jet": self.jet}
        said = [f"{name}: {part.words}" for name, part in parts.items() if part]
        said += [f"viscosity {self.viscosity:.3g} Pa s"] * (self.viscosity > 0)
        return "; ".join([*said, super().words])

    @property
    def given_parts(self) -> list[Held]:
        """What moves as given, or is held."""
        return [part for part in (self.pin, self.collider) if part]

    def company(self, simulation: Simulation) -> Company:
        return Company(simulation, self)

    def simulation(self) -> dict[str, Any]:
        return super().simulation() | {"fluid_viscosity": self.viscosity}


@dataclasses.dataclass
class Layout:
    """Where solids lie and how they move before the box is put around them. shapes: laid around the origin [m]."""

    draws: list[Draw]
    size: float
    h: float
    duration: float
    shapes: list[Made]
    places: np.ndarray
    velocities: np.ndarray
    room: list[np.ndarray] = dataclasses.field(default_factory=list)  # points that have to lie in the box, too

    @property
    def first(self) -> np.ndarray:
        """Points of the first solid."""
        return self.shapes[0][0] + self.places[0]


def make_everything_scene(seed: int, number: str) -> EverythingScene:
    """The scene "e0", "e1", ... of a seed. Raises solids.Absent."""
    draw = Draw(seed, number)
    draws = [draw] + [Draw(seed, f"{number} solid 2")] * draw.happens("second_solid")
    size, across = draw.number("size"), draw.number("contact_across")
    h, duration, ratio = size / across, draw.number("duration"), draw_ratio(draw)
    sizes, words, surfaces = draw_solids(draws)
    pull, faces = draw_gravity(draw, [False] * 3), draw_walls(draw)

    pinned, meets = draw.happens("pinned"), draw.happens("collider")
    region = collider_region(Draw(seed, f"{number} collider"), size, h) if meets else None
    layout = lay_out(draws, size, h, duration, surfaces, region)
    collider = let_meet(Draw(seed, f"{number} collider"), layout, region, pinned) if region else None
    spins = np.array([(0.0 if d.happens("still") else d.number("spin")) * d.direction("axis") for d in draws])
    pin = hold(Draw(seed, f"{number} pin"), layout, collider) if pinned else None
    if pin:
        layout.velocities[0], spins[0] = 0.0, 0.0
    jet = blow(Draw(seed, f"{number} jet"), layout) if ratio is not None and draw.happens("jet") else None
    if jet and "open" not in faces:
        axis = int(np.argmax(np.abs(jet.velocity)))
        ahead = 2 * axis + (jet.velocity[axis] > 0)
        faces = tuple("open" if face == ahead else kind for face, kind in enumerate(faces))

    clouds = [*surfaces, *((points, NO_TRIANGLES) for points in layout.room)]
    starts = np.concatenate([layout.places[: len(draws)], np.zeros((len(layout.room), 3))])
    cells, places = enclose(draw, clouds, starts, h, np.zeros(3))
    shift, places = places[0] - layout.places[0], places[: len(draws)]
    given = [speed_of(part, layout) for part in (pin, collider) if part]
    blown = float(np.linalg.norm(jet.velocity)) if jet else 0.0
    parts, fastest = make_bodies(
        draws,
        words,
        sizes,
        surfaces,
        places,
        layout.velocities[: len(draws)],
        spins,
        ratio,
        pull,
        cells * h,
        False,
        [*given, blown],
    )
    parts = tuple(with_yield(d, body) for d, body in zip(draws, parts, strict=True))
    scene = EverythingScene(
        **scene_values(draw, across, duration, ratio, pull, faces, parts, cells),
        fastest=fastest,
        parts=parts,
        pin=moved(pin, shift),
        collider=moved(collider, shift),
        jet=dataclasses.replace(jet, region=jet.region.moved(shift)) if jet else None,
    )
    if ratio is None or not draw.happens("viscous"):
        return scene
    return dataclasses.replace(scene, viscosity=scene.fluid_density * fastest * size / draw.number("reynolds"))


def with_yield(draw: Draw, body: Body) -> Body:
    if not draw.happens("yields"):
        return body
    hardening = draw.number("hardening") if draw.happens("hardens") else 0.0
    modulus = body.youngs_modulus
    plastic = Plastic(draw.number("yield_strain") * modulus, draw.number("flow_rate"), hardening * modulus)
    return dataclasses.replace(body, plastic=plastic)


def moved(held: Held | None, shift: np.ndarray) -> Held | None:
    if held is None:
        return None
    path = dataclasses.replace(held.path, pivot=tuple(map(float, np.add(held.path.pivot, shift))))
    return dataclasses.replace(held, region=held.region.moved(shift), path=path)


def speed_of(held: Held, layout: Layout) -> float:
    """Fastest that it, and what it holds, moves [m/s]."""
    if not held.path.moves:
        return 0.0
    arm = layout.size + float(np.linalg.norm(np.subtract(held.region.middle, held.path.pivot)))
    return float(np.linalg.norm(held.path.velocity) + np.linalg.norm(held.path.rate) * arm)


def drawn_region(draw: Draw, longest: float, least: float) -> Region:
    """A sphere or a box around the origin. longest, least: of its edges [m]."""
    kind, longest = draw.one_of("region"), max(longest, least)
    edges = (longest,) * 3
    if kind == "box":
        edges = (longest, *(max(least, longest * draw.number("box_edge", part)) for part in (1, 2)))
    return Region(kind, edges, (0.0, 0.0, 0.0), tuple(tuple(map(float, row)) for row in draw.rotation("turn")))


def collider_region(draw: Draw, size: float, h: float) -> Region:
    return drawn_region(draw, size * draw.number("collider_size"), constant("collider_least") * h)


def lay_out(
    draws: list[Draw], size: float, h: float, duration: float, surfaces: list[Made], region: Region | None
) -> Layout:
    """Solids, and the collider as the last one, that are thrown at the first one; a single one flies anyhow."""
    if region is None and len(draws) == 1:
        velocity = draws[0].number("speed") * size * draws[0].direction("heading")
        return Layout(draws, size, h, duration, surfaces, np.zeros((1, 3)), velocity[None])
    shapes, everyone, edges = surfaces, draws, [size] * len(draws)
    if region:
        shapes = [*surfaces, region.surface]
        everyone = [*draws, Draw(draws[0].seed, f"{draws[0].scene} collider")]
        edges = [*edges, size]
    places, velocities = thrown(everyone, shapes, edges, h, duration)
    return Layout(draws, size, h, duration, shapes, places, velocities)


def let_meet(draw: Draw, layout: Layout, region: Region, pinned: bool) -> Held:
    """The collider: it comes at the first solid, or rests and the solids come at it."""
    region, friction = region.moved(layout.places[-1]), 0.0 if draw.happens("frictionless") else draw.number("friction")
    if not (pinned or draw.happens("collider_moves")):
        layout.velocities -= layout.velocities[-1].copy()
        layout.room.append(region.surface[0])
        return Held(region, Path(), friction)
    velocity, apart = layout.velocities[-1].copy(), layout.places[-1] - layout.places[0]
    far = float(np.linalg.norm(apart))
    gap = far - span(layout.shapes[0], layout.shapes[-1], apart / far)
    press = layout.size * draw.number("press") * (0.5 if pinned else 1.0)
    until = min(layout.duration, (gap + press) / float(np.linalg.norm(velocity)))
    rate = draw.number("collider_rate") * draw.direction("axis") if draw.happens("collider_turns") else np.zeros(3)
    path = Path(tuple(map(float, velocity)), tuple(map(float, rate)), region.middle, until)
    layout.room += [region.surface[0], place(path.pose(until), region.surface[0])]
    if not pinned:  # it can be pushed so far
        layout.room.append(layout.first + velocity * until)
    return Held(region, path, friction)


def hold(draw: Draw, layout: Layout, collider: Held | None) -> Held:
    """A pin of the first solid, on the side that a collider does not come from."""
    points, size = layout.first, layout.size
    side = draw.direction("side")
    if len(layout.places) > 1:
        side = layout.places[0] - layout.places[-1]
        side /= np.linalg.norm(side)
    region = drawn_region(draw, size * draw.number("pin_size"), constant("region_least") * layout.h)
    region = around_part(region, points[int(np.argmax(points @ side))], (points, layout.shapes[0][1]), layout.h)
    kind = draw.one_of("pin_motion")
    if kind == "fixed":
        return Held(region, Path())
    speed, heading = draw.number("pin_speed") * size, draw.direction("heading")
    if collider and heading @ side < -constant("pin_towards"):
        heading = -heading
    until = min(layout.duration, constant("pin_travel") * size / speed)
    if kind == "straight":
        path = Path(tuple(map(float, speed * heading)), until=until)
    else:
        axis = np.cross(heading, draw.direction("arm"))
        axis, arm = axis / np.linalg.norm(axis), size * side
        rate = constant("pin_turn") / (constant("pin_travel") * size / speed) * axis
        path = Path(rate=tuple(map(float, rate)), pivot=tuple(map(float, region.middle + arm)), until=until)
    layout.room += [place(path.pose(part * until), points) for part in (0.5, 1.0)]
    return Held(region, path)


def around_part(region: Region, tip: np.ndarray, solid: Made, h: float) -> Region:
    """The region about a vertex, or as far from it towards the solid's middle as it takes to hold some cells of it."""
    middle, samples = center_of_volume(*solid), region.samples(SAMPLES)
    for way in np.linspace(0, 1, 11):
        held = region.moved(tip + way * (middle - tip))
        inside = sum(winding(point, *solid) > 0.5 for point in samples + held.middle)
        if inside * region.volume / len(samples) >= constant("pin_holds") * h**3:
            return held
    raise ValueError(f"no pin found at {tip}")


def blow(draw: Draw, layout: Layout) -> Jet:
    """A jet beside all solids, about towards the first one."""
    region = drawn_region(draw, layout.size * draw.number("jet_size"), constant("region_least") * layout.h)
    points, triangles = region.surface
    free = (points * (1 + 2 * constant("jet_free") * layout.h / min(region.edges)), triangles)
    shapes = [*layout.shapes, free]
    way, middle = find_place(draw, shapes, list(layout.places), len(layout.shapes), 0.0)
    aim = -way + constant("aside") * draw.direction("aim")
    velocity = draw.number("jet_speed") * layout.size * aim / np.linalg.norm(aim)
    layout.room.append(free[0] + middle)
    return Jet(region.moved(middle), tuple(map(float, velocity)), draw.number("jet_time") * layout.duration)
