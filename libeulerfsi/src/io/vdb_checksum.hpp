// Purpose: a checksum inside a .vdb file, among its metadata: over all its bytes, those of the checksum taken as '0'.
#pragma once

#include <string>

namespace efsi::io {

inline constexpr const char* kChecksumKey = "eulerfsi_checksum";
inline constexpr const char* kNoChecksum = "0000000000000000";  // what is written in its place at first

// Puts the checksum into the bytes of a file that was written with kNoChecksum. Throws Error(kInternal) where it has no
// place for one.
void put_checksum(std::string& bytes);

// What is wrong with the bytes of a file; empty: nothing.
std::string checksum_fault(const std::string& bytes);

}  // namespace efsi::io
