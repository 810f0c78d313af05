// Purpose: what a step, or several, report of solids that push each other (EfsiContactPair).
#pragma once

#include "frame/contact_pair.hpp"
#include "frame/scene.hpp"
#include "solve/pressure_equation.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::sim {

// Of a step after its projection. Empty where nothing pushes.
ContactPairs record_contacts(const Scene& scene, const SolidStates& states, const VelocityEquation& elasticity,
                             const PressureEquation& pressure);
// Adds those of a later step.
void add_contacts(const ContactPairs& later, ContactPairs& sums);

}  // namespace efsi::sim
