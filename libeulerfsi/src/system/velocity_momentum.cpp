// The momentum that a solve of G leaves is made that of its right-hand side, by a rigid motion of each solid.
#include <algorithm>

#include "system/velocity_system.hpp"

namespace efsi::system {

// The rigid motion that gives the unknowns of a solid the momenta that x lacks of b, nearly: where the fluid slips a
// third of its mass stands for the part along the normal.
solid::RigidMotion VelocitySystem::missing_motion(const Parallel& parallel, std::size_t solid,
                                                  const std::vector<Real>& b, const std::vector<Real>& x) const {
  const std::size_t begin = unknown_begin_[solid], end = unknown_begin_[solid + 1];
  const auto& band = solids_[solid].state->band.grid;
  const Vec3d origin = band.node_position(band.cells[0] / 2, band.cells[1] / 2, band.cells[2] / 2);
  const std::size_t chunks = (end - begin + kUnknownsPerSum - 1) / kUnknownsPerSum;
  std::vector<solid::MomentSums> sums(chunks);
  parallel.for_each(static_cast<std::int64_t>(chunks), [&](std::int64_t chunk) {
    const auto c = static_cast<std::size_t>(chunk);
    for (std::size_t u = begin + c * kUnknownsPerSum; u < std::min(end, begin + (c + 1) * kUnknownsPerSum); ++u) {
      const double m = static_cast<double>(inertia_[u]);
      const Vec3d slides = sliding_momentum(u, x).cast<double>();
      Vec3d missing;
      for (std::size_t a = 0; a < 3; ++a)
        missing[static_cast<Eigen::Index>(a)] =
            static_cast<double>(b[3 * u + a]) - m * static_cast<double>(x[3 * u + a]);
      sums[c].add(inertia(u), place(u) - origin, (missing + slides) / inertia(u));
    }
  });
  for (std::size_t c = 1; c < chunks; ++c) sums[0].add(sums[c]);
  return chunks > 0 ? solid::rigid_motion(sums[0].momenta(origin), held_[solid]) : solid::RigidMotion{};
}

void VelocitySystem::conserve_momentum(const Parallel& parallel, const std::vector<Real>& b,
                                       std::vector<Real>& x) const {
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    if (held_[l] == kAllAxes) continue;
    const std::size_t begin = unknown_begin_[l], end = unknown_begin_[l + 1];
    for (int pass = 0; pass < (normal_.empty() ? 1 : 2); ++pass) {
      const solid::RigidMotion missing = missing_motion(parallel, l, b, x);
      parallel.for_each(static_cast<std::int64_t>(end - begin), [&](std::int64_t i) {
        const std::size_t u = begin + static_cast<std::size_t>(i);
        const Vec3d v = missing.at(place(u));
        for (std::size_t a = 0; a < 3; ++a) x[3 * u + a] += static_cast<Real>(v[static_cast<Eigen::Index>(a)]);
      });
    }
  }
}

std::vector<Vec3d> VelocitySystem::sum_by_solid(const Parallel& parallel, const std::vector<Real>& x) const {
  std::vector<Vec3d> sums(solids_.size());
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    const std::size_t begin = unknown_begin_[l], end = unknown_begin_[l + 1];
    const auto chunks = static_cast<std::int64_t>((end - begin + kUnknownsPerSum - 1) / kUnknownsPerSum);
    for (std::size_t a = 0; a < 3; ++a)
      sums[l][static_cast<Eigen::Index>(a)] = parallel.sum(chunks, [&](std::int64_t chunk) {
        const std::size_t first = begin + static_cast<std::size_t>(chunk) * kUnknownsPerSum;
        double part = 0.0;
        for (std::size_t u = first; u < std::min(end, first + kUnknownsPerSum); ++u)
          part += static_cast<double>(x[3 * u + a]);
        return part;
      });
  }
  return sums;
}

}  // namespace efsi::system
