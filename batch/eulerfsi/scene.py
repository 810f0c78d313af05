"""Scene in: a USD stage becomes the definitions that the solver takes, in SI and simulation space."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from pathlib import Path
from typing import Any

import eulerfsi_usd  # noqa: F401 - registers the schema before a stage is opened
import numpy as np
from eulerfsi_usd import given, gprims
from eulerfsi_usd.parameters import API_SCHEMAS
from eulerfsi_usd.passengers import find_passengers
from eulerfsi_usd.pose import Pose, PoseError
from pxr import Tf, Usd, UsdGeom, UsdPhysics, UsdShade

from . import binding, memory, solver
from .errors import Cancelled, LibraryError, SceneError, UsageError
from .frames import FrameRange, check_frames
from .motion import fit_rigid_motion, volume_center
from .parameters import Parameter, StageUnits, table
from .progress import Waiting
from .reasons import mesh_reason, usd_reason
from .references import how_to_make_a_scene, is_usd_file
from .signals import Signals
from .space import SimulationSpace, determinant, domain_space, orthonormal_rows, transform_points, transform_vectors
from .system import available_threads

DOMAIN_API, SOLID_API, EMITTER_API, FORCE_API = (
    API_SCHEMAS[scope] for scope in ("domain", "solid", "emitter", "force")
)
APIS = {api: scope for scope, api in API_SCHEMAS.items()}
EARTH_GRAVITY = 9.81  # m/s^2
DEFAULT_DENSITY = 1000.0  # kg/m^3
_VOXEL_SIZES = (1e-6, 1e6)  # m: what single precision and OpenVDB's transforms can hold, and a continuum is
_TOKENS = {
    "preset": binding.PRESETS,
    "material": binding.MATERIALS,
    "mode": binding.EMITTER_MODES,
    "kind": binding.FORCE_KINDS,
    "actsOn": binding.ACTS_ON,
}


@dataclasses.dataclass
class Solid:
    """One solid. mesh: rest surface in simulation space; local: the same surface as the prim holds it."""

    path: str
    output_path: str  # the Mesh prim that receives the points
    mesh: solver.Mesh
    local: solver.Mesh
    values: dict[str, Any]  # fields of EfsiSolidDef
    surface: solver.Surface | None = None  # the mesh as the library examined it
    surface_file: str = ""
    subdivision: str = "none"
    left_handed: bool = False
    pose: str = ""  # what the start follows from, '' for a mesh that stands still as it is

    @property
    def report(self) -> dict[str, Any]:
        """Fields of EfsiMeshReport."""
        return self.surface.report


@dataclasses.dataclass
class Motion:
    """How what is given moves: with a prim's transform. driver: path of that prim, '' for none."""

    driver: str
    stage: Usd.Stage
    space: SimulationSpace
    first: int

    @property
    def moves(self) -> bool:
        """Whether it does."""
        return bool(self.driver) and given.moves(self.stage.GetPrimAtPath(self.driver))

    def pose(self, frame: int) -> np.ndarray:
        """(4, 4) for column vectors in simulation space: where a frame puts what lies there at the first frame."""
        if not self.moves:
            return np.eye(4)
        world = given.motion(self.stage.GetPrimAtPath(self.driver), frame, self.first)
        corners = self.space.point_to_world(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
        origin, *ends = transform_points(corners, self.space.from_local(world))
        pose = np.eye(4)
        pose[:3, :3] = np.stack([end - origin for end in ends], axis=1)
        pose[:3, 3] = origin
        return pose


@dataclasses.dataclass
class Pin:
    """What holds a part of a solid. where: (vertices,) bool of its mesh, or a volume as `surface` has examined it."""

    path: str  # of the prim that says where: the solid, or the volume
    solid: str
    motion: Motion
    vertices: np.ndarray | None = None
    mesh: solver.Mesh | None = None
    surface: solver.Surface | None = None


@dataclasses.dataclass
class Collider:
    """A body whose motion is given. mesh: where it is at the first frame, simulation space; values: EfsiSolidDef."""

    path: str
    mesh: solver.Mesh
    values: dict[str, Any]
    motion: Motion
    surface: solver.Surface | None = None
    surface_file: str = ""

    @property
    def report(self) -> dict[str, Any]:
        """Fields of EfsiMeshReport."""
        return self.surface.report


@dataclasses.dataclass
class Passenger:
    """What rides along with a solid, at rest. mesh, local: as of Solid; curves and points have no faces."""

    path: str
    solid: str  # path of the solid
    mesh: solver.Mesh
    local: solver.Mesh
    subdivision: str  # "" where there are no faces
    left_handed: bool = False
    surface_file: str = ""

    @property
    def output_path(self) -> str:
        """The prim that receives the points."""
        return self.path


@dataclasses.dataclass
class Emitter:
    """One emitter. values: fields of EfsiEmitterDef."""

    path: str
    values: dict[str, Any]


@dataclasses.dataclass
class Force:
    """One force while it is on. values: fields of EfsiForceDef. path: with a number from the second time on."""

    path: str
    values: dict[str, Any]


@dataclasses.dataclass
class Scene:
    """Everything that a simulation needs. domain: fields of EfsiSimulationDef."""

    path: Path
    stage: Usd.Stage
    units: StageUnits
    space: SimulationSpace
    frames: FrameRange
    fps: float
    domain_path: str
    domain: dict[str, Any]
    solids: list[Solid]
    emitters: list[Emitter]
    forces: list[Force]
    warnings: list[str]
    passengers: list[Passenger] = dataclasses.field(default_factory=list)
    pins: list[Pin] = dataclasses.field(default_factory=list)
    colliders: list[Collider] = dataclasses.field(default_factory=list)

    @property
    def drawn(self) -> list[Solid | Passenger]:
        """All that gets points in every frame."""
        return [*self.solids, *self.passengers]

    @property
    def name(self) -> str:
        """File name of the scene without its suffix; cache files carry it."""
        return self.path.stem

    @property
    def has_smoke(self) -> bool:
        """Whether volumes are written: something emits and there is a fluid to carry it."""
        return bool(self.emitters) and bool(self.domain["ambient_fluid"])

    def parameters(self) -> dict[str, dict[str, Any]]:
        """{prim path: {field of the C definition: SI value}}: all that was used."""
        result = {self.domain_path: self.domain}
        for item in [*self.solids, *self.emitters, *self.forces, *self.colliders]:
            result[item.path] = item.values
        for passenger in self.passengers:
            result[passenger.path] = {"carried_by": passenger.solid}
        for pin in self.pins:
            result[f"{pin.path} (pin)"] = {"solid": pin.solid, "driver": pin.motion.driver}
        return json.loads(json.dumps(result))

    def hash(self) -> str:
        """Hash of all that the simulation depends on: parameters, meshes, frame rate, first frame."""
        digest = hashlib.sha256()
        start = {"fps": self.fps, "first": self.frames.first, "parameters": self.parameters()}
        digest.update(json.dumps(start, sort_keys=True).encode())
        for solid in self.drawn:
            for array in (solid.mesh.points, solid.mesh.counts, solid.mesh.indices):
                digest.update(array.tobytes())
        for pin in self.pins:
            digest.update((pin.mesh.points if pin.mesh else pin.vertices).tobytes())
        for collider in self.colliders:
            digest.update(collider.mesh.points.tobytes() + collider.mesh.indices.tobytes())
        for moved in [*self.pins, *self.colliders]:
            if moved.motion.moves:
                digest.update(given.motion_text(self.stage.GetPrimAtPath(moved.motion.driver)).encode())
        return digest.hexdigest()


def applied_scopes(prim: Usd.Prim) -> list[str]:
    """Scopes of the parameter table ("domain", "solid", "emitter", "force") whose API is applied to the prim."""
    schemas = prim.GetAppliedSchemas()
    return [scope for api, scope in APIS.items() if api in schemas]


def find_prims(stage: Usd.Stage, scope: str) -> list[Usd.Prim]:
    """Prims of one scope in stage order, instance proxies included."""
    everything = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    return [prim for prim in everything if scope in applied_scopes(prim)]


def stage_units(stage: Usd.Stage) -> StageUnits:
    """Units of a stage."""
    return StageUnits(UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage))


