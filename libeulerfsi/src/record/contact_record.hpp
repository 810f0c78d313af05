// Purpose: the record of contacts between solids in one or several steps (EfsiContactPair).
#pragma once

#include "frame/contact_pair.hpp"
#include "frame/scene.hpp"
#include "solve/pressure_equation.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::sim {

// Reaction in the coupling step of the rows that are penalties in G, per row [N s].
std::vector<Vec3d> coupling_impulses(const VelocityEquation& elasticity, const PressureEquation& pressure);
// Of a step after its projection; coupling: as above. Empty without contact impulses.
ContactPairs record_contacts(const Scene& scene, const SolidStates& states, const SolidContacts& contacts,
                             const std::vector<Vec3d>& coupling);
// Adds those of a later step.
void add_contacts(const ContactPairs& later, ContactPairs& sums);

}  // namespace efsi::sim
