// Purpose: profile.h: what the simulation did and where it stands. The functions are declared in simulation.h and
// solid.h.
#include "capi/convert.hpp"
#include "capi/guard.hpp"
#include "capi/solid_id.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

EfsiStatus efsi_simulation_get_profile(const EfsiSim* sim, EfsiProfile* profile) {
  return guarded(sim, [&] {
    demand(profile, "efsi_simulation_get_profile: profile");
    *profile = to_c(sim->simulation.profile(), sim->simulation.memory_bytes());
  });
}

EfsiStatus efsi_simulation_reset_profile(EfsiSim* sim) {
  return guarded(sim, [&] { sim->simulation.reset_profile(); });
}

EfsiStatus efsi_simulation_get_fluid_diagnostics(EfsiSim* sim, EfsiFluidDiagnostics* out) {
  return guarded(sim, [&] {
    demand(out, "efsi_simulation_get_fluid_diagnostics: out");
    *out = to_c(sim->simulation.diagnose_fluid());
  });
}

EfsiStatus efsi_solid_get_diagnostics(EfsiSim* sim, uint32_t id, EfsiSolidDiagnostics* out) {
  return guarded(sim, [&] {
    demand(out, "efsi_solid_get_diagnostics: out");
    *out = to_c(sim->simulation.diagnose_solid(solid_index(*sim, id, "efsi_solid_get_diagnostics")));
  });
}

EfsiStatus efsi_simulation_get_repairs(const EfsiSim* sim, EfsiRepairs* out) {
  return guarded(sim, [&] {
    demand(out, "efsi_simulation_get_repairs: out");
    *out = to_c(sim->simulation.last_step().repairs);
  });
}

EfsiStatus efsi_simulation_get_contacts(const EfsiSim* sim, EfsiContactPair* pairs, uint64_t capacity,
                                        uint64_t* count) {
  return guarded(sim, [&] {
    demand(count, "efsi_simulation_get_contacts: count");
    const auto& contacts = sim->simulation.contacts();
    *count = contacts.size();
    if (capacity == 0) return;
    demand(pairs, "efsi_simulation_get_contacts: pairs");
    for (std::size_t p = 0; p < contacts.size() && p < capacity; ++p) pairs[p] = to_c(contacts[p]);
  });
}

EfsiStatus efsi_simulation_get_energy_ledger(const EfsiSim* sim, EfsiEnergyLedger* out) {
  return guarded(sim, [&] {
    demand(out, "efsi_simulation_get_energy_ledger: out");
    if (!sim->simulation.params().energy_ledger)
      throw Error(ErrorCode::kArgument, "efsi_simulation_get_energy_ledger: EfsiSimulationDef.energy_ledger is 0");
    *out = to_c(sim->simulation.last_step().energy.value_or(efsi::sim::EnergyRecord{}));
  });
}

EfsiStatus efsi_solid_get_transport_error(const EfsiSim* sim, uint32_t id, EfsiTransportError* out) {
  return guarded(sim, [&] {
    demand(out, "efsi_solid_get_transport_error: out");
    const std::size_t index = solid_index(*sim, id, "efsi_solid_get_transport_error");
    const auto& transport = sim->simulation.last_step().transport;
    *out = index < transport.size() ? to_c(transport[index]) : EfsiTransportError{};
  });
}
