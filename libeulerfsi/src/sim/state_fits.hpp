// Purpose: whether a state that was read from a file has a place in a simulation. The hash of a checkpoint finds
// damage; it does not stop a file that was made to lead astray.
#pragma once

#include <string>
#include <vector>

#include "frame/state.hpp"

namespace efsi::sim {

// What is wrong with the first field that has no place, as in "solid 2: u: 5 values: must be 8"; empty: all fit. Counts
// are those of the box, of each solid's band, lattice and surface; bands and the window lie in the box; all values are
// finite. ours: the state of the simulation, prepared; rests: of its bodies, as many as the states have.
std::string state_fault(const State& state, const State& ours, const grid::Grid& box,
                        const std::vector<solid::SolidRest>& rests);

// The same of one body.
std::string body_fault(const solid::SolidState& state, const grid::Grid& box, const solid::SolidRest& rest);

}  // namespace efsi::sim
