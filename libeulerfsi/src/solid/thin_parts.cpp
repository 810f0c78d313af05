#include "solid/thin_parts.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::solid {
namespace {

constexpr double kBall = 1.5;      // cells: radius of the ball
constexpr double kSlack = 0.05;    // of the radius: what the ball may stand out
constexpr double kCorner = 2.1;    // of the radius: farther from its centre no corner of a box is that it touches
constexpr double kInside = 0.1;    // cells: how far inside the surface a place outside is asked for
constexpr double kFarthest = 2.0;  // cells outside
constexpr double kRoot = 2.0;      // cells: of a part, where balls reach already

// Whether no ball of this radius within the shape, but for the slack, is near Y; centres are nodes.
bool is_far(const geometry::SignedDistance& distance, const Vec3d& Y, double radius) {
  const double deep = -(1.0 - kSlack) * radius, far = kCorner * radius;
  Vec3i first, last;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto e = static_cast<Eigen::Index>(a);
    const double place = (Y[e] - distance.origin[e]) / distance.spacing, most = far / distance.spacing;
    first[a] = std::max(0, static_cast<int>(std::ceil(place - most)));
    last[a] = std::min(distance.size[a] - 1, static_cast<int>(std::floor(place + most)));
  }
  for (int k = first[2]; k <= last[2]; ++k)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int i = first[0]; i <= last[0]; ++i)
        if (static_cast<double>(distance.values[distance.index(i, j, k)]) < deep &&
            (distance.node(i, j, k) - Y).squaredNorm() <= far * far)
          return false;
  return true;
}

}  // namespace

ThinParts::ThinParts(const Parallel& parallel, const geometry::SignedDistance& distance, double h)
    : size_(distance.size), spacing_(distance.spacing), origin_(distance.origin) {
  enum Place : std::uint8_t { kElsewhere, kNearSurface, kFarFromBalls };
  std::vector<std::uint8_t> place(distance.values.size(), kElsewhere);
  parallel.for_each(size_[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < size_[1]; ++j)
      for (int i = 0; i < size_[0]; ++i) {
        const std::size_t n = distance.index(i, j, k);
        const double phi = static_cast<double>(distance.values[n]);
        if (phi > kFarthest * h || phi < -kBall * h) continue;
        Vec3d Y = distance.node(i, j, k);
        if (phi > -kInside * h) Y -= (phi + kInside * h) * distance.gradient(Y).normalized();
        place[n] = is_far(distance, Y, kBall * h) ? kFarFromBalls : kNearSurface;
      }
  });
  // These, and their surroundings as far as a root goes.
  std::vector<Vec3i> last, next;
  const auto take = [&](const Vec3i& at) {
    thin_[distance.index(at[0], at[1], at[2])] = 1;
    next.push_back(at);
  };
  for (int k = 0; k < size_[2]; ++k)
    for (int j = 0; j < size_[1]; ++j)
      for (int i = 0; i < size_[0]; ++i) {
        if (place[distance.index(i, j, k)] != kFarFromBalls) continue;
        if (thin_.empty()) thin_.assign(place.size(), 0);
        take({i, j, k});
      }
  for (double way = 0.0; way < kRoot * h; way += spacing_) {
    last.swap(next);
    next.clear();
    for (const Vec3i& at : last)
      for (std::size_t side = 0; side < 6; ++side) {
        Vec3i to = at;
        int& index = to[side / 2];
        index += side % 2 ? 1 : -1;
        if (index < 0 || index >= size_[side / 2]) continue;
        const std::size_t n = distance.index(to[0], to[1], to[2]);
        if (place[n] != kElsewhere && thin_[n] == 0) take(to);
      }
  }
}

bool ThinParts::contains(const Vec3d& material) const {
  if (thin_.empty()) return false;
  std::size_t n = 0, stride = 1;
  for (std::size_t a = 0; a < 3; ++a) {
    const double place =
        std::round((material[static_cast<Eigen::Index>(a)] - origin_[static_cast<Eigen::Index>(a)]) / spacing_);
    if (!(place >= 0.0 && place < size_[a])) return false;
    n += stride * static_cast<std::size_t>(place);
    stride *= static_cast<std::size_t>(size_[a]);
  }
  return thin_[n] != 0;
}

}  // namespace efsi::solid
