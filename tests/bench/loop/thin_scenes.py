"""The named cases of thin bodies that meet: strap, chain, ring, rod, rope, press. All their parameters are here.

Every function makes the scene of a cell size h [m] in a box whose lower corner is the origin.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from .thin_shapes import ball, link, plate, ring, rod, rope
from .watch import Given, Thin

H = 0.01  # m: the cell of all cases
POISSON = 0.3
GRAVITY = 9.8
SIDEWAYS = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # turn about y by a quarter


@dataclasses.dataclass(frozen=True)
class Case:
    """cells: of the box; lengths below in cells."""

    make: Callable[[np.ndarray, float], Thin]  # of the box's edges and h [m]
    cells: tuple[int, int, int]
    duration: float  # s
    gravity: float = GRAVITY


def solid(density: float, modulus: float, friction: float = 0.0, speed: float = 0.0) -> dict[str, Any]:
    """Fields of EfsiSolidDef; speed: downwards."""
    return {
        "density": density,
        "youngs_modulus": modulus,
        "poissons_ratio": POISSON,
        "friction": friction,
        "velocity": (0.0, -speed, 0.0),
    }


def clamps(at: np.ndarray, long: float, size: tuple[float, float, float], number: int) -> tuple[Given, Given]:
    """Pins of solid `number` around both ends along x of what lies at `at`. size: of a pin's box."""
    low, high = (plate(size, size[1] / 3).moved(at + [side * long / 2, 0, 0]) for side in (-1, 1))
    return Given(low, number), Given(high, number)


# --- a heavy ball falls on a strap -----------------------------------------------------------------------------------

STRAP_CELLS, STRAP_LONG, STRAP_WIDE, STRAP_MODULUS, HELD = 4.5, 40, 12, 4e4, 3  # Pa; HELD: of either end
BALL_RADIUS, BALL_DENSITY, BALL_MODULUS, BALL_SPEED = 5, 3000.0, 3e5, 3.0


def strap(box: np.ndarray, h: float) -> Thin:
    at = np.array([box[0] / 2, 40 * h, box[2] / 2])
    belt = plate((STRAP_LONG * h, STRAP_CELLS * h, STRAP_WIDE * h), h).moved(at)
    above = at + [0, (STRAP_CELLS / 2 + BALL_RADIUS + 1) * h, 0]
    parts = (
        (belt, solid(1000.0, STRAP_MODULUS)),
        (
            ball(BALL_RADIUS * h).moved(above),
            solid(BALL_DENSITY, BALL_MODULUS, speed=BALL_SPEED),
        ),
    )
    held = (2 * HELD * h, 2 * STRAP_CELLS * h, 2 * STRAP_WIDE * h)
    return Thin(parts, clamps(at, STRAP_LONG * h, held, 1))


# --- four links hang -------------------------------------------------------------------------------------------------

LINKS, WIRE, HOLE, STRAIGHT, LINK_MODULUS = 4, 4, 7, 6, 6e4
APART = 1.25  # that a link falls before the one above it holds it


def chain(box: np.ndarray, h: float) -> Thin:
    made = link(WIRE * h, HOLE * h, STRAIGHT * h, h)
    high = STRAIGHT + WIRE + HOLE  # of the centre line
    at = np.array([box[0] / 2, box[1] - (high / 2 + WIRE / 2 + 3) * h, box[2] / 2])
    down = np.array([0, -(high - WIRE - APART) * h, 0])
    parts = [
        (made.moved(at + k * down, SIDEWAYS if k % 2 else None), solid(1000.0, LINK_MODULUS)) for k in range(LINKS)
    ]
    top = plate((3 * WIRE * h, 1.5 * WIRE * h, 3 * WIRE * h), WIRE * h / 2).moved(at + [0, high / 2 * h, 0])
    return Thin(tuple(parts), (Given(top, 1),))


# --- a ball is pulled through a ring ---------------------------------------------------------------------------------

PULLED_RADIUS, PULLED_MODULUS, PULL_SPEED = 6, 4e4, 0.5
RING_WIRE, RING_MODULUS, RING_SHARE = 4, 6e4, 0.9  # inner diameter over the ball's
RING_HELD = 1.2  # radius of the ring that holds the ring's outer side
PULL_FROM = 10  # above the ring's middle, and as far below it


