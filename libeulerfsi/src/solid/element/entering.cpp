#include "solid/element/entering.hpp"

#include <Eigen/Dense>
#include <map>

#include "solid/element/beside.hpp"
#include "solid/element/mass.hpp"
#include "solid/hexahedron.hpp"
#include "solid/map/credible.hpp"
#include "solid/map/displacement.hpp"

namespace efsi::solid {
namespace {

using grid::Grid;

// u around the middle of a cell, and how many of its corners are known.
struct CellField {
  Vec3d middle = Vec3d::Zero();
  Mat3d gradient = Mat3d::Zero();
  int known = 0;
  Mat3d inverse_f() const { return Mat3d::Identity() - gradient; }
};

CellField field_of(const SolidState& state, const Vec3i& cell) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const std::size_t n = g.node(cell[0], cell[1], cell[2]);
  CellField field;
  Vec3d u[8];
  for (std::size_t a = 0; a < 8; ++a) {
    u[a] = state.u.at(n + corner[a]).cast<double>();
    field.middle += 0.125 * u[a];
    field.known += state.valid[n + corner[a]] == kKnown;
  }
  field.gradient = displacement_gradient(u, center_gradients(), g.h);
  return field;
}

// What the elements that differ from a cell by one along so many axes, and are better known, extend to it on average;
// known: of all of them, 0 where there are none.
CellField extend_from(const SolidState& state, const SolidWork& work, const Vec3i& cell, int better_than, int axes) {
  const Grid& g = state.band.grid;
  CellField mean;
  visit_beside(g, work, cell, axes, [&](std::size_t, const Vec3i& place) {
    const CellField field = field_of(state, place);
    if (field.known <= better_than) return;
    const Vec3d apart(cell[0] - place[0], cell[1] - place[1], cell[2] - place[2]);
    mean.middle += field.known * (field.middle + g.h * (field.gradient * apart));
    mean.gradient += field.known * field.gradient;
    mean.known += field.known;
  });
  if (mean.known == 0) return mean;
  mean.middle /= mean.known;
  mean.gradient /= mean.known;
  return mean;
}

CellField extend_to(const SolidState& state, const SolidWork& work, const Vec3i& cell, int better_than) {
  CellField beside;
  for (int axes = 1; axes <= 3 && beside.known == 0; ++axes) beside = extend_from(state, work, cell, better_than, axes);
  return beside;
}

// Whether one map is strained against another within the bounds.
bool agree(const Mat3d& inverse_f, const Mat3d& other, const StretchBounds& bounds) {
  const Eigen::JacobiSVD<Mat3d> svd(inverse_f * other.inverse());
  const Vec3d& parts = svd.singularValues();  // the largest first; inverses of stretches
  return parts[0] * bounds.least < 1.0 && parts[2] * bounds.most > 1.0;
}

}  // namespace

bool settle_entering(const Parallel& parallel, const SolidRest& rest, SolidState& state, SolidWork& work) {
  if (!rest.stiff_by_part || state.stiff.empty()) return false;
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  struct Mean {
    Vec3d sum = Vec3d::Zero();
    int cells = 0;
  };
  std::map<std::size_t, Mean> moved;  // u of nodes, in their order
  for (std::size_t e = 0; e < work.element_cell.size(); ++e) {
    if (state.stiff[static_cast<std::size_t>(work.element_cell[e])] & kCarried) continue;
    const auto n = static_cast<std::size_t>(work.element_corner[e]);
    const Vec3i cell = g.node_place(n);
    const CellField own = field_of(state, cell);
    if (own.known == 8) continue;
    const CellField beside = extend_to(state, work, cell, own.known);
    if (beside.known == 0 || !(beside.inverse_f().determinant() > 0.0)) continue;
    if (agree(own.inverse_f(), beside.inverse_f(), kEnteringStretch)) continue;
    for (std::size_t a = 0; a < 8; ++a) {
      if (state.valid[n + corner[a]] == kKnown) continue;
      const Vec3d x(grid::kCorner[a][0] - 0.5, grid::kCorner[a][1] - 0.5, grid::kCorner[a][2] - 0.5);
      Mean& mean = moved[n + corner[a]];
      mean.sum += beside.middle + g.h * (beside.gradient * x);
      ++mean.cells;
    }
  }
  for (const auto& [n, mean] : moved) state.u.set(n, Vec3((mean.sum / mean.cells).cast<Real>()));
  if (!moved.empty()) compute_mass(parallel, rest, state, work);
  return !moved.empty();
}

}  // namespace efsi::solid
