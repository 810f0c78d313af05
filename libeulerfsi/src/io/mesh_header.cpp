// Purpose: headers of mesh files that would lead their readers astray, found before a reader sees them.
#include "io/mesh_header.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "base/error.hpp"

namespace efsi::io {

namespace {

constexpr std::size_t kLongestHeader = 1 << 20;  // bytes

// The beginning of the file, with every kind of line end as '\n'.
std::istringstream beginning_of(const std::string& path) {
  std::string text(kLongestHeader, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  std::replace(text.begin(), text.end(), '\r', '\n');
  return std::istringstream(text);
}

void refuse(const std::string& path, const std::string& announced, std::uintmax_t bytes) {
  throw Error(ErrorCode::kMesh,
              path + ": announces " + announced + ", more than its " + std::to_string(bytes) + " bytes can hold");
}

bool is_control(char c) { return std::iscntrl(static_cast<unsigned char>(c)) && c != '\t'; }

// Every property of every element takes one byte at least, as text or as a number. A header without an end would keep
// assimp's reader at it for ever, or make it crash; so would one whose end is not followed by a blank of its kind.
void check_ply(const std::string& path, std::uintmax_t bytes) {
  std::istringstream text = beginning_of(path);
  std::string line, word, announced;
  if (!std::getline(text, line)) return;
  for (char& c : line) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (!line.starts_with("ply")) return;  // assimp reads on behind these letters, whatever follows
  double count = 0.0, least = 0.0;
  while (word != "end_header" && std::getline(text, line)) {
    if (std::any_of(line.begin(), line.end(), is_control))
      throw Error(ErrorCode::kMesh, path + ": its header has a control character");
    std::istringstream words(line);
    if (!(words >> word)) continue;
    if (word == "property") least += count;
    if (word != "element") continue;
    std::string name, number;
    words >> name >> number;
    count = std::max(0.0, std::strtod(number.c_str(), nullptr));
    announced += (announced.empty() ? "" : ", ") + name + " " + number;
  }
  if (word != "end_header") throw Error(ErrorCode::kMesh, path + ": its header has no line end_header");
  if (least > static_cast<double>(bytes)) refuse(path, announced, bytes);
}

// [ST][C][N][4][n]OFF, for n the number of coordinates, then the numbers of vertices, faces and edges, for assimp's
// reader also right behind it. A vertex takes at least a digit for each of three coordinates and what parts them, a
// face its number of corners.
void check_off(const std::string& path, std::uintmax_t bytes) {
  constexpr double kVertexBytes = 6.0, kFaceBytes = 2.0;
  std::istringstream text = beginning_of(path);
  std::string line, header, first, coordinates, vertices, faces;
  while (std::getline(text, line)) header += line.substr(0, line.find('#')) + '\n';
  std::istringstream(header) >> first;
  const std::size_t name = first.find("OFF");
  if (name != std::string::npos) header.erase(0, header.find("OFF") + 3);
  std::istringstream words(header);
  if (name != std::string::npos && name > 0 && first[name - 1] == 'n') words >> coordinates;
  words >> vertices >> faces;
  const double least =
      kVertexBytes * std::strtod(vertices.c_str(), nullptr) + kFaceBytes * std::strtod(faces.c_str(), nullptr);
  // The last line needs no end.
  if (least > static_cast<double>(bytes) + 1.0) refuse(path, vertices + " vertices and " + faces + " faces", bytes);
}

}  // namespace

void check_header(const std::string& path, const std::string& suffix) {
  const std::uintmax_t bytes = std::filesystem::file_size(path);
  if (suffix == "ply") check_ply(path, bytes);
  if (suffix == "off") check_off(path, bytes);
}

}  // namespace efsi::io
