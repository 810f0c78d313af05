"""Error against processor seconds of all solvers, a panel a measure: `plot.py [CSV] [PNG]`."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import run
from accuracy import table
from accuracy.table import Row
from eulerfsi import files
from eulerfsi.errors import UsageError

PICTURE = run.ROOT / "docs" / "images" / "peers.png"
TITLES = {
    "frequency": "swing of a ball: frequency",
    "energy": "swing of a ball: energy kept in ten periods",
    "restitution": "bounce of a ball: restitution",
    "sag": "cantilever: sag",
}
LEAST = 1e-5  # error drawn
COLORS = ("tab:blue", "tab:green", "tab:red", "tab:purple", "tab:brown", "tab:olive")
STYLES = ("-", "--", ":")


def newest(rows: Sequence[Row]) -> list[Row]:
    """Rows with an error, of each run the last."""
    kept = {(row.case, row.solver, row.cells, row.parameters): row for row in rows}
    return [row for row in kept.values() if row.error is not None and row.core_s]


def draw(source: Path, target: Path) -> None:
    """Raises UsageError for a table without rows, and without matplotlib."""
    rows = newest(table.read(source))
    if not rows:
        raise UsageError(f"{source}: no run with an error; tests/bench/peers/run.py makes them")
    try:
        import matplotlib
    except ImportError:
        raise UsageError("drawing needs matplotlib: pip install matplotlib") from None
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, grid = pyplot.subplots(2, 2, figsize=(9, 6.6), layout="constrained")
    names = sorted({row.solver for row in rows}, key=lambda name: (name != table.SOLVER, name))
    for axes, (measure, title) in zip(grid.flat, TITLES.items(), strict=True):
        shown = [row for row in rows if row.case == f"peer_{measure}"]
        for name, color in zip(names, COLORS, strict=False):
            mine = [row for row in shown if row.solver == name]
            for style, options in zip(STYLES, sorted({row.parameters for row in mine}, key=len), strict=False):
                line = sorted((row for row in mine if row.parameters == options), key=lambda row: row.cells)
                axes.plot(
                    [row.core_s for row in line], [max(row.error, LEAST) for row in line], style + "o", color=color
                )
                for k, row in enumerate(line):
                    words = [f"{name} {value}" for name, value in json.loads(options).items()] if k == 0 else []
                    where = (row.core_s, max(row.error, LEAST))
                    text = " ".join([f"{row.cells:g}", *words])
                    axes.annotate(text, where, xytext=(3, -8 if words else 3), textcoords="offset points", fontsize=6)
        axes.set(xscale="log", yscale="log", ylabel=run.NORMS[measure])
        axes.set_title(title, fontsize="medium")
        axes.grid(alpha=0.3)
    for axes in grid[-1]:
        axes.set_xlabel("processor seconds")
    handles = [pyplot.Line2D([], [], color=c, marker="o", label=n) for n, c in zip(names, COLORS, strict=False)]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize="small")
    with files.replacing(target) as temporary:
        figure.savefig(temporary, format="png", dpi=80)
    pyplot.close(figure)


def main() -> int:
    given = [Path(word) for word in sys.argv[1:3]]
    source, target = given + [run.OUTPUT, PICTURE][len(given) :]
    try:
        draw(source, target)
    except UsageError as error:
        print(error, file=sys.stderr)
        return 2
    print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
