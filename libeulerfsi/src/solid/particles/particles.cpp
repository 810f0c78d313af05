#include "solid/particles/particles.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "grid/extrapolate.hpp"
#include "solid/map/displacement.hpp"
#include "solid/map/inverse_map.hpp"

namespace efsi::solid {
namespace {

constexpr double kLeastMass = 1.0 / 32.0;  // of a full node's mass, above which particles set its velocity

// Three numbers in [0, 1) that depend on the seed, a cell of the box and an eighth of it.
Vec3d scatter(std::uint64_t seed, const Vec3i& cell, int octant) {
  std::uint64_t bits = seed;
  for (const int value : {cell[0], cell[1], cell[2], octant}) {
    bits = (bits ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(value))) * 0x9e3779b97f4a7c15ull;
    bits ^= bits >> 29;
    bits *= 0xbf58476d1ce4e5b9ull;
    bits ^= bits >> 32;
  }
  constexpr std::uint64_t kMask = (1ull << 21) - 1;
  const auto part = [&](int shift) { return static_cast<double>((bits >> shift) & kMask) / 2097152.0; };
  return {part(0), part(21), part(42)};
}

// Weights of the tent at the corners of the cell around a place.
std::array<Real, 8> tent(const double f[3]) {
  std::array<Real, 8> w;
  for (std::size_t a = 0; a < 8; ++a) {
    double product = 1.0;
    for (int i = 0; i < 3; ++i) product *= grid::kCorner[a][i] ? f[i] : 1.0 - f[i];
    w[a] = static_cast<Real>(product);
  }
  return w;
}

// Particles by the cell that they are in: those of cell c are order[first[c]] to order[first[c + 1] - 1], in the order
// in which they were made.
struct Bins {
  std::vector<std::uint32_t> first, order;
};
Bins sort_into_cells(const Grid& g, const std::vector<std::uint32_t>& cell) {
  Bins bins;
  bins.first.assign(g.cell_count() + 1, 0);
  for (const std::uint32_t c : cell) ++bins.first[c + 1];
  for (std::size_t c = 0; c < g.cell_count(); ++c) bins.first[c + 1] += bins.first[c];
  std::vector<std::uint32_t> next = bins.first;
  bins.order.resize(cell.size());
  for (std::size_t p = 0; p < cell.size(); ++p) bins.order[next[cell[p]]++] = static_cast<std::uint32_t>(p);
  return bins;
}

// Sums over the particles around a node.
struct NodeSum {
  double mass = 0.0;
  Vec3d momentum = Vec3d::Zero();
};
NodeSum sum_around(const Grid& g, const Particles& particles, const Bins& bins, int i, int j, int k) {
  NodeSum sum;
  for (const auto& corner : grid::kCorner) {
    const int c[3] = {i - corner[0], j - corner[1], k - corner[2]};
    if (c[0] < 0 || c[1] < 0 || c[2] < 0 || c[0] >= g.cells[0] || c[1] >= g.cells[1] || c[2] >= g.cells[2]) continue;
    const std::size_t cell = g.cell(c[0], c[1], c[2]);
    for (std::uint32_t at = bins.first[cell]; at < bins.first[cell + 1]; ++at) {
      const std::size_t p = bins.order[at];
      const Vec3d from = (particles.x[p] - g.origin) / g.h - Vec3d(i, j, k);
      double w = static_cast<double>(particles.mass[p]);
      for (int a = 0; a < 3; ++a) w *= std::max(0.0, 1.0 - std::abs(from[a]));
      sum.mass += w;
      sum.momentum += w * particles.v[p].cast<double>();
    }
  }
  return sum;
}

}  // namespace

std::size_t Particles::bytes() const {
  return x.capacity() * sizeof(Vec3d) + v.capacity() * sizeof(Vec3) + mass.capacity() * sizeof(Real);
}

