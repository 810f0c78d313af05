"""Lines of `bench speed`: bars, what was measured, verdicts; all from results of runs (case.run_case) alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

RADIUS, GRAVITY = 0.1, 9.8
# A sphere of density 1000 in a fluid of density 1 that it drags along: (1000 - 1) / (1000 + 1/2).
FALL = 0.9985
# Steps whose divergence before the projection is below this part of the run's largest say nothing about the ratio.
QUIET = 0.01
TRIAD_GAIN_CAP = 1.7  # what two threads can be asked to gain
TILE = 8  # cells

Result = dict[str, Any]


@dataclasses.dataclass
class Line:
    """A bar and what was measured: low <= measured <= high passes; None bounds nothing, twice None: not judged.

    triads: the measured time over that of a triad, for times.
    """

    bar: str
    measured: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    conditions: str = ""
    triads: float | None = None

    @property
    def verdict(self) -> str:
        if self.low is None and self.high is None:
            return "not judged"
        enough = self.low is None or self.low <= self.measured
        return "pass" if enough and (self.high is None or self.measured <= self.high) else "MISSED"


# --- times -----------------------------------------------------------------------------------------------------------


def step_seconds(result: Result) -> float:
    """Mean wall-clock seconds of a step."""
    return float(np.mean([step["seconds"] for step in result["steps"]]))


def frame_seconds(result: Result) -> float:
    """Mean wall-clock seconds of a frame."""
    frames = {step["frame"] for step in result["steps"]}
    return sum(step["seconds"] for step in result["steps"]) / len(frames)


def core_seconds(result: Result) -> float:
    """Mean processor seconds of a step, of all threads, as the system counts them."""
    return float(np.mean([step["processor"] for step in result["steps"]]))


def timed(bar: str, seconds: float, result: Result, conditions: str, high: float | None = None) -> Line:
    """A line for a time [s], with its triads; judged where a highest value is given."""
    return Line(bar, seconds, "s", None if high is None else 0.0, high, conditions, seconds / result["triad"])


def per_cell(bar: str, seconds: float, result: Result, conditions: str) -> Line:
    """A line for the time of a step over the cells of the scene."""
    return Line(bar, 1e6 * seconds / result["cells"], "us", None, None, conditions, seconds / result["triad"])


def stage_seconds(result: Result) -> dict[str, float]:
    """Seconds per step of each stage."""
    steps = max(result["profile"]["steps"], 1)
    return {stage: seconds / steps for stage, seconds in result["profile"]["seconds"].items()}


def stage_rows(result: Result) -> list[dict[str, Any]]:
    """Time per stage, as the columns of the paper's Table 2, in ms per step."""
    total = result["profile"]["total_seconds"]
    return [
        {
            "stage": stage,
            "ms per step": 1000 * seconds,
            "share": result["profile"]["seconds"][stage] / total,
            "triads": seconds / result["triad"],
        }
        for stage, seconds in stage_seconds(result).items()
        if seconds > 0
    ]


def thread_share(one: Sequence[Result], two: Sequence[Result]) -> tuple[float, float, float]:
    """(share, gain of the step, gain of the triad) from one thread to two; the triad's counts up to TRIAD_GAIN_CAP."""
    gain = float(np.mean([step_seconds(r) for r in one]) / np.mean([step_seconds(r) for r in two]))
    triad = float(np.mean([r["triad"] for r in one]) / np.mean([r["triad"] for r in two]))
    return gain / min(triad, TRIAD_GAIN_CAP), gain, triad


def ratio(now: Sequence[float], then: Sequence[float]) -> float:
    """Median of now / then over runs that took turns."""
    return float(np.median(np.asarray(now) / np.asarray(then)))


# --- memory and tiles ------------------------------------------------------------------------------------------------


def memory_line(name: str, result: Result, conditions: str, high: float | None = None) -> Line:
    """A line for the memory of fields and workspace; judged where a highest number of bytes per cell is given."""
    bytes_per_cell = result["profile"]["memory_bytes"] / result["cells"]
    bar = "" if high is None else f" <= {high:g}"
    low = None if high is None else 0.0
    return Line(f"{name}: bytes per cell of fields and workspace{bar}", bytes_per_cell, "B", low, high, conditions)


