// Purpose: body forces on the fluid: buoyancy of smoke, vorticity confinement.
// Paper: Alg. 1 line 8 (f_ext); Sec. 4.4, Sec. 5.1; vorticity confinement: Fedkiw, Stam, Jensen 2001.
#pragma once

#include "base/parallel.hpp"
#include "fluid/fluid.hpp"

namespace efsi::fluid {

// velocity += dt (buoyancy of smoke + confinement) at nodes whose specific volume equals the fluid's. The weight of
// matter is not in it. state: smoke and temperature are read; its velocity, which `velocity` stands for during a step,
// is scratch. Returns the number of nodes visited.
std::uint64_t add_body_forces(const Parallel& parallel, const Grid& g, const FluidParams& params, FluidState& state,
                              const Vec3d& gravity, double dt, const std::vector<Real>& specific_volume,
                              VectorField& velocity);

}  // namespace efsi::fluid
