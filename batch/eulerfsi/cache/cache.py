"""The cache folder: made new, taken up again or refused; frames, volumes, statistics and checkpoints go in.

Layout: <scene>.usda, scene/ (copy of the scene), frames/, vdb/, checkpoints/, manifest.json, stats.jsonl, log,
preview.png, with --flipbook flipbook/. Every file appears whole, and the folder can be moved.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__, files
from ..errors import CacheIOError, UsageError
from ..frames import file_number
from ..scene.parts import Scene
from ..solver import binding
from ..solver.simulation import Simulation
from . import pictures, rebake, stats_file
from .localize import localize_scene
from .lock import LOCK
from .manifest import FILE_NAME, Manifest
from .output import Output
from .start_from import Start
from .usd_writer import UsdWriter

_FOLDERS = ("frames", "vdb", "checkpoints", "scene", pictures.FOLDER)
_FILES = (stats_file.NAME, "log", pictures.PREVIEW, FILE_NAME)


class Cache:
    """One cache folder that a run writes to. `checkpoint`: manifest entry that a resumed run starts from, or None."""

    def __init__(self, folder: Path, scene: Scene, manifest: Manifest) -> None:
        self.folder = folder
        self.scene = scene
        self.manifest = manifest
        self.writer = UsdWriter(folder, scene)
        self.checkpoint: dict[str, Any] | None = None
        self.output = Output.of(manifest.data.get("output"))
        self._stats: list[dict[str, Any]] = []

    @classmethod
    def create(
        cls, folder: Path, scene: Scene, overrides: dict[str, str], output: Output, start: Start | None = None
    ) -> Cache:
        """Makes the folder with a copy of the scene. An old cache must have been removed (`prepare`)."""
        facts = {
            **_recipe(scene, overrides, output),
            "scene": f"{scene.name}.usda",
            "scene_copy": "",
            "first": scene.frames.first,
            "last": scene.frames.last,
            "fps": scene.fps,
            "grids": _grids(scene, output),
            "bodies": scene.bodies(),
            **({"start_from": start.facts()} if start else {}),
        }
        cache = cls(folder, scene, Manifest.new(folder, **facts))
        cache._begin()
        return cache

    def _begin(self) -> None:
        """Folders, the copy of the scene, the clips' manifest: what is there before the first frame."""
        self.manifest.save()  # first of all: from now on the folder is known as a cache
        try:
            for name in ("frames", "checkpoints", *(("vdb",) if self.manifest.data["grids"] else ())):
                (self.folder / name).mkdir(exist_ok=True)
        except OSError as error:
            raise CacheIOError(f"{self.folder}: cannot be created: {error.strerror}") from error
        copy = localize_scene(self.scene.path, self.folder / "scene")
        self.writer.write_manifest_layer()
        self.manifest.data["scene_copy"] = copy.relative_to(self.folder).as_posix()
        self.manifest.save()

    @classmethod
    def resume(
        cls, folder: Path, scene: Scene, output: Output, start: Start | None = None, allow_restart: bool = False
    ) -> Cache:
        """Opens a cache for continuing at its latest intact checkpoint; what came after it is dropped.

        `checkpoint` is that checkpoint's manifest entry, or None when the run must begin again.
        Raises MismatchError when the scene has changed, and unless `allow_restart` where damage would drop finished
        frames; CacheIOError for a damaged manifest.
        """
        manifest = Manifest.load(folder)
        manifest.check_same_scene(scene.hash(), scene.parameters(), scene.frames.first, scene.fps)
        manifest.check_same_start(start.facts() if start else None)
        manifest.check_same_output(output.facts() if output != Output() else None)
        files.remove_leftovers(folder)
        cache = cls(folder, scene, manifest)
        manifest.data["last"] = max(scene.frames.last, manifest.last_frame or scene.frames.last)
        if not cache.is_complete():
            cache.checkpoint = manifest.usable_checkpoint()
            if not allow_restart:
                manifest.check_loss(cache.checkpoint)
            cache._go_back(cache.checkpoint)
        return cache

    @classmethod
    def rebake(
        cls, folder: Path, scene: Scene, overrides: dict[str, str], output: Output, checkpoint: dict[str, Any]
    ) -> Cache:
        """Opens a cache to make the frames after a checkpoint anew (`rebake.find_checkpoint`), with another scene."""
        manifest = Manifest.load(folder)
        files.remove_leftovers(folder)
        rebake.begin_stretch(manifest, checkpoint["frame"], _recipe(scene, overrides, output))
        grids = [name for name in _GRIDS if name in {*manifest.data["grids"], *_grids(scene, output)}]
        manifest.data |= {"grids": grids, "last": scene.frames.last, "scene_copy": ""}
        cache = cls(folder, scene, manifest)
        cache.checkpoint = checkpoint
        cache._go_back(checkpoint)
        return cache

    @property
    def is_foreign(self) -> bool:
        """Whether the checkpoint was made with other parameters than those of the scene."""
        first = self.manifest.data["first"]
        return bool(self.checkpoint) and self.checkpoint["frame"] <= rebake.foreign_until(self.manifest, first)

    def _go_back(self, checkpoint: dict[str, Any] | None) -> None:
        """Drops what came after a checkpoint, None: everything."""
        self.manifest.data["status"] = "running"
        self.manifest.forget_after(checkpoint["frame"] if checkpoint else self.scene.frames.first - 1)
        if not self.manifest.data["scene_copy"]:
            self._begin()
        stats_file.trim(self.folder, checkpoint["time"] if checkpoint else -1.0)

    def is_complete(self) -> bool:
        """All frames of the range are there, intact."""
        return all(not self.manifest.damaged_files(frame) for frame in self.scene.frames)

    def write_frame(
        self, frame: int, simulation: Simulation, surfaces: list[tuple[np.ndarray, np.ndarray]], left: list[str]
    ) -> None:
        """Writes all files of a frame and registers them.

        surfaces: (points, velocities) of scene.simulated; left: paths of the solids that have left the box.
        """
        written = {}
        if self.scene.drawn:
            written[self.writer.frame_name(frame)] = self.writer.write_frame(frame, surfaces)
        if self.manifest.data["grids"]:
            name = self.writer.vdb_name(frame)
            with files.replacing(self.folder / name) as temporary:
                written[name] = simulation.write_vdb(temporary, **self.output.definition(self.scene.space))
        self.manifest.frames[str(frame)] = {
            "time": simulation.time,
            "state": simulation.state_hash(),
            "files": {
                name: {**files.record(self.folder / name), "content": content} for name, content in written.items()
            },
            **({"left": left} if left else {}),
        }
        self._flush_stats()
        self.manifest.save()

    def write_root(self) -> Path:
        """Writes the layer that opens the cache, for the frames that are there. Returns its path."""
        frames = sorted(map(int, self.manifest.frames))
        data = self.manifest.data
        provenance = {key: data[key] for key in ("program", "scene_hash", "parameters", "overrides")}
        volumes = [n for n in frames if self.writer.vdb_name(n) in self.manifest.frames[str(n)]["files"]]
        last = max(frames, default=self.scene.frames.first)
        left = self.manifest.left()
        self.writer.write_root(f"./{data['scene_copy']}", last, volumes, data["grids"], provenance, left)
        return self.folder / f"{self.scene.name}.usda"

    def save_checkpoint(self, frame: int, simulation: Simulation, keep: int | None) -> None:
        """Writes the state after frame `frame` (and maybe some steps) and keeps the last checkpoints, None: all."""
        name = f"checkpoints/{file_number(frame)}.{simulation.steps}.efsi"
        with files.replacing(self.folder / name) as temporary:
            simulation.save_checkpoint(temporary)
        self._flush_stats()
        self.manifest.add_checkpoint(frame, simulation.time, name, keep, self.scene.poses(frame))

    def finish(self, status: str) -> None:
        """Registers how the run ended."""
        self._flush_stats()
        self.manifest.data["status"] = status
        self.manifest.save()

    def add_stats(self, line: dict[str, Any]) -> None:
        """Adds a line to stats.jsonl; it reaches the file with the frame."""
        self._stats.append(line)

    def stats(self) -> list[dict[str, Any]]:
        """The lines of stats.jsonl so far; of a cache that is resumed, those up to its checkpoint."""
        return stats_file.read(self.folder) if (self.folder / stats_file.NAME).is_file() else []

    def set_warnings(self, warnings: list[dict[str, Any]], at_once: bool) -> None:
        """Registers the warnings of the run; at_once: not only with the next frame."""
        self.manifest.data["warnings"] = warnings
        if at_once:
            self.manifest.save()

    def _flush_stats(self) -> None:
        if self._stats:
            stats_file.append(self.folder, self._stats)
            self._stats.clear()


