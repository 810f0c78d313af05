"""One simulation of `bench speed`, step by step, in a process of its own, so that its memory is the solver's.

`child.py FOLDER`: reads job.json, meshes.npz and, where it exists, start.npz (fields at time 0); prints JSON and writes
the fields that the job asks for to kept.npz. The binding is that of PYTHONPATH, of this checkout or of another one.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi.solver.simulation import Mesh, Simulation

FRAME = 1 / 24  # s
SMOKE = 0.1  # density of what counts as smoke


def top_of_smoke(density: np.ndarray) -> float:
    """Part of the height (y) that the smoke has reached; density: (nx, ny, nz)."""
    rows = np.flatnonzero(density.max(axis=(0, 2)) > SMOKE)
    return (int(rows[-1]) + 1) / density.shape[1] if len(rows) else 0.0


def frame_steps(simulation: Simulation, end: float) -> Iterator[dict[str, Any]]:
    """Steps until the time `end` [s]: fields of EfsiStepInfo, wall-clock and processor seconds (of all threads)."""
    while end - simulation.time > 1e-9:
        begun, used = time.perf_counter(), time.process_time()
        info = simulation.step(end - simulation.time)
        yield {**info, "seconds": time.perf_counter() - begun, "processor": time.process_time() - used}


def set_up(simulation: Simulation, job: dict[str, Any], folder: Path) -> None:
    """Solids, emitters and initial fields."""
    meshes = np.load(folder / "meshes.npz")
    for number, values in enumerate(job["solids"]):
        mesh = Mesh(*(meshes[f"{name}{number}"] for name in ("points", "counts", "indices")))
        simulation.add_solid(mesh, **values)
    for values in job["emitters"]:
        simulation.add_emitter(**values)
    if (folder / "start.npz").exists():
        for name, values in np.load(folder / "start.npz").items():
            simulation.set_field(name, values)


def run(folder: Path) -> dict[str, Any]:
    """The job of a folder; diagnostics are taken outside the measured time."""
    job = json.loads((folder / "job.json").read_text())
    steps: list[dict[str, Any]] = []
    top, writing = 0.0, 0.0
    with Simulation(job["definition"], lambda _level, text: print(text, file=sys.stderr)) as simulation:
        set_up(simulation, job, folder)
        has_solid = bool(job["solids"])
        start = simulation.solid_diagnostics(1) if has_solid else {}
        for frame in range(1, job["frames"] + 1):
            if frame == job["warm"] + 1:
                simulation.reset_profile()
                steps.clear()
            for info in frame_steps(simulation, frame * FRAME):
                solid = simulation.solid_diagnostics(1) if has_solid else {}
                steps.append({"frame": frame, **info, "solid": solid})
            if job["vdb"]:
                begun = time.process_time()
                simulation.write_vdb(folder / f"frame.{frame:04d}.vdb")
                writing += time.process_time() - begun
            if job["until"]:
                top = top_of_smoke(simulation.field("smoke_density")[0][0])
                if top >= job["until"]:
                    break
        if job["keep"]:
            np.savez(folder / "kept.npz", **{name: simulation.field(name)[0] for name in job["keep"]})
        profile, state = simulation.profile(), simulation.state_hash()
    return {
        "start": start,
        "steps": steps,
        "profile": profile,
        "state": state,
        "top": top,
        "writing": writing,
        "peak_bytes": peak_memory(),
    }


def peak_memory() -> int:
    """Largest resident memory of this process so far. VmHWM does not count what ran before exec, ru_maxrss does."""
    status = Path("/proc/self/status")
    for line in status.read_text().splitlines() if status.exists() else []:
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    print(json.dumps(run(Path(sys.argv[1]))))
