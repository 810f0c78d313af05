// Purpose: adds up the bytes of arrays; what values take beside them does not count.
#pragma once

#include <cstdint>
#include <vector>

namespace efsi {

struct ByteCount {
  std::uint64_t bytes = 0;
  template <class T>
  void value(const T&) {}
  template <class T>
  void array(const std::vector<T>& v) {
    bytes += v.capacity() * sizeof(T);
  }
};

}  // namespace efsi
