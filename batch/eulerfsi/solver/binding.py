"""The C API in ctypes: structures, constants and prototypes, field for field as in libeulerfsi/include/eulerfsi/.

Nothing is interpreted here; `solver.py` wraps it for Python. `STRUCTURES` lists every structure for the size test.
"""

from __future__ import annotations

import ctypes
import functools
import os
from ctypes import (
    POINTER,
    Structure,
    c_char,
    c_char_p,
    c_double,
    c_float,
    c_int32,
    c_int64,
    c_uint32,
    c_uint64,
    c_void_p,
)

from .. import paths
from ..errors import EulerFsiError, LibraryError

OK = 0
ERROR_INTERNAL, ERROR_ARGUMENT, ERROR_MESH, ERROR_DIVERGED = 1, 2, 3, 4
ERROR_IO, ERROR_MEMORY, ERROR_CANCELLED, ERROR_CHECKPOINT = 5, 6, 7, 8

PRESETS = {"production": 0, "paper2016": 1}
WALLS = {"slip": 0, "noSlip": 1, "open": 2, "periodic": 3}
MATERIALS = {"corotational": 0, "stableNeoHookean": 1, "stVenantKirchhoff": 2}
EMITTER_SHAPES = {"box": 0, "sphere": 1}
EMITTER_MODES = {"initial": 0, "continuous": 1}
FORCE_KINDS = {"constant": 0, "radial": 1, "wind": 2}
ACTS_ON = {"both": 0, "fluid": 1, "solids": 2}
FIELDS = {
    "velocity": 0,
    "pressure": 1,
    "smoke_density": 2,
    "smoke_temperature": 3,
    "solid_fraction": 4,
    "solid_displacement": 5,
    "solid_velocity": 6,
}
# Stages of EfsiProfile, in order (columns of the paper's Table 2 and what they leave out).
STAGES = (
    "time_step",
    "solid_mass",
    "compute_g",
    "fluid_forces",
    "velocity_solve",
    "pressure_solve",
    "solid_advection",
    "fluid_advection",
    "smoke",
    "contact",
    "surface",
    "check",
    "other",
)
# Columns of EfsiEnergyLedger, in order.
ENERGY_STAGES = (
    "weight",
    "mixing",
    "external",
    "walls",
    "velocity",
    "pressure",
    "solid_transport",
    "fluid_transport",
    "remap",
    "repair",
    "momentum",
    "plastic_flow",
    "viscosity",
)
LOG_INFO, LOG_WARNING = 0, 1

LogCallback = ctypes.CFUNCTYPE(None, c_void_p, c_int32, c_char_p)


class Error(Structure):
    _fields_ = [("status", c_int32), ("message", c_char * 1020)]


class Vec3(Structure):
    _fields_ = [("x", c_double), ("y", c_double), ("z", c_double)]

    def __iter__(self):
        return iter((self.x, self.y, self.z))


class FieldView(Structure):
    _fields_ = [
        ("data", POINTER(c_float) * 3),
        ("components", c_int32),
        ("size", c_int32 * 3),
        ("stride", c_int64 * 3),
        ("origin", Vec3),
        ("spacing", c_double),
        ("cell_centered", c_int32),
        ("reserved", c_int32),
    ]


class EmitterDef(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("magic", c_uint32),
        ("shape", c_int32),
        ("mode", c_int32),
        ("transform", c_double * 16),
        ("density", c_double),
        ("temperature", c_double),
        ("velocity", Vec3),
        ("start_time", c_double),
        ("end_time", c_double),
        ("has_velocity", c_int32),
        ("reserved", c_uint32 * 3),
    ]


class EmitterKey(Structure):
    _fields_ = [
        ("time", c_double),
        ("density", c_double),
        ("temperature", c_double),
        ("velocity", Vec3),
        ("on", c_int32),
        ("reserved", c_uint32),
    ]


