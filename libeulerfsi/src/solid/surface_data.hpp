// Purpose: what a solid keeps of its surface beside the mesh: points at which it may fold onto itself
// (solid/surface/fold_points.hpp) and clusters of its vertices (solid/surface/surface_clusters.hpp).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::solid {

// A point of the surface at rest.
struct FoldPoint {
  std::int32_t triangle;
  float second, third;        // weights of the triangle's last two corners
  float place[3], normal[3];  // at rest [m]; out of the solid
  std::uint32_t bends;        // 1: so far from its corners that the map has to say where it is

  Vec3d at_rest() const { return {place[0], place[1], place[2]}; }
};

// Where fold points are [m], and the normals of their triangles; those that have no area: 0.
struct FoldPlaces {
  std::vector<Vec3d> place;
  std::vector<Eigen::Vector3f> normal;
};

// Two fold points, one < other.
struct NearPair {
  std::int32_t one, other;
  float distance, at_rest;  // now and at rest [m]
};

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

}  // namespace efsi::solid
