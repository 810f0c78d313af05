// Purpose: an .obj file in the one form that assimp reads without mistakes, its objects under names that it can tell
// apart.
#pragma once

#include <string>
#include <vector>

namespace efsi::io {

// A line `o NAME` begins an object, also where its name has come before; the groups in it, `g NAME`, are left out.
// Where a file has no such line its groups are its objects. assimp itself cuts a name at its first space, gives faces
// to the wrong object where a name comes again, and begins an object with every group. Lines without a use
// for a mesh are left out: behind elements that are lines of one point assimp writes behind its points. Throws
// Error(kMesh) naming the path where there are no points. Returns points, faces and objects, these by number in place
// of name, "o 0", "o 1", ...; names: theirs, by number.
std::string plain_obj(const std::string& path, std::vector<std::string>& names);

}  // namespace efsi::io
