"""`view` of a wedge: the pages of its caches side by side, which play together."""

from __future__ import annotations

from pathlib import Path

from ..errors import EulerFsiError, SceneError, UsageError
from ..farm import wedge
from ..view.page import Beside, write_side_by_side
from .view import View, make_page, page_file, write

MOST_PAGES = 16  # pictures that a browser draws at once
_ESCAPED = 0.8  # part of a page's share that it may take: as an attribute it is larger


def is_wedge(folder: Path) -> bool:
    """Whether the folder is that of a wedge."""
    return (folder / wedge.MANIFEST).is_file()


def view_wedge(folder: Path, output: Path | None, every: int, max_mb: float) -> View:
    """Writes one page with those of all jobs, by default ./<wedge>.html.

    A job without a finished frame has its reason in place of a picture. Raises CacheIOError for a damaged manifest,
    SceneError where no job has a frame, UsageError for a page that cannot be as small as `max_mb`.
    """
    output = page_file(folder, output)
    jobs = wedge.load(folder)["jobs"]
    shown, notes = jobs[:MOST_PAGES], []
    if len(jobs) > len(shown):
        notes.append(f"The first {len(shown)} of {len(jobs)} jobs are shown; `view` of a job's own folder shows it.")
    pages = [_beside(folder, job, every, _ESCAPED * max_mb / len(shown)) for job in shown]
    if not any(page.text for page in pages):
        raise SceneError(f"{folder}: no job of the wedge has a finished frame; the first: {pages[0].fault}")
    return write(output, write_side_by_side(folder.resolve().name, pages, notes), notes)


def _beside(folder: Path, job: dict, every: int, max_mb: float) -> Beside:
    caption = ", ".join(f"{name} = {value}" for name, value in job["values"].items())
    try:
        text, notes, seconds = make_page(folder / job["folder"], every, max_mb)
    except UsageError:
        raise
    except EulerFsiError as error:
        return Beside(caption, str(error), "", 0.0)
    return Beside(caption, " ".join(notes), text, seconds)
