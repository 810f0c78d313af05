"""`bench accuracy --expectations`: the curves that `validate` speaks from, and whether random scenes bear them out.

With seed 0 the curves are measured. With another one scenes of `bench random` are run at a voxel size and at a third
of it. What is told of a solid holds where the change of its volume, and the difference of its first rebound to that of
the fine run, are within twice what `validate` says.
"""

from __future__ import annotations

import dataclasses
import json
import math
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi import files
from eulerfsi.cli import expectations as told
from loop.experiment import simulate
from loop.measure import Result, from_child
from random_scenes.scenes import Scene, make_scene
from random_scenes.solids import Absent

from . import fit, front
from .table import Row

# Name of a curve: the case that it is measured on, and which of its numbers it is; "": the error.
SOURCES = {
    "rebound": ("bounce_vacuum", ""),
    "volume": ("bounce_vacuum", "largest |V/V0 - 1|"),
    "swing": ("swing_vacuum", ""),
    "swing in fluid": ("swing_fluid", ""),
    "sliding": ("incline", ""),
    "vortex": ("taylor_green_3d", ""),
}
CASES = tuple(dict.fromkeys(case for case, _ in SOURCES.values()))
STEEPEST = 2.0  # order that is believed


def curve(rows: Sequence[Row], number: str) -> dict[str, Any]:
    """A curve of `validate` from the resolutions of one case. rows: with errors. Raises ValueError."""
    by_h = fit.resolution(rows)
    if len(by_h) < 3:
        raise ValueError(f"{len(by_h)} resolutions, must be 3")
    errors = [abs(row.number(number) or 0.0) for row in by_h] if number else errors_of(by_h)
    sizes = [1 / row.cells for row in by_h]
    order = fit.slope(sizes, errors) if fit.monotone(errors) else None
    cost = fit.slope([row.cells for row in by_h], [row.core_s or 0.0 for row in by_h])
    figures = {"order": min(max(order or 0.0, 0.0), STEEPEST), "cost": cost or 3.0}
    told_of = [max(errors[k:]) for k in range(len(errors))]  # a run that is better than a finer one is so by chance
    return {
        "cells": [float(row.cells) for row in by_h],
        "errors": [float(f"{error:.3g}") for error in told_of],
        **{name: float(f"{value:.3g}") for name, value in figures.items()},
    }


def errors_of(by_h: Sequence[Row]) -> list[float]:
    """With a reference those of the table. Without, differences to the finer runs; as two runs may agree by chance, at
    least what first order leaves of the coarsest run's."""
    if by_h[0].reference is not None:
        return [row.error or 0.0 for row in by_h]
    values, coarsest = np.array([row.value for row in by_h]), by_h[0].cells
    off = [float(np.abs(value / values[k:] - 1).max()) for k, value in enumerate(values)]
    return [max(error, off[0] * coarsest / row.cells) for error, row in zip(off, by_h, strict=True)]


