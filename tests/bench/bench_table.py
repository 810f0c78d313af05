"""The paper's scenes, its Tables 1 and 2 beside ours, and what their solves take: `./eulerfsi bench table`.

Every scene is simulated whole by the command line, one after the other, at --scale times the paper's resolution; what a
frame costs is that of its statistics. The paper's machine had 8 cores of 3 GHz and 16 threads. Iterations and steps are
judged by BARS on every machine, seconds only with --quiet, on one that does nothing else.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
for folder in (ROOT / "batch", ROOT / "usd_plugin", Path(__file__).resolve().parent):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import eulerfsi_usd  # noqa: E402, F401 - registers the schema
from bench_loop import machine  # noqa: E402
from eulerfsi import files  # noqa: E402
from eulerfsi.cli.plot import Statistics  # noqa: E402
from eulerfsi.frames import parse_frames  # noqa: E402
from eulerfsi.scene import checks  # noqa: E402
from eulerfsi.solver import binding  # noqa: E402
from pxr import Usd  # noqa: E402

SCENES = ROOT / "examples" / "scenes"
PAPER_VOXEL = 0.005  # m, of all scenes


@dataclasses.dataclass(frozen=True)
class Row:
    """A row of Table 2: average and least step [s], seconds per frame: in all, compute G, velocity, pressure, ..."""

    grid: tuple[int, int, int]
    mean_step: float
    least_step: float
    frame: float
    compute_g: float
    velocity: float
    pressure: float
    advection: float
    collision: float


# Scene file -> the paper's row.
PAPER = {
    "ball": Row((120, 140, 120), 0.025, 0.0016, 6.54, 0.84, 0.12, 2.83, 1.12, 0.01),
    "bunny_light": Row((144, 200, 144), 0.0369, 0.0064, 17.4, 1.32, 5.02, 6.21, 1.72, 0.016),
    "bunny_heavy": Row((144, 200, 144), 0.0236, 0.00058, 16.9, 1.35, 2.47, 8.31, 1.68, 0.016),
    "cheb": Row((120, 100, 80), 0.021, 0.0023, 6.97, 1.55, 1.10, 1.10, 1.37, 0.01),
    "party": Row((200, 180, 200), 0.0133, 0.00083, 54.1, 13.6, 6.72, 12.1, 14.46, 0.25),
}
NAMES = (*PAPER, "heap")  # heap: of nobody's paper, many solids that come to lie
EXAMPLES = tuple(sorted(path.stem for path in SCENES.glob("*.usda")))
# Stages of the profile that a column adds up. Contact is part of the velocity solve in `production`.
STAGES = {
    "compute_g": ("compute_g", "solid_mass"),
    "velocity": ("velocity_solve",),
    "pressure": ("pressure_solve",),
    "advection": ("solid_advection", "fluid_advection", "surface", "smoke"),
    "collision": ("contact",),
}


@dataclasses.dataclass(frozen=True)
class Bar:
    """What a scene may take at most; None: not judged."""

    velocity: float | None = None  # iterations of the velocity solves per step, mean of the worst frame
    pressure: float | None = None  # V-cycles, the same
    seconds: float | None = None  # a frame, mean


# (scene, scale) -> bar; frames 1 to 4 (heap: 1 to 12; bunny_light: velocity of frames 1 to 12).
BARS = {
    ("party", 0.25): Bar(60, 8),
    ("party", 0.5): Bar(80, 12),
    ("party", 1.0): Bar(90, 8),
    ("cheb", 1.0): Bar(130, None, 5.0),
    ("bunny_light", 1.0): Bar(60, 4),
    ("heap", 0.5): Bar(None, None, 18.0 / 11.0),
}
LAST = 21  # frames of which the mean is taken beside that of all


@dataclasses.dataclass(frozen=True)
class Effort:
    """Steps per frame, of all frames and of the last; iterations; what moved."""

    steps: float
    last_steps: float
    velocity: float
    pressure: float
    fluid_speed: float  # m/s
    overlap: float  # cells
    seconds: float

    @classmethod
    def of(cls, statistics: Statistics) -> Effort:
        frames: dict[int, list[dict]] = {}
        for step in statistics.steps:
            frames.setdefault(step["frame"], []).append(step)
        counts = [len(steps) for steps in frames.values()]

        def worst(column: str) -> float:
            return max(sum(step[column] for step in steps) / len(steps) for steps in frames.values())

        pairs = [pair for frame in statistics.frames for pair in frame.get("contacts", {}).get("pairs", [])]
        return cls(
            sum(counts) / len(counts),
            sum(counts[-LAST:]) / len(counts[-LAST:]),
            worst("velocity_iterations"),
            worst("pressure_iterations"),
            max(step["max_speed_fluid"] for step in statistics.steps),
            max((pair["surface_overlap"] for pair in pairs), default=0.0),
            sum(frame["seconds"] for frame in statistics.frames) / len(frames),
        )

    def missed(self, bar: Bar, quiet: bool) -> list[str]:
        """Names of what is over its bar."""
        judged = ["velocity", "pressure"] + (["seconds"] if quiet else [])
        limits = {name: getattr(bar, name) for name in judged}
        return [name for name, limit in limits.items() if limit is not None and getattr(self, name) > limit]


def scene_at(name: str, voxel: float, folder: Path) -> Path:
    """The file of a scene; of one that is a cell thick a copy in `folder` that is one of these cells thick."""
    path = SCENES / f"{name}.usda"
    stage = Usd.Stage.Open(str(path))
    domain = stage.GetPrimAtPath("/World/Domain")
    scale, authored = (domain.GetAttribute(key).Get() for key in ("xformOp:scale", "eulerfsi:voxelSize"))
    thin = [axis for axis in range(3) if abs(scale[axis] - authored) < 1e-6 * authored]
    if not thin or voxel == authored:
        return path
    scale[thin[0]] = voxel
    domain.GetAttribute("xformOp:scale").Set(scale)
    stage.GetRootLayer().Export(str(folder / path.name))
    return folder / path.name


def run(
    name: str, voxel: float, preset: str, frames: str | None, folder: Path, settings: Sequence[str] = ()
) -> Statistics:
    """Simulates a scene; returns its statistics. settings: as for --set. Raises CalledProcessError."""
    options = ["--preset", preset, "-o", str(folder), "--progress", "none"]
    for setting in (f"/World/Domain.voxelSize={voxel:g}", *settings):
        options += ["--set", setting]
    if frames:
        options += ["--frames", frames]
    command = [sys.executable, "-m", "eulerfsi", "simulate", str(scene_at(name, voxel, folder.parent)), *options]
    path = os.pathsep.join((str(ROOT / "batch"), str(ROOT / "usd_plugin")))
    subprocess.run(command, env=os.environ | {"PYTHONPATH": path}, check=True, stdout=subprocess.DEVNULL)
    return Statistics(folder)


def row_of(statistics: Statistics) -> Row:
    """The row of Table 2 of a run."""
    domain = statistics.manifest.data["parameters"]["/World/Domain"]
    grid = tuple(round(edge / domain["voxel_size"]) for edge in domain["domain_size"])
    steps, done = [line["dt"] for line in statistics.steps], statistics.frames
    count = len(done) - 1  # the first is the start
    seconds = done[-1]["profile"]["seconds"]
    columns = {column: sum(seconds[stage] for stage in stages) / count for column, stages in STAGES.items()}
    frame = sum(line["seconds"] for line in done) / count
    return Row(grid, sum(steps) / len(steps), min(steps), frame, **columns)


def table_1() -> list[str]:
    """The parameters that the scenes author, which are the paper's."""
    lines = ["| scene | density | spring stiffness k (unused in production) | friction |", "|---|---|---|---|"]
    for name in PAPER:
        stage = Usd.Stage.Open(str(SCENES / f"{name}.usda"))  # a prim does not keep its stage
        data = stage.GetPrimAtPath("/World/Domain").GetCustomDataByKey("paper")
        lines.append(f"| {name} | {data['densityRatio']} | {data['k']:g} | {data['mu']:g} |")
    return lines