class ForceDef(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("magic", c_uint32),
        ("shape", c_int32),
        ("kind", c_int32),
        ("acts_on", c_int32),
        ("reserved0", c_int32),
        ("transform", c_double * 16),
        ("acceleration", Vec3),
        ("radial_acceleration", c_double),
        ("wind_velocity", Vec3),
        ("wind_drag", c_double),
        ("noise_speed", c_double),
        ("noise_size", c_double),
        ("noise_frequency", c_double),
        ("start_time", c_double),
        ("end_time", c_double),
        ("reserved", c_uint64 * 2),
    ]


class VdbDef(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("magic", c_uint32),
        ("transform", c_double * 16),
        ("density_threshold", c_double),
        ("half_float", c_int32),
        ("write_velocity", c_int32),
        ("reserved", c_uint32 * 4),
    ]


class StepInfo(Structure):
    _fields_ = [
        ("time", c_double),
        ("dt", c_double),
        ("steps", c_uint64),
        ("velocity_iterations", c_uint64),
        ("pressure_iterations", c_uint64),
        ("velocity_residual", c_double),
        ("pressure_residual", c_double),
        ("divergence_before", c_double),
        ("divergence_after", c_double),
        ("divergence_after_solid", c_double),
        ("divergence_before_solid", c_double),
        ("max_speed_solid", c_double),
        ("max_speed_fluid", c_double),
        ("min_det_f", c_double),
        ("max_det_f", c_double),
        ("degenerate_cells", c_uint64),
        ("retries", c_uint64),
        ("unconverged", c_uint64),
        ("reserved", c_uint64 * 4),
    ]


class Profile(Structure):
    _fields_ = [
        ("seconds", c_double * len(STAGES)),
        ("tiles", c_uint64 * len(STAGES)),
        ("bytes", c_uint64 * len(STAGES)),
        ("total_seconds", c_double),
        ("steps", c_uint64),
        ("memory_bytes", c_uint64),
        ("reserved", c_uint64 * 2),
    ]


class SolidDiagnostics(Structure):
    _fields_ = [
        ("mass", c_double),
        ("rest_volume", c_double),
        ("volume_cells", c_double),
        ("rest_volume_cells", c_double),
        ("volume_mesh", c_double),
        ("center", Vec3),
        ("momentum", Vec3),
        ("angular_momentum", Vec3),
        ("kinetic_energy", c_double),
        ("elastic_energy", c_double),
        ("extent_min", Vec3),
        ("extent_max", Vec3),
        ("min_det_f", c_double),
        ("max_det_f", c_double),
        ("elements", c_uint64),
        ("memory_bytes", c_uint64),
        ("max_stretch", c_double),
        ("false_edges", c_uint64),
        ("max_plastic_strain", c_double),
    ]


class Repairs(Structure):
    _fields_ = [
        ("clamped", c_uint64),
        ("rejected", c_uint64),
        ("broken", c_uint64),
        ("repaired_cells", c_uint64),
        ("min_det_f_before", c_double),
        ("max_det_f_before", c_double),
        ("min_det_f_after", c_double),
        ("max_det_f_after", c_double),
    ]


class ContactPair(Structure):
    _fields_ = [
        ("solid", c_uint32 * 2),
        ("steps", c_uint64),
        ("rows", c_uint64),
        ("active_rows", c_uint64),
        ("sticking_rows", c_uint64),
        ("row_overlap", c_double),
        ("surface_overlap", c_double),
        ("normal_impulse", c_double),
        ("impulse", Vec3),
    ]


class PinReaction(Structure):
    _fields_ = [
        ("impulse", Vec3),
        ("angular_impulse", Vec3),
        ("center", Vec3),
        ("work", c_double),
    ]


class TransportError(Structure):
    _fields_ = [
        ("volume_mesh", c_double),
        ("volume_cells", c_double),
        ("momentum", Vec3),
        ("angular_momentum", Vec3),
        ("mass", c_double),
    ]


class Energy(Structure):
    _fields_ = [
        ("solid_kinetic", c_double),
        ("elastic", c_double),
        ("fluid_kinetic", c_double),
        ("potential", c_double),
    ]


