#include "fluid/forces.hpp"

#include <Eigen/Dense>
#include <algorithm>

namespace efsi::fluid {
namespace {

Vec3d curl(const Grid& g, const VectorField& v, int i, int j, int k) {
  const auto difference = [&](int component, int axis) {
    int low[3] = {i, j, k}, high[3] = {i, j, k};
    low[axis] = std::max(low[axis] - 1, 0);
    high[axis] = std::min(high[axis] + 1, g.cells[static_cast<std::size_t>(axis)]);
    const auto& f = v.c[static_cast<std::size_t>(component)];
    return (static_cast<double>(f[g.node(high[0], high[1], high[2])]) -
            static_cast<double>(f[g.node(low[0], low[1], low[2])])) /
           ((high[axis] - low[axis]) * g.h);
  };
  return {difference(2, 1) - difference(1, 2), difference(0, 2) - difference(2, 0), difference(1, 0) - difference(0, 1)};
}

// f = epsilon h (N x omega), N the direction in which |omega| grows.
void add_confinement(const Parallel& parallel, const Grid& g, double epsilon, double dt,
                     const std::vector<Real>& specific_volume, Real fluid_volume, VectorField& velocity) {
  std::vector<Real> magnitude(g.node_count());
  VectorField vorticity;
  vorticity.assign(g.node_count());
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const Vec3d w = curl(g, velocity, i, j, k);
        vorticity.set(n, w.cast<Real>());
        magnitude[n] = static_cast<Real>(w.norm());
      }
  });
  const auto stride = std::array<std::size_t, 3>{1, g.node_stride(1), g.node_stride(2)};
  parallel.for_each(std::max(0, g.cells[2] - 1), [&](std::int64_t kk) {
    const int k = static_cast<int>(kk) + 1;
    for (int j = 1; j < g.cells[1]; ++j)
      for (int i = 1; i < g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        bool fluid = specific_volume[n] == fluid_volume;
        Vec3d gradient;
        for (int a = 0; a < 3; ++a) {
          const std::size_t s = stride[static_cast<std::size_t>(a)];
          fluid = fluid && specific_volume[n - s] == fluid_volume && specific_volume[n + s] == fluid_volume;
          gradient[a] = static_cast<double>(magnitude[n + s]) - static_cast<double>(magnitude[n - s]);
        }
        const double length = gradient.norm();
        if (!fluid || !(length > 1e-6)) continue;
        const Vec3d force = epsilon * g.h * (gradient / length).cross(vorticity.at(n).cast<double>());
        velocity.set(n, velocity.at(n) + (dt * force).cast<Real>());
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
