#include "system/pressure_solve.hpp"

#include <algorithm>
#include <cmath>

#include "base/kernel.hpp"
#include "linalg/jacobi.hpp"
#include "linalg/reduce.hpp"

namespace efsi::system {
namespace {

constexpr int kMaxPcrIterations = 500;
// Every solve that can converge needs fewer. More do harm to one that cannot, between no-slip walls: pressures that
// move nothing grow, and their rounding becomes divergence.
constexpr int kMaxMultigridIterations = 100;
constexpr int kMostGradients = 10;     // iterations of conjugate gradients before conjugate residuals take over
constexpr double kHelps = 0.5;         // the last pressure is the start where it leaves less than this residual
constexpr int kAlternatingRounds = 8;  // of taking them out one after the other: the rest is rounding
constexpr double kSolidFloor = 1e-3;   // of the whole right-hand side: less divergence in the solids counts as this

EFSI_KERNEL void subtract_row(int n, Real value, Real* r) {
#pragma omp simd
  for (int i = 0; i < n; ++i) r[i] -= value;
}

}  // namespace

void PressureSystem::assemble(const Parallel& parallel, const Grid& g, const Walls& walls,
                              const std::vector<std::uint8_t>& fixed, const std::vector<Real>& specific_volume,
                              std::vector<std::uint8_t> active, std::vector<std::uint8_t> solid_cell, SlipNodes* slip,
                              bool given, bool sticks, const std::vector<Real>& compliance) {
  slip_ = slip;
  given_ = given;
  sticks_ = sticks;
  if (g.cells != grid_.cells) {  // ghosts lie elsewhere, and those that nobody writes must be zero
    rhs_.clear();
    pcg_ = {};
    pcr_ = {};
  }
  grid_ = g;
  walls_ = walls;
  solid_cells_.clear();
  for (std::size_t c = 0; c < solid_cell.size(); ++c)
    if (solid_cell[c]) solid_cells_.push_back(c);
  multigrid_.build(parallel, g, walls, fixed, specific_volume, std::move(active), slip, compliance);
  if (given_) find_parts(parallel);
}

bool PressureSystem::closed() const {
  return !walls_.any_open() && multigrid_.compliance().empty() && multigrid_.finest().active.empty();
}

void PressureSystem::find_parts(const Parallel& parallel) {
  const PressureLevel& level = multigrid_.finest();
  std::vector<std::uint8_t> moves(grid_.node_count());
  parallel.for_ranges(static_cast<std::int64_t>(moves.size()), [&](std::int64_t begin, std::int64_t end) {
    for (auto n = static_cast<std::size_t>(begin); n < static_cast<std::size_t>(end); ++n)
      moves[n] = level.mobility[n] > 0 && level.fixed[n] != 7;
  });
  if (slip_)
    for (const SlipNode& n : slip_->nodes()) moves[n.node] = 1;
  parts_.find(parallel, level, moves, operator_of(parallel));
}

bool PressureSystem::keep_last(const Parallel& parallel, std::vector<Real>& q) {
  std::vector<Real>& left = pcg_.r;
  left.resize(q.size());
  multigrid_.apply(parallel, q, left);
  linalg::scale_add(parallel, left, -1.0, rhs_);
  const bool helps = linalg::norm(parallel, left) < kHelps * linalg::norm(parallel, rhs_);
  if (!helps) {
    linalg::fill(parallel, q, q.size(), Real(0));
    linalg::copy(parallel, left, rhs_);
  }
  return helps;
}

void PressureSystem::compute_residual(const Parallel& parallel, const VectorField& velocity,
                                      const std::vector<Real>& source, std::vector<Real>& r) {
  compute_flux(parallel, grid_, velocity, source, r);
  if (slip_) slip_->correct_flux(parallel, velocity, r);
  const auto& active = multigrid_.finest().active;
  if (active.empty()) return;
  parallel.for_each(grid_.cells[2], [&](std::int64_t k) {
    for (int j = 0; j < grid_.cells[1]; ++j) {
      const std::size_t row = grid_.padded(0, j, static_cast<int>(k));
      for (std::size_t c = row; c < row + static_cast<std::size_t>(grid_.cells[0]); ++c)
        if (!active[c]) r[c] = 0;
    }
  });
}

DivergenceNorms PressureSystem::set_right_side(const Parallel& parallel, const VectorField& velocity,
                                               const std::vector<Real>& source) {
  compute_residual(parallel, velocity, source, rhs_);
  const DivergenceNorms norms = residual_norms(parallel, rhs_);
  if (walls_.any_moves() || sticks_) subtract_alternating(parallel);
  subtract_means(parallel);
  return norms;
}

void PressureSystem::subtract_means(const Parallel& parallel) {
  if (given_) return parts_.subtract_means(parallel, rhs_);
  if (!closed()) return;
  const Real mean = static_cast<Real>(linalg::sum(parallel, rhs_) / static_cast<double>(grid_.cell_count()));
  parallel.for_each(grid_.cells[2], [&](std::int64_t k) {
    for (int j = 0; j < grid_.cells[1]; ++j)
      subtract_row(grid_.cells[0], mean, rhs_.data() + grid_.padded(0, j, static_cast<int>(k)));
  });
}

void PressureSystem::subtract_alternating(const Parallel& parallel) {
  const auto alternates = [&](std::size_t axis) {
    if (grid_.periodic[axis]) return grid_.cells[axis] % 2 == 0;
    const int a = static_cast<int>(axis);
    return walls_.lower(a) == grid::Wall::kNoSlip && walls_.upper(a) == grid::Wall::kNoSlip;
  };
  const auto& active = multigrid_.finest().active;
  // Where cells have no equation these and the mean are not orthogonal.
  const int rounds = active.empty() ? 1 : kAlternatingRounds;
  for (int round = 0; round < rounds; ++round) {
    if (round > 0) subtract_means(parallel);
    for (std::size_t a = 0; a < 3; ++a)
      if (alternates((a + 1) % 3) && alternates((a + 2) % 3))
        parallel.for_each(grid_.cells[a],
                          [&](std::int64_t layer) { subtract_alternating(a, static_cast<int>(layer), active); });
  }
}

void PressureSystem::subtract_alternating(std::size_t axis, int layer, const std::vector<std::uint8_t>& active) {
  const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  const auto for_cells = [&](const auto& body) {
    Vec3i at{};
    at[axis] = layer;
    for (at[v] = 0; at[v] < grid_.cells[v]; ++at[v])
      for (at[u] = 0; at[u] < grid_.cells[u]; ++at[u]) {
        const std::size_t c = grid_.padded(at[0], at[1], at[2]);
        if (active.empty() || active[c]) body(rhs_[c], (at[u] + at[v]) % 2 ? -1.0 : 1.0);
      }
  };
  double sum = 0.0, count = 0.0;
  for_cells([&](const Real& value, double sign) {
    sum += sign * static_cast<double>(value);
    count += 1.0;
  });
  if (!(count > 0.0)) return;
  const double part = sum / count;
  for_cells([&](Real& value, double sign) { value -= static_cast<Real>(sign * part); });
}

double PressureSystem::solid_norm(const Parallel& parallel, const std::vector<Real>& r) const {
  constexpr std::int64_t kChunk = 4096;
  const auto n = static_cast<std::int64_t>(solid_cells_.size());
  return std::sqrt(parallel.sum((n + kChunk - 1) / kChunk, [&](std::int64_t chunk) {
    double sum = 0.0;
    for (std::int64_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i) {
      const double value = static_cast<double>(r[solid_cells_[static_cast<std::size_t>(i)]]);
      sum += value * value;
    }
    return sum;
  }));
}

DivergenceNorms PressureSystem::residual_norms(const Parallel& parallel, const std::vector<Real>& r) const {
  const double volume = grid_.h * grid_.h * grid_.h;
  return {linalg::norm(parallel, r) / volume, solid_norm(parallel, r) / volume};
}

linalg::Operator PressureSystem::operator_of(const Parallel& parallel) {
  return [this, &parallel](const std::vector<Real>& x, std::vector<Real>& y) {
    multigrid_.apply(parallel, const_cast<std::vector<Real>&>(x), y);  // only the ghosts of x are written
  };
}

linalg::SolveStats PressureSystem::solve_multigrid(const Parallel& parallel, const linalg::SolveOptions& options,
                                                   std::vector<Real>& q) {
  const linalg::Operator apply = operator_of(parallel);
  const linalg::Operator precondition = [&](const std::vector<Real>& r, std::vector<Real>& z) {
    multigrid_.precondition(parallel, r, z);
  };
  const double limit = options.tolerance * (options.reference > 0.0 ? options.reference : linalg::norm(parallel, rhs_));
  // What is left goes elsewhere in time, and stays where nothing is smoothed.
  const linalg::Operator follow = [&](const std::vector<Real>& r, std::vector<Real>& z) {
    multigrid_.focus().follow(parallel, r, limit);
    multigrid_.precondition(parallel, r, z);
  };
  linalg::SolveStats stats;
  // Goes on from q.
  const auto gradients = [&](linalg::SolveOptions part, const linalg::Operator& preconditioner) {
    part.max_iterations = kMostGradients;
    part.min_iterations = std::max(0, part.min_iterations - stats.iterations);
    part.residual_known = true;
    const int before = stats.iterations;
    stats = linalg::pcg(parallel, apply, preconditioner, rhs_, q, part, pcg_);
    stats.iterations += before;
    return stats.converged;
  };
  // Everything first; what the solids ask for beyond that is found by smoothing them alone.
  linalg::SolveOptions everything = options;
  everything.also = nullptr;
  bool converged = gradients(everything, follow);
  multigrid_.focus().widen();
  if (converged && options.also && !options.also(pcg_.r)) {
    multigrid_.focus().follow(solid_cells_);
    converged = gradients(options, precondition);
    multigrid_.focus().widen();
  }
  if (converged) return stats;
  // Between no-slip walls pressures that alternate from cell to cell move next to nothing: the energy of the error is
  // all in them, and its minimum leaves a divergence that does not fall.
  linalg::SolveOptions rest = options;
  rest.max_iterations -= stats.iterations;
  linalg::SolveStats residuals = linalg::pcr(parallel, apply, precondition, rhs_, q, rest, pcr_);
  pcr_ = {};  // seldom needed
  residuals.iterations += stats.iterations;
  return residuals;
}

linalg::SolveStats PressureSystem::solve(const Parallel& parallel, PressureSolver solver, double tolerance,
                                         const DivergenceNorms& before, std::vector<Real>& q) {
  const auto& active = multigrid_.finest().active;
  q.resize(grid_.padded_count());
  if (!active.empty())  // a cell that the solid has left keeps no pressure
    parallel.for_ranges(static_cast<std::int64_t>(q.size()), [&](std::int64_t begin, std::int64_t end) {
      for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c)
        if (!active[c]) q[c] = 0;
    });
  linalg::SolveOptions options;
  options.tolerance = tolerance;
  if (solver == PressureSolver::kPcr) {
    options.max_iterations = kMaxPcrIterations;
    return linalg::pcr(parallel, operator_of(parallel), linalg::jacobi(parallel, multigrid_.finest().inverse_diagonal),
                       rhs_, q, options, pcr_);
  }
  const double volume = grid_.h * grid_.h * grid_.h;
  options.reference = volume * before.all;
  options.max_iterations = kMaxMultigridIterations;
  options.min_iterations = keep_last(parallel, q);  // what a lasting load leaves falls from step to step
  if (!solid_cells_.empty()) {
    // A solid that moves rigidly, as in the first step of most scenes, has nothing to be relative to.
    const double limit = tolerance * volume * std::max(before.solid, kSolidFloor * before.all);
    options.also = [this, &parallel, limit](const std::vector<Real>& r) { return solid_norm(parallel, r) <= limit; };
  }
  return solve_multigrid(parallel, options, q);
}

