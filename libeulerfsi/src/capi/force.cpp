// Purpose: force.h: forces in a region.
#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "frame/parameter_table.inc"

using namespace efsi::capi;

EfsiStatus efsi_force_def_init(EfsiForceDef* def) {
  if (!def) return EFSI_ERROR_ARGUMENT;
  start_definition(*def);
#define EFSI_DEFAULT(name, field, kind, initial, min, max, exclusive, unit) def->field = initial;
  EFSI_FORCE_PARAMETERS(EFSI_DEFAULT)
#undef EFSI_DEFAULT
  for (int a = 0; a < 4; ++a) def->transform[5 * a] = 1.0;
  return EFSI_OK;
}

EfsiStatus efsi_force_add(EfsiSim* sim, const EfsiForceDef* def, uint32_t* id) {
  return guarded(sim, [&] {
    demand(def, "efsi_force_add: def");
    check_definition(*def);
    const std::size_t index = sim->simulation.add_force(to_force(*def));
    if (id) *id = static_cast<uint32_t>(index + 1);
  });
}
