#include "transport/fluid_behind.hpp"

#include <algorithm>

namespace efsi::sim {

using grid::Grid;

namespace {

// Where nodes beside a place are that lie on no face of the box; in a slab, one cell thick, all do.
struct Beside {
  int begin, end;
};
Beside beside(const Grid& g, std::size_t axis, int place) {
  if (g.cells[axis] == 1) return {0, 2};
  return {std::max(place - 1, 1), std::min(place + 2, g.cells[axis])};
}

}  // namespace

FluidBehind::FluidBehind(const Parallel& parallel, const Grid& g, const system::SlipNodes& slip,
                         const std::vector<Real>& specific_volume, Real fluid_volume)
    : g_(g), specific_volume_(specific_volume), fluid_volume_(fluid_volume) {
  if (slip.empty()) return;
  const std::vector<system::SlipNode>& all = slip.nodes();
  std::vector<std::vector<std::size_t>> planes(static_cast<std::size_t>(g.cells[2]) + 1);
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t plane) {
    const int k = static_cast<int>(plane);
    if (g.cells[2] > 1 && (k == 0 || k == g.cells[2])) return;
    std::vector<std::size_t>& found = planes[static_cast<std::size_t>(k)];
    const auto before = [](const system::SlipNode& n, std::size_t node) { return n.node < node; };
    const auto first = std::lower_bound(all.begin(), all.end(), g.node(0, 0, std::max(k - 1, 0)), before);
    const auto last = std::lower_bound(first, all.end(), g.node(0, 0, std::min(k + 1, g.cells[2]) + 1), before);
    for (auto n = first; n != last; ++n) {
      const Vec3i place = g.node_place(n->node);
      const Beside x = beside(g, 0, place[0]), y = beside(g, 1, place[1]);
      for (int j = y.begin; j < y.end; ++j)
        for (int i = x.begin; i < x.end; ++i)
          if (const std::size_t node = g.node(i, j, k); specific_volume[node] != fluid_volume) found.push_back(node);
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
  });
  for (const std::vector<std::size_t>& plane : planes) nodes_.insert(nodes_.end(), plane.begin(), plane.end());
}

// Calls body(node, square of its distance in cells).
template <class Body>
void FluidBehind::visit_fluid(std::size_t node, const Body& body) const {
  const Vec3i place = g_.node_place(node);
  const Beside x = beside(g_, 0, place[0]), y = beside(g_, 1, place[1]), z = beside(g_, 2, place[2]);
  for (int k = z.begin; k < z.end; ++k)
    for (int j = y.begin; j < y.end; ++j)
      for (int i = x.begin; i < x.end; ++i) {
        const std::size_t n = g_.node(i, j, k);
        if (specific_volume_[n] != fluid_volume_) continue;
        const int apart[3] = {i - place[0], j - place[1], k - place[2]};
        body(n, apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]);
      }
}

std::vector<Vec3> FluidBehind::values(const Parallel& parallel, const grid::VectorField& field) const {
  std::vector<Vec3> values(nodes_.size());
  parallel.for_each(static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t t) {
    values[static_cast<std::size_t>(t)] = field.at(nodes_[static_cast<std::size_t>(t)]);
  });
  return values;
}

void FluidBehind::extend(const Parallel& parallel, grid::VectorField& field) const {
  parallel.for_each(static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t t) {  // from fluid, which stays
    const std::size_t node = nodes_[static_cast<std::size_t>(t)];
    Vec3d sum = Vec3d::Zero();  // double: mirror images of a place have the same bits
    double weights = 0.0;
    visit_fluid(node, [&](std::size_t n, int square) {
      const double weight = 1.0 / (square * square);
      sum += weight * field.at(n).cast<double>();
      weights += weight;
    });
    if (weights > 0.0) field.set(node, (sum / weights).cast<Real>());
  });
}

void FluidBehind::set(const Parallel& parallel, const std::vector<Vec3>& values, grid::VectorField& field) const {
  parallel.for_each(static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t t) {
    field.set(nodes_[static_cast<std::size_t>(t)], values[static_cast<std::size_t>(t)]);
  });
}

}  // namespace efsi::sim
