"""The solver for Python: meshes, simulations, fields. SI units; a thin layer over `binding`.

Calls on one simulation must not overlap in time; a process may have any number of simulations.
"""

from __future__ import annotations

import ctypes
import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence
from ctypes import POINTER, byref, c_double, c_float, c_int32, c_uint32, c_uint64, c_void_p, sizeof
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import LibraryError
from . import binding, c_api, mesh_file
from .binding import check_error, define, library, read

LogFunction = Callable[[int, str], None]
ProgressFunction = Callable[[float, dict], bool]


@dataclasses.dataclass
class Mesh:
    """A polygon mesh.

    points: (n, 3) float32 [m]; counts: corners of each face, (faces,) int32; indices: points of the faces, one face
    after the other, (sum of counts,) int32. Other arrays and lists are converted. objects: of a mesh that was read from
    a file, the name and the number of faces of each of its objects, in the order of the faces; names may repeat, and
    are "" where the file has none.
    """

    points: np.ndarray
    counts: np.ndarray
    indices: np.ndarray
    objects: Sequence[tuple[str, int]] = ()

    def __post_init__(self) -> None:
        self.points = np.ascontiguousarray(self.points, np.float32).reshape(-1, 3)
        self.counts = np.ascontiguousarray(self.counts, np.int32)
        self.indices = np.ascontiguousarray(self.indices, np.int32)

    def triangles(self) -> np.ndarray:
        """(m, 3) int32: every polygon as a fan around its first vertex."""
        if len(self.counts) and (self.counts == 3).all():
            return self.indices.reshape(-1, 3)
        starts = np.concatenate([[0], np.cumsum(self.counts)[:-1]]) if len(self.counts) else np.zeros(0, int)
        fans = []
        for count in np.unique(self.counts[self.counts >= 3]):
            first = starts[self.counts == count][:, None]
            polygon = self.indices[first + np.arange(count)]
            fans += [polygon[:, [0, k, k + 1]] for k in range(1, count - 1)]
        return np.concatenate(fans) if fans else np.zeros((0, 3), np.int32)

    def flipped(self) -> Mesh:
        """The same surface with every face wound the other way."""
        ends = np.cumsum(self.counts)
        owner = np.repeat(np.arange(len(self.counts)), self.counts)
        position = np.arange(len(self.indices)) - (ends - self.counts)[owner]
        return Mesh(self.points, self.counts, self.indices[ends[owner] - 1 - position])

    def view(self) -> c_api.MeshView:
        """The C view; valid while this object lives."""
        view = c_api.MeshView(point_count=len(self.points), point_stride=12)
        view.points = self.points.ctypes.data
        view.face_vertex_counts, view.face_count = self.counts.ctypes.data, len(self.counts)
        view.face_vertex_indices, view.index_count = self.indices.ctypes.data, len(self.indices)
        return view


def to_dict(struct: ctypes.Structure) -> dict[str, Any]:
    """A result structure as plain numbers and lists, without padding."""
    result = {}
    for name, *_ in struct._fields_:
        value = getattr(struct, name)
        if name == "padding":
            continue
        result[name] = list(value) if isinstance(value, (c_api.Vec3, ctypes.Array)) else value
    return result


def _fill(struct: ctypes.Structure, values: Mapping[str, Any]) -> None:
    """Writes values into a definition; "wall[2]" is an element, a sequence of 3 a vector. Unknown names raise."""
    fields = {name for name, *_ in struct._fields_}
    for name, value in values.items():
        base, _, index = name.partition("[")
        if base not in fields:
            raise KeyError(f"{type(struct).__name__} has no field {name!r}; it has {', '.join(sorted(fields))}")
        current = getattr(struct, base)
        if index and isinstance(current[int(index[:-1])], c_api.Vec3):
            current[int(index[:-1])] = c_api.Vec3(*(float(c) for c in value))
        elif index:
            current[int(index[:-1])] = value
        elif isinstance(current, c_api.Vec3):
            current.x, current.y, current.z = (float(c) for c in value)
        elif isinstance(current, ctypes.Array):
            current[:] = [float(c) for c in np.asarray(value).ravel()]
        else:
            setattr(struct, base, value)


