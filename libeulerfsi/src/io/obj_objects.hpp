// Purpose: the objects of an .obj file, under names that assimp can tell apart.
#pragma once

#include <string>
#include <vector>

namespace efsi::io {

struct NumberedObj {
  std::string text;                // points, faces and objects, by number in place of name: "o 0", "o 1", ...
  std::vector<std::string> names;  // of the objects, by number
};

// A line `o NAME` begins an object, also where its name has come before; the groups in it, `g NAME`, are left out.
// Where a file has no such line its groups are its objects. assimp itself cuts a name at its first space, gives faces
// to the wrong object where a name comes again, and begins an object with every group. Lines without a use
// for a mesh are left out: behind elements that are lines of one point assimp writes behind its points. Throws
// Error(kMesh) naming the path where there are no points.
NumberedObj number_objects(const std::string& path);

}  // namespace efsi::io
