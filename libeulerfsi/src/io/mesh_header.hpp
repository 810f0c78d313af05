// Purpose: headers of mesh files that would lead their readers astray, found before a reader sees them.
#pragma once

#include <string>

namespace efsi::io {

// Throws Error(kMesh) naming path and reason where the header of a .ply or .off file announces more than the file can
// hold at its size, or where that of a .ply file has no end. suffix: "ply", "off"; others have no such header and pass.
// A header of unknown form passes: it is the reader's to refuse.
void check_header(const std::string& path, const std::string& suffix);

}  // namespace efsi::io
