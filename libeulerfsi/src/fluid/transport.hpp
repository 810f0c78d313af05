// Purpose: rows of nodes or cells of which eight neighbours are carried at once, for advect.cpp and advect_smoke.cpp.
#pragma once

#include "grid/lanes.hpp"

namespace efsi::fluid {

using grid::Grid;
using grid::VectorField;

// Points [begin, end) of row j, k; first: index of point 0 of the row.
struct Row {
  int j, k, begin, end;
  std::size_t first;
};

// Samples the nodes' fields of a grid one by one and eight at once.
struct NodeTransport {
  grid::PackedSampler sampler;
  grid::LaneSampler lanes;
  Vec3i points;
  std::array<bool, 3> periodic;
  explicit NodeTransport(const Grid& g) : sampler(g), lanes(g.nodes()), points(g.nodes()), periodic(g.periodic) {}
};

// Where the flow leads from a place that is `back` cells behind a point with velocity v, from that point: with the
// midpoint velocity ahead mirrored from the one behind, 2 v(x) - v(x - step/2 v), which keeps the order of the midpoint
// rule.
template <class V>
EFSI_INLINE V opposite(const V& back, const V& v, Real step) {
  return back + Real(2) * step * v;
}

EFSI_INLINE grid::Quad node_value(const VectorField& field, std::size_t n) {
  return grid::Quad{field.c[0][n], field.c[1][n], field.c[2][n], 0};
}
EFSI_INLINE void set_node(VectorField& field, std::size_t n, const grid::Quad& v) {
  for (int a = 0; a < 3; ++a) field.c[static_cast<std::size_t>(a)][n] = v[a];
}
EFSI_INLINE grid::Octets scaled(const grid::Octets& v, Real factor) {
  return {{factor * v.c[0], factor * v.c[1], factor * v.c[2]}};
}
// Stores the lanes from `begin` on.
EFSI_INLINE void store_from(int begin, const grid::Octet& v, Real* to) {
  if (begin == 0) {
    grid::store_octet(to, v);
    return;
  }
  for (int l = begin; l < grid::kLanes; ++l) to[l] = v[l];
}

// How far eight points of a row, from point i on, are from the first and the last one along each axis; periodic axes
// have no end.
class Room {
 public:
  EFSI_INLINE Room(const Vec3i& points, const std::array<bool, 3>& periodic, const Row& row, int i) {
    constexpr Real kFar = std::numeric_limits<Real>::max();
    const int place[3] = {i, row.j, row.k};
    const grid::Octet lanes = {0, 1, 2, 3, 4, 5, 6, 7};
    for (std::size_t a = 0; a < 3; ++a) {
      const grid::Octet at = grid::octet(static_cast<Real>(place[a])) + (a == 0 ? lanes : grid::Octet{});
      low_.c[a] = periodic[a] ? grid::octet(-kFar) : -at;
      high_.c[a] = periodic[a] ? grid::octet(kFar) : static_cast<Real>(points[a] - 1) - at;
    }
  }
  // Whether a displacement that is not zero ends at the first or last point or beyond.
  EFSI_INLINE bool cuts(const grid::Octets& way) const {
    const grid::Octet zero{}, one = grid::octet(1);
    grid::Octet cut{};
    for (std::size_t a = 0; a < 3; ++a) {
      const grid::Octet& e = way.c[a];
      const auto beyond = (e != zero) & ((e <= low_.c[a]) | (e >= high_.c[a]));
      cut = beyond ? one : cut;
    }
    return grid::greatest(cut) > 0;
  }
  // The displacements, cut there.
  EFSI_INLINE grid::Octets keep(const grid::Octets& way) const {
    grid::Octets kept;
    for (std::size_t a = 0; a < 3; ++a) kept.c[a] = grid::smaller(grid::larger(way.c[a], low_.c[a]), high_.c[a]);
    return kept;
  }

 private:
  grid::Octets low_, high_;
};

// Calls one(i) or eight(i, done) for the points of a row; points 0 and `last`, on the faces, come one by one. Where
// what is left is less than eight points eight(i, done) goes over `done` points that it calls for once more, later.
template <class One, class Eight>
EFSI_INLINE void for_lanes(const Row& row, int last, const One& one, const Eight& eight) {
  int begin = row.begin, end = row.end;
  if (begin == 0 && begin < end) one(begin++);
  if (end == last + 1 && begin < end) one(--end);
  const int count = end - begin;
  if (count < grid::kLanes) {
    for (int i = begin; i < end; ++i) one(i);
    return;
  }
  const int rest = count % grid::kLanes;
  if (rest > 0) eight(end - grid::kLanes, grid::kLanes - rest);
  for (int i = begin; i + grid::kLanes <= end; i += grid::kLanes) eight(i, 0);
}

}  // namespace efsi::fluid
