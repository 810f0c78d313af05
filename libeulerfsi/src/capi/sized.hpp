// Purpose: structs that have grown since the caller was compiled: what the caller's header did not have is left out,
// what the library does not have is refused by name.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

#include "base/error.hpp"
#include "capi/struct_fields.inc"

namespace efsi::capi {

// Throws Error(kArgument) where the caller's struct has more members than the library's.
template <class Struct>
void check_size(std::size_t size, const std::string& argument) {
  if (size <= sizeof(Struct)) return;
  throw Error(ErrorCode::kArgument,
              argument + " = " + std::to_string(size) + ": " + Layout<Struct>::name + " of library version " +
                  std::to_string(EFSI_VERSION_MAJOR) + "." + std::to_string(EFSI_VERSION_MINOR) + "." +
                  std::to_string(EFSI_VERSION_PATCH) + " has " + std::to_string(sizeof(Struct)) +
                  " bytes and ends with `" + Layout<Struct>::last +
                  "`; the caller was compiled against a newer version, whose later members this library lacks");
}

// As std::memcpy, whose addresses may not be null even where nothing is copied.
inline void copy_bytes(const void* from, std::size_t size, void* to) {
  std::copy_n(static_cast<const unsigned char*>(from), size, static_cast<unsigned char*>(to));
}

// Writes a result to the caller's struct, which may be an older and shorter one. function: for the message.
template <class Struct>
void give(const Struct& value, Struct* out, std::size_t size, const char* function) {
  check_size<Struct>(size, std::string(function) + ": size");
  copy_bytes(&value, size, out);
}

// The first `capacity` results, to an array of the caller's structs of `size` bytes each.
template <class Struct, class Values>
void give_array(const Values& values, Struct* out, std::size_t size, std::size_t capacity, const char* function) {
  check_size<Struct>(size, std::string(function) + ": size of an element");
  auto* bytes = reinterpret_cast<unsigned char*>(out);
  for (std::size_t i = 0; i < values.size() && i < capacity; ++i) copy_bytes(&values[i], size, bytes + i * size);
}

// An element of an array of the caller's structs; members that the caller's header did not have are zero.
template <class Struct>
Struct take(const Struct* array, std::size_t size, std::size_t index) {
  Struct value{};
  copy_bytes(reinterpret_cast<const unsigned char*>(array) + index * size, std::min(size, sizeof(Struct)), &value);
  return value;
}

}  // namespace efsi::capi
