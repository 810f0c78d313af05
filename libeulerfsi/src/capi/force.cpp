// Purpose: force.h: forces in a region.
#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"

using namespace efsi::capi;

EfsiStatus efsi_force_def_init(EfsiForceDef* def, size_t size) { return initialise(def, size); }

EfsiStatus efsi_force_add(EfsiSim* sim, const EfsiForceDef* def, uint32_t* id) {
  return guarded(sim, [&] {
    const std::size_t index = sim->simulation.add_force(to_force(receive(def, "efsi_force_add: def")));
    if (id) *id = static_cast<uint32_t>(index + 1);
  });
}
