"""Examined surfaces: progress, Ctrl-C, repairs in words, solids that overlap."""

from __future__ import annotations

import io
import os
import signal
import threading

import numpy as np
import pytest
from conftest import make_scene, sphere
from eulerfsi import progress
from eulerfsi.errors import Cancelled, LibraryError
from eulerfsi.scene import read as scene
from eulerfsi.solver import binding
from eulerfsi.solver import simulation as solver
from pxr import Sdf, Usd, UsdGeom


def ball(radius: float = 0.1, rows: int = 10) -> solver.Mesh:
    points, counts, indices = sphere(radius, rows)
    return solver.Mesh(points, counts, indices)


def test_a_surface_tells_how_far_it_is_and_gives_the_bits_of_its_mesh(library):
    seen: list[float] = []
    surface = solver.Surface(ball(), 0.02, 2, seen.append)  # append returns None: go on
    assert seen == sorted(seen) and seen[0] == 0 and seen[-1] == 1
    assert surface.report["pieces"] == 1 and surface.report["repaired"] == 0 and surface.repairs == ""
    hashes = []
    for shape in (surface.mesh, surface, surface):
        definition = {"domain_min": [-0.2] * 3, "domain_size": [0.4] * 3, "voxel_size": 0.02, "threads": 2}
        with solver.Simulation(definition) as simulation:
            _, report = simulation.add_solid(shape)
            assert report == surface.report
            simulation.step(0.01)
            hashes.append(simulation.state_hash())
    assert len(set(hashes)) == 1


def test_the_callback_stops_the_examination_and_its_exception_comes_through(library):
    with pytest.raises(LibraryError) as caught:
        solver.Surface(ball(), 0.02, 1, lambda fraction: fraction > 0.3)
    assert caught.value.status == binding.ERROR_CANCELLED

    def fail(_fraction: float) -> bool:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        solver.Surface(ball(), 0.02, 1, fail)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGHUP, 129), (signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_the_examination(library, tmp_path, monkeypatch, number, code):
    stage = make_scene(tmp_path / "ball.usda")
    handlers = {n: signal.getsignal(n) for n in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM)}
    told = threading.Event()

    def at(_self: progress.Waiting, _fraction: float) -> None:
        if not told.is_set():
            told.set()
            os.kill(os.getpid(), number)

    monkeypatch.setattr(progress.Waiting, "at", at)
    with pytest.raises(Cancelled) as caught:
        scene.read_scene(stage, tmp_path / "ball.usda")
    assert caught.value.exit_code == code
    assert {n: signal.getsignal(n) for n in handlers} == handlers


def test_waiting_is_silent_for_a_second_and_then_a_line_a_second(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    out = io.StringIO()
    waiting = progress.Waiting(progress.Progress(err=out), "examining the surface", "/World/Bunny")
    for step in range(33):
        now[0] = 100.0 + 0.1 * step
        waiting.at(step / 40)
    lines = out.getvalue().splitlines()
    assert lines[0] == "/World/Bunny: examining the surface, 25 %"
    assert len(lines) == 3


def test_the_repair_warning_says_what_was_found(cli, tmp_path):
    path = tmp_path / "ball.usda"
    stage = make_scene(path)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    indices = list(mesh.GetFaceVertexIndicesAttr().Get())
    indices[0], indices[1] = indices[1], indices[0]
    mesh.GetFaceVertexIndicesAttr().Set(indices)
    stage.GetRootLayer().Save()
    done = cli("validate", path)
    text = done.stdout + done.stderr
    assert done.returncode == 0
    assert "/World/Ball: the surface was repaired: 1 triangle against its neighbours: turned" in text
    assert "three faces" not in text


def two_balls(path, shift: float, scale: float = 1.0) -> Usd.Stage:
    """The scene's ball of radius 0.15 m and a scaled copy, `shift` metres to its right."""
    stage = make_scene(path)
    first = stage.GetPrimAtPath("/World/Ball")
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, first.GetPath(), layer, "/World/Other")
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Other"))
    points = scale * np.array(mesh.GetPointsAttr().Get()) + [shift, 0, 0]
    mesh.GetPointsAttr().Set([tuple(map(float, p)) for p in points])
    stage.GetRootLayer().Save()
    return stage


@pytest.mark.parametrize("command", ["validate", "simulate"])
def test_overlapping_solids_are_an_error_that_names_both(cli, tmp_path, command):
    path = tmp_path / "two.usda"
    two_balls(path, 0.1)
    options = ["-o", tmp_path / "cache"] if command == "simulate" else []
    done = cli(command, path, *options)
    err = done.stderr
    assert done.returncode == 3
    assert "/World/Ball and /World/Other: the solids overlap by 0." in err
    volume = float(err.split("a volume of ")[1].split(")")[0])
    assert volume == pytest.approx(
        np.pi * 0.2**2 * (0.1 + 4 * 0.15) / 12, rel=0.1
    )  # the lens; facets and a coarse grid take some
    assert "at most half a voxel, 0.025" in err
    assert not (tmp_path / "cache").exists()


def test_solids_that_touch_are_no_error(cli, tmp_path):
    path = tmp_path / "two.usda"
    two_balls(path, 0.15 + 0.06, 0.4)
    done = cli("validate", path)
    assert done.returncode == 0, done.stderr


def test_a_signal_in_validate_says_nothing_about_resuming():
    assert str(Cancelled(2)) == "stopped by signal 2"
    assert str(Cancelled(2, "continue with --resume")) == "stopped by signal 2; continue with --resume"
