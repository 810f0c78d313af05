"""Random scenes of compact compressible bodies, thrown hard at a wall, the floor, a collider or each other."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from .company import Held
from .contact import Body, find_place, impact_pressures, lay, reach_of, scene_values, weigh
from .draw import Draw, constant
from .everything import NO_TRIANGLES, EverythingScene, collider_region
from .regions import Path, Region
from .scenes import draw_gravity, draw_ratio, weight_ratio
from .solids import Made, make_solid

FLOOR = 2  # the face -y


@dataclasses.dataclass(frozen=True)
class CompactScene(EverythingScene):
    """One compressible body, or two that meet."""

    target: str = ""  # what the first one is thrown at: wall, floor, collider, body

    @property
    def words(self) -> str:
        return f"at a {self.target}, {super().words}"


def make_compact_scene(seed: int, number: str) -> CompactScene:
    """The scene "b0", "b1", ... of a seed."""
    draw = Draw(seed, number)
    target, size, across = draw.one_of("compact_target"), draw.number("size"), draw.number("compact_across")
    draws = [draw] + [Draw(seed, f"{number} solid 2")] * (target == "body")
    h, ratio, gap = size / across, draw_ratio(draw), draw.number("apart") * size / across
    pull = draw_gravity(draw, [False] * 3)
    if target == "floor":
        pull = np.array([0.0, -draw.number("gravity_size"), 0.0])
    sizes = [h * d.number("compact_across") for d in draws]
    made = [make_solid(d, "compact_shape") for d in draws]
    surfaces = [lay(d, s, surface) for d, s, (_, surface) in zip(draws, sizes, made, strict=True)]
    region = collider_region(draw, size, h) if target == "collider" else None
    face = None if target in ("collider", "body") else FLOOR if target == "floor" else int(6 * draw.evenly("face"))
    places, way = towards(draw, surfaces, region, face, gap)

    speed = max(draw.number("compact_speed") * size, math.sqrt(np.linalg.norm(pull) * size) / 2)
    aim = way + constant("aside") * draw.direction("aim")
    velocities, spins = np.zeros((len(draws), 3)), np.zeros((len(draws), 3))
    velocities[0] = speed * aim / np.linalg.norm(aim)
    if draw.happens("compact_spins"):
        spins[0] = draw.evenly("spin") * speed / size * draw.direction("axis")
    duration = (gap + draw.number("compact_after") * size) / speed

    clouds = [*surfaces, *([(region.surface[0], NO_TRIANGLES)] if region else [])]
    cells, places = boxed(draw, clouds, places, h, face, gap)
    faces = [draw.one_of("compact_wall", side) for side in range(6)]
    if ratio is not None and draw.happens("compact_open"):
        axis = int(np.argmax(np.abs(way)))
        faces[2 * axis + int(way[axis] < 0)] = "open"
    parts, fastest = compact_bodies(
        draws,
        [words for words, _ in made],
        sizes,
        surfaces,
        places,
        velocities,
        spins,
        ratio,
        pull,
        duration,
        cells * h,
    )
    return CompactScene(
        **scene_values(draw, across, duration, ratio, pull, tuple(faces), parts, cells),
        fastest=fastest,
        parts=parts,
        collider=Held(region.moved(places[-1]), Path(), parts[0].friction) if region else None,
        target=target,
    )


def towards(
    draw: Draw, surfaces: list[Made], region: Region | None, face: int | None, gap: float
) -> tuple[np.ndarray, np.ndarray]:
    """Places, the first body in the origin, what it meets as the last one; and the unit vector to that (n, 3), (3,)."""
    if face is not None:
        way = np.zeros(3)
        way[face // 2] = 1.0 if face % 2 else -1.0
        return np.zeros((1, 3)), way
    way, place = find_place(draw, [surfaces[0], region.surface if region else surfaces[1]], [np.zeros(3)], 1, gap)
    return np.array([np.zeros(3), place]), way


def boxed(
    draw: Draw, clouds: list[Made], places: np.ndarray, h: float, face: int | None, gap: float
) -> tuple[np.ndarray, np.ndarray]:
    """Cells of a box around all, and their places in it, the gap off a face."""
    low = np.min([place + points.min(axis=0) for place, (points, _) in zip(places, clouds, strict=True)], axis=0)
    high = np.max([place + points.max(axis=0) for place, (points, _) in zip(places, clouds, strict=True)], axis=0)
    room = np.array([[draw.number("compact_room", 2 * axis + side) for side in (0, 1)] for axis in range(3)]) * h
    if face is not None:
        room[face // 2, face % 2] = gap
    cells = np.ceil((high - low + room.sum(axis=1)) / h)
    shift = room[:, 0]
    if face is not None and face % 2:
        axis = face // 2
        shift[axis] = cells[axis] * h - (high - low)[axis] - gap
    return cells, places - low + shift


def compact_bodies(
    draws: list[Draw],
    words: list[str],
    sizes: list[float],
    surfaces: list[Made],
    places: np.ndarray,
    velocities: np.ndarray,
    spins: np.ndarray,
    ratio: float | None,
    pull: np.ndarray,
    duration: float,
    box: np.ndarray,
) -> tuple[tuple[Body, ...], float]:
    """The bodies, as soft as what the fastest impact may come to allows, and its speed [m/s]."""
    densities, fluid = weigh(draws, ratio)
    reaches = [reach_of(surface) for surface in surfaces]
    thrown = float(np.linalg.norm(velocities[0]) + np.linalg.norm(spins[0]) * reaches[0])
    fall = max(abs(weight_ratio(None if ratio is None else density / fluid)) for density in densities) * np.abs(pull)
    fastest = min(thrown + float(np.linalg.norm(fall)) * duration, math.sqrt(thrown**2 + 2 * float(fall @ box)))
    pressures = impact_pressures(draws, "compact_pressure", densities, fluid, fastest, pull, max(sizes))
    friction = 0.0 if draws[0].happens("frictionless") else draws[0].number("friction")
    parts = tuple(
        Body(
            shape=words[k],
            size=sizes[k],
            place=tuple(map(float, places[k])),
            density=densities[k],
            youngs_modulus=modulus,
            poissons_ratio=d.number("compact_poissons_ratio"),
            compressible=True,
            material="stableNeoHookean" if d.happens("neo_hookean") else "corotational",
            friction=friction,
            velocity=tuple(map(float, velocities[k])),
            spin=tuple(map(float, spins[k])),
            impact_pressure=pressure,
            reach=reaches[k],
            surface=surfaces[k],
        )
        for k, (d, (modulus, pressure)) in enumerate(zip(draws, pressures, strict=True))
    )
    return parts, fastest
