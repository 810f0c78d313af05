// Purpose: what survives a step: what a checkpoint holds and the state hash covers.
#pragma once

#include <cstdint>
#include <vector>

#include "fluid/fluid.hpp"
#include "frame/window.hpp"
#include "solid/solid.hpp"

namespace efsi::sim {

struct State {
  double time = 0.0;  // [s]
  std::uint64_t steps = 0;
  double fluid_speed = 0.0;  // largest component that limits the next time step [m/s]
  fluid::FluidState fluid;
  Window window;  // on which its pressure is known, 0 elsewhere
  std::vector<solid::SolidState> solids;
};

// Calls fields.value(x...) or fields.array(x...) for what one state, or several together, hold beside the solids; after
// these solid::visit_fields() goes over each solid. With fluid the window is the whole box and no field.
template <class Fields, class... States>
void visit_box_fields(Fields& fields, States&... s) {
  fields.value(s.time...);
  fields.value(s.steps...);
  fields.value(s.fluid_speed...);
  for (std::size_t a = 0; a < 3; ++a) fields.array(s.fluid.velocity.c[a]...);
  fields.array(s.fluid.pressure...);
  fields.value(s.fluid.carried_time...);
  if (((s.fluid.velocity.size() == 0) && ...)) fields.value(s.window...);
  fields.array(s.fluid.smoke...);
  fields.array(s.fluid.temperature...);
}

// All that a state holds. One list serves checkpoint, hash and memory count.
template <class S, class Fields>
void visit_fields(S& state, Fields& fields) {
  visit_box_fields(fields, state);
  for (auto& solid : state.solids) solid::visit_fields(solid, fields);
}

}  // namespace efsi::sim