def load_mesh(path: str | Path, memory_limit: int | None = None) -> Mesh:
    """Reads a mesh file (`mesh_file.FORMATS`) in the file's own units, in a child process (`mesh_file.read`).

    memory_limit: bytes, default what a simulation may take. Raises LibraryError with status ERROR_IO for a file that
    cannot be read, ERROR_MESH for another suffix or damaged content, ERROR_MEMORY beyond the limit.
    """
    return Mesh(*mesh_file.read(path, memory_limit))


class Surface:
    """The solid bounded by a mesh, prepared for one voxel size [m]. Constant; any number of simulations may use it.

    threads: 0 for one per processor. progress(completed fraction) is called repeatedly on this thread; returning True
    cancels. An exception inside it cancels too and is raised here. Raises LibraryError with status ERROR_MESH for a
    mesh that bounds no solid, ERROR_CANCELLED after a cancellation.

    Attributes: mesh; report, the fields of EfsiMeshReport; repairs, the description of the repairs, "" without any.
    """

    def __init__(
        self, mesh: Mesh, voxel_size: float, threads: int = 0, progress: Callable[[float], bool] | None = None
    ) -> None:
        self.mesh, self._lib, self._handle = mesh, library(), c_void_p()
        error, view, raised = c_api.Error(), mesh.view(), []

        def forward(_user: Any, fraction: float) -> int:
            return _stops(raised, lambda: progress(fraction))

        callback = c_api.SurfaceProgress(forward) if progress else c_api.SurfaceProgress()
        status = self._lib.efsi_surface_create(
            byref(view), voxel_size, threads, callback, None, byref(self._handle), byref(error)
        )
        if raised:
            raise raised[0]
        check_error(status, error)
        self._describe()

    def _describe(self) -> None:
        status, report = read(c_api.MeshReport, self._lib.efsi_surface_get_report, self._handle)
        check_error(status, c_api.Error())
        self.report = to_dict(report)
        self.repairs = self._lib.efsi_surface_get_repair_text(self._handle).decode("utf-8", "replace")

    def extrude_in_slab(self, axis: int, low: float, high: float) -> Surface:
        """Extrudes the section of the surface for a slab, a domain one cell thick along the axis, from low to high [m].

        axis: 0 to 2. Raises LibraryError with status ERROR_MESH for a mesh that does not extend through the slab.
        """
        slab, error = Surface.__new__(Surface), c_api.Error()
        slab.mesh, slab._lib, slab._handle = self.mesh, self._lib, c_void_p()
        check_error(
            self._lib.efsi_surface_extrude_in_slab(self.handle, axis, low, high, byref(slab._handle), byref(error)),
            error,
        )
        slab._describe()
        return slab

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._lib.efsi_surface_destroy(self._handle)

    def overlap(self, other: Surface) -> tuple[float, float]:
        """Returns the diameter of the largest ball inside both [m] and the volume of their intersection [m^3]."""
        depth, volume, error = c_double(), c_double(), c_api.Error()
        check_error(
            self._lib.efsi_surface_get_overlap(self.handle, other.handle, byref(depth), byref(volume), byref(error)),
            error,
        )
        return depth.value, volume.value

    @property
    def handle(self) -> c_void_p:
        """The C handle; valid while this object lives."""
        return self._handle


def _stops(raised: list[BaseException], ask: Callable[[], Any]) -> int:
    """What a progress callback returns to C; an exception must not cross its frames and is kept in `raised`."""
    try:
        return int(bool(ask()))
    except BaseException as error:
        raised.append(error)
        return 1