class EnergyLedger(Structure):
    _fields_ = [
        ("end", Energy),
        ("at_start", Energy),
        ("change", Energy * len(ENERGY_STAGES)),
        ("source_work", c_double),
    ]


class FluidDiagnostics(Structure):
    _fields_ = [
        ("kinetic_energy", c_double),
        ("momentum", Vec3),
        ("max_speed", c_double),
        ("smoke", c_double),
        ("max_divergence", c_double),
        ("reserved", c_uint64 * 2),
    ]


class SimulationDef(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("magic", c_uint32),
        ("domain_min", Vec3),
        ("domain_size", Vec3),
        ("voxel_size", c_double),
        ("gravity", Vec3),
        ("preset", c_int32),
        ("wall", c_int32 * 6),
        ("ambient_fluid", c_int32),
        ("fluid_density", c_double),
        ("fluid_viscosity", c_double),
        ("wall_velocity", Vec3 * 6),
        ("vorticity_confinement", c_double),
        ("smoke_buoyancy", c_double),
        ("temperature_buoyancy", c_double),
        ("cfl_solid", c_double),
        ("cfl_fluid", c_double),
        ("max_time_step", c_double),
        ("velocity_tolerance", c_double),
        ("pressure_tolerance", c_double),
        ("threads", c_int32),
        ("energy_ledger", c_int32),
        ("memory_limit", c_uint64),
        ("log", LogCallback),
        ("log_user", c_void_p),
        ("volume_source", c_int32),
        ("reserved0", c_int32),
        ("reserved", c_uint64 * 2),
    ]


class MeshView(Structure):
    _fields_ = [
        ("points", POINTER(c_float)),
        ("point_count", c_uint64),
        ("point_stride", c_uint64),
        ("face_vertex_counts", POINTER(c_int32)),
        ("face_count", c_uint64),
        ("face_vertex_indices", POINTER(c_int32)),
        ("index_count", c_uint64),
    ]


class MeshReport(Structure):
    _fields_ = [
        ("surface_volume", c_double),
        ("solid_volume", c_double),
        ("extent_min", Vec3),
        ("extent_max", Vec3),
        ("triangles", c_uint64),
        ("open_edges", c_uint64),
        ("holes", c_uint64),
        ("largest_hole", c_double),
        ("nonmanifold_edges", c_uint64),
        ("closed", c_int32),
        ("repaired", c_int32),
        ("thinnest_feature", c_double),
        ("closing_radius", c_double),
        ("pieces", c_uint32),
        ("merged_points", c_uint32),
        ("reversed_triangles", c_uint32),
        ("inner_triangles", c_uint32),
        ("separate_pieces", c_uint32),
    ]


class SolidDef(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("magic", c_uint32),
        ("mesh", MeshView),
        ("density", c_double),
        ("youngs_modulus", c_double),
        ("poissons_ratio", c_double),
        ("rayleigh_alpha", c_double),
        ("rayleigh_beta", c_double),
        ("velocity", Vec3),
        ("angular_velocity", Vec3),
        ("material", c_int32),
        ("compressible", c_int32),
        ("surface", c_void_p),
        ("friction", c_double),
        ("plastic_yield_stress", c_double),
        ("plastic_flow_rate", c_double),
        ("plastic_hardening", c_double),
        ("stretch", Vec3),
        ("contact_stiffness", c_double),
        ("reserved", c_uint64 * 2),
    ]


SurfaceProgress = ctypes.CFUNCTYPE(c_int32, c_void_p, c_double)
ProgressCallback = ctypes.CFUNCTYPE(c_int32, c_void_p, c_double, POINTER(StepInfo))