linalg::SolveStats PressureSystem::estimate(const Parallel& parallel, double tolerance, std::vector<Real>& q) {
  linalg::fill(parallel, q, grid_.padded_count(), Real(0));
  linalg::copy(parallel, pcg_.r, rhs_);
  linalg::SolveOptions options;
  options.tolerance = tolerance;
  options.max_iterations = kMaxMultigridIterations;
  return solve_multigrid(parallel, options, q);
}

double PressureSystem::step_length(const Parallel& parallel, const VectorField& velocity,
                                   const std::vector<Real>& source, const std::vector<Real>& q) {
  std::vector<Real>& left = pcg_.r;
  compute_residual(parallel, velocity, source, left);
  const auto [slope, rest] = linalg::dots(parallel, q, rhs_, left);
  const double drop = slope - rest;
  return slope > 0.0 && drop > 0.0 ? slope / drop : 0.0;
}

void PressureSystem::project(const Parallel& parallel, std::vector<Real>& q, VectorField& velocity) {
  grid::fill_ghosts(grid_, q, Real(0));
  subtract_pressure_gradient(parallel, multigrid_.finest(), q, velocity);
  if (slip_) slip_->subtract_gradient(parallel, q, velocity);
}

DivergenceNorms PressureSystem::norms(const Parallel& parallel, const VectorField& velocity,
                                      const std::vector<Real>& source) {
  compute_residual(parallel, velocity, source, pcg_.r);
  return residual_norms(parallel, pcg_.r);
}

void PressureSystem::exchange_scratch(const std::array<std::vector<Real>*, 5>& arrays) {
  arrays[0]->swap(pcg_.z);
  arrays[1]->swap(pcg_.d);
  arrays[2]->swap(multigrid_.scratch());
  arrays[3]->swap(pcg_.r);
  arrays[4]->swap(pcg_.q);
  for (std::vector<Real>* residual : {&pcg_.r, &pcg_.q}) {  // of both a solve writes the cells, and sums the ghosts
    if (residual->empty()) continue;
    residual->resize(grid_.padded_count());
    grid::clear_ghosts(grid_, *residual);
  }
}

std::size_t PressureSystem::bytes() const {
  return rhs_.size() * sizeof(Real) + parts_.bytes() + solid_cells_.size() * sizeof(std::size_t) + multigrid_.bytes() +
         pcg_.bytes() + pcr_.bytes();
}

}  // namespace efsi::system
