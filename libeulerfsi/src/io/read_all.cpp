// Purpose: a file as a string.
#include "io/read_all.hpp"

#include <filesystem>
#include <fstream>

namespace efsi::io {

std::string read_all(const std::string& path) {
  std::string text(std::filesystem::file_size(path), '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

}  // namespace efsi::io