def line(name: str, who: str, row: Row) -> str:
    """A line of Table 2."""
    grid = " x ".join(map(str, row.grid))
    costs = (row.frame, row.compute_g, row.velocity, row.pressure, row.advection, row.collision)
    cells = row.grid[0] * row.grid[1] * row.grid[2]
    per_step = 1e6 * row.frame * row.mean_step * 24 / cells
    times = " | ".join(f"{cost:.3g}" for cost in costs)
    return f"| {name} | {who} | {grid} | {row.mean_step:.3g} | {row.least_step:.2g} | {times} | {per_step:.2f} |"


def effort_line(name: str, scale: float, effort: Effort, quiet: bool) -> tuple[str, bool]:
    """A line of the third table, and whether a bar is missed."""
    bar = BARS.get((name, scale), Bar())
    missed = effort.missed(bar, quiet)

    def with_bar(value: float, limit: float | None) -> str:
        return f"{value:.3g}" if limit is None else f"{value:.3g} ({limit:.3g})"

    judged = any(limit is not None for limit in dataclasses.astuple(bar))
    verdict = f"missed: {', '.join(missed)}" if missed else "kept" if judged else "no bar"
    cells = (
        f"{effort.steps:.3g}",
        f"{effort.last_steps:.3g}",
        with_bar(effort.velocity, bar.velocity),
        with_bar(effort.pressure, bar.pressure),
        with_bar(effort.seconds, bar.seconds if quiet else None),
        f"{effort.fluid_speed:.3g}",
        f"{effort.overlap:.2g}",
        verdict,
    )
    return f"| {name} | {' | '.join(cells)} |", bool(missed)


