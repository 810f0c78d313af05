"""Points bound to a surface that deforms: nearest points of triangles, and what stays as it was."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import sphere
from eulerfsi.scene.follow import Binding
from eulerfsi.solver.simulation import Mesh, nearest_on_triangles


def folded(angle: float) -> np.ndarray:
    """A sheet of three rows of points along x, bent about its middle row by twice the angle: (9, 3)."""
    rows = [(-0.1, angle), (0.0, 0.0), (0.1, -angle)]
    return np.array([(x * math.cos(a), x * math.sin(a), z) for x, a in rows for z in (-0.1, 0.0, 0.1)])


SHEET = np.array([(3 * i + j, 3 * i + j + 1, 3 * i + j + 4) for i in (0, 1) for j in (0, 1)])
SHEET = np.concatenate([SHEET, [(a, c, a + 3) for a, _, c in SHEET]])


def test_nearest_points_are_those_of_the_thorough_way() -> None:
    random = np.random.default_rng(7)
    vertices = random.normal(size=(80, 3))
    corners = vertices[np.array([random.choice(80, 3, replace=False) for _ in range(120)])]
    points = 1.5 * random.normal(size=(300, 3))
    triangle, weights = nearest_on_triangles(corners, points)
    assert weights.min() >= 0.0 and np.abs(weights.sum(axis=1) - 1.0).max() < 1e-14
    found = np.linalg.norm(np.einsum("nk,nkc->nc", weights, corners[triangle]) - points, axis=1)
    side = np.linspace(0.0, 1.0, 41)
    u, v = (grid[np.add.outer(side, side) <= 1.0 + 1e-9] for grid in np.meshgrid(side, side))
    places = np.einsum("sk,tkc->tsc", np.stack([u, v, 1.0 - u - v], axis=1), corners).reshape(-1, 3)
    thorough = np.array([np.linalg.norm(places - point, axis=1).min() for point in points])
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    assert (thorough - found).min() > -1e-12 and (thorough - found).max() < edge / 40


def test_of_equally_near_triangles_the_first_is_taken() -> None:
    corners = np.array([[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 0, 0), (1, 1, 0), (0, 1, 0)]], float)
    triangle, weights = nearest_on_triangles(corners[[0, 0, 1, 1]], np.array([(0.5, 0.5, 1.0), (2.0, 2.0, 0.0)]))
    assert triangle.tolist() == [0, 2]
    assert np.allclose(weights, [(0, 0.5, 0.5), (0, 1, 0)])


def test_what_is_bent_tears_nothing_and_keeps_its_distance() -> None:
    """Points close together at rest stay so over an edge where the faces turn apart by a right angle."""
    line = np.linspace(-0.06, 0.06, 401)
    strip = np.stack([line, np.full_like(line, 0.02), np.full_like(line, 0.03)], axis=1)
    bent = folded(math.pi / 4)
    now = Binding(folded(0.0), SHEET, strip).points(bent)
    gaps = np.linalg.norm(np.diff(now, axis=0), axis=1) / (line[1] - line[0])
    assert gaps.min() > 0.8 and gaps.max() < 1.6  # the outer side of a bend is longer
    triangle, weights = nearest_on_triangles(bent[SHEET], now)
    away = np.linalg.norm(np.einsum("nk,nkc->nc", weights, bent[SHEET][triangle]) - now, axis=1)
    assert np.abs(away / 0.02 - 1.0).max() < 0.3
    assert np.array_equal(now[:, 2], strip[:, 2])


@pytest.mark.parametrize("height", (1.0, 0.0, -1.0))
def test_a_surface_that_is_crushed_gives_places_that_are_finite(height: float) -> None:
    points, counts, indices = sphere(0.12, 8)
    binding = Binding(points, Mesh(points, counts, indices).triangles(), 1.3 * points)
    now = binding.points(points * (1.0, height, 1.0))
    assert np.isfinite(now).all() and np.abs(now).max() < 2.0 * 1.3 * 0.12
    assert np.isfinite(binding.points(np.zeros_like(points))).all()


def test_triangles_without_area_bind_nothing() -> None:
    points, counts, indices = sphere(0.12, 8)
    triangles = Mesh(points, counts, indices).triangles()
    more = np.concatenate([[(0, 0, 5), (5, 5, 5)], triangles])
    moved = points * (1.0, 1.5, 0.9)
    plain, crowded = (Binding(points, faces, 1.1 * points).points(moved) for faces in (triangles, more))
    assert np.array_equal(plain, crowded)
