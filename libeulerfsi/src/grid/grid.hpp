// Purpose: index arithmetic of a box of cubic cells: nodes at the corners, cells, cells with one ghost layer.
// Symbols: h voxel size [m]; node (i,j,k) lies at origin + h (i,j,k); x runs fastest.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::grid {

struct Grid {
  Vec3i cells{0, 0, 0};
  double h = 1.0;
  Vec3d origin = Vec3d::Zero();
  std::array<bool, 3> periodic{false, false, false};
  Vec3i lo{0, 0, 0};  // node (0,0,0) in the grid of the box, of which this may be a part

  Vec3i nodes() const { return {cells[0] + 1, cells[1] + 1, cells[2] + 1}; }
  std::size_t node_count() const { return product(nodes()); }
  std::size_t cell_count() const { return product(cells); }
  std::size_t padded_count() const { return product({cells[0] + 2, cells[1] + 2, cells[2] + 2}); }

  std::size_t node(int i, int j, int k) const {
    return static_cast<std::size_t>(i) + node_stride(1) * static_cast<std::size_t>(j) +
           node_stride(2) * static_cast<std::size_t>(k);
  }
  // i, j, k of a node.
  Vec3i node_place(std::size_t n) const {
    return {static_cast<int>(n % node_stride(1)), static_cast<int>(n % node_stride(2) / node_stride(1)),
            static_cast<int>(n / node_stride(2))};
  }
  std::size_t cell(int i, int j, int k) const {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(cells[0]) *
               (static_cast<std::size_t>(j) + static_cast<std::size_t>(cells[1]) * static_cast<std::size_t>(k));
  }
  // Index into a cell array with one ghost layer: i = -1 .. cells.
  std::size_t padded(int i, int j, int k) const {
    return static_cast<std::size_t>(i + 1) +
           static_cast<std::size_t>(cells[0] + 2) *
               (static_cast<std::size_t>(j + 1) +
                static_cast<std::size_t>(cells[1] + 2) * static_cast<std::size_t>(k + 1));
  }
  std::size_t node_stride(int axis) const {
    return axis == 0 ? 1
                     : (axis == 1 ? static_cast<std::size_t>(cells[0] + 1)
                                  : static_cast<std::size_t>(cells[0] + 1) * static_cast<std::size_t>(cells[1] + 1));
  }
  Vec3d node_position(int i, int j, int k) const { return origin + h * Vec3d(i, j, k); }
  Vec3d cell_center(int i, int j, int k) const { return origin + h * Vec3d(i + 0.5, j + 0.5, k + 0.5); }

 private:
  static std::size_t product(const Vec3i& n) {
    return static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]) * static_cast<std::size_t>(n[2]);
  }
};

// Where node (0,0,0) of one part of the box lies in another.
inline Vec3i offset(const Grid& part, const Grid& other) {
  return {part.lo[0] - other.lo[0], part.lo[1] - other.lo[1], part.lo[2] - other.lo[2]};
}

// The 8 corners of a cell: corner a lies at (kCorner[a][0], kCorner[a][1], kCorner[a][2]).
inline constexpr int kCorner[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                      {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};

// Node offsets of the 8 corners relative to the cell's lowest node.
inline std::array<std::size_t, 8> corner_offsets(const Grid& g) {
  std::array<std::size_t, 8> offset{};
  for (int a = 0; a < 8; ++a)
    offset[static_cast<std::size_t>(a)] = static_cast<std::size_t>(kCorner[a][0]) +
                                          g.node_stride(1) * static_cast<std::size_t>(kCorner[a][1]) +
                                          g.node_stride(2) * static_cast<std::size_t>(kCorner[a][2]);
  return offset;
}

using ScalarField = std::vector<Real>;

// Three components, each its own array.
struct VectorField {
  std::array<std::vector<Real>, 3> c;
  void assign(std::size_t n, Real value = 0) {
    for (auto& component : c) component.assign(n, value);
  }
  std::size_t size() const { return c[0].size(); }
  Vec3 at(std::size_t n) const { return {c[0][n], c[1][n], c[2][n]}; }
  void set(std::size_t n, const Vec3& v) {
    c[0][n] = v[0];
    c[1][n] = v[1];
    c[2][n] = v[2];
  }
};

}  // namespace efsi::grid
