// Purpose: a tree of boxes over triangles that answers winding numbers and rays.
// The winding number w(X) of a surface is its solid angle seen from X over 4 pi: 1 inside a closed surface, 0 outside,
// between in the mouth of an open one. Far triangles act together through the first three terms of the Taylor series of
// the dipole field, near ones exactly (Jacobson et al. 2013, Barill et al. 2018).
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/triangle_mesh.hpp"
#include "geometry/winding_kernel.hpp"

namespace efsi::geometry {

class TriangleTree {
 public:
  static constexpr std::int32_t kLeafSize = 8;

  // leaf_size: triangles that are not divided further; 1 is best for winding_numbers().
  explicit TriangleTree(const TriangleMesh& mesh, std::int32_t leaf_size = kLeafSize);

  // Generalized winding number at X; the sums run in one fixed order.
  double winding_number(const Vec3d& X) const;

  struct Hit {
    double distance;        // along the ray, in units of its direction
    double cosine;          // of the angle between the ray and the normal of the triangle; > 0: the ray leaves
    std::int32_t triangle;  // index in the mesh
  };

  // Winding numbers at points in the cube of edge 2 `half` around `centre`, the same up to 2e-3 and much faster for
  // many points: they share the walk through the tree, and far triangles are interpolated. on_surface[i]: point i lies
  // so close to a triangle that rounding decides on its side.
  void winding_numbers(const Vec3d& centre, double half, const std::vector<Vec3d>& points, std::vector<double>& winding,
                       std::vector<bool>& on_surface) const;

  // How often the segment passes triangles from front to back, less how often the other way: w(to) - w(from) for a
  // closed surface, the part of it that jumps for an open one. Neighbouring triangles
  // agree on which of them a segment through their edge passes. Neither end may lie on the surface.
  int winding_change(const Vec3d& from, const Vec3d& to) const;

  bool empty() const { return nodes_.empty(); }

  // Where the ray origin + t direction, t > 0, meets triangles, sorted by t. direction: unit vector.
  void cast(const Vec3d& origin, const Vec3d& direction, std::vector<Hit>& hits) const;

 private:
  struct Corners {
    Vec3d a, b, c;
    std::int32_t triangle;
  };
  struct Node {
    Vec3d min, max;               // box
    Vec3d centre;                 // area-weighted [m]
    Vec3d area_normal;            // sum of vector areas [m^2]
    Mat3d moment;                 // sum of (triangle centre - centre) vector area^T [m^3]
    CubicForm second_moment;      // see add_second_moment() [m^4]
    double far_distance_squared;  // beyond this the series is used [m^2]
    std::int32_t begin, end;      // triangles
    std::int32_t right;           // second child, the first follows its parent; 0: leaf
  };

  template <class Meets, class Visit>
  void for_corners(const Meets& meets, const Visit& visit) const;
  void build(std::int32_t begin, std::int32_t end);

  struct Targets;
  void add_winding(const Vec3d& centre, double half, const std::vector<std::int32_t>& sources, Targets& targets) const;

  std::int32_t leaf_size_;
  std::vector<Corners> corners_;
  std::vector<Node> nodes_;
};

}  // namespace efsi::geometry
