#include "sources/volume_source.hpp"

#include <algorithm>

#include "contact/push_out.hpp"
#include "frame/grid_loops.hpp"
#include "linalg/reduce.hpp"
#include "solid/surface/surface.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr double kLargestGrowth = 0.02;  // of a solid's volume in a step, to make up for what its surface has lost
constexpr double kSoonest = 1e-3;        // s: in which it makes up for that, not sooner
constexpr double kBulkTimes = 3.0;       // of the time in which det F is led back, where bulk stiffness resists it
constexpr double kFastest = 0.1;         // of a cell's volume in a step
constexpr double kAhead = 0.5;           // of what the last step lost: losses last for many steps

// What a solid as a whole is asked to gain in this step, over its volume at rest: what its mesh has lost and part of
// what this step will lose.
double asked_volume(double lost, double leak) {
  if (lost == 0.0) return 0.0;
  return std::clamp(lost + kAhead * leak, -kLargestGrowth, kLargestGrowth);
}

}  // namespace

double count_fluid_cells(const Grid& g, const SolidWorks& solids) {
  double cells = static_cast<double>(g.cell_count());
  for (const solid::SolidWork& solid : solids) cells -= static_cast<double>(solid.owned_cells());
  return cells;
}

void take_from_fluid(const Parallel& parallel, const Matter& matter, Real share, std::vector<Real>& source) {
  const Grid& g = matter.common.grid;
  parallel.for_each(g.cells[2], [&](std::int64_t k) {
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.padded(i, j, static_cast<int>(k));
        if (!matter.owned[c]) source[c] -= share;
      }
  });
}

double return_rate(double dt, const solid::SolidWork& work, std::size_t cell) {
  const double det = static_cast<double>(work.volume_ratio[cell]), limit = kFastest / dt;
  const double wanted = work.dilatation.empty() || work.element[cell] < 0
                            ? 1.0
                            : static_cast<double>(work.dilatation[static_cast<std::size_t>(work.element[cell])]);
  const double time = overlap_time(dt) * (work.dilatation.empty() ? 1.0 : kBulkTimes);
  return std::clamp((wanted - det) / (det * time), -limit, limit);
}

void compute_volume_source(const Parallel& parallel, const Scene& scene, double dt, const SolidStates& states,
                           const Holds& holds, const Matter& matter, SolidWorks& solids, std::vector<Real>& source) {
  const Grid& g = matter.common.grid;
  linalg::fill(parallel, source, g.padded_count(), Real(0));
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    solid::SolidWork& solid = solids[l];
    solid.next_volume = 0.0;
    const bool compressible = scene.solids[l].compressible;
    if (compressible && solid.dilatation.empty()) continue;
    double growth = 0.0;
    if (!compressible && states[l].whole && solid::encloses(scene.solids[l])) {
      const double volume = solid::volume_ratio(scene.solids[l], states[l]);
      const double lost = lost_beyond_film(holds.of(l), scene.solids[l], scene.grid.h, 1.0 - volume);
      const double asked = asked_volume(lost, states[l].leak);
      solid.next_volume = volume + asked;
      growth = asked / std::max(dt, kSoonest);
    }
    for_owned_cells(parallel, g, matter.owned, l, states[l].band, [&](std::size_t cell, std::size_t c) {
      const double rate = growth + return_rate(dt, solid, c);
      source[cell] = static_cast<Real>(rate * static_cast<double>(solid.fraction[c]));
    });
  }
  const double fluid_cells = count_fluid_cells(g, solids);
  if (!scene.params.fluid.present || scene.params.walls.any_open() || fluid_cells < 1.0) return;
  const double total = parallel.sum(g.cells[2], [&](std::int64_t k) {
    double sum = 0.0;
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) sum += static_cast<double>(source[g.padded(i, j, static_cast<int>(k))]);
    return sum;
  });
  take_from_fluid(parallel, matter, static_cast<Real>(total / fluid_cells), source);
}

}  // namespace efsi::sim
