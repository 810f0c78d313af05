#include "solve/carried_pressure.hpp"

#include <algorithm>
#include <cmath>

#include "frame/grid_loops.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "system/divergence.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr Real kCarried = Real(0.5);
constexpr int kFadeCells = 8;  // over which it grows beside the bands of solids and open faces

// What of the pressure is carried along a row of cells: 0 in the boxes, 1 from kFadeCells on.
class Fade {
 public:
  Fade(const Grid& g, const grid::Walls& walls, const SolidStates& states) {
    for (const solid::SolidState& state : states) {
      const Vec3i lo = grid::offset(state.band.grid, g), size = state.band.grid.cells;
      boxes_.push_back({lo, {lo[0] + size[0], lo[1] + size[1], lo[2] + size[2]}});
    }
    for (std::size_t a = 0; a < 3; ++a) {  // and their images
      const std::size_t count = g.periodic[a] ? boxes_.size() : 0;
      for (std::size_t b = 0; b < count; ++b)
        for (const int shift : {-g.cells[a], g.cells[a]}) {
          Box image = boxes_[b];
          image.lo[a] += shift, image.hi[a] += shift;
          boxes_.push_back(image);
        }
    }
    for (std::size_t face = 0; face < 6; ++face) {
      if (walls.face[face] != grid::Wall::kOpen) continue;
      constexpr int kFar = 1 << 20;
      Box plane{{-kFar, -kFar, -kFar}, {kFar, kFar, kFar}};
      (face % 2 ? plane.lo : plane.hi)[face / 2] = face % 2 ? g.cells[face / 2] : 0;
      boxes_.push_back(plane);
    }
  }
  // False: all of the row is carried.
  bool begin_row(int j, int k) {
    near_.clear();
    for (const Box& box : boxes_) {
      const int apart = std::max(distance(box.lo[1], box.hi[1], j), distance(box.lo[2], box.hi[2], k));
      if (apart < kFadeCells) near_.push_back({box.lo[0], box.hi[0], apart});
    }
    return !near_.empty();
  }
  Real at(int i) const {
    int cells = kFadeCells;
    for (const auto& [low, high, apart] : near_) cells = std::min(cells, std::max(apart, distance(low, high, i)));
    const Real x = static_cast<Real>(cells) / kFadeCells;
    return x * x * (3 - 2 * x);
  }

 private:
  struct Box {
    Vec3i lo, hi;  // nodes
  };
  struct Span {
    int low, high, apart;
  };
  // Cells from cell i to the nodes low to high.
  static int distance(int low, int high, int i) { return std::max({0, low - 1 - i, i - high}); }
  std::vector<Box> boxes_;
  std::vector<Span> near_;
};

// Calls body(cell, part) for the cells of which not all is carried.
template <class Body>
void for_faded(const Grid& g, const Fade& all, int k, const Body& body) {
  Fade fade = all;
  for (int j = 0; j < g.cells[1]; ++j) {
    if (!fade.begin_row(j, k)) continue;
    for (int i = 0; i < g.cells[0]; ++i)
      if (const Real part = fade.at(i); part < 1) body(g.padded(i, j, k), part);
  }
}

// The mean of q where part of it is carried: only differences of a pressure count, and those across the fade are to be
// small. Nothing beside open faces, where the pressure is zero.
Real level_of(const Parallel& parallel, const CommonGrid& common, const Fade& fade, const std::vector<Real>& q) {
  if (common.walls.any_open()) return 0;
  const auto sum_of = [&](const auto& value) {
    return parallel.sum(common.grid.cells[2], [&](std::int64_t k) {
      double sum = 0.0;
      for_faded(common.grid, fade, static_cast<int>(k), [&](std::size_t c, Real part) {
        if (part > 0) sum += value(c);
      });
      return sum;
    });
  };
  const double count = sum_of([](std::size_t) { return 1.0; });
  return count > 0.0 ? static_cast<Real>(sum_of([&](std::size_t c) { return static_cast<double>(q[c]); }) / count) : 0;
}

}  // namespace

void take_carried_pressure(const Parallel& parallel, const CommonGrid& common, const SolidStates& states,
                           const std::vector<Real>& pressure, std::vector<Real>& carried) {
  linalg::copy(parallel, carried, pressure);
  linalg::scale(parallel, carried, static_cast<double>(kCarried));
  if (states.empty() && !common.walls.any_open()) return;
  const Fade fade(common.grid, common.walls, states);
  const Real level = level_of(parallel, common, fade, carried);
  parallel.for_each(common.grid.cells[2], [&](std::int64_t k) {
    for_faded(common.grid, fade, static_cast<int>(k),
              [&](std::size_t c, Real part) { carried[c] = level + part * (carried[c] - level); });
  });
}

double spread_of(const Parallel& parallel, const Grid& g, std::vector<Real>& pressure) {
  if (pressure.empty()) return 0.0;
  grid::clear_ghosts(g, pressure);
  const double sum = linalg::sum(parallel, pressure), square = linalg::dot(parallel, pressure, pressure);
  return std::sqrt(std::max(0.0, square - sum * sum / static_cast<double>(g.cell_count())));
}

void take_back_carried(const Parallel& parallel, const CommonGrid& common, const SolidStates& states,
                       const std::vector<Real>& pressure, double dt, double density, std::vector<Real>& q,
                       grid::VectorField& velocity) {
  const auto& [g, walls] = common;
  take_carried_pressure(parallel, common, states, pressure, q);
  linalg::scale(parallel, q, dt);
  grid::fill_ghosts(g, q, Real(0));
  const double eighth = density * g.h * g.h * g.h / 8.0;  // mass [kg]
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const unsigned fixed = grid::fixed_components(g, walls, i, j, k);
        const Vec3 change =
            static_cast<Real>(1.0 / (eighth * adjacent_cells(g, i, j, k))) * system::pressure_impulse(g, q, i, j, k);
        for (std::size_t a = 0; a < 3; ++a)
          if (!(fixed & (1u << a))) velocity.c[a][g.node(i, j, k)] -= change[static_cast<Eigen::Index>(a)];
      }
  });
}

}  // namespace efsi::sim
