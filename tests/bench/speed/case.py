"""Runs of `bench speed`: a scene with settings, so many frames, in a process of its own (child.py)."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi.solver import binding

from . import kernels

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "examples" / "scenes"
UP = 1  # axis of height
GRAVITY = 9.8


@dataclasses.dataclass(frozen=True)
class Case:
    """One run. scene: a file of examples/scenes, or "plume"."""

    scene: str
    settings: tuple[str, ...] = ()  # as for --set; of the plume: fields of EfsiSimulationDef
    frames: int = 1
    threads: int = 2
    warm: int = 0  # frames that come before what is measured
    grow: float = 1.0  # edge lengths of the box times this; its floor stays
    until: float = 0.0  # ends with the frame in which smoke has reached this part of the height
    keep: tuple[str, ...] = ()  # fields to keep in the result
    vdb: bool = False  # writes a .vdb of every frame, outside the steps' time
    checkout: Path = ROOT  # whose library runs


# A hot ball of smoke in a cube of fluid at rest with open sides, as the peer bakes it and with about its buoyancy.
PLUME_RADIUS, PLUME_HEIGHT = 0.08, 0.15  # over the edge
PLUME_BUOYANCY = 0.02  # [m/s^2/K]
PLUME_HEAT = 300.0  # [K]


def plume(cells: int, tolerance: float) -> tuple[str, ...]:
    """Settings of the plume with so many cells along an edge of 1 m, and the pressure solve's tolerance."""
    return (f"voxel_size={1 / cells!r}", f"pressure_tolerance={tolerance!r}")


def plume_job(settings: tuple[str, ...]) -> dict[str, Any]:
    d = 2 * PLUME_RADIUS
    values = {name: float(value) for name, _, value in (text.partition("=") for text in settings)}
    definition = {
        "domain_min": [0.0, 0.0, 0.0],
        "domain_size": [1.0, 1.0, 1.0],
        "gravity": [0.0, -GRAVITY, 0.0],
        "temperature_buoyancy": PLUME_BUOYANCY,
        **{f"wall[{face}]": binding.WALLS["open"] for face in range(6)},
        **values,
    }
    emitter = {
        "shape": binding.REGION_SHAPES["sphere"],
        "mode": binding.EMITTER_MODES["continuous"],
        "transform": [d, 0, 0, 0.5, 0, d, 0, PLUME_HEIGHT, 0, 0, d, 0.5, 0, 0, 0, 1],
        "temperature": PLUME_HEAT,
        "end_time": 1e6,
    }
    return {"definition": definition, "solids": [], "emitters": [emitter], "meshes": {}}


def scene_job(scene: str, settings: tuple[str, ...]) -> dict[str, Any]:
    """Definitions of an example scene, read here."""
    from eulerfsi.scene.overrides import apply_overrides
    from eulerfsi.scene.read import read_scene
    from pxr import Usd

    path = SCENES / f"{scene}.usda"
    stage = Usd.Stage.Open(str(path))
    apply_overrides(stage, settings)
    read = read_scene(stage, path)
    meshes = {
        f"{name}{number}": getattr(solid.mesh, name)
        for number, solid in enumerate(read.solids)
        for name in ("points", "counts", "indices")
    }
    return {
        "definition": dict(read.domain),
        "solids": [solid.values for solid in read.solids],
        "emitters": [emitter.values for emitter in read.emitters],
        "meshes": meshes,
    }


def grown(low: list[float], size: list[float], factor: float) -> tuple[list[float], list[float]]:
    """(low corner, edge lengths) of a box around the same axis on the same floor, its edges times `factor`."""
    new = [edge * factor for edge in size]
    corner = [low[a] if a == UP else low[a] + (size[a] - new[a]) / 2 for a in range(3)]
    return corner, new


def cells_of(definition: dict[str, Any]) -> list[int]:
    """Cells along x, y, z; edges are rounded up to whole voxels."""
    return [math.ceil(edge / definition["voxel_size"] - 1e-6) for edge in definition["domain_size"]]


def environment(checkout: Path) -> dict[str, str]:
    """Environment of a child that uses the binding and the library of a checkout. Raises SystemExit without them."""
    library = checkout / "build" / "release" / "libeulerfsi" / "libeulerfsi.so"
    if not library.is_file():
        raise SystemExit(f"{library}: there is no such library; run ./eulerfsi setup in {checkout}")
    folders = os.pathsep.join((str(checkout / "batch"), str(checkout / "usd_plugin")))
    values = {**os.environ, "PYTHONPATH": folders}
    return values if checkout == ROOT else {**values, "EULERFSI_LIBRARY": str(library)}


@contextlib.contextmanager
def prepared(case: Case, start: dict[str, np.ndarray] | None) -> Iterator[tuple[Path, dict[str, Any]]]:
    """(folder with what the child reads, the definition)."""
    job = plume_job(case.settings) if case.scene == "plume" else scene_job(case.scene, case.settings)
    definition = job["definition"]
    definition["threads"] = case.threads
    definition["domain_min"], definition["domain_size"] = grown(
        list(definition["domain_min"]), list(definition["domain_size"]), case.grow
    )
    job.update(frames=case.frames, warm=case.warm, until=case.until, keep=case.keep, vdb=case.vdb)
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "meshes.npz", **job.pop("meshes"))
        if start:
            np.savez(Path(folder) / "start.npz", **start)
        (Path(folder) / "job.json").write_text(json.dumps(job))
        yield Path(folder), definition


def run_case(case: Case, start: dict[str, np.ndarray] | None = None) -> dict[str, Any]:
    """Simulates a case and returns what the child measured, with `cells` and `triad`: seconds of a triad over one field
    of the scene's size at the same number of threads, the mean of just before and just after.

    start: fields at time 0. Raises SystemExit where the child fails.
    """
    with prepared(case, start) as (folder, definition):
        cells = cells_of(definition)
        before = kernels.triad_seconds(cells, case.threads)
        child = [sys.executable, str(Path(__file__).with_name("child.py")), str(folder)]
        done = subprocess.run(child, stdout=subprocess.PIPE, text=True, check=False, env=environment(case.checkout))
        if done.returncode != 0:
            raise SystemExit(f"{case.scene} {' '.join(case.settings)} failed with exit code {done.returncode}")
        after = kernels.triad_seconds(cells, case.threads)
        result = json.loads(done.stdout)
        if case.keep:
            result["fields"] = dict(np.load(folder / "kept.npz"))
    result.update(cells=math.prod(cells), triad=(before + after) / 2, threads=case.threads)
    result["floor"] = definition["domain_min"][UP]
    return result
