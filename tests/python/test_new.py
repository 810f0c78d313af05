"""`new`: layouts that a short run can afford, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import without_progress, write_obj
from eulerfsi.cli import new_scene
from eulerfsi.scene.read import EARTH_GRAVITY
from pxr import Usd

BAR_OBJ = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "".join(
    f"f {f}\n" for f in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
)


def write_box(path, x: float, y: float, z: float):
    """A box with these edges as an obj file."""
    lines = []
    for line in BAR_OBJ.splitlines():
        word, *numbers = line.split()
        scaled = [f"{float(n) * e:.9g}" for n, e in zip(numbers, (x, y, z), strict=False)] if word == "v" else numbers
        lines.append(" ".join([word, *scaled]))
    path.write_text("\n".join(lines) + "\n")
    return path


SHAPES = {
    "cube": [[1, 1, 1]],
    "tiny": [[0.001, 0.001, 0.001]],
    "huge": [[1000, 1000, 1000]],
    "rod": [[2, 0.05, 0.05]],
    "upright rod": [[0.05, 2, 0.05]],
    "ten": [[0.2, 0.2, 0.2]] * 10,
    "large and small": [[4, 4, 4], [0.4, 0.4, 0.4]],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_layout_is_affordable_and_holds_the_solids_apart(shape):
    edges = np.array(SHAPES[shape], float)
    layout = new_scene.lay_out(edges)
    assert layout.cells <= 1.1 * new_scene._MAX_CELLS
    assert 48 <= layout.frames <= 480
    low, high = layout.centers - edges / 2, layout.centers + edges / 2
    assert (low[:, 1] > 0).all() and (high[:, 1] < layout.size[1]).all()
    for axis in (0, 2):
        assert (low[:, axis] > -layout.size[axis] / 2).all() and (high[:, axis] < layout.size[axis] / 2).all()
    assert (low[1:, 0] > high[:-1, 0]).all()
    # The fall from rest to the floor is seen.
    drop = float(low[:, 1].min())
    assert (2 * drop / EARTH_GRAVITY) ** 0.5 < layout.frames / layout.fps


def test_layout_does_not_depend_on_the_size_but_for_its_clock():
    small, large = (new_scene.lay_out(np.full((1, 3), size)) for size in (0.004, 0.4))
    assert small.cells == pytest.approx(large.cells, rel=0.2)
    assert small.size / 0.004 == pytest.approx(large.size / 0.4, rel=0.05)
    assert small.fps > large.fps == 24
    assert small.moduli[0] == pytest.approx(large.moduli[0] / 100, rel=0.05)  # as heavy for their stiffness


def test_finer_where_thin_and_coarser_where_there_is_much():
    cube, rod, ten = (new_scene.lay_out(np.array(SHAPES[name], float)) for name in ("cube", "rod", "ten"))
    assert rod.voxel < 2 / 24 and rod.voxel < cube.voxel
    assert ten.voxel > new_scene.lay_out(np.array(SHAPES["ten"][:1], float)).voxel


@pytest.mark.parametrize(
    ("edges", "words"),
    [
        ((1, 0, 1), "the mesh is flat, without extent along y: a solid needs a volume"),
        ((1, 0, 0), "the mesh is flat, without extent along y and z"),
        ((1, 0.001, 1), "cannot be simulated at voxel size"),
        ((12, 0.05, 0.05), "too thin for this voxel size"),
    ],
)
def test_new_refuses_what_simulate_refuses_and_leaves_nothing(cli, tmp_path, edges, words):
    write_box(tmp_path / "box.obj", *edges)
    done = cli("new", "shot.usda", "--solid", "box.obj")
    assert done.returncode == 3, done.stdout
    error = without_progress(done.stderr)
    assert error.startswith("error: box.obj: ") and words in error and error.count("box.obj") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["box.obj"]


def test_new_refuses_a_solid_too_small_beside_another(cli, tmp_path):
    write_box(tmp_path / "speck.obj", 0.001, 0.001, 0.001)
    write_box(tmp_path / "house.obj", 10, 10, 10)
    done = cli("new", "shot.usda", "--solid", "house.obj", "--solid", "speck.obj")
    error = without_progress(done.stderr)
    assert done.returncode == 3 and error.startswith("error: speck.obj: cannot be simulated"), done.stderr


def test_new_says_what_simulate_will_warn_of(cli, tmp_path):
    write_box(tmp_path / "rod.obj", 3, 0.05, 0.05)
    done = cli("new", "shot.usda", "--solid", "rod.obj")
    assert done.returncode == 0 and "warning: /World/Rod (rod.obj): the thinnest feature" in done.stderr, done.stderr


def test_new_for_a_tiny_thing_is_slow_motion(cli, tmp_path):
    write_obj(tmp_path / "ball.obj", 0.0005)
    done = cli("new", "shot.usda", "--solid", "ball.obj")
    assert done.returncode == 0 and "slow motion, 1:" in done.stdout, done.stderr
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() > 24
    run = cli("simulate", "shot.usda", "--frames", "1-2", "--progress", "none")
    assert run.returncode == 0, run.stderr
