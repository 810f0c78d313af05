#include "system/pressure_multigrid.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/kernel.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "system/films.hpp"
#include "system/pressure_transfer.hpp"

namespace efsi::system {
namespace {

constexpr int kCoarsestCells = 6;            // coarsen while every axis has more cells than this
constexpr std::size_t kSerialCells = 27000;  // a level of no more cells is faster on one thread
constexpr int kCoarsestSteps = 4;            // of smoothing on the coarsest level, per cell along its longest axis,
constexpr int kMostCoarsestSteps = 64;       // and in all at most
constexpr double kCoarsestRange = 5.0;       // largest over smallest of its spectrum, per square of that number

// Chebyshev smoothing: Jacobi steps whose weights make a polynomial that is small on [largest / range, largest] of the
// spectrum of D^-1 A, which for uniform density reaches 8/3 on the finest level and 2 on the others.
constexpr Real chebyshev(double root, double largest, double range) {
  return static_cast<Real>(2.0 / (largest * ((1.0 + 1.0 / range) + (1.0 - 1.0 / range) * root)));
}
template <std::size_t Degree>
constexpr std::array<Real, Degree> chebyshev(const std::array<double, Degree>& roots, double largest, double range) {
  std::array<Real, Degree> weights{};
  for (std::size_t i = 0; i < Degree; ++i) weights[i] = chebyshev(roots[i], largest, range);
  return weights;
}
// cos((2 i + 1) pi / (2 n)), in an order that keeps rounding small; library cosines differ between machines.
constexpr std::array<double, 3> kRoots3 = {0.86602540378443865, 0.0, -0.86602540378443865};
constexpr std::array<double, 8> kRoots8 = {0.98078528040323045,  -0.98078528040323045, 0.19509032201612827,
                                           -0.19509032201612827, 0.83146961230254524,  -0.83146961230254524,
                                           0.55557023301960222,  -0.55557023301960222};
constexpr double kLargestFine = 2.8, kLargest = 2.0;  // of the spectrum
constexpr std::array<Real, 3> kEverywhere = chebyshev(kRoots3, kLargestFine, 16.0);
constexpr std::array<Real, 8> kInFocus = chebyshev(kRoots8, kLargestFine, 64.0);  // few cells, among them hard ones
constexpr std::array<Real, 3> kCoarse = chebyshev(kRoots3, kLargest, 8.0);

// Weights for a level that has no coarser one and is solved by them: of a degree 2^n that reaches its longest wave, of
// which a quarter fits between a closed wall and an open one.
std::vector<Real> coarsest_weights(const Grid& g, double largest) {
  const int longest = *std::max_element(g.cells.begin(), g.cells.end());
  const auto degree = static_cast<std::size_t>(std::min(kCoarsestSteps * longest, kMostCoarsestSteps));
  std::vector<double> roots = {0.0};
  while (roots.size() < degree) {  // by half of the angle, in the order of Lebedev and Finogenov
    std::vector<double> twice;
    for (const double root : roots) {
      const double half = std::sqrt(0.5 * (1.0 + root));
      twice.insert(twice.end(), {half, -half});
    }
    roots = std::move(twice);
  }
  std::vector<Real> weights;
  for (const double root : roots) weights.push_back(chebyshev(root, largest, kCoarsestRange * longest * longest));
  return weights;
}

// mobility = (h^2/4)^2 / m with m = density h^3 (adjacent cells) / 8.
void set_mobility(const Parallel& parallel, const std::vector<Real>& specific_volume, PressureLevel& level) {
  const Grid& g = level.grid;
  level.mobility.resize(g.node_count());
  const auto cells = [&](std::size_t axis, int index) {  // adjacent along one axis
    return g.periodic[axis] || (index > 0 && index < g.cells[axis]) ? 2.0 : 1.0;
  };
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk), n = g.cells[0];
    for (int j = 0; j <= g.cells[1]; ++j) {
      const double scale = g.h / 2.0 / (cells(1, j) * cells(2, k));
      const Real inner = static_cast<Real>(scale / 2.0), end = static_cast<Real>(scale / cells(0, 0));
      const Real* volume = specific_volume.data() + g.node(0, j, k);
      Real* out = level.mobility.data() + g.node(0, j, k);
#pragma omp simd
      for (int i = 1; i < n; ++i) out[i] = inner * volume[i];
      out[0] = end * volume[0];
      out[n] = end * volume[n];
    }
  });
}

