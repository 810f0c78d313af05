// Purpose: the distance from every node of a grid to a triangle mesh, without a sign.
#pragma once

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"

namespace efsi::geometry {

// Fills grid.values with the distance to the mesh [m]: to 0.01 spacings within three spacings of it and to 2 % farther
// away (OpenVDB finds the nearest triangles near the mesh, sweeps carry them through the grid). The bits depend on mesh
// and grid alone.
void distance_to_mesh(const TriangleMesh& mesh, SignedDistance& grid, const Parallel& parallel = Parallel(),
                      const Progress& progress = Progress());

}  // namespace efsi::geometry
