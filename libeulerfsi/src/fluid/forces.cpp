#include "fluid/forces.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/kernel.hpp"

namespace efsi::fluid {
namespace {

// Vorticity and its magnitude on a few planes of nodes.
struct VorticityPlane {
  std::vector<Real> x, y, z, magnitude;
  explicit VorticityPlane(std::size_t n) : x(n), y(n), z(n), magnitude(n) {}
};

// A component's rows below and above a row along y and z, and the row itself.
struct Rows {
  const Real *row, *y_low, *y_high, *z_low, *z_high;
};

// Curl by central differences, one-sided at the walls; scale: 1/2h, twice that at a wall.
EFSI_KERNEL void vorticity_row(int n, Real scale, Real scale_y, Real scale_z, const Rows& u, const Rows& v,
                               const Rows& w, Real* x, Real* y, Real* z, Real* magnitude) {
  const auto at = [&](int i, int low, int high, Real scale_x) {
    x[i] = scale_y * (w.y_high[i] - w.y_low[i]) - scale_z * (v.z_high[i] - v.z_low[i]);
    y[i] = scale_z * (u.z_high[i] - u.z_low[i]) - scale_x * (w.row[high] - w.row[low]);
    z[i] = scale_x * (v.row[high] - v.row[low]) - scale_y * (u.y_high[i] - u.y_low[i]);
  };
  at(0, 0, 1, 2 * scale);
  at(n - 1, n - 2, n - 1, 2 * scale);
#pragma omp simd
  for (int i = 1; i < n - 1; ++i) {
    x[i] = scale_y * (w.y_high[i] - w.y_low[i]) - scale_z * (v.z_high[i] - v.z_low[i]);
    y[i] = scale_z * (u.z_high[i] - u.z_low[i]) - scale * (w.row[i + 1] - w.row[i - 1]);
    z[i] = scale * (v.row[i + 1] - v.row[i - 1]) - scale_y * (u.y_high[i] - u.y_low[i]);
  }
#pragma omp simd
  for (int i = 0; i < n; ++i) magnitude[i] = std::sqrt(x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
}

void vorticity_plane(const Grid& g, const VectorField& velocity, int k, VorticityPlane& plane) {
  const Real scale = static_cast<Real>(0.5 / g.h);
  const int top_y = g.cells[1], top_z = g.cells[2];
  for (int j = 0; j <= top_y; ++j) {
    const auto rows = [&](std::size_t a) {
      const auto row = [&](int jj, int kk) { return velocity.c[a].data() + g.node(0, jj, kk); };
      return Rows{row(j, k), row(std::max(0, j - 1), k), row(std::min(top_y, j + 1), k), row(j, std::max(0, k - 1)),
                  row(j, std::min(top_z, k + 1))};
    };
    const std::size_t r = g.node(0, j, 0);
    vorticity_row(g.cells[0] + 1, scale, j == 0 || j == top_y ? 2 * scale : scale,
                  k == 0 || k == top_z ? 2 * scale : scale, rows(0), rows(1), rows(2), plane.x.data() + r,
                  plane.y.data() + r, plane.z.data() + r, plane.magnitude.data() + r);
  }
}

// v += kick (N x omega) at interior nodes of a row, N the direction in which |omega| grows; only where the node and its
// 6 neighbours are all fluid. m: magnitude, s: specific volume, w: vorticity.
EFSI_KERNEL void confine_row(int n, Real kick, Real fluid_volume, const Rows& m, const Rows& s, const Real* w_x,
                             const Real* w_y, const Real* w_z, Real* v_x, Real* v_y, Real* v_z) {
#pragma omp simd
  for (int i = 1; i < n - 1; ++i) {
    const Real gx = m.row[i + 1] - m.row[i - 1], gy = m.y_high[i] - m.y_low[i], gz = m.z_high[i] - m.z_low[i];
    const Real length = std::sqrt(gx * gx + gy * gy + gz * gz);
    const bool fluid = (s.row[i] == fluid_volume) & (s.row[i - 1] == fluid_volume) & (s.row[i + 1] == fluid_volume) &
                       (s.y_low[i] == fluid_volume) & (s.y_high[i] == fluid_volume) & (s.z_low[i] == fluid_volume) &
                       (s.z_high[i] == fluid_volume);
    const bool acts = fluid & (length > Real(1e-6));
    const Real factor = kick / (acts ? length : Real(1));
    const Real f_x = factor * (gy * w_z[i] - gz * w_y[i]), f_y = factor * (gz * w_x[i] - gx * w_z[i]),
               f_z = factor * (gx * w_y[i] - gy * w_x[i]);
    v_x[i] += acts ? f_x : Real(0);
    v_y[i] += acts ? f_y : Real(0);
    v_z[i] += acts ? f_z : Real(0);
  }
}

// out = in + confinement f = epsilon h (N x omega). The vorticity lives on three planes that pass through the
// grid.
void add_confinement(const Parallel& parallel, const Grid& g, double epsilon, double dt,
                     const std::vector<Real>& specific_volume, Real fluid_volume, const VectorField& in,
                     VectorField& out) {
  const Real kick = static_cast<Real>(epsilon * g.h * dt);
  const std::size_t row = g.node_stride(1), plane = g.node_stride(2);
  const int count = g.cells[0] + 1;
  parallel.for_ranges(g.cells[2] + 1, [&](std::int64_t begin, std::int64_t end) {
    std::array<VorticityPlane, 3> window{VorticityPlane(plane), VorticityPlane(plane), VorticityPlane(plane)};
    const auto vorticity = [&](int k) -> VorticityPlane& { return window[static_cast<std::size_t>(k % 3)]; };
    const int first = static_cast<int>(begin), last = static_cast<int>(end) - 1;
    for (int k = std::max(0, first - 1); k <= first; ++k) vorticity_plane(g, in, k, vorticity(k));
    for (int k = first; k <= last; ++k) {
      if (k < g.cells[2]) vorticity_plane(g, in, k + 1, vorticity(k + 1));
      for (int j = 0; j <= g.cells[1]; ++j) {
        const std::size_t n = g.node(0, j, k), r = g.node(0, j, 0);
        const Real* s = specific_volume.data() + n;
        for (std::size_t a = 0; a < 3; ++a) std::copy_n(in.c[a].data() + n, count, out.c[a].data() + n);
        const auto on_face = [&](int index, std::size_t axis) {
          return g.cells[axis] > 1 && (index == 0 || index == g.cells[axis]);
        };
        if (on_face(j, 1) || on_face(k, 2)) continue;
        // In a slab the row itself stands for what lies beyond.
        const std::size_t y_low = j > 0 ? row : 0, y_high = j < g.cells[1] ? row : 0, z_low = k > 0 ? plane : 0,
                          z_high = k < g.cells[2] ? plane : 0;
        const VorticityPlane& here = vorticity(k);
        const Real* m = here.magnitude.data() + r;
        confine_row(count, kick, fluid_volume,
                    {m, m - y_low, m + y_high, vorticity(std::max(k - 1, 0)).magnitude.data() + r,
                     vorticity(std::min(k + 1, g.cells[2])).magnitude.data() + r},
                    {s, s - y_low, s + y_high, s - z_low, s + z_high}, here.x.data() + r, here.y.data() + r,
                    here.z.data() + r, out.c[0].data() + n, out.c[1].data() + n, out.c[2].data() + n);
      }
    }
  });
}

// out += factor times the mean of the 8 cells around each node of a row; rows: the 4 rows of n cells around it.
EFSI_KERNEL void add_mean_of_cells(int n, const Real* const* rows, Real factor, Real* out) {
  const Real *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3];
  const Real part = factor / 8;
  const auto sum = [&](int i) EFSI_INLINE_LAMBDA { return (a[i] + b[i]) + (c[i] + d[i]); };
  out[0] += 2 * part * sum(0);
#pragma omp simd
  for (int i = 1; i < n; ++i) out[i] += part * (sum(i - 1) + sum(i));
  out[n] += 2 * part * sum(n - 1);
}

// v += lift in fluid, along a row of nodes.
EFSI_KERNEL void lift_row(int nodes, const Real* lift, Real share, const Real* specific_volume, Real fluid_volume,
                          Real* v) {
#pragma omp simd
  for (int i = 0; i < nodes; ++i) v[i] += specific_volume[i] == fluid_volume ? share * lift[i] : Real(0);
}

// Boussinesq: smoke weighs, heat lifts. Beyond the faces the cells are like those inside.
void add_buoyancy(const Parallel& parallel, const Grid& g, const FluidParams& params, const FluidState& state,
                  const Vec3d& kick, const std::vector<Real>& specific_volume, Real fluid_volume,
                  VectorField& velocity) {
  const std::pair<const std::vector<Real>*, Real> causes[2] = {
      {&state.smoke, static_cast<Real>(params.smoke_buoyancy)},
      {&state.temperature, static_cast<Real>(-params.temperature_buoyancy)}};
  const int n = g.cells[0];
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    std::vector<Real> lift(static_cast<std::size_t>(n + 1));
    for (int j = 0; j <= g.cells[1]; ++j) {
      std::fill(lift.begin(), lift.end(), Real(0));
      for (const auto& [cells, factor] : causes) {
        if (factor == 0 || cells->empty()) continue;
        const Real* rows[4];
        for (int r = 0; r < 4; ++r)
          rows[r] = cells->data() +
                    g.cell(0, std::clamp(j - (r & 1), 0, g.cells[1] - 1), std::clamp(k - (r >> 1), 0, g.cells[2] - 1));
        add_mean_of_cells(n, rows, factor, lift.data());
      }
      const std::size_t row = g.node(0, j, k);
      for (std::size_t a = 0; a < 3; ++a)
        if (const Real share = static_cast<Real>(kick[static_cast<Eigen::Index>(a)]); share != 0)
          lift_row(n + 1, lift.data(), share, specific_volume.data() + row, fluid_volume, velocity.c[a].data() + row);
    }
  });
}

}  // namespace

std::uint64_t add_body_forces(const Parallel& parallel, const Grid& g, const FluidParams& params, FluidState& state,
                              const Vec3d& gravity, double dt, const std::vector<Real>& specific_volume,
                              VectorField& velocity) {
  std::uint64_t visited = 0;
  if (!params.present) return visited;
  const Real fluid_volume = static_cast<Real>(1.0 / params.density);
  if (params.vorticity_confinement > 0.0) {
    for (auto& component : state.velocity.c) component.resize(g.node_count());
    add_confinement(parallel, g, params.vorticity_confinement, dt, specific_volume, fluid_volume, velocity,
                    state.velocity);
    std::swap(velocity.c, state.velocity.c);
    visited += g.node_count();
  }
  const bool by_smoke = params.smoke_buoyancy != 0.0 && !state.smoke.empty();
  const bool by_heat = params.temperature_buoyancy != 0.0 && !state.temperature.empty();
  if ((by_smoke || by_heat) && gravity.norm() > 0.0) {
    add_buoyancy(parallel, g, params, state, dt * gravity.normalized(), specific_volume, fluid_volume, velocity);
    visited += g.node_count();
  }
  return visited;
}

}  // namespace efsi::fluid
