"""Whether bodies have exchanged sides: passes that are planted in translated meshes, and what only comes near one."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "bench"))

from eulerfsi.solver.simulation import Surface  # noqa: E402
from loop import experiment, sides, thin_scenes, thin_shapes  # noqa: E402
from loop.overlap import deepest_vertex  # noqa: E402
from loop.sides import Sides  # noqa: E402
from loop.watch import mesh_of  # noqa: E402

H = 0.01
TURNED = thin_scenes.SIDEWAYS


def followed(bodies: list[thin_shapes.Shape], ways: list[np.ndarray]) -> list[sides.Passed]:
    """What is seen after each step of bodies that stand at offsets (steps, 3) from where they are."""
    surfaces = lambda k: [(b.points + way[k], b.triangles) for b, way in zip(bodies, ways, strict=True)]  # noqa: E731
    watch = Sides([body.trace for body in bodies], surfaces(0))
    return [watch.follow(surfaces(k)) for k in range(1, len(ways[0]))]


def path(*stops: tuple[float, float, float], step: float = H) -> np.ndarray:
    """Offsets on straight ways from stop to stop."""
    places = [np.array(stops[0], float)[None]]
    for start, end in zip(stops[:-1], stops[1:], strict=True):
        count = max(1, int(np.ceil(np.linalg.norm(np.subtract(end, start)) / step)))
        places.append(np.linspace(start, end, count + 1)[1:])
    return np.concatenate(places)


def still(other: np.ndarray) -> np.ndarray:
    return np.zeros_like(other)


STRAP = thin_shapes.plate((0.2, 4.5 * H, 0.1), 1.5 * H)
BALL = thin_shapes.ball(0.04, levels=2)
ABOVE = 4.5 * H / 2 + 0.04  # of the ball that touches the strap


@pytest.mark.parametrize("step", [0.6 * H, 3.0 * H])
def test_a_ball_through_a_strap_is_found_whatever_the_steps(step: float) -> None:
    way = path((0, 1.3 * ABOVE, 0), (0, -1.3 * ABOVE, 0), step=step)
    seen = followed([STRAP, BALL.moved((0, 0, 0))], [still(way), way])
    assert seen[-1].vertices > len(BALL.points) / 2 and seen[-1].pairs == ((1, 2),)
    first = next(k for k, now in enumerate(seen) if now.vertices)
    assert way[first + 1][1] < 0.04 - 2.25 * H + 1e-9  # its lowest point is out below


@pytest.mark.parametrize(
    "stops",
    [
        [(0, 1.3 * ABOVE, 0), (0, ABOVE, 0), (0, 1.3 * ABOVE, 0)],  # touches
        [(0, 1.3 * ABOVE, 0), (0, ABOVE - 2.25 * H, 0), (0, 1.3 * ABOVE, 0)],  # half a thickness deep, and back
        [(0, 1.3 * ABOVE, 0), (0, ABOVE - 3.5 * H, 0), (0, 1.3 * ABOVE, 0)],  # past the middle, and back
        [(0, 1.3 * ABOVE, 0), (0, 1.3 * ABOVE, 0.2), (0, -1.3 * ABOVE, 0.2), (0, -1.3 * ABOVE, 0)],  # around its edge
        [(0, 0, 0.091), (0, ABOVE, 0.091), (0, -ABOVE, 0.091)],  # along its side, where they touch
    ],
    ids=["touch", "half", "more than half", "around", "along"],
)
def test_a_ball_that_comes_back_or_goes_around_has_not_passed(stops: list[tuple[float, float, float]]) -> None:
    way = path(*stops)
    assert all(one.pairs == () for one in followed([STRAP, BALL], [still(way), way]))


@pytest.mark.parametrize(("deep", "passed"), [(0.8 * H, False), (3 * H, True)])
def test_a_ball_that_goes_around_an_edge_may_overlap_it_by_less_than_a_cell(deep: float, passed: bool) -> None:
    strap = thin_shapes.plate((0.1, 4.5 * H, 0.1), 0.4 * H)  # whose middle surface ends 0.4 cells inside
    way = path((0, ABOVE, 0.09 - deep), (0, -ABOVE, 0.09 - deep))
    assert (followed([strap, BALL], [still(way), way])[-1].vertices > 0) == passed


def test_a_rod_through_a_sheet_is_found_while_it_sticks_in_it() -> None:
    sheet, rod = thin_shapes.plate((0.2, 3 * H, 0.2), H), thin_shapes.rod(0.16, 5 * H, 1.5 * H, H)
    way = path((0, 0.1, 0), (0, 0.03, 0))
    seen = followed([sheet, rod], [still(way), way])
    assert seen[-1].vertices > 20 and seen[-1].lines == 0
    way = path((0, 0.1, 0), (0, 0.08, 0), (0, 0.1, 0))  # the point is half through
    assert deepest_vertex([(sheet.points, sheet.triangles), (rod.points + way[2], rod.triangles)]) > 0.8 * H
    assert not any(one.pairs for one in followed([sheet, rod], [still(way), way]))


def test_links_that_are_pulled_apart_are_found_by_their_linking_number() -> None:
    upper = thin_shapes.link(4 * H, 7 * H, 6 * H, H)
    lower = upper.moved((0, -0.1175, 0), TURNED)
    apart = path((0, 0, 0), (0, -0.2, 0))
    seen = followed([upper, lower], [still(apart), apart])
    assert seen[-1].lines == 1 and seen[-1].pairs == ((1, 2),)
    half = path((0, 0, 0), (0, -0.0125 - 2 * H, 0), (0, 0, 0))  # overlap of half a wire
    assert deepest_vertex([(upper.points, upper.triangles), (lower.points + [0, -0.03, 0], lower.triangles)]) > 0.8 * H
    assert not any(one.pairs for one in followed([upper, lower], [still(half), half]))


def test_a_ball_beside_or_through_a_ring() -> None:
    ring = thin_shapes.ring(0.075, 4 * H, H)
    ball = thin_shapes.ball(0.05, levels=2, axis=1, beyond=1.0)
    down = path((0, 0.09, 0), (0, -0.09, 0))
    assert not any(one.pairs for one in followed([ring, ball], [still(down), down]))  # the hole is wide enough
    aside = down + [0.05, 0, 0]  # its centre line stays in the hole, its side cuts the ring
    assert followed([ring, ball], [still(aside), aside])[-1].vertices > 0
    across = path((0, 0.2, 0), (0, 0.2, 0), (0.15, 0.2, 0))
    assert followed([ring, ball], [still(across), across])[-1].lines == 1


def test_a_rope_that_goes_through_itself_is_found() -> None:
    straight = np.stack([np.linspace(-0.1, 0.1, 21), 0 * np.arange(21), 0 * np.arange(21)], axis=1)
    bar = thin_shapes.rope(straight, 4 * H, H)
    down = path((0, 0.06, 0), (0, -0.06, 0), step=0.01)
    crossed = thin_shapes.rope(straight[:, ::-1], 4 * H, H)
    seen = followed([bar, crossed], [still(down), down])
    assert seen[-1].lines == 1 and seen[-1].vertices > 0
    # One rope whose second half is bent back over the first and then goes through it.
    turn = np.linspace(-0.5 * np.pi, 1.5 * np.pi, 40)
    bend = np.stack([0.1 * np.sin(turn), 0 * turn, 0.1 * np.sin(2 * turn)], axis=1)
    lifted = bend + np.outer(np.linspace(0, 1, len(bend)), [0, 0.1, 0])
    pushed = bend - np.outer(np.linspace(0, 1, len(bend)), [0, 0.1, 0])
    shapes = [thin_shapes.rope(lifted + k / 12 * (pushed - lifted), 4 * H, H) for k in range(13)]
    watch = Sides([shapes[0].trace], [(shapes[0].points, shapes[0].triangles)])
    seen = [watch.follow([(shape.points, shape.triangles)]) for shape in shapes]
    assert seen[4].pairs == () and seen[-1].pairs == ((1, 1),)


def test_gauss_integrals_of_closed_polygons_are_whole() -> None:
    turn = np.linspace(0, 2 * np.pi, 41)
    one = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    other = np.stack([1 + np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    twice = np.stack([2 + 0.3 * np.cos(2 * turn), 0.3 * np.sin(2 * turn) + 0 * turn, 0 * turn], axis=1)
    assert abs(sides.gauss_integral(one, other)) == pytest.approx(1, abs=1e-9)
    assert sides.gauss_integral(one, other + [3, 0, 0]) == pytest.approx(0, abs=1e-9)
    assert abs(sides.gauss_integral(other, twice)) == pytest.approx(2, abs=1e-9)


@pytest.mark.parametrize("name", experiment.WATCHED)
def test_named_cases_are_closed_meshes_that_do_not_touch(library, name: str) -> None:
    case, h = experiment.WATCHED[name], thin_scenes.H
    made = case.make(h * np.array(case.cells), h)
    for shape, _ in made.parts:
        report = Surface(mesh_of(shape), h).report
        assert report["closed"] == 1 and report["repaired"] == 0 and report["thinnest_feature"] > 2.8 * h
        assert (shape.points > 0).all() and (shape.points < h * np.array(case.cells)).all()
    bodies = [shape for shape, _ in made.parts] + [given.shape for given in made.given if not given.solid]
    surfaces = [(shape.points, shape.triangles) for shape in bodies]
    assert deepest_vertex(surfaces) == 0
    assert Sides([shape.trace for shape in bodies], surfaces).follow(surfaces) == sides.Passed()
