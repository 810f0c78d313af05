// Purpose: for tests of the surface: a U of two legs whose surface has a point at every corner of its cubes.
#pragma once

#include <algorithm>
#include <array>
#include <map>

#include "solid/surface/surface_clusters.hpp"
#include "unit/solid/ball.hpp"

namespace efsi::test {

// Of cubes of edge `size`: legs of 4 x 4 cubes in x and y and 27 high in z, `gap` cubes apart in x, the lowest 4
// joined.
struct Hairpin {
  double size = 0.02;
  int gap = 12;
  Vec3i low = {5, 8, 3};  // its first cube

  bool holds(int i, int j, int k) const {
    i -= low[0];
    j -= low[1];
    k -= low[2];
    if (std::min({i, j, k}) < 0 || i >= 8 + gap || j >= 4 || k >= 27) return false;
    return k < 4 || i < 4 || i >= 4 + gap;
  }

  geometry::TriangleMesh surface() const {
    geometry::TriangleMesh mesh;
    std::map<Vec3i, std::int32_t> numbers;
    const auto point = [&](const Vec3i& p) {
      const auto [at, added] = numbers.emplace(p, static_cast<std::int32_t>(mesh.points.size()));
      if (added) mesh.points.push_back(size * Vec3d(p[0], p[1], p[2]));
      return at->second;
    };
    const auto add_face = [&](const Vec3i& cube, std::size_t axis, int side) {
      Vec3i corner = cube;
      corner[axis] += side;
      std::array<std::int32_t, 4> around;
      for (std::size_t n = 0; n < 4; ++n) {
        Vec3i p = corner;
        p[(axis + 1) % 3] += n == 1 || n == 2;
        p[(axis + 2) % 3] += n >= 2;
        around[side ? n : 3 - n] = point(p);
      }
      mesh.triangles.push_back({around[0], around[1], around[2]});
      mesh.triangles.push_back({around[0], around[2], around[3]});
    };
    for (int k = low[2]; k < low[2] + 27; ++k)
      for (int j = low[1]; j < low[1] + 4; ++j)
        for (int i = low[0]; i < low[0] + 8 + gap; ++i)
          for (std::size_t axis = 0; axis < 3; ++axis)
            for (const int side : {0, 1}) {
              Vec3i beside = {i, j, k};
              beside[axis] += side ? 1 : -1;
              if (holds(i, j, k) && !holds(beside[0], beside[1], beside[2])) add_face({i, j, k}, axis, side);
            }
    return mesh;
  }

  double phi(const Vec3d& x) const {
    const auto box = [&](int from_x, int to_x, int to_z) {
      const Vec3d from = size * Vec3d(low[0] + from_x, low[1], low[2]);
      const Vec3d to = size * Vec3d(low[0] + to_x, low[1] + 4, low[2] + to_z);
      return (from - x).cwiseMax(x - to).maxCoeff();
    };
    return std::min({box(0, 4, 27), box(4 + gap, 8 + gap, 27), box(0, 8 + gap, 4)});
  }

  TestSolid make() const {
    TestSolid s = make_solid(
        cube_grid(34, size), {},
        sample_distance(Vec3d::Zero(), Vec3d::Constant(34 * size), 0.5 * size, [&](const Vec3d& x) { return phi(x); }));
    s.rest.surface = surface();
    s.rest.clusters = solid::make_surface_clusters(s.rest.surface, s.rest.distance, size);
    s.state.surface = s.rest.surface.points;
    return s;
  }
};

}  // namespace efsi::test
