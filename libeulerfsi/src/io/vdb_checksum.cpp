#include "io/vdb_checksum.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string_view>

#include "base/error.hpp"

namespace efsi::io {

namespace {

constexpr std::size_t kDigits = 16;
constexpr std::size_t kHead = 4096;  // bytes in which the checksum lies; whole words

// Where the digits are: OpenVDB writes a key, the name of the type and the value, the latter two behind their lengths
// as 32-bit numbers. npos: nowhere.
std::size_t place_of_digits(const std::string& bytes) {
  const std::string_view head = std::string_view(bytes).substr(0, kHead);
  const std::size_t key = head.find(kChecksumKey);
  if (key == std::string::npos) return key;
  const std::string type = std::string("\6\0\0\0string\20\0\0\0", 14);
  const std::size_t after = key + std::strlen(kChecksumKey);
  if (bytes.compare(after, type.size(), type) != 0 || head.size() < after + type.size() + kDigits)
    return std::string::npos;
  return after + type.size();
}

std::uint64_t mix(std::uint64_t state, std::string_view bytes) {
  for (std::size_t at = 0; at < bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, std::min<std::size_t>(8, bytes.size() - at));
    state = (state ^ word) * 0xff51afd7ed558ccdull;
    state ^= state >> 32;
  }
  return state;
}

std::string digits_of(const std::string& bytes, std::size_t place) {
  std::string head = bytes.substr(0, kHead);
  head.replace(place, kDigits, kNoChecksum);
  const std::uint64_t state = mix(mix(bytes.size(), head), std::string_view(bytes).substr(head.size()));
  char text[kDigits + 1];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(state));
  return text;
}

}  // namespace

void put_checksum(std::string& bytes) {
  const std::size_t place = place_of_digits(bytes);
  if (place == std::string::npos) throw Error(ErrorCode::kInternal, "VDB: OpenVDB wrote metadata of an unknown form");
  bytes.replace(place, kDigits, digits_of(bytes, place));
}

std::string checksum_fault(const std::string& bytes) {
  const std::size_t place = place_of_digits(bytes);
  if (place == std::string::npos)
    return "it has no checksum of eulerfsi: it is not a .vdb file of this program, of an older version, or damaged";
  if (bytes.compare(place, kDigits, digits_of(bytes, place)) != 0) return "it is damaged or cut short (checksum)";
  return "";
}

}  // namespace efsi::io
