"""Random scenes with contact: two or three solids that are thrown at each other, or let fall into a pile."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Mesh

from .draw import Draw, constant, ranges
from .scenes import ADDED_MASS, AXES, Scene, box_cells, draw_gravity, draw_poisson, draw_ratio, weight_ratio
from .solids import Made, center_of_volume, folds_nowhere, make_solid

TRIES = 40  # directions in which a third solid is tried


@dataclasses.dataclass(frozen=True)
class Plastic:
    """How a solid yields: yield stress [Pa], flow rate [1/s], hardening [Pa]."""

    yield_stress: float
    flow_rate: float
    hardening: float


@dataclasses.dataclass(frozen=True)
class Body:
    """A solid of a scene; place: middle of its bounding box at the start [m]; the rest as in Scene."""

    shape: str
    size: float
    place: tuple[float, float, float]
    density: float
    youngs_modulus: float
    poissons_ratio: float
    compressible: bool
    material: str
    friction: float
    velocity: tuple[float, float, float]
    spin: tuple[float, float, float]
    impact_pressure: float
    reach: float
    surface: Made = dataclasses.field(compare=False, repr=False)
    plastic: Plastic | None = None  # None: elastic

    def mesh(self) -> Mesh:
        points, triangles = self.surface
        return Mesh(points + np.array(self.place), np.full(len(triangles), 3), triangles.ravel())

    def values(self) -> dict[str, Any]:
        """Fields of EfsiSolidDef."""
        names = ("density", "youngs_modulus", "poissons_ratio", "friction", "velocity")
        plastic = dataclasses.asdict(self.plastic) if self.plastic else {}
        return {name: getattr(self, name) for name in names} | {
            "compressible": int(self.compressible),
            "material": binding.MATERIALS[self.material],
            "angular_velocity": self.spin,
            **{f"plastic_{name}": value for name, value in plastic.items()},
        }

    @property
    def words(self) -> str:
        kind = ", compressible" * self.compressible + ", neo-Hookean" * (self.material != "corotational")
        if self.plastic:
            yields, rate, hardening = dataclasses.astuple(self.plastic)
            kind += f", yields at {yields:.3g} Pa, {rate:.3g}/s, hardening {hardening:.3g} Pa"
        return (
            f"{self.shape} of {self.size:.3g} m, {self.density:.3g} kg/m^3, E {self.youngs_modulus:.3g} Pa, "
            f"nu {self.poissons_ratio:.3f}{kind}, friction {self.friction:.2f}"
        )


@dataclasses.dataclass(frozen=True)
class ContactScene(Scene):
    """Several solids; what Scene says of its one solid is of the first."""

    parts: tuple[Body, ...] = ()
    pile: bool = False

    @property
    def words(self) -> str:
        vector = lambda v: "(" + " ".join(f"{c + 0.0:.3g}" for c in v) + ")"  # noqa: E731
        density = "vacuum" if self.density_ratio is None else f"first {self.density_ratio:.3g}:1"
        return (
            f"{'pile' if self.pile else 'thrown'}: {' + '.join(body.words for body in self.parts)}; "
            f"{self.across:.1f} cells of {self.spacing:.3g} m, box {'x'.join(map(str, self.cells))}, {self.walls}, "
            f"{density}, rho v^2/2 / E up to {self.impact_pressure:.2g}, g {vector(self.pull)}, {self.duration:.2f} s, "
            f"dt <= {self.dt:.3g} s, CFL {'default' if self.cfl is None else f'{self.cfl:.2f}'}"
        )

    @property
    def most_steps(self) -> int:
        return len(self.parts) * super().most_steps

    def bodies(self) -> list[tuple[Mesh, dict[str, Any]]]:
        return [(body.mesh(), body.values()) for body in self.parts]

    def view(self, number: int) -> Scene:
        """The scene as it is for solid `number`, from 1, alone."""
        body = self.parts[number - 1]
        same = ("shape", "size", "youngs_modulus", "poissons_ratio", "compressible", "material", "velocity", "spin")
        return dataclasses.replace(
            self,
            **{name: getattr(body, name) for name in (*same, "impact_pressure", "reach", "surface")},
            across=body.size / self.spacing,
            folds_nowhere=folds_nowhere(body.shape),
        )


def draw_solids(draws: list[Draw]) -> tuple[list[float], list[str], list[Made]]:
    """Sizes [m], shapes in words and surfaces [m], one a draw; the other sizes follow from the first."""
    size, across = draws[0].number("size"), draws[0].number("contact_across")
    sizes = [size] + [size * max(d.number("other_size"), constant("least_across") / across) for d in draws[1:]]
    made = [make_solid(d) for d in draws]
    surfaces = [lay(d, s, surface) for d, s, (_, surface) in zip(draws, sizes, made, strict=True)]
    return sizes, [words for words, _ in made], surfaces


def draw_walls(draw: Draw) -> tuple[str, ...]:
    """Kinds of the faces -x +x -y +y -z +z, none of them periodic."""
    return tuple(draw.one_of("wall", axis + side) for axis in AXES for side in "-+")


def make_contact_scene(seed: int, number: str) -> ContactScene:
    """The scene "c0", "c1", ... of a seed. Raises solids.Absent."""
    draw = Draw(seed, number)
    count = 3 if draw.happens("third_solid") else 2
    draws = [draw] + [Draw(seed, f"{number} solid {k}") for k in range(2, count + 1)]
    size, across = draw.number("size"), draw.number("contact_across")
    h, duration, ratio = size / across, draw.number("duration"), draw_ratio(draw)
    sizes, words, surfaces = draw_solids(draws)
    pull, faces = draw_gravity(draw, [False] * 3), draw_walls(draw)
    pile = bool(pull.any()) and draw.happens("pile")
    if pile:
        axis = int(np.argmax(np.abs(pull)))
        pull = np.where(np.arange(3) == axis, np.sign(pull) * np.linalg.norm(pull), 0.0)
        places, velocities = piled(draws, surfaces, pull, h), np.zeros((count, 3))
        faces = tuple("slip" if face // 2 == axis and kind == "open" else kind for face, kind in enumerate(faces))
    else:
        places, velocities = thrown(draws, surfaces, sizes, h, duration)
    spins = np.array([(0.0 if pile or d.happens("still") else d.number("spin")) * d.direction("axis") for d in draws])
    cells, places = enclose(draw, surfaces, places, h, pull if pile else np.zeros(3))

    parts, fastest = make_bodies(draws, words, sizes, surfaces, places, velocities, spins, ratio, pull, cells * h, pile)
    return ContactScene(
        **scene_values(draw, across, duration, ratio, pull, faces, parts, cells),
        fastest=fastest,
        parts=parts,
        pile=pile,
    )


def scene_values(
    draw: Draw,
    across: float,
    duration: float,
    ratio: float | None,
    pull: np.ndarray,
    faces: tuple[str, ...],
    parts: tuple[Body, ...],
    cells: np.ndarray,
) -> dict[str, Any]:
    """Fields of Scene for several solids."""
    first = parts[0]
    same = ("shape", "size", "youngs_modulus", "poissons_ratio", "material", "velocity", "spin", "reach", "surface")
    return {name: getattr(first, name) for name in same} | {
        "scene": f"{draw.seed}/{draw.scene}",
        "seed": draw.seed,
        "number": draw.scene,
        "across": across,
        "box": tuple(map(float, cells * (first.size / across))),
        "center": first.place,
        "duration": duration,
        "dt": draw.number("step"),
        "density_ratio": ratio,
        "walls": " ".join(faces),
        "faces": faces,
        "cfl": None if draw.happens("default_cfl") else draw.number("cfl"),
        "pull": tuple(map(float, pull)),
        "compressible": any(body.compressible for body in parts),
        "impact_pressure": max(body.impact_pressure for body in parts),
        "folds_nowhere": all(folds_nowhere(body.shape) for body in parts),
    }


def make_bodies(
    draws: list[Draw],
    words: list[str],
    sizes: list[float],
    surfaces: list[Made],
    places: np.ndarray,
    velocities: np.ndarray,
    spins: np.ndarray,
    ratio: float | None,
    pull: np.ndarray,
    box: np.ndarray,
    pile: bool,
    others: Sequence[float] = (),
) -> tuple[tuple[Body, ...], float]:
    """The solids, as stiff as the fastest impact asks for, and its speed [m/s]. others: speeds of what is no solid."""
    densities, fluid = weigh(draws, ratio)
    ratios = [None if ratio is None else density / fluid for density in densities]
    fall = max(float(np.abs(weight_ratio(r) * pull) @ box) for r in ratios) * (constant("pile_fall") if pile else 1.0)
    reaches = [reach_of(surface) for surface in surfaces]
    speeds = np.linalg.norm(velocities, axis=1) + np.linalg.norm(spins, axis=1) * reaches
    fastest = max(math.sqrt(max(speeds.max(), *others, 0.0) ** 2 + 2 * fall), constant("slowest") * sizes[0])
    pressures = impact_pressures(draws, "impact_pressure", densities, fluid, fastest, pull, max(sizes))
    parts = tuple(
        Body(
            shape=words[k],
            size=sizes[k],
            place=tuple(map(float, places[k])),
            density=densities[k],
            youngs_modulus=modulus,
            poissons_ratio=draw_poisson(d),
            compressible=d.happens("compressible"),
            material="stableNeoHookean" if d.happens("neo_hookean") else "corotational",
            friction=0.0 if d.happens("frictionless") else d.number("friction"),
            velocity=tuple(map(float, velocities[k])),
            spin=tuple(map(float, spins[k])),
            impact_pressure=pressure,
            reach=reaches[k],
            surface=surfaces[k],
        )
        for k, (d, (modulus, pressure)) in enumerate(zip(draws, pressures, strict=True))
    )
    return parts, fastest


def weigh(draws: list[Draw], ratio: float | None, alike: bool = False) -> tuple[list[float], float]:
    """Densities of the solids and of the fluid, 0 for none [kg/m^3]. ratio: of the first solid's to the fluid's; alike:
    the others are as dense."""
    first = 1000.0 * min(1.0, ratio or 1.0)
    densities = [first * (d.number("other_density") if k and not alike else 1.0) for k, d in enumerate(draws)]
    return densities, 0.0 if ratio is None else 1000.0 / max(1.0, ratio)


def reach_of(surface: Made) -> float:
    """How far a shape reaches from its centre of volume [m]."""
    points, triangles = surface
    return float(np.linalg.norm(points - center_of_volume(points, triangles), axis=1).max())


def impact_pressures(
    draws: list[Draw],
    part: str,
    densities: list[float],
    fluid: float,
    fastest: float,
    pull: np.ndarray,
    largest: float,
) -> list[tuple[float, float]]:
    """Young's modulus of each solid [Pa], and the part of it that the pressure of the fastest impact is: the number
    `part` of its draw, or less where its weight would let it sag. largest: of their sizes [m]."""
    energy = (max(densities) + ADDED_MASS * fluid) * fastest**2 / 2
    load = sum(abs(density - fluid) for density in densities) * float(np.linalg.norm(pull)) * largest
    moduli = [max(energy / d.number(part), load / constant("sag")) for d in draws]
    return [(modulus, energy / modulus) for modulus in moduli]


def lay(draw: Draw, size: float, made: Made) -> Made:
    """A shape in its size, turned, centred at the middle of its bounding box [m]."""
    points = size * made[0] @ draw.rotation("turn").T
    return points - (points.min(axis=0) + points.max(axis=0)) / 2, made[1]


def span(one: Made, other: Made, way: np.ndarray) -> float:
    """How far `other` has to be from `one` along a unit vector for a plane across it to lie between them [m]."""
    return float((one[0] @ way).max() - (other[0] @ way).min())


def thrown(
    draws: list[Draw], surfaces: list[Made], sizes: list[float], h: float, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """Places around the first solid, in the origin, and velocities towards it (n, 3)."""
    drift = constant("drift") * draws[0].number("speed") * sizes[0] * draws[0].direction("heading")
    places, velocities = [np.zeros(3)], [drift]
    for k in range(1, len(draws)):
        closing = draws[k].number("speed") * sizes[0]
        wanted = min(draws[k].number("apart") * h, constant("met_by") * closing * duration)
        gap = max(wanted, ranges()["apart"]["low"] * h)
        way, place = find_place(draws[k], surfaces, places, k, gap)
        aim = -way + constant("aside") * draws[k].direction("aim")
        places.append(place)
        velocities.append(drift + closing * aim / np.linalg.norm(aim))
    return np.array(places), np.array(velocities)


def find_place(
    draw: Draw, surfaces: list[Made], places: list[np.ndarray], k: int, gap: float
) -> tuple[np.ndarray, np.ndarray]:
    """A direction from the first solid, and the place along it, where solid k is clear of all before it."""
    far = 1.0
    for attempt in range(TRIES):
        way = draw.direction(f"beside {attempt}")
        place = places[0] + way * far * (span(surfaces[0], surfaces[k], way) + gap)
        clear = True
        for other in range(1, k):
            between = place - places[other]
            distance = float(np.linalg.norm(between))
            clear = clear and distance >= span(surfaces[other], surfaces[k], between / max(distance, 1e-30)) + gap
        if clear:
            return way, place
        far *= 1.05
    raise ValueError(f"{draw.seed}/{draw.scene}: no place found")


def piled(draws: list[Draw], surfaces: list[Made], pull: np.ndarray, h: float) -> np.ndarray:
    """Places one above the other, the first one in the origin, each a little beside the one below it (n, 3)."""
    up = -pull / np.linalg.norm(pull)
    places = [np.zeros(3)]
    for k in range(1, len(draws)):
        aside = constant("aside") / 2 * np.ptp(surfaces[k - 1][0], axis=0) * draws[k].direction("aside")
        rise = span(surfaces[k - 1], surfaces[k], up) + draws[k].number("apart") * h
        places.append(places[-1] + up * rise + aside - up * (aside @ up))
    return np.array(places)


def enclose(
    draw: Draw, surfaces: list[Made], places: np.ndarray, h: float, down: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cells of a box around all, and their places in it; the box's wall lies under them where down is not zero."""
    low = np.min([place + points.min(axis=0) for place, (points, _) in zip(places, surfaces, strict=True)], axis=0)
    high = np.max([place + points.max(axis=0) for place, (points, _) in zip(places, surfaces, strict=True)], axis=0)
    gap, extent = constant("gap"), np.ptp(surfaces[0][0], axis=0)
    cells = box_cells(draw, extent / h, (high - low) / h + 2 * gap, constant("contact_most_cells"))
    room = cells * h - (high - low) - 2 * gap * h
    share = np.array([draw.evenly("place", axis) for axis in AXES])
    share = np.where(down < 0, 0.0, np.where(down > 0, 1.0, share))
    return cells, places - low + gap * h + share * room
