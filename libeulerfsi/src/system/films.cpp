#include "system/films.hpp"

#include <algorithm>

namespace efsi::system {
namespace {

constexpr Real kHeavy = Real(0.3);  // of the largest 1/density: a node below it is heavy

// Whether one of the fluid's cells around a node has heavy matter at all of its corners.
bool touches_film(const grid::Grid& g, const SlipNode& n, Real heavy, const std::vector<Real>& specific_volume) {
  for (std::size_t c = 0; c < 8; ++c) {
    const bool fluid = n.shared() ? n.fluid_cells >> c & 1u : !(n.solid_cells >> c & 1u);
    if (!fluid) continue;
    const auto& corner = grid::kCorner[c];
    const int i = n.i - corner[0], j = n.j - corner[1], k = n.k - corner[2];
    if (i < 0 || j < 0 || k < 0 || i >= g.cells[0] || j >= g.cells[1] || k >= g.cells[2]) continue;
    if (std::all_of(std::begin(grid::kCorner), std::end(grid::kCorner),
                    [&](const auto& o) { return specific_volume[g.node(i + o[0], j + o[1], k + o[2])] < heavy; }))
      return true;
  }
  return false;
}

}  // namespace

void open_films(const Parallel& parallel, const grid::Grid& g, const SlipNodes& slip,
                std::vector<Real>& specific_volume) {
  const auto row = static_cast<std::size_t>(g.cells[0] + 1);
  const std::size_t rows = g.node_count() / row;
  const double lightest = parallel.max(static_cast<std::int64_t>(rows), 0.0, [&](std::int64_t r) {
    const auto first = specific_volume.begin() + r * static_cast<std::int64_t>(row);
    return static_cast<double>(*std::max_element(first, first + static_cast<std::int64_t>(row)));
  });
  const Real heavy = kHeavy * static_cast<Real>(lightest);
  const auto count = static_cast<std::int64_t>(slip.nodes().size());
  std::vector<Real> more(slip.nodes().size());
  const auto open = [&](const auto& opens) {
    parallel.for_each(count, [&](std::int64_t i) {
      const auto t = static_cast<std::size_t>(i);
      more[t] = opens(t) ? std::max(Real(0), slip.slipping_volume(t)) : Real(0);
    });
    for (std::size_t t = 0; t < more.size(); ++t) specific_volume[slip.nodes()[t].node] += more[t];
  };
  open([&](std::size_t t) { return slip.nodes()[t].is_free(); });
  if (slip.between_solids())
    open([&](std::size_t t) {
      return !slip.nodes()[t].is_free() && slip.leads(t) && touches_film(g, slip.nodes()[t], heavy, specific_volume);
    });
}

}  // namespace efsi::system
