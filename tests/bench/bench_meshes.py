"""Seconds that the examination of a mesh takes before the first step: `./eulerfsi bench meshes [--mesh FILE]`.

Made meshes of several kinds, closed, open, crossing and loose, of a few thousand triangles and of 100 000, each 100
cells across; each line prints triangles, what was found, seconds, processor seconds and the bar. Exit code 1 if the bar
is missed, unless CI=true or --quick (20 cells across, where the bar means nothing).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", ROOT / "tests" / "bench"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from eulerfsi.solver.simulation import Mesh, Surface, load_mesh  # noqa: E402
from loop import shapes  # noqa: E402

BAR = 5.0  # s, on two threads
THREADS = 2
Made = tuple[np.ndarray, np.ndarray]  # points (n, 3), triangles (m, 3)


def many(shape: Made, count: int, apart: float, size: float) -> Made:
    """Copies of a shape, each `size` long and turned its own way, at random places in a cube of edge `apart`."""
    points, triangles = shape
    random = np.random.default_rng(1)
    parts = [points * (size / shapes.SIZE) @ shapes.rotation(random.uniform(0, 6)).T for _ in range(count)]
    places = random.uniform(0, apart, (count, 3))
    starts = len(points) * np.arange(count)
    return (
        np.concatenate([part + place for part, place in zip(parts, places, strict=True)]),
        np.concatenate([triangles + start for start in starts]),
    )


def lattice(shape: Made, count: int, size: float) -> Made:
    """count^3 copies of a shape that do not touch, in a cube of edge 1."""
    points, triangles = shape
    places = (np.stack(np.meshgrid(*[np.arange(count)] * 3), axis=-1).reshape(-1, 3) + 0.5) / count
    return (
        np.concatenate([points * (size / shapes.SIZE) + place for place in places]),
        np.concatenate([triangles + len(points) * number for number in range(len(places))]),
    )


def opened(shape: Made, part: float) -> Made:
    """The shape without the triangles of its highest `part`."""
    points, triangles = shape
    height = points[triangles].mean(axis=1)[:, 1]
    return points, triangles[height < np.quantile(height, 1 - part)]


def sheet(cuts: int) -> Made:
    """A bent square, cuts x cuts quads: a leaf."""
    u, v = np.meshgrid(*[np.linspace(-0.5, 0.5, cuts + 1)] * 2, indexing="ij")
    points = shapes.SIZE * np.stack([u, 0.3 * u * u + 0.1 * v, v], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(cuts), np.arange(cuts), indexing="ij"))
    at = lambda a, b: a * (cuts + 1) + b  # noqa: E731
    return points, shapes.split(np.stack([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)], axis=1))


def joined(*parts: Made) -> Made:
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(points) for points, _ in parts[:-1]])
    return (
        np.concatenate([points for points, _ in parts]),
        np.concatenate([triangles + start for (_, triangles), start in zip(parts, starts, strict=True)]),
    )


KINDS: dict[str, Callable[[], Made]] = {
    "one ball, 1 k": lambda: shapes.ball(3),
    "balls apart, 2 k": lambda: lattice(shapes.ball(1), 3, 0.25),
    "balls that cross, 3 k": lambda: many(shapes.ball(2), 9, 0.7, 0.5),
    "open balls that cross, 3 k": lambda: many(opened(shapes.ball(2), 0.15), 10, 0.7, 0.5),
    "leaves, 3 k": lambda: many(sheet(2), 350, 1.0, 0.2),
    "ball and leaves, 3 k": lambda: joined(shapes.ball(2), many(sheet(2), 330, 0.4, 0.1)),
    "one ball, 82 k": lambda: shapes.ball(6),
    "one open ball, 78 k": lambda: opened(shapes.ball(6), 0.05),
    "torus, 100 k": lambda: shapes.torus(0.07, 0.03, 320, 156),
    "balls apart, 98 k": lambda: lattice(shapes.ball(2), 7, 0.13),
    "balls that cross, 100 k": lambda: many(shapes.ball(2), 312, 1.0, 0.2),
    "open balls that cross, 99 k": lambda: many(opened(shapes.ball(2), 0.15), 364, 1.0, 0.2),
    "leaves, 100 k": lambda: many(sheet(3), 5555, 1.0, 0.06),
    "ball and leaves, 100 k": lambda: joined(shapes.ball(5), many(sheet(3), 4400, 0.3, 0.02)),
    "loose triangles, 100 k": lambda: many((sheet(1)[0], sheet(1)[1][:1]), 100000, 1.0, 0.02),
}


def measure(name: str, mesh: Mesh, across: int) -> float:
    """Prints a line and returns the seconds."""
    voxel = float(np.ptp(mesh.points, axis=0).max()) / across
    begun, used = time.perf_counter(), time.process_time()
    report = Surface(mesh, voxel, THREADS).report
    seconds, processor = time.perf_counter() - begun, time.process_time() - used
    found = f"{report['pieces']} pieces, {report['holes']} holes, {report['solid_volume'] / voxel**3:.4g} cells full"
    print(f"{name:30} {report['triangles']:8} {seconds:8.2f} s {processor:8.2f} s CPU  {found}", flush=True)
    return seconds


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(prog="eulerfsi bench meshes", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="20 cells across")
    parser.add_argument("--mesh", type=Path, action="append", default=[], help="a mesh file instead of the made ones")
    parser.add_argument("--kind", default="", help="only the made meshes whose name holds this text")
    options = parser.parse_args(arguments)
    across = 20 if options.quick else 100
    print(f"{across} cells across, {THREADS} threads, bar {BAR:g} s")
    if options.mesh:
        seconds = [measure(path.name, load_mesh(path), across) for path in options.mesh]
    else:
        chosen = {name: make for name, make in KINDS.items() if options.kind in name}
        made = ((name, *make()) for name, make in chosen.items())
        seconds = [
            measure(name, Mesh(points, np.full(len(triangles), 3), triangles.ravel()), across)
            for name, points, triangles in made
        ]
    missed = sum(s > BAR for s in seconds)
    print(f"slowest {max(seconds):.2f} s, {missed} of {len(seconds)} miss the bar")
    return int(missed > 0 and not options.quick and os.environ.get("CI") != "true")


if __name__ == "__main__":
    sys.exit(main())
