#include "solid/element/mass.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "grid/plane_cut.hpp"
#include "solid/element/aggregation.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/hexahedron.hpp"
#include "solid/map/boundary_distance.hpp"
#include "solid/map/copies.hpp"
#include "solid/map/credible.hpp"
#include "solid/map/displacement.hpp"

namespace efsi::solid {
namespace {

constexpr double kMostWeight = 2.0;    // of an element: crumbs of a solid do not become rigid
constexpr double kThinnestFree = 0.1;  // cells: least width of the deforming part of an element beside a pin

// Cells: further away the plane phi = 0 misses the cell. Half the cell's diagonal times a bound of the length of
// F^-T grad phi, clamped as below; the slope of a distance is at most 1 along each axis.
double cutting_distance(const Mat3d& inverse_f) {
  const Mat3d size = inverse_f.cwiseAbs();
  const double norm = std::sqrt(size.rowwise().sum().maxCoeff() * size.colwise().sum().maxCoeff());
  return 0.5 * std::sqrt(3.0) * kCutStretch.clamp(1.05 * std::sqrt(3.0) * norm) + 1e-6;
}

// The surface near a cell, as seen from its centre, which is at `material`.
struct Plane {
  double distance;  // cells
  Vec3d normal;
};
Plane plane_of(const geometry::SignedDistance& distance, const Vec3d& material, double phi, const Mat3d& inverse_f) {
  const SeenBoundary seen = see_boundary(phi, inverse_f.transpose() * distance.gradient(material), kCutStretch);
  return {seen.distance, seen.outwards.isZero() ? Vec3d(0, 1, 0) : seen.outwards};
}

constexpr std::size_t kSplinter = 3;  // elements

constexpr int kRoomUnits = 60;  // that a whole cell has in its memory

// Of a cell that the solid owns more than this is solid.
Real least_fraction(const SolidRest& rest, const SolidState& state, std::size_t c) {
  const auto [fraction, lag] = rest.element;
  if (state.stiff.empty()) return fraction;
  const std::uint8_t memory = state.stiff[c];
  const bool lags = (memory & kNoLag) == 0, carried = lags && (memory & kCarried) != 0;
  if (memory >= kRoomUnit) {  // beside a collider
    const double room = static_cast<double>(memory / kRoomUnit) / kRoomUnits;
    const Real part = std::min(static_cast<Real>(kRoomPart * std::max(room, kLeastRoom)), fraction);
    if (carried) return part - lag;
    if (room > kLeastRoom) return part;
  }
  if (!lags) return fraction;
  return carried ? fraction - lag : fraction + lag;
}

bool is_positive(const Mat3d& m) {
  return m(0, 0) > 0.0 && m(0, 0) * m(1, 1) > m(0, 1) * m(1, 0) && m.determinant() > 0.0;
}

// The map in the middle of a cell.
struct CellMap {
  const PlasticField& plastic;
  Vec3d material;
  Mat3d inverse_f;

