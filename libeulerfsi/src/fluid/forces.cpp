#include "fluid/forces.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace efsi::fluid {
namespace {

// Curl at a node by central differences, one-sided at the walls, times 2h inside.
Vec3 curl(const Grid& g, const VectorField& v, int i, int j, int k, std::size_t n) {
  const std::size_t stride[3] = {1, g.node_stride(1), g.node_stride(2)};
  const int index[3] = {i, j, k};
  std::size_t low[3], high[3];
  Real scale[3];
  for (std::size_t a = 0; a < 3; ++a) {
    const bool first = index[a] == 0, last = index[a] == g.cells[a];
    low[a] = first ? n : n - stride[a];
    high[a] = last ? n : n + stride[a];
    scale[a] = first || last ? Real(2) : Real(1);
  }
  const auto d = [&](std::size_t component, std::size_t axis) {
    const Real* f = v.c[component].data();
    return scale[axis] * (f[high[axis]] - f[low[axis]]);
  };
  return {d(2, 1) - d(1, 2), d(0, 2) - d(2, 0), d(1, 0) - d(0, 1)};
}

// f = epsilon h (N x omega), N the direction in which |omega| grows.
void add_confinement(const Parallel& parallel, const Grid& g, double epsilon, double dt,
                     const std::vector<Real>& specific_volume, Real fluid_volume, VectorField& velocity) {
  std::vector<Real> magnitude(g.node_count());
  VectorField vorticity;
  vorticity.assign(g.node_count());
  const Real inverse = static_cast<Real>(0.5 / g.h);
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const Vec3 w = inverse * curl(g, velocity, i, j, k, n);
        vorticity.set(n, w);
        magnitude[n] = w.norm();
      }
  });
  const std::size_t stride[3] = {1, g.node_stride(1), g.node_stride(2)};
  const Real kick = static_cast<Real>(epsilon * g.h * dt);
  parallel.for_each(std::max(0, g.cells[2] - 1), [&](std::int64_t kk) {
    const int k = static_cast<int>(kk) + 1;
    for (int j = 1; j < g.cells[1]; ++j)
      for (int i = 1; i < g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        bool fluid = specific_volume[n] == fluid_volume;
        Vec3 gradient;
        for (int a = 0; a < 3; ++a) {
          const std::size_t s = stride[a];
          fluid = fluid && specific_volume[n - s] == fluid_volume && specific_volume[n + s] == fluid_volume;
          gradient[a] = magnitude[n + s] - magnitude[n - s];
        }
        const Real length = gradient.norm();
        if (!fluid || !(length > Real(1e-6))) continue;
        velocity.set(n, velocity.at(n) + (kick / length) * gradient.cross(vorticity.at(n)));
      }
  });
}

Real mean_of_cells(const Grid& g, const std::vector<Real>& cells, int i, int j, int k) {
  Real sum = 0;
  for (const auto& corner : grid::kCorner) {
    const int ci = std::clamp(i - corner[0], 0, g.cells[0] - 1), cj = std::clamp(j - corner[1], 0, g.cells[1] - 1),
              ck = std::clamp(k - corner[2], 0, g.cells[2] - 1);
    sum += cells[g.cell(ci, cj, ck)];
  }
  return sum / 8;
}

}  // namespace

std::uint64_t add_body_forces(const Parallel& parallel, const Grid& g, const FluidParams& params,
                              const FluidState& state, const Vec3d& gravity, double dt,
                              const std::vector<Real>& specific_volume, VectorField& velocity) {
  std::uint64_t visited = 0;
  const Real fluid_volume = static_cast<Real>(1.0 / params.density);
  if (params.vorticity_confinement > 0.0) {
    add_confinement(parallel, g, params.vorticity_confinement, dt, specific_volume, fluid_volume, velocity);
    visited += g.node_count();
  }
  const bool by_smoke = params.smoke_buoyancy != 0.0 && !state.smoke.empty();
  const bool by_heat = params.temperature_buoyancy != 0.0 && !state.temperature.empty();
  if ((by_smoke || by_heat) && gravity.norm() > 0.0) {
    const Vec3d down = gravity.normalized();
    parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
      const int k = static_cast<int>(kk);
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) {
          const std::size_t n = g.node(i, j, k);
          if (specific_volume[n] != fluid_volume) continue;
          double a = 0.0;
          if (by_smoke) a += params.smoke_buoyancy * static_cast<double>(mean_of_cells(g, state.smoke, i, j, k));
          if (by_heat)
            a -= params.temperature_buoyancy * static_cast<double>(mean_of_cells(g, state.temperature, i, j, k));
          if (a != 0.0) velocity.set(n, velocity.at(n) + (dt * a * down).cast<Real>());
        }
    });
    visited += g.node_count();
  }
  return visited;
}

void apply_emitters(const Parallel& parallel, const Grid& g, const std::vector<Emitter>& emitters, double time,
                    FluidState& state, VectorField& velocity) {
  for (const Emitter& emitter : emitters) {
    const bool on = emitter.mode == Emitter::Mode::kInitial
                        ? time == 0.0
                        : time >= emitter.start_time - 1e-9 && time < emitter.end_time - 1e-9;
    if (!on) continue;
    parallel.for_each(g.cells[2], [&](std::int64_t kk) {
      const int k = static_cast<int>(kk);
      for (int j = 0; j < g.cells[1]; ++j)
        for (int i = 0; i < g.cells[0]; ++i) {
          if (!emitter.contains(g.cell_center(i, j, k))) continue;
          const std::size_t c = g.cell(i, j, k);
          if (!state.smoke.empty()) state.smoke[c] = static_cast<Real>(emitter.density);
          if (!state.temperature.empty()) state.temperature[c] = static_cast<Real>(emitter.temperature);
        }
    });
    if (!emitter.has_velocity) continue;
    parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
      const int k = static_cast<int>(kk);
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i)
          if (emitter.contains(g.node_position(i, j, k))) velocity.set(g.node(i, j, k), emitter.velocity.cast<Real>());
    });
  }
}

}  // namespace efsi::fluid
