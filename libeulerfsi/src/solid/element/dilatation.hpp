// Purpose: the volume ratio that the pressure of a compressible solid answers to, carried with its material beside the
// map: det F of the map is rough from cell to cell after its transport, which at a high bulk modulus would be most of
// the solid's energy (docs/numerics/bulk-by-pressure.md).
// Source: dilatation as a field of its own, Simo, Taylor & Pister 1985 (mixed methods for nearly incompressible
// solids).
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// Reads the lattice; where no node around a point knows it, and in solids without one, it is det F.
class Dilatation {
 public:
  Dilatation(const SolidRest& rest, const SolidState& state) : lattice_(rest.lattice), nodes_(state.dilatation) {}
  // At the centre of a cell with these displacements at its corners, the lowest at x0; h: its edge [m].
  double at_center(const Vec3d u[8], const Vec3d& x0, double h, double det) const;

 private:
  const Grid& lattice_;
  const std::vector<Real>& nodes_;
};

constexpr double kForgotten = -1.0;  // a dilatation that is not known any more

// A step has given the elements another dilatation than they had (work.dilatation): `next`, per element; 0: it stays.
// The nodes around their centres take the mean of what has changed, those that knew nothing the mean itself; around an
// element of kForgotten they know nothing any more.
void carry_dilatation(const Parallel& parallel, const SolidRest& rest, const SolidWork& work,
                      const std::vector<double>& next, SolidState& state);

}  // namespace efsi::solid
