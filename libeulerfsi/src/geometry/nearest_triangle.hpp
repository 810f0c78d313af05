// Purpose: the triangle of a mesh that is nearest to a point, by a tree of boxes.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/triangle_mesh.hpp"

namespace efsi::geometry {

// The point of a triangle that is nearest to x.
Vec3d closest_point(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& x);

// The same point by the weights of the corners, each >= 0, with sum 1.
Vec3d closest_weights(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& x);

class NearestTriangle {
 public:
  NearestTriangle() = default;  // of a mesh without triangles
  explicit NearestTriangle(const TriangleMesh& mesh);

  struct Found {
    std::int32_t triangle = -1;  // index in the mesh; of several at the same distance the first; -1: there is none
    double distance = 0.0;       // [m]
    std::int32_t leaf = -1;      // where the tree has the triangle
  };
  // guess: a leaf that may be near; what is found does not depend on it, how long that takes does. -1: none.
  Found find(const Vec3d& x, std::int32_t guess = -1) const;
  std::size_t bytes() const { return boxes_.capacity() * sizeof(Box) + leaves_.capacity() * sizeof(Leaf); }

 private:
  struct Box {
    Vec3d min, max;
    std::int32_t begin, end;  // leaves
    std::int32_t right;       // second child, the first follows its parent; 0: it has none
  };
  struct Leaf {
    std::array<Vec3d, 3> corner;
    Vec3d middle;   // of the corners
    Vec3d normal;   // unit; zero without an area
    double radius;  // around the middle, a little more than to the corners
    std::int32_t triangle;
  };
  void build(std::int32_t begin, std::int32_t end);

  std::vector<Box> boxes_;
  std::vector<Leaf> leaves_;
};

}  // namespace efsi::geometry
