// Purpose: a word as a whole number.
#pragma once

#include <charconv>
#include <string_view>
#include <system_error>

namespace efsi::io {

// Whether all of the word is the number, within the type.
template <class Number>
bool to_number(std::string_view word, Number& number) {
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, number);
  return result.ec == std::errc() && result.ptr == end;
}

}  // namespace efsi::io
