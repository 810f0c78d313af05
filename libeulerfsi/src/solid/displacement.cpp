#include "solid/displacement.hpp"

#include <algorithm>
#include <array>

#include "grid/extrapolate.hpp"
#include "grid/interpolate.hpp"

namespace efsi::solid {

using grid::NodeSampler;
using grid::Trilinear;

void update_velocity(const Parallel& parallel, const Grid& global, const VectorField& velocity, SolidState& state,
                     SolidWork& work) {
  const Grid& g = state.band.grid;
  const Vec3i& lo = state.band.lo;
  work.layer.assign(g.node_count(), grid::kNoLayer);
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (!work.carries[n]) continue;
        work.layer[n] = 0;
        state.v.set(n, velocity.at(global.node(i + lo[0], j + lo[1], k + lo[2])));
      }
  });
  work.max_speed = parallel.max(g.cells[2] + 1, 0.0, [&](std::int64_t k) {
    Real top = 0;
    for (std::size_t n = static_cast<std::size_t>(k) * g.node_stride(2);
         n < (static_cast<std::size_t>(k) + 1) * g.node_stride(2); ++n)
      if (work.layer[n] == 0) top = std::max(top, state.v.at(n).cwiseAbs().maxCoeff());
    return static_cast<double>(top);
  });
  std::array<Real*, 6> fields;
  for (std::size_t a = 0; a < 3; ++a) {
    fields[a] = state.u.c[a].data();
    fields[3 + a] = state.v.c[a].data();
  }
  grid::extend_linear(parallel, g, kExtensionLayers, work.layer, fields);
}

namespace {

// The value of a field at a position, when all corners around it hold data.
struct Sampler {
  NodeSampler nodes;
  explicit Sampler(const Grid& g) : nodes(g) {}
  bool valid(const Trilinear& t, const std::vector<std::uint8_t>& layer, std::uint8_t limit) const {
    for (std::size_t offset : nodes.corners())
      if (layer[t.base + offset] > limit) return false;
    return true;
  }
};

// Lowest and highest of a field's 8 values around a position.
std::pair<Real, Real> bounds(const NodeSampler& nodes, const Trilinear& t, const std::vector<Real>& field) {
  Real low = field[t.base + nodes.corners()[0]], high = low;
  for (std::size_t offset : nodes.corners()) {
    low = std::min(low, field[t.base + offset]);
    high = std::max(high, field[t.base + offset]);
  }
  return {low, high};
}

}  // namespace

