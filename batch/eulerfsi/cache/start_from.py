"""`--start-from CACHE[:FRAME]`: solids that start as another run has left them."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

from .. import files
from ..errors import CacheIOError, LibraryError, MismatchError, UsageError
from ..scene.parts import Scene
from ..solver import binding
from ..solver.simulation import Simulation
from .manifest import FILE_NAME, Manifest


@dataclasses.dataclass
class Start:
    """A checkpoint of another cache. text: as the user gave it; frame: the last one that is complete in it."""

    text: str
    path: Path
    frame: int

    def facts(self) -> dict[str, Any]:
        """What the manifest of the new cache says of it."""
        return {"frame": self.frame, "sha256": files.digest(self.path)}


def find_start(text: str) -> Start:
    """The checkpoint that CACHE or CACHE:FRAME names; without a frame the last one.

    Raises UsageError for a folder without cache or a frame without checkpoint, CacheIOError for a damaged one.
    """
    folder, frame = Path(text), None
    if not folder.is_dir() and (match := re.fullmatch(r"(.+):(-?\d+)", text)):
        folder, frame = Path(match[1]), int(match[2])
    if not (folder / FILE_NAME).is_file():
        raise UsageError(f"--start-from {text}: {folder} contains no cache")
    manifest = Manifest.load(folder)
    found = manifest.whole_checkpoints(frame)
    if not found:
        there = " and ".join(str(checkpoint["frame"]) for checkpoint in manifest.whole_checkpoints()) or "none"
        raise UsageError(
            f"--start-from {text}: {folder} contains no checkpoint{'' if frame is None else f' of frame {frame}'}; it "
            f"has those of frames: {there}. A run keeps the last two: simulate it with --frames up to "
            "the wanted frame, or with --keep-checkpoints all"
        )
    path = folder / found[-1]["file"]
    if not path.is_file() or files.digest(path) != found[-1]["sha256"]:
        raise CacheIOError(f"--start-from {text}: {path}: is missing or damaged")
    return Start(text, path, found[-1]["frame"])


def take_over(start: Start, simulation: Simulation, scene: Scene) -> None:
    """The solids get the states that they have in the checkpoint. Raises MismatchError where they are others."""
    try:
        simulation.restore_solids(start.path)
    except LibraryError as error:
        if error.status != binding.ERROR_CHECKPOINT:
            raise
        raise MismatchError(f"{scene.path}: --start-from {start.text}: {error}") from error
