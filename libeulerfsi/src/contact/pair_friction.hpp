// Purpose: Coulomb's law of two bodies as a whole, by the normal impulse of this step. The pressure changes it after
// the velocity solve, whose friction is limited by what it was there: while a contact unloads that is too much
// (docs/numerics/pair-friction.md).
#pragma once

#include <vector>

#include "contact/hold.hpp"
#include "contact/solid_contacts.hpp"
#include "contact/wall_friction.hpp"
#include "frame/step_context.hpp"

namespace efsi::sim {

// Takes from the solids what friction between two of them has too much in the step: adds to `impulses`, per solid, and
// to the record of contacts and the reactions of colliders in step.info. coupling: what the pressure adds to the
// impulse of each row [N s]; momenta: of the solids after it.
void limit_pair_friction(const StepContext& step, const SolidStates& states, const Holds& holds,
                         const SolidContacts& contacts, const std::vector<Vec3d>& coupling,
                         const std::vector<solid::Momenta>& momenta, std::vector<RigidImpulse>& impulses);

}  // namespace efsi::sim
