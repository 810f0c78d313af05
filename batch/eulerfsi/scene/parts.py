"""What a scene holds, in SI and simulation space: domain, solids, what is given, emitters, forces."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from eulerfsi_usd import deform, transforms
from eulerfsi_usd.issues import Issue
from eulerfsi_usd.pose import PoseError
from eulerfsi_usd.subdivide import Refinement
from pxr import Usd, UsdGeom

from ..frames import FrameRange
from ..parameters import StageUnits
from ..solver import binding
from ..solver import simulation as solver
from .follow import Binding
from .space import SimulationSpace, transform_points

if TYPE_CHECKING:
    from .moving_emitters import Stay
    from .tet_bodies import TetState

_RECENT = 4  # times of which a shape is kept


@dataclasses.dataclass
class Solid:
    """One solid. mesh: rest surface in simulation space; local: the same surface as the prim holds it."""

    rigid = False
    path: str
    output_path: str  # the prim that receives the points, '' where a cage does
    mesh: solver.Mesh
    local: solver.Mesh
    values: dict[str, Any]  # fields of EfsiSolidDef
    surface: solver.Surface | None = None  # the mesh as the library examined it
    surface_file: str = ""
    subdivision: str = "none"
    left_handed: bool = False
    pose: str = ""  # what the start follows from, '' for a mesh that stands still as it is
    start: solver.Surface | None = None  # `surface` where the solid starts, where it may be stretched
    tets: TetState | None = None  # of a body of the standard
    refinement: Refinement | None = None  # of a cage whose smooth surface is simulated
    cage: Passenger | None = None  # its points, which the prim receives
    origins: dict[str, str] = dataclasses.field(default_factory=dict)  # where values are from, for people

    @property
    def report(self) -> dict[str, Any]:
        """Fields of EfsiMeshReport."""
        return self.surface.report

    def start_bytes(self) -> bytes:
        """Where its points start and how they move then, where they do so one by one."""
        if not self.tets or not (self.tets.deforms or self.tets.velocities is not None):
            return b""
        velocities = b"" if self.tets.velocities is None else self.tets.velocities.tobytes()
        return self.tets.start.tobytes() + self.tets.corners.tobytes() + velocities


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
        return bool(self.driver) and transforms.moves(self.stage.GetPrimAtPath(self.driver))

    def pose(self, frame: float) -> np.ndarray:
        """(4, 4) for column vectors in simulation space: where a frame puts what lies there at the first frame."""
        if not self.moves:
            return np.eye(4)
        world = transforms.motions(self.stage.GetPrimAtPath(self.driver), [frame], self.first)[0]
        corners = self.space.point_to_world(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
        origin, *ends = transform_points(corners, self.space.from_local(world))
        pose = np.eye(4)
        pose[:3, :3] = np.stack([end - origin for end in ends], axis=1)
        pose[:3, 3] = origin
        return pose


@dataclasses.dataclass
class Deformation:
    """How the points of a collider move beside its motion. stretched: that is none, they move with its transform."""

    path: str
    stage: Usd.Stage
    space: SimulationSpace
    first: int
    stretched: bool
    refinement: Refinement | None = None  # of a cage

    def __post_init__(self) -> None:
        self.points = functools.lru_cache(_RECENT)(self.points)  # one asks more than once

    def points(self, frame: float) -> np.ndarray:
        """(n, 3) in simulation space: the motion of the collider places them in a frame. Raises PoseError."""
        prim = self.stage.GetPrimAtPath(self.path)
        time = Usd.TimeCode(frame if self.stretched else self.first)
        matrix = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
        points = deform.points_at(prim, frame)
        points = self.refinement.points(points) if self.refinement else points
        points = transform_points(points, self.space.from_local(np.array(matrix)))
        points.flags.writeable = False
        return points


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
    shape: Deformation | None = None  # of one that deforms
    refinement: Refinement | None = None  # of a cage
    surface: solver.Surface | None = None
    surface_file: str = ""

    def points(self, frame: int) -> np.ndarray:
        """(n, 3) where it is in a frame, simulation space."""
        points = self.shape.points(frame) if self.shape else self.mesh.points
        return transform_points(points, self.motion.pose(frame).T)

    @property
    def report(self) -> dict[str, Any]:
        """Fields of EfsiMeshReport."""
        return self.surface.report


@dataclasses.dataclass(kw_only=True)
class Carried:
    """What a body carries, drawn only. local: as of Solid; curves and points have no faces.

    rigid: a shape without points, such as a Sphere, whose transform follows; `local` is its surface.
    """

    path: str
    local: solver.Mesh
    subdivision: str  # "" where there are no faces
    left_handed: bool
    surface_file: str = ""
    rigid: bool = False

    @property
    def output_path(self) -> str:
        """The prim that receives the points."""
        return self.path


@dataclasses.dataclass(kw_only=True)
class Passenger(Carried):
    """What rides along with a solid. mesh: as of Solid, at rest; is_cage: it is the cage of the solid's surface."""

    solid: str  # path of the solid
    mesh: solver.Mesh
    is_cage: bool = False


