// Purpose: lists of a .ply file that announce more entries than there are, found before assimp allocates for them.
#pragma once

#include <string>

namespace efsi::io {

// Throws Error(kMesh) naming path, element and its number where a list announces more entries than its line (ascii) or
// the rest of the file (binary) holds, or no number of entries at all, or where a property has no known type. Other
// errors of the file are its reader's to refuse.
void check_ply_lists(const std::string& path);

}  // namespace efsi::io
