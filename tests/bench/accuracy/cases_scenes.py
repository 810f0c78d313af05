"""Example scenes by the command line: their cost as the grid is refined, and how far their bodies are from the finest.

`cells` is the voxels along a metre. The reference is the finest run of the same table (`fit.with_limits`).
"""

from __future__ import annotations

import resource
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from bench_table import Effort
from bench_table import run as simulate_scene

from .meter import Failed, Measured, Meter
from .sweep import Run

NORM = "distance of the bodies' centres to the finest run [m]"


def scene(run: Run, meter: Meter) -> Measured:
    """Frames of a scene: the bodies' centres at the last one, steps per frame, iterations per step, time."""
    frames, voxel = run.of["frames"], 1.0 / run.cells
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    settings = [f"/World/Domain.{name}={value!r}" for name, value in authored(run).items()]
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = simulate_scene(run.of["scene"], voxel, run.preset, frames, Path(folder) / "c", settings)
        except subprocess.CalledProcessError as error:
            raise Failed(f"simulate ended with exit code {error.returncode}") from None
        effort, last = Effort.of(done), done.frames[-1]
        seconds = len(done.frames[1:]) * done.frame_seconds
        centers = [value for solid in last["solids"].values() for value in solid["center"]]
        meter.wall = sum(frame["seconds"] for frame in done.frames)
        iterations = (sum(s[name] for s in done.steps) for name in ("velocity_iterations", "pressure_iterations"))
        meter.count(len(done.steps), *map(int, iterations))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    meter.core = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    numbers = {
        "centers": centers,
        "core seconds per simulated second": meter.core / seconds,
        "steps per frame": effort.steps,
        "iterations per step": float(np.mean([s["velocity_iterations"] for s in done.steps])),
    }
    return Measured(float(np.mean(centers)), None, NORM, f"frames {frames}", numbers=numbers)


def authored(run: Run) -> dict[str, float]:
    """What the sweeps set, as attributes of a domain."""
    names = {"velocity_tolerance": "velocityTolerance", "pressure_tolerance": "pressureTolerance"}
    names |= {"cfl_solid": "cflSolid", "cfl_fluid": "cflFluid", "step_tolerance": "stepTolerance"}
    values = {names[name]: value for name, value in run.settings.items() if name in names}
    return values if run.step == "default" else values | {"maxTimeStep": run.largest_step}


CASES = {name: scene for name in ("scene_ball", "scene_bunny", "scene_heap", "scene_party")}
