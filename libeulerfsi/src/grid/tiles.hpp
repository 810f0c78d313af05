// Purpose: activity of blocks of 8^3 points, so that a stage visits only what it needs.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"

namespace efsi::grid {

inline constexpr int kTileSize = 8;

class TileMask {
 public:
  TileMask() = default;
  explicit TileMask(const Vec3i& points) : points_(points) {
    for (std::size_t a = 0; a < 3; ++a) tiles_[a] = (points[a] + kTileSize - 1) / kTileSize;
    active_.assign(
        static_cast<std::size_t>(tiles_[0]) * static_cast<std::size_t>(tiles_[1]) * static_cast<std::size_t>(tiles_[2]),
        0);
  }
  const Vec3i& tiles() const { return tiles_; }  // along each axis
  std::int64_t count() const { return static_cast<std::int64_t>(active_.size()); }
  std::int64_t at(const Vec3i& tile) const {
    return tile[0] + std::int64_t{1} * tiles_[0] * (tile[1] + std::int64_t{1} * tiles_[1] * tile[2]);
  }
  bool active(std::int64_t t) const { return active_[static_cast<std::size_t>(t)] != 0; }
  void set(std::int64_t t, bool on) { active_[static_cast<std::size_t>(t)] = on; }
  std::uint64_t active_count() const {
    std::uint64_t sum = 0;
    for (std::uint8_t a : active_) sum += a;
    return sum;
  }
  // Of masks of the same points; one without points covers none and takes the other's.
  bool covers(const TileMask& other) const {
    return points_ == other.points_ &&
           std::equal(active_.begin(), active_.end(), other.active_.begin(), std::greater_equal<>());
  }
  TileMask& operator|=(const TileMask& other) {
    if (active_.empty()) return *this = other;
    for (std::size_t t = 0; t < active_.size(); ++t) active_[t] |= other.active_[t];
    return *this;
  }
  // First point and end point of a tile.
  void range(std::int64_t t, Vec3i& begin, Vec3i& end) const {
    const int index[3] = {static_cast<int>(t % tiles_[0]), static_cast<int>(t / tiles_[0] % tiles_[1]),
                          static_cast<int>(t / (static_cast<std::int64_t>(tiles_[0]) * tiles_[1]))};
    for (std::size_t a = 0; a < 3; ++a) {
      begin[a] = index[a] * kTileSize;
      end[a] = std::min(points_[a], begin[a] + kTileSize);
    }
  }
  // Calls body(j, k, begin, end, active) for runs [begin, end) of points along x of one activity; rows of tiles in
  // parallel.
  template <class Body>
  void for_runs(const Parallel& parallel, const Body& body) const {
    parallel.for_each(std::int64_t{1} * tiles_[1] * tiles_[2], [&](std::int64_t row) {
      const std::int64_t first = row * tiles_[0];
      Vec3i begin, end;
      range(first, begin, end);
      for (int k = begin[2]; k < end[2]; ++k)
        for (int j = begin[1]; j < end[1]; ++j)
          for (int t = 0; t < tiles_[0];) {
            const int start = t;
            const bool on = active(first + start);
            while (t < tiles_[0] && active(first + t) == on) ++t;
            body(j, k, start * kTileSize, std::min(points_[0], t * kTileSize), on);
          }
    });
  }
  // Boxes [begin, end) of points: runs of active tiles along x; runs side by side along y make one box.
  std::vector<std::pair<Vec3i, Vec3i>> boxes() const {
    std::vector<std::pair<Vec3i, Vec3i>> found;
    std::size_t layer = 0;  // first box of this layer of tiles
    for (int k = 0; k < tiles_[2]; ++k, layer = found.size())
      for (int j = 0; j < tiles_[1]; ++j)
        for (int i = 0; i < tiles_[0]; ++i) {
          if (!active(at({i, j, k}))) continue;
          Vec3i begin, end, last;
          range(at({i, j, k}), begin, end);
          while (i + 1 < tiles_[0] && active(at({i + 1, j, k}))) range(at({++i, j, k}), last, end);
          const auto beside =
              std::find_if(found.begin() + static_cast<std::ptrdiff_t>(layer), found.end(), [&](const auto& box) {
                return box.first[0] == begin[0] && box.second[0] == end[0] && box.second[1] == begin[1];
              });
          if (beside == found.end())
            found.emplace_back(begin, end);
          else
            beside->second[1] = end[1];
        }
    return found;
  }
  // Every neighbour of an active tile becomes active (periodic neighbours included).
  void dilate(const std::array<bool, 3>& periodic) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::vector<std::uint8_t> old = active_;
      const int n = tiles_[static_cast<std::size_t>(axis)];
      const std::int64_t stride = axis == 0 ? 1 : (axis == 1 ? tiles_[0] : std::int64_t{1} * tiles_[0] * tiles_[1]);
      for (std::int64_t t = 0; t < count(); ++t) {
        const int i = static_cast<int>(t / stride % n);
        for (const int d : {-1, 1}) {
          int q = i + d;
          if (periodic[static_cast<std::size_t>(axis)]) q = (q + n) % n;
          if (q < 0 || q >= n) continue;
          if (old[static_cast<std::size_t>(t + (q - i) * stride)]) active_[static_cast<std::size_t>(t)] = 1;
        }
      }
    }
  }

 private:
  Vec3i points_{0, 0, 0}, tiles_{0, 0, 0};
  std::vector<std::uint8_t> active_;
};

}  // namespace efsi::grid
