"""Named cases of fluid that is shut in and of bodies in a narrow gap: a funnel, a sealed chamber, a hollow solid.

As in `thin_scenes`, every function makes the scene of a cell size h [m] in a box whose lower corner is the origin.
"""

from __future__ import annotations

import numpy as np

from . import shapes
from .thin_scenes import Case, solid
from .thin_shapes import Shape, ball, plate
from .watch import Given, Thin

MODULUS = 2e4  # Pa
GAP, BALLS, RADIUS, BOARD = 5, 2, 4, 6  # cells: of the funnel's slit, of its balls; thickness of what presses
PISTON_SPEED = 0.6  # m/s
CHAMBER, WALL = 16, 3  # cells: inner edge of what is hollow, its wall


def funnel(box: np.ndarray, h: float) -> Thin:
    """A piston presses soft balls through a slit of five eighths of their diameter."""
    middle, low, lip = box[0] / 2, 14 * h, (14 + BOARD) * h
    given = []
    for side in (-1, 1):
        wide = (box[0] - GAP * h) / 2 + 2 * h  # it reaches through the wall
        at = [middle + side * (GAP * h + wide) / 2, low + BOARD / 2 * h, box[2] / 2]
        given.append(Given(plate((wide, BOARD * h, box[2] + 4 * h), 2 * h).moved(at), friction=0.1))
    centers = [lip + (0.5 + RADIUS + k * (2 * RADIUS + 0.5)) * h for k in range(BALLS)]
    under = centers[-1] + (RADIUS + 0.5) * h
    board = plate((box[0] - 2 * h, BOARD * h, box[2] - 2 * h), 2 * h).moved([middle, under + BOARD / 2 * h, box[2] / 2])
    way = under - lip - 1.5 * h
    given.append(Given(board, 0, (0.0, -PISTON_SPEED, 0.0), way / PISTON_SPEED))
    balls = (ball(RADIUS * h, 3).moved([middle, y, box[2] / 2]) for y in centers)
    return Thin(tuple((made, solid(1000.0, MODULUS, friction=0.1)) for made in balls), tuple(given))


def hollow(h: float) -> Shape:
    """A box with a closed cavity."""
    count = CHAMBER + 2 * WALL
    full = np.ones((count,) * 3, bool)
    full[(slice(WALL, -WALL),) * 3] = False
    points, triangles = shapes.blocks(full, (h,) * 3)
    return Shape(points - count * h / 2, triangles)


def sealed(box: np.ndarray, h: float) -> Thin:
    """A ball falls in the liquid of a closed collider, which stands in more of it."""
    middle = box / 2
    return Thin(((ball(RADIUS * h, 3).moved(middle), solid(1000.0, MODULUS)),), (Given(hollow(h).moved(middle)),))


def pocket(box: np.ndarray, h: float) -> Thin:
    """A hollow solid falls to the floor with the liquid in it."""
    return Thin(((hollow(h).moved(box / 2), solid(1000.0, 10 * MODULUS, speed=1.0)),))


CASES = {
    "funnel": Case(funnel, (24, 48, 12), 0.35),
    "sealed": Case(sealed, (30, 30, 30), 0.3),
    "pocket": Case(pocket, (30, 32, 30), 0.2),
}