class _Reader:
    """Reads attribute values at one time and converts them to SI."""

    def __init__(self, units: StageUnits, time: Usd.TimeCode) -> None:
        self.units = units
        self.time = time

    def value(self, prim: Usd.Prim, parameter: Parameter) -> Any:
        """The authored value in SI, or the table's default (which is SI already) where nothing is authored."""
        attribute = prim.GetAttribute(parameter.attribute)
        if not attribute or not attribute.HasAuthoredValue():
            return parameter.default
        raw = attribute.Get(self.time)
        if parameter.type == "token":
            return str(raw)
        if parameter.type in ("bool", "asset") or raw == -math.inf:  # -inf: "use the default"
            return parameter.default if raw == -math.inf else raw
        factor = self.units.factor(parameter.stage_unit)
        return [float(c) * factor for c in raw] if parameter.type == "vector" else float(raw) * factor

    def fields(self, prim: Usd.Prim, scope: str) -> dict[str, Any]:
        """{C field: SI value} of the parameters that map to one; vectors stay in world axes."""
        result = {}
        for parameter in table()[scope].values():
            if not parameter.field or parameter.usd_physics:
                continue
            value = self.value(prim, parameter)
            if parameter.type == "token":
                value = binding.WALLS[value] if parameter.name.startswith("wall") else _TOKENS[parameter.name][value]
            elif parameter.type == "bool":
                value = int(value)
            result[parameter.field] = value
        return result

    def authored(self, prim: Usd.Prim, name: str) -> Any:
        """Authored value of any attribute, None where there is none."""
        attribute = prim.GetAttribute(name)
        return attribute.Get(self.time) if attribute and attribute.HasAuthoredValue() else None

    def local_to_world(self, prim: Usd.Prim) -> np.ndarray:
        """(4, 4) for row vectors, at this reader's time."""
        return np.array(UsdGeom.XformCache(self.time).GetLocalToWorldTransform(prim))


