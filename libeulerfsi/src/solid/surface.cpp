#include "solid/surface.hpp"

#include <Eigen/Dense>
#include <algorithm>

#include "grid/interpolate.hpp"
#include "solid/surface_mend.hpp"

namespace efsi::solid {
namespace {

constexpr int kNewtonIterations = 8;
constexpr double kNewtonTolerance = 1e-4;  // cells
constexpr double kHeld = 0.1;              // cells of material: a place with more left does not hold the vertex
constexpr double kTrustedVolume = 0.2;     // relative difference between the surface's volume and the solid's

Vec3 to_grid(const Grid& g, const Vec3d& x) { return ((x - g.origin) / g.h).cast<Real>(); }

// The lowest node of the cell that x lies in, or of the nearest one, and where in the cell x lies.
std::size_t lower_node(const Grid& g, const Vec3d& x, double f[3]) {
  const Vec3d p = (x - g.origin) / g.h;
  int lower[3];
  for (int a = 0; a < 3; ++a) {
    const int n = g.cells[static_cast<std::size_t>(a)];
    const double q = std::clamp(p[a], 0.0, static_cast<double>(n));
    lower[a] = std::min(static_cast<int>(q), n - 1);
    f[a] = p[a] - lower[a];  // extrapolates linearly beyond the band
  }
  return g.node(lower[0], lower[1], lower[2]);
}

// Trilinear value and gradient of u in double precision; false where a corner holds no data.
bool sample_displacement(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& x, Vec3d& u,
                         Mat3d& gradient) {
  const Grid& g = state.band.grid;
  double f[3];
  const std::size_t base = lower_node(g, x, f);
  u.setZero();
  gradient.setZero();
  for (std::size_t a = 0; a < 8; ++a) {
    if (!state.valid[base + corner[a]]) return false;
    double w[3], s[3];
    for (int i = 0; i < 3; ++i) {
      w[i] = grid::kCorner[a][i] ? f[i] : 1.0 - f[i];
      s[i] = grid::kCorner[a][i] ? 1.0 : -1.0;
    }
    const Vec3d value = state.u.at(base + corner[a]).cast<double>();
    u += w[0] * w[1] * w[2] * value;
    gradient += value * Vec3d(s[0] * w[1] * w[2], w[0] * s[1] * w[2], w[0] * w[1] * s[2]).transpose() / g.h;
  }
  return true;
}

// Whether no node around x has its data from the solid's own.
bool is_made_up(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& x) {
  double f[3];
  const std::size_t base = lower_node(state.band.grid, x, f);
  for (const std::size_t c : corner)
    if (state.valid[base + c] == kKnown || state.valid[base + c] == kEdge) return false;
  return true;
}

// Newton's method for x - u(x) = X from x on, which becomes the best x on the way; returns what is left there [m].
double correct_point(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& material,
                     Vec3d& best_x) {
  const double h = state.band.grid.h;
  Vec3d x = best_x;
  double best = std::numeric_limits<double>::infinity();
  for (int it = 0; it < kNewtonIterations; ++it) {
    Vec3d u;
    Mat3d gradient;
    if (!sample_displacement(state, corner, x, u, gradient)) break;
    const Vec3d error = x - u - material;
    const double size = error.norm();
    if (size < best) {
      best = size;
      best_x = x;
    }
    if (size < kNewtonTolerance * h) break;
    const Mat3d inverse_f = Mat3d::Identity() - gradient;
    Vec3d move = error;
    if (inverse_f.determinant() > 0.05) move = inverse_f.inverse() * error;
    const double length = move.norm();
    if (length > h) move *= h / length;
    x -= move;
  }
  return best;
}

}  // namespace

double volume_ratio(const SolidRest& rest, const SolidState& state) {
  const double at_rest = geometry::signed_volume(rest.surface);
  return std::abs(at_rest) > 0.0 ? geometry::signed_volume(state.surface, rest.surface.triangles) / at_rest : 0.0;
}

bool encloses(const SolidRest& rest) {
  return std::abs(std::abs(geometry::signed_volume(rest.surface)) / rest.volume - 1.0) < kTrustedVolume;
}

std::uint64_t count_false_edges(const SolidRest& rest, const SolidState& state, double max_stretch) {
  const double rounding = 1e-3 * state.band.grid.h;  // of edges without a length
  std::vector<std::array<std::int32_t, 2>> found;
  for (const geometry::Triangle& t : rest.surface.triangles)
    for (std::size_t side = 0; side < 3; ++side) {
      const std::int32_t a = t[side], b = t[(side + 1) % 3];
      const double at_rest = (rest.surface.points[b] - rest.surface.points[a]).norm();
      const double now = (state.surface[b] - state.surface[a]).norm();
      if (now > kFalseStretch * max_stretch * at_rest + rounding) found.push_back({std::min(a, b), std::max(a, b)});
    }
  std::sort(found.begin(), found.end());
  return static_cast<std::uint64_t>(std::unique(found.begin(), found.end()) - found.begin());
}

void measure_leak(const SolidRest& rest, const SolidWork& work, SolidState& state) {
  state.leak = work.next_volume > 0.0 ? work.next_volume - volume_ratio(rest, state) : 0.0;
}

bool is_whole(const Grid& global, const grid::Walls& walls, const SolidState& state) {
  if (!walls.any_open()) return true;
  const Vec3d top = global.node_position(global.cells[0], global.cells[1], global.cells[2]);
  for (const Vec3d& x : state.surface)
    for (int a = 0; a < 3; ++a)
      if ((walls.lower(a) == grid::Wall::kOpen && x[a] < global.origin[a]) ||
          (walls.upper(a) == grid::Wall::kOpen && x[a] > top[a]))
        return false;
  return true;
}

void place_surface(const Parallel& parallel, const SolidRest& rest, SolidState& state) {
  const auto corner = grid::corner_offsets(state.band.grid);
  parallel.for_each(static_cast<std::int64_t>(state.surface.size()), [&](std::int64_t i) {
    const auto s = static_cast<std::size_t>(i);
    correct_point(state, corner, rest.surface.points[s], state.surface[s]);
  });
}

void correct_surface(const Parallel& parallel, const SolidRest& rest, double max_stretch, SolidState& state) {
  const auto corner = grid::corner_offsets(state.band.grid);
  const double h = state.band.grid.h;
  std::vector<std::uint8_t> lost(state.surface.size(), 0), made_up(state.surface.size(), 0);
  parallel.for_each(static_cast<std::int64_t>(state.surface.size()), [&](std::int64_t i) {
    const auto s = static_cast<std::size_t>(i);
    lost[s] = !(correct_point(state, corner, rest.surface.points[s], state.surface[s]) < kHeld * h);
    made_up[s] = is_made_up(state, corner, state.surface[s]);
  });
  mend_surface(parallel, rest, max_stretch, made_up, lost, state);
}

void sample_surface_velocity(const Parallel& parallel, const SolidState& state, std::vector<Vec3d>& velocity) {
  velocity.resize(state.surface.size());
  const grid::NodeSampler sampler(state.band.grid);
  parallel.for_each(static_cast<std::int64_t>(state.surface.size()), [&](std::int64_t i) {
    const auto s = static_cast<std::size_t>(i);
    velocity[s] = sampler.vector(state.v, to_grid(state.band.grid, state.surface[s])).cast<double>();
  });
}

}  // namespace efsi::solid
