// Purpose: a .ply file in the one form that assimp reads without mistakes.
#include "io/plain_ply.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <map>
#include <sstream>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "io/read_all.hpp"
#include "io/to_number.hpp"

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
  std::string name, type_names;  // type_names: "float", "list uchar int"
  bool list = false, kept = false;
  Type count, value;  // count: of a list's number of entries
};

struct Element {
  std::string name;
  std::uint32_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  std::string format;
  std::vector<Element> elements;
};

class Ply {
 public:
  explicit Ply(const std::string& path) : path_(path), text_(read_all(path)) {}

  std::string plain() {
    const Header header = read_header();
    ascii_ = header.format == "ascii";
    little_ = header.format == "binary_little_endian";
    if (!ascii_ && !little_ && header.format != "binary_big_endian")
      refuse("not a readable .ply file: its header has no known format");
    std::string vertices, faces;
    for (const Element& element : header.elements) {
      if (element.properties.empty()) continue;
      std::string& kept = element.name == "vertex" ? vertices : faces;
      for (std::uint64_t i = 0; i < element.count; ++i)
        ascii_ ? take_line(element, i, kept) : take_bytes(element, i, kept);
    }
    std::string plain = "ply\nformat " + header.format + " 1.0\n";
    for (const char* name : {"vertex", "face"}) {
      for (const Element& element : header.elements) {
        if (element.name != name) continue;
        plain += "element " + element.name + " " + std::to_string(element.count) + "\n";
        for (const Property& property : element.properties)
          if (property.kept) plain += "property " + property.type_names + " " + property.name + "\n";
      }
    }
    // Of the binary file assimp takes off a line feed behind the end of the header.
    return plain + (ascii_ ? "end_header\n" : "end_header\r\n") + vertices + faces;
  }

 private:
  // The next line without its end, '\n', "\r\n" or '\r'.
  std::string_view next_line() {
    const std::size_t begin = at_, end = std::min(text_.find_first_of("\r\n", begin), text_.size());
    at_ = std::min(end + (text_.compare(end, 2, "\r\n") == 0 ? 2 : 1), text_.size());
    return std::string_view(text_).substr(begin, end - begin);
  }

  [[noreturn]] void refuse(const std::string& reason) const { throw Error(ErrorCode::kMesh, path_ + ": " + reason); }

  // number: of the element among its kind, from 0.
  [[noreturn]] void refuse(const Element& element, std::uint64_t number, const std::string& reason) const {
    refuse(element.name + " " + std::to_string(number + 1) + ": " + reason);
  }

  Type type_of(const std::string& name, std::string_view line) const {
    const auto found = kTypes.find(name);
    if (found == kTypes.end()) refuse("its header has a property without a known type: " + std::string(line));
    return found->second;
  }

  Header read_header() {
    std::string first(next_line().substr(0, 3));
    for (char& c : first) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (first != "ply") refuse("not a readable .ply file: it does not begin with \"ply\"");
    Header header;
    for (bool ended = false; !ended;) {
      if (at_ == text_.size()) refuse("its header has no line end_header");
      const std::string_view line = next_line();
      std::istringstream words{std::string(line)};
      std::string key, word, number;
      words >> key >> word >> number;
      ended = key == "end_header";
      if (key == "format") header.format = word;
      if (key == "element") header.elements.push_back({word, count_of(number, line), {}});
      if (key != "property" || header.elements.empty()) continue;
      Property property;
      property.list = word == "list";
      property.type_names = word;
      property.name = number;
      if (property.list) {
        property.count = type_of(number, line);
        words >> word >> property.name;
        property.type_names += " " + number + " " + word;
      }
      property.value = type_of(word, line);
      header.elements.back().properties.push_back(property);
    }
    for (Element& element : header.elements) keep(header, element);
    const auto has = [&](const char* name) {
      return std::any_of(header.elements.begin(), header.elements.end(), [&](const Element& element) {
        return element.name == name && std::any_of(element.properties.begin(), element.properties.end(),
                                                   [](const Property& property) { return property.kept; });
      });
    };
    if (!has("vertex")) refuse("its header has no element vertex with coordinates");
    if (!has("face")) refuse("has no faces: its header has no element face with a list vertex_indices");
    return header;
  }

  std::uint32_t count_of(const std::string& word, std::string_view line) const {
    std::uint32_t count = 0;
    if (!to_number(word, count)) refuse("its header has an element without a number: " + std::string(line));
    return count;
  }