def open_stage(path: Path) -> Usd.Stage:
    """Opens a scene file with the schema registered. Raises SceneError."""
    if not path.is_file():
        raise SceneError(f"{path}: {'is a folder, no scene file' if path.is_dir() else 'no such file'}")
    if not is_usd_file(path):
        raise SceneError(how_to_make_a_scene(path))
    try:
        return Usd.Stage.Open(str(path))
    except (Tf.ErrorException, UnicodeDecodeError) as error:  # bytes that are no text reach Python as the latter
        raise SceneError(f"{path}: cannot be opened as USD: {usd_reason(error)}") from error


def stage_frames(stage: Usd.Stage) -> FrameRange:
    """The stage's own range. Raises UsageError or SceneError."""
    if not stage.HasAuthoredTimeCodeRange():
        raise SceneError("stage: startTimeCode and endTimeCode are not authored; give --frames first-last")
    frames = _authored_range(stage)
    return check_frames(frames, f"stage range {frames}")


def _authored_range(stage: Usd.Stage) -> FrameRange:
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    if first != int(first) or last != int(last):
        raise SceneError(f"stage: startTimeCode {first:g} and endTimeCode {last:g}: must be whole numbers")
    return FrameRange(int(first), int(last))


def set_frames(stage: Usd.Stage, wanted: FrameRange | None, start: int | None) -> None:
    """Makes the frames that this run simulates the stage's own, on its session layer, for all that read them later.

    wanted: --frames, start: --start-frame. A simulation starts at the scene's first frame, whatever frames are wanted,
    unless `start` says otherwise; `wanted` gives the first where the stage has no range. Raises UsageError.
    """
    own = _authored_range(stage) if stage.HasAuthoredTimeCodeRange() else wanted
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


