// Purpose: grids and fields for tests of transport.
#pragma once

#include <vector>

#include "fluid/fluid.hpp"

namespace efsi::fluid {

// One unit long in x.
inline Grid box(const Vec3i& cells, bool periodic = false) {
  Grid g;
  g.cells = cells;
  g.h = 1.0 / cells[0];
  g.periodic = {periodic, periodic, periodic};
  return g;
}

inline double total(const std::vector<Real>& field) {
  double sum = 0.0;
  for (Real v : field) sum += static_cast<double>(v);
  return sum;
}

}  // namespace efsi::fluid
