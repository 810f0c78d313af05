// Purpose: self-contact of folds: a row wherever two parts of its surface come near each other through
// what is not solid, and are far from each other in the material (docs/numerics/folds.md). What rows do: Eq. 8 with
// contact, system/contact_solve.hpp.
#pragma once

#include <vector>

#include "contact/row_parts.hpp"
#include "contact/solid_contact.hpp"
#include "frame/step_context.hpp"

namespace efsi::sim {

// Before anything else in a step: where the fold points of a solid are, and which are near each other
// (work.fold_places, work.near_folds; empty where none are).
void find_near_folds(const Parallel& parallel, const solid::SolidRest& rest, const solid::SolidState& state,
                     solid::SolidWork& work);

// The rows of solid l, in the order of their points, with the impulses of the last step.
std::vector<FoundRow> find_folds(const StepContext& step, std::size_t l, const solid::SolidState& state,
                                 const solid::SolidWork& work, const grid::Grid& common, const NodeVelocity& velocity);

// Calls visit for the parts of a solid that are within reach of another.
void visit_fold_gaps(const solid::SolidState& state, const solid::SolidWork& work, const VisitGap& visit);

}  // namespace efsi::sim