def read_scene(stage: Usd.Stage, path: Path, memory_limit: int = 0, threads: int | None = None) -> Scene:
    """Reads a stage that `checks.check_stage` found without errors, at its first frame.

    memory_limit: bytes that the simulation may take, 0 for no limit. threads: for the examination of the meshes, None
    for all. Raises SceneError for what only this reading finds: too fine a grid, files that do not load, meshes that
    the library refuses; Cancelled after a signal.
    """
    frames = stage_frames(stage)
    units = stage_units(stage)
    reader = _Reader(units, Usd.TimeCode(frames.first))
    domain_prim = _the_domain(stage)
    where = str(domain_prim.GetPath())
    space, scale, mirrored = domain_space(where, reader.local_to_world(domain_prim), units.meters_per_unit)
    domain = _domain_values(reader, domain_prim, scale * units.meters_per_unit, mirrored)
    for face in range(6):
        velocity = np.array(space.vector_to_sim(domain[f"wall_velocity[{face}]"]))
        velocity[np.abs(velocity) < 1e-9 * np.abs(velocity).max()] = 0.0  # what turning it has left
        domain[f"wall_velocity[{face}]"] = velocity.tolist()
    warnings: list[str] = []
    domain["gravity"] = space.vector_to_sim(_gravity(stage, units, warnings)).tolist()
    enabled = table()["solid"]["enabled"]
    solids = [_solid(reader, space, prim) for prim in find_prims(stage, "solid") if reader.value(prim, enabled)]
    pins = [pin for solid in solids for pin in _pins(reader, space, stage.GetPrimAtPath(solid.path), frames.first)]
    colliders = [
        _collider(reader, space, prim, frames.first)
        for prim in find_prims(stage, "collider")
        if reader.value(prim, enabled)
    ]
    memory.demand(where, domain, [solid.mesh for solid in solids], memory_limit, units.meters_per_unit)
    for solid in solids:
        _examine(solid, domain, threads or available_threads())
        prim = stage.GetPrimAtPath(solid.path)
        solid.values["density"] = _density(reader, prim, solid.report["solid_volume"])
    for given_body in [*(pin for pin in pins if pin.mesh), *colliders]:
        _examine(given_body, domain, threads or available_threads())
    passengers = [
        _passenger(reader, space, stage.GetPrimAtPath(solid.path), prim)
        for solid in solids
        for prim in find_passengers(stage.GetPrimAtPath(solid.path))
    ]
    emitters = [_emitter(reader, space, p) for p in find_prims(stage, "emitter") if reader.value(p, enabled)]
    if not domain["ambient_fluid"]:
        emitters = []  # nothing carries the smoke; check_stage warns
    forces = [force for prim in find_prims(stage, "force") for force in _forces(reader, space, prim, frames)]
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
    )


def _the_domain(stage: Usd.Stage) -> Usd.Prim:
    prims = find_prims(stage, "domain")
    if len(prims) != 1:
        found = ", ".join(str(p.GetPath()) for p in prims) or "none"
        raise SceneError(f"the scene must have exactly one prim with {DOMAIN_API} (found: {found})")
    return prims[0]


def _domain_values(reader: _Reader, prim: Usd.Prim, meters: np.ndarray, mirrored: bool) -> dict[str, Any]:
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


def slab_axis(domain: dict[str, Any]) -> int | None:
    """The axis along which the domain is one cell thick between slip walls: a 2-D scene; None: there is none."""
    for axis in (2, 1, 0):
        thin = math.ceil(domain["domain_size"][axis] / domain["voxel_size"] - 1e-6) <= 1
        walls = {domain[f"wall[{2 * axis}]"], domain[f"wall[{2 * axis + 1}]"]}
        if thin and walls == {binding.WALLS["slip"]}:
            return axis
    return None


