"""Scene in: a USD stage becomes the definitions that the solver takes, in SI and simulation space."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import eulerfsi_usd  # noqa: F401 - registers the schema before a stage is opened
import numpy as np
from eulerfsi_usd.attachments import Attachment, find_attachments
from eulerfsi_usd.deformables import body_at, kinematic_bodies, simulated_bodies
from eulerfsi_usd.foreign import physics_colliders
from eulerfsi_usd.issues import Issue, all_prims, first_time
from eulerfsi_usd.passengers import find_passengers
from pxr import Tf, Usd, UsdGeom, UsdPhysics

from ..errors import SceneError, UsageError
from ..frames import FrameRange, check_frames
from ..parameters import StageUnits, table
from ..progress import Progress
from ..reasons import usd_reason
from ..solver.simulation import slab_axis
from ..system import available_threads
from . import memory
from .bodies import examine, read_collider, read_density, read_pins, read_solid
from .confine import demand_confined, demand_layers_within
from .parts import Pin, Scene, Solid
from .passengers import read_passenger, read_riders
from .path_map import map_layers, parse_rules
from .references import how_to_make_a_scene, is_usd_file
from .sources import read_emitters, read_forces
from .space import SimulationSpace, domain_space
from .tet_bodies import body_density, evenness, read_body_pins, read_tet_solid
from .values import DOMAIN_API, Reader, find_prims, stage_units

EARTH_GRAVITY = 9.81  # m/s^2
_VOXEL_SIZES = (1e-6, 1e6)  # m: what single precision and OpenVDB's transforms can hold, and a continuum is


def open_stage(path: Path, path_map: Iterable[str] = (), confine: bool = False) -> Usd.Stage:
    """Opens a scene file with the schema registered. Raises SceneError, UsageError.

    path_map: options `--path-map`; confine: nothing outside the scene's folder is read.
    """
    rules = parse_rules(path_map)
    if not path.is_file():
        raise SceneError(f"{path}: {'is a folder, not a scene file' if path.is_dir() else 'no such file'}")
    if not is_usd_file(path):
        raise SceneError(how_to_make_a_scene(path))
    if confine:
        demand_confined(path, rules)
    held = map_layers(path, rules)
    try:
        stage = Usd.Stage.Open(held[0] if held else str(path))
    except (Tf.ErrorException, UnicodeDecodeError) as error:  # bytes that are no text reach Python as the latter
        raise SceneError(f"{path}: cannot be opened as USD: {usd_reason(error)}") from error
    if confine:
        demand_layers_within(stage, path, rules)
    return stage


def stage_frames(stage: Usd.Stage) -> FrameRange:
    """The stage's own range. Raises UsageError or SceneError."""
    if not stage.HasAuthoredTimeCodeRange():
        raise SceneError("stage: startTimeCode and endTimeCode are not authored; give --frames first-last")
    frames = _authored_range(stage)
    return check_frames(frames, f"stage range {frames}")


def _authored_range(stage: Usd.Stage, start: int | None = None) -> FrameRange:
    """start: --start-frame; with it the whole frames of the range count."""
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    limits = f"stage: startTimeCode {first:g} and endTimeCode {last:g}: must be whole numbers"
    if not (math.isfinite(first) and math.isfinite(last)):
        raise SceneError(limits)
    whole = FrameRange(math.ceil(first), math.floor(last))
    if start is None and (first, last) != (whole.first, whole.last):
        raise SceneError(f"{limits}; --start-frame {whole.first} simulates the whole frames from there")
    return whole


def set_frames(stage: Usd.Stage, wanted: FrameRange | None, start: int | None) -> None:
    """Makes the frames that this run simulates the stage's own, on its session layer, for all that read them later.

    wanted: --frames, start: --start-frame. A simulation starts at the scene's first frame, whatever frames are wanted,
    unless `start` says otherwise; `wanted` gives the first where the stage has no range. Raises UsageError.
    """
    own = _authored_range(stage, start) if stage.HasAuthoredTimeCodeRange() else wanted
    if own is None or (wanted is None and start is None):
        return  # the range is the stage's own, or missing
    start, last = own.first if start is None else start, (wanted or own).last
    if wanted and wanted.first < start:
        way_out = f"write --frames {start}-{max(last, start + 1)}, or --start-frame {wanted.first} to start there"
        raise UsageError(f"--frames {wanted}: the simulation starts at frame {start}; {way_out}")
    check_frames(FrameRange(start, last), f"frames {start}-{last}")
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        stage.SetStartTimeCode(start)
        stage.SetEndTimeCode(last)


