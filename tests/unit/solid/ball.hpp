// Purpose: solids for tests, from closed forms: a ball, and a block that fills its band.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include "grid/grid.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/material_force.hpp"
#include "solid/solid.hpp"

namespace efsi::test {

struct TestSolid {
  grid::Grid global;
  solid::SolidRest rest;
  solid::SolidState state;
  solid::SolidWork work;
};

inline geometry::SignedDistance sample_distance(const Vec3d& low, const Vec3d& high, double spacing,
                                                const std::function<double(const Vec3d&)>& phi) {
  geometry::SignedDistance d;
  d.spacing = spacing;
  d.origin = low;
  for (std::size_t a = 0; a < 3; ++a)
    d.size[a] = 1 + static_cast<int>(std::ceil((high - low)[static_cast<Eigen::Index>(a)] / spacing));
  d.values.resize(static_cast<std::size_t>(d.size[0]) * static_cast<std::size_t>(d.size[1]) *
                  static_cast<std::size_t>(d.size[2]));
  for (int k = 0; k < d.size[2]; ++k)
    for (int j = 0; j < d.size[1]; ++j)
      for (int i = 0; i < d.size[0]; ++i) d.values[d.index(i, j, k)] = static_cast<float>(phi(d.node(i, j, k)));
  return d;
}

inline grid::Grid cube_grid(int cells, double h) {
  grid::Grid g;
  g.cells = {cells, cells, cells};
  g.h = h;
  return g;
}

// u(x) at every node of the band; all of them hold data.
inline void set_displacement(TestSolid& s, const std::function<Vec3d(const Vec3d&)>& u) {
  const grid::Grid& g = s.state.band.grid;
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        s.state.u.set(g.node(i, j, k), Vec3(u(g.node_position(i, j, k)).cast<Real>()));
  std::fill(s.state.valid.begin(), s.state.valid.end(), std::uint8_t{1});
}

// A solid at rest whose band is the whole grid.
inline TestSolid make_solid(const grid::Grid& g, const material::Elastic& elastic, geometry::SignedDistance distance) {
  TestSolid s;
  s.global = g;
  s.rest.elastic = elastic;
  s.rest.distance = std::move(distance);
  s.rest.volume = s.rest.distance.volume();
  solid::move_band(s.state, solid::make_band(g, {0, 0, 0}, g.cells));
  set_displacement(s, [](const Vec3d&) { return Vec3d::Zero(); });
  return s;
}

inline TestSolid make_ball(const grid::Grid& g, const material::Elastic& elastic, const Vec3d& center, double radius) {
  const Vec3d margin = Vec3d::Constant(radius + 3.0 * g.h);
  return make_solid(g, elastic, sample_distance(center - margin, center + margin, 0.5 * g.h, [&](const Vec3d& x) {
                      return (x - center).norm() - radius;
                    }));
}

// Solid everywhere, whatever the displacement.
inline TestSolid make_block(const grid::Grid& g, const material::Elastic& elastic) {
  return make_solid(g, elastic,
                    sample_distance(Vec3d::Constant(-10), Vec3d::Constant(10), 5.0, [](const Vec3d&) { return -5.0; }));
}

inline void compute(TestSolid& s, int points, int threads = 1) {
  const Parallel parallel(threads);
  solid::compute_mass(parallel, s.rest, s.state, s.work);
  solid::compute_material(parallel, s.rest, s.state, points, s.work);
}

}  // namespace efsi::test
