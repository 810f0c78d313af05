#include "solid/map/boundary_distance.hpp"

#include <array>
#include <optional>

#include "grid/interpolate.hpp"
#include "solid/map/inverse_map.hpp"

namespace efsi::solid {

constexpr int kFalsePositions = 3;

double boundary_distance(const SolidRest& rest, const SolidState& state, const Vec3d& x, const Vec3d& outwards,
                         double length) {
  const grid::Grid& g = state.band.grid;
  const geometry::SignedDistance& distance = distance_of(rest, state);
  const auto corner = grid::corner_offsets(g);
  const auto at_rest = [&](double way) -> std::optional<double> {
    const Vec3d y = x - way * outwards;
    Vec3d u;
    Mat3d gradient;
    if (!sample_displacement(state, corner, y, u, gradient)) return {};
    return distance.sample(y - u);
  };
  const Vec3d u = grid::NodeSampler(g).vector(state.u, ((x - g.origin) / g.h).cast<Real>()).cast<double>();
  double near = 0.0, at_near = distance.sample(x - u);
  const double estimate = at_near / length;
  const std::optional<double> at_estimate = at_rest(estimate);
  if (!at_estimate || !(*at_estimate * at_near < 0.0)) return estimate;
  double far = estimate, at_far = *at_estimate;
  const auto crossing = [&] { return near + (far - near) * at_near / (at_near - at_far); };
  bool last = false;  // whether the far end moved
  for (int n = 0; n < kFalsePositions; ++n) {
    const double way = crossing();
    const std::optional<double> there = at_rest(way);
    if (!there || *there == 0.0) return way;
    const bool beyond = *there * at_near < 0.0;
    (beyond ? far : near) = way;
    (beyond ? at_far : at_near) = *there;
    if (n > 0 && beyond == last) (beyond ? at_near : at_far) *= 0.5;  // the end that stays counts half (Illinois)
    last = beyond;
  }
  return crossing();
}

}  // namespace efsi::solid