def read_scene(
    stage: Usd.Stage,
    path: Path,
    memory_limit: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Scene:
    """Reads a stage that `checks.check_stage` found without errors, at its first frame.

    memory_limit: bytes that the simulation may take, 0 for no limit. threads: for the examination of the meshes, None
    for all; progress: learns how far that is. Raises SceneError for what only this reading finds: too fine a grid,
    files that do not load, meshes that the library refuses; Cancelled after a signal.
    """
    threads, progress = threads or available_threads(), progress or Progress()
    frames = stage_frames(stage)
    units = stage_units(stage)
    reader = Reader(units, Usd.TimeCode(frames.first))
    domain_prim = _the_domain(stage)
    where = str(domain_prim.GetPath())
    space, scale, mirrored = domain_space(where, reader.local_to_world(domain_prim), units.meters_per_unit)
    domain = _domain_values(reader, domain_prim, scale * units.meters_per_unit, mirrored)
    for face in range(6):
        velocity = np.array(space.vector_to_sim(domain[f"wall_velocity[{face}]"]))
        velocity[np.abs(velocity) < 1e-9 * np.abs(velocity).max()] = 0.0  # what turning it has left
        domain[f"wall_velocity[{face}]"] = velocity.tolist()
    reader.voxel = domain["voxel_size"]
    warnings: list[Issue] = []
    domain["gravity"] = space.vector_to_sim(_gravity(stage, units, warnings)).tolist()
    enabled = table()["solid"]["enabled"]
    marked = [prim for prim in find_prims(stage, "solid") if not body_at(prim)]
    solids = [read_solid(reader, space, prim) for prim in marked if reader.value(prim, enabled)]
    solids += [read_tet_solid(reader, space, body) for body in simulated_bodies(stage)]
    warnings += evenness(solids)
    attachments = find_attachments(stage)
    pins = [pin for solid in solids for pin in _pins_of(reader, space, stage, solid, frames.first, attachments)]
    marked = [prim for prim in find_prims(stage, "collider") if reader.value(prim, enabled)]
    marked += physics_colliders(stage) + [body.sim for body in kinematic_bodies(stage)]
    colliders = [read_collider(reader, space, prim, frames.first) for prim in marked]
    memory.demand(where, domain, [body.mesh for body in [*solids, *colliders]], memory_limit, units.meters_per_unit)
    for solid in solids:
        examine(solid, domain, threads, progress)
        prim = stage.GetPrimAtPath(solid.path)
        volume = solid.report["solid_volume"]
        solid.values["density"] = body_density(solid) if solid.tets else read_density(reader, prim, volume)
    emitters = [emitter for p in find_prims(stage, "emitter") for emitter in read_emitters(reader, space, p, frames)]
    if not domain["ambient_fluid"]:
        emitters = []  # nothing carries the smoke; check_stage warns
    for body in [*(pin for pin in pins if pin.mesh), *colliders, *(emitter for emitter in emitters if emitter.mesh)]:
        examine(body, domain, threads, progress)
    passengers = [solid.cage for solid in solids if solid.cage]
    passengers += [
        read_passenger(reader, space, solid, prim)
        for solid in solids
        for prim in find_passengers(stage.GetPrimAtPath(solid.path))
    ]
    riders = [rider for collider in colliders for rider in read_riders(reader, space, collider, stage)]
    forces = [force for prim in find_prims(stage, "force") for force in read_forces(reader, space, prim, frames)]
    fps = stage.GetTimeCodesPerSecond()
    return Scene(
        path,
        stage,
        units,
        space,
        frames,
        fps,
        where,
        domain,
        solids,
        emitters,
        forces,
        warnings,
        passengers,
        pins,
        colliders,
        riders,
    )


def _pins_of(
    reader: Reader,
    space: SimulationSpace,
    stage: Usd.Stage,
    solid: Solid,
    first: int,
    attachments: list[Attachment],
) -> list[Pin]:
    if solid.tets:
        return read_body_pins(reader, space, solid, first, attachments)
    pins = read_pins(reader, space, stage.GetPrimAtPath(solid.path), first)
    for pin in pins:
        if pin.vertices is not None and solid.refinement:
            near = solid.refinement.spread(pin.vertices[:, None].astype(float))[:, 0]
            pin.vertices = near >= min(0.5, near.max())
    return pins


def _the_domain(stage: Usd.Stage) -> Usd.Prim:
    prims = find_prims(stage, "domain")
    if len(prims) != 1:
        found = ", ".join(str(p.GetPath()) for p in prims) or "none"
        raise SceneError(f"the scene must have exactly one prim with {DOMAIN_API} (found: {found})")
    return prims[0]


def _domain_values(reader: Reader, prim: Usd.Prim, meters: np.ndarray, mirrored: bool) -> dict[str, Any]:
    """Fields of EfsiSimulationDef without gravity. meters: length of the prim's local units along its axes [m]."""
    values = reader.fields(prim, "domain")
    if prim.IsA(UsdGeom.Cube):
        edges = np.full(3, float(UsdGeom.Cube(prim).GetSizeAttr().Get(reader.time)))
        where = f"{prim.GetPath()}: size = {edges[0]:g}"
    else:
        edges = np.array(reader.value(prim, table()["domain"]["size"]), float)
        where = f"{prim.GetPath()}: eulerfsi:size = {tuple(edges.tolist())}"
    if not (edges > 0).all():
        raise SceneError(f"{where}: the edges of the domain must be > 0 (on an Xform set eulerfsi:size)")
    size, voxel = edges * meters, values["voxel_size"]
    if not _VOXEL_SIZES[0] <= voxel <= _VOXEL_SIZES[1]:
        low, high = (limit / reader.units.meters_per_unit for limit in _VOXEL_SIZES)
        raise SceneError(
            f"{prim.GetPath()}: eulerfsi:voxelSize = {voxel / reader.units.meters_per_unit:g}: must be between {low:g} "
            f"and {high:g} (a micrometre and a thousand kilometres)"
        )
    # A size that is a whole number of voxels up to rounding must not gain a voxel from that rounding.
    count = np.round(size / voxel)
    size = np.where(np.abs(size / voxel - count) < 1e-4 * np.maximum(count, 1), np.maximum(count, 1) * voxel, size)
    if mirrored:
        for name in ("wall", "wall_velocity"):
            values[f"{name}[0]"], values[f"{name}[1]"] = values[f"{name}[1]"], values[f"{name}[0]"]
    values["domain_min"] = (-size / 2).tolist()
    values["domain_size"] = size.tolist()
    slab = slab_axis(values)
    if any(edge < 2 * voxel for axis, edge in enumerate(size) if axis != slab):
        raise SceneError(
            f"{prim.GetPath()}: eulerfsi:voxelSize = {voxel / reader.units.meters_per_unit:g}: the shortest edge "
            f"{size.min() / reader.units.meters_per_unit:g} must hold at least 2 voxels; one edge may be 1 voxel "
            "between slip walls, which makes a 2-D scene"
        )
    return values


def _gravity(stage: Usd.Stage, units: StageUnits, warnings: list[Issue]) -> np.ndarray:
    """World vector [m/s^2] from the PhysicsScene; 9.81 down without one."""
    up = np.array([0.0, 0.0, 1.0] if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else [0.0, 1.0, 0.0])
    scenes = [UsdPhysics.Scene(prim) for prim in all_prims(stage) if prim.IsA(UsdPhysics.Scene)]
    if len(scenes) > 1:
        used = str(scenes[0].GetPath())
        message = f"{len(scenes)} PhysicsScene prims: gravity is taken from {used}"
        warnings.append(Issue(used, "typeName", str(len(scenes)), "one", message, "warning", "SeveralPhysicsScenes"))
    direction, magnitude = -up, EARTH_GRAVITY
    if scenes:
        for attribute in (scenes[0].GetGravityDirectionAttr(), scenes[0].GetGravityMagnitudeAttr()):
            if attribute.GetNumTimeSamples() > 1:
                path, limit = str(scenes[0].GetPath()), "constant: the value of the first frame is used"
                message = f"{path}.{attribute.GetName()} = animated: must be {limit}"
                warnings.append(Issue(path, attribute.GetName(), "animated", limit, message, "warning", "Animated"))
        time = first_time(stage)
        authored = np.array(scenes[0].GetGravityDirectionAttr().Get(time), float)
        if authored.any():
            direction = authored / math.sqrt((authored * authored).sum())
        given = scenes[0].GetGravityMagnitudeAttr().Get(time)
        if math.isfinite(given) and given >= 0:
            magnitude = given * units.meters_per_unit
        elif given != -math.inf:
            raise SceneError(
                f"{scenes[0].GetPath()}: physics:gravityMagnitude = {given}: must be >= 0 or -inf (9.81 m/s^2)"
            )
    return direction * magnitude
