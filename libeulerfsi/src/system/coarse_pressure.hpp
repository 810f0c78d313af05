// Purpose: the pressure operator of the coarse levels of multigrid: fluxes through faces, seven points.
// J W J^T of the finest level hardly sees what alternates along two axes. On a coarse grid the same operator would
// amplify such corrections several times over; -div (1/density) grad by faces treats smooth ones alike and never
// overshoots (docs/lab/pressure.md).
#pragma once

#include <array>

#include "system/divergence.hpp"

namespace efsi::system {

// (A x)_c = sum over faces of `face` (x_c - x_neighbour), x = 0 beyond an open wall and where there is no equation.
struct CoarsePressureLevel : PressureGrid {
  // h / density of a cell's lower face along each axis, 0 at closed walls [m^4/kg]; padded cells, so that the upper
  // face is the neighbour's.
  std::array<std::vector<Real>, 3> face;
};

// Sets the faces and the diagonal; grid, walls and active stand already.
void build_coarse_pressure(const Parallel& parallel, const std::vector<Real>& specific_volume,
                           CoarsePressureLevel& level);
// r = b - A x where the level has equations, 0 elsewhere. Ghosts of x must be filled.
void coarse_residual(const Parallel& parallel, const CoarsePressureLevel& level, const std::vector<Real>& b,
                     const std::vector<Real>& x, std::vector<Real>& r);
// y = x + weight D^-1 (b - A x), one Jacobi step. Ghosts of x must be filled.
void smooth_coarse(const Parallel& parallel, const CoarsePressureLevel& level, const std::vector<Real>& b, Real weight,
                   const std::vector<Real>& x, std::vector<Real>& y);

}  // namespace efsi::system
