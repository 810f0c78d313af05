#include "solid/surface/surface.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "grid/interpolate.hpp"
#include "solid/map/credible.hpp"
#include "solid/map/inverse_map.hpp"
#include "solid/surface/surface_mend.hpp"

namespace efsi::solid {
namespace {

constexpr double kInWall = 1.0;         // cells: deeper in a wall the map says nothing; bound of the overlap in contact
constexpr double kTrustedVolume = 0.2;  // relative difference between the surface's volume and the solid's

Vec3 to_grid(const Grid& g, const Vec3d& x) { return ((x - g.origin) / g.h).cast<Real>(); }

// Whether no node around x has its data from the solid's own.
bool is_made_up(const SolidState& state, const std::array<std::size_t, 8>& corner, const Vec3d& x) {
  double f[3];
  const std::size_t base = lower_node(state.band.grid, x, f);
  for (const std::size_t c : corner)
    if (state.valid[base + c] == kKnown || state.valid[base + c] == kEdge) return false;
  return true;
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

Eigen::AlignedBox3d map_reach(const Grid& global, const grid::Walls& walls) {
  const Vec3d top = global.node_position(global.cells[0], global.cells[1], global.cells[2]);
  const double everywhere = std::numeric_limits<double>::infinity();
  Eigen::AlignedBox3d reach(Vec3d::Constant(-everywhere), Vec3d::Constant(everywhere));
  for (int a = 0; a < 3; ++a) {
    if (a == grid::slab_axis(global, walls)) continue;
    if (grid::Walls::blocks(walls.lower(a))) reach.min()[a] = global.origin[a] - kInWall * global.h;
    if (grid::Walls::blocks(walls.upper(a))) reach.max()[a] = top[a] + kInWall * global.h;
  }
  return reach;
}

void correct_surface(const Parallel& parallel, const Eigen::AlignedBox3d& reach, const SolidRest& rest,
                     double max_stretch, SolidState& state) {
  const auto corner = grid::corner_offsets(state.band.grid);
  const double h = state.band.grid.h;
  std::vector<std::uint8_t> lost(state.surface.size(), 0), extrapolated(state.surface.size(), 0);
  parallel.for_each(static_cast<std::int64_t>(state.surface.size()), [&](std::int64_t i) {
    const auto s = static_cast<std::size_t>(i);
    const double residual = correct_point(state, corner, rest.surface.points[s], state.surface[s]);
    lost[s] = !(residual < kHeldResidual * h && reach.contains(state.surface[s]));
    extrapolated[s] = is_made_up(state, corner, state.surface[s]);
  });
  repair_surface(parallel, rest, max_stretch, extrapolated, lost, state);
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
