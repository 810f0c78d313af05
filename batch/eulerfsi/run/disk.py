"""The disk that a run will take, and the refusal of a run for which there is too little."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from ..cache.output import Output
from ..errors import CacheIOError
from ..scene.parts import Emitter, Scene
from ..system import format_bytes

# Bytes, of caches as they are: a point with its velocity in a .usdc; an active voxel of smoke and of its velocity in
# a .vdb; a node or cell of the fluid, and of a solid's band, in a checkpoint; a picture.
_POINT, _SCALAR, _VELOCITY, _FLUID, _BAND, _PICTURE = 24.0, 4.0, 12.0, 20.0, 26.0, 60_000.0
_MARGIN = 6.0  # cells of a solid's band beyond its box
_ALWAYS = 400_000.0  # the copy of the scene's own layer, log, statistics, preview
_PER_FRAME = 3_000.0  # headers, and a line of the manifest for each file
_GRID, _LEAVES = 8_500.0, 1.1  # the upper nodes of a grid's tree in a .vdb; leaves for each byte of their voxels


def frame_bytes(scene: Scene, output: Output, full: bool = False) -> float:
    """One frame: points and velocities of all that is drawn, and the smoke that emitters give at the start or hold.

    full: smoke in the whole box.
    """
    points = sum(len(part.local.points) for part in scene.drawn)
    size = _PER_FRAME + _POINT * points
    if scene.has_smoke:
        scalars = 1 + any(emitter.over_time("temperature").any() for emitter in scene.emitters)
        voxel = _SCALAR * scalars + (_VELOCITY if output.velocity else 0.0)
        cells = _LEAVES * scene.cells if full else _smoke_cells(scene)
        size += cells * voxel / (2 if output.half else 1) + _GRID * (scalars + output.velocity)
    return size


def _smoke_cells(scene: Scene) -> float:
    """Cells of the emitters' boxes, as far as they lie in the domain."""
    low, edges = np.array(scene.domain["domain_min"]), np.array(scene.domain["domain_size"])
    return min(float(scene.cells), sum(_cells_of(emitter, low, edges, scene) for emitter in scene.emitters))


def _cells_of(emitter: Emitter, low: np.ndarray, edges: np.ndarray, scene: Scene) -> float:
    start, end = emitter.extent()
    inside = np.minimum(end, low + edges) - np.maximum(start, low)
    return float(np.prod(np.maximum(inside, 0.0))) / scene.domain["voxel_size"] ** 3


def checkpoint_bytes(scene: Scene) -> float:
    """One checkpoint: the state of fluid and solids."""
    voxel = scene.domain["voxel_size"]
    size = _FLUID * scene.cells if scene.domain["ambient_fluid"] else 0.0
    for body in [*scene.solids, *scene.colliders]:
        edges = np.ptp(body.mesh.points, axis=0) / voxel
        edges = np.minimum(edges, np.array(scene.domain["domain_size"]) / voxel)
        size += _BAND * float(np.prod(edges + 2 * _MARGIN)) + _POINT * len(body.mesh.points)
    return size


def need(scene: Scene, output: Output, frames: int, checkpoints: int, pictures: int = 0, full: bool = False) -> int:
    """Bytes of so many frames, checkpoints and pictures of a flip-book. Smoke may spread to more; full: to the whole
    box in every frame, which is the most there can be."""
    size = _ALWAYS + frames * frame_bytes(scene, output, full) + checkpoints * checkpoint_bytes(scene)
    return int(size + pictures * _PICTURE)


def free(folder: Path) -> int:
    """Bytes that may be written to a folder, which need not exist yet."""
    while not folder.exists() and folder.parent != folder:
        folder = folder.parent
    return shutil.disk_usage(folder).free


def demand(folder: Path, needed: int, available: int) -> None:
    """Raises CacheIOError where a run needs more than there is."""
    if needed > available:
        raise CacheIOError(
            f"{folder}: the run needs about {format_bytes(needed)} of disk, {format_bytes(available)} are free: make "
            "room, choose another folder with -o, write less (--half, --no-velocity, --keep-checkpoints), or go on "
            "with --force"
        )
