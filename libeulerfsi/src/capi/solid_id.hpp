// Purpose: solids and the like by their ids, which are stable and count from 1.
#pragma once

#include <string>

#include "capi/guard.hpp"

namespace efsi::capi {

// Index from 0 of one of `count` things that are named `kind`. Throws Error(kArgument) that names the argument, the id
// and the ids that exist.
inline std::size_t check_id(std::uint32_t id, std::size_t count, const std::string& argument, const char* kind) {
  if (id >= 1 && id <= count) return id - 1;
  const std::string limit = count == 0 ? std::string("the id of a ") + kind + ", and there is none"
                                       : "between 1 and " + std::to_string(count);
  throw Error(ErrorCode::kArgument, argument + " = " + std::to_string(id) + ": must be " + limit);
}

inline std::size_t solid_index(const EfsiSim& sim, std::uint32_t id, const char* function) {
  return check_id(id, sim.simulation.solids().size(), std::string(function) + ": solid", "solid");
}

}  // namespace efsi::capi
