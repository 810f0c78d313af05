"""`validate` and `info`: what a scene or a cache is, without simulating."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..cache.manifest import FILE_NAME, Manifest
from ..errors import EulerFsiError, LibraryError, SceneError
from ..frames import FrameRange, demand_start, parse_frames
from ..parameters import Parameter, table
from ..run import estimate
from ..scene import checks, memory
from ..scene.overrides import apply_overrides
from ..scene.parts import Scene
from ..scene.read import open_stage, read_scene, set_frames
from ..solver import binding
from ..system import available_memory, available_threads, format_bytes

_MOST_LINES = 8  # of passengers of one body


def validate(
    path: Path, frames_text: str | None, start: int | None, settings: list[str], threads: int | None
) -> list[str]:
    """Lines of the report. Raises SceneError with all faults, UsageError for options."""
    frames = parse_frames(frames_text) if frames_text else None
    stage = open_stage(path)
    set_frames(stage, frames, start)
    apply_overrides(stage, settings)
    warnings = checks.raise_errors(checks.stage_issues(stage))
    limit = available_memory()
    scene = read_scene(stage, path, limit, threads)
    if frames:
        demand_start(frames, scene.frames.first, None)
    warnings += scene.warnings + checks.raise_errors(checks.check_scene(scene))
    lines = [*describe_scene(scene), *(f"warning: {text}" for text in dict.fromkeys(warnings))]
    need, _ = memory.estimate(scene.domain, [body.mesh for body in [*scene.solids, *scene.colliders]], limit)
    lines.append(f"memory: about {format_bytes(need)} of {format_bytes(limit)} available")
    lines.append(time_estimate(scene, threads or available_threads(), limit))
    lines.append("the scene can be simulated")
    return lines


def describe_scene(scene: Scene) -> list[str]:
    """Domain, solids, what is given, what rides along, emitters and forces, one a line, in SI."""
    cells = np.ceil(np.array(scene.domain["domain_size"]) / scene.domain["voxel_size"] - 1e-6).astype(int)
    size = " x ".join(f"{edge:.4g}" for edge in scene.domain["domain_size"])
    gravity = ", ".join(f"{g + 0.0:.4g}" for g in scene.domain["gravity"])
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
        if solid.pose:
            lines.append(f"{solid.path}: {solid.pose}")
    lines += _describe_given(scene)
    for emitter in scene.emitters:
        mode = next(name for name, number in binding.EMITTER_MODES.items() if number == emitter.values["mode"])
        text = f"{emitter.path}: {mode} emitter, smoke density {emitter.over_time('density').max():g}"
        if emitter.values["has_velocity"]:
            text += f", velocity {np.linalg.norm(emitter.over_time('velocity'), axis=-1).max():.4g} m/s"
        lines.append(text + (f", {len(emitter.keys)} keys" if emitter.keys else ""))
    for force in scene.forces:
        kind, on = (
            next(name for name, number in names.items() if number == force.values[field])
            for names, field in ((binding.FORCE_KINDS, "kind"), (binding.ACTS_ON, "acts_on"))
        )
        times = f"from {force.values['start_time']:g} to {force.values['end_time']:g} s"
        lines.append(f"{force.path}: {kind} force on {'fluid and solids' if on == 'both' else on}, {times}")
    return lines


def _describe_given(scene: Scene) -> list[str]:
    """Pins, colliders, and what rides along."""
    lines = []
    for pin in scene.pins:
        where = f"{int(pin.vertices.sum()):,} vertices" if pin.vertices is not None else f"the material in {pin.path}"
        driver = f"follows {pin.motion.driver}" if pin.motion.moves else "fixed where it starts"
        lines.append(f"{pin.solid}: pinned, {where}, {driver}")
    for collider in scene.colliders:
        ways = ["moves"] * collider.motion.moves + ["deforms"] * (collider.shape is not None)
        lines.append(
            f"{collider.path}: collider, {collider.report['triangles']:,} triangles, "
            f"friction {collider.values['friction']:g}, {' and '.join(ways) or 'stands still'}"
        )
    ways = [(part, f"follows {part.solid}") for part in scene.passengers]
    ways += [(part, f"follows the surface of {part.collider}") for part in scene.riders]
    for way in dict.fromkeys(way for _, way in ways):
        parts = [part for part, its in ways if its == way]
        sizes = [len(part.local.points) for part in parts]
        if len(parts) > _MOST_LINES:
            lines.append(f"{parts[0].path} and {len(parts) - 1} more: each {way}, {sum(sizes):,} points in all")
        else:
            lines += [f"{part.path}: {way}, {size:,} points" for part, size in zip(parts, sizes, strict=True)]
    return lines


def time_estimate(scene: Scene, threads: int, memory_limit: int) -> str:
    """How long a run will take, by its first steps on this machine.

    Raises LibraryError where the library refuses the scene; where only its first steps fail, says that.
    """
    plan = estimate.plan_of(scene)
    try:
        taken = estimate.try_steps(scene, threads, memory_limit)
    except LibraryError as error:
        if error.status != binding.ERROR_DIVERGED:
            raise
        return f"time: not estimated, the first steps fail: {error}"
    cells = float(np.prod(np.array(scene.domain["domain_size"]) / scene.domain["voxel_size"]))
    return estimate.describe(plan, taken, threads, cells)


def info(path: Path | None) -> Iterator[str]:
    """Lines about the program, a cache folder or a scene.

    Raises SceneError, after some lines for a cache that is damaged.
    """
    if path is None:
        yield f"eulerfsi {__version__}"
        try:
            yield f"library {binding.library_version()}: {binding.library().efsi_path}"
        except EulerFsiError as error:
            yield f"library: {error}"
        yield f"threads: {available_threads()}"
        yield f"memory: {format_bytes(available_memory())}"
    elif path.is_dir() or path.name == FILE_NAME:
        yield from _cache_info(Manifest.load(path if path.is_dir() else path.parent))
    else:
        stage = open_stage(path)
        checks.raise_errors(checks.stage_issues(stage))
        if not stage.HasAuthoredTimeCodeRange():
            set_frames(stage, FrameRange(1, 2), None)
        yield from describe_scene(read_scene(stage, path))


def _cache_info(manifest: Manifest) -> Iterator[str]:
    data: dict[str, Any] = manifest.data
    files = [facts for frame in manifest.frames.values() for facts in frame["files"].values()]
    yield f"{manifest.folder}: cache of {data['scene']}, {data['status']}, eulerfsi {data['program']['eulerfsi']}"
    size = format_bytes(sum(facts["bytes"] for facts in files))
    yield f"frames: {len(manifest.frames)} of {data['first']}-{data['last']} at {data['fps']:g} per second, {size}"
    yield f"grids: {', '.join(data['grids']) or 'none'}"
    yield f"checkpoints: {', '.join(str(c['frame']) for c in data['checkpoints']) or 'none'}"
    yield f"scene hash: {data['scene_hash']}"
    damaged = [str(frame) for frame in manifest.frames if manifest.damaged_files(int(frame))]
    if damaged:
        raise SceneError(f"{manifest.folder}: damaged or missing frames: {', '.join(damaged)}")
    for path, values in data["parameters"].items():
        yield from describe_parameters(path, values)


def describe_parameters(path: str, values: dict[str, Any]) -> list[str]:
    """The prim, then one indented line per value that a run used: name, value with its unit, tokens by name.

    values: {field of the C definition: SI value}, as a manifest holds them. What has no row in the parameter table is
    named by its field.
    """
    kind = next((name for name, field in _KINDS.items() if field in values), "prim")
    rows = {row.field: row for row in table().get(kind, {}).values() if row.field}
    lines = [f"{path}: {kind}"]
    for field, value in values.items():
        row = rows.get(field)
        if field == "transform":
            corner = np.reshape(value, (4, 4))
            lines.append(f"  {'center':<22} {_text(corner[:3, 3])} m")
            lines.append(f"  {'edges':<22} {_text(np.linalg.norm(corner[:3, :3], axis=0))} m")
            continue
        name, unit = (row.name, row.unit) if row else (field.replace("_", " "), _UNITS.get(field, ""))
        lines.append(f"  {name:<22} {_text(_token(field, row, value))} {unit}".rstrip())
    return lines


# What a prim is, by a field that only such prims have; the first that fits.
_KINDS = {
    "domain": "voxel_size",
    "solid": "youngs_modulus",
    "force": "acts_on",
    "emitter": "mode",
    "passenger": "carried_by",
    "pin": "driver",
    "collider": "friction",
}
# Fields that are no parameters: they follow from prims.
_UNITS = {"domain_min": "m", "domain_size": "m", "gravity": "m/s^2"}


def _token(field: str, row: Parameter | None, value: Any) -> Any:
    """A number of the C API as the name that a stage has for it."""
    if field == "shape":
        return next(name for name, number in binding.REGION_SHAPES.items() if number == value)
    if row and row.type == "token":
        return row.tokens[value]
    return bool(value) if row and row.type == "bool" else value


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, (list, tuple, np.ndarray)):
        return f"({', '.join(f'{float(x):.6g}' for x in value)})"
    return f"{value:.6g}" if isinstance(value, (int, float)) else str(value)
