"""What came of the jobs of a wedge: wedge.csv, and wedge.png with their pictures side by side."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .. import errors, files
from ..cache.manifest import Manifest
from ..cache.pictures import PREVIEW
from ..errors import EulerFsiError
from .variations import Job

TABLE = "wedge.csv"
SHEET = "wedge.png"
MOST_PICTURES = 64  # of a sheet; more make wedge_2.png, ...
_COLUMNS = ("exit_code", "status", "last_frame", "seconds", "warnings", "reason")
_BACKGROUND, _TEXT, _FAILED = (0.075, 0.085, 0.105), (0.85, 0.87, 0.90), (0.95, 0.45, 0.35)
_WIDTH = 3.0  # inches of one picture


@dataclasses.dataclass
class Row:
    """A job and what came of it. exit_code None: it has not run yet; warnings: codes of docs/warnings.md."""

    job: Job
    exit_code: int | None = None
    status: str = "waiting"
    last_frame: int | None = None
    seconds: float = 0.0
    warnings: str = ""
    reason: str = ""

    def take(self, code: int, events: list[dict[str, Any]], last_line: str, seconds: float, cache: Path) -> None:
        """The result of its process. last_line: on standard error, where the events do not say why it ended."""
        end = next((event for event in events if event["event"] == "end"), {})
        self.exit_code, self.seconds = code, seconds
        self.status = errors.EXIT_CODES.get(code, (f"signal {code - 128}" if code > 128 else f"code {code}", ""))[0]
        self.last_frame = end.get("last_frame")
        self.reason = (end.get("error") or ("" if not code else last_line or "ended without a word")).replace(
            "\n", "; "
        )
        try:
            self.warnings = " ".join(sorted({w["code"] for w in Manifest.load(cache).data.get("warnings", [])}))
        except EulerFsiError:
            self.warnings = ""


def write(path: Path, rows: Sequence[Row]) -> None:
    """The table: a row for each job, in the order of the wedge; folder, values, result."""
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(["folder", *rows[0].job.values, *_COLUMNS])
    for row in rows:
        facts = {**vars(row), "seconds": f"{row.seconds:.1f}" if row.exit_code is not None else ""}
        result = ["" if facts[column] is None else facts[column] for column in _COLUMNS]
        out.writerow([row.job.folder, *row.job.values.values(), *result])
    files.write_text(path, text.getvalue())


def draw(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """The contact sheets: the picture of every cache that has one, with its values. None without matplotlib."""
    try:
        import matplotlib
    except ImportError:
        return []
    matplotlib.use("Agg")
    sheets = []
    for start in range(0, len(rows), MOST_PICTURES):
        name = SHEET if not start else f"{Path(SHEET).stem}_{start // MOST_PICTURES + 1}.png"
        _draw_sheet(folder / name, folder, rows[start : start + MOST_PICTURES])
        sheets.append(folder / name)
    return sheets


def _draw_sheet(path: Path, folder: Path, rows: Sequence[Row]) -> None:
    from matplotlib import pyplot

    pictures = [_picture(folder / row.job.folder / PREVIEW) for row in rows]
    shapes = [picture.shape for picture in pictures if picture is not None]
    ratio = max((shape[0] / shape[1] for shape in shapes), default=0.25)
    columns = _columns(rows)
    lines = math.ceil(len(rows) / columns)
    title = 0.22 * (1 + len(rows[0].job.values))  # inches above a picture
    size = (_WIDTH * columns, (_WIDTH * ratio + title) * lines)
    figure = pyplot.figure(figsize=size, dpi=100, facecolor=_BACKGROUND)
    for number, (row, picture) in enumerate(zip(rows, pictures, strict=True)):
        left, top = (number % columns) / columns, 1 - (number // columns) / lines
        axes = figure.add_axes((left + 0.01 / columns, top - 1 / lines, 0.98 / columns, 1 / lines - title / size[1]))
        axes.set_axis_off()
        if picture is not None:
            axes.imshow(picture, aspect="equal", interpolation="antialiased")
            axes.set_anchor("N")
        values = [f"{name} = {value}" for name, value in row.job.values.items()]
        end = row.status if row.exit_code in (None, 0) else f"{row.exit_code} {row.status}, last frame {row.last_frame}"
        color = _FAILED if row.exit_code else _TEXT
        place = (left + 0.03 / columns, top - 0.05 / size[1])
        figure.text(*place, "\n".join([*values, end]), color=color, fontsize=8, va="top")
    with files.replacing(path) as temporary:
        figure.savefig(temporary, facecolor=_BACKGROUND)
    pyplot.close(figure)


def _columns(rows: Sequence[Row]) -> int:
    """As many as the value that changes fastest has, where that makes a table; else nearly a square."""
    fastest = list(rows[0].job.values)[-1]
    count = len({row.job.values[fastest] for row in rows})
    return count if count <= 8 and len(rows) % count == 0 else min(8, math.ceil(math.sqrt(len(rows))))


def _picture(path: Path) -> Any:
    from matplotlib import pyplot

    try:
        return pyplot.imread(path) if path.is_file() else None
    except (OSError, ValueError, SyntaxError):  # a run was killed while it drew it, or another disk lost it
        return None
