"""The peer: smoke of the fluid solver in Blender (peers/mantaflow.py), beside ours."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from . import case, lines
from .child import top_of_smoke
from .lines import Line

SCRIPT = Path(__file__).resolve().parents[1] / "peers" / "mantaflow.py"
MARK = "MANTAFLOW "
INSTALL = "blender is not installed: apt-get install --no-install-recommends blender (3.4.1 in Debian 12, 650 MB)"


def find() -> str | None:
    """The program, None where it is not installed."""
    return shutil.which("blender")


def read(output: str) -> dict[str, Any]:
    """What the script printed. Raises SystemExit with the last lines where it printed no result."""
    for line in output.splitlines():
        if line.startswith(MARK):
            return json.loads(line.removeprefix(MARK))
    raise SystemExit("blender gave no result:\n" + "\n".join(output.splitlines()[-10:]))


def bake(program: str, cells: int, frames: int, threads: int) -> dict[str, Any]:
    """Bakes `frames` frames in a cube of cells^3."""
    command = [program, "--background", "--factory-startup", "--python", str(SCRIPT), "--"]
    command += ["--cells", str(cells), "--frames", str(frames), "--threads", str(threads)]
    command += ["--radius", str(case.PLUME_RADIUS), "--height", str(case.PLUME_HEIGHT)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    return read(done.stdout)


def compare(ours: list[dict[str, Any]], baked: dict[str, Any]) -> list[Line]:
    """Core and wall time per cell and step of both, and the ratios, ours over the peer's; `ours`: around the bake."""
    cells, steps, triad = baked["cells"], baked["steps"], float(np.mean([result["triad"] for result in ours]))
    per = 1e6 / (cells * steps)
    at = f"{cells} cells, {baked['frames']} frames, {steps} steps, {lines.threads_text(ours[0]['threads'])}, "
    at += f"smoke up to {baked['top']:.2f} of the height, with its cache ({baked['bytes'] / 1e6:.0f} MB)"
    top = top_of_smoke(ours[0]["fields"]["smoke_density"][0])
    own = f"{lines.conditions_of('same inflow', ours[0])}, smoke up to {top:.2f} of the height"
    found = []
    for what, seconds, theirs in (
        ("core", lines.core_seconds, baked["processor"]),
        ("wall", lines.step_seconds, baked["wall"]),
    ):
        mine = float(np.mean([seconds(result) for result in ours]))
        mine_per_cell = 1e6 * mine / ours[0]["cells"]
        name = f"{what} time per cell and step"
        found += [
            Line(f"Mantaflow: {name}", theirs * per, "us", None, None, at, theirs / steps / triad),
            Line(f"ours: {name}", mine_per_cell, "us", None, None, own, mine / triad),
            Line(f"ours / Mantaflow: {name}", mine_per_cell / (theirs * per), "", None, None, own),
        ]
        if what == "core":
            writing = float(np.mean([result["writing"] / len(result["steps"]) for result in ours]))
            both = 1e6 * (mine + writing) / ours[0]["cells"]
            name += ", with a .vdb of every frame"
            found.append(Line(f"ours / Mantaflow: {name}", both / (theirs * per), "", None, None, own))
    return found
