#include "frame/slab_state.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// Calls body(node of the lower layer, node above it) for the two layers of a slab.
template <class Body>
void for_pairs(const Parallel& parallel, const Grid& g, int axis, const Body& body) {
  const std::size_t step = g.node_stride(axis), row = g.node_stride(1), plane = g.node_stride(2);
  const std::size_t count = g.node_count() / 2;
  parallel.for_ranges(static_cast<std::int64_t>(count), [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const std::size_t low = axis == 2 ? i : axis == 1 ? i / row * plane + i % row : 2 * i;
      body(low, low + step);
    }
  });
}

}  // namespace

void flatten(const Parallel& parallel, const Grid& g, int axis, grid::VectorField& field) {
  const auto a = static_cast<std::size_t>(axis);
  for_pairs(parallel, g, axis, [&](std::size_t low, std::size_t high) {
    field.c[a][low] = 0;
    for (auto& c : field.c) c[high] = c[low];
  });
}

std::optional<geometry::Slab> slab_of(const Params& params, const Grid& box) {
  const int axis = grid::slab_axis(box, params.walls);
  if (axis < 0) return {};
  return geometry::Slab{axis, box.origin[axis], box.origin[axis] + box.h};
}

void flatten(const Parallel& parallel, const solid::SolidRest& rest, int axis, solid::SolidState& state) {
  const Grid& g = state.band.grid;
  flatten(parallel, g, axis, state.u);
  flatten(parallel, g, axis, state.v);
  for_pairs(parallel, g, axis, [&](std::size_t low, std::size_t high) { state.valid[high] = state.valid[low]; });
  for (std::size_t v = 0; v < state.surface.size(); ++v) state.surface[v][axis] = rest.surface.points[v][axis];
}

}  // namespace efsi::sim
