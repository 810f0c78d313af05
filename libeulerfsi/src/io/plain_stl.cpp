// Purpose: an .stl file in the forms that assimp reads without mistakes.
#include "io/plain_stl.hpp"

#include <cstdint>
#include <cstring>

#include "base/error.hpp"
#include "io/read_all.hpp"

namespace efsi::io {

namespace {

constexpr std::size_t kHeader = 80, kFacet = 50;  // bytes

bool is_binary(const std::string& text) {
  std::uint32_t facets = 0;
  if (text.size() < kHeader + sizeof facets) return false;
  std::memcpy(&facets, text.data() + kHeader, sizeof facets);
  return text.size() == kHeader + sizeof facets + kFacet * facets;
}

}  // namespace

std::string plain_stl(const std::string& path) {
  std::string text = read_all(path);
  if (is_binary(text)) return text.replace(0, kHeader, kHeader, ' ');
  std::size_t begin = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  begin = text.find_first_not_of(" \t", begin);
  if (begin == text.npos || text.compare(begin, 5, "solid") != 0)
    throw Error(ErrorCode::kMesh, path +
                                      ": not a readable .stl file: it is not an STL file, neither a binary one by its "
                                      "size nor a text that begins with \"solid\"");
  return text.erase(0, begin);
}

}  // namespace efsi::io
