// Purpose: sets that are joined two by two; each is known by its smallest member, whatever the order of joining.
#pragma once

#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

namespace efsi {

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t members) : parent_(members) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t find(std::size_t member) {
    while (parent_[member] != member) member = parent_[member] = parent_[parent_[member]];
    return member;
  }
  void unite(std::size_t a, std::size_t b) {
    a = find(a);
    b = find(b);
    if (a == b) return;
    if (a > b) std::swap(a, b);
    parent_[b] = a;
  }

 private:
  std::vector<std::size_t> parent_;
};

}  // namespace efsi
