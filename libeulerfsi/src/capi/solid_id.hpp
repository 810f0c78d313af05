// Purpose: solids by their id, which is stable and counts from 1.
#pragma once

#include <string>

#include "capi/guard.hpp"

namespace efsi::capi {

// Index from 0. Throws Error(kArgument) that names function, id and the ids that exist.
inline std::size_t solid_index(const EfsiSim& sim, std::uint32_t id, const char* function) {
  const std::size_t count = sim.simulation.solids().size();
  if (id >= 1 && id <= count) return id - 1;
  throw Error(ErrorCode::kArgument,
              std::string(function) + ": solid = " + std::to_string(id) + ": must be " +
                  (count == 0 ? "the id of a solid, and there is none" : "between 1 and " + std::to_string(count)));
}

}  // namespace efsi::capi