bool can_coarsen(const Grid& g, int slab) {
  for (std::size_t a = 0; a < 3; ++a)
    if (static_cast<int>(a) == slab)
      continue;  // its one cell stays
    else if (g.cells[a] <= kCoarsestCells || (g.periodic[a] && g.cells[a] % 2 != 0))
      return false;
  return true;
}

Grid coarsen(const Grid& fine) {
  Grid coarse = fine;
  for (std::size_t a = 0; a < 3; ++a) coarse.cells[a] = (fine.cells[a] + 1) / 2;
  coarse.h = 2.0 * fine.h;
  return coarse;
}

// A coarse cell has an equation when one of its children has; of an odd number of cells every second one is a child of
// both beside it.
void coarsen_active(const PressureGrid& fine, PressureGrid& coarse) {
  coarse.active.clear();
  if (fine.active.empty()) return;
  coarse.active.assign(coarse.grid.padded_count(), 0);
  const Vec3i& n = fine.grid.cells;
  const auto last = [&](std::size_t axis, int index) {
    return !fine.grid.periodic[axis] && n[axis] % 2 != 0 ? (index + 1) / 2 : index / 2;
  };
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) {
        if (!fine.active[fine.grid.padded(i, j, k)]) continue;
        for (const int c : {k / 2, last(2, k)})
          for (const int b : {j / 2, last(1, j)})
            for (const int a : {i / 2, last(0, i)}) coarse.active[coarse.grid.padded(a, b, c)] = 1;
      }
}

}  // namespace

void PressureMultigrid::build(const Parallel& parallel, const Grid& g, const Walls& walls,
                              const std::vector<std::uint8_t>& fixed, const std::vector<Real>& specific_volume,
                              std::vector<std::uint8_t> active, const SlipNodes* slip,
                              const std::vector<Real>& compliance) {
  slip_ = slip;
  if (g.cells != finest_.grid.cells) {  // ghosts lie elsewhere, and those that nobody writes must be zero
    finest_.inverse_diagonal.clear();
    coarse_.clear();
  }
  finest_.grid = g;
  finest_.walls = walls;
  finest_.fixed = fixed;
  finest_.active = std::move(active);
  set_mobility(parallel, specific_volume, finest_);
  compute_pressure_diagonal(parallel, finest_);
  if (slip_ && !slip_->empty()) {
    std::vector<Real>& d = finest_.inverse_diagonal;
    const std::vector<std::uint8_t>& on = finest_.active;
    slip_->for_smoother_terms(parallel, [&](std::size_t c, Real value) {
      // With d = 0 nothing but what slips along given motion moves at the corners of a cell.
      const Real sum = (d[c] > 0 ? 1 / d[c] : Real(0)) + value;
      if (sum > 0 && (on.empty() || on[c])) d[c] = 1 / sum;
    });
  }
  compliance_.set(compliance, finest_);
  compliance_.add_to_diagonal(finest_.inverse_diagonal);
  build_coarse(parallel, specific_volume, compliance);
  coarsest_ = coarse_.empty() ? coarsest_weights(g, kLargestFine) : coarsest_weights(coarse_.back().op.grid, kLargest);
  focus_.reset(g, bound_tiles());
}

