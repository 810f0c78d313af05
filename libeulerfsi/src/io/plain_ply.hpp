// Purpose: a .ply file in the one form that assimp reads without mistakes.
#pragma once

#include <string>

namespace efsi::io {

// The file with the coordinates of its vertices and the corners of its faces alone, an element per line where it is a
// text. assimp allocates what a list announces, writes behind the first vertices or faces where a header has two kinds
// of them, reads behind the corners of a face with more texture coordinates, repeats the last element where a file ends
// early, and takes a first byte of 10 for the end of the header. Throws Error(kMesh) naming path, element and its
// number where the header is none, has two of a kind or triangle strips, where a line or the file is too short for what
// it announces, or where a number of entries is none.
std::string plain_ply(const std::string& path);

}  // namespace efsi::io
