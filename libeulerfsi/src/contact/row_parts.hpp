// Purpose: on which nodes a row of contact acts at a point of a solid's surface.
#pragma once

#include <array>
#include <limits>
#include <optional>

#include "contact/solid_contacts.hpp"
#include "nodes/node_fields.hpp"
#include "solid/solid.hpp"

namespace efsi::sim {

using Weights = std::array<double, 8>;
inline Weights trilinear(const Vec3d& t) {
  Weights w;
  for (std::size_t a = 0; a < 8; ++a) {
    w[a] = 1.0;
    for (int axis = 0; axis < 3; ++axis) w[a] *= grid::kCorner[a][axis] ? t[axis] : 1.0 - t[axis];
  }
  return w;
}

// The cell of the band nearest to x among those that carry stiffness and of which `accept` is true.
template <class Accept>
std::optional<Vec3i> nearest_element(const grid::Grid& g, const solid::SolidWork& work, const Vec3d& x,
                                     const Accept& accept) {
  constexpr int kSearch = 2;  // cells around x
  const Vec3d at = (x - g.origin) / g.h;
  Vec3i base;
  for (std::size_t a = 0; a < 3; ++a) base[a] = static_cast<int>(std::floor(at[static_cast<Eigen::Index>(a)]));
  double least = std::numeric_limits<double>::infinity();
  std::optional<Vec3i> nearest;
  for (int k = base[2] - kSearch; k <= base[2] + kSearch; ++k)
    for (int j = base[1] - kSearch; j <= base[1] + kSearch; ++j)
      for (int i = base[0] - kSearch; i <= base[0] + kSearch; ++i) {
        if (i < 0 || j < 0 || k < 0 || i >= g.cells[0] || j >= g.cells[1] || k >= g.cells[2]) continue;
        if (work.element[g.cell(i, j, k)] < 0) continue;
        const Vec3d low(i, j, k);
        const double square = (at - at.cwiseMax(low).cwiseMin(low + Vec3d::Ones())).squaredNorm();
        if (!(square < least) || !accept(Vec3i{i, j, k})) continue;
        least = square;
        nearest = {i, j, k};
      }
  return nearest;
}

// Adds what a surface point at x has in a row: the corners of its element, times sign.
void add_parts(const grid::Grid& band, const Vec3i& element, const grid::Grid& common, const Vec3d& x, double sign,
               std::vector<system::RowPart>& parts);

struct FoundRow {
  RowPlace place;
  system::ContactRow contact;
};

// The solid to which a part of a row belongs.
inline std::size_t solid_of(const RowPlace& place, std::size_t part) { return place.solids[part < 8 ? 0 : 1]; }
// B v of a row whose parts name nodes.
Vec3d velocity_of(const RowPlace& place, const system::ContactRow& row, const NodeVelocity& velocity);

}  // namespace efsi::sim
