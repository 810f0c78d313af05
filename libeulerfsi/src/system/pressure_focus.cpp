#include "system/pressure_focus.hpp"

#include <algorithm>

namespace efsi::system {
namespace {

constexpr double kUnfocused = 0.3;    // of the limit: residual in tiles that are not smoothed
constexpr double kMostFocused = 0.5;  // of all tiles: with more, sweeps of everything are faster

// The fewest tiles that leave no more than `limit`, a 2-norm, of r outside.
grid::TileMask tiles_of(const Parallel& parallel, const Grid& g, const std::vector<Real>& r, double limit) {
  grid::TileMask mask(g.cells);
  std::vector<std::pair<double, std::int64_t>> tiles(static_cast<std::size_t>(mask.count()));  // |r|^2 in each
  parallel.for_each(mask.count(), [&](std::int64_t t) {
    Vec3i begin, end;
    mask.range(t, begin, end);
    double sum = 0.0;
    for (int k = begin[2]; k < end[2]; ++k)
      for (int j = begin[1]; j < end[1]; ++j)
        for (int i = begin[0]; i < end[0]; ++i) {
          const double value = static_cast<double>(r[g.padded(i, j, k)]);
          sum += value * value;
        }
    tiles[static_cast<std::size_t>(t)] = {sum, t};
  });
  std::sort(tiles.begin(), tiles.end());
  double left = 0.0;
  for (const auto& [sum, t] : tiles) {
    left += sum;
    mask.set(t, !(left <= limit * limit));
  }
  return mask;
}

}  // namespace

void mark_tiles(const Grid& g, const std::vector<std::size_t>& cells, grid::TileMask& mask) {
  const auto tile = [](std::size_t padded) { return (static_cast<int>(padded) - 1) / grid::kTileSize; };
  const std::size_t row = g.padded(0, 1, 0) - g.padded(0, 0, 0), plane = g.padded(0, 0, 1) - g.padded(0, 0, 0);
  for (const std::size_t c : cells) mask.set(mask.at({tile(c % row), tile(c % plane / row), tile(c / plane)}), true);
}

void PressureFocus::reset(const Grid& g, grid::TileMask always) {
  grid_ = g;
  always_ = std::move(always);
  widen();
}

void PressureFocus::widen() {
  followed_ = within_ = {};
  smoothed_.clear();
  reached_.clear();
}

void PressureFocus::follow(const Parallel& parallel, const std::vector<Real>& r, double limit) {
  add(tiles_of(parallel, grid_, r, kUnfocused * limit));
}

void PressureFocus::follow(const std::vector<std::size_t>& cells) {
  grid::TileMask tiles(grid_.cells);
  mark_tiles(grid_, cells, tiles);
  add(tiles);
}

void PressureFocus::add(const grid::TileMask& tiles) {
  if (within_.covers(tiles)) return;
  followed_ |= tiles;
  within_ = followed_;
  within_.dilate(grid_.periodic);
  within_ |= always_;
  smoothed_.clear();
  if (static_cast<double>(within_.active_count()) > kMostFocused * static_cast<double>(within_.count())) return;
  smoothed_ = within_.boxes();
  grid::TileMask reached = within_;
  reached.dilate(grid_.periodic);
  reached_ = reached.boxes();
}

}  // namespace efsi::system
