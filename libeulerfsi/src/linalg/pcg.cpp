#include "linalg/pcg.hpp"

#include <cmath>

#include "linalg/reduce.hpp"

namespace efsi::linalg {
namespace {

constexpr int kBestInterval = 8;  // iterations

}  // namespace

SolveStats pcg(const Parallel& parallel, const Operator& apply, const Operator& precondition,
               const std::vector<Real>& b, std::vector<Real>& x, const SolveOptions& options, PcgWorkspace& work) {
  const std::size_t n = b.size();
  for (auto* v : {&work.r, &work.z, &work.d, &work.q, &work.r_old, &work.best}) v->resize(n);
  auto& [r, z, d, q, r_old, best] = work;

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
  const auto done = [&] {
    stats.residual = norm(parallel, r) / b_norm;
    return stats.residual <= options.tolerance && (!options.also || options.also(r));
  };

  // r = b - A x
  apply(x, q);
  r = b;
  add_scaled(parallel, r, -1.0, q);
  if (done()) return stats;
  // The best iterate so far, looked at now and then: b may lie outside the range of A.
  best = x;
  double best_residual = stats.residual;
  precondition(r, z);
  d = z;
  double rz = dot(parallel, r, z);
  while (stats.iterations < options.max_iterations) {
    apply(d, q);
    const double dq = dot(parallel, d, q);
    if (!(dq > 0.0) || !std::isfinite(dq)) break;
    const double alpha = rz / dq;
    add_scaled(parallel, x, alpha, d);
    r_old = r;
    add_scaled(parallel, r, -alpha, q);
    ++stats.iterations;
    if (done()) return stats;
    if (stats.iterations % kBestInterval == 0 && stats.residual < best_residual) {
      best = x;
      best_residual = stats.residual;
    }
    precondition(r, z);
    const double rz_new = dot(parallel, r, z);
    const double beta = (rz_new - dot(parallel, r_old, z)) / rz;  // Polak-Ribiere
    if (!(rz_new > 0.0) || !std::isfinite(beta)) break;
    scale_add(parallel, d, beta, z);
    rz = rz_new;
  }
  if (!(stats.residual <= best_residual)) {
    x = best;
    stats.residual = best_residual;
  }
  stats.converged = false;
  return stats;
}

}  // namespace efsi::linalg
