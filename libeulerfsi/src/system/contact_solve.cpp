#include "system/contact_solve.hpp"

#include <algorithm>
#include <cmath>

#include "linalg/reduce.hpp"
#include "system/contact_descent.hpp"

namespace efsi::system {
namespace {

constexpr double kStiff = 3.0;      // of a penalty, over the inverse of the mobility of its row by the diagonal of G
constexpr int kMostUpdates = 25;    // of the impulses
constexpr double kLooser = 30.0;    // the tolerance of the first update; half of it in the next, and so on
constexpr double kOfImpulse = 0.1;  // of the contact impulses, to which the tolerance refers at least
constexpr double kFiner = 0.3;      // of the tolerance, where an update met it from the start
constexpr double kSettled = 1e-3;   // change of the impulses in an update, over the largest

// What the rows start with: penalties, and impulses that they may have.
void prepare(const VelocitySystem& system, std::vector<ContactRow>& rows) {
  for (ContactRow& row : rows) {
    double mobility = 0.0;
    for (const RowPart& part : row.parts)
      mobility += static_cast<double>(part.weight * part.weight) * system.mobility(part.unknown);
    row.penalty = mobility > 0.0 ? kStiff / mobility : 0.0;
    if (row.penalty == 0.0) row.normal_impulse = 0.0;
    row.friction_impulse -= row.normal.dot(row.friction_impulse) * row.normal;
    const double limit = row.friction * row.normal_impulse, length = row.friction_impulse.norm();
    if (length > limit) row.friction_impulse *= limit / length;
  }
}

// Takes up in the impulses what the penalties have done. Whether that is settled: a small part of the largest impulse,
// or what leads two surfaces into each other, or along each other where they stick, at less than `negligible`.
bool update(const std::vector<Real>& x, double negligible, std::vector<ContactRow>& rows) {
  double change = 0.0, largest = 0.0;
  PairMotion motion;
  for (ContactRow& row : rows) {
    if (!(row.penalty > 0.0)) continue;
    const RowAct next = act(row, row_velocity(row, x));
    const Vec3d before = row.impulse();
    row.normal_impulse = next.normal_impulse;
    row.friction_impulse = next.friction_impulse;
    row.sticks = next.share == 1.0;
    const double changed = (row.impulse() - before).norm(), impulse = row.impulse().norm();
    change = std::max(change, changed);
    largest = std::max(largest, impulse);
    motion.add(row, std::max(impulse, before.norm()), changed / row.penalty);
  }
  return motion.largest() <= negligible || change <= kSettled * largest;
}

// |f + B^T r - G x| of what moves, r the impulses that the rows have.
double first_residual(const Parallel& parallel, const std::vector<Real>& f, const std::vector<Real>& x,
                      const std::vector<ContactRow>& rows, VelocitySystem& system) {
  std::vector<Real> loaded = f;
  add_impulses(rows, loaded);
  return system.residual(parallel, loaded, x);
}

}  // namespace

linalg::SolveStats solve_contact(const Parallel& parallel, VelocitySolver solver, const std::vector<Real>& f,
                                 double tolerance, double negligible, VelocitySystem& system,
                                 std::vector<ContactRow>& rows, std::vector<Real>& x) {
  if (rows.empty()) return system.solve(parallel, solver, f, x, tolerance);
  system.set_penalties(parallel, {});
  prepare(system, rows);
  system.follow_ties(x);
  Target target{std::max(tolerance * first_residual(parallel, f, x, rows, system), system.rounding(parallel, x)),
                tolerance * kOfImpulse};
  linalg::SolveStats stats;
  bool settled = false;
  double looser = kLooser;
  for (int outer = 0; outer < kMostUpdates && !settled; ++outer) {
    const linalg::SolveStats descent =
        descend(parallel, f, {looser * target.least, looser * target.of_impulse}, rows, stats.iterations, system, x);
    stats.iterations += descent.iterations;
    stats.converged = descent.converged;
    stats.residual = tolerance * descent.residual;
    settled = update(x, negligible, rows);
    const bool exact = looser == 1.0;
    // Impulses that change while no unknown does: what the tolerance leaves is more than what they need.
    if (descent.iterations == 0 && exact) target.least *= kFiner, target.of_impulse *= kFiner;
    looser = settled ? 1.0 : std::max(1.0, 0.5 * looser);
    settled = settled && exact;
  }
  stats.converged = stats.converged && settled;
  // Under the pressure the impulses are not recomputed: only the penalties respond.
  close_rows(parallel, rows, acts(rows, x), system, true);
  return stats;
}

}  // namespace efsi::system
