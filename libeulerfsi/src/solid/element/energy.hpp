// Purpose: energies of a solid, by its elements and by its shape.
// By elements is what the discrete forces derive from: the material's energy at the points of the elements, weighed as
// their stiffness is, and that of the hourglass modes. By shape every cell counts by the part of it that is solid, so
// that it does not matter which cells carry stiffness: the difference of the two is what that choice makes.
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// Of the elements of `work` in the displacement state.u [J]; what compute_material finds.
double elastic_energy(const Parallel& parallel, const SolidRest& rest, const SolidState& state, const SolidWork& work,
                      int points_per_element);

struct ShapeEnergies {
  double kinetic = 0.0, elastic = 0.0;  // [J]
  Vec3d center = Vec3d::Zero();         // of mass [m]
};
// Over the cells that are solid in part, in which u and v must be known (extend, advect), for the mass
// work.total_mass.
ShapeEnergies measure_shape(const Parallel& parallel, const SolidRest& rest, const SolidState& state,
                            const SolidWork& work, int points_per_element);

}  // namespace efsi::solid
