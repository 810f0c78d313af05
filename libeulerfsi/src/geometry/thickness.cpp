// Purpose: the smallest thickness of a solid, measured by rays from its surface to the opposite one.
#include "geometry/thickness.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "geometry/solid_boundary.hpp"

namespace efsi::geometry {

namespace {

// Length of one of the kRays rays, 0: it finds no opposite surface. area_up_to: of the triangles, summed up [m^2].
double ray_length(const TriangleMesh& mesh, const TriangleTree& tree, const std::vector<double>& area_up_to,
                  double step, int ray) {
  // Triangles in equal shares of the area, the place in a triangle from Roberts' R2 sequence.
  const auto at = std::upper_bound(area_up_to.begin(), area_up_to.end(), area_up_to.back() * (ray + 0.5) / kRays);
  if (at == area_up_to.end()) return 0.0;
  double u = std::fmod(0.7548776662466927 * (ray + 1), 1.0), v = std::fmod(0.5698402909980532 * (ray + 1), 1.0);
  if (u + v > 1.0) {
    u = 1.0 - u;
    v = 1.0 - v;
  }
  const Triangle& t = mesh.triangles[at - area_up_to.begin()];
  const Vec3d &a = mesh.points[t[0]], e1 = mesh.points[t[1]] - a, e2 = mesh.points[t[2]] - a;
  const Vec3d normal = e1.cross(e2).normalized(), start = a + u * e1 + v * e2;
  const double inside = tree.winding_number(start - step * normal);
  if (!(inside > kInsideWinding) || tree.winding_number(start + step * normal) > kInsideWinding) return 0.0;
  std::vector<TriangleTree::Hit> hits;
  tree.cast(start, -normal, hits);
  int layers = std::max(1, static_cast<int>(std::lround(inside)));
  for (const TriangleTree::Hit& hit : hits) {
    if (hit.distance <= step) continue;
    layers += hit.cosine > 0.0 ? -1 : 1;
    if (layers <= 0) return hit.cosine > kFacingCosine ? hit.distance : 0.0;
  }
  return 0.0;
}

}  // namespace

double thinnest_feature(const TriangleMesh& mesh, const TriangleTree& tree, const Parallel& parallel,
                        const Progress& progress) {
  if (mesh.triangles.empty()) return 0.0;
  std::vector<double> area_up_to;
  double area = 0.0;
  for (const Triangle& t : mesh.triangles) {
    area += triangle_area(mesh, t);
    area_up_to.push_back(area);
  }
  const Extents box = extents(mesh);
  const double step = 1e-6 * (box.max - box.min).norm();
  std::vector<double> lengths(kRays, 0.0);
  progress.for_each(parallel, kRays, [&](std::int64_t ray) {
    lengths[ray] = ray_length(mesh, tree, area_up_to, step, static_cast<int>(ray));
  });
  std::erase(lengths, 0.0);
  if (lengths.empty()) return 0.0;
  const auto chosen = lengths.begin() + static_cast<std::ptrdiff_t>(kPercentile * static_cast<double>(lengths.size()));
  std::nth_element(lengths.begin(), chosen, lengths.end());
  return *chosen;
}

}  // namespace efsi::geometry
