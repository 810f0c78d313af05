"""`info`: what the program, a cache or a scene is, without simulating."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from .. import __version__
from ..cache.manifest import FILE_NAME, Manifest, changes
from ..cache.verify import status as status_of
from ..errors import CacheIOError, EulerFsiError
from ..frames import FrameRange
from ..run.watch import last_text
from ..scene import checks
from ..scene.instancers import expand_instancers
from ..scene.read import open_stage, read_scene, set_frames
from ..scene.shown import parameter_rows
from ..solver import binding
from ..system import available_memory, available_threads, format_bytes
from .report import describe_scene, scene_facts


@dataclasses.dataclass
class Info:
    """What there is to tell. damage: why it is not whole, None where it is."""

    lines: list[str]
    facts: dict[str, Any]
    damage: CacheIOError | None = None


def info(path: Path | None) -> Info:
    """About the program, a cache folder or a scene. Raises SceneError for a path that is neither."""
    if path is None:
        return _program_info()
    if path.is_dir() or path.name == FILE_NAME:
        return _cache_info(Manifest.load(path if path.is_dir() else path.parent))
    stage = open_stage(path)
    expand_instancers(stage)
    checks.raise_errors(checks.stage_issues(stage))
    if not stage.HasAuthoredTimeCodeRange():
        set_frames(stage, FrameRange(1, 2), None)
    scene = read_scene(stage, path)
    return Info(describe_scene(scene), scene_facts(scene))


def _program_info() -> Info:
    facts = {"program": __version__, "library": None, "library_path": None}
    try:
        facts["library"], facts["library_path"] = binding.library_version(), binding.library().efsi_path
        library = f"library {facts['library']}: {facts['library_path']}"
    except EulerFsiError as error:
        library = f"library: {error}"
    facts |= {"threads": available_threads(), "memory_limit": available_memory()}
    lines = [f"eulerfsi {__version__}", library, f"threads: {facts['threads']}"]
    return Info([*lines, f"memory: {format_bytes(facts['memory_limit'])}"], facts)


def _cache_info(manifest: Manifest) -> Info:
    data: dict[str, Any] = manifest.data
    status = status_of(manifest)
    how, program = "stopped by --strict" if status == "strict" else status, data["program"]["eulerfsi"]
    size = sum(facts["bytes"] for frame in manifest.frames.values() for facts in frame["files"].values())
    damaged = [int(frame) for frame in manifest.frames if manifest.damaged_files(int(frame))]
    checkpoints = [checkpoint["frame"] for checkpoint in data["checkpoints"]]
    lines = [
        f"{manifest.folder}: cache of {data['scene']}, {how}, eulerfsi {program}",
        f"frames: {len(manifest.frames)} of {data['first']}-{data['last']} at {data['fps']:g} per second, "
        f"{format_bytes(size)}",
        f"grids: {', '.join(data['grids']) or 'none'}",
        f"checkpoints: {', '.join(map(str, checkpoints)) or 'none'}",
        f"scene hash: {data['scene_hash']}",
    ]
    warnings = data.get("warnings", [])
    lines += [f"warning: {last_text(warning)}" for warning in warnings]
    facts = {
        "folder": str(manifest.folder),
        "status": status,
        **{key: data[key] for key in ("program", "scene", "scene_hash", "first", "last", "fps", "grids", "parameters")},
        "frames": sorted(map(int, manifest.frames)),
        "bytes": size,
        "checkpoints": checkpoints,
        "damaged": damaged,
        "warnings": warnings,
        "stretches": data.get("stretches", []),
    }
    for stretch in data.get("stretches", []):
        lines.append(f"frames up to {stretch['last']} were made with other values, scene hash {stretch['scene_hash']}:")
        lines += [f"  {change}" for change in changes(stretch["parameters"], data["parameters"])]
    if damaged:
        names = ", ".join(map(str, damaged))
        return Info(lines, facts, CacheIOError(f"{manifest.folder}: damaged or missing frames: {names}"))
    for path, values in data["parameters"].items():
        lines += describe_parameters(path, values)
    return Info(lines, facts)


def describe_parameters(path: str, values: dict[str, Any]) -> list[str]:
    """The prim, then one indented line per value that a run used: name, value with its unit, tokens by name."""
    kind, rows = parameter_rows(values)
    return [f"{path}: {kind}", *(f"  {name:<22} {text}" for name, text in rows)]
