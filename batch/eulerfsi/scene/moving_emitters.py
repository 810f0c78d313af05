"""Emitters that move: in every short time the region is where its transform puts it halfway.

A step takes all the times that it overlaps, each by its share, so that a jet brings the same volume whatever the steps
are, and smoke is imposed along the way.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from eulerfsi_usd.transforms import frames_of, moves, place_attributes
from pxr import Gf, Usd

from ..errors import SceneError
from ..frames import FrameRange
from ..parameters import table
from ..solver.simulation import Mesh
from .parts import Motion
from .space import SimulationSpace, transform_points
from .values import Reader

_MOST_PARTS = 16  # of a frame
_MOST_SHAPES, _MOST_MESHES = 4000, 400  # places of a region by formula, and of a mesh, which is examined anew
_STILL = 1e-4  # voxels by which a region that stands still may move


@dataclasses.dataclass
class Stay:
    """Where an emitter is for a short time. values: fields of EfsiEmitterDef that differ; velocity: that of its motion
    [m/s], added to keys; hull: surface of its region, simulation space."""

    values: dict[str, Any]
    velocity: np.ndarray
    hull: Mesh


def read_stays(
    reader: Reader, space: SimulationSpace, prim: Usd.Prim, values: dict[str, Any], hull: Mesh, frames: FrameRange
) -> list[Stay]:
    """Of a continuous emitter whose transform is animated after the first frame; else none. hull: at the start.

    values: of the emitter at the start; "transform" where it is a box or a ball.
    """
    last = _last_frame(prim, frames.first)
    if reader.value(prim, table()["emitter"]["mode"]) != "continuous" or last <= frames.first:
        return []
    fps = prim.GetStage().GetTimeCodesPerSecond()
    adds = reader.value(prim, table()["emitter"]["addMotion"])
    motion = Motion(str(prim.GetPath()), prim.GetStage(), space, frames.first)
    spans = _spans(motion, hull, last, reader.voxel)
    most = _MOST_SHAPES if "transform" in values else _MOST_MESHES
    if len(spans) > most:
        message = f"{prim.GetPath()}: moves through {len(spans)} places: must be at most {most}"
        raise SceneError(f"{message}; animate it over fewer frames, or slower")
    stays = []
    for number, (begin, end) in enumerate(spans):
        lasts = number == len(spans) - 1
        start = values["start_time"] if number == 0 else max(values["start_time"], (begin - frames.first) / fps)
        stop = values["end_time"] if lasts else min(values["end_time"], (end - frames.first) / fps)
        if start >= stop:
            continue
        pose = motion.pose(begin if lasts else (begin + end) / 2).T
        moved = transform_points(hull.points, pose)
        now = {"start_time": start, "end_time": stop}
        if "transform" in values:
            region = Gf.Matrix4d(np.reshape(values["transform"], (4, 4)).T) * Gf.Matrix4d(pose)
            now["transform"] = np.array(region).T.ravel().tolist()
        velocity = np.zeros(3)
        if adds and not lasts:
            ends = [transform_points(hull.points, motion.pose(time).T) for time in (begin, end)]
            velocity = (ends[1] - ends[0]).mean(axis=0) * fps / (end - begin)
        stays.append(Stay(now, velocity, Mesh(moved, hull.counts, hull.indices)))
    return stays


def _last_frame(prim: Usd.Prim, first: int) -> int:
    """The frame from which on its place is the same."""
    if not moves(prim):
        return first
    attributes = [attribute for attribute in place_attributes(prim) if attribute.ValueMightBeTimeVarying()]
    times = [time for attribute in attributes for time in attribute.GetTimeSamples()[-1:]]
    if len(times) < len(attributes):  # one that varies without samples
        times.append(frames_of(prim.GetStage())[-1])
    return max(first, math.ceil(max(times, default=first)))


def _spans(motion: Motion, hull: Mesh, last: int, voxel: float) -> list[tuple[float, float]]:
    """Times in which the region moves at most a voxel, or not at all; the last begins with the last frame."""
    spans: list[tuple[float, float]] = []
    still = False
    before = hull.points.astype(float)
    for frame in range(motion.first, last):
        halfway, after = (transform_points(hull.points, motion.pose(frame + t).T) for t in (0.5, 1.0))
        way = np.abs(halfway - before).max() + np.abs(after - halfway).max()
        before = after
        if way <= _STILL * voxel and still:
            spans[-1] = (spans[-1][0], frame + 1.0)
            continue
        still = way <= _STILL * voxel
        parts = min(max(math.ceil(way / voxel - 1e-3), 1), _MOST_PARTS)
        spans += [(frame + k / parts, frame + (k + 1) / parts) for k in range(parts)]
    return [*spans, (float(last), math.inf)]