def _gravity(stage: Usd.Stage, units: StageUnits, warnings: list[str]) -> np.ndarray:
    """World vector [m/s^2] from the PhysicsScene; 9.81 down without one."""
    up = np.array([0.0, 0.0, 1.0] if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else [0.0, 1.0, 0.0])
    scenes = [UsdPhysics.Scene(prim) for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene)]
    if len(scenes) > 1:
        warnings.append(f"{len(scenes)} PhysicsScene prims: gravity is taken from {scenes[0].GetPath()}")
    direction, magnitude = -up, EARTH_GRAVITY
    if scenes:
        authored = np.array(scenes[0].GetGravityDirectionAttr().Get(), float)
        if authored.any():
            direction = authored / math.sqrt((authored * authored).sum())
        given = scenes[0].GetGravityMagnitudeAttr().Get()
        if math.isfinite(given) and given >= 0:
            magnitude = given * units.meters_per_unit
        elif given != -math.inf:
            raise SceneError(
                f"{scenes[0].GetPath()}: physics:gravityMagnitude = {given}: must be >= 0 or -inf (9.81 m/s^2)"
            )
    return direction * magnitude


def _surface(reader: _Reader, prim: Usd.Prim) -> tuple[solver.Mesh, str, Pose]:
    """The prim's surface in its local space, posed as it starts, the file that it came from ('' for none), its pose."""
    path = str(prim.GetPath())
    asset = reader.authored(prim, "eulerfsi:surfaceFile")
    if asset is not None and asset.path:
        file = asset.resolvedPath or asset.path
        if not Path(file).is_file():
            raise SceneError(f"{path}: eulerfsi:surfaceFile = {asset.path}: no such file")
        try:
            return solver.load_mesh(file), file, Pose(prim, own_points=False)
        except LibraryError as error:
            raise SceneError(f"{path}: eulerfsi:surfaceFile = {asset.path}: {mesh_reason(file, error)}") from error
    if not prim.IsA(UsdGeom.Mesh):
        raise SceneError(f"{path}: a {prim.GetTypeName() or 'typeless'} prim needs eulerfsi:surfaceFile; or use a Mesh")
    geom = UsdGeom.Mesh(prim)
    pose = Pose(prim, own_points=True)
    try:
        points = pose.points(reader.time)
    except PoseError as error:
        raise SceneError(f"{path}: skel:skeleton = {pose.skeleton}: cannot be applied: {error}") from error
    counts = geom.GetFaceVertexCountsAttr().Get(reader.time)
    indices = geom.GetFaceVertexIndicesAttr().Get(reader.time)
    if not len(points) or not counts or not indices:
        raise SceneError(f"{path}: the mesh has no points or no faces at frame {reader.time.GetValue():g}")
    return solver.Mesh(points, np.array(counts), np.array(indices)), "", pose


def _solid(reader: _Reader, space: SimulationSpace, prim: Usd.Prim) -> Solid:
    """Surface, placement and values; the mesh is not examined yet and the density is missing."""
    path = str(prim.GetPath())
    if prim.IsInstanceProxy():
        raise SceneError(f"{path}: a solid inside an instance cannot be given its own points; set instanceable = false")
    local, file, pose = _surface(reader, prim)
    to_sim = space.from_local(reader.local_to_world(prim))
    handedness = determinant(to_sim)
    if handedness == 0:
        raise SceneError(f"{path}: the transform of the solid has a zero scale")
    mesh = solver.Mesh(transform_points(local.points, to_sim), local.counts, local.indices)
    is_mesh = prim.IsA(UsdGeom.Mesh)
    left_handed = is_mesh and not file and reader.authored(prim, "orientation") == UsdGeom.Tokens.leftHanded
    if left_handed != (handedness < 0):
        mesh = mesh.flipped()  # outward faces stay outward
    values = reader.fields(prim, "solid")
    animated = _animated_motion(reader, space, pose, local, mesh)
    values["velocity"], values["angular_velocity"] = _initial_motion(reader, space, prim, values, animated)
    subdivision = "none" if file or not is_mesh else str(UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get())
    output = path if is_mesh else _free_child(prim, "surface")
    start = _describe_start(reader, pose, animated, values)
    return Solid(path, output, mesh, local, values, None, file, subdivision, left_handed, start)


