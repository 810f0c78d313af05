"""`plot`: curves of a cache's statistics: step size (the paper's Fig. 9), volume, energy, time per frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import files
from ..cache import stats_file
from ..cache.manifest import Manifest
from ..errors import CacheIOError, UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMATS = (".png", ".svg", ".pdf")
_INCHES = (9.0, 4.5)
_ROW, _AROUND = 0.2, 0.7  # inches of a row of the panel below, and of what is around its rows
_MOST_BODIES = 12  # that have a row of their own
_OTHERS = "others"


class Statistics:
    """Lines of stats.jsonl, in order of time. steps, frames: those of the two kinds."""

    def __init__(self, folder: Path) -> None:
        """Raises SceneError where the folder is no cache, CacheIOError where it holds no frame that was simulated."""
        self.manifest = Manifest.load(folder)
        lines = stats_file.read(folder)
        self.steps = [line for line in lines if line.get("event") == "step"]
        self.frames = [line for line in lines if line.get("event") == "frame"]
        if not self.steps:
            raise CacheIOError(
                f"{folder / stats_file.NAME}: contains no step: the run must have simulated at least one frame"
            )

    @property
    def solids(self) -> list[str]:
        """Paths of the solids."""
        return list(self.frames[-1]["solids"]) if self.frames else []

    @property
    def frame_seconds(self) -> float:
        """Seconds of a frame."""
        return 1.0 / self.manifest.data["fps"]


def plot(kind: str, folder: Path, output: Path | None) -> Path:
    """Draws one of KINDS; returns the file, by default ./<cache>_<kind>.png. Raises as Statistics, and UsageError."""
    output = output or Path(f"{folder.resolve().name}_{kind}.png")
    if output.suffix.lower() not in FORMATS:
        raise UsageError(f"--output {output}: must end with one of {', '.join(FORMATS)}")
    statistics = Statistics(folder)
    try:
        import matplotlib
    except ImportError as error:
        raise UsageError("plot: drawing needs matplotlib: pip install matplotlib") from error
    matplotlib.use("Agg")
    from matplotlib import pyplot

    if rows := len(limiting_bodies(statistics)) if kind == "step" else 0:
        heights = (_INCHES[1], _ROW * rows + _AROUND)
        size = (_INCHES[0], sum(heights))
        figure, (axes, below) = pyplot.subplots(2, height_ratios=heights, figsize=size, layout="constrained")
        draw_bodies(statistics, below)
    else:
        figure, axes = pyplot.subplots(figsize=_INCHES, layout="constrained")
    KINDS[kind](statistics, axes)
    if rows:
        below.set_xlim(axes.get_xlim())
    axes.set_title(f"{folder.resolve().name}", fontsize="medium")
    axes.grid(alpha=0.3)
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(fontsize="small", loc="best")
    with files.replacing(output) as temporary:
        figure.savefig(temporary, format=output.suffix[1:].lower(), dpi=120)
    pyplot.close(figure)
    return output


def _column(lines: list[dict[str, Any]], pick: Callable[[dict[str, Any]], Any]) -> np.ndarray:
    """(lines,) one value of each; nan where it is missing."""
    values = [pick(line) for line in lines]
    return np.array([np.nan if value is None else value for value in values], float)


def _step(statistics: Statistics, axes: Axes) -> None:
    """Fig. 9: the size of every step, what limited it, and the mean."""
    end, size = (_column(statistics.steps, lambda line, name=name: line[name]) for name in ("time", "dt"))
    axes.step(end, 1e3 * size, where="pre", linewidth=0.8, color="tab:gray", label=f"{len(size)} steps")
    rules = np.array(_rules(statistics))
    for name, color in _colors(statistics).items():
        share = f"{name}: {(rules == name).mean():.0%}"
        axes.plot(end[rules == name], 1e3 * size[rules == name], ".", markersize=3, color=color, label=share)
    mean = 1e3 * size.mean()
    axes.axhline(mean, color="black", linewidth=1.2, label=f"mean {mean:.3g} ms")
    frame = 1e3 * statistics.frame_seconds
    axes.axhline(frame, color="tab:gray", linewidth=0.8, linestyle="--", label=f"a frame, {frame:.3g} ms")
    axes.set(xlabel="time [s]", ylabel="size of a step [ms]", ylim=(0.0, 1.05 * frame))


def _rules(statistics: Statistics) -> list[str]:
    """What limited every step, "" where the statistics do not say. The last step of a frame is as long as what is left
    of it, whatever limited the steps before."""
    names = [line.get("limit", {}).get("rule", "").replace("_", " ") for line in statistics.steps]
    alone = Counter(line["frame"] for line in statistics.steps)
    ends = {True: "a whole frame", False: "the last step of a frame"}
    told = zip(statistics.steps, names, strict=True)
    return [ends[alone[line["frame"]] == 1] if name == "end" else name for line, name in told]


def _colors(statistics: Statistics) -> dict[str, str]:
    """{rule: color}, the most frequent first."""
    rules = [rule for rule, _ in Counter(_rules(statistics)).most_common() if rule]
    return {rule: f"C{number % 10}" for number, rule in enumerate(rules)}


def limiting_bodies(statistics: Statistics) -> dict[str, list[int]]:
    """{body: numbers of the steps that it limited}, the most frequent first: the name of its prim, the path where
    several have that name. What is left of many is together in one."""
    found: dict[str, list[int]] = {}
    for number, line in enumerate(statistics.steps):
        for path in line.get("limit", {}).get("bodies", ()):
            found.setdefault(path, []).append(number)
    paths = sorted(found, key=lambda path: -len(found[path]))
    names = Counter(path.rpartition("/")[2] for path in paths)
    rows: dict[str, list[int]] = {}
    for row, path in enumerate(paths):
        name = path.rpartition("/")[2]
        name = path if names[name] > 1 else name
        if row < _MOST_BODIES or len(paths) == _MOST_BODIES + 1:
            rows[name] = found[path]
        else:
            rows[_OTHERS] = sorted({*rows.get(_OTHERS, ()), *found[path]})
    return rows


def draw_bodies(statistics: Statistics, axes: Axes) -> None:
    """Which body limited which step, a row each, in the colors of the rules."""
    end = _column(statistics.steps, lambda line: line["time"])
    rules, rows = _rules(statistics), limiting_bodies(statistics)
    for color_of, color in _colors(statistics).items():
        points = [(end[n], row) for row, numbers in enumerate(rows.values()) for n in numbers if rules[n] == color_of]
        if points:
            axes.plot(*np.transpose(points), "|", color=color)
    labels = [f"{name}: {len(numbers) / len(rules):.0%}" for name, numbers in rows.items()]
    axes.set_yticks(range(len(rows)), labels, fontsize="small")
    axes.set(xlabel="time [s]", ylim=(len(rows) - 0.5, -0.5))
    axes.set_title("steps limited by", fontsize="small", loc="left")
    axes.grid(alpha=0.3, axis="x")


def _volume(statistics: Statistics, axes: Axes) -> None:
    """The volume of every solid over that at rest, by its mesh and by cells."""
    time = _column(statistics.frames, lambda line: line["time"])
    for number, path in enumerate(_demand_solids(statistics)):
        for mark, now, rest in (("-", "volume_mesh", "rest_volume"), (":", "volume_cells", "rest_volume_cells")):
            ratio = _column(statistics.frames, lambda line, p=path, n=now, r=rest: _ratio(line["solids"][p], n, r))
            label = f"{path}{' (dotted: by cells)' if number == 0 else ''}" if mark == "-" else None
            axes.plot(time, ratio, mark, color=f"C{number}", label=label)
    axes.axhline(1.0, color="black", linewidth=0.6)
    axes.set(xlabel="time [s]", ylabel="volume / volume at rest")


def _ratio(solid: dict[str, Any], now: str, rest: str) -> float | None:
    return solid[now] / solid[rest] if solid[rest] else None


def _energy(statistics: Statistics, axes: Axes) -> None:
    """Energies: of every step with their sum where the run kept the ledger, else of every frame."""
    booked = [line for line in statistics.steps if "energy" in line]
    if booked:
        time = _column(booked, lambda line: line["time"])
        names = {"solid_kinetic": "solids, kinetic", "elastic": "elastic", "fluid_kinetic": "fluid, kinetic"}
        total = np.zeros(len(time))
        for name, label in {**names, "potential": "potential"}.items():
            values = _column(booked, lambda line, n=name: line["energy"]["at_end"][n])
            if name == "potential":
                values = values - values[0]
            total += values
            axes.plot(time, values, linewidth=1.0, label=label)
        axes.plot(time, total, color="black", linewidth=1.4, label="sum")
    else:
        time = _column(statistics.frames, lambda line: line["time"])
        for name, label in {"kinetic_energy": "solids, kinetic", "elastic_energy": "elastic"}.items():
            values = _column(statistics.frames, lambda line, n=name: sum(s[n] for s in line["solids"].values()))
            axes.plot(time, values, label=label)
        axes.plot(
            time, _column(statistics.frames, lambda line: line["fluid"]["kinetic_energy"]), label="fluid, kinetic"
        )
    axes.set(xlabel="time [s]", ylabel="energy [J]")


def _time(statistics: Statistics, axes: Axes) -> None:
    """Wall-clock seconds of every frame."""
    frames = [line["frame"] for line in statistics.frames]
    seconds = _column(statistics.frames, lambda line: line["seconds"])
    axes.bar(frames, seconds, width=0.8, label=f"{seconds.sum():.3g} s in all")
    axes.axhline(seconds.mean(), color="black", linewidth=1.2, label=f"mean {seconds.mean():.3g} s")
    axes.set(xlabel="frame", ylabel="wall-clock time [s]")


def _demand_solids(statistics: Statistics) -> list[str]:
    if not statistics.solids:
        raise UsageError(f"{statistics.manifest.folder}: the scene has no solid, whose volume could be plotted")
    return statistics.solids


KINDS: dict[str, Callable[[Statistics, Axes], None]] = {
    "step": _step,
    "volume": _volume,
    "energy": _energy,
    "time": _time,
}