  // Whether it is not inverted and its principal elastic stretches are within bounds.
  bool is_within(const StretchBounds& bounds) const {
    if (!(inverse_f.determinant() > 0.0)) return false;
    const Mat3d squares = inverse_f.transpose() * plastic.metric(material) * inverse_f;
    return is_positive(squares - Mat3d::Identity() / (bounds.most * bounds.most)) &&
           is_positive(Mat3d::Identity() / (bounds.least * bounds.least) - squares);
  }
};

// What becomes of a cell of this solid fraction.
enum CellUse : std::uint8_t { kNoElement, kSliver, kOwned };
CellUse use_of(const SolidRest& rest, const SolidState& state, std::size_t c, Real fraction, const CellMap& map) {
  if (fraction > least_fraction(rest, state, c)) return kOwned;
  const bool enough = fraction > rest.sliver || (fraction > kSliverPart && rest.thin.contains(map.material));
  return enough && map.is_within(kSliverStretch) ? kSliver : kNoElement;
}

// Whether a cell's map is valid: not where it is extrapolated, and where it is partly so only if it is plausible.
// Beside folds and thin parts the extension leads back into the solid.
bool has_valid_map(std::uint8_t nearest, std::uint8_t farthest, const CellMap& map) {
  return farthest == kKnown || (nearest != kExtrapolated && map.is_within(kPlausibleStretch));
}

// Returns what the cells hold that are solid in part, by planes; use: CellUse of each cell.
std::vector<std::vector<Holding>> compute_fractions(const Parallel& parallel, const SolidRest& rest,
                                                    const SolidState& state, std::vector<std::uint8_t>& use,
                                                    SolidWork& work) {
  const Grid& g = state.band.grid;
  const geometry::SignedDistance& distance = distance_of(rest, state);
  const auto corner = grid::corner_offsets(g);
  const PlasticField plastic(rest, state);
  work.fraction.assign(g.cell_count(), 0);
  work.volume_ratio.assign(g.cell_count(), 1);
  use.assign(g.cell_count(), kNoElement);
  std::vector<std::vector<Holding>> planes(static_cast<std::size_t>(g.cells[2]));
  std::vector<std::uint64_t> rejected(static_cast<std::size_t>(g.cells[2]), 0);
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        // Origin of the map at the corners.
        std::uint8_t nearest = kExtrapolated, farthest = kNoData;
        for (std::size_t offset : corner) {
          nearest = std::min(nearest, state.valid[n + offset]);
          farthest = std::max(farthest, state.valid[n + offset]);
        }
        if (nearest == kNoData) continue;
        // Material at the centre, and the cut of the cell by the surface.
        Vec3d u[8], mean = Vec3d::Zero();
        for (std::size_t a = 0; a < 8; ++a) {
          u[a] = state.u.at(n + corner[a]).cast<double>();
          mean += 0.125 * u[a];
        }
        const Vec3d material = g.cell_center(i, j, k) - mean;
        const double phi = distance.sample(material);
        if (phi > 4.0 * g.h) continue;
        const Mat3d inverse_f = Mat3d::Identity() - displacement_gradient(u, center_gradients(), g.h);
        const double inverse_det = std::clamp(inverse_f.determinant(), 1.0 / kMostDetF, kMostDetF);
        double fraction = phi < 0.0 ? 1.0 : 0.0;
        if (std::abs(phi) < cutting_distance(inverse_f) * g.h) {
          const Plane surface = plane_of(distance, material, phi / g.h, inverse_f);
          fraction = grid::plane_cut_fraction(surface.distance, surface.normal);
        }
        // Cells with an invalid map are counted and left empty.
        const std::size_t c = g.cell(i, j, k);
        const CellMap map{plastic, material, inverse_f};
        const CellUse is = use_of(rest, state, c, static_cast<Real>(fraction), map);
        if (fraction > 0.0 && !has_valid_map(nearest, farthest, map)) {
          rejected[static_cast<std::size_t>(k)] += is != kNoElement;
          continue;
        }
        use[c] = is;
        work.fraction[c] = static_cast<Real>(fraction);
        work.volume_ratio[c] = static_cast<Real>(1.0 / inverse_det);
        if (fraction > 0.0) planes[static_cast<std::size_t>(k)].push_back({material, {i, j, k}, farthest == kKnown});
      }
  });
  work.rejected = 0;
  for (const std::uint64_t cells : rejected) work.rejected += cells;
  return planes;
}

void remove_cells(const std::vector<std::size_t>& cells, std::vector<std::uint8_t>& use, SolidWork& work) {
  for (const std::size_t c : cells) {
    work.rejected += use[c] != kNoElement;
    work.fraction[c] = 0;
    use[c] = kNoElement;
  }
}

// Whether the elements that a cell of one reaches over faces are kSplinter or fewer with it.
bool is_splinter(const Grid& g, const std::vector<std::uint8_t>& use, const Vec3i& cell) {
  std::array<Vec3i, kSplinter> part{cell};
  std::size_t count = 1;
  for (std::size_t p = 0; p < count; ++p)
    for (std::size_t side = 0; side < 6; ++side) {
      Vec3i next = part[p];
      int& index = next[side / 2];
      index += side % 2 ? 1 : -1;
      if (index < 0 || index >= g.cells[side / 2] || !use[g.cell(next[0], next[1], next[2])]) continue;
      if (std::find(part.begin(), part.begin() + count, next) != part.begin() + count) continue;
      if (count == kSplinter) return false;
      part[count++] = next;
    }
  return true;
}

// Splinters that have changed their volume are taken away: the map that extends from a single element covers the whole
// rest shape, and what is torn off would grow into a solid of its own. Where the solid is, the extension of the rest
// gives the place its map back.
void remove_splinters(const SolidState& state, std::vector<std::uint8_t>& use, SolidWork& work) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  std::vector<std::size_t> splinters;
  bool others = false;
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.cell(i, j, k), n = g.node(i, j, k);
        if (!use[c]) continue;
        const double det = static_cast<double>(work.volume_ratio[c]);
        const auto known = [&](std::size_t offset) { return state.valid[n + offset] == kKnown; };
        if (std::max(det, 1.0 / det) > kSplinterGrowth && !std::all_of(corner.begin(), corner.end(), known) &&
            is_splinter(g, use, {i, j, k}))
          splinters.push_back(c);
        else
          others = true;
      }
  if (others) remove_cells(splinters, use, work);
}

