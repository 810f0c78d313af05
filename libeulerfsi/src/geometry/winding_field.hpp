// Purpose: the winding number of a mesh at the nodes of a grid and at points between them, for all meshes fast.
// Closed by triangles over its holes the mesh has a whole number, which is counted where it passes grid rows and
// segments; the triangles over the holes are few and large, and their part is taken away by the tree over them.
#pragma once

#include <cstdint>
#include <vector>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"
#include "geometry/triangle_tree.hpp"

namespace efsi::geometry {

// A node this close to the surface, in spacings, lies on it: rounding could change its side.
constexpr double kOnSurface = 1e-3;

class WindingField {
 public:
  // mesh: welded; tree: over the same mesh; distance: holds the distance to the mesh (>= 0) at the nodes. All three
  // must live as long as this object. The bits do not depend on the number of threads.
  WindingField(const TriangleMesh& mesh, const TriangleTree& tree, const SignedDistance& distance,
               const Parallel& parallel = Parallel(), const Progress& progress = Progress());

  // No edge of the mesh is open, so that the number changes at the surface only.
  bool balanced() const { return closing_tree_.empty(); }

  // At each node of the grid (its order), to 2e-3; on the surface about half-way between its sides.
  const std::vector<float>& at_nodes() const { return at_nodes_; }

  // At points in the grid that are off the surface, to 2e-3.
  std::vector<float> at(const std::vector<Vec3d>& points, const Parallel& parallel, const Progress& progress) const;

  // By how much the number jumps along a segment, at the triangles that it passes. What is left of the change is that
  // of a smooth function. Neither end may lie on the surface.
  int jump(const Vec3d& from, const Vec3d& to) const { return tree_.winding_change(from, to); }

 private:
  void subtract_closing_at_nodes(const Parallel& parallel, const Progress& progress);
  double closed_number(const Vec3d& X) const;

  const TriangleTree& tree_;
  const SignedDistance& distance_;
  std::vector<Triangle> closing_;
  TriangleTree closed_tree_, closing_tree_;  // the first of a mesh that closing triangles close only
  std::vector<std::int32_t> count_;  // whole numbers of the closed mesh at the nodes; kUnknown on a closing triangle
  std::vector<float> at_nodes_;
};

}  // namespace efsi::geometry
