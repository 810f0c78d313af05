// Purpose: what each stage of a step does to the energy (docs/numerics/energy-ledger.md). It reads and changes nothing
// else: a run has the same bits with it and without. Full passes over the grid; off unless asked for.
//   kinetic    1/2 sum m v^2 over the nodes, of the solids and of the fluid, each with its own mass
//   elastic    of the elements (solid/energy.hpp)
//   potential  -(M - rho_f V) g.x_c per solid: weight less the weight of the fluid that it displaces
#pragma once

#include <array>
#include <span>
#include <vector>

#include "fluid/fluid.hpp"
#include "solid/energy.hpp"
#include "solid/momentum.hpp"
#include "system/slip.hpp"

namespace efsi::sim {

// Values equal EFSI_ENERGY_*.
enum class EnergyStage : std::int32_t {
  kWeight = 0,      // weight less buoyancy acts on the velocities
  kMixing,          // one velocity at nodes that solids and fluid share
  kOutside,         // emitters, smoke and heat, vorticity confinement
  kWalls,           // components that walls fix; one normal velocity where the fluid slips
  kVelocity,        // Eq. 8
  kPressure,        // Eqs. 12, 13 with the coupling step
  kSolidTransport,  // u and v move with the solids, by shape
  kFluidTransport,  // the fluid's velocity moves, the masses of the nodes stand still
  kRemap,           // which cells carry stiffness, how much fluid the nodes hold
  kRepair,
  kMomentum,  // what restores the momenta
  kCount
};
inline constexpr std::size_t kEnergyStages = static_cast<std::size_t>(EnergyStage::kCount);

struct Energy {
  double solid_kinetic = 0.0, elastic = 0.0, fluid_kinetic = 0.0, potential = 0.0;  // [J]
  double sum() const { return solid_kinetic + elastic + fluid_kinetic + potential; }
  Energy& operator+=(const Energy& other);
};
Energy operator-(const Energy& a, const Energy& b);

// A step's columns. end less the sum of all changes is what the step began with.
struct EnergyRecord {
  Energy end;
  Energy at_start;  // with the velocities of the time at which the step begins, see EnergyLedger::meet
  std::array<Energy, kEnergyStages> change{};
  double source_work = 0.0;  // dt sum of p b h^3, part of kPressure [J]
};

// sum of 1/2 m (v + push)^2 over the nodes of a grid; those of a periodic axis once [J].
double kinetic_energy(const Parallel& parallel, const grid::Grid& g, const std::vector<Real>& mass,
                      const grid::VectorField& velocity, const Vec3& push = Vec3::Zero());
// dt sum of p b h^3 [J]; pressure [Pa] and source [1/s], padded cells, source may be empty.
double source_work(const Parallel& parallel, const grid::Grid& g, const std::vector<Real>& pressure,
                   const std::vector<Real>& source, double dt);

// One step's bookkeeping. Every call books the difference to the one before it; none does anything when off.
class EnergyLedger {
 public:
  struct Solids {
    const std::vector<solid::SolidRest>& rest;
    const std::vector<solid::SolidState>& state;
    const std::vector<solid::SolidWork>& work;
    int points_per_element;
  };
  struct Surroundings {
    bool fluid;
    double density;  // of the fluid [kg/m^3]
    Vec3d gravity;
  };
  EnergyLedger(const Parallel& parallel, bool on, const Solids& solids, const Surroundings& surroundings)
      : parallel_(parallel), on_(on), solids_(solids), around_(surroundings) {}
  bool on() const { return on_; }

  // The energies at the start. fluid_mass: of the fluid per node of `common`; without solids its density says it.
  void open(const grid::Grid& common, const std::vector<Real>& fluid_mass, const grid::VectorField& fluid_velocity);
  // What weight adds, before it does: to the velocities of all fluid and of each solid [m/s].
  void weigh(const grid::VectorField& fluid_velocity, const Vec3& fluid, std::span<const Vec3> solids);
  // The velocities are those of the nodes of `common`, with that of the fluid at slip nodes.
  void book_nodes(EnergyStage stage, system::SlipNodes& slip, grid::VectorField& velocity);
  // Transport moves u by the velocity that a step ends with, so that this is the one of the middle of the step, and the
  // mean of those that it begins and ends with is the one of its start. The rigid motion is different: transport moves
  // it by the mean, so that it belongs to the ends of the steps. frames: of the transport that follows.
  void meet(system::SlipNodes& slip, grid::VectorField& velocity, std::span<const solid::RigidStep> frames, double dt);
  void book_source(const std::vector<Real>& pressure, const std::vector<Real>& source, double dt);
  // Solid l at the start of its transport: its velocity has been extended, the masses are those of the start.
  void leave(std::size_t l);
  // After the fluid's transport.
  void book_fluid(const grid::VectorField& fluid_velocity);
  // After the transport, with the masses of the new state.
  void arrive(const std::vector<Real>& fluid_mass, const grid::VectorField& fluid_velocity);
  // What has changed the solids' states, or the fluid's velocity. deformed: also u.
  void book_state(EnergyStage stage, const std::vector<Real>& fluid_mass, const grid::VectorField& fluid_velocity,
                  bool deformed);
  const EnergyRecord& record() const { return record_; }

 private:
  void book(EnergyStage stage, const Energy& now);
  double fluid_energy(const std::vector<Real>& mass, const grid::VectorField& velocity) const;
  double potential(std::size_t l, const Vec3d& center) const;
  Energy of_states(const std::vector<Real>& fluid_mass, const grid::VectorField& fluid_velocity, bool deformed) const;

  const Parallel& parallel_;
  bool on_;
  Solids solids_;
  Surroundings around_;
  grid::Grid common_;
  std::vector<Real> fluid_mass_;       // at the start
  grid::VectorField fluid_velocity_;   // at the start
  std::vector<solid::Momenta> first_;  // of the solids at the start
  Energy shape_;                       // of the solids, before their transport
  EnergyRecord record_;
};

}  // namespace efsi::sim