def through_a_ring(box: np.ndarray, h: float) -> Thin:
    at = np.array([box[0] / 2, box[1] / 2, box[2] / 2])
    radius = RING_SHARE * PULLED_RADIUS + RING_WIRE / 2
    above = at + [0, PULL_FROM * h, 0]
    parts = (
        (ring(radius * h, RING_WIRE * h, h).moved(at), solid(1000.0, RING_MODULUS)),
        (ball(PULLED_RADIUS * h, axis=1, beyond=100 * h).moved(above), solid(1000.0, PULLED_MODULUS)),
    )
    around = ring((radius + RING_WIRE / 2) * h, 2 * RING_HELD * h, h / 2).moved(at)
    core = ball(PULLED_RADIUS / 3 * h, 2).moved(above)
    pull = Given(core, 2, (0.0, -PULL_SPEED, 0.0), 2 * PULL_FROM * h / PULL_SPEED)
    return Thin(parts, (Given(around, 1), pull))


# --- a rod with a point falls on a sheet -----------------------------------------------------------------------------

SHEET_CELLS, SHEET_EDGE, SHEET_MODULUS = 3, 22, 4e4
ROD_LONG, ROD_THICK, ROD_TIP, ROD_DENSITY, ROD_MODULUS, ROD_SPEED = 16, 5, 1.5, 2000.0, 1e6, 3.0  # tip: its radius


def rod_at_a_sheet(box: np.ndarray, h: float) -> Thin:
    at = np.array([box[0] / 2, 18 * h, box[2] / 2])
    sheet = plate((SHEET_EDGE * h, SHEET_CELLS * h, SHEET_EDGE * h), h).moved(at)
    above = at + [0, (SHEET_CELLS / 2 + ROD_LONG / 2 + 1) * h, 0]
    spear = rod(ROD_LONG * h, ROD_THICK * h, ROD_TIP * h, h).moved(above)
    parts = (sheet, solid(1000.0, SHEET_MODULUS)), (spear, solid(ROD_DENSITY, ROD_MODULUS, speed=ROD_SPEED))
    held = (2 * HELD * h, 2 * SHEET_CELLS * h, 2 * SHEET_EDGE * h)
    return Thin(parts, clamps(at, SHEET_EDGE * h, held, 1))


# --- a rope falls and folds ------------------------------------------------------------------------------------------

ROPE_CELLS, ROPE_LONG, ROPE_MODULUS, ROPE_WAVE = 5, 48, 1.5e4, 3  # wave: how far it hangs beside a straight line
ROPE_FALL = 2


def folding_rope(box: np.ndarray, h: float) -> Thin:
    up = np.linspace(0, 1, ROPE_LONG + 1)
    bend = ROPE_WAVE * np.stack([np.sin(2 * np.pi * up), 0 * up, 0.5 * np.sin(4 * np.pi * up)], axis=1)
    center = h * (bend + np.stack([0 * up, ROPE_FALL + ROPE_LONG * up, 0 * up], axis=1))
    made = rope(center + [box[0] / 2, 0, box[2] / 2], ROPE_CELLS * h, h)
    return Thin(((made, solid(1000.0, ROPE_MODULUS, friction=0.3)),))


# --- a ball is pressed flat ------------------------------------------------------------------------------------------

PRESSED_RADIUS, PRESSED_MODULUS, PRESS_SPEED, PRESSED_TO = 6, 2e4, 0.3, 0.2  # of its height; speed of either plate
PRESS_HIGH = 6  # of a plate


def pressed(box: np.ndarray, h: float) -> Thin:
    middle, given = np.array(box) / 2, []
    way = (PRESSED_RADIUS * (1 - PRESSED_TO) + 0.5) * h
    for side in (-1, 1):
        at = middle + [0, side * (PRESSED_RADIUS + PRESS_HIGH / 2 + 0.5) * h, 0]
        board = plate((box[0] - 4 * h, PRESS_HIGH * h, box[2] - 4 * h), 2 * h).moved(at)
        given.append(Given(board, 0, (0.0, -side * PRESS_SPEED, 0.0), way / PRESS_SPEED, 0.2))
    parts = ((ball(PRESSED_RADIUS * h, 3).moved(middle), solid(1000.0, PRESSED_MODULUS, friction=0.2)),)
    return Thin(parts, tuple(given))


CASES = {
    "strap": Case(strap, (48, 54, 22), 0.15),
    "chain": Case(chain, (22, 74, 22), 0.3),
    "ring": Case(through_a_ring, (26, 42, 26), 0.4),
    "rod": Case(rod_at_a_sheet, (28, 40, 28), 0.1),
    "rope": Case(folding_rope, (26, 56, 26), 0.4),
    "press": Case(pressed, (30, 18, 30), 0.2, 0.0),
}
