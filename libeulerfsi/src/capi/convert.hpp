// Purpose: the only conversions between C and C++ types. Definitions must have been checked (definition.hpp).
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "eulerfsi/eulerfsi.h"
#include "sim/simulation.hpp"

namespace efsi::capi {

static_assert(EFSI_PRESET_PAPER2016 == static_cast<int>(sim::Preset::kPaper2016));
static_assert(EFSI_WALL_NO_SLIP == static_cast<int>(grid::Wall::kNoSlip));
static_assert(EFSI_WALL_OPEN == static_cast<int>(grid::Wall::kOpen));
static_assert(EFSI_WALL_PERIODIC == static_cast<int>(grid::Wall::kPeriodic));
static_assert(EFSI_EMITTER_SPHERE == static_cast<int>(fluid::Emitter::Shape::kSphere));
static_assert(EFSI_EMIT_CONTINUOUS == static_cast<int>(fluid::Emitter::Mode::kContinuous));
static_assert(EFSI_MATERIAL_STABLE_NEO_HOOKEAN == static_cast<int>(material::Law::kStableNeoHookean));
static_assert(EFSI_MATERIAL_ST_VENANT_KIRCHHOFF == static_cast<int>(material::Law::kStVenantKirchhoff));
static_assert(EFSI_STAGE_VELOCITY_SOLVE == static_cast<int>(sim::Stage::kVelocitySolve));
static_assert(EFSI_STAGE_OTHER == static_cast<int>(sim::Stage::kOther));
static_assert(EFSI_STAGE_COUNT == static_cast<int>(sim::Stage::kCount));
static_assert(EFSI_FORCE_WIND == static_cast<int>(sim::ForceField::Kind::kWind));
static_assert(EFSI_ACTS_ON_SOLIDS == static_cast<int>(sim::ForceField::ActsOn::kSolids));
static_assert(EFSI_ENERGY_VELOCITY == static_cast<int>(sim::EnergyStage::kVelocity));
static_assert(EFSI_ENERGY_REMAP == static_cast<int>(sim::EnergyStage::kRemap));
static_assert(EFSI_ENERGY_VISCOSITY == static_cast<int>(sim::EnergyStage::kViscosity));
static_assert(EFSI_ENERGY_STAGE_COUNT == static_cast<int>(sim::EnergyStage::kCount));

inline Vec3d to_vector(const EfsiVec3& v) { return {v.x, v.y, v.z}; }
inline EfsiVec3 to_c(const Vec3d& v) { return {v[0], v[1], v[2]}; }

// Row-major 4x4.
inline Eigen::Matrix4d to_matrix(const double (&m)[16]) {
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m);
}

// A number of bytes; what does not fit into 64 bits becomes the largest number.
inline std::uint64_t to_bytes(double bytes) {
  return bytes < 1.8e19 ? static_cast<std::uint64_t>(bytes) : std::numeric_limits<std::uint64_t>::max();
}

inline sim::Params to_params(const EfsiSimulationDef& def) {
  sim::Params p;
  p.domain_min = to_vector(def.domain_min);
  p.domain_size = to_vector(def.domain_size);
  p.voxel_size = def.voxel_size;
  p.gravity = to_vector(def.gravity);
  for (std::size_t face = 0; face < 6; ++face) p.walls.face[face] = static_cast<grid::Wall>(def.wall[face]);
  p.fluid.present = def.ambient_fluid != 0;
  for (std::size_t face = 0; face < 6; ++face) p.walls.velocity[face] = to_vector(def.wall_velocity[face]);
  p.fluid.density = def.fluid_density;
  p.fluid.viscosity = def.fluid_viscosity;
  p.fluid.vorticity_confinement = def.vorticity_confinement;
  p.fluid.smoke_buoyancy = def.smoke_buoyancy;
  p.fluid.temperature_buoyancy = def.temperature_buoyancy;
  p.cfl_solid = def.cfl_solid;
  p.cfl_fluid = def.cfl_fluid;
  p.max_time_step = def.max_time_step;
  p.threads = def.threads;
  p.memory_limit = def.memory_limit;
  p.energy_ledger = def.energy_ledger != 0;
  p.numerics = sim::numerics_of(static_cast<sim::Preset>(def.preset));
  if (def.velocity_tolerance > 0.0) p.numerics.velocity_tolerance = def.velocity_tolerance;
  if (def.pressure_tolerance > 0.0) p.numerics.pressure_tolerance = def.pressure_tolerance;
  if (def.volume_source == 0) p.numerics.volume_source = false;
  return p;
}