EFFORT_HEAD = (
    f"| scene | steps per frame | last {LAST} frames | velocity iterations per step, worst frame | V-cycles per step, "
    "worst frame | s per frame | fluid's top speed [m/s] | deepest overlap [cells] | verdict |"
)
HEAD = (
    "| scene | | grid | mean step [s] | least step | s per frame | compute G | velocity | pressure | advection | "
    "collision | us per cell and step |"
)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="eulerfsi bench table", description=__doc__.splitlines()[0])
    parser.add_argument("--scale", type=float, default=0.5, help="of the paper's resolution, default 0.5")
    parser.add_argument("--preset", choices=tuple(binding.PRESETS), default="production")
    parser.add_argument("--frames", metavar="A-B", help="default: all of each scene")
    parser.add_argument("--only", metavar="NAME,...", help=f"example scenes; default {','.join(NAMES)}")
    parser.add_argument("--quiet", action="store_true", help="nothing else runs here: seconds are judged, too")
    parser.add_argument("--output", type=Path, help="also write the tables there, as Markdown")
    options = parser.parse_args(arguments)
    names = options.only.split(",") if options.only else list(NAMES)
    unknown = [name for name in names if name not in EXAMPLES]
    if unknown:
        parser.error(f"--only {unknown[0]}: must be of {', '.join(EXAMPLES)}")
    if not 0.1 <= options.scale <= 2.0:
        parser.error(f"--scale {options.scale:g}: must be between 0.1 and 2")
    if options.frames:
        parse_frames(options.frames)
    if options.output:
        checks.check_output(options.output.absolute().parent)
    text = [
        "# The paper's tables",
        "",
        f"`./eulerfsi bench table --scale {options.scale:g} --preset {options.preset}`; {machine()}.",
        "The paper: 8 cores of 3 GHz, 16 threads.",
        "",
        "Table 1, as the scenes author it.",
        "",
        *table_1(),
        "",
        "Table 2. Seconds per frame of 1/24 s and of its stages.",
        "",
        HEAD,
        "|" + "---|" * (HEAD.count("|") - 1),
    ]
    print("\n".join(text), flush=True)
    failed = False
    efforts = []
    for name in names:
        rows = [line(name, "paper", PAPER[name])] if name in PAPER else []
        with tempfile.TemporaryDirectory() as folder:
            try:
                statistics = run(name, PAPER_VOXEL / options.scale, options.preset, options.frames, Path(folder) / "c")
                rows.append(line(name, "here", row_of(statistics)))
                efforts.append((name, Effort.of(statistics)))
            except subprocess.CalledProcessError as error:
                failed = True
                rows.append(f"| {name} | here | ended with exit code {error.returncode} |" + " |" * 9)
        text += rows
        print("\n".join(rows), flush=True)
    judged = [effort_line(name, options.scale, effort, options.quiet) for name, effort in efforts]
    third = [
        "",
        "What the solves take, with bars in brackets.",
        "",
        EFFORT_HEAD,
        "|" + "---|" * (EFFORT_HEAD.count("|") - 1),
    ]
    third += [row for row, _ in judged]
    text += third
    print("\n".join(third), flush=True)
    failed = failed or any(missed for _, missed in judged)
    if options.output:
        files.write_text(options.output, "\n".join(text) + "\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
