#include "solid/element/repair.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "solid/element/mass.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/hexahedron.hpp"
#include "solid/map/displacement.hpp"

namespace efsi::solid {
namespace {

constexpr int kMapSweeps = 10, kVelocitySweeps = 10;
constexpr Real kInside = Real(1) - Real(1e-6);  // of a cell

// det: det F over that of the solid.
bool is_broken(double det) { return !(det <= kMostGrowth && det * kMostGrowth >= 1.0); }

// det F of the solid as a whole.
double mean_det(const SolidRest& rest, const SolidWork& work) { return rest.density * work.volume / work.total_mass; }

// The map of a cell that has the axes of inverse_f, and accepted stretches and volume. Of what has
// yielded it is the elastic part.
Mat3d sound_inverse(const Mat3d& inverse_f, double mean) {
  const Eigen::JacobiSVD<Mat3d> svd(inverse_f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3d u = svd.matrixU();
  Vec3d stretch = svd.singularValues();
  if (u.determinant() * svd.matrixV().determinant() < 0.0) {  // inverted: along the axis of the least stretch
    u.col(2) *= -1.0;
    stretch[2] *= -1.0;
  }
  for (int a = 0; a < 3; ++a) stretch[a] = kSurfaceStretch.clamp(stretch[a]);
  const double det = stretch.prod(), sound = std::clamp(mean * det, 1.0 / kRepairedGrowth, kRepairedGrowth) / mean;
  stretch *= std::cbrt(sound / det);
  return u * stretch.asDiagonal() * svd.matrixV().transpose();
}

// Moves the corners of broken cells to where the maps of their broken cells, repaired, have them on average. Adds
// these cells and their corners to the sets; false: there are none.
bool repair_cells(const SolidRest& rest, SolidState& state, const SolidWork& work, std::set<std::size_t>& cells,
                  std::set<std::size_t>& nodes) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const double mean = mean_det(rest, work);
  const PlasticField plastic(rest, state);
  struct Move {
    Vec3d sum = Vec3d::Zero();
    int cells = 0;
  };
  std::map<std::size_t, Move> moves;  // of nodes, in their order
  for (std::size_t e = 0; e < work.element_cell.size(); ++e) {
    const auto c = static_cast<std::size_t>(work.element_cell[e]);
    const auto n = static_cast<std::size_t>(work.element_corner[e]);
    if (work.fraction[c] < kInside || !is_broken(static_cast<double>(work.volume_ratio[c]) / mean)) continue;
    cells.insert(c);
    Vec3d u[8];
    for (std::size_t a = 0; a < 8; ++a) u[a] = state.u.at(n + corner[a]).cast<double>();
    const Mat3d inverse_f = Mat3d::Identity() - displacement_gradient(u, center_gradients(), g.h);
    const Mat3d yielded = plastic.stretch(material_in_cell(state, g.node_place(n)));
    const Mat3d change = yielded.inverse() * sound_inverse(yielded * inverse_f, mean) - inverse_f;
    for (std::size_t a = 0; a < 8; ++a) {
      const Vec3d x(grid::kCorner[a][0] - 0.5, grid::kCorner[a][1] - 0.5, grid::kCorner[a][2] - 0.5);
      Move& move = moves[n + corner[a]];
      move.sum -= g.h * (change * x);
      ++move.cells;
    }
  }
  for (const auto& [n, move] : moves) {
    nodes.insert(n);
    state.u.set(n, state.u.at(n) + Vec3((move.sum / move.cells).cast<Real>()));
  }
  return !moves.empty();
}

// Calls visit(n, weight) for the node and its neighbours, weights (1, 2, 1)^3.
template <class Visit>
void visit_neighbours(const Grid& g, std::size_t node, const Visit& visit) {
  const auto [i, j, k] = g.node_place(node);
  for (int c = std::max(k - 1, 0); c <= std::min(k + 1, g.cells[2]); ++c)
    for (int b = std::max(j - 1, 0); b <= std::min(j + 1, g.cells[1]); ++b)
      for (int a = std::max(i - 1, 0); a <= std::min(i + 1, g.cells[0]); ++a)
        visit(g.node(a, b, c), (a == i ? 2 : 1) * (b == j ? 2 : 1) * (c == k ? 2 : 1));
}

// The velocities of these nodes and of those beside them become means by mass: both sides of a fold have stuck
// together.
void smooth_velocity(const std::set<std::size_t>& nodes, SolidState& state, const SolidWork& work) {
  const Grid& g = state.band.grid;
  std::set<std::size_t> near;
  for (const std::size_t n : nodes)
    visit_neighbours(g, n, [&](std::size_t m, int) {
      if (work.carries[m]) near.insert(m);
    });
  const std::vector<std::size_t> list(near.begin(), near.end());
  std::vector<Vec3> smooth(list.size());
  for (int sweep = 0; sweep < kVelocitySweeps; ++sweep) {
    for (std::size_t l = 0; l < list.size(); ++l) {
      Vec3d sum = Vec3d::Zero();
      double mass = 0.0;
      visit_neighbours(g, list[l], [&](std::size_t m, int weight) {
        if (!work.carries[m]) return;
        const double share = weight * static_cast<double>(work.mass[m]);
        sum += share * state.v.at(m).cast<double>();
        mass += share;
      });
      smooth[l] = mass > 0.0 ? Vec3((sum / mass).cast<Real>()) : state.v.at(list[l]);
    }
    for (std::size_t l = 0; l < list.size(); ++l) state.v.set(list[l], smooth[l]);
    if (state.change.size() > 0)
      for (const std::size_t n : list) state.change.set(n, Vec3::Zero());
  }
}

}  // namespace

MapQuality inspect_map(const SolidRest& rest, const SolidWork& work) {
  MapQuality quality;
  bool any = false;
  for (const std::int32_t cell : work.element_cell) {
    const auto c = static_cast<std::size_t>(cell);
    if (work.fraction[c] < kInside) continue;
    const double det = static_cast<double>(work.volume_ratio[c]);
    quality.min_det_f = any ? std::min(quality.min_det_f, det) : det;
    quality.max_det_f = any ? std::max(quality.max_det_f, det) : det;
    quality.broken += !rest.compressible && is_broken(det / mean_det(rest, work));
    any = true;
  }
  return quality;
}

std::uint64_t repair_map(const Parallel& parallel, const SolidRest& rest, SolidState& state, SolidWork& work) {
  if (rest.compressible || work.element_cell.empty()) return 0;
  std::set<std::size_t> cells, nodes;
  int sweeps = 0;
  for (; sweeps < kMapSweeps && repair_cells(rest, state, work, cells, nodes); ++sweeps)
    compute_mass(parallel, rest, state, work);
  if (sweeps == 0) return 0;
  smooth_velocity(nodes, state, work);
  return cells.size();
}

}  // namespace efsi::solid
