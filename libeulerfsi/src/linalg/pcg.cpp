#include "linalg/pcg.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "linalg/reduce.hpp"

namespace efsi::linalg {
namespace {

constexpr int kBestInterval = 8;                                          // iterations
constexpr double kRounding = 8.0 * std::numeric_limits<Real>::epsilon();  // of |b|: a residual below is noise

}  // namespace

SolveStats pcg(const Parallel& parallel, const Operator& apply, const Operator& precondition,
               const std::vector<Real>& b, std::vector<Real>& x, const SolveOptions& options, PcgWorkspace& work) {
  const std::size_t n = b.size();
  for (auto* v : {&work.r, &work.z, &work.d, &work.q}) v->resize(n);
  auto &r = work.r, &z = work.z, &d = work.d, &q = work.q, &best = work.best;

  // A right-hand side that is zero or not finite needs no iteration.
  SolveStats stats;
  const double b_norm = norm(parallel, b);
  if (b_norm == 0.0) {
    x.assign(n, 0);
    return stats;
  }
  if (!std::isfinite(b_norm)) {
    x.assign(n, 0);
    stats.residual = b_norm;
    stats.converged = false;
    return stats;
  }
  // The stopping criterion.
  double reference = options.reference > 0.0 ? options.reference : b_norm;
  const auto done = [&](double r_norm) {
    stats.residual = r_norm / reference;
    return stats.iterations >= options.min_iterations && stats.residual <= options.tolerance &&
           (!options.also || options.also(r));
  };

  // r = b - A x
  if (!options.residual_known) {
    copy(parallel, r, b);
    if (dot(parallel, x, x) > 0.0) {
      apply(x, q);
      add_scaled(parallel, r, -1.0, q);
    }
  }
  const double start = norm(parallel, r);
  if (options.against_start)
    reference = std::max({start, kRounding * b_norm / options.tolerance, options.least / options.tolerance});
  if (done(start)) return stats;
  // The best iterate of a long solve, looked at now and then: b may lie outside the range of A.
  double best_residual = std::numeric_limits<double>::infinity();
  precondition(r, d);
  double rz = dot(parallel, r, d);
  while (stats.iterations < options.max_iterations) {
    apply(d, q);
    const double dq = dot(parallel, d, q);
    if (!(dq > 0.0) || !std::isfinite(dq)) break;
    const double alpha = rz / dq;
    const double r_square = advance(parallel, alpha, d, q, x, r);
    ++stats.iterations;
    if (done(std::sqrt(r_square))) return stats;
    if (stats.iterations % kBestInterval == 0 && stats.residual < best_residual) {
      copy(parallel, best, x);
      best_residual = stats.residual;
    }
    precondition(r, z);
    const auto [rz_new, qz] = dots(parallel, z, r, q);
    const double beta = -alpha * qz / rz;  // Polak-Ribiere: the residual has changed by -alpha q
    if (!(rz_new > 0.0) || !std::isfinite(beta)) break;
    scale_add(parallel, d, beta, z);
    rz = rz_new;
  }
  // Not converged: return the best iterate.
  if (!(stats.residual <= best_residual) && best_residual < std::numeric_limits<double>::infinity()) {
    copy(parallel, x, best);
    stats.residual = best_residual;
  }
  stats.converged = false;
  return stats;
}

}  // namespace efsi::linalg
