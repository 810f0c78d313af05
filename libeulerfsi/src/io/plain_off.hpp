// Purpose: an .off file in the one form that assimp reads without mistakes.
#pragma once

#include <string>

namespace efsi::io {

// The file with its points and faces alone: without comments, normals, colours, texture coordinates and faces of fewer
// than three corners, its lines in their places. assimp writes behind a buffer for lines of more than 4095 characters
// and behind its faces where lines of others follow, leaves out faces of more than nine corners, and takes the last
// point for one that there is not. Throws Error(kMesh) naming path, vertex or face and reason where the file is too
// short, a line too long, or a number none.
std::string plain_off(const std::string& path);

}  // namespace efsi::io
