// Purpose: an .stl file in the forms that assimp reads without mistakes.
#pragma once

#include <string>

namespace efsi::io {

// The file with a blank header (binary), or without a mark of UTF-8 and blanks before its first word (text): assimp
// reads behind its buffer where a file begins with the mark of UTF-32. Throws Error(kMesh) naming the path where the
// file is neither binary by its size nor text by its first word.
std::string plain_stl(const std::string& path);

}  // namespace efsi::io