inline Log to_log(EfsiLogCallback callback, void* user) {
  if (!callback) return Log();
  return Log([callback, user](LogLevel level, const std::string& message) {
    callback(user, static_cast<std::int32_t>(level), message.c_str());
  });
}

// The surface is filled in by the caller: reading the mesh can fail.
inline sim::SolidDesc to_solid(const EfsiSolidDef& def) {
  sim::SolidDesc d;
  d.density = def.density;
  d.youngs_modulus = def.youngs_modulus;
  d.poissons_ratio = def.poissons_ratio;
  d.rayleigh_alpha = def.rayleigh_alpha;
  d.rayleigh_beta = def.rayleigh_beta;
  d.friction = def.friction;
  d.contact_stiffness = def.contact_stiffness;
  d.plastic = {def.plastic_yield_stress, def.plastic_flow_rate, def.plastic_hardening};
  d.compressible = def.compressible != 0;
  d.law = static_cast<material::Law>(def.material);
  d.velocity = to_vector(def.velocity);
  d.angular_velocity = to_vector(def.angular_velocity);
  d.stretch = to_vector(def.stretch);
  return d;
}

inline fluid::Emitter to_emitter(const EfsiEmitterDef& def) {
  fluid::Emitter e;
  e.shape = static_cast<fluid::Emitter::Shape>(def.shape);
  e.mode = static_cast<fluid::Emitter::Mode>(def.mode);
  e.from_world = to_matrix(def.transform).inverse();
  e.density = def.density;
  e.temperature = def.temperature;
  e.velocity = to_vector(def.velocity);
  e.has_velocity = def.has_velocity != 0;
  e.start_time = def.start_time;
  e.end_time = def.end_time;
  return e;
}

inline sim::ForceField to_force(const EfsiForceDef& def) {
  sim::ForceField f;
  f.shape = static_cast<fluid::Region::Shape>(def.shape);
  f.from_world = to_matrix(def.transform).inverse();
  f.kind = static_cast<sim::ForceField::Kind>(def.kind);
  f.acts_on = static_cast<sim::ForceField::ActsOn>(def.acts_on);
  f.acceleration = to_vector(def.acceleration);
  f.radial_acceleration = def.radial_acceleration;
  f.wind_velocity = to_vector(def.wind_velocity);
  f.wind_drag = def.wind_drag;
  f.noise_speed = def.noise_speed;
  f.noise_size = def.noise_size;
  f.noise_frequency = def.noise_frequency;
  f.start_time = def.start_time;
  f.end_time = def.end_time;
  return f;
}

inline EfsiMeshReport to_c(const geometry::MeshReport& r) {
  EfsiMeshReport c{};
  c.surface_volume = r.surface_volume;
  c.solid_volume = r.solid_volume;
  c.extent_min = to_c(r.extent_min);
  c.extent_max = to_c(r.extent_max);
  c.triangles = r.triangles;
  c.open_edges = r.open_edges;
  c.holes = r.holes;
  c.largest_hole = r.largest_hole;
  c.nonmanifold_edges = r.nonmanifold_edges;
  c.closed = r.closed;
  c.repaired = r.repaired;
  c.thinnest_feature = r.thinnest_feature;
  c.closing_radius = r.closing_radius;
  c.pieces = r.pieces;
  c.merged_points = r.merged_points;
  c.reversed_triangles = r.reversed_triangles;
  c.inner_triangles = r.inner_triangles;
  c.separate_pieces = r.separate_pieces;
  return c;
}

inline EfsiStepInfo to_c(const sim::StepInfo& s) {
  EfsiStepInfo c{};
  c.time = s.time;
  c.dt = s.dt;
  c.steps = s.steps;
  c.velocity_iterations = s.velocity_iterations;
  c.pressure_iterations = s.pressure_iterations;
  c.velocity_residual = s.velocity_residual;
  c.pressure_residual = s.pressure_residual;
  c.divergence_before = s.divergence_before;
  c.divergence_after = s.divergence_after;
  c.divergence_before_solid = s.divergence_before_solid;
  c.divergence_after_solid = s.divergence_after_solid;
  c.max_speed_solid = s.max_speed_solid;
  c.max_speed_fluid = s.max_speed_fluid;
  c.min_det_f = s.min_det_f;
  c.max_det_f = s.max_det_f;
  c.degenerate_cells = s.degenerate_cells;
  c.retries = s.retries;
  c.unconverged = s.unconverged;
  return c;
}

