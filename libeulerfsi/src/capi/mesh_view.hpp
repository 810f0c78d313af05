// Purpose: the caller's meshes and solids, with their surfaces.
#pragma once

#include <string>

#include "capi/handle.hpp"

namespace efsi::capi {

// Triangles of the caller's mesh. owner: "EfsiSolidDef.mesh" for the messages. What the entries hold is checked by
// triangulate(), the shape of the arrays here.
geometry::TriangleMesh read_view(const EfsiMeshView& view, const std::string& owner);
// A solid with its surface; the definition has been checked.
sim::SolidDesc to_body(const EfsiSolidDef& def);

}  // namespace efsi::capi