def _passenger(reader: _Reader, space: SimulationSpace, solid: Usd.Prim, prim: Usd.Prim) -> Passenger:
    """Where a prim is while the solid is in its rest shape: both as posed at the start."""
    path, is_mesh = str(prim.GetPath()), prim.IsA(UsdGeom.Mesh)
    counts = indices = subdivision = None
    if is_mesh:
        pose, mesh = Pose(prim, own_points=True), UsdGeom.Mesh(prim)
        try:
            points = pose.points(reader.time)
        except PoseError as error:
            raise SceneError(f"{path}: skel:skeleton = {pose.skeleton}: cannot be applied: {error}") from error
        counts = mesh.GetFaceVertexCountsAttr().Get(reader.time)
        indices = mesh.GetFaceVertexIndicesAttr().Get(reader.time)
        subdivision = str(mesh.GetSubdivisionSchemeAttr().Get())
    else:
        points = np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get(reader.time), float)
    local = solver.Mesh(points, np.array(counts or (), int), np.array(indices or (), int))
    if is_mesh and (local.counts.sum() != len(local.indices) or (local.indices >= len(local.points)).any()):
        raise SceneError(f"{path}: faceVertexCounts, faceVertexIndices and points of the mesh do not fit")
    to_sim = space.from_local(reader.local_to_world(prim))
    if determinant(to_sim) == 0:
        raise SceneError(f"{path}: the transform of what {solid.GetPath()} carries has a zero scale")
    placed = solver.Mesh(transform_points(local.points, to_sim), local.counts, local.indices)
    left_handed = is_mesh and reader.authored(prim, "orientation") == UsdGeom.Tokens.leftHanded
    return Passenger(path, str(solid.GetPath()), placed, local, subdivision or "", left_handed)


def _closed_mesh(reader: _Reader, space: SimulationSpace, prim: Usd.Prim) -> solver.Mesh:
    """The surface of a Gprim where it is at the start, in simulation space, faces outwards."""
    path = str(prim.GetPath())
    try:
        local = solver.Mesh(*gprims.surface_of(prim, reader.time))
    except (PoseError, ValueError) as error:
        raise SceneError(f"{path}: {error}") from error
    to_sim = space.from_local(reader.local_to_world(prim))
    handedness = determinant(to_sim)
    if handedness == 0:
        raise SceneError(f"{path}: its transform has a zero scale")
    mesh = solver.Mesh(transform_points(local.points, to_sim), local.counts, local.indices)
    left_handed = prim.IsA(UsdGeom.Mesh) and reader.authored(prim, "orientation") == UsdGeom.Tokens.leftHanded
    return mesh.flipped() if left_handed != (handedness < 0) else mesh


def _pins(reader: _Reader, space: SimulationSpace, solid: Usd.Prim, first: int) -> list[Pin]:
    """What holds parts of a solid: its volumes, and the vertices that its primvar marks."""
    stage, path = solid.GetStage(), str(solid.GetPath())
    pins = []
    for target in given.targets(solid, given.PINS):
        motion = Motion(str(target), stage, space, first)
        mesh = _closed_mesh(reader, space, stage.GetPrimAtPath(target))
        pins.append(Pin(str(target), path, motion, mesh=mesh))
    held = given.pinned_vertices(solid, reader.time)
    if held is not None:
        driver = next((str(target) for target in given.targets(solid, given.PIN_TO)), "")
        pins.append(Pin(path, path, Motion(driver, stage, space, first), vertices=held))
    return pins


def _collider(reader: _Reader, space: SimulationSpace, prim: Usd.Prim, first: int) -> Collider:
    motion = Motion(str(prim.GetPath()), prim.GetStage(), space, first)
    return Collider(str(prim.GetPath()), _closed_mesh(reader, space, prim), reader.fields(prim, "collider"), motion)


