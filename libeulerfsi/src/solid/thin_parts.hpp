// Purpose: the parts of a solid's rest shape that no ball of three cells inside it reaches: sheets and tips.
#pragma once

#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "geometry/signed_distance.hpp"

namespace efsi::solid {

// Constant. As the map carries such a part over the grid, none of its cells may stay as full as an element of a thick
// part is (solid/element/mass.hpp).
class ThinParts {
 public:
  ThinParts() = default;  // none
  ThinParts(const Parallel& parallel, const geometry::SignedDistance& distance, double h);
  // At the nearest node of the distance grid; material space, up to two cells outside the shape. False: elsewhere.
  bool contains(const Vec3d& material) const;
  std::size_t bytes() const { return thin_.capacity(); }

 private:
  Vec3i size_ = {0, 0, 0};
  double spacing_ = 1.0;
  Vec3d origin_ = Vec3d::Zero();
  std::vector<std::uint8_t> thin_;  // nodes of the distance grid; empty: none is
};

}  // namespace efsi::solid
