// Purpose: repulsion and friction of the particles of solids (solid/particles/particles.hpp) at other solids and at
// walls. Paper: Alg. 1 line 14; Sec. 4.6. The impulses: Eq. 14, 15, contact/repulsion.hpp.
//   overlap d = h_c - phi_j(X_j(x_p)): of a particle at x_p against solid j, seen in its material space
//   normal: of the triangle of j's surface that is nearest to X_j there, where that triangle is in the world now
// Every particle answers to the velocities of line 11. What it gets the other solid does not give: the other's own
// particles do, which are others. The text names solids only; its Table 1 gives k and mu to scenes of one solid, so
// walls act as a solid at rest does (docs/deviations.md).
#pragma once

#include "frame/step_context.hpp"
#include "solid/particles/particles.hpp"

namespace efsi::sim {

// particles: per solid; none of one whose motion is given. layer of its SolidWork: where it has velocities. Returns
// what the solids did to each other, in the order of the pairs.
ContactPairs repel_particles(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                             std::vector<solid::Particles>& particles);

}  // namespace efsi::sim
