#include "solid/element/dilatation.hpp"

#include "solid/element/material_lattice.hpp"

namespace efsi::solid {
namespace {

constexpr int kPasses = 2;  // in which the nodes take what has changed: reading between them smooths it

Vec3d rest_center(const Vec3d u[8], const Vec3d& x0, double h) {
  Vec3d X = x0 + Vec3d::Constant(0.5 * h);
  for (std::size_t a = 0; a < 8; ++a) X -= 0.125 * u[a];
  return X;
}

// From the nodes around a point that know it; 0: none does.
double read(const std::vector<Real>& nodes, const LatticePoint& point) {
  double sum = 0.0, known = 0.0;
  for (std::size_t c = 0; c < 8; ++c) {
    const Real value = nodes[point.node[c]];
    if (!(value > 0)) continue;
    sum += point.weight[c] * static_cast<double>(value);
    known += point.weight[c];
  }
  return known > 0.0 ? sum / known : 0.0;
}

// What a node of the lattice gets of the elements around it.
struct NodeSum {
  double weight = 0.0, next = 0.0, missing = 0.0;
};

}  // namespace

double Dilatation::at_center(const Vec3d u[8], const Vec3d& x0, double h, double det) const {
  if (nodes_.empty()) return det;
  const double ratio = read(nodes_, lattice_point(lattice_, rest_center(u, x0, h)));
  return ratio > 0.0 ? ratio : det;
}

void carry_dilatation(const Parallel& parallel, const SolidRest& rest, const SolidWork& work,
                      const std::vector<double>& next, SolidState& state) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const std::size_t elements = next.size(), plane = rest.lattice.node_stride(2);
  const auto for_elements = [&](const auto& body) {
    parallel.for_each(static_cast<std::int64_t>(elements), [&](std::int64_t e) { body(static_cast<std::size_t>(e)); });
  };
  std::vector<LatticePoint> points(elements);
  for_elements([&](std::size_t e) {
    const auto n = static_cast<std::size_t>(work.element_corner[e]);
    const Vec3i place = g.node_place(n);
    Vec3d u[8];
    for (std::size_t a = 0; a < 8; ++a) u[a] = state.u.at(n + corner[a]).cast<double>();
    points[e] = lattice_point(rest.lattice, rest_center(u, g.node_position(place[0], place[1], place[2]), g.h));
  });
  // Planes of nodes in parallel, each with the elements around it in their order.
  std::vector<std::vector<std::uint32_t>> planes(static_cast<std::size_t>(rest.lattice.nodes()[2]));
  for (std::size_t e = 0; e < elements; ++e)
    if (next[e] > 0.0)
      for (const std::size_t k : {points[e].node[0] / plane, points[e].node[7] / plane})
        planes[k].push_back(static_cast<std::uint32_t>(e));
  std::vector<double> missing(elements);
  for (int pass = 0; pass < kPasses; ++pass) {
    for_elements([&](std::size_t e) { missing[e] = next[e] - read(state.dilatation, points[e]); });
    parallel.for_each(static_cast<std::int64_t>(planes.size()), [&](std::int64_t kk) {
      const auto k = static_cast<std::size_t>(kk);
      if (planes[k].empty()) return;
      std::vector<NodeSum> sums(plane);
      for (const std::uint32_t e : planes[k])
        for (std::size_t c = 0; c < 8; ++c) {
          if (points[e].node[c] / plane != k) continue;
          NodeSum& sum = sums[points[e].node[c] - k * plane];
          sum.weight += points[e].weight[c];
          sum.next += points[e].weight[c] * next[e];
          sum.missing += points[e].weight[c] * missing[e];
        }
      for (std::size_t m = 0; m < plane; ++m) {
        if (!(sums[m].weight > 0.0)) continue;
        Real& node = state.dilatation[k * plane + m];
        node = node > 0 ? node + static_cast<Real>(sums[m].missing / sums[m].weight)
                        : static_cast<Real>(sums[m].next / sums[m].weight);
      }
    });
  }
  for (std::size_t e = 0; e < elements; ++e)
    if (next[e] == kForgotten)
      for (const std::size_t node : points[e].node) state.dilatation[node] = 0;
}

}  // namespace efsi::solid
