// Purpose: slow readable twin of grid::CornerShares: the range of the 8 values around a position, in which the values
// at one end of an axis fade out where the position is within 1/16 of the other end.
#pragma once

#include <algorithm>
#include <array>
#include <utility>

#include "base/math_types.hpp"

namespace efsi::reference {

// values: corners, x fastest; part: where in the cell the position is, 0 to 1. Returns the lowest and the highest.
inline std::pair<Real, Real> faded_range(const std::array<Real, 8>& values, const Vec3& part) {
  std::array<Real, 8> low = values, high = values;
  std::size_t count = 8;
  for (int axis = 2; axis >= 0; --axis) {  // the upper half of what is left lies at the upper end
    count /= 2;
    const Real upper = std::clamp(16 * part[axis], Real(0), Real(1));
    const Real lower = std::clamp(16 * (1 - part[axis]), Real(0), Real(1));
    for (std::size_t c = 0; c < count; ++c) {
      const Real least = std::min(low[c], low[c + count]), most = std::max(high[c], high[c + count]);
      low[c] = least + (1 - upper) * (low[c] - least) + (1 - lower) * (low[c + count] - least);
      high[c] = most + (1 - upper) * (high[c] - most) + (1 - lower) * (high[c + count] - most);
    }
  }
  return {low[0], high[0]};
}

}  // namespace efsi::reference