void advect(const Parallel& parallel, AdvectionScheme scheme, double dt, SolidState& state, SolidWork& work) {
  const Grid& g = state.band.grid;
  const Sampler sampler(g);
  const Real step = static_cast<Real>(dt / g.h);
  const Real h = static_cast<Real>(g.h);
  const bool paper = scheme == AdvectionScheme::kPaper;
  Vec3 top;
  for (int a = 0; a < 3; ++a) top[a] = static_cast<Real>(g.cells[static_cast<std::size_t>(a)]);

  const std::size_t count = g.node_count();
  VectorField& first_u = work.scratch_u;
  VectorField& first_v = work.scratch_v;
  first_u.assign(count);
  first_v.assign(count);
  std::vector<std::uint8_t> reached(count, 0);  // first sweep reached data
  const auto clamp = [&](const Vec3& x) -> Vec3 { return x.cwiseMax(Real(0)).cwiseMin(top); };
  const auto trace = [&](const Vec3& x, const Vec3& v, Real s) -> Vec3 {
    return clamp(grid::trace_rk3(sampler.nodes, state.v, x, v, s));
  };

  VectorField moved;  // paper: u + dt v at the nodes (line 19)
  if (paper) {
    moved = state.u;
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t n = 0; n < count; ++n) moved.c[a][n] += static_cast<Real>(dt) * state.v.c[a][n];
  }

  const auto for_nodes = [&](const auto& body) {
    parallel.for_each(g.cells[2] + 1, [&](std::int64_t k) {
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) body(i, j, static_cast<int>(k), g.node(i, j, static_cast<int>(k)));
    });
  };
  const auto position = [](int i, int j, int k) {
    return Vec3(static_cast<Real>(i), static_cast<Real>(j), static_cast<Real>(k));
  };

  // First sweep: f1(x) = f(x_d).
  for_nodes([&](int i, int j, int k, std::size_t n) {
    if (work.layer[n] == grid::kNoLayer) return;
    const Vec3 x = position(i, j, k), v = state.v.at(n);
    Vec3 from;
    if (paper) {
      const Vec3 middle = sampler.nodes.vector(state.v, x - Real(0.5) * step * v);
      from = clamp(x - step * middle);
    } else {
      from = trace(x, v, step);
    }
    const Trilinear t = sampler.nodes.stencil(from);
    if (!sampler.valid(t, work.layer, kExtensionLayers)) return;
    first_u.set(n, sampler.nodes.value(t, paper ? moved : state.u));
    first_v.set(n, sampler.nodes.value(t, state.v));
    reached[n] = 1;
  });
  if (paper) {
    state.u = first_u;
    state.v = first_v;
    state.valid = std::move(reached);
    return;
  }

  // Second sweep, forwards: the error of going there and back, half of it is taken off.
  VectorField u_new = first_u, v_new = first_v;
  for_nodes([&](int i, int j, int k, std::size_t n) {
    if (!reached[n]) return;
    const Vec3 x = position(i, j, k), v = state.v.at(n);
    const Vec3 from = trace(x, v, step), to = trace(x, v, -step);
    const Vec3 travelled = h * (x - from);
    const Trilinear ahead = sampler.nodes.stencil(to);
    bool all = true;
    for (std::size_t offset : sampler.nodes.corners()) all = all && reached[ahead.base + offset];
    if (all) {
      const Vec3 u_back = sampler.nodes.value(ahead, first_u), v_back = sampler.nodes.value(ahead, first_v);
      Vec3 u = first_u.at(n) + Real(0.5) * (state.u.at(n) - u_back);
      Vec3 w = first_v.at(n) + Real(0.5) * (state.v.at(n) - v_back);
      if (work.layer[n] != 0) {  // no new extremes outside the data
        const Trilinear behind = sampler.nodes.stencil(from);
        for (int a = 0; a < 3; ++a) {
          const auto s = static_cast<std::size_t>(a);
          const auto [u_low, u_high] = bounds(sampler.nodes, behind, state.u.c[s]);
          const auto [v_low, v_high] = bounds(sampler.nodes, behind, state.v.c[s]);
          u[a] = std::clamp(u[a], u_low, u_high);
          w[a] = std::clamp(w[a], v_low, v_high);
        }
      }
      u_new.set(n, u + travelled);
      v_new.set(n, w);
    } else {
      u_new.set(n, first_u.at(n) + travelled);
    }
  });
  state.u = std::move(u_new);
  state.v = std::move(v_new);
  state.valid = std::move(reached);
}

void follow_solid(const Grid& global, const SolidRest& rest, SolidState& state) {
  const Grid& g = state.band.grid;
  Vec3i lo = {global.cells[0], global.cells[1], global.cells[2]}, hi = {0, 0, 0};
  bool any = false;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (!state.valid[n]) continue;
        const Vec3d material = g.node_position(i, j, k) - state.u.at(n).cast<double>();
        if (rest.distance.sample(material) > g.h) continue;
        any = true;
        const int index[3] = {i + state.band.lo[0], j + state.band.lo[1], k + state.band.lo[2]};
        for (std::size_t a = 0; a < 3; ++a) {
          lo[a] = std::min(lo[a], index[a]);
          hi[a] = std::max(hi[a], index[a]);
        }
      }
  if (!any) return;
  const Band band = make_band(global, lo, hi);
  if (band.lo != state.band.lo || band.grid.cells != state.band.grid.cells) move_band(state, band);
}

}  // namespace efsi::solid
