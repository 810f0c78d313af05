// Purpose: the embedded surface at rest in clusters of about a cell's size, and which of them are neighbours in the
// material: what knows, without any map, which points travel together.
#pragma once

#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"
#include "solid/surface_data.hpp"

namespace efsi::solid {

// spacing: length of the boxes' edges [m]
SurfaceClusters make_surface_clusters(const geometry::TriangleMesh& surface, const geometry::SignedDistance& distance,
                                      double spacing);

}  // namespace efsi::solid
