"""The shapes of random scenes: closed triangle meshes and real ones, their longest edge 1, centred at the origin."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import numpy as np
from eulerfsi.solver.simulation import load_mesh
from loop import shapes

from .draw import Draw

ROOT = Path(__file__).resolve().parents[3]
MESHES = Path(os.environ.get("EFSI_SHARED_DIR", ROOT.parent / "shared")) / "meshes"
Made = tuple[np.ndarray, np.ndarray]  # points (n, 3), triangles (m, 3)


class Absent(Exception):
    """The scene needs a mesh file that is not here."""


def make_solid(draw: Draw, kinds: str = "shape") -> tuple[str, Made]:
    """The shape in words, points and triangles. kinds: table of their weights. Raises Absent."""
    kind = draw.one_of(kinds)
    words, (points, triangles) = MAKERS[kind](draw)
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    return words, (points / np.ptp(points, axis=0).max(), triangles)


def folds_nowhere(words: str) -> bool:
    """Convex shapes and the torus: their surfaces do not touch themselves unless they lose their shape."""
    return not words.endswith(".obj")


def sphere(_draw: Draw) -> tuple[str, Made]:
    return "sphere", shapes.ball()


def box(draw: Draw) -> tuple[str, Made]:
    edges = np.array([1.0, draw.number("box_edge", 1), draw.number("box_edge", 2)])
    blocks = np.maximum(1, np.rint(20 * edges)).astype(int)
    made = shapes.blocks(np.ones(blocks, bool), tuple(edges / blocks))
    return f"box 1 x {edges[1]:.2f} x {edges[2]:.2f}", made


def torus(draw: Draw) -> tuple[str, Made]:
    tube = draw.number("torus_tube")
    return f"torus, tube {tube:.2f}", shapes.torus(0.5 - tube, tube)


def capsule(draw: Draw) -> tuple[str, Made]:
    """A cylinder about the y axis between two half balls."""
    radius = draw.number("capsule_radius")
    around, rows = 48, 14
    polar = np.linspace(0, np.pi / 2, rows)[1:]
    ring = radius * np.sin(polar)
    height = (0.5 - radius) + radius * np.cos(polar)
    middle = np.linspace(height[-1], -height[-1], 14)[1:-1]
    rings = np.concatenate([ring, np.full(len(middle), radius), ring[::-1]])
    heights = np.concatenate([height, middle, -height[::-1]])
    return f"capsule, radius {radius:.2f}", revolved(rings, heights, around)


def cylinder(draw: Draw) -> tuple[str, Made]:
    """About the y axis, of height 1."""
    radius, rows, around = draw.number("cylinder_radius"), 7, 48
    cap, height = radius * np.linspace(0, 1, rows)[1:], np.linspace(0.5, -0.5, 15)[1:-1]
    rings = np.concatenate([cap, np.full(len(height), radius), cap[::-1]])
    heights = np.concatenate([np.full(len(cap), 0.5), height, np.full(len(cap), -0.5)])
    return f"cylinder, radius {radius:.2f} of its height", revolved(rings, heights, around)


def revolved(rings: np.ndarray, heights: np.ndarray, around: int) -> Made:
    """Circles about the y axis, from the top down, closed by a point at either end (at height +-1/2)."""
    angle = 2 * np.pi * np.arange(around) / around
    points = np.stack(
        [np.outer(rings, np.cos(angle)), np.repeat(heights[:, None], around, 1), -np.outer(rings, np.sin(angle))], -1
    )
    count = len(rings)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count - 1), np.arange(around), indexing="ij"))
    at = lambda a, b: a * around + b % around  # noqa: E731
    sides = shapes.split(np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], axis=1))
    top, bottom, k = count * around, count * around + 1, np.arange(around)
    first = np.stack([np.full(around, top), at(0, k), at(0, k + 1)], axis=1)
    last = np.stack([np.full(around, bottom), at(count - 1, k + 1), at(count - 1, k)], axis=1)
    ends = np.array([[0, 0.5, 0], [0, -0.5, 0]])
    return np.concatenate([points.reshape(-1, 3), ends]), np.concatenate([first, sides, last])


def superquadric(draw: Draw) -> tuple[str, Made]:
    """|x/a|^(2/e) + |y/b|^(2/e) to the e/n + |z/c|^(2/n) = 1 (Barr 1981), by stretching the directions of a ball."""
    axes = np.array([1.0, draw.number("superquadric_axis", 1), draw.number("superquadric_axis", 2)])
    east, north = draw.number("superquadric_exponent", "east"), draw.number("superquadric_exponent", "north")
    points, triangles = shapes.ball()
    unit = np.abs(points / np.linalg.norm(points, axis=1)[:, None]) + 1e-9
    flat = (unit[:, 0] ** (2 / east) + unit[:, 1] ** (2 / east)) ** (east / north)
    stretch = (flat + unit[:, 2] ** (2 / north)) ** (-north / 2)
    words = f"superquadric 1 x {axes[1]:.2f} x {axes[2]:.2f}, exponents {east:.2f} {north:.2f}"
    return words, (points / np.linalg.norm(points, axis=1)[:, None] * stretch[:, None] * axes, triangles)


def mesh(draw: Draw) -> tuple[str, Made]:
    name = draw.one_of("mesh")
    return name, loaded(name)


@functools.cache
def loaded(name: str) -> Made:
    if not (MESHES / name).is_file():
        raise Absent(f"{name}: no such file in {MESHES}")
    read = load_mesh(MESHES / name)
    return read.points.astype(float), read.triangles()


MAKERS = {
    "sphere": sphere,
    "box": box,
    "torus": torus,
    "capsule": capsule,
    "cylinder": cylinder,
    "superquadric": superquadric,
    "mesh": mesh,
}


def center_of_volume(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Of what a closed surface encloses, in its units."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
    return volumes @ (a + b + c) / 4 / volumes.sum()
