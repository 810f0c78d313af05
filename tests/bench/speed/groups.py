"""What `bench speed` measures: each group is a function that runs its cases and returns lines and tables."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from . import kernels, lines, peer, scaling
from .case import Case, plume, run_case
from .lines import Line

Table = list[dict[str, Any]]


@dataclasses.dataclass(frozen=True)
class Sizes:
    """Grids: voxel sizes [m], cells along an edge of the plume, grid of the kernels."""

    fine: float = 0.005
    coarse: float = 0.01
    empty: float = 0.02
    plume: int = 128
    kernels: tuple[int, int, int] = (120, 140, 120)
    peer_frames: int = 12


# So small that bars mean nothing: checks the benchmark itself.
QUICK = Sizes(0.02, 0.02, 0.05, 32, (32, 40, 32), 3)


@dataclasses.dataclass
class Outcome:
    """Lines, and tables by title."""

    lines: list[Line] = dataclasses.field(default_factory=list)
    tables: dict[str, Table] = dataclasses.field(default_factory=dict)

    def add_stages(self, name: str, result: dict[str, Any]) -> None:
        self.tables[f"Stages of {name}, state {result['state']}"] = lines.stage_rows(result)


def ball_case(voxel: float, preset: str, frames: int, **more: Any) -> Case:
    return Case("ball", (f"Domain.voxelSize={voxel}", f"Domain.preset={preset}"), frames, **more)


def ball(sizes: Sizes) -> Outcome:
    """The ball, `production`, through its bounce."""
    name = f"Ball {sizes.fine:g}"
    result = run_case(ball_case(sizes.fine, "production", 12))
    at = lines.conditions_of("production, frames 1-12", result)
    outcome = Outcome([*lines.time_lines(name, result, at, 6.0, 150), *lines.physics_lines(name, result, at)])
    outcome.add_stages(name, result)
    return outcome


def paper(sizes: Sizes) -> Outcome:
    """The paper's own scheme is held to its speed only; its physics is what the other preset improves on."""
    name = f"Ball {sizes.fine:g}, paper2016"
    result = run_case(ball_case(sizes.fine, "paper2016", 12))
    at = lines.conditions_of("paper2016, frames 1-12", result)
    outcome = Outcome(lines.time_lines(name, result, at, 10.0, None))
    outcome.add_stages(name, result)
    return outcome


def bounce(sizes: Sizes) -> Outcome:
    """Physics of two seconds on a coarse grid."""
    result = run_case(ball_case(sizes.coarse, "production", 48))
    at = lines.conditions_of("production, frames 1-48", result)
    return Outcome(lines.physics_lines(f"Ball {sizes.coarse:g}", result, at))


PLUME_TOP = 2 / 3  # of the height
PLUME_TOLERANCE = 1e-3
PLUME_FIELDS = ("velocity", "smoke_density", "smoke_temperature")


def developed_plume(sizes: Sizes) -> dict[str, Any]:
    """Fields of a plume that has risen to PLUME_TOP: an emitter that never stops in fluid at rest, buoyancy, on the
    grid and with the tolerance of what is measured. Kept as fields, so that other libraries can start from them."""
    case = Case("plume", plume(sizes.plume, PLUME_TOLERANCE), frames=120, until=PLUME_TOP, keep=PLUME_FIELDS)
    result = run_case(case)
    if result["top"] < PLUME_TOP:
        raise SystemExit(f"plume: smoke reached {result['top']:.2f} of the height in 120 frames, not {PLUME_TOP:.2f}")
    return result["fields"]


def plume_case(sizes: Sizes, **more: Any) -> Case:
    """From a developed plume on; the first frame, whose pressure starts from nothing, is not measured."""
    return Case("plume", plume(sizes.plume, PLUME_TOLERANCE), frames=9, warm=1, **more)


def smoke(sizes: Sizes) -> Outcome:
    """Smoke only, a developed plume."""
    name = f"Smoke only {sizes.plume}^3"
    result = run_case(plume_case(sizes), developed_plume(sizes))
    at = lines.conditions_of(f"developed plume, tolerance {PLUME_TOLERANCE:g}", result)
    left = lines.divergence_ratio(result)
    outcome = Outcome(
        [
            lines.per_cell(f"{name}: core time per cell and step", lines.core_seconds(result), result, at),
            lines.per_cell(f"{name}: wall per cell and step", lines.step_seconds(result), result, at),
            Line(f"{name}: divergence after/before <= 0.001", left, "", 0, PLUME_TOLERANCE, at),
            lines.memory_line(name, result, at, 110),
        ]
    )
    outcome.add_stages(name, result)
    return outcome