void find_elements(const Grid& g, const std::vector<std::uint8_t>& use, SolidWork& work) {
  const auto corner = grid::corner_offsets(g);
  work.element.assign(g.cell_count(), -1);
  work.carries.assign(g.node_count(), 0);
  work.element_cell.clear();
  work.element_corner.clear();
  work.sliver.clear();
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.cell(i, j, k);
        if (!use[c]) continue;
        const std::size_t n = g.node(i, j, k);
        work.element[c] = static_cast<std::int32_t>(work.element_cell.size());
        work.element_cell.push_back(static_cast<std::int32_t>(c));
        work.element_corner.push_back(static_cast<std::int32_t>(n));
        work.sliver.push_back(use[c] == kSliver);
        for (std::size_t offset : corner) work.carries[n + offset] = 1;
      }
}

// An element is as stiff as it is solid, and strained as its solid part is in the middle.
void stiffen_by_part(const Parallel& parallel, const SolidRest& rest, const SolidState& state, SolidWork& work) {
  work.element_factor.clear();
  work.element_middle.clear();
  if (!rest.stiff_by_part) return;
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const geometry::SignedDistance& distance = distance_of(rest, state);
  work.element_factor.resize(work.element_cell.size());
  work.element_middle.assign(work.element_cell.size(), Vec3::Zero());
  parallel.for_each(static_cast<std::int64_t>(work.element_cell.size()), [&](std::int64_t i) {
    const auto e = static_cast<std::size_t>(i);
    const double fraction = static_cast<double>(work.fraction[static_cast<std::size_t>(work.element_cell[e])]);
    work.element_factor[e] = fraction;
    if (!(fraction < 1.0)) return;
    const auto n = static_cast<std::size_t>(work.element_corner[e]);
    Vec3d u[8];
    for (std::size_t a = 0; a < 8; ++a) u[a] = state.u.at(n + corner[a]).cast<double>();
    const Vec3d material = material_in_cell(state, g.node_place(n));
    const Mat3d inverse_f = Mat3d::Identity() - displacement_gradient(u, center_gradients(), g.h);
    const Plane surface = plane_of(distance, material, distance.sample(material) / g.h, inverse_f);
    work.element_middle[e] = (2.0 * grid::plane_cut_centroid(surface.distance, surface.normal)).cast<Real>();
  });
}

// One at the border of a pin deforms in its part outside only, a width theta of a cell, in which all of its strain
// lies: theta psi(F / theta) is about psi(F) / theta.
void stiffen_beside_pins(const Parallel& parallel, const SolidRest& rest, const SolidState& state, SolidWork& work) {
  if (state.shape)
    work.element_factor.assign(work.element_corner.size(), 0.0);  // prescribed deformation meets no resistance
  if (rest.held.empty() || rest.plastic.yields()) return;         // what has yielded is kept by cells
  const Grid& g = state.band.grid;
  work.element_factor.resize(work.element_corner.size(), 1.0);
  parallel.for_each(static_cast<std::int64_t>(work.element_factor.size()), [&](std::int64_t i) {
    const auto e = static_cast<std::size_t>(i);
    const Vec3d X = material_in_cell(state, g.node_place(static_cast<std::size_t>(work.element_corner[e])));
    double out = std::numeric_limits<double>::infinity();
    for (const auto& region : rest.held) out = std::min(out, region->sample(X));
    work.element_factor[e] /= std::clamp(0.5 + out / g.h, kThinnestFree, 1.0);
  });
}

// What corner a of a cell gets of its mass, over what all would get alike: the mass lies where the solid part does. In
// slivers, f below the least part of elements elsewhere, it lies nearer to the middle, since their outer corners would
// have f^2 of the cell's mass.
Real corner_share(const SolidRest& rest, const SolidWork& work, std::size_t c, const int (&a)[3]) {
  if (work.element[c] < 0 || work.element_middle.empty()) return Real(1);
  const Vec3 middle = work.element_middle[static_cast<std::size_t>(work.element[c])] *
                      std::min(Real(1), work.fraction[c] / (rest.element.fraction - rest.element.lag));
  Real share = 1;
  for (int i = 0; i < 3; ++i) share *= Real(1) + (a[i] ? middle[i] : -middle[i]);
  return share;
}

void lump_mass(const Parallel& parallel, const SolidRest& rest, const SolidState& state, SolidWork& work) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  // Mass of a cell per corner that receives it. Slivers whose cells have no such corner weigh nothing of their own.
  std::vector<Real> share(g.cell_count(), 0);
  const double unit = rest.density * g.h * g.h * g.h;
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.cell(i, j, k), n = g.node(i, j, k);
        if (!(work.fraction[c] > 0)) continue;
        int carriers = 0;
        for (std::size_t offset : corner) carriers += work.carries[n + offset];
        if (carriers == 0) continue;
        share[c] = static_cast<Real>(unit * static_cast<double>(work.fraction[c]) /
                                     static_cast<double>(work.volume_ratio[c]) / carriers);
      }
  });
  work.mass.assign(g.node_count(), 0);
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (!work.carries[n]) continue;
        Real sum = 0;
        for (const auto& a : grid::kCorner) {
          const int ci = i - a[0], cj = j - a[1], ck = k - a[2];
          if (ci < 0 || cj < 0 || ck < 0 || ci >= g.cells[0] || cj >= g.cells[1] || ck >= g.cells[2]) continue;
          const std::size_t c = g.cell(ci, cj, ck);
          sum += share[c] * corner_share(rest, work, c, a);
        }
        work.mass[n] = sum;
      }
  });
}

