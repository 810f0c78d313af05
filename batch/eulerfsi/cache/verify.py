"""What of a cache is missing, truncated or changed, file by file: `verify`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom

from .. import files
from ..errors import LibraryError
from ..reasons import usd_reason
from ..solver import binding
from ..solver.volume_file import VolumeFile
from ..system import format_bytes
from ..usd_messages import composition_faults
from . import pictures, stats_file
from .lock import LOCK, is_held
from .manifest import COPY, FILE_NAME, Manifest

_OTHERS = {FILE_NAME, COPY, LOCK, stats_file.NAME, "log", pictures.PREVIEW}
_PICTURES = (pictures.FOLDER, pictures.EARLIER_FOLDER)
_SLAB = 1 << 24  # values of a grid that are in memory at a time


@dataclasses.dataclass
class Verified:
    """What was found. damaged: (relative file, what is wrong); left_over: temporary files of runs that were killed;
    unknown: files that no run has written."""

    manifest: Manifest
    status: str
    deep: bool
    count: int
    size: int
    damaged: list[tuple[str, str]]
    left_over: list[str]
    unknown: list[str]

    @property
    def missing(self) -> list[int]:
        """Frames of the range that are not there yet."""
        data = self.manifest.data
        return [frame for frame in range(data["first"], data["last"] + 1) if str(frame) not in self.manifest.frames]

    def lines(self) -> list[str]:
        """For people."""
        data = self.manifest.data
        told = [
            f"{self.manifest.folder}: cache of {data['scene']}, {self.status}: {len(self.manifest.frames)} frames of "
            f"{data['first']}-{data['last']}, {self.count} files, {format_bytes(self.size)}"
        ]
        told += [f"{name}: {fault}" for name, fault in self.damaged]
        told += [f"{name}: left by a run that was killed; --resume removes it" for name in self.left_over]
        told += [f"{name}: is no file of this cache" for name in self.unknown]
        if not self.damaged:
            how = "all files are as they were written"
            told.append(f"{how}, every grid and every mesh can be read" if self.deep else how)
        return told

    def facts(self) -> dict[str, Any]:
        """For programs."""
        data = self.manifest.data
        return {
            "folder": str(self.manifest.folder),
            **{key: data[key] for key in ("scene_hash", "first", "last")},
            "status": self.status,
            "deep": self.deep,
            "frames": len(self.manifest.frames),
            "missing_frames": self.missing,
            "files": self.count,
            "bytes": self.size,
            "damaged": [{"file": name, "fault": fault} for name, fault in self.damaged],
            "left_over": self.left_over,
            "unknown": self.unknown,
        }


def verify(folder: Path, deep: bool = False) -> Verified:
    """Looks at every file of a cache; deep: reads every grid and every mesh back.

    Raises SceneError for a folder that is no cache, CacheIOError for a damaged manifest.
    """
    manifest = Manifest.load(folder)
    known = dict(manifest.recorded())
    damaged = damage(manifest)
    if deep:
        broken = {name for name, _ in damaged}
        damaged += [fault for fault in _read_all(manifest) if fault[0] not in broken]
    held = is_held(folder)
    left = [] if held else files.leftovers(folder)
    return Verified(
        manifest,
        status(manifest),
        deep,
        len(known),
        sum(facts["bytes"] for facts in known.values()),
        damaged,
        [path.relative_to(folder).as_posix() for path in left],
        [] if held else unknown_files(manifest),
    )


def unknown_files(manifest: Manifest) -> list[str]:
    """Files in the folder that no run has written, temporary ones and those of the flip-book left out."""
    known = {name for name, _ in manifest.recorded()} | _OTHERS | {manifest.data["scene"]}
    found = (path.relative_to(manifest.folder) for path in manifest.folder.rglob("*") if not path.is_dir())
    return sorted(
        path.as_posix()
        for path in found
        if path.as_posix() not in known and path.parts[0] not in _PICTURES and files.TEMPORARY_PREFIX not in path.name
    )


def status(manifest: Manifest) -> str:
    """How the last run of a cache has ended; the manifest of one that was killed says for ever that it is running."""
    found = manifest.data["status"]
    return "stopped" if found == "running" and not is_held(manifest.folder) else found


def damage(manifest: Manifest) -> list[tuple[str, str]]:
    """(relative file, what is wrong) of every file that is not as it was written."""
    found = [(name, fault) for name, facts in manifest.recorded() if (fault := manifest.fault(name, facts))]
    whole = manifest.data.get("stats")
    parts = [whole] if whole else [checkpoint["stats"] for checkpoint in manifest.data["checkpoints"][-1:]]
    faults = [stats_file.fault(manifest.folder, part, whole is not None) for part in parts]
    return found + [(stats_file.NAME, fault) for fault in faults if fault]


def _read_all(manifest: Manifest) -> Iterator[tuple[str, str]]:
    """Faults of files that cannot be read, or hold what no run writes."""
    folder, data = manifest.folder, manifest.data
    yield from ((stats_file.NAME, fault) for fault in stats_file.faults(folder))
    root = folder / data["scene"]
    stage = None
    if manifest.frames:
        try:
            stage = Usd.Stage.Open(str(root))
        except (Tf.ErrorException, UnicodeDecodeError) as error:
            yield data["scene"], f"cannot be opened: {usd_reason(error)}"
    if stage:
        yield from ((data["scene"], text) for text, _ in composition_faults(stage))
    for frame in sorted(map(int, manifest.frames)):
        for name in manifest.frames[str(frame)]["files"]:
            if not (folder / name).is_file():
                continue
            reading = _read_volume(folder / name) if name.endswith(".vdb") else _read_layer(folder / name, frame, stage)
            yield from ((name, fault) for fault in reading)


def _read_volume(path: Path) -> Iterator[str]:
    """Faults of the grids of a .vdb file."""
    try:
        with VolumeFile(path) as volume:
            for name in ("density", "vel", "temperature"):
                yield from _read_grid(volume, name)
    except LibraryError as error:
        yield str(error).removeprefix(f"{path}: ")


def _read_grid(volume: VolumeFile, name: str) -> Iterator[str]:
    try:
        grid = volume.grid(name)
    except LibraryError as error:
        if error.status == binding.ERROR_ARGUMENT:
            return  # it was not asked for
        raise
    if not grid["active_count"]:
        return
    size, low = grid["size"], grid["min"]
    thick = max(1, _SLAB // int(size[0] * size[1] * grid["components"]))
    for first in range(0, int(size[2]), thick):
        cells = np.array([size[0], size[1], min(thick, size[2] - first)])
        if not np.isfinite(volume.read(name, low + np.array([0, 0, first]), cells)).all():
            yield f"grid {name} holds values that are no numbers"
            return


def _read_layer(path: Path, frame: int, stage: Usd.Stage | None) -> Iterator[str]:
    """Faults of what a frame's layer holds. stage: the cache's own, which the points must fit; None: not known."""
    try:
        layer = Sdf.Layer.OpenAsAnonymous(str(path))
        for prim in _prims(layer):
            values = {}
            for spec in prim.properties:
                value = layer.QueryTimeSample(spec.path, frame)
                values[spec.name] = None if value is None else np.asarray(value)
                if value is None or not np.isfinite(values[spec.name]).all():
                    yield f"{spec.path}: holds no value, or values that are no numbers"
            if values.get("points") is not None and stage:
                yield from _compare(stage, str(prim.path), frame, values)
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        yield f"cannot be read: {usd_reason(error)}"


def _prims(layer: Sdf.Layer) -> list[Sdf.PrimSpec]:
    """All prims with attributes."""
    found: list[Sdf.PrimSpec] = []

    def look(path: Sdf.Path) -> None:
        if path.IsPrimPath() and (prim := layer.GetPrimAtPath(path)) and prim.properties:
            found.append(prim)

    layer.Traverse(Sdf.Path.absoluteRootPath, look)
    return found


def _compare(stage: Usd.Stage, path: str, frame: int, values: dict[str, np.ndarray]) -> Iterator[str]:
    """Faults of a mesh: as many velocities as points, faces that have their points, and the stage shows them."""
    points = values["points"]
    if len(values["velocities"]) != len(points):
        yield f"{path}: {len(points)} points but {len(values['velocities'])} velocities"
    prim = stage.GetPrimAtPath(path)
    if not prim or not prim.IsA(UsdGeom.PointBased):
        yield f"{path}: the cache has no such shape"
        return
    shown = np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get(frame))
    if shown.tobytes() != points.tobytes():
        yield f"{path}: the cache does not show the points of this frame"
    indices = UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get(frame) if prim.IsA(UsdGeom.Mesh) else None
    if indices and max(indices) >= len(points):
        yield f"{path}: a face has point {max(indices)} of {len(points)}"