def _examine(solid: Solid | Pin | Collider, domain: dict[str, Any], threads: int) -> None:
    """Adds the surface that the library makes of the mesh; in a 2-D scene what of it lies in the slab."""
    waiting, signals = Waiting(f"{solid.path}: examining the surface"), Signals()

    def stop(fraction: float) -> bool:
        waiting.at(fraction)
        return bool(signals.number)

    try:
        with signals.installed():
            solid.surface = solver.Surface(solid.mesh, domain["voxel_size"], threads, stop)
        axis = slab_axis(domain)
        if axis is not None and not isinstance(solid, Pin):
            low = domain["domain_min"][axis]
            solid.surface = solid.surface.lay_in_slab(axis, low, low + domain["voxel_size"])
    except LibraryError as error:
        if error.status == binding.ERROR_CANCELLED:
            raise Cancelled(signals.number) from error
        source = getattr(solid, "surface_file", "")
        file = f"{source}: " if source else ""
        raise SceneError(f"{solid.path}: {file}{mesh_reason(source, error)}") from error


def _free_child(prim: Usd.Prim, name: str) -> str:
    """Path of a child that the prim does not have yet."""
    number, candidate = 1, name
    while prim.GetStage().GetPrimAtPath(prim.GetPath().AppendChild(candidate)):
        number, candidate = number + 1, f"{name}{number}"
    return str(prim.GetPath().AppendChild(candidate))


def _density(reader: _Reader, prim: Usd.Prim, volume: float) -> float:
    """[kg/m^3]: physics:mass over the volume, else physics:density, else that of the physics material, else 1000."""
    to_si = reader.units.factor("kg^1 m^-3")
    mass, density = reader.authored(prim, "physics:mass"), reader.authored(prim, "physics:density")
    if mass is not None and mass != 0:  # UsdPhysics: 0 is "not given"
        return mass * reader.units.kilograms_per_unit / volume
    if density is None:
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        density = reader.authored(material.GetPrim(), "physics:density") if material else None
    return density * to_si if density else DEFAULT_DENSITY


def _initial_motion(
    reader: _Reader,
    space: SimulationSpace,
    prim: Usd.Prim,
    values: dict[str, Any],
    animated: tuple[np.ndarray, np.ndarray],
) -> tuple[list[float], list[float]]:
    """Velocity [m/s] and angular velocity [rad/s] in simulation axes.

    eulerfsi: attributes are in world axes; PhysicsRigidBodyAPI's, used where those are not authored, in local axes;
    where neither is, the motion of the animation.
    """
    linear = reader.local_to_world(prim)[:3, :3]
    velocity, angular = animated
    rigid_velocity = reader.authored(prim, "physics:velocity")
    if reader.authored(prim, "eulerfsi:velocity") is not None:
        velocity = space.vector_to_sim(values["velocity"])
    elif rigid_velocity is not None:
        velocity = space.vector_to_sim(transform_vectors(rigid_velocity, linear)) * reader.units.meters_per_unit
    rigid_angular = reader.authored(prim, "physics:angularVelocity")
    if reader.authored(prim, "eulerfsi:angularVelocity") is not None:
        angular = space.vector_to_sim(values["angular_velocity"])
    elif rigid_angular is not None:
        # An axial vector: a mirror image turns the other way.
        turn = np.copysign(1.0, determinant(linear))
        turning = transform_vectors(np.radians(np.array(rigid_angular, float)), orthonormal_rows(linear)) * turn
        angular = space.vector_to_sim(turning)
    return velocity.tolist(), angular.tolist()


