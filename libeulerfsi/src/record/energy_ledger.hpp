// Purpose: what each stage of a step does to the energy (docs/numerics/energy-ledger.md). It reads and changes nothing
// else: a run has the same bits with it and without. Full passes over the grid; off unless asked for.
//   kinetic    1/2 sum m v^2 over the nodes, of the solids and of the fluid, each with its own mass
//   elastic    of the elements (solid/element/energy.hpp)
//   potential  -(M - rho_f V) g.x_c per solid: weight less that of the fluid that its volume at rest displaces
#pragma once

#include <span>
#include <vector>

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "nodes/step_weight.hpp"
#include "sources/jets.hpp"

namespace efsi::sim {

// sum of 1/2 m (v + velocity_change)^2 over the nodes of a grid; those of a periodic axis once [J].
double kinetic_energy(const Parallel& parallel, const grid::Grid& g, const std::vector<Real>& mass,
                      const grid::VectorField& velocity, const Vec3& velocity_change = Vec3::Zero());
// dt sum of p b h^3 [J]; pressure [Pa] and source [1/s], padded cells, source may be empty.
double source_work(const Parallel& parallel, const grid::Grid& g, const std::vector<Real>& pressure,
                   const std::vector<Real>& source, double dt);

// One step's bookkeeping, in StepInfo::energy. Every call books the difference to the one before it; none does anything
// when off (Params::energy_ledger). It lives as long as the step, its solids and their states.
class EnergyLedger {
 public:
  // Measures the start: after lines 3 and 7.
  EnergyLedger(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
               const grid::VectorField& fluid_velocity);
  bool on() const { return record_ != nullptr; }

  // What forces have added to the velocities of solids and fluid.
  void book_forces(const Matter& matter, const grid::VectorField& fluid_velocity);
  // What weight adds, before it does.
  void book_weight(const StepWeight& weight, const grid::VectorField& fluid_velocity);
  // What has changed the velocity of the nodes, which is left as it was.
  void book_nodes(EnergyStage stage, NodeVelocity& velocity);
  // The work of the pressure through the volume source.
  void book_source(const std::vector<Real>& pressure, const std::vector<Real>& source);
  // Transport moves u by the velocity that a step ends with, so that this is the one of the middle of the step, and the
  // mean of those that it begins and ends with is the one of its start. With the velocities v0 and v1 of these ends the
  // displacement of that time is u + dt/4 (v1 - v0). The rigid motion is different: transport moves it by the mean, so
  // that it belongs to the ends of the steps. frames: of the transport that follows.
  void meet(NodeVelocity& velocity, std::span<const solid::BodyStep> frames);
  // Solid l at the start of its transport: its velocity has been extended, the masses are those of the start.
  void leave(std::size_t l);
  // The fluid's transport, with the masses of the start.
  void book_fluid(const grid::VectorField& fluid_velocity);
  // What emitters bring in with the fluid that the transport has spread: outside work. flow: that of the transport.
  void book_inflow(const Jets& jets, const grid::VectorField& flow);
  // After the transport, with the solids' masses where they are now.
  void arrive();
  // What has changed the solids' states, masses or elements, and the fluid's masses or velocity.
  void book_solids(EnergyStage stage);
  void book_fluid(EnergyStage stage, const Matter& matter, const grid::VectorField& fluid_velocity);

 private:
  void book(EnergyStage stage, const Energy& now);
  double fluid_energy(const std::vector<Real>& mass, const grid::VectorField& velocity) const;
  double potential(std::size_t l, const Vec3d& center) const;
  bool counts(std::size_t l) const;  // the energy of a collider itself is excluded
  Energy shape_of(std::size_t l) const;
  // now: with the energies of the solids as they are.
  Energy with_solids(Energy now) const;

  const Parallel& parallel_;
  const Scene& scene_;
  const double dt_;
  const SolidStates& states_;
  const SolidWorks& solids_;
  EnergyRecord* record_ = nullptr;  // none: off
  grid::Grid common_;
  std::vector<Real> fluid_mass_;       // at the start
  grid::VectorField fluid_velocity_;   // at the start
  std::vector<solid::Momenta> first_;  // of the solids at the start
  Energy left_;                        // of the solids by shape, before their transport
};

}  // namespace efsi::sim
