// Purpose: where the finest level of the pressure multigrid is smoothed: everywhere, or in focus, on tiles of 8^3
// cells.
#pragma once

#include <vector>

#include "grid/tiles.hpp"
#include "system/divergence.hpp"

namespace efsi::system {

class PressureFocus {
 public:
  // Everywhere; a focus will hold the tiles `always`.
  void reset(const Grid& g, grid::TileMask always);
  // Everywhere again.
  void widen();
  // From now on, besides what is in focus already, the fewest tiles that leave a part of `limit`, a 2-norm, of the
  // residual r outside (padded cells), and the tiles beside them.
  void follow(const Parallel& parallel, const std::vector<Real>& r, double limit);
  // The same for the tiles that hold some of these padded cells.
  void follow(const std::vector<std::size_t>& cells);
  bool everywhere() const { return smoothed_.empty(); }
  // Boxes that do not overlap: what is smoothed, and where that changes A x. None: everywhere.
  const std::vector<CellBox>& smoothed() const { return smoothed_; }
  const std::vector<CellBox>& reached() const { return reached_; }

 private:
  void add(const grid::TileMask& tiles);
  Grid grid_;
  grid::TileMask always_;
  grid::TileMask followed_, within_;  // asked for so far; the same with what is beside them and always_
  std::vector<CellBox> smoothed_, reached_;
};

// Marks the tiles that hold some of these padded cells.
void mark_tiles(const Grid& g, const std::vector<std::size_t>& cells, grid::TileMask& mask);

}  // namespace efsi::system
