// Purpose: conserves the amount of smoke and heat: what the transport has lost or gained is compensated
// in the neighbourhood.
// Symbols: psi: quadratic B-splines, one per interval of 8^3 cells, of sum 1; s, r: a cell's value before and after the
// transport; x: the cell's centre, X: where its content comes from; top: the largest |s| nearby.
//   missing = sum psi(x) s - sum psi(X) r         what there was and what has arrived from there
//   r += q w,  w = |r| (1 - |r| / top),  q = sum of psi(x) missing / sum psi(x) w over the functions, |q| <= 1
// So the sum is kept, |r| stays below top, no sign changes and nothing comes where nothing is. Smooth functions, since
// kinks would make of every motion of the cells across them a loss here and a gain there (docs/lab/smoke.md).
#pragma once

#include <array>

#include "base/parallel.hpp"
#include "fluid/emitter.hpp"
#include "grid/boundary.hpp"
#include "grid/tiles.hpp"

namespace efsi::fluid {

using grid::Grid;

// psi along an axis, as a tile of cells sees it. Its cells lie in interval 0.
struct TileSpline {
  using Row = Real[grid::kTileSize];
  int function[5];           // -2..2; beyond the box the last one, mirrored
  Real begin;                // of interval 0 [cells]
  Real width[3];             // of intervals -1, 0, 1 [cells]
  Real before[3], after[3];  // each one's part of its and the last's width, of its and the next's
  Row cell[3], block[3];     // functions -1, 0, 1 at the cells and in the middle of their pairs
};

// Of one cell-centred scalar. Cells in solids hold nothing; their flags are empty without solids. Nothing is read
// across steps.
class ScalarBudget {
 public:
  // Before the transport. keep: whether the amount is kept at all; tiles: where the scalar may be before or after the
  // transport; top: its largest magnitude per tile.
  void open(const Parallel& parallel, const Grid& g, bool keep, const grid::TileMask& tiles,
            const std::vector<Real>& top, const std::vector<Real>& field, const std::vector<std::uint8_t>& solid);
  // Fluid comes in and brings what is in these cells.
  void bring_in(const Grid& g, double dt, std::span<const SourceCell> sources, const std::vector<Real>& field);
  // After it. back: per cell how far it is from its centre to where its content comes from [cells].
  void count(const Parallel& parallel, const Grid& g, const grid::VectorField& back, const std::vector<Real>& field,
             const std::vector<std::uint8_t>& solid);
  // When the solids have moved: cells that are more than half solid now are emptied, which is a loss too, and what is
  // missing is restored; not within two intervals of an open face, where what has left is no loss.
  void settle(const Parallel& parallel, const Grid& g, const grid::Walls& walls, const std::vector<std::uint8_t>& was,
              const std::vector<Real>& cell_fraction, std::vector<Real>& field);
  // There is nothing to settle.
  void close() { tiles_ = {}; }
  std::size_t bytes() const;

 private:
  std::size_t function(int i, int j, int k) const;
  void gather(const Parallel& parallel, const grid::Walls& walls);
  void exchange(const Parallel& parallel, const Grid& g);

  bool keep_ = true;
  grid::TileMask tiles_;
  Vec3i functions_{0, 0, 0};
  std::array<std::vector<TileSpline>, 3> splines_;     // per axis and tile along it
  std::vector<Real> top_;                              // per tile: of it and its 26 neighbours
  std::vector<Real> parts_;                            // per tile: what its cells miss of the functions -2..2
  std::vector<Real> room_parts_;                       // per tile: sum psi w in it for the functions -1..1
  std::vector<double> missing_, room_, given_, over_;  // per function
  std::vector<Real> share_;                            // q / psi
};

}  // namespace efsi::fluid
