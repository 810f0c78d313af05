// Purpose: a solid as a slab sees it, a layer between two parallel planes in which nothing changes across it: the
// section of its mesh, taken halfway, is its shape (docs/numerics/slabs.md).
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "geometry/mesh_sdf.hpp"

namespace efsi::geometry {

// What lies between two planes normal to an axis.
struct Slab {
  int axis = 2;
  double low = 0.0, high = 0.0;  // [m]
  double middle() const { return 0.5 * (low + high); }
  double thickness() const { return high - low; }
};

// Where a plane cuts a mesh: segments in the two other axes (axis + 1, axis + 2), the solid on the left.
using Point2 = Eigen::Vector2d;
struct Section {
  std::vector<std::array<Point2, 2>> segments;
  double open_ends = 0;  // points at which as many segments do not start as end
};
Section cut(const TriangleMesh& mesh, int axis, double place);

// The surface in a slab: points beyond it are moved onto its faces, a little inside, so that the mesh encloses what the
// solid has there; `along` of the result holds where they were. Distances are those in the plane to the section
// halfway, the same all along the axis; inside is where its winding number is above 1/2. In the report extents, volume
// and thinnest feature are those of the slab.
// Throws Error(kMesh) for a mesh that does not reach through the slab, and for a section that is open or encloses no
// node of the grid.
std::shared_ptr<const Surface> extrude_in_slab(const Surface& surface, const Slab& slab,
                                               const Parallel& parallel = Parallel());

// A distance field in a slab: that halfway, all along the axis.
SignedDistance flattened(const SignedDistance& field, const Slab& slab);

}  // namespace efsi::geometry
