// Purpose: Eq. 8 of a step with what acts on it: walls, solids, what is given.
#pragma once

#include <vector>

#include "contact/hold.hpp"
#include "contact/solid_contacts.hpp"
#include "contact/wall_row.hpp"
#include "given/given_node.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

// Eq. 8 on its unknowns.
struct VelocityEquation {
  system::VelocitySystem system;
  Holds holds;                        // constraints of the solids during and after the solve
  std::vector<WallRow> walls;         // what walls do
  SolidContacts contacts;             // what solids do to each other
  std::vector<PrescribedNode> given;  // what pins and colliders prescribe
  std::vector<Real> f_star;           // the right-hand side [kg m/s]
  std::vector<Real> v_star;           // start of the solve, then v* [m/s]
  std::vector<Real> v_old;            // at the start of the step, where there are contacts or pins [m/s]
  std::vector<Real> momentum;         // M v + dt f, which v* has to have [kg m/s]
};

}  // namespace efsi::sim
