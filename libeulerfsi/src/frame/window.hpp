// Purpose: the part of the box that a step computes on. With fluid that is all of it; without, nothing has an equation
// outside the solids, and the common grid follows them.
#pragma once

#include <vector>

#include "frame/params.hpp"
#include "grid/boundary.hpp"
#include "solid/solid.hpp"

namespace efsi::sim {

inline constexpr int kWindowMargin = 1;  // cells between an element and a face of the window that is none of the box
inline constexpr int kWindowStep = 4;    // its sizes are multiples of so many cells: few steps change them

// Cells [lo, lo + cells) of the box.
struct Window {
  Vec3i lo{0, 0, 0}, cells{0, 0, 0};
  bool operator==(const Window&) const = default;
};

// The grid of a window; faces that are none of the box are open, nothing is fixed there.
struct CommonGrid {
  grid::Grid grid;
  grid::Walls walls;
};

// All of the box with fluid or along a periodic axis; elsewhere what is within kWindowMargin of the solids' elements,
// rounded up to multiples of kWindowStep. work: the solids' elements in this state.
Window choose_window(const Params& params, const grid::Grid& box, const std::vector<solid::SolidState>& solids,
                     const std::vector<solid::SolidWork>& work);
CommonGrid cut(const Params& params, const grid::Grid& box, const Window& window);

// What padded cells of one window are in another; 0 in cells that the first one does not have, and in ghosts.
std::vector<Real> move_cells(const std::vector<Real>& values, const Window& from, const Window& to);

}  // namespace efsi::sim
