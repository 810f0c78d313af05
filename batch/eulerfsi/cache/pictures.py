"""Pictures of a run: preview.png, and with `--flipbook` one of every frame, a contact sheet and a film.

matplotlib and, with it, Pillow draw them; without them there are none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .. import files
from ..errors import CacheIOError
from ..frames import file_number
from ..scene.parts import Scene
from .painter import BACKGROUND, paint

if TYPE_CHECKING:
    from PIL import Image

PREVIEW = "preview.png"
FOLDER = "flipbook"
SHEET, FILM = f"{FOLDER}/contact_sheet.png", f"{FOLDER}/film.webp"
EARLIER = 4  # frames below the last one in the preview
_SHEET_PICTURES, _SHEET_COLUMNS, _SHEET_WIDTH = 24, 6, 200
_QUALITY = 80  # of the film
_SHORTEST = 20  # milliseconds of a frame that players keep


def can_draw() -> bool:
    """Whether the packages that draw are there."""
    try:
        import matplotlib.figure  # noqa: F401
        import PIL.Image  # noqa: F401
    except ImportError:
        return False
    return True


def spread(numbers: Iterable[int], count: int) -> list[int]:
    """At most `count` of the numbers, evenly, with the first and the last."""
    known = sorted(numbers)
    if len(known) <= count:
        return known
    return [known[round(k * (len(known) - 1) / (count - 1))] for k in range(count)] if count > 1 else known[-1:]


class Pictures:
    """Draws frames while a run makes them."""

    def __init__(self, folder: Path, scene: Scene, flipbook: bool) -> None:
        """flipbook: every frame gets a file."""
        self._folder, self._scene, self._flipbook, self._on = folder, scene, flipbook, can_draw()
        self._wanted = set(spread(scene.frames, EARLIER + 1))
        self._small: dict[int, Image.Image] = {}  # of earlier frames, for the preview
        self._last: tuple[int, Image.Image] | None = None

    def name(self, frame: int) -> str:
        """Relative path of a frame's picture."""
        return f"{FOLDER}/{self._scene.name}.{file_number(frame)}.png"

    def forget_after(self, frame: int) -> None:
        """Removes what shows later frames, which are made anew, and what is made of all."""
        for name in (SHEET, FILM):
            (self._folder / name).unlink(missing_ok=True)
        for path in (self._folder / FOLDER).glob("*.png"):
            number = path.stem.rsplit(".", 1)[-1]
            if number.lstrip("-").isdecimal() and int(number) > frame:
                path.unlink()

    def frame(self, frame: int, surfaces: list[tuple[np.ndarray, np.ndarray]], smoke: Callable[[], np.ndarray]) -> None:
        """Draws a frame where a picture of it is wanted. smoke(): its density; not called where none is."""
        if self._on and (self._flipbook or frame in self._wanted):
            self._draw(frame, surfaces, smoke())

    def finish(
        self, frames: Iterable[int], surfaces: list[tuple[np.ndarray, np.ndarray]], smoke: Callable[[], np.ndarray]
    ) -> bool:
        """Draws the preview, and of a flip-book what shows all frames. False where nothing can draw.

        frames: those of the cache; surfaces, smoke: of the last one.
        """
        if not self._on:
            return False
        known = sorted(frames)
        if self._last is None or self._last[0] != known[-1]:
            self._draw(known[-1], surfaces, smoke())
        self._write_preview()
        if self._flipbook:
            self._write_flipbook(known)
        return True

    def _draw(self, frame: int, surfaces: list[tuple[np.ndarray, np.ndarray]], smoke: np.ndarray | None) -> None:
        from PIL import Image

        picture = Image.fromarray(paint(self._scene, frame, surfaces, smoke))
        self._last = (frame, picture)
        if frame in self._wanted:
            self._small[frame] = _scaled(picture, picture.width // EARLIER)
        if self._flipbook:
            self._make_folder()
            self._save(self.name(frame), picture)

    def _make_folder(self) -> None:
        try:
            (self._folder / FOLDER).mkdir(exist_ok=True)
        except OSError as error:
            raise CacheIOError(f"{self._folder / FOLDER}: cannot be created: {error.strerror}") from error

    def _write_preview(self) -> None:
        """The last frame, and below it earlier ones of this run."""
        frame, picture = self._last
        earlier = [self._small[n] for n in spread((n for n in self._small if n < frame), EARLIER)]
        self._save(PREVIEW, _grid([picture], 1, earlier))

    def _write_flipbook(self, frames: list[int]) -> None:
        from PIL import Image

        there = [frame for frame in frames if (self._folder / self.name(frame)).is_file()]

        def pictures(numbers: list[int]) -> Iterable[Image.Image]:
            for number in numbers:
                with Image.open(self._folder / self.name(number)) as picture:
                    yield picture.convert("RGB")

        try:
            shown = [_scaled(picture, _SHEET_WIDTH) for picture in pictures(spread(there, _SHEET_PICTURES))]
            columns = min(_SHEET_COLUMNS, math.ceil(math.sqrt(len(shown))))
            self._save(SHEET, _grid(shown, columns))
            first, *rest = there
            each = max(round(1000 / self._scene.fps), _SHORTEST)
            options = {"save_all": True, "duration": each, "loop": 0, "quality": _QUALITY, "method": 0}
            [start] = pictures([first])
            with files.replacing(self._folder / FILM) as temporary:
                start.save(temporary, "WEBP", append_images=pictures(rest), **options)
        except (OSError, SyntaxError) as error:  # Pillow's words for a damaged file
            raise CacheIOError(f"{self._folder / FOLDER}: a picture cannot be read or written: {error}") from error

    def _save(self, name: str, picture: Image.Image) -> None:
        with files.replacing(self._folder / name) as temporary:
            picture.save(temporary, "PNG", compress_level=1)


def _scaled(picture: Image.Image, width: int) -> Image.Image:
    from PIL import Image

    size = (max(width, 1), max(round(picture.height * width / picture.width), 1))
    return picture.resize(size, Image.Resampling.BOX, reducing_gap=2.0)


def _grid(pictures: list[Image.Image], columns: int, below: list[Image.Image] = ()) -> Image.Image:
    """Pictures of one size, row by row, and a row below them."""
    from PIL import Image

    width, height = pictures[0].size
    rows = math.ceil(len(pictures) / columns)
    size = (width * columns, height * rows + max((p.height for p in below), default=0))
    sheet = Image.new("RGB", size, tuple(round(255 * part) for part in BACKGROUND))
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (width * (number % columns), height * (number // columns)))
    for number, picture in enumerate(below):
        sheet.paste(picture, (number * picture.width, height * rows))
    return sheet