@dataclasses.dataclass(kw_only=True)
class Rider(Carried):
    """What follows the surface of a collider. place: where that surface is; local: at the first frame."""

    collider: str  # path of the collider
    place: Deformation
    binding: Binding

    def __post_init__(self) -> None:
        self._own_points = functools.lru_cache(_RECENT)(self._own_points)  # each frame asks for those beside it, too

    @property
    def mesh(self) -> solver.Mesh:
        """Where it is at the first frame, simulation space."""
        return solver.Mesh(self.points(self.place.first), self.local.counts, self.local.indices)

    def points(self, frame: float) -> np.ndarray:
        """(n, 3) in a frame, simulation space. Raises PoseError."""
        return self.binding.points(self.place.points(frame))

    def in_own_space(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 3) and velocities (n, 3) [1/s] in the space of the prim.

        The velocities are the mean over the frame before and the frame after; where it stands still in one of them, or
        is another mesh there, that of the other: an animation may begin or end here.
        """
        now = self._own_points(frame)
        places = {frame: now}
        for time in (frame - 1, frame + 1):
            with contextlib.suppress(PoseError):
                points = self._own_points(time)
                if points is not None and np.abs(points - now).max() > deform.SAME * np.abs(now).max():
                    places[time] = points
        start, end = min(places), max(places)
        if start == end:
            return now, np.zeros_like(now)
        return now, (places[end] - places[start]) * (self.place.stage.GetTimeCodesPerSecond() / (end - start))

    def _own_points(self, frame: float) -> np.ndarray | None:
        """None where the collider is another mesh. Raises PoseError."""
        surface = self.place.points(frame)
        if len(surface) != self.binding.surface_points or not np.isfinite(surface).all():
            return None
        prim = self.place.stage.GetPrimAtPath(self.path)
        to_world = UsdGeom.XformCache(Usd.TimeCode(frame)).GetLocalToWorldTransform(prim)
        world = self.place.space.point_to_world(self.binding.points(surface))
        return transform_points(world, np.array(to_world.GetInverse()))


@dataclasses.dataclass
class Emitter:
    """One emitter. values: fields of EfsiEmitterDef; keys: of EfsiEmitterKey, empty where nothing changes in time.

    hull: surface of the region in simulation space; mesh: the same where it is no box or ball; surface: as the library
    examined that; stays: where it is, one after the other, if it moves.
    """

    path: str
    values: dict[str, Any]
    hull: solver.Mesh
    keys: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    mesh: solver.Mesh | None = None
    surface: solver.Surface | None = None
    stays: list[Stay] = dataclasses.field(default_factory=list)
    stage: Usd.Stage | None = None

    @property
    def report(self) -> dict[str, Any]:
        """Fields of EfsiMeshReport, of a mesh."""
        return self.surface.report

    @property
    def is_jet(self) -> bool:
        """Whether it blows, for longer than the first step."""
        return bool(self.values["has_velocity"]) and self.values["mode"] == binding.EMITTER_MODES["continuous"]

    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the box around the region, wherever it moves, simulation space [m]."""
        if self.stays:
            points = np.concatenate([stay.hull.points for stay in self.stays])
            return points.min(axis=0).astype(float), points.max(axis=0).astype(float)
        if self.mesh:
            return np.array(self.report["extent_min"]), np.array(self.report["extent_max"])
        matrix = np.reshape(self.values["transform"], (4, 4))[:3]
        rows = matrix[:, :3]
        ball = self.values["shape"] == binding.REGION_SHAPES["sphere"]
        reach = (np.sqrt((rows * rows).sum(axis=1)) if ball else np.abs(rows).sum(axis=1)) / 2
        return matrix[:, 3] - reach, matrix[:, 3] + reach

    def over_time(self, field: str) -> np.ndarray:
        """(times, ...) all values that a field has."""
        values = np.array([key[field] for key in self.keys or [self.values]], float)
        if field == "velocity" and self.stays:
            return np.concatenate([values + stay.velocity for stay in self.stays])
        return values


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
    warnings: list[Issue]
    passengers: list[Passenger] = dataclasses.field(default_factory=list)
    pins: list[Pin] = dataclasses.field(default_factory=list)
    colliders: list[Collider] = dataclasses.field(default_factory=list)
    riders: list[Rider] = dataclasses.field(default_factory=list)

    @property
    def simulated(self) -> list[Solid | Passenger]:
        """All that the solver has points of in every frame."""
        return [*self.solids, *self.passengers]

    @property
    def drawn(self) -> list[Solid | Passenger | Rider]:
        """All that gets points in every frame."""
        return [*(part for part in self.simulated if part.output_path), *self.riders]

    @property
    def name(self) -> str:
        """File name of the scene without its suffix; cache files carry it."""
        return self.path.stem

    @property
    def has_smoke(self) -> bool:
        """Whether volumes are written: something emits and there is a fluid to carry it."""
        return bool(self.emitters) and bool(self.domain["ambient_fluid"])

    @property
    def cells(self) -> int:
        """Cells of the domain."""
        edges = np.array(self.domain["domain_size"]) / self.domain["voxel_size"]
        return int(np.ceil(edges - 1e-6).prod())

    def parameters(self) -> dict[str, dict[str, Any]]:
        """{prim path: {field of the C definition: SI value}}: all that was used."""
        result = {self.domain_path: self.domain}
        for item in [*self.solids, *self.emitters, *self.forces, *self.colliders]:
            result[item.path] = dict(item.values)
        for emitter in self.emitters:
            for field in emitter.keys[0] if emitter.keys else ():
                result[emitter.path] |= {f"key_{field}": emitter.over_time(field).ravel().tolist()}
        for passenger in self.passengers:
            if not passenger.is_cage:
                result[passenger.path] = {"carried_by": passenger.solid}
        for rider in self.riders:
            result[rider.path] = {"carried_by": rider.collider}
        for pin in self.pins:
            result[f"{pin.path} (pin)"] = {"solid": pin.solid, "driver": pin.motion.driver}
        return json.loads(json.dumps(result))

    def bodies(self) -> dict[str, str]:
        """{prim path: digest of its mesh in the first frame} of what is simulated, drawn or a collider, in order."""
        result = {}
        for body in [*self.drawn, *self.colliders]:
            mesh = body.mesh
            digest = hashlib.sha256(mesh.points.tobytes() + mesh.counts.tobytes() + mesh.indices.tobytes())
            result[body.path] = digest.hexdigest()
        return result

    def poses(self, frame: int) -> dict[str, str]:
        """{prim path: digest of where a frame puts it} of pins and colliders. Raises PoseError."""
        result = {}
        for given in [*self.pins, *self.colliders]:
            points = given.points(frame) if isinstance(given, Collider) else given.motion.pose(frame)
            result[given.path] = hashlib.sha256(np.ascontiguousarray(points).tobytes()).hexdigest()
        return result

    def starts(self) -> dict[str, str]:
        """{prim path: digest} of what acts at the start alone and is no parameter of a solid."""
        parts = {solid.path: solid.start_bytes() for solid in self.solids}
        for emitter in self.emitters:
            if emitter.values["mode"] == binding.EMITTER_MODES["initial"]:
                parts[emitter.path] = json.dumps(emitter.values).encode() + emitter.hull.points.tobytes()
        return {path: hashlib.sha256(part).hexdigest() for path, part in parts.items() if part}

    def hash(self) -> str:
        """Hash of all that the simulation depends on: parameters, meshes, frame rate, first frame."""
        digest = hashlib.sha256()
        start = {"fps": self.fps, "first": self.frames.first, "parameters": self.parameters()}
        digest.update(json.dumps(start, sort_keys=True).encode())
        for solid in [*self.simulated, *self.riders]:
            for array in (solid.mesh.points, solid.mesh.counts, solid.mesh.indices):
                digest.update(array.tobytes())
        for solid in self.solids:
            digest.update(solid.start_bytes())
        for pin in self.pins:
            digest.update((pin.mesh.points if pin.mesh else pin.vertices).tobytes())
        for body in [*self.colliders, *(emitter for emitter in self.emitters if emitter.mesh)]:
            digest.update(body.mesh.points.tobytes() + body.mesh.indices.tobytes())
        for moved in [*self.pins, *self.colliders]:
            if moved.motion.moves:
                digest.update(transforms.motion_text(self.stage.GetPrimAtPath(moved.motion.driver)).encode())
        for emitter in self.emitters:
            if emitter.stays:
                digest.update(transforms.motion_text(emitter.stage.GetPrimAtPath(emitter.path)).encode())
                digest.update(np.array([stay.velocity for stay in emitter.stays]).tobytes())
        for collider in self.colliders:
            if collider.shape:
                digest.update(deform.shape_digest(self.stage.GetPrimAtPath(collider.path)))
        return digest.hexdigest()


def open_faces(domain: dict[str, Any]) -> list[int]:
    """The faces of the domain that let fluid in and out."""
    return [face for face in range(6) if domain[f"wall[{face}]"] == binding.WALLS["open"]]


def domain_box(domain: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner of the domain [m]."""
    low = np.array(domain["domain_min"])
    return low, low + np.array(domain["domain_size"])


def beyond_faces(domain: dict[str, Any], least: np.ndarray, most: np.ndarray) -> np.ndarray:
    """(6,) in the order of the faces, how far a box from `least` to `most` reaches beyond each [m]; < 0: inside."""
    low, high = domain_box(domain)
    return np.stack([low - least, most - high], axis=1).ravel()


def face_name(face: int) -> str:
    """A face of the domain as parameters name it: 0 XMin, 1 XMax, 2 YMin ..."""
    return f"{'XYZ'[face // 2]}{('Min', 'Max')[face % 2]}"
