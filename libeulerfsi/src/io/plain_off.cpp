// Purpose: an .off file in the one form that assimp reads without mistakes.
#include "io/plain_off.hpp"

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "base/error.hpp"
#include "io/read_all.hpp"
#include "io/to_number.hpp"

namespace efsi::io {

namespace {

constexpr std::size_t kLongestLine = 4095, kMostOfFace = 9;  // what assimp reads
constexpr std::string_view kGaps = " \t";

// The first word of a line, which is taken off it; empty: there is none.
std::string_view take_word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(kGaps), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(kGaps));
  line.remove_prefix(word.size());
  return word;
}

class Off {
 public:
  explicit Off(const std::string& path) : path_(path), text_(read_all(path)) {
    for (char& c : text_) {
      if (c == '\r') c = '\n';
      if (c == '\0' || c == '\v' || c == '\f') c = ' ';
    }
  }

  std::string plain() {
    read_keyword();
    vertices_ = read_count();
    const std::uint32_t faces = read_count();
    read_count();  // edges
    std::string points, corners;
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < vertices_; ++i) points += vertex(i);
    for (std::uint32_t i = 0; i < faces; ++i) {
      const std::string line = face(i, faces);
      corners += line;
      if (!line.empty()) ++kept;
    }
    return std::string(homogeneous_ ? "4OFF\n" : "OFF\n") + std::to_string(vertices_) + " " + std::to_string(kept) +
           " 0\n" + points + corners;
  }

 private:
  [[noreturn]] void refuse(const std::string& reason) const { throw Error(ErrorCode::kMesh, path_ + ": " + reason); }

  // To the next character that is neither blank nor comment.
  void skip_blank() {
    while ((at_ = std::min(text_.find_first_not_of(" \t\n", at_), text_.size())) < text_.size() && text_[at_] == '#')
      at_ = std::min(text_.find('\n', at_), text_.size());
  }

  // The rest of the line without its comment.
  std::string_view take_line() {
    skip_blank();
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    const std::string_view line = std::string_view(text_).substr(at_, end - at_);
    at_ = end;
    return line.substr(0, line.find('#'));
  }

  // [ST][C][N][4][n]OFF, or nothing; for n the number of coordinates follows.
  void read_keyword() {
    skip_blank();
    std::size_t at = at_;
    const auto has = [&](std::string_view part) {
      const bool found = text_.compare(at, part.size(), part) == 0;
      if (found) at += part.size();
      return found;
    };
    has("ST"), has("C"), has("N");
    const bool homogeneous = has("4"), any_dimension = has("n");
    if (!has("OFF")) return;
    at_ = at;
    homogeneous_ = homogeneous;
    if (any_dimension) dimension_ = read_count();
    if (dimension_ < 1 || dimension_ > 3)
      refuse("has points of " + std::to_string(dimension_) + " coordinates, not of 1 to 3");
  }

  std::uint32_t read_count() {
    skip_blank();
    const std::size_t end = std::min(text_.find_first_of(" \t\n#", at_), text_.size());
    const std::string_view word = std::string_view(text_).substr(at_, end - at_);
    std::uint32_t number = 0;
    if (!to_number(word, number))
      refuse("not a readable .off file: '" + std::string(word.substr(0, 40)) +
             "' stands for its number of vertices, faces or edges");
    at_ = end;
    return number;
  }

  std::string vertex(std::uint32_t number) {
    const auto name = [&] { return "vertex " + std::to_string(number + 1); };
    std::string_view line = take_line();
    if (line.empty()) refuse("ends before " + name() + " of " + std::to_string(vertices_));
    const std::uint32_t weight = homogeneous_ ? 1 : 0;
    std::string plain;
    for (std::uint32_t i = 0; i < 3 + weight; ++i) {
      if (i >= dimension_ && i < 3) {
        plain += "0 ";
        continue;
      }
      const std::string_view word = take_word(line);
      if (word.empty()) refuse(name() + " has fewer than " + std::to_string(dimension_ + weight) + " coordinates");
      plain.append(word) += ' ';
    }
    plain.back() = '\n';
    if (plain.size() > kLongestLine)
      refuse(name() + " has numbers of more than " + std::to_string(kLongestLine) + " characters");
    return plain;
  }

  // Empty: a face of fewer than three corners.
  std::string face(std::uint32_t number, std::uint32_t faces) {
    const auto name = [&] { return "face " + std::to_string(number + 1); };
    std::string_view line = take_line();
    if (line.empty()) refuse("ends before " + name() + " of " + std::to_string(faces));
    const std::string_view first = take_word(line);
    std::uint32_t corners = 0;
    if (!to_number(first, corners))
      refuse(name() + ": '" + std::string(first.substr(0, 40)) + "' is no number of corners");
    if (corners < 3) return "";
    if (corners > kMostOfFace)
      refuse(name() + " has " + std::to_string(corners) + " corners, more than the " + std::to_string(kMostOfFace) +
             " that are read of an .off file");
    std::string plain(first);
    for (std::uint32_t i = 0; i < corners; ++i) {
      const std::string_view word = take_word(line);
      std::uint32_t index = 0;
      if (word.empty())
        refuse(name() + ": its line has fewer than the " + std::to_string(corners) + " corners it announces");
      if (!to_number(word, index) || index >= vertices_)
        refuse(name() + ": '" + std::string(word.substr(0, 40)) + "' is none of the " + std::to_string(vertices_) +
               " vertices, counted from 0");
      plain.append(" ").append(word);
    }
    return plain += '\n';
  }

  std::string path_, text_;
  std::size_t at_ = 0;  // what is read next
  bool homogeneous_ = false;
  std::uint32_t dimension_ = 3, vertices_ = 0;
};

}  // namespace

std::string plain_off(const std::string& path) { return Off(path).plain(); }

}  // namespace efsi::io