bool velocity_at(const SolidState& state, const std::vector<std::uint8_t>& layer, const Vec3d& x, Vec3& v) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  double f[3];
  const std::size_t base = lower_node(g, x, f);
  for (double& part : f) part = std::clamp(part, 0.0, 1.0);
  const std::array<Real, 8> w = tent(f);
  Real sum = 0;
  v.setZero();
  for (std::size_t a = 0; a < 8; ++a) {
    if (layer[base + corner[a]] == grid::kNoLayer) continue;
    v += w[a] * state.v.at(base + corner[a]);
    sum += w[a];
  }
  if (!(sum > 0)) return false;
  v /= sum;
  return true;
}

void seed_particles(const Parallel& parallel, const SolidRest& rest, const SolidState& state, const SolidWork& work,
                    std::uint64_t seed, Particles& particles) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  std::vector<Particles> planes(static_cast<std::size_t>(g.cells[2]));
  parallel.for_each(g.cells[2], [&](std::int64_t plane) {
    Particles& made = planes[static_cast<std::size_t>(plane)];
    const int k = static_cast<int>(plane);
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.cell(i, j, k);
        if (!(work.fraction[c] > 0)) continue;
        const double part = g.h * g.h * g.h / kParticlesPerCell / static_cast<double>(work.volume_ratio[c]);
        for (int octant = 0; octant < kParticlesPerCell; ++octant) {
          const auto& half = grid::kCorner[octant];
          const Vec3d in_cell =
              0.5 * (Vec3d(half[0], half[1], half[2]) + scatter(seed, {i + g.lo[0], j + g.lo[1], k + g.lo[2]}, octant));
          const Vec3d x = g.node_position(i, j, k) + g.h * in_cell;
          if (work.fraction[c] < 1) {
            Vec3d u;
            Mat3d gradient;
            if (!sample_displacement(state, corner, x, u, gradient) || rest.distance.sample(x - u) > 0.0) continue;
          }
          Vec3 v;
          if (!velocity_at(state, work.layer, x, v)) continue;
          made.x.push_back(x);
          made.v.push_back(v);
          made.mass.push_back(static_cast<Real>(rest.density * part));
        }
      }
  });
  particles = {};
  for (const Particles& made : planes) {
    particles.x.insert(particles.x.end(), made.x.begin(), made.x.end());
    particles.v.insert(particles.v.end(), made.v.begin(), made.v.end());
    particles.mass.insert(particles.mass.end(), made.mass.begin(), made.mass.end());
  }
}

void rasterize(const Parallel& parallel, double dt, const SolidRest& rest, Particles& particles, SolidState& state,
               SolidWork& work) {
  const Grid& g = state.band.grid;
  const Vec3d top = g.node_position(g.cells[0], g.cells[1], g.cells[2]);
  std::vector<std::uint32_t> cell(particles.size());
  parallel.for_each(static_cast<std::int64_t>(particles.size()), [&](std::int64_t n) {
    const auto p = static_cast<std::size_t>(n);
    Vec3d& x = particles.x[p];
    x = (x + dt * particles.v[p].cast<double>()).cwiseMax(g.origin).cwiseMin(top);
    int at[3];
    for (int a = 0; a < 3; ++a)
      at[a] = std::min(static_cast<int>((x[a] - g.origin[a]) / g.h), g.cells[static_cast<std::size_t>(a)] - 1);
    cell[p] = static_cast<std::uint32_t>(g.cell(at[0], at[1], at[2]));
  });
  const Bins bins = sort_into_cells(g, cell);
  const double least = kLeastMass * rest.density * g.h * g.h * g.h;
  std::vector<std::uint8_t> layer(g.node_count(), grid::kNoLayer);
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t plane) {
    const int k = static_cast<int>(plane);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const NodeSum sum = sum_around(g, particles, bins, i, j, k);
        if (!(sum.mass > least)) continue;
        const std::size_t n = g.node(i, j, k);
        state.v.set(n, (sum.momentum / sum.mass).cast<Real>());
        layer[n] = 0;
      }
  });
  const std::array<Real*, 3> fields = {state.v.c[0].data(), state.v.c[1].data(), state.v.c[2].data()};
  grid::extend_linear(parallel, g, kExtensionLayers, layer, fields);
  for (std::size_t n = 0; n < layer.size(); ++n)
    if (layer[n] == grid::kNoLayer || work.layer[n] == grid::kNoLayer) work.layer[n] = grid::kNoLayer;
}

}  // namespace efsi::solid