// The elements stand for the whole body in the elastic energy, as their corners do in the mass.
void weigh_elements(const SolidRest& rest, const Grid& g, SolidWork& work) {
  double stiff = 0.0, whole = 0.0;  // their rest volume in cells
  for (std::size_t e = 0; e < work.element_cell.size(); ++e) {
    const auto c = static_cast<std::size_t>(work.element_cell[e]);
    const double volume = 1.0 / static_cast<double>(work.volume_ratio[c]);
    stiff += work.factor(e) * volume;
    if (!work.sliver[e]) whole += volume;
  }
  const double cell = rest.density * g.h * g.h * g.h;
  const auto weight = [&](double cells) {
    return cells > 0.0 ? std::clamp(work.total_mass / (cell * cells), 1.0 / kMostWeight, kMostWeight) : 1.0;
  };
  work.element_weight = weight(stiff);
  work.whole_weight = weight(whole);
}

}  // namespace

void compute_mass(const Parallel& parallel, const SolidRest& rest, const SolidState& state, SolidWork& work) {
  const Grid& g = state.band.grid;
  std::vector<std::uint8_t> use;
  const auto holdings = compute_fractions(parallel, rest, state, use, work);
  remove_cells(find_copies(parallel, g, holdings, use, kPlausibleStretch.most), use, work);
  remove_splinters(state, use, work);
  find_elements(g, use, work);
  stiffen_by_part(parallel, rest, state, work);
  stiffen_beside_cuts(g, work);
  lump_mass(parallel, rest, state, work);
  const auto slab = static_cast<std::size_t>(g.cells[0]) * static_cast<std::size_t>(g.cells[1]);
  work.volume = g.h * g.h * g.h * parallel.sum(g.cells[2], [&](std::int64_t k) {
    double sum = 0.0;
    for (std::size_t c = static_cast<std::size_t>(k) * slab; c < (static_cast<std::size_t>(k) + 1) * slab; ++c)
      sum += static_cast<double>(work.fraction[c]);
    return sum;
  });
  const std::size_t plane = g.node_stride(2);
  work.total_mass = parallel.sum(g.cells[2] + 1, [&](std::int64_t k) {
    double sum = 0.0;
    for (std::size_t n = static_cast<std::size_t>(k) * plane; n < (static_cast<std::size_t>(k) + 1) * plane; ++n)
      sum += static_cast<double>(work.mass[n]);
    return sum;
  });
  work.cell_mass = work.total_mass;
  const double weight = rest.density * rest.mass_volume;
  if (state.whole && work.total_mass > 0.0 && weight > 0.0) {
    const Real factor = static_cast<Real>(weight / work.total_mass);
    for (Real& m : work.mass) m *= factor;
    work.total_mass = weight;
  }
  weigh_elements(rest, g, work);
  stiffen_beside_pins(parallel, rest, state, work);
}

double bulk_weight(const SolidRest& rest, const SolidWork& work, std::size_t e) {
  if (work.sliver[e]) return 0.0;
  if (rest.wet && rest.stiff_by_part) return work.whole_weight;
  return work.element_weight * work.factor(e);
}

void remember_elements(const SolidWork& work, bool lag, SolidState& state) {
  state.stiff.resize(work.element.size());
  const int all = lag ? 0 : kNoLag;
  for (std::size_t c = 0; c < work.element.size(); ++c)
    state.stiff[c] = static_cast<std::uint8_t>(all | (work.owns(c) ? kCarried : 0));
}

void remember_room(const Vec3i& cell, double room, SolidState& state) {
  const Grid& g = state.band.grid;
  Vec3i local;
  for (std::size_t a = 0; a < 3; ++a) {
    local[a] = cell[a] - g.lo[a];
    if (local[a] < 0 || local[a] >= g.cells[a]) return;
  }
  if (state.stiff.empty()) state.stiff.assign(g.cell_count(), kNoLag);
  std::uint8_t& memory = state.stiff[g.cell(local[0], local[1], local[2])];
  memory = static_cast<std::uint8_t>((memory & (kRoomUnit - 1)) | (kRoomUnit * std::lround(kRoomUnits * room)));
}

}  // namespace efsi::solid
