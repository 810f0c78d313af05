// Purpose: the only conversions between C and C++ types. Definitions must have been checked (definition.hpp).
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "capi/struct_fields.inc"
#include "eulerfsi/eulerfsi.h"
#include "frame/parameter_table.inc"
#include "sim/simulation.hpp"
#include "sim/time_step.hpp"

namespace efsi::capi {

static_assert(EFSI_PRESET_PAPER2016 == static_cast<int>(sim::Preset::kPaper2016));
static_assert(EFSI_WALL_NO_SLIP == static_cast<int>(grid::Wall::kNoSlip));
static_assert(EFSI_WALL_OPEN == static_cast<int>(grid::Wall::kOpen));
static_assert(EFSI_WALL_PERIODIC == static_cast<int>(grid::Wall::kPeriodic));
static_assert(EFSI_REGION_COUNT == fluid::Region::kShapes);
static_assert(EFSI_EMITTER_CONTINUOUS == static_cast<int>(fluid::Emitter::Mode::kContinuous));
static_assert(EFSI_MATERIAL_COUNT == std::size(material::kLaws));
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

// A field of a definition to its member: numbers as they are, int32_t to bool or to an enum of the same values.
inline void assign(double& to, double from) { to = from; }
inline void assign(bool& to, std::int32_t from) { to = from != 0; }
inline void assign(Vec3d& to, const EfsiVec3& from) { to = to_vector(from); }
template <class Enum>
requires std::is_enum_v<Enum>
void assign(Enum& to, std::int32_t from) { to = static_cast<Enum>(from); }
#define EFSI_ASSIGN(field, member) assign(to.member, def.field);

inline sim::Params to_params(const EfsiSimulationDef& def) {
  sim::Params to;
  EFSI_DOMAIN_MEMBERS(EFSI_ASSIGN)
  to.domain_min = to_vector(def.domain_min);
  to.domain_size = to_vector(def.domain_size);
  to.gravity = to_vector(def.gravity);
  to.threads = def.threads;
  to.memory_limit = def.memory_limit;
  to.energy_ledger = def.energy_ledger != 0;  // changes no result
  // The preset's pieces, of which some can be chosen.
  to.numerics = sim::numerics_of(static_cast<sim::Preset>(def.preset));
  if (def.step_tolerance > 0.0) to.numerics.step_tolerance = def.step_tolerance;
  if (def.velocity_tolerance > 0.0) to.numerics.velocity_tolerance = def.velocity_tolerance;
  if (def.pressure_tolerance > 0.0) to.numerics.pressure_tolerance = def.pressure_tolerance;
  if (def.volume_source == 0) to.numerics.volume_source = false;
  return to;
}

// The surface is filled in by the caller: reading the mesh can fail.
inline sim::SolidDesc to_solid(const EfsiSolidDef& def) {
  sim::SolidDesc to;
  EFSI_SOLID_MEMBERS(EFSI_ASSIGN)
  return to;
}

inline fluid::Emitter to_emitter(const EfsiEmitterDef& def) {
  fluid::Emitter to;
  EFSI_EMITTER_MEMBERS(EFSI_ASSIGN)
  assign(to.shape, def.shape);
  to.from_world = to_matrix(def.transform).inverse();
  return to;
}

inline sim::ForceField to_force(const EfsiForceDef& def) {
  sim::ForceField to;
  EFSI_FORCE_MEMBERS(EFSI_ASSIGN)
  assign(to.shape, def.shape);
  to.from_world = to_matrix(def.transform).inverse();
  return to;
}

#undef EFSI_ASSIGN

inline Log to_log(EfsiLogCallback callback, void* user) {
  if (!callback) return Log();
  return Log([callback, user](LogLevel level, const std::string& message) {
    callback(user, static_cast<std::int32_t>(level), message.c_str());
  });
}

// A member of a record to the field of the same name.
template <class Number>
void assign_field(Number& to, Number from) {
  to = from;
}
inline void assign_field(std::int32_t& to, bool from) { to = from; }
inline void assign_field(std::int32_t& to, sim::StepRule from) { to = static_cast<std::int32_t>(from); }
inline void assign_field(EfsiVec3& to, const Vec3d& from) { to = to_c(from); }
inline void assign_field(EfsiEnergy& to, const sim::Energy& from) {
  to = {from.solid_kinetic, from.elastic, from.fluid_kinetic, from.potential};
}
#define EFSI_ASSIGN(field) assign_field(to.field, from.field);
#define EFSI_CONVERT(Record, Struct, FIELDS) \
  inline Struct to_c(const Record& from) {   \
    Struct to{};                             \
    FIELDS(EFSI_ASSIGN)                      \
    return to;                               \
  }

EFSI_CONVERT(geometry::MeshReport, EfsiMeshReport, EFSI_MESH_REPORT_FIELDS)
EFSI_CONVERT(sim::StepInfo, EfsiStepInfo, EFSI_STEP_INFO_FIELDS)
EFSI_CONVERT(sim::StepLimits, EfsiStepLimits, EFSI_STEP_LIMITS_FIELDS)
EFSI_CONVERT(sim::SolidDiagnostics, EfsiSolidDiagnostics, EFSI_SOLID_DIAGNOSTICS_FIELDS)
EFSI_CONVERT(sim::FluidDiagnostics, EfsiFluidDiagnostics, EFSI_FLUID_DIAGNOSTICS_FIELDS)
EFSI_CONVERT(sim::Repairs, EfsiRepairs, EFSI_REPAIRS_FIELDS)
EFSI_CONVERT(sim::TransportError, EfsiTransportError, EFSI_TRANSPORT_ERROR_FIELDS)
EFSI_CONVERT(sim::PinReaction, EfsiPinReaction, EFSI_PIN_REACTION_FIELDS)
EFSI_CONVERT(sim::EnergyRecord, EfsiEnergyLedger, EFSI_ENERGY_LEDGER_FIELDS)

#undef EFSI_CONVERT
#undef EFSI_ASSIGN

inline EfsiContactPair to_c(const sim::ContactPair& p) {
  EfsiContactPair c{};
  c.solid[0] = static_cast<std::uint32_t>(p.one + 1);
  c.solid[1] = static_cast<std::uint32_t>(p.other + 1);
  c.steps = p.steps;
  c.rows = p.rows;
  c.active_rows = p.active_rows;
  c.sticking_rows = p.sticking_rows;
  c.row_overlap = p.row_overlap;
  c.surface_overlap = p.surface_overlap;
  c.normal_impulse = p.normal_impulse;
  c.impulse = to_c(p.impulse);
  c.exchanged_vertices = p.exchanged_vertices;
  c.exchanged_place = to_c(p.exchanged_place);
  return c;
}

// Points from x y z numbers. argument: "efsi_collider_set_points: from". Throws Error(kArgument) for one that is not
// finite.
template <class Number>
std::vector<Vec3d> read_points(const Number* values, std::uint64_t count, const std::string& argument) {
  std::vector<Vec3d> points(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    points[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
    if (!points[i].allFinite())
      throw Error(ErrorCode::kArgument, argument + "[" + std::to_string(i) + "]: must be finite");
  }
  return points;
}

// Copies points [m] as x y z floats.
inline void copy_points(const std::vector<Vec3d>& points, float* out) {
  for (const Vec3d& x : points)
    for (int a = 0; a < 3; ++a) *out++ = static_cast<float>(x[a]);
}

}  // namespace efsi::capi
