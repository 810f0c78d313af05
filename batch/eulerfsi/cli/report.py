"""`validate`: what a scene is, and whether and how long it runs, without simulating."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..cache.output import Output
from ..errors import LibraryError
from ..frames import demand_start, parse_frames
from ..progress import Progress, finding
from ..run import disk, estimate
from ..run.checkpoints import Checkpoints
from ..scene import checks, memory
from ..scene.checks import Issue
from ..scene.instancers import expand_instancers
from ..scene.overrides import apply_overrides
from ..scene.parts import Scene
from ..scene.read import open_stage, read_scene, set_frames
from ..solver import binding
from ..system import available_memory, available_threads, format_bytes
from . import expectations

_MOST_LINES = 8  # of passengers of one body


@dataclasses.dataclass
class Report:
    """A scene that can be simulated. memory, memory_limit: bytes that it needs and may take; time: a line; disk: bytes
    of its cache, disk_full: with smoke in the whole box; expected: a line a solid and one for the fluid."""

    scene: Scene
    warnings: list[Issue]
    notes: list[str]
    memory: int
    memory_limit: int
    threads: int
    time: str
    disk: int
    disk_full: int
    expected: list[str]

    def lines(self) -> list[str]:
        """For people."""
        spread = f", up to {format_bytes(self.disk_full)} where smoke fills the box" if self.scene.has_smoke else ""
        return [
            *describe_scene(self.scene),
            *(f"warning: {issue.message}" for issue in self.warnings),
            *(f"note: {note}" for note in self.notes),
            f"memory: about {format_bytes(self.memory + memory.PROCESS)} of {format_bytes(self.memory_limit)} "
            f"available ({format_bytes(self.memory)} for the simulation)",
            f"disk: about {format_bytes(self.disk)}" + spread,
            self.time,
            *self.expected,
            "the scene can be simulated",
        ]

    def facts(self) -> dict[str, Any]:
        """For programs."""
        return {
            **scene_facts(self.scene),
            "warnings": [finding(i.message, i.code, i.prim, i.field) for i in self.warnings],
            "notes": self.notes,
            "memory": self.memory,
            "process_memory": self.memory + memory.PROCESS,
            "disk": self.disk,
            "disk_full": self.disk_full,
            "memory_limit": self.memory_limit,
            "threads": self.threads,
            "time": self.time.removeprefix("time: "),
            "expected": self.expected,
        }


def validate(
    path: Path,
    frames_text: str | None,
    start: int | None,
    settings: list[str],
    threads: int | None,
    progress: Progress | None = None,
    path_map: Iterable[str] = (),
    confine: bool = False,
) -> Report:
    """Raises SceneError with all faults, UsageError for options."""
    progress, threads, begun = progress or Progress(), threads or available_threads(), time.monotonic()
    frames = parse_frames(frames_text) if frames_text else None
    stage = open_stage(path, path_map, confine)
    set_frames(stage, frames, start)
    expand_instancers(stage)
    apply_overrides(stage, settings)
    warnings = checks.raise_errors(checks.stage_issues(stage))
    limit = available_memory()
    scene = read_scene(stage, path, limit, threads, progress)
    if frames:
        demand_start(frames, scene.frames.first, None)
    warnings += scene.warnings + checks.raise_errors(checks.check_scene(scene))
    warnings = list({issue.message: issue for issue in warnings}.values())
    for issue in warnings:
        progress.warning(issue.message, issue.code, issue.prim, issue.field)
    needed = memory.need(scene, limit)
    progress.start(
        "validate",
        scene.frames,
        0,
        scene=str(path),
        scene_hash=scene.hash(),
        folder=None,
        threads=threads,
        memory=needed,
        memory_limit=limit,
        cells=scene.cells,
    )
    reading = time.monotonic() - begun
    number = len(scene.frames)
    checkpoints = Checkpoints("10", "2").most(number)
    room, most = (disk.need(scene, Output(), number, checkpoints, full=full) for full in (False, True))
    told = time_estimate(scene, threads, limit, reading)
    notes, expected = checks.notes(scene), expectations.describe(scene)
    return Report(scene, warnings, notes, needed, limit, threads, told, room, most, expected)


def scene_facts(scene: Scene) -> dict[str, Any]:
    """What a scene is, for programs; values are those of the C API, in SI."""
    return {
        "scene": str(scene.path),
        "scene_hash": scene.hash(),
        "first": scene.frames.first,
        "last": scene.frames.last,
        "fps": scene.fps,
        "meters_per_unit": scene.units.meters_per_unit,
        "cells": scene.cells,
        "parameters": scene.parameters(),
    }


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
        if solid.origins:
            lines.append(
                f"{solid.path}: {'; '.join(f'{name} from {origin}' for name, origin in solid.origins.items())}"
            )
    lines += _describe_given(scene)
    for emitter in scene.emitters:
        mode = next(name for name, number in binding.EMITTER_MODES.items() if number == emitter.values["mode"])
        text = f"{emitter.path}: {mode} emitter, smoke density {emitter.over_time('density').max():g}"
        if emitter.values["has_velocity"]:
            text += f", velocity {np.linalg.norm(emitter.over_time('velocity'), axis=-1).max():.4g} m/s"
        text += f", {len(emitter.keys)} keys" if emitter.keys else ""
        lines.append(text + (f", moves through {len(emitter.stays)} places" if emitter.stays else ""))
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


def time_estimate(scene: Scene, threads: int, memory_limit: int, reading: float = 0.0) -> str:
    """How long a run will take, by its first steps on this machine. reading: seconds that reading the scene took.

    Raises LibraryError where the library refuses the scene; where only its first steps fail, says that.
    """
    plan = estimate.plan_of(scene)
    try:
        trial = estimate.try_steps(scene, threads, memory_limit)
    except LibraryError as error:
        if error.status != binding.ERROR_DIVERGED:
            raise
        return f"time: not estimated, the first steps fail: {error}"
    return estimate.describe(plan, trial, threads, scene.cells, reading)
