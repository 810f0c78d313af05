"""The cache folder: made new, taken up again or refused; frames, volumes, statistics and checkpoints go in.

Layout: <scene>.usda, scene/ (copy of the scene), frames/, vdb/, checkpoints/, manifest.json, stats.jsonl, log,
preview.png, with --flipbook flipbook/. Every file appears whole, and the folder can be moved.
"""

from __future__ import annotations

import glob
import shutil
from collections.abc import Callable
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
from .manifest import COPY, FILE_NAME, Manifest
from .output import Output
from .start_from import Start
from .usd_writer import UsdWriter
from .verify import damage

_FOLDERS = ("frames", "vdb", "checkpoints", "scene", pictures.FOLDER, pictures.EARLIER_FOLDER)
_FILES = (stats_file.NAME, "log", pictures.PREVIEW)


class Cache:
    """One cache folder that a run writes to.

    checkpoint: manifest entry that a resumed run starts from, or None; complete: there is nothing to do.
    """

    def __init__(self, folder: Path, scene: Scene, manifest: Manifest) -> None:
        self.folder = folder
        self.scene = scene
        self.manifest = manifest
        self.writer = UsdWriter(folder, scene)
        self.checkpoint: dict[str, Any] | None = None
        self.complete = False
        self.output = Output.of(manifest.data.get("output"))
        self._stats: list[dict[str, Any]] = []
        self._extent = stats_file.Extent()

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
            "starts": scene.starts(),
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
        around = [self.folder / self.writer.manifest_name, *sorted((self.folder / "scene").rglob("*"))]
        self.manifest.data["files"] = {
            path.relative_to(self.folder).as_posix(): files.record(path) for path in around if path.is_file()
        }
        self.manifest.save()
        self.manifest.save_copy()

    @classmethod
    def resume(
        cls,
        folder: Path,
        scene: Scene,
        output: Output,
        start: Start | None = None,
        allow_restart: bool = False,
        warn: Callable[[str], None] = lambda _text: None,
    ) -> Cache:
        """Opens a cache for continuing at its latest intact checkpoint; what came after it is dropped.

        `checkpoint` is that checkpoint's manifest entry, or None when the run must begin again; warn: learns of every
        file that is damaged. Raises MismatchError when the scene has changed, and unless `allow_restart` where damage
        would drop finished frames; unless `allow_restart` CacheIOError for a damaged manifest.
        """
        manifest = open_manifest(folder, allow_restart, warn)
        manifest.check_same_scene(scene.hash(), scene.parameters(), scene.frames.first, scene.fps)
        manifest.check_same_start(start.facts() if start else None)
        manifest.check_same_output(output.facts() if output != Output() else None)
        files.remove_leftovers(folder)
        cache = cls(folder, scene, manifest)
        manifest.data["last"] = max(scene.frames.last, manifest.last_frame or scene.frames.last)
        usable = manifest.usable_checkpoint()
        cache.complete = cache.is_complete() and (not allow_restart or usable == manifest.data["checkpoints"][-1])
        if not cache.complete and not allow_restart:
            manifest.check_loss(usable)
        for name, fault in damage(manifest):
            warn(f"{folder / name}: {fault}")
        if not cache.complete:
            cache.checkpoint = usable
            cache._go_back(usable)
            return cache
        if not cache._is_copied():
            cache._begin()
        if "stats" not in manifest.data:  # killed after its last checkpoint
            cache._extent = stats_file.go_back(folder, manifest.data["checkpoints"][-1])
        return cache

    def _is_copied(self) -> bool:
        """Whether the copy of the scene is there, as it was made."""
        data = self.manifest.data
        around = {name: facts for name, facts in data.get("files", {}).items() if name != data["scene"]}
        return bool(data["scene_copy"]) and all(self.manifest.intact(name, facts) for name, facts in around.items())

    @classmethod
    def rebake(
        cls, folder: Path, scene: Scene, overrides: dict[str, str], output: Output, checkpoint: dict[str, Any]
    ) -> Cache:
        """Opens a cache to make the frames after a checkpoint anew (`rebake.find_checkpoint`), with another scene."""
        manifest = Manifest.load(folder)
        files.remove_leftovers(folder)
        manifest.data.get("files", {}).clear()
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
        self.manifest.data.pop("stats", None)
        self.manifest.data.get("files", {}).pop(self.manifest.data["scene"], None)
        self.manifest.forget_after(checkpoint["frame"] if checkpoint else self.scene.frames.first - 1)
        self._sweep()
        if not self._is_copied():
            self._begin()
        self._extent = stats_file.go_back(self.folder, checkpoint)

    def _sweep(self) -> None:
        """Removes damaged checkpoints, and files of frames and checkpoints that a killed run has not registered."""
        manifest, name = self.manifest, glob.escape(self.scene.name)
        manifest.data["checkpoints"] = [c for c in manifest.data["checkpoints"] if manifest.intact(c["file"], c)]
        manifest.save()
        known = {file for frame in manifest.frames.values() for file in frame["files"]}
        known |= {checkpoint["file"] for checkpoint in manifest.data["checkpoints"]}
        for pattern in (f"frames/{name}.*.usdc", f"vdb/{name}.*.vdb", "checkpoints/*.efsi"):
            for path in self.folder.glob(pattern):
                if path.relative_to(self.folder).as_posix() not in known:
                    path.unlink(missing_ok=True)

    def is_complete(self) -> bool:
        """All frames of the range are there, intact, and the run has come to its last checkpoint."""
        reached = any(checkpoint["frame"] >= self.scene.frames.last for checkpoint in self.manifest.data["checkpoints"])
        return reached and all(not self.manifest.damaged_files(frame) for frame in self.scene.frames)

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

    def save_checkpoint(
        self, frame: int, simulation: Simulation, keep: int | None, stopped: dict[str, Any] | None = None
    ) -> None:
        """Writes the state after frame `frame` (and maybe some steps) and keeps the last checkpoints, None: all.

        stopped: of a run that stops here, between regular checkpoints: contacts of the frame so far.
        """
        name = f"checkpoints/{file_number(frame)}.{simulation.steps}.efsi"
        regular = [c["file"] for c in self.manifest.data["checkpoints"] if "stopped" not in c]
        if stopped is not None and name in regular:
            return  # nothing has happened since that one
        with files.replacing(self.folder / name) as temporary:
            simulation.save_checkpoint(temporary)
        self._flush_stats()
        facts = {"frame": frame, "time": simulation.time, "poses": self.scene.poses(frame)}
        facts["stats"] = self._extent.facts()
        self.manifest.add_checkpoint(name, keep, facts if stopped is None else {**facts, "stopped": stopped})
        self.write_root()

    def finish(self, status: str) -> None:
        """Writes the layer that opens the cache, for the frames that are there, and registers how the run ended."""
        self._flush_stats()
        data = self.manifest.data
        if self.manifest.frames:
            data.setdefault("files", {})[data["scene"]] = files.record(self.write_root())
        data["status"] = status
        if not self.complete or "stats" not in data:
            data["stats"] = self._extent.facts()
        self.manifest.save()
        self.manifest.save_copy()

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
            stats_file.append(self.folder, self._stats, self._extent)
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

    Raises UsageError for a cache without --overwrite, --resume or --rebake-from, and for --rebake-from without a cache.
    """
    if rebake_from is not None:
        if not is_cache(folder):
            raise UsageError(f"--rebake-from {rebake_from}: {folder} contains no cache")
        return "rebake"
    if is_cache(folder):
        if resume:
            return "resume"
        if not overwrite:
            raise UsageError(
                f"{folder}: already contains a cache; continue it with --resume or replace it with --overwrite"
            )
        Manifest.load(folder)  # only a folder that is ours is ever replaced
        return "new"
    return "new"


def is_cache(folder: Path) -> bool:
    """Whether the folder is a cache, damaged maybe."""
    return (folder / FILE_NAME).is_file() or (folder / COPY).is_file()


def open_manifest(folder: Path, allow_restart: bool, warn: Callable[[str], None] = lambda _text: None) -> Manifest:
    """The manifest of a cache that is resumed. Raises CacheIOError where it is damaged, unless `allow_restart`."""
    if allow_restart:
        return Manifest.recover(folder, warn)
    try:
        return Manifest.load(folder)
    except CacheIOError as error:
        if not (folder / COPY).is_file():
            raise
        raise CacheIOError(f"{error}; --resume --allow-restart goes on at the last checkpoint") from error


def check_ours(folder: Path) -> None:
    """Raises UsageError for a folder that holds other things than a cache."""
    if not folder.is_dir() or is_cache(folder):
        return
    if any(path.name != LOCK and not path.name.startswith(files.TEMPORARY_PREFIX) for path in folder.iterdir()):
        raise UsageError(f"{folder}: is not empty and contains no cache; choose another folder with -o")


def size(folder: Path) -> int:
    """Bytes of what `remove_old` removes, but for the few of single files."""
    return sum(path.stat().st_size for name in _FOLDERS for path in (folder / name).rglob("*") if path.is_file())


def remove_old(folder: Path) -> None:
    """Removes what a cache consists of, nothing else. Raises CacheIOError."""
    if not (folder / FILE_NAME).is_file():
        return
    root = Manifest.load(folder).data["scene"]
    try:
        for name in _FOLDERS:
            if (folder / name).is_dir():
                shutil.rmtree(folder / name)
        for name in (*_FILES, root, COPY, FILE_NAME):  # the manifest last: as long as it is there the folder is a cache
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise CacheIOError(f"{folder}: the old cache cannot be removed: {error.strerror}") from error