void PressureMultigrid::build_coarse(const Parallel& parallel, const std::vector<Real>& specific_volume,
                                     const std::vector<Real>& compliance) {
  std::vector<Real> fine_compliance = compliance, coarse_compliance;
  std::size_t count = 0;
  const int slab = grid::slab_axis(finest_.grid, finest_.walls);
  for (Grid g = finest_.grid; can_coarsen(g, slab); g = coarsen(g)) ++count;
  coarse_.resize(count);
  std::vector<Real> with_films;
  if (slip_ && (slip_->between_solids() || slip_->any_free())) {
    with_films = specific_volume;
    open_films(parallel, finest_.grid, *slip_, with_films);
  }
  const std::vector<Real>& finest = with_films.empty() ? specific_volume : with_films;
  for (std::size_t l = 0; l < count; ++l) {
    const PressureGrid& fine = l > 0 ? static_cast<const PressureGrid&>(coarse_[l - 1].op) : finest_;
    CoarseLevel& level = coarse_[l];
    const Grid grid = coarsen(fine.grid);
    if (level.op.grid.cells != grid.cells || level.x.empty())
      for (auto* field : {&level.x, &level.b, &level.other}) field->assign(grid.padded_count(), 0);
    level.op.grid = grid;
    level.op.walls = fine.walls;
    for (int a = 0; a < 3; ++a) {  // in half of the finer cells; of an odd number the outer one keeps its place
      const auto s = static_cast<std::size_t>(a);
      const double length = fine.grid.cells[s] % 2 != 0 ? fine.outer[s] + 0.5 : fine.outer[s] + 1.0;
      level.op.outer[s] = a == slab ? 1.0 : 0.5 * length;
    }
    coarsen_specific_volume(parallel, fine.grid, l > 0 ? coarse_[l - 1].specific_volume : finest, grid,
                            level.specific_volume);
    coarsen_active(fine, level.op);
    build_coarse_pressure(parallel, level.specific_volume, level.op);
    level.compliance = {};
    if (compliance_.empty()) continue;
    coarse_compliance.assign(grid.padded_count(), 0);  // P^T D P by the sums of its rows
    restrict_residual(parallel, fine, fine_compliance, level.op, coarse_compliance);
    level.compliance.set(coarse_compliance, level.op);
    level.compliance.add_to_diagonal(level.op.inverse_diagonal);
    std::swap(fine_compliance, coarse_compliance);
  }
}

void PressureMultigrid::apply(const Parallel& parallel, std::vector<Real>& x, std::vector<Real>& y) {
  grid::fill_ghosts(finest_.grid, x, Real(0));
  apply_pressure_operator(parallel, finest_, x, y);
  add_rest(parallel, x, Real(1), y);
}

std::span<const Real> PressureMultigrid::weights() const {
  if (coarse_.empty()) return coarsest_;
  return focus_.everywhere() ? std::span<const Real>(kEverywhere) : std::span<const Real>(kInFocus);
}

void PressureMultigrid::smooth(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x,
                               std::size_t step) {
  grid::fill_periodic_ghosts(finest_.grid, x);
  const Real weight = weights()[step];
  if (slip_) slip_->excess(parallel, x, excess_);  // of x before the step
  if (!compliance_.empty()) compliance_.multiply(parallel, x, given_);
  if (focus_.everywhere()) {
    smooth_pressure(parallel, finest_, b, weight, x);
  } else {
    relax_in_boxes(parallel, finest_, focus_.smoothed(), b, weight, x, residual_);
    std::swap(x, residual_);
  }
  if (slip_)
    slip_->for_terms(parallel, excess_,
                     [&](std::size_t c, Real value) { x[c] -= weight * finest_.inverse_diagonal[c] * value; });
  if (!compliance_.empty()) compliance_.relax(parallel, weight, finest_.inverse_diagonal, given_, x);
}

void PressureMultigrid::add_rest(const Parallel& parallel, const std::vector<Real>& x, Real sign,
                                 std::vector<Real>& y) {
  if (!compliance_.empty()) compliance_.add(parallel, sign, x, y);
  if (!slip_) return;
  const auto& active = finest_.active;
  slip_->excess(parallel, x, excess_);
  slip_->for_terms(parallel, excess_, [&](std::size_t c, Real value) {
    if (active.empty() || active[c]) y[c] += sign * value;
  });
}

grid::TileMask PressureMultigrid::bound_tiles() const {
  const Grid& g = finest_.grid;
  grid::TileMask mask(g.cells);
  for (std::int64_t t = 0; coarse_.empty() && t < mask.count(); ++t) mask.set(t, true);
  if (slip_)
    for (const SlipNode& n : slip_->nodes())
      for (const auto& c : grid::kCorner) {
        const auto tile = [&](int node, int corner, std::size_t axis) {
          return std::clamp(node - corner, 0, g.cells[axis] - 1) / grid::kTileSize;
        };
        mask.set(mask.at({tile(n.i, c[0], 0), tile(n.j, c[1], 1), tile(n.k, c[2], 2)}), true);
      }
  mark_tiles(g, compliance_.cells(), mask);
  return mask;
}

