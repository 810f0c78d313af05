#include "contact/row_parts.hpp"

namespace efsi::sim {
namespace {

constexpr double kExternal = 0.5;  // cells: rows act at most that far outside the cells that carry stiffness

}  // namespace

void add_parts(const grid::Grid& band, const Vec3i& element, const grid::Grid& common, const Vec3d& x, double sign,
               std::vector<system::RowPart>& parts) {
  const Vec3d local = ((x - band.origin) / band.h - Vec3d(element[0], element[1], element[2]))
                          .cwiseMax(Vec3d::Constant(-kExternal))
                          .cwiseMin(Vec3d::Constant(1.0 + kExternal));
  const Weights w = trilinear(local);
  const Vec3i lo = grid::offset(band, common);
  for (std::size_t a = 0; a < 8; ++a) {
    const auto& c = grid::kCorner[a];
    parts.push_back({common.node(element[0] + c[0] + lo[0], element[1] + c[1] + lo[1], element[2] + c[2] + lo[2]),
                     static_cast<Real>(sign * w[a])});
  }
}

Vec3d velocity_of(const RowPlace& place, const system::ContactRow& row, const NodeVelocity& velocity) {
  Vec3d sum = Vec3d::Zero();
  for (std::size_t p = 0; p < row.parts.size(); ++p)
    sum += static_cast<double>(row.parts[p].weight) *
           velocity.slip.velocity_of(solid_of(place, p), row.parts[p].unknown, velocity.field).cast<double>();
  return sum;
}

}  // namespace efsi::sim
