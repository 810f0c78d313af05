#include "solid/thin_parts.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::solid {
namespace {

constexpr double kBall = 1.5;      // cells: radius of the ball
constexpr double kSlack = 0.05;    // of the radius: what the ball may stand out, and leave to the place
constexpr double kInside = 0.1;    // cells: how far inside the surface a place outside is asked for
constexpr double kFarthest = 2.0;  // cells outside

// Whether a ball of this radius within the shape reaches Y, but for the slack.
bool is_thick(const geometry::SignedDistance& distance, const Vec3d& Y, const Vec3d& normal, double radius) {
  const double deep = -(1.0 - kSlack) * radius, reach = (1.0 + kSlack) * radius;
  const auto is_centre = [&](const Vec3d& place) { return distance.sample(place) < deep; };
  if (is_centre(Y) || is_centre(Y - reach * normal)) return true;
  const double step = distance.spacing;
  const int most = static_cast<int>(std::ceil(reach / step));
  for (int k = -most; k <= most; ++k)
    for (int j = -most; j <= most; ++j)
      for (int i = -most; i <= most; ++i) {
        const Vec3d offset = step * Vec3d(i, j, k);
        if (offset.squaredNorm() <= reach * reach && is_centre(Y + offset)) return true;
      }
  return false;
}

}  // namespace

ThinParts::ThinParts(const Parallel& parallel, const geometry::SignedDistance& distance, double h)
    : size_(distance.size), spacing_(distance.spacing), origin_(distance.origin) {
  thin_.assign(distance.values.size(), 0);
  parallel.for_each(size_[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < size_[1]; ++j)
      for (int i = 0; i < size_[0]; ++i) {
        const std::size_t n = distance.index(i, j, k);
        const double phi = static_cast<double>(distance.values[n]);
        if (phi > kFarthest * h || phi < -kBall * h) continue;
        Vec3d Y = distance.node(i, j, k);
        const Vec3d normal = distance.gradient(Y).normalized();
        if (phi > -kInside * h) Y -= (phi + kInside * h) * normal;
        thin_[n] = !is_thick(distance, Y, normal, kBall * h);
      }
  });
  if (std::none_of(thin_.begin(), thin_.end(), [](std::uint8_t mark) { return mark != 0; }))
    std::vector<std::uint8_t>().swap(thin_);
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