void PressureMultigrid::smooth_from_zero(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x) {
  if (focus_.everywhere()) {
    linalg::multiply(parallel, x, finest_.inverse_diagonal, b, weights()[0]);
    return;
  }
  for (auto* field : {&x, &residual_}) linalg::fill(parallel, *field, b.size(), Real(0));
  relax_from_zero(parallel, finest_, focus_.smoothed(), b, weights()[0], x);
}

void PressureMultigrid::leave_residual(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x) {
  grid::fill_periodic_ghosts(finest_.grid, x);
  if (focus_.everywhere()) {
    apply_pressure_operator(parallel, finest_, x, residual_, &b);
  } else {
    parallel.for_ranges(static_cast<std::int64_t>(b.size()), [&](std::int64_t begin, std::int64_t end) {
      std::copy(b.begin() + begin, b.begin() + end, residual_.begin() + begin);
    });
    residual_in_boxes(parallel, finest_, focus_.reached(), b, x, residual_);
  }
  add_rest(parallel, x, Real(-1), residual_);
}

void PressureMultigrid::coarse_cycle(const Parallel& every, std::size_t l) {
  CoarseLevel& level = coarse_[l];
  const Grid& g = level.op.grid;
  const Parallel& parallel = g.cell_count() <= kSerialCells ? serial_ : every;
  const auto smooth_once = [&](Real weight) {
    grid::fill_periodic_ghosts(g, level.x);
    smooth_coarse(parallel, level.op, level.b, weight, level.x, level.other);
    if (!level.compliance.empty()) {
      level.compliance.multiply(parallel, level.x, given_);
      level.compliance.relax(parallel, weight, level.op.inverse_diagonal, given_, level.other);
    }
    std::swap(level.x, level.other);
  };
  const bool last = l + 1 == coarse_.size();
  const std::span<const Real> weights = last ? std::span<const Real>(coarsest_) : std::span<const Real>(kCoarse);
  linalg::multiply(parallel, level.x, level.op.inverse_diagonal, level.b, weights[0]);  // a step from zero
  for (const Real weight : weights.subspan(1)) smooth_once(weight);
  if (last) return;
  grid::fill_periodic_ghosts(g, level.x);
  coarse_residual(parallel, level.op, level.b, level.x, level.other);
  if (!level.compliance.empty()) level.compliance.add(parallel, Real(-1), level.x, level.other);
  CoarseLevel& next = coarse_[l + 1];
  restrict_residual(parallel, level.op, level.other, next.op, next.b);
  coarse_cycle(every, l + 1);
  prolong_and_add(parallel, next.op, next.x, level.op, level.x);
  for (std::size_t i = weights.size(); i-- > 0;) smooth_once(weights[i]);
}

void PressureMultigrid::precondition(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z) {
  z.resize(r.size());
  residual_.resize(r.size());
  smooth_from_zero(parallel, r, z);
  for (std::size_t i = 1; i < weights().size(); ++i) smooth(parallel, r, z, i);
  if (coarse_.empty()) return;
  leave_residual(parallel, r, z);
  restrict_residual(parallel, finest_, residual_, coarse_[0].op, coarse_[0].b);
  coarse_cycle(parallel, 0);
  prolong_and_add(parallel, coarse_[0].op, coarse_[0].x, finest_, z);
  if (!focus_.everywhere())
    copy_in_boxes(parallel, finest_.grid, focus_.reached(), z, residual_);  // outside the focus the same
  for (std::size_t i = weights().size(); i-- > 0;) smooth(parallel, r, z, i);
}

std::size_t PressureMultigrid::bytes() const {
  std::size_t reals = residual_.size() + finest_.mobility.size() + finest_.inverse_diagonal.size();
  std::size_t total = finest_.active.size() + compliance_.bytes();
  for (const CoarseLevel& level : coarse_) {
    reals += level.x.size() + level.b.size() + level.other.size() + level.specific_volume.size() +
             level.op.inverse_diagonal.size();
    for (const auto& face : level.op.face) reals += face.size();
    total += level.op.active.size() + level.compliance.bytes();
  }
  return total + reals * sizeof(Real);
}

}  // namespace efsi::system