def _animated_motion(
    reader: _Reader, space: SimulationSpace, pose: Pose, local: solver.Mesh, mesh: solver.Mesh
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity [m/s] of the centre of volume and angular velocity [rad/s] that the animation has at the start.

    They come from the frame before and the frame after, where it moves in both; from the one in which it moves where it
    stands still in the other: an animation may begin or end at the start.
    """
    if not pose.drivers():
        return np.zeros(3), np.zeros(3)

    def surface(frame: float) -> np.ndarray | None:
        """None where the mesh is another one then, or none at all."""
        at = _Reader(reader.units, Usd.TimeCode(frame))
        if not pose.own_points:
            points = local.points
        elif not pose.has_faces(at.time, local.counts, local.indices):
            return None
        else:
            points = pose.points(at.time)
        matrix = at.local_to_world(pose.prim)
        whole = len(points) == len(local.points) and np.isfinite(points).all() and np.isfinite(matrix).all()
        return transform_points(points, space.from_local(matrix)) if whole and determinant(matrix) != 0 else None

    now = reader.time.GetValue()
    poses = {frame: surface(frame) for frame in (now - 1, now, now + 1)}
    poses = {frame: points for frame, points in poses.items() if points is not None}
    times = [frame for frame, points in poses.items() if frame == now or not np.array_equal(points, poses[now])]
    if len(times) == 1:
        return np.zeros(3), np.zeros(3)
    seconds = (times[-1] - times[0]) / pose.prim.GetStage().GetTimeCodesPerSecond()
    triangles = mesh.triangles()
    center = volume_center(mesh.points, triangles)
    return fit_rigid_motion(poses[times[0]], poses[times[-1]], triangles, seconds, center)


def _describe_start(
    reader: _Reader, pose: Pose, animated: tuple[np.ndarray, np.ndarray], values: dict[str, Any]
) -> str:
    """What gives a solid its pose and motion at the start, for people; '' where nothing but the mesh does."""
    sources = [f"skinned by {pose.skeleton}"] if pose.skeleton else []
    sources += ["blend shapes"] if pose.has_blend_shapes else []
    sources += [f"animated by {' and '.join(pose.drivers())}"] if pose.drivers() else []
    if not sources:
        return ""
    text = f"starts from its pose at frame {reader.time.GetValue():g} ({', '.join(sources)})"
    if pose.drivers() and not any(motion.any() for motion in animated):
        return f"{text}, where its animation gives it no motion"
    for name, unit, motion in zip(("velocity", "angular_velocity"), ("m/s", "rad/s"), animated, strict=True):
        if motion.any():
            kept = values[name] == motion.tolist()
            vector = ", ".join(f"{component:.4g}" for component in np.round(values[name], 9) + 0.0)
            text += f"; {name.replace('_', ' ')} ({vector}) {unit} {'of the animation' if kept else 'as authored'}"
    return text


def _region(reader: _Reader, space: SimulationSpace, prim: Usd.Prim, api: str) -> dict[str, Any]:
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
    return {"shape": binding.EMITTER_SHAPES[shape], "transform": to_sim.T.ravel().tolist()}


def _emitter(reader: _Reader, space: SimulationSpace, prim: Usd.Prim) -> Emitter:
    values = reader.fields(prim, "emitter")
    values |= _region(reader, space, prim, EMITTER_API)
    values["velocity"] = space.vector_to_sim(values["velocity"]).tolist()
    return Emitter(str(prim.GetPath()), values)


def _forces(reader: _Reader, space: SimulationSpace, prim: Usd.Prim, frames: FrameRange) -> list[Force]:
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


def _times_on(reader: _Reader, prim: Usd.Prim, frames: FrameRange) -> list[tuple[float, float]]:
    """Intervals in which eulerfsi:enabled is on, seconds after the first frame; its time samples are steps."""
    attribute = prim.GetAttribute("eulerfsi:enabled")
    fps = prim.GetStage().GetTimeCodesPerSecond()
    changes = [time for time in attribute.GetTimeSamples() if time > frames.first] if attribute else []
    edges = [frames.first, *changes]
    intervals: list[tuple[float, float]] = []
    for begin, end in zip(edges, [*edges[1:], math.inf], strict=True):
        if not _Reader(reader.units, Usd.TimeCode(begin)).value(prim, table()["force"]["enabled"]):
            continue
        start, stop = (begin - frames.first) / fps, (end - frames.first) / fps
        if intervals and intervals[-1][1] == start:
            start = intervals.pop()[0]
        intervals.append((start, stop))
    return intervals
