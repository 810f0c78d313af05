// Purpose: how deep and how much two solids lie in each other.
#pragma once

#include "base/parallel.hpp"
#include "geometry/signed_distance.hpp"

namespace efsi::geometry {

struct Overlap {
  double depth = 0.0;   // diameter of the largest ball that lies in both solids [m]; 0: they do not overlap
  double volume = 0.0;  // of what lies in both [m^3]
};

// Where both fields are negative. The depth of two balls is the thickness of their lens, that of a solid within another
// one its own thickness. Both fields are looked at in steps of a quarter of the smaller spacing: the depth is right to
// about half of that spacing, of a solid within another one to the larger spacing; the volume to that of the linear
// interpolant on nodes one spacing apart. Fields whose boxes do not meet cost nothing. The bits do not depend on the
// number of threads or on the order of a and b.
Overlap overlap(const SignedDistance& a, const SignedDistance& b, const Parallel& parallel = Parallel());

}  // namespace efsi::geometry
