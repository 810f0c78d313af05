// Purpose: the objects of an .obj file, under names that assimp can tell apart.
#include "io/obj_objects.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string_view>

namespace efsi::io {

namespace {

constexpr const char* kBlank = " \t\v\f";

std::string read_all(const std::string& path) {
  std::string text(std::filesystem::file_size(path), '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

// Of a line without its end: whether it is `KEY` or `KEY NAME`.
bool begins(std::string_view line, char key) {
  return !line.empty() && line[0] == key && (line.size() == 1 || line[1] == ' ' || line[1] == '\t');
}

std::string name_in(std::string_view line) {
  const std::size_t first = line.find_first_not_of(kBlank, 1);
  return first == line.npos ? "" : std::string(line.substr(first, line.find_last_not_of(kBlank) + 1 - first));
}

// Calls line(begin, end) for each line, its end of one character or two not within it.
template <class Line>
void for_each_line(std::string_view text, const Line& line) {
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find_first_of("\r\n", begin), text.size());
    line(begin, end);
    begin = end + 1;
  }
}

}  // namespace

NumberedObj number_objects(const std::string& path) {
  const std::string text = read_all(path);
  const std::string_view view = text;
  bool has_objects = false;
  for_each_line(view, [&](std::size_t begin, std::size_t end) {
    has_objects = has_objects || begins(view.substr(begin, end - begin), 'o');
  });
  NumberedObj numbered;
  numbered.text.reserve(text.size());
  std::size_t copied = 0;
  for_each_line(view, [&](std::size_t begin, std::size_t end) {
    const std::string_view line = view.substr(begin, end - begin);
    const bool object = begins(line, has_objects ? 'o' : 'g');
    if (!object && !begins(line, 'g')) return;
    numbered.text += view.substr(copied, begin - copied);
    copied = end;
    if (!object) return;
    numbered.text += "o " + std::to_string(numbered.names.size());
    numbered.names.push_back(name_in(line));
  });
  numbered.text += view.substr(copied);
  return numbered;
}

}  // namespace efsi::io