class Simulation:
    """Solids and a fluid in a box. A context manager: leaving it frees the memory, as close() does.

    values: fields of EfsiSimulationDef by name (SI); omitted ones keep their defaults. An element of an array field is
    "wall[2]". log(level, message): receives the library's messages.

    Attribute names: {"solid 1": the caller's name for it}, likewise "collider 1" and "pin 1"; messages of the library
    append it to the number, and errors have the first that they name as their `prim`. point_to_world: what makes the
    caller's own coordinates of a place, "at (x, y, z) m", in a message; None: they stay.

    A method that fails raises LibraryError. Its status (`binding.ERROR_*`) is ERROR_ARGUMENT for an unknown id, a value
    outside its limits and a call at the wrong time, ERROR_MEMORY when memory runs out; docstrings name the others. A
    name that is no field of a definition raises KeyError. Ids count from 1.
    """

    def __init__(self, values: Mapping[str, Any], log: LogFunction | None = None) -> None:
        self._lib = library()
        self._handle = c_void_p()
        self.names: dict[str, str] = {}
        self.point_to_world: Callable[[np.ndarray], np.ndarray] | None = None
        self._surface_points: dict[int, int] = {}  # number of points by id
        self._passenger_points: dict[int, int] = {}
        self._log = (
            c_api.LogCallback(lambda _user, level, text: log(level, self._named(text.decode("utf-8", "replace"))[0]))
            if log
            else None
        )
        definition, error = _simulation_def(values), c_api.Error()
        if self._log:
            definition.log = self._log
        check_error(self._lib.efsi_simulation_create(byref(definition), byref(self._handle), byref(error)), error)

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Frees the simulation; no calls are possible afterwards."""
        handle, self._handle = self._handle, c_void_p()
        self._lib.efsi_simulation_destroy(handle)

    def _check(self, status: int) -> None:
        if status != binding.OK:
            text = self._lib.efsi_simulation_last_error(self._handle).decode("utf-8", "replace")
            text, names = self._named(text)
            raise LibraryError(status, text or binding.status_text(status), names[0] if names else "")

    def _named(self, text: str) -> tuple[str, list[str]]:
        """A message with the caller's names, and those that it has."""
        found = []

        def with_name(match: re.Match[str]) -> str:
            if match[0] not in self.names:
                return match[0]
            found.append(self.names[match[0]])
            return f"{match[0]} ({found[-1]})"

        def placed(match: re.Match[str]) -> str:
            if not self.point_to_world:
                return match[0]
            place = self.point_to_world(np.array([float(number) for number in match[1].split(",")]))
            return f"at ({', '.join(f'{number:.4g}' for number in place)})"

        text = re.sub(r"\bat \((\S+, \S+, \S+)\) m\b", placed, text)
        return re.sub(r"\b(?:solid|collider|pin) \d+\b", with_name, text), found

    def add_solid(self, shape: Mesh | Surface, **values: Any) -> tuple[int, dict[str, Any]]:
        """Adds a solid before the first step. Returns its id and the fields of EfsiMeshReport.

        shape: a mesh, or a surface prepared for this voxel size. values: fields of EfsiSolidDef (SI). ERROR_ARGUMENT as
        well where it extends beyond the box or overlaps another solid by more than half a voxel; ERROR_MESH for a mesh
        that bounds no solid or contains no cell.
        """
        definition, identifier = self._solid_def(shape, values), c_uint32()
        self._check(self._lib.efsi_solid_add(self._handle, byref(definition), byref(identifier)))
        self._surface_points[identifier.value] = _point_count(shape)
        return identifier.value, self._read(c_api.MeshReport, self._lib.efsi_solid_get_mesh_report, identifier)

    def _solid_def(self, shape: Mesh | Surface, values: Mapping[str, Any]) -> c_api.SolidDef:
        definition = define(c_api.SolidDef)
        _fill(definition, values)
        if isinstance(shape, Surface):
            definition.surface = shape.handle
        else:
            definition.mesh = shape.view()
        return definition

    def add_collider(self, shape: Mesh | Surface, **values: Any) -> tuple[int, int]:
        """Adds a collider, a body of given motion, before the first step. Returns its ids as a solid and as a pin.

        shape: as in add_solid; it may extend beyond the box. values: friction. ERROR_MESH for a mesh without a volume.
        """
        definition, solid, pin = self._solid_def(shape, values), c_uint32(), c_uint32()
        status = self._lib.efsi_collider_add(self._handle, byref(definition), byref(solid), byref(pin))
        self._check(status)
        self._surface_points[solid.value] = _point_count(shape)
        return solid.value, pin.value

    def add_pin(self, solid: int, where: Surface | np.ndarray) -> int:
        """Pins a part of a solid, before the first step. Returns the pin's id.

        where: a volume in the space of the rest shape, or (vertices,) true where a vertex of its mesh is pinned.
        ERROR_ARGUMENT as well for a volume without a node of the solid.
        """
        pin = c_uint32()
        if isinstance(where, Surface):
            status = self._lib.efsi_pin_add_volume(self._handle, solid, where.handle, byref(pin))
        else:
            marked = np.ascontiguousarray(where, np.uint8)
            status = self._lib.efsi_pin_add_vertices(self._handle, solid, marked.ctypes.data, len(marked), byref(pin))
        self._check(status)
        return pin.value

    def set_motion(self, pin: int, start: float, end: float, poses: tuple[np.ndarray, np.ndarray]) -> None:
        """Moves a pin or a collider from one pose to another between two times [s].

        poses: (4, 4) each, rigid, for column vectors; they are applied to the rest position [m], and the first has to
        be the current one. Called between two calls of advance; not part of the state.
        """
        before, after = (np.ascontiguousarray(pose, np.float64) for pose in poses)
        status = self._lib.efsi_pin_set_motion(self._handle, pin, start, end, before.ctypes.data, after.ctypes.data)
        self._check(status)

    def set_points(self, pin: int, start: float, end: float, points: tuple[np.ndarray, np.ndarray]) -> None:
        """Moves the points of a collider along straight lines between two times [s].

        points: (n, 3) each, in the order of its mesh, simulation space [m]; set_motion's poses are applied to them. The
        first have to be the current ones. ERROR_MESH, here or from advance, where they bound no volume.
        """
        before, after = (np.ascontiguousarray(part, np.float32) for part in points)
        status = self._lib.efsi_collider_set_points(
            self._handle, pin, start, end, before.ctypes.data, after.ctypes.data, min(len(before), len(after))
        )
        self._check(status)

    def pin_reaction(self, pin: int) -> dict[str, Any]:
        """Returns the fields of EfsiPinReaction: what a pin exerted in the last step [kg m/s, kg m^2/s, m, J]."""
        return self._read(c_api.PinReaction, self._lib.efsi_pin_get_reaction, pin)

    def add_emitter(self, volume: Surface | None = None, keys: Sequence[Mapping] = (), **values: Any) -> int:
        """Adds an emitter before the first step. values: fields of EfsiEmitterDef (SI). Returns its id.

        volume: a closed mesh instead of a box or a ball. keys: fields of EfsiEmitterKey in the order of their times,
        instead of constant values. ERROR_ARGUMENT as well for a region without a cell centre.
        """
        definition, identifier = define(c_api.EmitterDef), c_uint32()
        _fill(definition, values)
        if volume:
            status = self._lib.efsi_emitter_add_volume(
                self._handle, byref(definition), volume.handle, byref(identifier)
            )
        else:
            status = self._lib.efsi_emitter_add(self._handle, byref(definition), byref(identifier))
        self._check(status)
        if keys:
            array = (c_api.EmitterKey * len(keys))()
            for key, fields in zip(array, keys, strict=True):
                _fill(key, fields)
            self._check(
                self._lib.efsi_emitter_set_keys(self._handle, identifier, array, sizeof(c_api.EmitterKey), len(keys))
            )
        return identifier.value

    def emitter_flux(self, emitter: int) -> float:
        """Returns the volume flux of an emitter into the box in the last step [m^3/s]."""
        out = c_double()
        self._check(self._lib.efsi_emitter_get_flux(self._handle, emitter, byref(out)))
        return out.value

    def add_passenger(self, solid: int, points: np.ndarray) -> int:
        """Adds points, (n, 3) [m] in the solid's rest shape, that follow its material. Returns their id.

        ERROR_ARGUMENT as well for a point more than 6 voxels outside the solid.
        """
        identifier, rest = c_uint32(), np.ascontiguousarray(points, np.float32)
        status = self._lib.efsi_passenger_add(self._handle, solid, rest.ctypes.data, len(rest), byref(identifier))
        self._check(status)
        self._passenger_points[identifier.value] = len(rest)
        return identifier.value

    def passenger(self, identifier: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns current positions [m] and velocities [m/s] of a passenger's points, (n, 3) float32 each."""
        return self._points(self._lib.efsi_passenger_get_points, identifier, self._passenger_points)

    def _points(self, call: Callable[..., int], identifier: int, counts: dict[int, int]) -> tuple[np.ndarray, ...]:
        count = counts.get(identifier, 0)
        points, velocities = (np.empty((count, 3), np.float32) for _ in range(2))
        self._check(call(self._handle, identifier, points.ctypes.data, velocities.ctypes.data, count))
        return points, velocities

    def add_force(self, **values: Any) -> int:
        """Adds a force before the first step. values: fields of EfsiForceDef (SI). Returns its id."""
        definition, identifier = define(c_api.ForceDef), c_uint32()
        _fill(definition, values)
        self._check(self._lib.efsi_force_add(self._handle, byref(definition), byref(identifier)))
        return identifier.value

    def step(self, max_dt: float) -> dict[str, Any]:
        """Makes one step of at most max_dt seconds. Returns the fields of EfsiStepInfo.

        ERROR_DIVERGED as in advance.
        """
        return self._read(c_api.StepInfo, self._lib.efsi_simulation_step, max_dt)

    def advance(self, duration: float, progress: ProgressFunction | None = None) -> dict[str, Any]:
        """Advances by `duration` seconds; returns EfsiStepInfo, counters summed over the steps.

        progress(fraction, step info) is called between steps; True asks to stop, which is ERROR_CANCELLED: the state is
        that of the last step. An exception inside it stops the run and is raised here. ERROR_DIVERGED where a step
        failed at its smallest size or a solid lost its shape: the state is that of the last valid step.
        """
        info, raised = c_api.StepInfo(), []

        def forward(_user: Any, fraction: float, step: Any) -> int:
            return _stops(raised, lambda: progress(fraction, to_dict(step.contents) if step else {}))

        callback = c_api.ProgressCallback(forward) if progress else c_api.ProgressCallback()
        status = self._lib.efsi_simulation_advance(self._handle, duration, byref(info), sizeof(info), callback, None)
        if raised:
            raise raised[0]
        self._check(status)
        return to_dict(info)

    @property
    def time(self) -> float:
        """Returns the simulated time [s]."""
        return self._time_and_steps()[0]

    @property
    def steps(self) -> int:
        """Returns the number of steps since time 0."""
        return self._time_and_steps()[1]

    def _time_and_steps(self) -> tuple[float, int]:
        time, steps = c_double(), c_uint64()
        self._check(self._lib.efsi_simulation_get_time(self._handle, byref(time), byref(steps)))
        return time.value, steps.value

    def state_hash(self) -> str:
        """Returns the 64-bit hash of the state, 16 hexadecimal digits."""
        value = c_uint64()
        self._check(self._lib.efsi_simulation_get_hash(self._handle, byref(value)))
        return f"{value.value:016x}"

    def save_checkpoint(self, path: str | Path) -> None:
        """Writes the state to a file. ERROR_IO where it cannot be written."""
        self._check(self._lib.efsi_simulation_save_checkpoint(self._handle, str(path).encode()))

    def restore_checkpoint(self, path: str | Path) -> None:
        """Restores a state of the same definitions; allowed at any time.

        ERROR_IO for a file that cannot be read, ERROR_CHECKPOINT for one of another scene or version.
        """
        self._check(self._lib.efsi_simulation_restore_checkpoint(self._handle, str(path).encode()))

    def restore_state(self, path: str | Path) -> None:
        """Restores the state of a simulation with other parameters, emitters, forces, pins; allowed at any time.

        The box, the voxel size and the meshes of solids and colliders have to be the same. ERROR_IO, ERROR_CHECKPOINT
        as in restore_checkpoint.
        """
        self._check(self._lib.efsi_simulation_restore_state(self._handle, str(path).encode()))

    def restore_solids(self, path: str | Path) -> None:
        """Restores the solids' shape, velocity and plastic strain from a checkpoint, before the first step.

        The box, the voxel size and the solids have to be the same. ERROR_IO, ERROR_CHECKPOINT as in restore_checkpoint.
        """
        self._check(self._lib.efsi_simulation_restore_solids(self._handle, str(path).encode()))

    def surface(self, solid: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns current positions [m] and velocities [m/s] of the points of a solid's mesh, (n, 3) float32 each.

        solid: the id of a solid or collider.
        """
        return self._points(self._lib.efsi_solid_get_surface, solid, self._surface_points)

    def solid_diagnostics(self, solid: int) -> dict[str, Any]:
        """Returns the fields of EfsiSolidDiagnostics: integrals and extrema of a solid now (SI)."""
        return self._read(c_api.SolidDiagnostics, self._lib.efsi_solid_get_diagnostics, solid)

    def fluid_diagnostics(self) -> dict[str, Any]:
        """Returns the fields of EfsiFluidDiagnostics: integrals and extrema of the fluid now (SI)."""
        return self._read(c_api.FluidDiagnostics, self._lib.efsi_simulation_get_fluid_diagnostics)

    def repairs(self) -> dict[str, Any]:
        """Returns the fields of EfsiRepairs: cells with an invalid map in the last step."""
        return self._read(c_api.Repairs, self._lib.efsi_simulation_get_repairs)

    def contacts(self) -> list[dict[str, Any]]:
        """Returns the fields of EfsiContactPair for all pairs in contact in the last call of `step` or `advance`."""
        return self._read_array(c_api.ContactPair, self._lib.efsi_simulation_get_contacts)

    def transport_error(self, solid: int) -> dict[str, Any]:
        """Returns the fields of EfsiTransportError: errors of the transport in the last step, before a correction."""
        return self._read(c_api.TransportError, self._lib.efsi_solid_get_transport_error, solid)

    def energy_ledger(self) -> dict[str, Any]:
        """Returns the energies of the last step [J].

        {"at_end": {form: energy}, "at_start": the same, "change": {stage: {form: change}}, "source_work": work}. Forms:
        fields of EfsiEnergy; stages: binding.ENERGY_STAGES. ERROR_ARGUMENT where energy_ledger is off.
        """
        ledger = self._read(c_api.EnergyLedger, self._lib.efsi_simulation_get_energy_ledger)
        changes = (c_api.Energy * len(binding.ENERGY_STAGES))()
        self._check(self._lib.efsi_simulation_get_energy_changes(self._handle, changes, len(changes), None))
        change = dict(zip(binding.ENERGY_STAGES, map(to_dict, changes), strict=True))
        energies = {name: to_dict(ledger[name]) for name in ("at_end", "at_start")}
        return {**energies, "change": change, "source_work": ledger["source_work"]}

    def profile(self) -> dict[str, Any]:
        """Returns the fields of EfsiProfile, and those of EfsiStageProfile as dicts by stage."""
        result = self._read(c_api.Profile, self._lib.efsi_simulation_get_profile)
        stages = self._read_array(c_api.StageProfile, self._lib.efsi_simulation_get_stages)
        for name in ("seconds", "tiles", "bytes"):
            result[name] = {stage: values[name] for stage, values in zip(binding.STAGES, stages, strict=False)}
        return result

    def _read(self, kind: type[ctypes.Structure], call: Callable[..., int], *arguments: object) -> dict[str, Any]:
        status, out = read(kind, call, self._handle, *arguments)
        self._check(status)
        return to_dict(out)

    def _read_array(self, kind: type[ctypes.Structure], call: Callable[..., int]) -> list[dict[str, Any]]:
        count = c_uint64()
        self._check(call(self._handle, None, sizeof(kind), 0, byref(count)))
        array = (kind * count.value)()
        self._check(call(self._handle, array, sizeof(kind), count.value, byref(count)))
        return [to_dict(element) for element in array]

    def reset_profile(self) -> None:
        """Resets the profile's sums to zero."""
        self._check(self._lib.efsi_simulation_reset_profile(self._handle))

    def field(self, name: str, solid: int = 0) -> tuple[np.ndarray, dict[str, Any]]:
        """Returns a copy of a field, (components, nx, ny, nz) float32, and its place, as field_view does."""
        views, place = self.field_view(name, solid)
        return np.stack(views), place

    def field_view(self, name: str, solid: int = 0) -> tuple[tuple[np.ndarray, ...], dict[str, Any]]:
        """Returns a field without copying it: a read-only array (nx, ny, nz) float32 per component, and its place.

        name: a key of binding.FIELDS, the names of EfsiField; solid: the id for a field of one solid. Place:
        {"origin": position of element (0, 0, 0) [m], "spacing": [m], "cell_centered": False for values at nodes}.
        Arrays of a field that the scene does not use are empty, (0, 0, 0).

        The arrays are the library's memory, valid until the next call that steps, restores, sets or closes. Reading
        them later is undefined; `field` copies.
        """
        status, view = read(c_api.FieldView, self._lib.efsi_field_get_view, self._handle, binding.FIELDS[name], solid)
        self._check(status)
        place = {"origin": list(view.origin), "spacing": view.spacing, "cell_centered": bool(view.cell_centered)}
        return tuple(_component(view, k) for k in range(view.components)), place

    def set_field(self, name: str, values: np.ndarray, solid: int = 0) -> None:
        """Replaces a field; values: (components, nx, ny, nz) as `field` returns it.

        name: velocity, smoke_density, smoke_temperature, solid_displacement or solid_velocity; the first three need
        ambient fluid. ERROR_ARGUMENT as well for another shape and for a value that is not finite.
        """
        flat = np.concatenate([np.asarray(part, np.float32).ravel(order="F") for part in values])
        self._check(self._lib.efsi_field_set(self._handle, binding.FIELDS[name], solid, flat.ctypes.data, len(flat)))

    def write_vdb(self, path: str | Path, **values: Any) -> str:
        """Writes one .vdb with all grids. Returns the content hash, 16 hexadecimal digits.

        values: fields of EfsiVdbDef. ERROR_IO where the file cannot be written.
        """
        definition, content = define(c_api.VdbDef), c_uint64()
        _fill(definition, values)
        self._check(self._lib.efsi_vdb_write(self._handle, str(path).encode(), byref(definition), byref(content)))
        return f"{content.value:016x}"


def _point_count(shape: Mesh | Surface) -> int:
    return len((shape.mesh if isinstance(shape, Surface) else shape).points)


def _component(view: c_api.FieldView, index: int) -> np.ndarray:
    """One component of a field: the library's memory, read-only; empty where there is none."""
    size, data = tuple(view.size), view.data[index]
    if 0 in size or not data:
        empty = np.zeros((0, 0, 0), np.float32)
        empty.flags.writeable = False
        return empty
    extent = 1 + sum((n - 1) * stride for n, stride in zip(size, view.stride, strict=True))
    flat = np.ctypeslib.as_array(ctypes.cast(data, POINTER(c_float)), (extent,))
    strides = tuple(flat.itemsize * stride for stride in view.stride)
    return np.lib.stride_tricks.as_strided(flat, size, strides, writeable=False)


def _simulation_def(values: Mapping[str, Any]) -> c_api.SimulationDef:
    definition = define(c_api.SimulationDef)
    _fill(definition, values)
    return definition


def estimate_memory(values: Mapping[str, Any], solid_volume: float) -> tuple[int, float]:
    """Returns the bytes that a simulation will need, and the smallest voxel size [m] within the memory limit or 0.

    values: fields of EfsiSimulationDef; solid_volume: sum of the bounding-box volumes of the solids [m^3]. Raises
    LibraryError with status ERROR_MEMORY where no voxel size is within values["memory_limit"].
    """
    error, count, fitting, definition = c_api.Error(), c_uint64(), c_double(), _simulation_def(values)
    check_error(
        library().efsi_simulation_estimate_memory(
            byref(definition), solid_volume, byref(count), byref(fitting), byref(error)
        ),
        error,
    )
    return count.value, fitting.value


def slab_axis(values: Mapping[str, Any]) -> int | None:
    """Returns the axis along which a domain is one cell thick between slip walls, a scene in 2-D; None: there is none.

    values: fields of EfsiSimulationDef. None as well where they are invalid.
    """
    axis = c_int32(-1)
    library().efsi_simulation_def_get_slab_axis(byref(_simulation_def(values)), byref(axis), None)
    return axis.value if axis.value >= 0 else None


def step_limits(values: Mapping[str, Any], lightest_density: float) -> dict[str, float]:
    """Returns the fields of EfsiStepLimits: limits of the step that a simulation keeps [cells].

    values: fields of EfsiSimulationDef; lightest_density: of the solids [kg/m^3]. Raises LibraryError.
    """
    limits, error = c_api.StepLimits(), c_api.Error()
    call = library().efsi_simulation_def_get_step_limits
    status = call(byref(_simulation_def(values)), lightest_density, byref(limits), sizeof(limits), byref(error))
    check_error(status, error)
    return to_dict(limits)


def nearest_on_triangles(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the triangle nearest to each point, (n,) int64, and the weights of its corners there, (n, 3) float64.

    corners: (m, 3, 3) of triangles, m > 0; points: (n, 3). Of equally near triangles the first. Raises LibraryError for
    a value that is not finite.
    """
    corners, points = (np.ascontiguousarray(values, np.float64) for values in (corners, points))
    triangles, weights, error = np.zeros(len(points), np.uint32), np.zeros((len(points), 3)), c_api.Error()
    status = library().efsi_triangles_find_nearest(
        corners.ctypes.data,
        len(corners),
        points.ctypes.data,
        len(points),
        triangles.ctypes.data_as(POINTER(c_uint32)),
        weights.ctypes.data_as(POINTER(c_double)),
        byref(error),
    )
    check_error(status, error)
    return triangles.astype(np.int64), weights
