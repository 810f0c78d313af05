"""manifest.json: what a cache holds, and how a run that stopped is taken up again."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from .. import files
from ..errors import CacheIOError, MismatchError, SceneError
from ..scene.shown import kind_of, row_of, shown
from . import stats_file

FILE_NAME = "manifest.json"
COPY = "manifest.backup.json"  # as of the last checkpoint, or of the end of the run
_FORMAT, _VERSION = "eulerfsi-cache", 2
_CHECKSUM = "checksum"  # of all else in the file


class Manifest:
    """The manifest of one cache folder; `data` is the JSON object. `save` replaces the file.

    data["frames"]["12"]: {"time", "state", "files": {relative path: {"bytes", "sha256", "content"}}}; once solids
    have left the box also "left": their paths.
    data["checkpoints"]: [{"frame", "time", "file", "bytes", "sha256", "poses", "stats"}], oldest first; "frame" is the
    last frame that is complete at that time, "poses" as Scene.poses gives them for it, "stats" the extent of
    stats.jsonl up to it (stats_file.Extent). One of a run that was stopped between regular ones has "stopped": contacts
    of the frame so far; it goes with the next regular one.
    data["files"]: {relative path: {"bytes", "sha256"}} of the copied scene and the clips' manifest; once the run has
    ended also of the layer that opens the cache.
    data["stats"]: the extent of stats.jsonl when the last run ended; absent while one goes on, or was killed.
    data["bodies"], data["starts"]: as Scene.bodies and Scene.starts give them; data["output"]: as Output has it.
    data["stretches"]: of a cache that was made anew in part (cache.rebake).
    data["warnings"]: what run.watch.Watch has found in the run so far, up to the last frame; absent before 0.2.0.
    """

    def __init__(self, folder: Path, data: dict[str, Any]) -> None:
        self.folder = folder
        self.data = data
        self._faults: dict[tuple[str, str], str] = {}

    @classmethod
    def new(cls, folder: Path, **facts: Any) -> Manifest:
        """A manifest without frames. facts: scene, scene_hash, parameters, first, last, fps, versions."""
        return cls(
            folder,
            {
                "format": _FORMAT,
                "version": _VERSION,
                "status": "running",
                **facts,
                "files": {},
                "frames": {},
                "checkpoints": [],
            },
        )

    @classmethod
    def load(cls, folder: Path) -> Manifest:
        """Raises SceneError for a folder that is no cache, CacheIOError that names the file and the fault."""
        path = folder / FILE_NAME
        if not path.exists() and (folder / COPY).is_file():
            raise CacheIOError(f"{path}: is missing")
        return cls._read(folder, path)

    @classmethod
    def recover(cls, folder: Path, warn: Callable[[str], None]) -> Manifest:
        """The manifest, or where it is damaged its copy as of the last checkpoint; warn: learns of that."""
        try:
            return cls.load(folder)
        except CacheIOError as error:
            if not (folder / COPY).is_file():
                raise
            warn(f"{error}; its copy {COPY} takes its place")
        return cls._read(folder, folder / COPY)

    @classmethod
    def _read(cls, folder: Path, path: Path) -> Manifest:
        try:
            what = "the manifest of a cache that this version reads"
            data = files.read_tagged(path, what, format=_FORMAT, version=_VERSION)
        except (FileNotFoundError, NotADirectoryError) as error:
            raise SceneError(f"{folder}: {_no_cache(folder)}") from error
        except OSError as error:
            raise CacheIOError(f"{path}: {error.strerror}") from error
        except ValueError as error:
            raise CacheIOError(f"{path}: {error}") from error
        if data.pop(_CHECKSUM, None) != _checksum(data):
            raise CacheIOError(f"{path}: is damaged: its checksum is another one")
        return cls(folder, data)

    @property
    def frames(self) -> dict[str, dict[str, Any]]:
        """Completed frames by number."""
        return self.data["frames"]

    @property
    def last_frame(self) -> int | None:
        """Last completed frame, None when there is none."""
        return max(map(int, self.frames), default=None)

    def left(self) -> dict[str, int]:
        """Paths of the solids that have left the box, with the first frame in which they had."""
        first: dict[str, int] = {}
        for frame in sorted(map(int, self.frames)):
            for path in self.frames[str(frame)].get("left", ()):
                first.setdefault(path, frame)
        return first

    def save(self) -> None:
        """Writes the file."""
        self._faults.clear()
        files.write_text(self.folder / FILE_NAME, self._text())

    def _text(self) -> str:
        return json.dumps({**self.data, _CHECKSUM: _checksum(self.data)}, indent=1) + "\n"

    def check_same_scene(self, scene_hash: str, parameters: dict[str, dict[str, Any]], first: int, fps: float) -> None:
        """Raises MismatchError that names the parameter (or the geometry) which differs from the cache's."""
        starts = (("first", "first frame (--start-frame)", first), ("fps", "frame rate", fps))
        if scene_hash == self.data["scene_hash"]:
            return
        found = changes(self.data["parameters"], parameters)
        texts = [str(change) for change in found]
        texts += [
            f"the {name} was {self.data[key]:g}, is {now:g}" for key, name, now in starts if self.data[key] != now
        ]
        what = "; ".join(texts[:5]) or "a mesh"
        text = f"{self.folder}: cannot resume, the scene has changed since the cache was started: {what}"
        raise MismatchError(text, prim=found[0].prim if found else "", field=found[0].attribute if found else "")

    def check_same_start(self, start: dict[str, Any] | None) -> None:
        """Raises MismatchError for another `--start-from` than the cache's, and none where the run must begin again."""
        before = self.data.get("start_from")
        if start == before or (start is None and self.usable_checkpoint()):
            return
        was = f"from frame {before['frame']} of another cache" if before else "without --start-from"
        raise MismatchError(f"{self.folder}: cannot resume, it was started {was}: give the same option")

    def check_same_output(self, output: dict[str, Any] | None) -> None:
        """Raises MismatchError for other options of the output than the cache's; None: the cache's."""
        before = self.data.get("output", output)
        if output in (None, before):
            return
        name = next(key for key in output if output[key] != before.get(key))
        raise MismatchError(
            f"{self.folder}: cannot resume, the cache was started with another output: {name} was {before.get(name)}, "
            f"is {output[name]}"
        )

    def damaged_files(self, frame: int) -> list[str]:
        """Files of a frame that are missing or differ from what was written."""
        entry = self.frames.get(str(frame))
        if entry is None:
            return [f"frame {frame}"]
        return [name for name, facts in entry["files"].items() if not self.intact(name, facts)]

    def recorded(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """(relative name, its record) of every file that the manifest knows."""
        yield from self.data.get("files", {}).items()
        for frame in sorted(map(int, self.frames)):
            yield from self.frames[str(frame)]["files"].items()
        for checkpoint in self.data["checkpoints"]:
            yield checkpoint["file"], checkpoint

    def fault(self, name: str, facts: dict[str, Any]) -> str:
        """What is wrong with a file, a relative name; "" where it is as it was written. Read once until `save`."""
        key = (name, facts["sha256"])
        if key not in self._faults:
            self._faults[key] = files.fault(self.folder / name, facts)
        return self._faults[key]

    def intact(self, name: str, facts: dict[str, Any]) -> bool:
        """Whether a file, a relative name, is as it was written."""
        return not self.fault(name, facts)

    def intact_checkpoint(self, checkpoint: dict[str, Any]) -> bool:
        """Whether the file of a checkpoint, and the statistics up to it, are as they were written."""
        return self.intact(checkpoint["file"], checkpoint) and self.intact_stats(checkpoint)

    def intact_stats(self, checkpoint: dict[str, Any]) -> bool:
        """Whether stats.jsonl up to a checkpoint is as it was written."""
        return not stats_file.fault(self.folder, checkpoint["stats"])

    def usable_checkpoint(self) -> dict[str, Any] | None:
        """The latest checkpoint that is intact, as are all frames and the statistics up to it."""
        first = self.data["first"]
        good_until, frame = first - 1, first
        while self.frames.get(str(frame)) and not self.damaged_files(frame):
            good_until, frame = frame, frame + 1
        for checkpoint in reversed(self.data["checkpoints"]):
            if checkpoint["frame"] <= good_until and self.intact_checkpoint(checkpoint):
                return checkpoint
        return None

    def whole_checkpoints(self, frame: int | None = None) -> list[dict[str, Any]]:
        """Checkpoints at the end of a frame, of this one or of any; one that a signal has left may lie between two."""
        first, fps = self.data["first"], self.data["fps"]
        whole = [c for c in self.data["checkpoints"] if abs(c["time"] * fps - (c["frame"] - first)) < 1e-6]
        return [checkpoint for checkpoint in whole if frame in (None, checkpoint["frame"])]

    def check_loss(self, checkpoint: dict[str, Any] | None) -> None:
        """Raises MismatchError where damage is why a run goes on at `checkpoint`, and finished frames would be lost."""
        kept = self.data["checkpoints"]
        if not kept or checkpoint == kept[-1]:
            return
        frame = checkpoint["frame"] if checkpoint else self.data["first"] - 1
        later = sorted(number for number in map(int, self.frames) if number > frame)
        damaged = [number for number in later if self.damaged_files(number)]
        lost = len(later) - len(damaged)
        if lost:
            what = f"frame {damaged[0]}" if damaged else "the last checkpoint"
            if not damaged and not self.intact_stats(kept[-1]):
                what = stats_file.NAME
            count = f"{lost} finished frame{'s' if lost > 1 else ''}"
            where = f"after frame {frame}" if checkpoint else "from the first frame"
            raise MismatchError(
                f"{self.folder}: {what} is damaged: --resume would drop {count} and continue {where}; "
                "--allow-restart accepts that"
            )

    def forget_after(self, frame: int) -> None:
        """Drops all frames and checkpoints after a frame: first from the manifest, which is saved, then their files."""
        names = [name for n in list(self.frames) if int(n) > frame for name in self.frames.pop(n)["files"]]
        names += [c["file"] for c in self.data["checkpoints"] if c["frame"] > frame]
        self.data["checkpoints"] = [c for c in self.data["checkpoints"] if c["frame"] <= frame]
        self.save()
        for name in names:
            (self.folder / name).unlink(missing_ok=True)

    def add_checkpoint(self, name: str, keep: int | None, facts: dict[str, Any]) -> None:
        """Registers a checkpoint file (relative name) and removes the oldest regular ones beyond `keep`, None: none.

        facts: the rest of its entry. One of a run that was stopped stays until the next one.
        """
        before = self.data["checkpoints"]
        regular = [c for c in before if c["file"] != name and "stopped" not in c]
        new = {"file": name, **facts, **files.record(self.folder / name)}
        kept = [*regular, new]
        if keep is not None and "stopped" not in new:
            kept = kept[-keep:]
        self.data["checkpoints"] = kept
        self.save()
        self.save_copy()
        for checkpoint in before:
            if all(checkpoint["file"] != one["file"] for one in kept):
                (self.folder / checkpoint["file"]).unlink(missing_ok=True)

    def save_copy(self) -> None:
        """Writes the copy that `recover` reads."""
        files.write_text(self.folder / COPY, self._text())


def _no_cache(folder: Path) -> str:
    """Why a folder without a manifest is no cache."""
    if not folder.exists():
        return "no such folder"
    if not folder.is_dir():
        return "is a file: must be the folder of a cache"
    inside = sorted(path.parent.name for path in folder.glob(f"*/{FILE_NAME}"))
    hint = f"; {len(inside)} of its folders have one, the first is {inside[0]}" if inside else ""
    return f"is not a cache of eulerfsi: it has no {FILE_NAME}{hint}"


def _checksum(data: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data).encode()).hexdigest()


