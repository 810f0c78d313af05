// Purpose: record.h: counters, times, repairs, contacts and energies of steps.
#include "capi/convert.hpp"
#include "capi/guard.hpp"
#include "capi/sized.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

namespace {

// Of the last step; zeros before the first one.
efsi::sim::EnergyRecord energy_of(const EfsiSim& sim, const std::string& function) {
  if (!sim.simulation.params().energy_ledger)
    throw Error(ErrorCode::kArgument, function + ": EfsiSimulationDef.energy_ledger is 0");
  return sim.simulation.last_step().energy.value_or(efsi::sim::EnergyRecord{});
}

}  // namespace

EfsiStatus efsi_simulation_get_profile(const EfsiSim* sim, EfsiProfile* profile, size_t size) {
  return guarded(sim, [&] {
    demand(profile, "efsi_simulation_get_profile: profile");
    const efsi::sim::Profile& sums = sim->simulation.profile();
    const EfsiProfile out{sums.total_seconds, sums.steps, sim->simulation.memory_bytes()};
    give(out, profile, size, "efsi_simulation_get_profile");
  });
}

EfsiStatus efsi_simulation_get_stages(const EfsiSim* sim, EfsiStageProfile* stages, size_t stage_size,
                                      uint64_t capacity, uint64_t* count) {
  return guarded(sim, [&] {
    if (count) *count = EFSI_STAGE_COUNT;
    if (capacity == 0) return;
    demand(stages, "efsi_simulation_get_stages: stages");
    const efsi::sim::Profile& sums = sim->simulation.profile();
    std::array<EfsiStageProfile, EFSI_STAGE_COUNT> all;
    for (std::size_t s = 0; s < all.size(); ++s) all[s] = {sums.seconds[s], sums.tiles[s], sums.bytes[s]};
    give_array(all, stages, stage_size, capacity, "efsi_simulation_get_stages");
  });
}

EfsiStatus efsi_simulation_reset_profile(EfsiSim* sim) {
  return guarded(sim, [&] { sim->simulation.reset_profile(); });
}

EfsiStatus efsi_simulation_get_repairs(const EfsiSim* sim, EfsiRepairs* out, size_t size) {
  return guarded(sim, [&] {
    demand(out, "efsi_simulation_get_repairs: out");
    give(to_c(sim->simulation.last_step().repairs), out, size, "efsi_simulation_get_repairs");
  });
}

EfsiStatus efsi_simulation_get_contacts(const EfsiSim* sim, EfsiContactPair* pairs, size_t pair_size, uint64_t capacity,
                                        uint64_t* count) {
  return guarded(sim, [&] {
    demand(count, "efsi_simulation_get_contacts: count");
    const auto& contacts = sim->simulation.contacts();
    *count = contacts.size();
    if (capacity == 0) return;
    demand(pairs, "efsi_simulation_get_contacts: pairs");
    std::vector<EfsiContactPair> all;
    for (const efsi::sim::ContactPair& pair : contacts) all.push_back(to_c(pair));
    give_array(all, pairs, pair_size, capacity, "efsi_simulation_get_contacts");
  });
}

EfsiStatus efsi_simulation_get_energy_ledger(const EfsiSim* sim, EfsiEnergyLedger* out, size_t size) {
  return guarded(sim, [&] {
    demand(out, "efsi_simulation_get_energy_ledger: out");
    give(to_c(energy_of(*sim, "efsi_simulation_get_energy_ledger")), out, size, "efsi_simulation_get_energy_ledger");
  });
}

EfsiStatus efsi_simulation_get_energy_changes(const EfsiSim* sim, EfsiEnergy* changes, uint64_t capacity,
                                              uint64_t* count) {
  return guarded(sim, [&] {
    const efsi::sim::EnergyRecord record = energy_of(*sim, "efsi_simulation_get_energy_changes");
    if (count) *count = record.change.size();
    if (capacity == 0) return;
    demand(changes, "efsi_simulation_get_energy_changes: changes");
    for (std::size_t s = 0; s < record.change.size() && s < capacity; ++s) assign_field(changes[s], record.change[s]);
  });
}
