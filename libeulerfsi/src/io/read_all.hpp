// Purpose: a file as a string.
#pragma once

#include <string>

namespace efsi::io {

// The bytes of the file; as many as can be read.
std::string read_all(const std::string& path);

}  // namespace efsi::io
