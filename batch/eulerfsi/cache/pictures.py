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
EARLIER_FOLDER = "preview"  # of their pictures, so that a resumed run has them
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
        """flipbook: every frame gets a file; one that an earlier run has begun is continued."""
        begun = any((folder / FOLDER).glob("*.png"))
        self._folder, self._scene, self._flipbook, self._on = folder, scene, flipbook or begun, can_draw()
        self._wanted = set(spread(scene.frames, EARLIER + 1))
        self._last: tuple[int, Image.Image] | None = None

    def name(self, frame: int, folder: str) -> str:
        """Relative path of a frame's picture."""
        return f"{folder}/{self._scene.name}.{file_number(frame)}.png"

    def forget_after(self, frame: int) -> None:
        """Removes what shows later frames, which are made anew, what is made of all, and what no preview shows."""
        for name in (SHEET, FILM):
            (self._folder / name).unlink(missing_ok=True)
        for folder in (FOLDER, EARLIER_FOLDER):
            for number, path in self._drawn(folder):
                if number > frame or (folder == EARLIER_FOLDER and number not in self._wanted):
                    path.unlink()

    def _drawn(self, folder: str) -> list[tuple[int, Path]]:
        """Frames with a picture in a folder of the cache, in order, and their files."""
        numbered = [(path.stem.rsplit(".", 1)[-1], path) for path in (self._folder / folder).glob("*.png")]
        return sorted((int(number), path) for number, path in numbered if number.lstrip("-").isdecimal())

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
        if self._last is None or self._last[0] != known[-1]:  # a run without a frame, whose smoke may be ahead of it
            self._last = (known[-1], self._paint(known[-1], surfaces, smoke()))
            if self._flipbook and not (self._folder / self.name(known[-1], FOLDER)).exists():
                self._save(self.name(known[-1], FOLDER), self._last[1])
        self._write_preview()
        if self._flipbook:
            self._write_flipbook(known)
        return True

    def _draw(self, frame: int, surfaces: list[tuple[np.ndarray, np.ndarray]], smoke: np.ndarray | None) -> None:
        picture = self._paint(frame, surfaces, smoke)
        self._last = (frame, picture)
        if frame in self._wanted:
            self._save(self.name(frame, EARLIER_FOLDER), _scaled(picture, picture.width // EARLIER))
        if self._flipbook:
            self._save(self.name(frame, FOLDER), picture)

    def _paint(
        self, frame: int, surfaces: list[tuple[np.ndarray, np.ndarray]], smoke: np.ndarray | None
    ) -> Image.Image:
        from PIL import Image

        return Image.fromarray(paint(self._scene, frame, surfaces, smoke))

    def _write_preview(self) -> None:
        """The last frame, and below it earlier ones."""
        frame, picture = self._last
        drawn = {number: path for number, path in self._drawn(EARLIER_FOLDER) if number < frame}
        earlier = [self._read(drawn[number]) for number in spread(drawn, EARLIER)]
        self._save(PREVIEW, _grid([picture], 1, earlier))

    def _write_flipbook(self, frames: list[int]) -> None:
        there = [frame for frame in frames if (self._folder / self.name(frame, FOLDER)).is_file()]

        def pictures(numbers: list[int]) -> Iterable[Image.Image]:
            return (self._read(self._folder / self.name(number, FOLDER)) for number in numbers)

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
        except OSError as error:
            raise CacheIOError(f"{self._folder / FOLDER}: a picture cannot be written: {error}") from error

    def _read(self, path: Path) -> Image.Image:
        from PIL import Image

        try:
            with Image.open(path) as picture:
                return picture.convert("RGB")
        except (OSError, SyntaxError) as error:  # Pillow's words for a damaged file
            raise CacheIOError(f"{path}: a picture cannot be read: {error}") from error

    def _save(self, name: str, picture: Image.Image) -> None:
        folder = (self._folder / name).parent
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise CacheIOError(f"{folder}: cannot be created: {error.strerror}") from error
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