def curves(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """All of them. Raises ValueError that names the case."""
    by_case, out = front.by_case(rows), {}
    for name, (case, number) in SOURCES.items():
        try:
            out[name] = curve(by_case.get(case, []), number)
        except ValueError as error:
            raise ValueError(f"{case}: {error}") from None
    return out


def write(rows: Sequence[Row], path: Path = told.CURVES) -> None:
    """For `validate`."""
    files.write_text(path, json.dumps(curves(rows), indent=2) + "\n")


# --- random scenes ---------------------------------------------------------------------------------------------------

FINER, TWICE, PASSED = 3, 2.0, 0.8  # times the cells along an edge; of what was said; share of the scenes
MOST_CELLS, COARSE = 1.5e5, (6.0, 12.0)  # of the fine run; voxels over the scene's size
LONGEST = 0.3  # s
NEAR, LEAST = 1.5, 0.3  # cells from a face at a rebound; cells a centre moves in the longest step before it


def at_cells(scene: Scene, across: float) -> Scene:
    """The scene with so many cells over its size, its box a whole number of the coarse ones."""
    h = scene.size / across
    box = tuple(float(math.ceil(edge / h - 1e-6) * h) for edge in scene.box)
    return dataclasses.replace(scene, across=across, box=box, duration=min(scene.duration, LONGEST))


def scenes(seed: int) -> Iterator[tuple[Scene, Scene]]:
    """(coarse, fine) of the scenes of a seed with a solid that folds nowhere between closed faces."""
    for number in range(10000):
        try:
            scene = make_scene(seed, number)
        except Absent:
            continue
        if not scene.folds_nowhere or "open" in scene.faces or "periodic" in scene.faces:
            continue
        room = float(np.prod(scene.box)) / scene.size**3
        across = min(scene.across, COARSE[1], (MOST_CELLS / room) ** (1 / 3) / FINER)
        if across >= COARSE[0]:
            coarse = at_cells(scene, across)
            yield coarse, dataclasses.replace(coarse, across=FINER * across)


def run(scene: Scene) -> Result:
    """In a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        try:
            return from_child(scene, pool.submit(simulate, scene).result())
        except BrokenProcessPool as error:
            return Result(scene, f"the process ended: {error}", {}, {})


def rebound(result: Result) -> float | None:
    """Speed after over speed before of the first reversal of the centre at a face; None where there is none."""
    scene, found = result.run, []
    if not result.columns:
        return None
    velocity, h = result.velocity, scene.spacing
    for axis in range(3):
        for side, name in ((-1, "extent_min"), (1, "extent_max")):
            edge = result.with_start(name)[:, axis]
            gap = edge if side < 0 else scene.box[axis] - edge
            towards = side * velocity[:, axis]
            turns = np.flatnonzero((towards[:-1] > 0) & (towards[1:] <= 0) & (gap[1:] < NEAR * h))
            if turns.size:
                at = int(turns[0]) + 1
                back = np.flatnonzero(towards[at:] > 0)
                end = at + int(back[0]) if back.size else len(towards)
                found.append((at, float(-towards[at:end].min() / towards[:at].max())))
    return min(found)[1] if found else None


def off(result: Result) -> float:
    """Largest change of the mesh's volume."""
    return float(np.abs(result["volume_mesh"] / result.start["volume_mesh"] - 1).max())


@dataclasses.dataclass(frozen=True)
class Checked:
    """A scene: figures as (name, error, what was said)."""

    scene: str
    figures: tuple[tuple[str, float, float], ...]
    failure: str = ""

    @property
    def passed(self) -> bool:
        return not self.failure and all(error <= TWICE * said for _, error, said in self.figures)

    @property
    def words(self) -> str:
        told_of = [f"{name} {100 * error:.2g} % ({100 * said:.2g} % said)" for name, error, said in self.figures]
        return f"{self.scene}: {self.failure or ', '.join(told_of)} | {'pass' if self.passed else 'MISSED'}"


def checked(coarse: Scene, fine: Scene) -> Checked:
    """Runs both."""
    across = float(np.ptp(coarse.surface[0], axis=0).min()) / coarse.spacing
    name = f"{coarse.scene}, {coarse.shape}, {across:.3g} and {FINER * across:.3g} cells across"
    one, other = run(coarse), run(fine)
    if one.failure or other.failure:
        return Checked(name, (), one.failure or other.failure)
    said = told.of_solid(coarse.solid(), across, coarse.fluid_density)
    figures = [("volume", off(one), said["volume"])] if "volume" in said else []
    speeds = rebound(one), rebound(other)
    if speeds[0] is not None and speeds[1]:
        figures.append(("rebound", abs(speeds[0] / speeds[1] - 1), said["rebound"]))
    return Checked(name, tuple(figures))


def check(seed: int, count: int) -> bool:
    """Prints a line a scene that shows anything; whether enough of them pass."""
    done: list[Checked] = []
    for coarse, fine in scenes(seed):
        one = checked(coarse, fine)
        if one.figures or one.failure:
            done.append(one)
            print(one.words, flush=True)
        if len(done) == count:
            break
    passed = sum(one.passed for one in done)
    print(f"{passed} of {len(done)} scenes of seed {seed} within {TWICE:g} times what `validate` says")
    return passed >= PASSED * len(done)
