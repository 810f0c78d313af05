"""Several solids of one experiment: stacks, a heap, a ball under a load. Lengths [m]."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from eulerfsi.solver.simulation import Mesh

from . import shapes

SKIN = 0.25  # cells that contact keeps between solids
FRICTION, DAMPING = 0.5, 2e-3  # of stacks; s
STACK_MODULUS = 2e5  # Pa
LAYER = (10, 5, 10)  # cells of a box in a stack
HEAP_FRICTION, HEAP_SIZE, HEAP_PITCH = 0.3, 0.1, 0.125
BLOCK, BLOCK_MODULUS, BLOCK_POISSON, BLOCK_DENSITY = (0.32, 0.1, 0.32), 3e5, 0.3, 100.0  # under the load; Pa, kg/m^3
END_WIDTH, END_HEIGHT = 0.12, 0.06  # of the body with the spherical end
STIFFER = 100.0  # its modulus over the block's
QUIET_AFTER = 0.04  # s: Rayleigh's damping of the block, about that at which it does not swing
MEET_SPEED, MEET_MODULUS, MEET_GAP = 5.0, 2e4, 3.0  # of one against the other [m/s]; Pa; cells between them
MEET_WAY = np.array([0.9, 0.35, 0.26]) / np.linalg.norm([0.9, 0.35, 0.26])  # across the grid, as most bodies meet
ASIDE = 0.5  # of the radius: how far beside its centre one meets the other, along x then
Bodies = list[tuple[Mesh, dict[str, Any]]]


class Place(Protocol):
    """What a group wants to know of its experiment."""

    spacing: float
    box: tuple[float, float, float]
    load: float
    compressible: bool


def mesh_of(points: np.ndarray, triangles: np.ndarray, center: np.ndarray) -> Mesh:
    """A surface whose bounding box has its middle at `center`."""
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2 + center
    return Mesh(points, np.full(len(triangles), 3), triangles.ravel())


def layers(run: Place, densities: tuple[float, ...]) -> Bodies:
    """Boxes one above the other on the floor, where contact holds them."""
    h, bodies = run.spacing, []
    for k, density in enumerate(densities):
        height = (k * (LAYER[1] + SKIN) + LAYER[1] / 2) * h
        made = shapes.blocks(np.ones(LAYER, bool), (h, h, h))
        values = {"density": density, "youngs_modulus": STACK_MODULUS, "poissons_ratio": 0.3, "friction": FRICTION}
        values |= {"rayleigh_beta": DAMPING, "compressible": int(run.compressible)}
        bodies.append((mesh_of(*made, np.array([run.box[0] / 2, height, run.box[2] / 2])), values))
    return bodies


def stack(run: Place) -> Bodies:
    return layers(run, (1000.0,) * 3)


def heavy_on_soft(run: Place) -> Bodies:
    """The upper box weighs a hundred times as much: a twentieth of the modulus presses on the lower one."""
    return layers(run, (100.0, 10000.0))


def heap(run: Place) -> Bodies:
    """Twenty bodies of four shapes in three layers, turned; they fall into a narrow box."""
    turns, bodies = np.random.default_rng(20), []
    ball = shapes.ball(3)
    egg = (ball[0] * [1.0, 0.8, 0.7], ball[1])
    cube, brick = (shapes.blocks(np.ones(n, bool), (0.1 / 8,) * 3) for n in ((7, 7, 7), (8, 5, 6)))
    for k in range(20):
        points, triangles = (ball, cube, egg, brick)[k % 4]
        points = points * (HEAP_SIZE / np.linalg.norm(np.ptp(points, axis=0) if k % 4 % 2 else [shapes.SIZE]))
        turn, _ = np.linalg.qr(turns.normal(size=(3, 3)))
        points = points @ (turn * np.sign(np.linalg.det(turn)))
        column = np.array([k % 9 % 3, k // 9, k % 9 // 3])
        center = HEAP_PITCH * (column + 0.5) + [0.0, 0.01, 0.0]
        values = {"density": 1000.0, "youngs_modulus": STACK_MODULUS, "poissons_ratio": 0.3, "friction": HEAP_FRICTION}
        values |= {"rayleigh_beta": DAMPING, "compressible": int(run.compressible)}
        bodies.append((mesh_of(points, triangles, center), values))
    return bodies


def pressed(run: Place) -> Bodies:
    """A soft block on the floor and a stiff body with a spherical end on it, whose density is the experiment's load.

    Its centre of mass lies below the centre of the sphere, so that it does not fall over.
    """
    middle = np.array(run.box) / 2
    count = np.rint(np.array(BLOCK) / 0.01).astype(int)
    block = shapes.blocks(np.ones(count, bool), tuple(np.array(BLOCK) / count))
    points, triangles = shapes.blocks(np.ones((24, 6, 24), bool), (1 / 24, 1 / 6, 1 / 24))
    x, up, z = points.T
    x, z = (END_WIDTH * (v - 0.5) for v in (x, z))
    low = shapes.RADIUS - np.sqrt(shapes.RADIUS**2 - x**2 - z**2)
    end = np.stack([x, low + up * (END_HEIGHT - low), z], axis=1), triangles
    bottom = BLOCK[1] + SKIN * run.spacing
    common = {"poissons_ratio": BLOCK_POISSON, "compressible": 1}
    return [
        (
            mesh_of(*block, np.array([middle[0], BLOCK[1] / 2, middle[2]])),
            common | {"density": BLOCK_DENSITY, "youngs_modulus": BLOCK_MODULUS, "rayleigh_beta": QUIET_AFTER},
        ),
        (
            mesh_of(*end, np.array([middle[0], bottom + END_HEIGHT / 2, middle[2]])),
            common
            | {"density": run.load, "youngs_modulus": STIFFER * BLOCK_MODULUS, "rayleigh_beta": QUIET_AFTER / STIFFER},
        ),
    ]


def two_balls(run: Place, way: np.ndarray, aside: float) -> Bodies:
    """That fly at each other along a unit vector. aside: of the lines of their centres, along y [m]."""
    middle, bodies, made = np.array(run.box) / 2, [], shapes.ball()
    for side in (-1, 1):
        at = middle + side * (shapes.RADIUS + MEET_GAP / 2 * run.spacing) * way + [0, side * aside / 2, 0]
        values = {"density": 1000.0, "youngs_modulus": MEET_MODULUS, "poissons_ratio": 0.3}
        values |= {"velocity": tuple(map(float, -side * MEET_SPEED / 2 * way)), "compressible": int(run.compressible)}
        bodies.append((mesh_of(*made, at), values))
    return bodies


def head_on(run: Place) -> Bodies:
    return two_balls(run, MEET_WAY, 0.0)


def off_centre(run: Place) -> Bodies:
    return two_balls(run, np.array([1.0, 0.0, 0.0]), ASIDE * shapes.RADIUS)


GROUPS = {"stack": stack, "heavy on soft": heavy_on_soft, "heap": heap, "pressed": pressed}
GROUPS |= {"meet head on": head_on, "meet off centre": off_centre}
