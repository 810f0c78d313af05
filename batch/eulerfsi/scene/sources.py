"""Emitters and forces of a scene, with the times at which they are on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from ..errors import SceneError
from ..frames import FrameRange
from ..parameters import table
from ..solver import binding
from .bodies import closed_mesh
from .moving_emitters import read_stays
from .parts import Emitter, Force
from .space import SimulationSpace, determinant
from .values import EMITTER_API, FORCE_API, Reader


def read_emitters(reader: Reader, space: SimulationSpace, prim: Usd.Prim, frames: FrameRange) -> list[Emitter]:
    """The emitter of a prim; none where it is never on."""
    values = reader.fields(prim, "emitter")
    values["velocity"] = space.vector_to_sim(values["velocity"]).tolist()
    keys = _emitter_keys(reader, space, prim, frames.first)
    on = any(key["on"] for key in keys) if keys else reader.value(prim, table()["emitter"]["enabled"])
    if not on:
        return []
    path, hull = str(prim.GetPath()), closed_mesh(reader, space, prim)
    by_formula = prim.IsA(UsdGeom.Cube) or prim.IsA(UsdGeom.Sphere)
    if by_formula:
        values |= _region(reader, space, prim, EMITTER_API)
    stays = read_stays(reader, space, prim, values, hull, frames)
    if any(stay.velocity.any() for stay in stays) and not values["has_velocity"]:
        values |= {"has_velocity": 1, "velocity": [0.0, 0.0, 0.0]}
        keys = [key | {"velocity": [0.0, 0.0, 0.0]} for key in keys]
    return [Emitter(path, values, hull, keys, None if by_formula else hull, stays=stays, stage=prim.GetStage())]


def _emitter_keys(reader: Reader, space: SimulationSpace, prim: Usd.Prim, first: int) -> list[dict[str, Any]]:
    """Fields of EfsiEmitterKey at the first frame and at the time samples after it; none where nothing changes.

    Where the stage holds values between samples two keys of one time make the step.
    """
    if reader.value(prim, table()["emitter"]["mode"]) != "continuous":
        return []
    stage = prim.GetStage()
    attributes = [prim.GetAttribute(row.attribute) for row in table()["emitter"].values() if row.animated]
    times = sorted({time for a in attributes if a for time in a.GetTimeSamples() if time > first})
    if not times:
        return []

    def key(time: float, at: float) -> dict[str, Any]:
        now = Reader(reader.units, Usd.TimeCode(at))
        fields = now.fields(prim, "emitter")
        return {
            "time": (time - first) / stage.GetTimeCodesPerSecond(),
            "density": fields["density"],
            "temperature": fields["temperature"],
            "velocity": space.vector_to_sim(fields["velocity"]).tolist(),
            "on": int(now.value(prim, table()["emitter"]["enabled"])),
        }

    keys = [key(first, first)]
    held = stage.GetInterpolationType() == Usd.InterpolationTypeHeld
    for before, time in zip([first, *times], times, strict=False):
        keys += [key(time, before), key(time, time)] if held else [key(time, time)]
    return keys


def read_forces(reader: Reader, space: SimulationSpace, prim: Usd.Prim, frames: FrameRange) -> list[Force]:
    """A force for each time in which the prim is on, between its startTime and endTime."""
    values = reader.fields(prim, "force")
    values |= _region(reader, space, prim, FORCE_API)
    for name in ("acceleration", "wind_velocity"):
        values[name] = space.vector_to_sim(values[name]).tolist()
    forces: list[Force] = []
    for start, end in _times_on(reader, prim, frames):
        start, end = max(start, values["start_time"]), min(end, values["end_time"])
        if start < end:
            path = f"{prim.GetPath()}{f' ({len(forces) + 1})' if forces else ''}"
            forces.append(Force(path, {**values, "start_time": start, "end_time": end}))
    return forces


def _region(reader: Reader, space: SimulationSpace, prim: Usd.Prim, api: str) -> dict[str, Any]:
    """Fields shape and transform of a Cube or a Sphere."""
    what = api.removeprefix("EulerFsi").removesuffix("API").lower()
    if prim.IsA(UsdGeom.Cube):
        shape, width = "box", UsdGeom.Cube(prim).GetSizeAttr().Get(reader.time)
    elif prim.IsA(UsdGeom.Sphere):
        shape, width = "sphere", 2 * UsdGeom.Sphere(prim).GetRadiusAttr().Get(reader.time)
    else:
        raise SceneError(f"{prim.GetPath()}: {api} on a {prim.GetTypeName()}: must be a Cube or a Sphere")
    to_sim = space.from_local(reader.local_to_world(prim) * np.array([[width], [width], [width], [1.0]]))
    if determinant(to_sim) == 0:
        raise SceneError(f"{prim.GetPath()}: the transform of the {what} has a zero scale")
    return {"shape": binding.REGION_SHAPES[shape], "transform": to_sim.T.ravel().tolist()}


def _times_on(reader: Reader, prim: Usd.Prim, frames: FrameRange) -> list[tuple[float, float]]:
    """Intervals in which eulerfsi:enabled is on, seconds after the first frame; its time samples are steps."""
    attribute = prim.GetAttribute("eulerfsi:enabled")
    fps = prim.GetStage().GetTimeCodesPerSecond()
    changes = [time for time in attribute.GetTimeSamples() if time > frames.first] if attribute else []
    edges = [frames.first, *changes]
    intervals: list[tuple[float, float]] = []
    for begin, end in zip(edges, [*edges[1:], math.inf], strict=True):
        if not Reader(reader.units, Usd.TimeCode(begin)).value(prim, table()["force"]["enabled"]):
            continue
        start, stop = (begin - frames.first) / fps, (end - frames.first) / fps
        if intervals and intervals[-1][1] == start:
            start = intervals.pop()[0]
        intervals.append((start, stop))
    return intervals
