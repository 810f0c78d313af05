#include "solid/map/copies.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace efsi::solid {

using grid::Grid;

namespace {

constexpr double kBeside = 2.0;  // cells: so near the map may be rough
constexpr int kNear = 2;         // cells of material: wider than the box whose strongest claim stands for all in it

// Per cell: full and connected over faces to the most other full ones.
std::vector<std::uint8_t> largest_part(const Grid& g, const std::vector<std::uint8_t>& full) {
  constexpr std::int32_t kNone = -1;
  std::vector<std::int32_t> part(full.size(), kNone);
  std::vector<std::size_t> sizes;
  std::vector<Vec3i> next;
  const auto join = [&](const Vec3i& cell) {
    const std::size_t c = g.cell(cell[0], cell[1], cell[2]);
    if (!full[c] || part[c] != kNone) return;
    part[c] = static_cast<std::int32_t>(sizes.size());
    next.push_back(cell);
  };
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        join({i, j, k});
        std::size_t size = 0;
        for (; !next.empty(); ++size) {
          const Vec3i cell = next.back();
          next.pop_back();
          for (std::size_t a = 0; a < 3; ++a)
            for (const int step : {-1, 1}) {
              Vec3i beside = cell;
              beside[a] += step;
              if (beside[a] >= 0 && beside[a] < g.cells[a]) join(beside);
            }
        }
        if (size > 0) sizes.push_back(size);
      }
  const auto largest = static_cast<std::int32_t>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<std::uint8_t> in_largest(full.size());
  for (std::size_t c = 0; c < full.size(); ++c) in_largest[c] = full[c] && part[c] == largest;
  return in_largest;
}

// Where the solid holds its material: the rest shape in boxes of a cell's size, each with the strongest claim to it.
class Claims {
 public:
  Claims(const Grid& g, const std::vector<std::vector<Holding>>& planes, const std::vector<std::uint8_t>& full,
         double stretch)
      : grid_(g), full_(full), in_largest_(largest_part(g, full)), stretch_(stretch) {
    Vec3d high = Vec3d::Constant(-std::numeric_limits<double>::infinity());
    low_ = -high;
    for_full(planes, [&](const Holding& holding) {
      low_ = low_.cwiseMin(holding.material);
      high = high.cwiseMax(holding.material);
    });
    if (!(low_[0] <= high[0])) return;
    const Vec3i last = box(high);
    for (std::size_t a = 0; a < 3; ++a) boxes_.cells[a] = last[a] + 1;
    strongest_.resize(boxes_.cell_count(), nullptr);
    for_full(planes, [&](const Holding& holding) {
      const Vec3i b = box(holding.material);
      const Holding*& there = strongest_[boxes_.cell(b[0], b[1], b[2])];
      if (!there || strength(*there) <= strength(holding)) there = &holding;
    });
  }

  bool is_copy(const Holding& holding) const {
    if (strongest_.empty() || strength(holding) == kStrongest) return false;
    const Vec3i middle = box(holding.material);
    Vec3i first, last;
    for (std::size_t a = 0; a < 3; ++a) {
      first[a] = std::max(middle[a] - kNear, 0);
      last[a] = std::min(middle[a] + kNear, boxes_.cells[a] - 1);
    }
    for (int k = first[2]; k <= last[2]; ++k)
      for (int j = first[1]; j <= last[1]; ++j)
        for (int i = first[0]; i <= last[0]; ++i) {
          const Holding* other = strongest_[boxes_.cell(i, j, k)];
          if (other && strength(*other) > strength(holding) && contradict(*other, holding)) return true;
        }
    return false;
  }

 private:
  static constexpr int kStrongest = 2;

  template <class Visit>
  void for_full(const std::vector<std::vector<Holding>>& planes, const Visit& visit) const {
    for (const auto& plane : planes)
      for (const Holding& holding : plane)
        if (full_[index(holding)]) visit(holding);
  }
  std::size_t index(const Holding& holding) const {
    return grid_.cell(holding.cell[0], holding.cell[1], holding.cell[2]);
  }
  int strength(const Holding& holding) const {
    const std::size_t c = index(holding);
    if (full_[c] && !in_largest_[c]) return 0;
    return holding.known ? kStrongest : 1;
  }
  bool contradict(const Holding& a, const Holding& b) const {
    const double apart = Vec3d(a.cell[0] - b.cell[0], a.cell[1] - b.cell[1], a.cell[2] - b.cell[2]).norm();
    const double material = (a.material - b.material).norm();
    return material < kNear * grid_.h && apart > kBeside && grid_.h * apart > stretch_ * material;
  }
  Vec3i box(const Vec3d& material) const {
    Vec3i b;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto i = static_cast<Eigen::Index>(a);
      b[a] = static_cast<int>(std::floor((material[i] - low_[i]) / grid_.h));
    }
    return b;
  }

  const Grid& grid_;
  const std::vector<std::uint8_t>& full_;
  std::vector<std::uint8_t> in_largest_;
  double stretch_;
  Vec3d low_;
  Grid boxes_;
  std::vector<const Holding*> strongest_;  // per box, or none
};

}  // namespace

std::vector<std::size_t> find_copies(const Parallel& parallel, const Grid& g,
                                     const std::vector<std::vector<Holding>>& planes,
                                     const std::vector<std::uint8_t>& full, double stretch) {
  const Claims claims(g, planes, full, stretch);
  std::vector<std::vector<std::size_t>> found(planes.size());
  parallel.for_each(static_cast<std::int64_t>(planes.size()), [&](std::int64_t p) {
    const auto plane = static_cast<std::size_t>(p);
    for (const Holding& holding : planes[plane])
      if (claims.is_copy(holding)) found[plane].push_back(g.cell(holding.cell[0], holding.cell[1], holding.cell[2]));
  });
  std::vector<std::size_t> copies;
  for (const auto& plane : found) copies.insert(copies.end(), plane.begin(), plane.end());
  return copies;
}

}  // namespace efsi::solid
