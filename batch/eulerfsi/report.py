"""`validate` and `info`: what a scene or a cache is, without simulating."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from . import __version__, binding, checks, memory
from .errors import EulerFsiError, SceneError
from .frames import FrameRange, parse_frames
from .manifest import FILE_NAME, Manifest
from .overrides import apply_overrides
from .scene import Scene, open_stage, read_scene, stage_frames
from .system import available_memory, available_threads, format_bytes

# Processor seconds per cell and step of the ball, from `bench speed` (voxel 0.005, 2 threads), and per frame written.
_SECONDS_PER_CELL_STEP = {"production": 2.6e-7, "paper2016": 6.6e-7}
_SECONDS_PER_FRAME = 0.03


def validate(path: Path, frames_text: str | None, settings: list[str], threads: int | None) -> list[str]:
    """Lines of the report. Raises SceneError with all faults, UsageError for options."""
    frames = parse_frames(frames_text) if frames_text else None
    stage = open_stage(path)
    apply_overrides(stage, settings)
    warnings = checks.raise_errors(checks.stage_issues(stage))
    limit = available_memory()
    scene = read_scene(stage, path, frames, limit, threads)
    warnings += scene.warnings + checks.raise_errors(checks.check_scene(scene))
    lines = [*describe_scene(scene), *(f"warning: {text}" for text in dict.fromkeys(warnings))]
    need, _ = memory.estimate(scene.domain, [solid.mesh for solid in scene.solids], limit)
    lines.append(f"memory: about {format_bytes(need)} of {format_bytes(limit)} available")
    lines.append(time_estimate(scene, threads or available_threads()))
    lines.append("the scene can be simulated")
    return lines


def describe_scene(scene: Scene) -> list[str]:
    """Domain, solids and emitters, one a line, in SI."""
    cells = np.ceil(np.array(scene.domain["domain_size"]) / scene.domain["voxel_size"] - 1e-6).astype(int)
    size = " x ".join(f"{edge:.4g}" for edge in scene.domain["domain_size"])
    gravity = ", ".join(f"{g:.4g}" for g in scene.domain["gravity"])
    lines = [
        f"{scene.path.name}: frames {scene.frames} at {scene.fps:g} per second, "
        f"{scene.units.meters_per_unit:g} m per unit",
        f"{scene.domain_path}: domain {size} m, voxel {scene.domain['voxel_size']:.4g} m, "
        f"{' x '.join(map(str, cells))} = {cells.prod():,} cells, gravity ({gravity}) m/s^2",
    ]
    for solid in scene.solids:
        v, report = solid.values, solid.report
        lines.append(
            f"{solid.path}: solid, {report['triangles']:,} triangles, volume {report['solid_volume']:.4g} m^3, "
            f"density {v['density']:.4g} kg/m^3, E {v['youngs_modulus']:.4g} Pa, nu {v['poissons_ratio']:.3g}, "
            f"thinnest feature {report['thinnest_feature']:.3g} m"
        )
    for emitter in scene.emitters:
        mode = next(name for name, number in binding.EMITTER_MODES.items() if number == emitter.values["mode"])
        lines.append(f"{emitter.path}: {mode} emitter, smoke density {emitter.values['density']:g}")
    return lines


def time_estimate(scene: Scene, threads: int) -> str:
    """A rough guess from the number of cells and the steps that the start speeds and gravity ask for."""
    h, frame = scene.domain["voxel_size"], 1 / scene.fps
    duration = (len(scene.frames) - 1) * frame
    start = max((float(np.abs(s.values["velocity"]).max()) for s in scene.solids), default=0.0)
    fall = float(np.sqrt(np.sum(np.square(scene.domain["gravity"]))))
    # Nothing falls farther than the box is high.
    height = float(max(scene.domain["domain_size"]))
    speed = start + min(fall * duration, (2 * fall * height) ** 0.5) / 2 if scene.solids else 0.0
    # Impacts and rebounds slow a solid down: half of that speed is the mean of a run.
    steps = max(1.0, speed / 2 * frame / (scene.domain["cfl_solid"] * h))
    cells = float(np.prod(np.array(scene.domain["domain_size"]) / h))
    preset = next(name for name, number in binding.PRESETS.items() if number == scene.domain["preset"])
    seconds = cells * steps * _SECONDS_PER_CELL_STEP[preset] / max(threads, 1) + _SECONDS_PER_FRAME
    total = seconds * (len(scene.frames) - 1)
    whole = f"{total:.2g} s" if total < 99.5 else f"{total / 60:.2g} min"
    return f"time: very roughly {seconds:.2g} s per frame ({steps:.0f} steps), {whole} for all, on {threads} threads"


def info(path: Path | None) -> list[str]:
    """About the program, a cache folder or a scene."""
    if path is None:
        lines = [
            f"eulerfsi {__version__}",
            f"threads: {available_threads()}",
            f"memory: {format_bytes(available_memory())}",
        ]
        try:
            lines.insert(1, f"library {binding.library_version()}: {binding.library().efsi_path}")
        except EulerFsiError as error:
            lines.insert(1, f"library: {error}")
        return lines
    if path.is_dir() or path.name == FILE_NAME:
        return _cache_info(Manifest.load(path if path.is_dir() else path.parent))
    stage = open_stage(path)
    checks.raise_errors(checks.stage_issues(stage))
    frames = stage_frames(stage) if stage.HasAuthoredTimeCodeRange() else FrameRange(1, 2)
    return describe_scene(read_scene(stage, path, frames))


def _cache_info(manifest: Manifest) -> list[str]:
    data: dict[str, Any] = manifest.data
    files = [facts for frame in manifest.frames.values() for facts in frame["files"].values()]
    lines = [
        f"{manifest.folder}: cache of {data['scene']}, {data['status']}, eulerfsi {data['program']['eulerfsi']}",
        f"frames: {len(manifest.frames)} of {data['first']}-{data['last']} at {data['fps']:g} per second, "
        f"{format_bytes(sum(facts['bytes'] for facts in files))}",
        f"grids: {', '.join(data['grids']) or 'none'}",
        f"checkpoints: {', '.join(str(c['frame']) for c in data['checkpoints']) or 'none'}",
        f"scene hash: {data['scene_hash']}",
    ]
    damaged = [str(frame) for frame in manifest.frames if manifest.damaged_files(int(frame))]
    if damaged:
        raise SceneError("\n".join([*lines, f"damaged or missing frames: {', '.join(damaged)}"]))
    lines += [f"{path}: {json.dumps(values)}" for path, values in data["parameters"].items()]
    return lines
