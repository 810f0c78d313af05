// Purpose: an .obj file in the one form that assimp reads without mistakes.
#include "io/plain_obj.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>

#include "base/error.hpp"
#include "io/read_all.hpp"

namespace efsi::io {

namespace {

constexpr const char* kBlank = " \t\v\f";

// Of a line without its end: whether it is `KEY` or `KEY NAME`.
bool begins(std::string_view line, char key) {
  return !line.empty() && line[0] == key && (line.size() == 1 || line[1] == ' ' || line[1] == '\t');
}

std::string name_in(std::string_view line) {
  const std::size_t first = line.find_first_not_of(kBlank, 1);
  return first == line.npos ? "" : std::string(line.substr(first, line.find_last_not_of(kBlank) + 1 - first));
}

// Whether assimp is given it: points, faces, and the sections of curves, whose lines it leaves out.
bool makes_mesh(std::string_view line) { return begins(line, 'v') || (!line.empty() && std::strchr("fce", line[0])); }

// Calls use(line) for each line without its end; a backslash before an end joins two lines.
template <class Use>
void for_each_line(std::string_view text, const Use& use) {
  constexpr std::string_view kEnds("\n\r\f\0", 4);
  std::string joined;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find_first_of(kEnds, begin), text.size());
    std::string_view line = text.substr(begin, end - begin);
    begin = end + (text.substr(end, 2) == "\r\n" ? 2 : 1);
    const bool goes_on = line.ends_with('\\');
    if (goes_on || !joined.empty()) joined += line.substr(0, line.find_last_not_of('\\') + 1);
    if (goes_on && begin < text.size()) continue;
    use(joined.empty() ? line : joined);
    joined.clear();
  }
}

}  // namespace

std::string plain_obj(const std::string& path, std::vector<std::string>& names) {
  const std::string text = read_all(path);
  bool has_objects = false;
  for_each_line(text, [&](std::string_view line) { has_objects = has_objects || begins(line, 'o'); });
  names.clear();
  std::string plain;
  plain.reserve(text.size());
  bool has_points = false;
  for_each_line(text, [&](std::string_view line) {
    if (begins(line, has_objects ? 'o' : 'g')) {
      plain += "o " + std::to_string(names.size()) + "\n";
      names.push_back(name_in(line));
    } else if (makes_mesh(line)) {
      plain.append(line) += '\n';
      has_points = has_points || line[0] == 'v';
    }
  });
  if (!has_points) throw Error(ErrorCode::kMesh, path + ": not a readable .obj file: it contains no mesh");
  return plain;
}

}  // namespace efsi::io