# Grids in the order in which they are listed.
_GRIDS = ("density", "vel", "temperature")


def _grids(scene: Scene, output: Output) -> list[str]:
    """Names of the grids in each volume file; none where nothing emits."""
    if not scene.has_smoke:
        return []
    heated = any(emitter.over_time("temperature").any() for emitter in scene.emitters)
    return ["density", *(["vel"] if output.velocity else []), *(["temperature"] if heated else [])]


def _recipe(scene: Scene, overrides: dict[str, str], output: Output) -> dict[str, Any]:
    """How frames are made, for the manifest."""
    return {
        "program": {"eulerfsi": __version__, "library": binding.library_version()},
        "scene_hash": scene.hash(),
        "parameters": scene.parameters(),
        "overrides": overrides,
        "output": output.facts(),
    }


def prepare(folder: Path, overwrite: bool, resume: bool, rebake_from: int | None = None) -> str:
    """Decides what becomes of the output folder: "new", "resume" or "rebake". Removes nothing yet.

    Raises UsageError for a cache without --overwrite, --resume or --rebake-from, for a folder with other things in it,
    and for --rebake-from without a cache.
    """
    if rebake_from is not None:
        if not (folder / FILE_NAME).is_file():
            raise UsageError(f"--rebake-from {rebake_from}: {folder} contains no cache")
        return "rebake"
    if (folder / FILE_NAME).is_file():
        if resume:
            return "resume"
        if not overwrite:
            raise UsageError(
                f"{folder}: already contains a cache; continue it with --resume or replace it with --overwrite"
            )
        Manifest.load(folder)  # only a folder that is ours is ever replaced
        return "new"
    if folder.is_dir() and any(path.name != LOCK for path in folder.iterdir()):
        raise UsageError(f"{folder}: is not empty and contains no cache; choose another folder with -o")
    return "new"


def remove_old(folder: Path) -> None:
    """Removes what a cache consists of, nothing else. Raises CacheIOError."""
    if not (folder / FILE_NAME).is_file():
        return
    root = Manifest.load(folder).data["scene"]
    try:
        for name in (*_FILES, root):
            (folder / name).unlink(missing_ok=True)
        for name in _FOLDERS:
            if (folder / name).is_dir():
                shutil.rmtree(folder / name)
    except OSError as error:
        raise CacheIOError(f"{folder}: the old cache cannot be removed: {error.strerror}") from error