inline EfsiProfile to_c(const sim::Profile& p, std::uint64_t memory_bytes) {
  EfsiProfile c{};
  for (std::size_t s = 0; s < sim::Profile::kStages; ++s) {
    c.seconds[s] = p.seconds[s];
    c.tiles[s] = p.tiles[s];
    c.bytes[s] = p.bytes[s];
  }
  c.total_seconds = p.total_seconds;
  c.steps = p.steps;
  c.memory_bytes = memory_bytes;
  return c;
}

inline EfsiSolidDiagnostics to_c(const sim::SolidDiagnostics& d) {
  EfsiSolidDiagnostics c{};
  c.mass = d.mass;
  c.rest_volume = d.rest_volume;
  c.volume_cells = d.volume_cells;
  c.rest_volume_cells = d.rest_volume_cells;
  c.volume_mesh = d.volume_mesh;
  c.center = to_c(d.center);
  c.momentum = to_c(d.momentum);
  c.angular_momentum = to_c(d.angular_momentum);
  c.kinetic_energy = d.kinetic_energy;
  c.elastic_energy = d.elastic_energy;
  c.extent_min = to_c(d.extent_min);
  c.extent_max = to_c(d.extent_max);
  c.min_det_f = d.min_det_f;
  c.max_det_f = d.max_det_f;
  c.max_stretch = d.max_stretch;
  c.false_edges = d.false_edges;
  c.elements = d.elements;
  c.memory_bytes = d.memory_bytes;
  c.max_plastic_strain = d.max_plastic_strain;
  return c;
}

inline EfsiRepairs to_c(const sim::Repairs& r) {
  EfsiRepairs c{};
  c.clamped = r.clamped;
  c.rejected = r.rejected;
  c.broken = r.broken;
  c.repaired_cells = r.repaired_cells;
  c.min_det_f_before = r.min_det_f_before;
  c.max_det_f_before = r.max_det_f_before;
  c.min_det_f_after = r.min_det_f_after;
  c.max_det_f_after = r.max_det_f_after;
  return c;
}

inline EfsiTransportError to_c(const sim::TransportError& t) {
  EfsiTransportError c{};
  c.volume_mesh = t.volume_mesh;
  c.volume_cells = t.volume_cells;
  c.momentum = to_c(t.momentum);
  c.angular_momentum = to_c(t.angular_momentum);
  c.mass = t.mass;
  return c;
}

inline EfsiContactPair to_c(const sim::ContactPair& p) {
  EfsiContactPair c{};
  c.solid[0] = static_cast<std::uint32_t>(p.one + 1);
  c.solid[1] = static_cast<std::uint32_t>(p.other + 1);
  c.steps = p.steps;
  c.rows = p.rows;
  c.active_rows = p.pushing;
  c.sticking_rows = p.sticking;
  c.row_overlap = p.row_overlap;
  c.surface_overlap = p.surface_overlap;
  c.normal_impulse = p.normal_impulse;
  c.impulse = to_c(p.impulse);
  return c;
}

inline EfsiEnergy to_c(const sim::Energy& e) { return {e.solid_kinetic, e.elastic, e.fluid_kinetic, e.potential}; }

inline EfsiEnergyLedger to_c(const sim::EnergyRecord& r) {
  EfsiEnergyLedger c{};
  c.end = to_c(r.end);
  c.at_start = to_c(r.at_start);
  for (std::size_t s = 0; s < sim::kEnergyStages; ++s) c.change[s] = to_c(r.change[s]);
  c.source_work = r.source_work;
  return c;
}

inline EfsiFluidDiagnostics to_c(const sim::FluidDiagnostics& d) {
  EfsiFluidDiagnostics c{};
  c.kinetic_energy = d.kinetic_energy;
  c.momentum = to_c(d.momentum);
  c.max_speed = d.max_speed;
  c.smoke = d.smoke;
  c.max_divergence = d.max_divergence;
  return c;
}

// Copies points [m] as x y z floats.
inline void copy_points(const std::vector<Vec3d>& points, float* out) {
  for (const Vec3d& x : points)
    for (int a = 0; a < 3; ++a) *out++ = static_cast<float>(x[a]);
}

}  // namespace efsi::capi
