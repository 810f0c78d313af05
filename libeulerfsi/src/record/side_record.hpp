// Purpose: vertices that leave another solid through another side than that by which they went in: surfaces that have
// exchanged sides (EfsiContactPair.exchanged_vertices).
#pragma once

#include "frame/contact_pair.hpp"
#include "frame/scene.hpp"

namespace efsi::sim {

// Of the state at the end of a step. Counts them in their pairs, which are added where they are missing, and remembers
// what is deep in another solid (SolidState::deep).
void record_sides(const Scene& scene, SolidStates& states, ContactPairs& pairs);

}  // namespace efsi::sim
