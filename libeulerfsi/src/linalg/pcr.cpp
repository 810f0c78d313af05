#include "linalg/pcr.hpp"

#include <cmath>

#include "linalg/reduce.hpp"

namespace efsi::linalg {

SolveStats pcr(const Parallel& parallel, const Operator& apply, const Operator& precondition,
               const std::vector<Real>& b, std::vector<Real>& x, const SolveOptions& options, PcrWorkspace& work) {
  const std::size_t n = b.size();
  for (auto* v : {&work.r, &work.z, &work.p, &work.az, &work.ap, &work.mp}) v->resize(n);
  auto &r = work.r, &z = work.z, &p = work.p, &az = work.az, &ap = work.ap, &mp = work.mp;

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
  // r = b - A x, and the stopping criterion.
  apply(x, az);
  r = b;
  add_scaled(parallel, r, -1.0, az);
  const double reference = options.reference > 0.0 ? options.reference : b_norm;
  const auto done = [&] {
    stats.residual = norm(parallel, r) / reference;
    return stats.iterations >= options.min_iterations && stats.residual <= options.tolerance &&
           (!options.also || options.also(r));
  };
  if (done()) return stats;
  // The first search direction; ap = A p and az = A z are kept instead of multiplied anew.
  precondition(r, z);
  p = z;
  apply(z, az);
  ap = az;
  double zaz = dot(parallel, z, az);
  while (stats.iterations < options.max_iterations) {
    precondition(ap, mp);
    const double denominator = dot(parallel, ap, mp);
    if (!(denominator > 0.0) || !(zaz > 0.0) || !std::isfinite(zaz)) break;
    const double alpha = zaz / denominator;
    add_scaled(parallel, x, alpha, p);
    add_scaled(parallel, r, -alpha, ap);
    add_scaled(parallel, z, -alpha, mp);
    ++stats.iterations;
    if (done()) return stats;
    apply(z, az);
    const double zaz_new = dot(parallel, z, az);
    const double beta = zaz_new / zaz;
    scale_add(parallel, p, beta, z);
    scale_add(parallel, ap, beta, az);
    zaz = zaz_new;
  }
  stats.converged = false;
  return stats;
}

}  // namespace efsi::linalg