def tiles_with_solid(fraction: np.ndarray) -> int:
    """Tiles of 8^3 cells that hold some of a solid; fraction: (nx, ny, nz)."""
    padded = np.pad(fraction, [(0, -count % TILE) for count in fraction.shape])
    counts = [count // TILE for count in padded.shape]
    blocks = padded.reshape(counts[0], TILE, counts[1], TILE, counts[2], TILE)
    return int((blocks.max(axis=(1, 3, 5)) > 0).sum())


def tile_rows(profile: dict[str, Any], with_solid: int) -> list[dict[str, Any]]:
    """Tiles per step and stage as the profile counts them (points over 8^3), and how many more than hold a solid."""
    steps = max(profile["steps"], 1)
    return [
        {
            "stage": stage,
            "tiles per step": count / steps,
            "more than hold a solid": max(0.0, count / steps - with_solid),
        }
        for stage, count in profile["tiles"].items()
        if count > 0
    ]


# --- physics of the ball ---------------------------------------------------------------------------------------------


def fall_acceleration(result: Result) -> tuple[float, int]:
    """Slope of the ball's mean velocity [m/s^2] over its first fall, down to a radius above the floor; and samples."""
    samples = []
    for step in result["steps"]:
        if step["solid"]["extent_min"][1] - result["floor"] <= RADIUS:
            break
        samples.append((step["time"], step["solid"]["momentum"][1] / step["solid"]["mass"]))
    if len(samples) < 2:
        return float("nan"), len(samples)
    times, speeds = np.array(samples).T
    return -float(np.polyfit(times, speeds, 1)[0]), len(samples)


def volume_errors(result: Result) -> tuple[float, float, float]:
    """Largest |V/V0 - 1| by mesh, by cells, and the largest difference of the two ratios."""
    mesh = np.array([s["solid"]["volume_mesh"] for s in result["steps"]]) / result["start"]["volume_mesh"]
    cells = np.array([s["solid"]["volume_cells"] / s["solid"]["rest_volume_cells"] for s in result["steps"]])
    return float(abs(mesh - 1).max()), float(abs(cells - 1).max()), float(abs(mesh - cells).max())


def divergence_ratio(result: Result, where: str = "") -> float:
    """Largest ratio of the 2-norm of div v after and before the projection, over the steps that are not quiet."""
    before = np.array([s[f"divergence_before{where}"] for s in result["steps"]])
    after = np.array([s[f"divergence_after{where}"] for s in result["steps"]])
    loud = before > QUIET * before.max()
    return float((after[loud] / before[loud]).max()) if loud.any() else 0.0


def threads_text(count: int) -> str:
    return f"{count} thread" + "s" * (count != 1)


def conditions_of(name: str, result: Result) -> str:
    """Scene, steps per frame, time step, threads."""
    dt = [step["dt"] for step in result["steps"]]
    frames = len({step["frame"] for step in result["steps"]})
    steps = f"{len(dt) / frames:.2f} steps per frame, dt {min(dt):.3g}..{max(dt):.3g} s"
    return f"{name}, {result['cells']} cells, {steps}, {threads_text(result['threads'])}"


def time_lines(name: str, result: Result, at: str, frame_bar: float, bytes_bar: float | None) -> list[Line]:
    """Speed and memory of one run."""
    return [
        timed(f"{name}: wall per frame < {frame_bar:g}", frame_seconds(result), result, at, frame_bar),
        timed(f"{name}: wall per step", step_seconds(result), result, at),
        timed(f"{name}: processor time per step", core_seconds(result), result, at),
        memory_line(name, result, at, bytes_bar),
        Line(f"{name}: peak memory < 0.8 GB", result["peak_bytes"] / 1e9, "GB", 0, 0.8, at),
    ]


def physics_lines(name: str, result: Result, at: str) -> list[Line]:
    """What a fall and a bounce of the ball must keep."""
    lines = []
    fall, count = fall_acceleration(result)
    limits = (FALL * 0.995, FALL * 1.005)
    free = f"{at}, {count} samples"
    lines.append(Line(f"{name}: free fall {FALL} g +- 0.5 %", fall / GRAVITY, "g", *limits, free))
    mesh, cells, apart = volume_errors(result)
    lines.append(Line(f"{name}: |V/V0 - 1| by mesh <= 0.03", mesh, "", 0, 0.03, at))
    lines.append(Line(f"{name}: |V/V0 - 1| by cells <= 0.03", cells, "", 0, 0.03, at))
    lines.append(Line(f"{name}: mesh and cells agree within 0.005", apart, "", 0, 0.005, at))
    norm = f"{at}, 2-norm, worst step above {QUIET:.0%} of the largest"
    lines.append(Line(f"{name}: divergence after/before <= 0.02", divergence_ratio(result), "", 0, 0.02, norm))
    inside = divergence_ratio(result, "_solid")
    lines.append(Line(f"{name}: divergence inside the solid <= 0.02", inside, "", 0, 0.02, norm))
    return lines
