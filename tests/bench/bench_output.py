"""What the options of the output cost: `./eulerfsi bench output [--scene FILE] [--frame N] [--set ...] [--page]`.

Simulates the scene once to the frame and writes the smoke of that state with each option: bytes of the file, processor
seconds of one thread (the least of several writings), and the largest difference from the same state with 32-bit floats
and threshold 0: of density over the domain or the region, of velocity over the voxels that are written. --page writes
the table into docs/output.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / place) for place in ("batch", "usd_plugin")]

from eulerfsi.cache.output import Output  # noqa: E402
from eulerfsi.errors import LibraryError  # noqa: E402
from eulerfsi.log import Log  # noqa: E402
from eulerfsi.run.build import build_simulation  # noqa: E402
from eulerfsi.run.simulate import Options, load_scene, simulate  # noqa: E402
from eulerfsi.scene.parts import Scene  # noqa: E402
from eulerfsi.solver.simulation import Simulation  # noqa: E402
from eulerfsi.solver.volume_file import VolumeFile  # noqa: E402
from eulerfsi.system import available_memory  # noqa: E402

PAGE = ROOT / "docs" / "output.md"
HEAD = "| written with | bytes | of the default | seconds | error of density | of velocity, m/s |"
_SCENE, _FRAME, _TIMES = ROOT / "examples" / "scenes" / "ball.usda", 24, 5


@dataclasses.dataclass
class Row:
    """One way to write: bytes of the file, processor seconds, largest errors; of velocity [m/s] None without one."""

    words: str
    size: int
    seconds: float
    density: float
    velocity: float | None

    def text(self, default: Row) -> str:
        share = f"{100 * self.size / default.size:.0f} %"
        speed = "-" if self.velocity is None else f"{self.velocity:.1g}"
        name = f"`{self.words}`" if self.words else "nothing: the default"
        return f"| {name} | {self.size:,} | {share} | {self.seconds:.3f} | {self.density:.1g} | {speed} |"


def variants(scene: Scene) -> list[tuple[str, Output]]:
    """Options and what they mean; the region is the half of the domain with lower x."""
    size, low = np.array(scene.domain["domain_size"]), np.array(scene.domain["domain_min"])
    corners = scene.space.point_to_world(np.stack([low, low + size * (0.5, 1.0, 1.0)]))
    box = ",".join(f"{x:.4g}" for x in [*corners.min(axis=0), *corners.max(axis=0)])
    rows: list[tuple[str, dict[str, Any]]] = [
        ("", {}),
        ("--smoke-threshold 0", {"threshold": "0"}),
        ("--smoke-threshold 0.01", {"threshold": "0.01"}),
        ("--smoke-threshold 0.1", {"threshold": "0.1"}),
        ("--half", {"half": True}),
        ("--half --smoke-threshold 0", {"half": True, "threshold": "0"}),
        ("--no-velocity", {"velocity": False}),
        ("--half --no-velocity", {"half": True, "velocity": False}),
        (f"--region {box}", {"region": box}),
    ]
    given = {"half": False, "threshold": None, "velocity": True, "region": None}
    return [(words, Output.parse(**{**given, **values})) for words, values in rows]


def whole(path: Path, scene: Scene) -> dict[str, np.ndarray]:
    """The grids of a file over the whole domain, velocities in m/s; 0 where nothing is written."""
    count = np.rint(np.array(scene.domain["domain_size"]) / scene.domain["voxel_size"]).astype(int)
    found = {}
    with VolumeFile(path) as file:
        for name, unit in (("density", 1.0), ("vel", scene.space.meters_per_unit)):
            try:
                found[name] = unit * file.read(name, np.zeros(3, int), count).astype(float)
            except LibraryError:
                continue  # --no-velocity
    return found


def measure(simulation: Simulation, scene: Scene, folder: Path) -> tuple[str, list[Row]]:
    """The state that the simulation has in words, and the rows: every way to write it."""
    exact = whole(write(simulation, scene, Output(threshold=0.0), folder)[0], scene)
    rows = []
    for words, output in variants(scene):
        path, seconds = write(simulation, scene, output, folder)
        found = whole(path, scene)
        kept = np.ones(exact["density"].shape, bool)
        if output.region:  # the half with lower x of the simulation's own axes
            kept[kept.shape[0] // 2 :] = False
        density = np.abs(found["density"] - exact["density"])[kept].max()
        speed = None
        if "vel" in found:
            written = found["density"] > output.threshold
            speed = np.linalg.norm((found["vel"] - exact["vel"])[written], axis=-1).max(initial=0.0)
        rows.append(Row(words, path.stat().st_size, seconds, float(density), None if speed is None else float(speed)))
    speed = np.linalg.norm(exact["vel"], axis=-1).max()
    return f"{exact['density'].size:,} cells, density to {exact['density'].max():.2g}, to {speed:.2g} m/s", rows


def write(simulation: Simulation, scene: Scene, output: Output, folder: Path) -> tuple[Path, float]:
    """A file of the state, and the least of the processor seconds that it took."""
    path, taken = folder / "state.vdb", []
    for _ in range(_TIMES):
        start = time.process_time()
        simulation.write_vdb(path, **output.definition(scene.space))
        taken.append(time.process_time() - start)
    return path, min(taken)


def table(rows: list[Row]) -> str:
    rule = "|" + "---|" * (HEAD.count("|") - 1)
    return "\n".join([HEAD, rule, *(row.text(rows[0]) for row in rows)])


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="./eulerfsi bench output", description="What the options of the output cost.")
    parser.add_argument("--scene", type=Path, default=_SCENE, metavar="FILE", help="default: ball")
    parser.add_argument("--frame", type=int, default=_FRAME, help=f"default: {_FRAME}")
    parser.add_argument("--set", action="append", default=[], metavar="PRIM.NAME=VALUE")
    parser.add_argument("--page", action="store_true", help="write the table into docs/output.md")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="eulerfsi-output-") as place:
        cache = Path(place) / "cache"
        options = Options(
            output=cache, frames=f"1-{given.frame}", settings=tuple(given.set), progress="none", threads=1
        )
        simulate(given.scene, options, Log())
        scene, _ = load_scene(given.scene, options, Log(), available_memory())
        last = json.loads((cache / "manifest.json").read_text())["checkpoints"][-1]
        build = build_simulation(scene, 1, available_memory(), Log())
        with build.simulation:
            build.simulation.restore_state(cache / last["file"])
            words, rows = measure(build.simulation, scene, Path(place))
    text = table(rows)
    print(words, text, sep="\n\n")
    if given.page:
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(re.sub(re.escape(HEAD) + r"\n(\|.*\n)*", lambda _: text + "\n", page), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
