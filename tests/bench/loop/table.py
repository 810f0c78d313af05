"""The rows of all runs and the lines of all laws, as text, Markdown and CSV."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path

from .laws import Line
from .measure import Result, divergence_ratio, extremes, volume_range

LINE_NAMES = ("law", "bar", "measured", "unit", "verdict", "conditions")


def cell(value: object) -> str:
    """A number with 4 digits, anything else as it is."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def span(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.3g}..{pair[1]:.3g}"


def row(result: Result) -> dict[str, str]:
    """One run: its scene, its choices, what happened and the numbers of the laws that looked at it."""
    run, dt = result.run, result["dt"]
    return {
        "scene": run.scene,
        "shape": run.shape,
        "across": str(run.across),
        "dt [s]": span((dt.min(), dt.max())) if dt.size else "",
        "CFL": "" if run.cfl is None else f"{run.cfl:g}",
        "density ratio": "vacuum" if run.density_ratio is None else f"{run.density_ratio:g}",
        "walls": run.walls,
        "settings": " ".join(f"{name}={value}" for name, value in run.settings),
        "finished": "yes" if result.finished else f"no: {result.failure}",
        "time [s]": cell(float(result.times[-1])),
        "steps": str(dt.size),
        "clamps": str(result.clamps),
        "retries": str(result.retries),
        "unconverged": str(int(result["unconverged"].sum())),
        "det F interior": span(extremes(result, "det_f_interior")),
        "det F cut": span(extremes(result, "det_f_cut")),
        "V/V0 mesh": span(volume_range(result, "mesh")),
        "V/V0 cells": span(volume_range(result, "cells")),
        "div after/before": cell(divergence_ratio(result)),
        "in the solid": cell(divergence_ratio(result, "_solid")),
        "seconds": f"{result['seconds'].sum():.1f}",
        "numbers": ", ".join(f"{name} {cell(value)}" for name, value in result.numbers.items()),
    }


def line_cells(line: Line) -> dict[str, str]:
    return {**{name: cell(value) for name, value in dataclasses.asdict(line).items()}, "verdict": line.verdict}


def text(rows: Sequence[dict[str, str]]) -> str:
    """Columns of equal width."""
    if not rows:
        return ""
    names = list(rows[0])
    widths = {name: max(len(name), *(len(r[name]) for r in rows)) for name in names}
    head = {name: name for name in names}
    return "\n".join("  ".join(r[name].ljust(widths[name]) for name in names).rstrip() for r in [head, *rows])


def markdown(rows: Sequence[dict[str, str]], names: Iterable[str]) -> str:
    names = list(names)
    body = ["| " + " | ".join(r[name].replace("|", "\\|") for name in names) + " |" for r in rows]
    return "\n".join(["| " + " | ".join(names) + " |", "|" + "---|" * len(names), *body])


def write(path: Path, title: str, where: str, results: Sequence[Result], lines: Sequence[Line]) -> None:
    """Markdown, or for a name that ends in .csv the rows alone."""
    rows = [row(result) for result in results]
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".csv":
        with path.open("w", newline="") as out:
            writer = csv.DictWriter(out, list(rows[0]) if rows else [])
            writer.writeheader()
            writer.writerows(rows)
        return
    laws = markdown([line_cells(line) for line in lines], LINE_NAMES)
    path.write_text(
        f"# {title}\n\n{where}\n\n## Laws\n\n{laws}\n\n## Runs\n\n{markdown(rows, rows[0] if rows else [])}\n"
    )
