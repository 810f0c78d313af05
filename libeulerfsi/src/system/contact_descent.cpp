#include "system/contact_descent.hpp"

#include <algorithm>
#include <cmath>

#include "linalg/reduce.hpp"

namespace efsi::system {
namespace {

constexpr int kMostIterations = 1000;
constexpr int kRenew = 8;        // iterations after which the preconditioner is that of what is closed then
constexpr int kMostTrials = 20;  // of a line search
constexpr double kDescended =
    1e-2;  // line search: directional derivative left at its end, relative to that at its start

// The rows along x + t d.
class Ray {
 public:
  Ray(const std::vector<ContactRow>& rows, const std::vector<Real>& x)
      : rows_(rows), change_(rows.size(), Vec3d::Zero()) {
    for (const ContactRow& row : rows) velocity_.push_back(row_velocity(row, x));
    move(0.0);
  }
  void point(const std::vector<Real>& d) {
    for (std::size_t r = 0; r < rows_.size(); ++r) change_[r] = row_velocity(rows_[r], d);
  }
  // d.B^T r there.
  double force(double t) const {
    double sum = 0.0;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      const RowAct a = act(rows_[r], velocity_[r] + t * change_[r]);
      sum += change_[r].dot(a.impulse(rows_[r]));
    }
    return sum;
  }
  // What that falls by with t while no row opens, closes or slips.
  double stiffness() const {
    double sum = 0.0;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      if (!acts_[r].closed()) continue;
      const double along = rows_[r].normal.dot(change_[r]);
      sum += rows_[r].penalty * (along * along + acts_[r].share * (change_[r].squaredNorm() - along * along));
    }
    return sum;
  }
  void move(double t) {
    acts_.clear();
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      velocity_[r] += t * change_[r];
      acts_.push_back(act(rows_[r], velocity_[r]));
    }
  }
  const std::vector<RowAct>& acts() const { return acts_; }

 private:
  const std::vector<ContactRow>& rows_;
  std::vector<Vec3d> velocity_, change_;
  std::vector<RowAct> acts_;
};

// Line search along d to a zero of the directional derivative; that of the system falls from `start` by `slope` t.
double way(const Ray& ray, double start, double slope) {
  const auto force = [&](double t) { return start - t * slope + ray.force(t); };
  const double first = force(0.0);
  double low = 0.0, high = first / (slope + ray.stiffness()), at_low = first, at_high = force(high);
  for (int i = 0; i < kMostTrials && at_high > kDescended * first;
       ++i) {  // rows have opened along the search direction
    low = high;
    at_low = at_high;
    high *= 2.0;
    at_high = force(high);
  }
  // Regula falsi; an end that stays counts half.
  for (int i = 0; i < kMostTrials && at_high < -kDescended * first; ++i) {
    const double t = low + (high - low) * at_low / (at_low - at_high), at = force(t);
    if (at < 0.0) {
      high = t;
      at_high = at;
      at_low *= 0.5;
    } else {
      if (at <= kDescended * first) return t;
      low = t;
      at_low = at;
      at_high *= 0.5;
    }
  }
  return high;
}

}  // namespace

linalg::SolveStats descend(const Parallel& parallel, const std::vector<Real>& f, const Target& target,
                           const std::vector<ContactRow>& rows, int iterations, VelocitySystem& system,
                           std::vector<Real>& x) {
  // The forces without contact, updated along with x.
  linalg::SolveStats stats;
  system.follow_ties(x);
  Ray ray(rows, x);
  std::vector<Real> rest = f, contact_load, left, before, z, d, whole, q;  // rest: f - G x; left: the residual
  system.multiply(parallel, x, q);
  linalg::add_scaled(parallel, rest, -1.0, q);
  system.fold(parallel, rest);
  double residual = 0.0, enough = 0.0;
  // The residual with the impulses of the rows, and the tolerance.
  const auto find_left = [&] {
    linalg::fill(parallel, contact_load, f.size(), Real(0));
    for (std::size_t r = 0; r < rows.size(); ++r) {
      const RowAct& a = ray.acts()[r];
      if (a.closed()) add_impulse(rows[r], a.impulse(rows[r]), contact_load);
    }
    system.fold(parallel, contact_load);
    enough = std::max(target.least, target.of_impulse * linalg::norm(parallel, contact_load));
    linalg::copy(parallel, left, rest);
    linalg::add_scaled(parallel, left, 1.0, contact_load);
    residual = linalg::norm(parallel, left);
  };
  find_left();
  double rz = 0.0;
  while (residual > enough && stats.iterations < kMostIterations) {
    // Search direction (Polak-Ribiere); steepest descent where it does not descend.
    if ((iterations + stats.iterations) % kRenew == 0) close_rows(parallel, rows, ray.acts(), system);
    system.precondition(parallel, left, z);
    const double next = linalg::dot(parallel, left, z);
    const double beta = rz > 0.0 ? std::max(0.0, (next - linalg::dot(parallel, before, z)) / rz) : 0.0;
    if (beta > 0.0) linalg::scale_add(parallel, d, beta, z);
    if (!(beta > 0.0) || !(linalg::dot(parallel, d, left) > 0.0)) linalg::copy(parallel, d, z);
    rz = next;
    // Line search, in which rows open, stick and slide.
    system.apply_bare(parallel, d, q);
    linalg::copy(parallel, whole, d);
    system.follow_ties(whole);
    ray.point(whole);
    const double t = way(ray, linalg::dot(parallel, d, rest), linalg::dot(parallel, d, q));
    linalg::add_scaled(parallel, x, t, whole);
    linalg::add_scaled(parallel, rest, -t, q);
    ray.move(t);
    std::swap(before, left);
    find_left();
    ++stats.iterations;
  }
  stats.converged = residual <= enough;
  stats.residual = enough > 0.0 ? residual / enough : 0.0;
  return stats;
}

}  // namespace efsi::system
