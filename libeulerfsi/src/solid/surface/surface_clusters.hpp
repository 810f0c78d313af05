// Purpose: the embedded surface at rest in clusters of about a cell's size, and which of them are neighbours in the
// material: what knows, without any map, which points travel together.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"

namespace efsi::solid {

// Constant. Points of a cluster lie in one box of the rest shape and are connected by edges in it. Clusters are linked
// where an edge of less than three boxes leads from one to the other, and, in boxes that touch, where the solid lies
// between them: the two sides of a thin part are, two parts with a gap between them are not.
struct SurfaceClusters {
  std::vector<std::int32_t> of_point;          // point -> cluster
  std::vector<std::int32_t> first, points;     // the points of cluster c: points[first[c]] .. points[first[c + 1]]
  std::vector<std::int32_t> first_link, link;  // the clusters linked to c, in the same way
  std::vector<Vec3d> center;                   // mean of its points at rest [m]

  std::size_t size() const { return center.size(); }
};

// spacing: length of the boxes' edges [m]
SurfaceClusters make_surface_clusters(const geometry::TriangleMesh& surface, const geometry::SignedDistance& distance,
                                      double spacing);

}  // namespace efsi::solid