ROOFLINE_ROUNDS = 15
OPERATOR_SHARE = 0.45


def roofline(sizes: Sizes) -> Outcome:
    """Kernels that move whole fields, beside a triad."""
    outcome = Outcome()
    for threads in (1, 2):
        rows = kernels.roofline(kernels.measure(sizes.kernels, threads, ROOFLINE_ROUNDS))
        outcome.tables[f"Roofline, {lines.threads_text(threads)}"] = rows
        operator = next(row for row in rows if row["kernel"] == "pressure operator")
        at = f"{'x'.join(map(str, sizes.kernels))} cells, {lines.threads_text(threads)}, median of {ROOFLINE_ROUNDS}"
        outcome.lines.append(
            Line(
                f"pressure operator: share of the triad's bandwidth >= {OPERATOR_SHARE:g}",
                operator["share of the triad"],
                "",
                OPERATOR_SHARE,
                None,
                at,
            )
        )
    return outcome


THREAD_ROUNDS = 2
THREAD_SHARE = 0.85


def at_threads(case: Case, rounds: int = 1) -> dict[int, list[dict[str, Any]]]:
    """Runs of a case by number of threads, 1, 2, 4, ..., taking turns."""
    runs: dict[int, list[dict[str, Any]]] = {count: [] for count in scaling.counts(os.cpu_count() or 1)}
    for _ in range(rounds):
        for count, results in runs.items():
            results.append(run_case(dataclasses.replace(case, threads=count)))
    return runs


def threads(sizes: Sizes) -> Outcome:
    """Every stage of four scenes at 1, 2, 4, ... threads; of the ball the whole step with one thread and with two."""
    ball = at_threads(ball_case(sizes.fine, "production", 2), THREAD_ROUNDS)
    share, gain, triad = lines.thread_share(ball[1], ball[2])
    at = f"Ball {sizes.fine:g}, frames 1-2, {THREAD_ROUNDS} runs each: step x{gain:.3g}, triad x{triad:.3g}"
    name = f"1 -> 2 threads: the step's gain over the triad's (at most {lines.TRIAD_GAIN_CAP:g}) >= {THREAD_SHARE:g}"
    outcome = Outcome([Line(name, share, "", THREAD_SHARE, None, at)])
    scenes = {f"ball {sizes.fine:g}, frames 1-2": ball}
    for scene, voxel, frames in (("smoke_only", sizes.fine, 4), ("party", sizes.coarse, 3), ("heap", sizes.coarse, 11)):
        case = Case(scene, (f"Domain.voxelSize={voxel}",), frames)
        scenes[f"{scene} {voxel:g}, frames 1-{frames}"] = at_threads(case)
    for name, runs in scenes.items():
        results = {count: found[-1] for count, found in runs.items()}
        title = f"Seconds per step of {name}, {results[1]['profile']['steps']} steps"
        outcome.tables[title] = [*scaling.rows(results), scaling.triad_row(results)]
    return outcome


BOX = 3.0


def box(sizes: Sizes) -> Outcome:
    """The same action in a box of 8 times the volume."""
    case = ball_case(sizes.coarse, "production", 4)
    small, large = run_case(case), run_case(dataclasses.replace(case, grow=2.0))
    at = [lines.conditions_of(f"Ball {sizes.coarse:g}, frames 1-4", result) for result in (small, large)]
    measured = lines.step_seconds(large) / lines.step_seconds(small)
    outcome = Outcome(
        [
            Line(f"box of 8 times the volume: time per step, ratio <= {BOX:g}", measured, "", 0, BOX, at[1]),
            lines.timed("the small box: wall per step", lines.step_seconds(small), small, at[0]),
            lines.timed("the large box: wall per step", lines.step_seconds(large), large, at[1]),
        ]
    )
    outcome.add_stages("the small box", small)
    outcome.add_stages("the large box", large)
    return outcome


