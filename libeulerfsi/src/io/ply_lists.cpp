// Purpose: lists of a .ply file that announce more entries than there are, found before assimp allocates for them.
#include "io/ply_lists.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string_view>
#include <vector>

#include "base/error.hpp"

namespace efsi::io {

namespace {

struct Type {
  std::size_t bytes = 0;
  bool is_signed = false;
};
const std::map<std::string, Type, std::less<>> kTypes = {
    {"char", {1, true}},  {"int8", {1, true}},    {"uchar", {1, false}},  {"uint8", {1, false}},
    {"short", {2, true}}, {"int16", {2, true}},   {"ushort", {2, false}}, {"uint16", {2, false}},
    {"int", {4, true}},   {"int32", {4, true}},   {"uint", {4, false}},   {"uint32", {4, false}},
    {"float", {4, true}}, {"float32", {4, true}}, {"double", {8, true}},  {"float64", {8, true}},
};

struct Property {
  bool list = false;
  Type count, value;  // count: of a list's number of entries
};

struct Element {
  std::string name;
  double count = 0.0;
  std::vector<Property> properties;
  bool has_list() const {
    return std::any_of(properties.begin(), properties.end(), [](const Property& p) { return p.list; });
  }
};

struct Header {
  std::string format;
  std::vector<Element> elements;
};

class Ply {
 public:
  explicit Ply(const std::string& path) : path_(path) {
    std::ifstream file(path, std::ios::binary);
    text_.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }

  void check() {
    const Header header = read_header();
    const bool ascii = header.format == "ascii";
    const bool little = header.format == "binary_little_endian";
    if (!ascii && !little && header.format != "binary_big_endian") return;
    for (const Element& element : header.elements) {
      for (double i = 0.0; i < element.count && at_ < text_.size(); i += 1.0) {
        ascii ? check_line(element, i) : skip(element, little, i);
      }
    }
  }

 private:
  // The next line without its end, '\n', "\r\n" or '\r'.
  std::string_view next_line() {
    const std::size_t begin = at_, end = std::min(text_.find_first_of("\r\n", begin), text_.size());
    at_ = std::min(end + (text_.compare(end, 2, "\r\n") == 0 ? 2 : 1), text_.size());
    return std::string_view(text_).substr(begin, end - begin);
  }

  Type type_of(const std::string& name, std::string_view line) const {
    const auto found = kTypes.find(name);
    if (found == kTypes.end())
      throw Error(ErrorCode::kMesh, path_ + ": its header has a property without a known type: " + std::string(line));
    return found->second;
  }

  Header read_header() {
    Header header;
    while (at_ < text_.size()) {
      const std::string_view line = next_line();
      std::istringstream words{std::string(line)};
      std::string key, word, number;
      words >> key >> word >> number;
      if (key == "end_header") break;
      if (key == "format") header.format = word;
      if (key == "element") header.elements.push_back({word, std::strtod(number.c_str(), nullptr), {}});
      if (key != "property" || header.elements.empty()) continue;
      Property property;
      property.list = word == "list";
      if (property.list) {
        property.count = type_of(number, line);
        words >> word;
      }
      property.value = type_of(word, line);
      header.elements.back().properties.push_back(property);
    }
    return header;
  }

  // number: of the element among its kind, from 0.
  [[noreturn]] void refuse(const Element& element, double number, const std::string& reason) const {
    throw Error(ErrorCode::kMesh, path_ + ": " + element.name + " " +
                                      std::to_string(static_cast<std::uint64_t>(number) + 1) + ": " + reason);
  }

  // One element of a text, a line that is not blank.
  void check_line(const Element& element, double number) {
    constexpr std::string_view kSpace = " \t\v\f";
    std::string_view line;
    do line = next_line();
    while (line.find_first_not_of(kSpace) == std::string_view::npos && at_ < text_.size());
    if (!element.has_list()) return;
    const auto next_word = [&] {
      line.remove_prefix(std::min(line.find_first_not_of(kSpace), line.size()));
      const std::string_view word = line.substr(0, line.find_first_of(kSpace));
      line.remove_prefix(word.size());
      return word;
    };
    for (const Property& property : element.properties) {
      const std::string word(next_word());
      if (!property.list) continue;
      char* end = nullptr;
      const double entries = std::strtod(word.c_str(), &end);
      if (word.empty() || *end != '\0' || !(entries >= 0.0) || entries != std::floor(entries))
        refuse(element, number, "'" + word + "' is no number of entries of a list");
      for (double i = 0.0; i < entries; i += 1.0) {
        if (next_word().empty())
          refuse(element, number, "its line has fewer entries than the " + word + " it announces");
      }
    }
  }

  // One element of a binary file.
  void skip(const Element& element, bool little, double number) {
    for (const Property& property : element.properties) {
      std::uint64_t entries = 1;
      if (property.list) {
        if (text_.size() - at_ < property.count.bytes) {
          at_ = text_.size();
          return;
        }
        const Type& count = property.count;
        entries = read_number(count, little);
        if (count.is_signed && entries >> (8 * count.bytes - 1) != 0)
          refuse(element, number, "a list with a negative number of entries");
        at_ += count.bytes;
        if (entries > (text_.size() - at_) / property.value.bytes)
          refuse(element, number,
                 "a list of " + std::to_string(entries) + " entries, more than the rest of the file holds");
      }
      at_ = std::min<std::uint64_t>(at_ + entries * property.value.bytes, text_.size());
    }
  }

  // What is next, its bits as those of a number without a sign.
  std::uint64_t read_number(const Type& type, bool little) const {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < type.bytes; ++i) {
      const std::size_t byte = little ? type.bytes - 1 - i : i;
      value = value << 8 | static_cast<unsigned char>(text_[at_ + byte]);
    }
    return value;
  }

  std::string path_, text_;
  std::size_t at_ = 0;  // what is read next
};

}  // namespace

void check_ply_lists(const std::string& path) { Ply(path).check(); }

}  // namespace efsi::io