# C name -> ctypes structure.
STRUCTURES = {
    "EfsiError": Error,
    "EfsiVec3": Vec3,
    "EfsiFieldView": FieldView,
    "EfsiEmitterDef": EmitterDef,
    "EfsiEmitterKey": EmitterKey,
    "EfsiForceDef": ForceDef,
    "EfsiVdbDef": VdbDef,
    "EfsiStepInfo": StepInfo,
    "EfsiProfile": Profile,
    "EfsiSolidDiagnostics": SolidDiagnostics,
    "EfsiRepairs": Repairs,
    "EfsiContactPair": ContactPair,
    "EfsiPinReaction": PinReaction,
    "EfsiTransportError": TransportError,
    "EfsiEnergy": Energy,
    "EfsiEnergyLedger": EnergyLedger,
    "EfsiFluidDiagnostics": FluidDiagnostics,
    "EfsiSimulationDef": SimulationDef,
    "EfsiMeshView": MeshView,
    "EfsiMeshReport": MeshReport,
    "EfsiSolidDef": SolidDef,
}

_SIM = c_void_p
_MESH = c_void_p
_SURFACE = c_void_p
_P = POINTER

# Function -> argument types; all return EfsiStatus except those in _RESULTS.
PROTOTYPES: dict[str, list] = {
    "efsi_version": [_P(c_int32), _P(c_int32), _P(c_int32)],
    "efsi_status_text": [c_int32],
    "efsi_simulation_def_init": [_P(SimulationDef)],
    "efsi_simulation_estimate_memory": [_P(SimulationDef), c_double, _P(c_uint64), _P(c_double), _P(Error)],
    "efsi_simulation_create": [_P(SimulationDef), _P(_SIM), _P(Error)],
    "efsi_simulation_destroy": [_SIM],
    "efsi_simulation_last_error": [_SIM],
    "efsi_simulation_step": [_SIM, c_double, _P(StepInfo)],
    "efsi_simulation_advance": [_SIM, c_double, _P(StepInfo), ProgressCallback, c_void_p],
    "efsi_simulation_get_time": [_SIM, _P(c_double), _P(c_uint64)],
    "efsi_simulation_get_hash": [_SIM, _P(c_uint64)],
    "efsi_simulation_save_checkpoint": [_SIM, c_char_p],
    "efsi_simulation_restore_checkpoint": [_SIM, c_char_p],
    "efsi_simulation_restore_solids": [_SIM, c_char_p],
    "efsi_simulation_get_profile": [_SIM, _P(Profile)],
    "efsi_simulation_reset_profile": [_SIM],
    "efsi_simulation_get_repairs": [_SIM, _P(Repairs)],
    "efsi_simulation_get_contacts": [_SIM, _P(ContactPair), c_uint64, _P(c_uint64)],
    "efsi_simulation_get_energy_ledger": [_SIM, _P(EnergyLedger)],
    "efsi_simulation_get_fluid_diagnostics": [_SIM, _P(FluidDiagnostics)],
    "efsi_mesh_load": [c_char_p, _P(_MESH), _P(Error)],
    "efsi_mesh_get_view": [_MESH, _P(MeshView)],
    "efsi_mesh_destroy": [_MESH],
    "efsi_surface_create": [_P(MeshView), c_double, c_int32, SurfaceProgress, c_void_p, _P(_SURFACE), _P(Error)],
    "efsi_surface_get_report": [_SURFACE, _P(MeshReport)],
    "efsi_surface_get_repair_text": [_SURFACE],
    "efsi_surface_get_overlap": [_SURFACE, _SURFACE, _P(c_double), _P(c_double), _P(Error)],
    "efsi_surface_extrude_in_slab": [_SURFACE, c_int32, c_double, c_double, _P(_SURFACE), _P(Error)],
    "efsi_surface_destroy": [_SURFACE],
    "efsi_solid_def_init": [_P(SolidDef)],
    "efsi_solid_add": [_SIM, _P(SolidDef), _P(c_uint32), _P(MeshReport)],
    "efsi_solid_get_count": [_SIM, _P(c_uint32)],
    "efsi_solid_get_surface": [_SIM, c_uint32, c_void_p, c_void_p, c_uint64],
    "efsi_solid_get_diagnostics": [_SIM, c_uint32, _P(SolidDiagnostics)],
    "efsi_solid_get_transport_error": [_SIM, c_uint32, _P(TransportError)],
    "efsi_pin_add_volume": [_SIM, c_uint32, _SURFACE, _P(c_uint32)],
    "efsi_pin_add_vertices": [_SIM, c_uint32, c_void_p, c_uint64, _P(c_uint32)],
    "efsi_collider_add": [_SIM, _P(SolidDef), _P(c_uint32), _P(c_uint32), _P(MeshReport)],
    "efsi_pin_set_motion": [_SIM, c_uint32, c_double, c_double, c_void_p, c_void_p],
    "efsi_collider_set_points": [_SIM, c_uint32, c_double, c_double, c_void_p, c_void_p, c_uint64],
    "efsi_pin_get_impulse": [_SIM, c_uint32, _P(Vec3)],
    "efsi_pin_get_reaction": [_SIM, c_uint32, _P(PinReaction)],
    "efsi_passenger_add": [_SIM, c_uint32, c_void_p, c_uint64, _P(c_uint32)],
    "efsi_passenger_get_points": [_SIM, c_uint32, c_void_p, c_void_p, c_uint64],
    "efsi_emitter_def_init": [_P(EmitterDef)],
    "efsi_emitter_add": [_SIM, _P(EmitterDef), _P(c_uint32)],
    "efsi_emitter_add_volume": [_SIM, _P(EmitterDef), _SURFACE, _P(c_uint32)],
    "efsi_emitter_set_keys": [_SIM, c_uint32, _P(EmitterKey), c_uint64],
    "efsi_emitter_get_flux": [_SIM, c_uint32, _P(c_double)],
    "efsi_force_def_init": [_P(ForceDef)],
    "efsi_force_add": [_SIM, _P(ForceDef), _P(c_uint32)],
    "efsi_field_get_view": [_SIM, c_int32, c_uint32, _P(FieldView)],
    "efsi_field_set": [_SIM, c_int32, c_uint32, c_void_p, c_uint64],
    "efsi_vdb_def_init": [_P(VdbDef)],
    "efsi_vdb_write": [_SIM, c_char_p, _P(VdbDef), _P(c_uint64)],
}
_RESULTS = {
    "efsi_status_text": c_char_p,
    "efsi_simulation_last_error": c_char_p,
    "efsi_simulation_destroy": None,
    "efsi_mesh_destroy": None,
    "efsi_surface_get_repair_text": c_char_p,
    "efsi_surface_destroy": None,
}


