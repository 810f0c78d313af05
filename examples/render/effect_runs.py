"""Small two-dimensional runs for the pictures of docs/effects.md: a block or a disc in a box one voxel thick."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from eulerfsi import Mesh, Simulation
from eulerfsi.errors import LibraryError
from eulerfsi.solver.simulation import Surface

__all__ = ["Frame", "LibraryError", "run"]

FPS = 24
_SIDE = 16  # edges of a block's side, and squares of its pattern
_VALUES = ("domain", "solid", "emitter", "force")
# What every run begins with; a row of effects.toml and its variants change it. Names are fields of the C structs.
_DOMAIN = {"voxel_size": 0.02, "gravity": (0.0, -9.81, 0.0), "threads": 1}
_SOLID = {"density": 1000.0, "youngs_modulus": 2e4, "poissons_ratio": 0.45}


@dataclasses.dataclass
class Frame:
    """outline: (n, 2), of the solid; pattern: (17, 17, 2), points that ride on it; both empty without one.

    smoke: density of each cell, rows from below; None without an emitter.
    """

    outline: np.ndarray
    pattern: np.ndarray
    smoke: np.ndarray | None


def run(scene: dict[str, Any], variant: dict[str, Any]) -> list[Frame]:
    """Frames 1 (the start) to scene["frames"] of a scene with the values of a variant."""
    values = {name: {**scene.get(name, {}), **variant.get(name, {})} for name in _VALUES}
    domain = _DOMAIN | values["domain"]
    voxel, (width, height) = domain["voxel_size"], scene["box"]
    with Simulation(domain | {"domain_size": (width, height, voxel)}) as simulation:
        solid = rider = None
        if scene.get("shape"):
            outline, pattern = shape(scene["shape"], scene["size"], scene["center"], scene.get("turn", 0.0))
            surface = Surface(_prism(outline, voxel), voxel, threads=1).extrude_in_slab(2, 0.0, voxel)
            solid, _ = simulation.add_solid(surface, **_SOLID | values["solid"])
            points = pattern.reshape(-1, 2)
            rider = simulation.add_passenger(solid, np.c_[points, np.full(len(points), voxel / 2)])
        if "region" in scene:
            simulation.add_emitter(transform=_place(*scene["region"], voxel), **values["emitter"])
        if values["force"]:
            simulation.add_force(transform=_place(*scene["force_region"], voxel), **values["force"])
        frames = [_look(simulation, solid, rider)]
        while len(frames) < scene["frames"]:
            simulation.advance(1 / scene.get("rate", FPS))
            frames.append(_look(simulation, solid, rider))
    return frames


def shape(kind: str, size: float, center: tuple[float, float], turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Outline, against the clock, and pattern of a block or a disc of that size, turned by degrees."""
    steps = np.linspace(-0.5, 0.5, _SIDE + 1)
    if kind == "block":
        sides = [np.c_[steps[:-1], np.full(_SIDE, -0.5)]]
        for _ in range(3):
            sides.append(sides[-1] @ np.array([[0.0, 1.0], [-1.0, 0.0]]))  # a quarter turn
        outline, reach = np.concatenate(sides), 0.49
    else:
        angles = 2 * np.pi * np.arange(4 * _SIDE) / (4 * _SIDE)
        outline, reach = 0.5 * np.c_[np.cos(angles), np.sin(angles)], 0.33
    pattern = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1) * 2 * reach
    cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    turned = np.array([[cosine, sine], [-sine, cosine]]) * size
    return outline @ turned + center, pattern @ turned + center


def _prism(outline: np.ndarray, height: float) -> Mesh:
    """A closed mesh over an outline, from z = 0 to a height."""
    count = len(outline)
    points = np.concatenate([np.c_[outline, np.full(count, z)] for z in (0.0, height)])
    around = [[k, (k + 1) % count, count + (k + 1) % count, count + k] for k in range(count)]
    caps = [list(range(count))[::-1], list(range(count, 2 * count))]
    indices = [index for face in (*caps, *around) for index in face]
    return Mesh(points, [count, count] + [4] * count, indices)


def _place(low: tuple[float, float], high: tuple[float, float], voxel: float) -> list[list[float]]:
    """Transform of the unit cube to a region through the slab."""
    edges, middle = np.subtract(high, low), np.add(low, high) / 2
    return [[edges[0], 0, 0, middle[0]], [0, edges[1], 0, middle[1]], [0, 0, 2 * voxel, voxel / 2], [0, 0, 0, 1]]


def _look(simulation: Simulation, solid: int | None, rider: int | None) -> Frame:
    outline, pattern = np.empty((0, 2)), np.empty((0, 0, 2))
    if solid is not None:
        points = simulation.surface(solid)[0]
        outline = points[: len(points) // 2, :2].copy()
        pattern = simulation.passenger(rider)[0][:, :2].reshape(_SIDE + 1, _SIDE + 1, 2).copy()
    smoke = simulation.field("smoke_density")[0][0]
    return Frame(outline, pattern, smoke[:, :, 0].T if smoke.size else None)