  // Marks the properties that are kept.
  void keep(const Header& header, Element& element) const {
    if (element.name == "tristrips" && element.count > 0) refuse("has triangle strips, which are not read");
    if (element.name != "vertex" && element.name != "face") return;
    const auto same = [&](const Element& other) { return other.name == element.name; };
    if (std::count_if(header.elements.begin(), header.elements.end(), same) > 1)
      refuse("its header has more than one element " + element.name);
    for (Property& property : element.properties) {
      const bool coordinate = property.name == "x" || property.name == "y" || property.name == "z";
      const bool corners = property.name == "vertex_index" || property.name == "vertex_indices";
      property.kept = element.name == "vertex" ? coordinate && !property.list : corners && property.list;
      const auto again = [&](const Property& other) { return other.kept && other.name == property.name; };
      if (property.kept && std::count_if(element.properties.begin(), element.properties.end(), again) > 1)
        refuse("its " + element.name + " has more than one property " + property.name);
    }
  }

  // One element of a text, a line that is not blank; what is kept of it goes to the end of `kept`.
  void take_line(const Element& element, std::uint64_t number, std::string& kept) {
    constexpr std::string_view kSpace(" \t\v\f\0", 5);
    std::string_view line;
    do line = next_line();
    while (line.find_first_not_of(kSpace) == std::string_view::npos && at_ < text_.size());
    if (line.find_first_not_of(kSpace) == std::string_view::npos) refuse(element, number, "the file ends before it");
    const auto next_word = [&] {
      line.remove_prefix(std::min(line.find_first_not_of(kSpace), line.size()));
      const std::string_view word = line.substr(0, line.find_first_of(kSpace));
      line.remove_prefix(word.size());
      return word;
    };
    for (const Property& property : element.properties) {
      const std::string_view word = next_word();
      if (property.kept) kept.append(word) += ' ';
      if (!property.list) {
        if (word.empty()) refuse(element, number, "its line has fewer numbers than it has properties");
        continue;
      }
      const std::uint64_t entries = entries_of(element, number, word);
      for (std::uint64_t i = 0; i < entries; ++i) {
        const std::string_view entry = next_word();
        if (entry.empty())
          refuse(element, number, "its line has fewer entries than the " + std::string(word) + " it announces");
        if (!property.kept) continue;
        if (entry.find_first_not_of("0123456789") != std::string_view::npos)
          refuse(element, number, "'" + std::string(entry) + "' is no number of a vertex");
        kept.append(entry) += ' ';
      }
    }
    if (!kept.empty()) kept.back() = '\n';
  }

  std::uint64_t entries_of(const Element& element, std::uint64_t number, std::string_view word) const {
    std::uint64_t entries = 0;
    if (!to_number(word, entries))
      refuse(element, number, "'" + std::string(word) + "' is no number of entries of a list");
    return entries;
  }

  // One element of a binary file; what is kept of it goes to the end of `kept`.
  void take_bytes(const Element& element, std::uint64_t number, std::string& kept) {
    for (const Property& property : element.properties) {
      const std::size_t begin = at_;
      std::uint64_t entries = 1;
      if (property.list) {
        const Type& count = property.count;
        if (text_.size() - at_ < count.bytes) refuse(element, number, "the file ends within it");
        entries = read_number(count);
        if (count.is_signed && entries >> (8 * count.bytes - 1) != 0)
          refuse(element, number, "a list with a negative number of entries");
        at_ += count.bytes;
        if (entries > (text_.size() - at_) / property.value.bytes)
          refuse(element, number,
                 "a list of " + std::to_string(entries) + " entries, more than the rest of the file holds");
      }
      if (text_.size() - at_ < property.value.bytes && !property.list)
        refuse(element, number, "the file ends within it");
      at_ += entries * property.value.bytes;
      if (property.kept) kept.append(text_, begin, at_ - begin);
    }
  }

  // What is next, its bits as those of a number without a sign.
  std::uint64_t read_number(const Type& type) const {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < type.bytes; ++i) {
      const std::size_t byte = little_ ? type.bytes - 1 - i : i;
      value = value << 8 | static_cast<unsigned char>(text_[at_ + byte]);
    }
    return value;
  }

  std::string path_, text_;
  bool ascii_ = false, little_ = false;
  std::size_t at_ = 0;  // what is read next
};

}  // namespace

std::string plain_ply(const std::string& path) { return Ply(path).plain(); }

}  // namespace efsi::io
