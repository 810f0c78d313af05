// Purpose: fluid.h: smoke emitters and jets; the state of the fluid.
#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "capi/solid_id.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

namespace {

std::size_t emitter_index(const EfsiSim& sim, uint32_t id, const char* function) {
  return check_id(id, sim.simulation.emitters().size(), std::string(function) + ": id", "emitter");
}

}  // namespace

EfsiStatus efsi_emitter_def_init(EfsiEmitterDef* def, size_t size) { return initialise(def, size); }

EfsiStatus efsi_emitter_add(EfsiSim* sim, const EfsiEmitterDef* def, uint32_t* id) {
  return guarded(sim, [&] {
    const std::size_t index = sim->simulation.add_emitter(to_emitter(receive(def, "efsi_emitter_add: def")));
    if (id) *id = static_cast<uint32_t>(index + 1);
  });
}

EfsiStatus efsi_emitter_add_volume(EfsiSim* sim, const EfsiEmitterDef* def, const EfsiSurface* volume, uint32_t* id) {
  return guarded(sim, [&] {
    const efsi::fluid::Emitter emitter = to_emitter(receive(def, "efsi_emitter_add_volume: def"));
    demand(volume, "efsi_emitter_add_volume: volume");
    const std::size_t index = sim->simulation.add_emitter(emitter, volume->surface.get());
    if (id) *id = static_cast<uint32_t>(index + 1);
  });
}

EfsiStatus efsi_emitter_set_keys(EfsiSim* sim, uint32_t id, const EfsiEmitterKey* keys, size_t key_size,
                                 uint64_t count) {
  return guarded(sim, [&] {
    const std::size_t index = emitter_index(*sim, id, "efsi_emitter_set_keys");
    demand(keys, "efsi_emitter_set_keys: keys");
    if (count == 0) throw Error(ErrorCode::kArgument, "efsi_emitter_set_keys: count = 0: must be at least 1");
    check_size<EfsiEmitterKey>(key_size, "efsi_emitter_set_keys: key_size");
    std::vector<efsi::fluid::EmitterKey> values;
    for (uint64_t i = 0; i < count; ++i) {
      const EfsiEmitterKey key = take(keys, key_size, i);
      const std::string name = "efsi_emitter_set_keys: keys[" + std::to_string(i) + "].";
      check((name + "time").c_str(), key.time, {i > 0 ? values.back().time : -kInfinity, kInfinity, false});
      check((name + "density").c_str(), key.density, {0.0, kInfinity, false});
      check((name + "temperature").c_str(), key.temperature, {});
      check((name + "velocity").c_str(), key.velocity, {});
      check((name + "on").c_str(), key.on, {0.0, 1.0, false});
      values.push_back({key.time, key.density, key.temperature, to_vector(key.velocity), key.on != 0});
    }
    sim->simulation.set_keys(index, std::move(values));
  });
}

EfsiStatus efsi_emitter_get_flux(const EfsiSim* sim, uint32_t id, double* flux) {
  return guarded(sim, [&] {
    const std::size_t index = emitter_index(*sim, id, "efsi_emitter_get_flux");
    demand(flux, "efsi_emitter_get_flux: flux");
    const std::vector<double>& jets = sim->simulation.last_step().jets;
    *flux = index < jets.size() ? jets[index] : 0.0;
  });
}

EfsiStatus efsi_simulation_get_fluid_diagnostics(EfsiSim* sim, EfsiFluidDiagnostics* out, size_t size) {
  return guarded(sim, [&] {
    demand(out, "efsi_simulation_get_fluid_diagnostics: out");
    give(to_c(sim->simulation.diagnose_fluid()), out, size, "efsi_simulation_get_fluid_diagnostics");
  });
}
