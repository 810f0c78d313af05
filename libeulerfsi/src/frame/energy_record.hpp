// Purpose: what a step reports of the energy (EfsiEnergyLedger); record/energy_ledger.hpp measures it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace efsi::sim {

// Values equal EFSI_ENERGY_*.
enum class EnergyStage : std::int32_t {
  kWeight = 0,      // weight less buoyancy acts on the velocities
  kMixing,          // one velocity at nodes that solids and fluid share
  kExternal,        // emitters, smoke and heat, vorticity confinement
  kWalls,           // components that walls fix; one normal velocity where the fluid slips
  kVelocity,        // Eq. 8
  kPressure,        // Eqs. 12, 13 with the coupling step
  kSolidTransport,  // u and v move with the solids, by shape
  kFluidTransport,  // the fluid's velocity moves, the masses of the nodes stand still
  kRemap,           // changes of the cells with stiffness and of the fluid's mass at nodes
  kRepair,
  kMomentum,     // what restores the momenta
  kPlasticFlow,  // what plastic flow dissipates
  kViscosity,    // viscous dissipation minus the work of moving walls
  kCount
};
inline constexpr std::size_t kEnergyStages = static_cast<std::size_t>(EnergyStage::kCount);

struct Energy {
  double solid_kinetic = 0.0, elastic = 0.0, fluid_kinetic = 0.0, potential = 0.0;  // [J]

  double sum() const { return solid_kinetic + elastic + fluid_kinetic + potential; }
  Energy& operator+=(const Energy& other) {
    solid_kinetic += other.solid_kinetic;
    elastic += other.elastic;
    fluid_kinetic += other.fluid_kinetic;
    potential += other.potential;
    return *this;
  }
};
inline Energy operator-(const Energy& a, const Energy& b) {
  return {a.solid_kinetic - b.solid_kinetic, a.elastic - b.elastic, a.fluid_kinetic - b.fluid_kinetic,
          a.potential - b.potential};
}

// A step's columns. at_end less the sum of all changes is what the step began with.
struct EnergyRecord {
  Energy at_end;
  Energy at_start;  // with the velocities of the time at which the step begins, see EnergyLedger::meet
  std::array<Energy, kEnergyStages> change{};
  double source_work = 0.0;  // dt sum of p b h^3, part of kPressure [J]
};

}  // namespace efsi::sim