@functools.cache
def library() -> ctypes.CDLL:
    """The shared library with its prototypes set. Raises EulerFsiError that names every place looked at."""
    candidates = paths.library_candidates()
    found = next((path for path in candidates if path.is_file()), None)
    if found is None:
        places = "\n  ".join(map(str, candidates))
        raise EulerFsiError(
            f"the shared library was not found; build it or set EULERFSI_LIBRARY. Looked at:\n  {places}"
        )
    try:
        # Threads that spin while they wait stall each other on a busy machine; read when the OpenMP runtime is loaded.
        os.environ.setdefault("OMP_WAIT_POLICY", "passive")
        lib = ctypes.CDLL(str(found))
    except OSError as error:
        raise EulerFsiError(f"{found}: cannot be loaded: {error}") from error
    for name, arguments in PROTOTYPES.items():
        function = getattr(lib, name, None)
        if function is None:
            raise EulerFsiError(f"{found}: lacks the function {name}; library and package are of different versions")
        function.argtypes = arguments
        function.restype = _RESULTS.get(name, c_int32)
    lib.efsi_path = str(found)
    return lib


def status_text(status: int) -> str:
    """Short English name of a status."""
    return library().efsi_status_text(status).decode("utf-8", "replace")


def check_error(status: int, error: Error) -> None:
    """Raises LibraryError for a failed call that fills an EfsiError."""
    if status != OK:
        raise LibraryError(status, error.message.decode("utf-8", "replace") or status_text(status))


def library_version() -> str:
    """Version of the loaded library, "major.minor.patch"."""
    numbers = [c_int32() for _ in range(3)]
    library().efsi_version(*(ctypes.byref(n) for n in numbers))
    return ".".join(str(n.value) for n in numbers)