def vacuum(sizes: Sizes) -> Outcome:
    """A solid without fluid: tiles visited and memory. The profile counts what stages declare, points over 8^3, not
    which tiles; so what is shown is how many more they are than hold a solid."""
    settings = (f"Domain.voxelSize={sizes.coarse}",)
    result = run_case(Case("jelly_drop_no_fluid", settings, 4, keep=("solid_fraction",)))
    with_solid = lines.tiles_with_solid(result["fields"]["solid_fraction"][0])
    rows = lines.tile_rows(result["profile"], with_solid)
    at = lines.conditions_of(f"jelly_drop_no_fluid {sizes.coarse:g}", result)
    more = sum(row["more than hold a solid"] for row in rows)
    at_tiles = f"{at}, sum over the stages, {with_solid} of {result['cells'] // lines.TILE**3} tiles hold solid"
    return Outcome(
        [
            Line("no fluid: tiles per step beyond those that hold solid = 0", more, "tiles", 0, 0, at_tiles),
            lines.memory_line("no fluid", result, at),
            lines.timed("no fluid: wall per step", lines.step_seconds(result), result, at),
        ],
        {f"Tiles without fluid, {with_solid} hold solid": rows},
    )


# What a scene lacks -> the settings that take it out of the ball scene, and the stages that then have nothing to do.
MISSING = {
    "fluid": (("Domain.ambientFluid=false",), ("fluid_advection", "smoke")),
    "smoke": (("Carpet.enabled=false",), ("smoke",)),
    "solids": (("Ball.enabled=false",), ("solid_mass", "compute_g", "solid_advection", "surface", "contact")),
}


def missing(sizes: Sizes) -> Outcome:
    """Tiles and bytes of the stages that a scene does not need."""
    outcome = Outcome()
    for name, (settings, stages) in MISSING.items():
        profile = run_case(Case("ball", (*settings, f"Domain.voxelSize={sizes.empty}")))["profile"]
        for kind in ("tiles", "bytes"):
            touched = sum(profile[kind][stage] for stage in stages)
            at = f"voxel {sizes.empty:g}, production, stages {', '.join(stages)}"
            outcome.lines.append(Line(f"{kind} of stages without {name} = 0", touched, kind, 0, 0, at))
    return outcome


GROUPS: dict[str, Callable[[Sizes], Outcome]] = {
    "ball": ball,
    "paper": paper,
    "bounce": bounce,
    "smoke": smoke,
    "roofline": roofline,
    "threads": threads,
    "box": box,
    "vacuum": vacuum,
    "missing": missing,
}


def against(sizes: Sizes, checkout: Path, rounds: int) -> Outcome:
    """Ball and plume with the library of another checkout and with this one's, `rounds` times in turns; ratios, now
    over then."""
    start = developed_plume(sizes)
    cases = {
        **{
            f"Ball {sizes.fine:g}, {preset}, frames 1-4": (ball_case(sizes.fine, preset, 4), None)
            for preset in ("production", "paper2016")
        },
        f"Smoke only {sizes.plume}^3, developed plume": (plume_case(sizes), start),
    }
    outcome = Outcome()
    for name, (case, fields) in cases.items():
        then, now = [], []
        for _ in range(rounds):
            then.append(run_case(dataclasses.replace(case, checkout=checkout), fields))
            now.append(run_case(case, fields))
        at = f"{rounds} runs each, taking turns; steps {len(now[0]['steps'])} / {len(then[0]['steps'])}"
        for what, seconds in (
            ("wall per step", lines.step_seconds),
            ("core time per step", lines.core_seconds),
            ("wall per frame", lines.frame_seconds),
        ):
            pair = [[seconds(result) for result in results] for results in (now, then)]
            values = f"{at}; {1000 * min(pair[0]):.4g} / {1000 * min(pair[1]):.4g} ms at best"
            outcome.lines.append(Line(f"{name}: {what}, now / then", lines.ratio(*pair), "", None, None, values))
        memory = [results[0]["profile"]["memory_bytes"] / results[0]["cells"] for results in (now, then)]
        at = f"{memory[0]:.4g} / {memory[1]:.4g} B per cell"
        outcome.lines.append(Line(f"{name}: memory, now / then", memory[0] / memory[1], "", None, None, at))
        outcome.add_stages(f"{name}, now", now[-1])
        outcome.add_stages(f"{name}, then", then[-1])
    return outcome


def beside_peer(sizes: Sizes) -> Outcome:
    """Smoke of Blender's Mantaflow and ours, from the same inflow, ours before and after it."""
    blender = peer.find()
    if blender is None:
        print(peer.INSTALL)
        return Outcome()
    case = Case("plume", plume(sizes.plume, PLUME_TOLERANCE), sizes.peer_frames, keep=("smoke_density",), vdb=True)
    before = run_case(case)
    baked = peer.bake(blender, sizes.plume, sizes.peer_frames, case.threads)
    return Outcome(peer.compare([before, run_case(case)], baked))