@dataclasses.dataclass(frozen=True)
class Change:
    """A difference of two scenes. field: of the C definition, "" where the prim itself has come or gone; attribute: of
    the stage, "" where there is none."""

    prim: str
    field: str
    attribute: str
    text: str

    def __str__(self) -> str:
        return f"{self.prim}: {self.text}" if self.field else f"{self.prim} {self.text}"


def changes(before: dict[str, dict[str, Any]], now: dict[str, dict[str, Any]]) -> list[Change]:
    """What differs between the parameters of two scenes, as Scene.parameters gives them."""
    result = []
    for path in sorted({*before, *now}):
        if path not in before or path not in now:
            result.append(Change(path, "", "", f"is {'new' if path in now else 'gone'}"))
            continue
        old, new = before[path], now[path]
        result += [_change(path, key, old, new) for key in sorted({*old, *new}) if old.get(key) != new.get(key)]
    return result


def _change(path: str, key: str, old: dict[str, Any], new: dict[str, Any]) -> Change:
    kind = kind_of(new)
    row = row_of(kind, key)
    was, now = (shown(kind, key, values[key]) if key in values else [(key, "none")] for values in (old, new))
    pairs = [(name, a, b) for (name, a), (_, b) in zip(was, now, strict=False) if a != b]
    name, a, b = pairs[0] if pairs else (key, old.get(key), new.get(key))
    return Change(path, key, row.attribute if row else "", f"{name} was {a}, is {b}")
