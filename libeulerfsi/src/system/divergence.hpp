// Purpose: the constraint gradient J of Eq. 11 and its transpose as stencils, never stored.
// Paper: Sec. 4.2, Sec. 4.5; Eq. 11, Eq. 12.
//   (J v)_c = h^2/4 sum over corners a of c of (+-v_x +-v_y +-v_z)_a  [m^3/s], the flux out of cell c of face-averaged
//   v A = J W J^T, W = 1/m per node with the components that walls fix set to zero
// A slow reference with assembled matrices is in tests/reference/.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "grid/boundary.hpp"
#include "grid/grid.hpp"

namespace efsi::system {

using grid::Grid;
using grid::VectorField;
using grid::Walls;

// One grid of the pressure equation.
struct PressureGrid {
  Grid grid;
  Walls walls;
  std::vector<std::uint8_t> active;    // padded cells; empty: all cells have an equation
  std::vector<Real> inverse_diagonal;  // of smoothing; padded cells; 0 where a cell has no equation
  // Along each axis what the first and the last cell have of the length h: from the wall, half a cell beyond the
  // center.
  std::array<double, 3> outer{1, 1, 1};
};

// The grid of the scene.
struct PressureLevel : PressureGrid {
  std::vector<std::uint8_t> fixed;  // per node: bit a: component a is fixed by a wall
  // W (h^2/4)^2 per node, walls not yet applied [m^4/kg]: A = D mobility D^T with D the +-1 stencil.
  std::vector<Real> mobility;
};

// y = A x on padded cell arrays. Ghosts of x must be filled (fill_ghosts with 0). Ghosts of y are not written.
// With b given, y = b - A x.
void apply_pressure_operator(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& x,
                             std::vector<Real>& y, const std::vector<Real>* b = nullptr);

// x += weight D^-1 (b - A x), one Jacobi step in place. Ghosts of x must be filled.
void smooth_pressure(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& b, Real weight,
                     std::vector<Real>& x);

// Cells [first, second).
using CellBox = std::pair<Vec3i, Vec3i>;
// r = b - A x in boxes that do not overlap. Ghosts of x must be filled.
void residual_in_boxes(const Parallel& parallel, const PressureLevel& level, const std::vector<CellBox>& boxes,
                       const std::vector<Real>& b, const std::vector<Real>& x, std::vector<Real>& r);
// out = x + weight D^-1 (b - A x) in boxes that do not overlap; out is another field than x. Ghosts of x must be
// filled.
void relax_in_boxes(const Parallel& parallel, const PressureLevel& level, const std::vector<CellBox>& boxes,
                    const std::vector<Real>& b, Real weight, const std::vector<Real>& x, std::vector<Real>& out);
// The same for x = 0, in place.
void relax_from_zero(const Parallel& parallel, const PressureLevel& level, const std::vector<CellBox>& boxes,
                     const std::vector<Real>& b, Real weight, std::vector<Real>& x);
void copy_in_boxes(const Parallel& parallel, const Grid& g, const std::vector<CellBox>& boxes,
                   const std::vector<Real>& from, std::vector<Real>& to);

// Diagonal of A -> inverse_diagonal.
void compute_pressure_diagonal(const Parallel& parallel, PressureLevel& level);

// flux[padded cell] = J v - h^3 source [m^3/s]; source: wanted div v [1/s], may be empty.
void compute_flux(const Parallel& parallel, const Grid& g, const VectorField& velocity, const std::vector<Real>& source,
                  std::vector<Real>& flux);

// v -= W J^T q, q [Pa s].
void subtract_pressure_gradient(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& q,
                                VectorField& velocity);

// (J^T q) at one node, walls not applied [kg m/s].
Vec3 pressure_impulse(const Grid& g, const std::vector<Real>& q, int i, int j, int k);

}  // namespace efsi::system
