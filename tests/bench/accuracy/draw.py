"""`plot accuracy`: error against core seconds, a picture a group and a panel a case, the front of all runs marked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from eulerfsi import files
from eulerfsi.errors import UsageError

from . import fit, front, sweep, table
from .table import SOLVER, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS, PANEL, DPI = 3, (3.4, 2.7), 80  # inches
MARKS = {"resolution": ("o", "resolution"), "step": ("^", "step"), "tolerance": ("s", "tolerance")}
COLORS = {"production": "tab:blue", "paper2016": "tab:orange", "fast": "tab:green"}
PEERS = ("tab:green", "tab:red", "tab:purple", "tab:brown", "tab:pink", "tab:olive", "tab:cyan")


def label(row: Row) -> str:
    return row.preset if row.solver == SOLVER else row.solver


def panel(axes: Axes, rows: Sequence[Row], colors: dict[str, str]) -> None:
    """One case. Runs on a machine that others kept busy are hollow."""
    for row in front.measured(rows):
        color = colors[label(row)]
        mark = MARKS.get(row.sweep, MARKS["resolution"])[0] if row.solver == SOLVER else "D"
        face = "none" if row.loaded else color
        axes.plot([row.core_s], [max(row.error, 1e-9)], mark, color=color, markerfacecolor=face, markersize=5)
    for preset in COLORS:
        line = fit.resolution([row for row in rows if row.preset == preset and row.sweep in ("resolution", "preset")])
        line = line or [row for row in rows if row.preset == preset and row.sweep == "preset"]
        line = front.measured(sorted(line, key=lambda row: row.cells))
        axes.plot(
            [r.core_s for r in line], [max(r.error, 1e-9) for r in line], "-", color=COLORS[preset], linewidth=0.7
        )
    best = front.front(rows)
    axes.plot([r.core_s for r in best], [max(r.error, 1e-9) for r in best], "--", color="black", linewidth=1.0)
    axes.set(xscale="log", yscale="log")
    frame(axes)
    axes.set_title(rows[0].case, fontsize="small")
    norms = [row.norm for row in rows if row.norm]
    axes.set_ylabel(norms[0][:44] if norms else "error", fontsize=6)
    axes.tick_params(which="both", labelsize=6)
    axes.grid(alpha=0.3)


def frame(axes: Axes) -> None:
    """Limits of at least a decade, so that what hardly changes looks so; labels at the decades alone."""
    from matplotlib.ticker import NullFormatter

    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        grow = max(1.0, 10.0**0.6 / (high / low) ** 0.5)
        axis.set_minor_formatter(NullFormatter())
        (axes.set_xlim if axis is axes.xaxis else axes.set_ylim)(low / grow, high * grow)


def picture(rows: Sequence[Row], names: Sequence[str], path: Path) -> None:
    """The cases of a group."""
    from matplotlib import pyplot
    from matplotlib.lines import Line2D

    high = -(-len(names) // COLUMNS)
    wide = min(COLUMNS, len(names))
    size = (PANEL[0] * wide, PANEL[1] * high + 0.5)
    figure, grid = pyplot.subplots(high, wide, figsize=size, layout="constrained", squeeze=False)
    peers = sorted({row.solver for row in rows if row.solver != SOLVER})
    colors = COLORS | {peer: PEERS[k % len(PEERS)] for k, peer in enumerate(peers)}
    for axes in grid.flat[len(names) :]:
        axes.set_axis_off()
    for axes, name in zip(grid.flat, names, strict=False):
        panel(axes, [row for row in rows if row.case == name], colors)
    for axes in grid[-1]:
        axes.set_xlabel("core seconds", fontsize=7)
    used = {label(row) for row in rows}
    handles = [Line2D([], [], color=color, marker="o", label=name) for name, color in colors.items() if name in used]
    handles += [Line2D([], [], color="gray", marker=mark, linestyle="", label=text) for mark, text in MARKS.values()]
    handles += [Line2D([], [], color="gray", marker="D", linestyle="", label="peer")] if peers else []
    handles += [Line2D([], [], color="black", linestyle="--", label="front")]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=6)
    with files.replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI)
    pyplot.close(figure)


def draw(source: Path = table.RESULTS, folder: Path | None = None) -> list[Path]:
    """Draws all groups that have rows; returns the files accuracy_<group>.png, by default in docs/images."""
    folder = folder or table.ROOT / "docs" / "images"
    if not source.exists():
        raise UsageError(f"{source}: there is no such table; ./eulerfsi bench accuracy writes it")
    rows = fit.with_errors(front.newest(table.read(source)))
    try:
        import matplotlib
    except ImportError as error:
        raise UsageError("plot: drawing needs matplotlib: pip install matplotlib") from error
    matplotlib.use("Agg")
    _, cases = sweep.load()
    table.demand_writable(folder / "accuracy.png")
    folder.mkdir(parents=True, exist_ok=True)
    known = {row.case for row in front.measured(rows)}
    groups: dict[str, list[str]] = {}
    for name, case in cases.items():
        if name in known:
            groups.setdefault(case.group, []).append(name)
    if not groups:
        raise UsageError(f"{source}: has no run with an error and a time")
    for group, names in groups.items():
        picture(rows, names, folder / f"accuracy_{group}.png")
    return [folder / f"accuracy_{group}.png" for group in groups]
