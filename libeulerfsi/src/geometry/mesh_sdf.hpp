// Purpose: from a triangle mesh to the signed distance field of the closed solid that it stands for.
#pragma once

#include <memory>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"

namespace efsi::geometry {

inline constexpr double kDefaultMargin = 4.0;  // grid around the extents, in spacings

// Signed distance to the solid that `mesh` bounds, on a grid over its extents plus `margin` spacings on every side.
// Inside is where the generalized winding number is above 1/2, so that open, self-crossing and multi-part meshes become
// one closed solid; distances (OpenVDB) are those to the boundary of that solid, caps over the holes included, to 0.01
// spacings within three spacings of it and to 2 % farther away, 4 % where surfaces cross or holes are. Triangles that
// are inside out are turned. `report` is filled in whole. The result depends on the arguments alone, not on the number
// of threads.
//
// Throws Error(kArgument) for a spacing that is not positive, Error(kMesh) for a mesh that encloses no node of the
// grid, Error(kMemory) for a grid that does not fit, Error(kCancelled) where `progress` stops it.
SignedDistance build_signed_distance(const TriangleMesh& mesh, double spacing, MeshReport& report,
                                     const Parallel& parallel = Parallel(), const Progress& progress = Progress(),
                                     double margin = kDefaultMargin);

// A mesh and the solid that it bounds.
struct Surface {
  TriangleMesh mesh;  // as passed, with inverted triangles reversed
  SignedDistance distance;
  MeshReport report;
  std::vector<double> along;  // of a slab's surface: where the points of the mesh were along its axis [m]
};

// build_signed_distance() with the default margin.
std::shared_ptr<const Surface> examine(TriangleMesh mesh, double spacing, const Parallel& parallel = Parallel(),
                                       const Progress& progress = Progress());

// The same solid and report, less its thinnest feature and separate pieces, for a mesh that moves in every step:
// distances are exact within three spacings of the solid's boundary, farther away linear between nodes two to eight
// spacings apart (geometry/distance_by_levels.hpp).
std::shared_ptr<const Surface> examine_moved(TriangleMesh mesh, double spacing, const Parallel& parallel = Parallel());

}  // namespace efsi::geometry
