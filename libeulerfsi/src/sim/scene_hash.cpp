// Purpose: a number that tells scenes apart, for checkpoints: what decides the results, but for the state. Parameters
// are taken from the table (parameters.toml), so that a new one counts by itself.
#include <type_traits>

#include "frame/parameter_table.inc"
#include "sim/checkpoint.hpp"
#include "sim/simulation.hpp"

namespace efsi::sim {
namespace {

// Numbers as they are, bool and enum as whole numbers.
void add(double v, Hash& hash) { hash.add_value(v); }
void add(const Vec3d& v, Hash& hash) { hash.add(v.data(), 3 * sizeof(double)); }
template <class Token>
requires(std::is_enum_v<Token> || std::is_integral_v<Token>) void add(Token v, Hash& hash) {
  hash.add_value(static_cast<std::int64_t>(v));
}
template <class... Values>
void add_all(Hash& hash, const Values&... values) {
  (add(values, hash), ...);
}
#define EFSI_ADD(field, member) add(of.member, hash);

void add(const Params& of, Hash& hash) {
  EFSI_DOMAIN_MEMBERS(EFSI_ADD)
  add_all(hash, of.domain_min, of.domain_size, of.gravity);
  const Numerics& n = of.numerics;
  add_all(hash, n.velocity_solver, n.pressure_solver, n.velocity_tolerance, n.pressure_tolerance, n.points_per_element,
          n.solid_advection, n.contact_distance, n.corrected_fluid_advection, n.carries_pressure, n.stiff_correction,
          n.coupling_step, n.damping_by_pace, n.stiffness_by_part, n.resolve_impacts, n.step_tolerance,
          n.contact_travel, n.repair_map, n.volume_by_pressure, n.unilateral_walls, n.volume_source, n.fluid_slips,
          n.conserve_momentum, sizeof(Real));
}

void add(const solid::SolidRest& of, Hash& hash) {
  hash.add_value(of.definition);
  hash.add_array(of.distance.values);
  hash.add_array(of.surface.points);
  hash.add_array(of.surface.triangles);
}

void add(const Pin& of, Hash& hash) {
  add_all(hash, of.solid, of.whole, of.region->origin);
  hash.add_array(of.region->values);
}

void add(const fluid::Emitter& of, Hash& hash) {
  EFSI_EMITTER_MEMBERS(EFSI_ADD)
  add(of.shape, hash);
  hash.add(of.from_world.data(), 16 * sizeof(double));
  hash.add_array(of.cells);
  for (const Vec3d& face : of.faces) add(face, hash);
  for (const fluid::EmitterKey& key : of.keys)
    add_all(hash, key.time, key.density, key.temperature, key.velocity, key.on);
}

void add(const ForceField& of, Hash& hash) {
  EFSI_FORCE_MEMBERS(EFSI_ADD)
  add(of.shape, hash);
  hash.add(of.from_world.data(), 16 * sizeof(double));
}

}  // namespace

std::uint64_t definition_hash(const SolidDesc& of) {
  Hash hash;
  EFSI_SOLID_MEMBERS(EFSI_ADD)
  return hash.value();
}

#undef EFSI_ADD

std::uint64_t Simulation::scene_hash() const {
  Hash hash;
  add(params_, hash);
  for (const solid::SolidRest& s : solids_) add(s, hash);
  for (const Pin& pin : pins_) add(pin, hash);
  for (const fluid::Emitter& e : emitters_) add(e, hash);
  for (const ForceField& f : forces_) add(f, hash);
  return hash.value();
}

}  // namespace efsi::sim
