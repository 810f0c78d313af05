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
  Ray(const Parallel& parallel, const std::vector<ContactRow>& rows, const std::vector<Real>& x)
      : parallel_(parallel), rows_(rows), velocity_(rows.size()), change_(rows.size(), Vec3d::Zero()) {
    find_velocities(x, velocity_);
    move(0.0);
  }
  void point(const std::vector<Real>& d) { find_velocities(d, change_); }
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
  void find_velocities(const std::vector<Real>& v, std::vector<Vec3d>& out) const {
    parallel_.for_each(static_cast<std::int64_t>(rows_.size()), [&](std::int64_t n) {
      const auto r = static_cast<std::size_t>(n);
      out[r] = row_velocity(rows_[r], v);
    });
  }

  const Parallel& parallel_;
  const std::vector<ContactRow>& rows_;
  std::vector<Vec3d> velocity_, change_;
  std::vector<RowAct> acts_;
};

// B^T r of what moves, for the few entries that are in a row.
class RowLoad {
 public:
  RowLoad(const std::vector<ContactRow>& rows, const VelocitySystem& system)
      : rows_(rows), system_(system), load_(3 * static_cast<std::size_t>(system.unknowns()), Real(0)) {
    for (const ContactRow& row : rows)
      for (const RowPart& part : row.parts)
        for (std::size_t a = 0; a < 3; ++a) {
          const std::size_t entry = 3 * part.unknown + a;
          if (load_[entry] == 0) entries_.push_back(entry);
          load_[entry] = 1;
        }
    for (const std::size_t entry : system.followed(load_)) {
      if (load_[entry] == 0) entries_.push_back(entry);
      load_[entry] = 1;
    }
  }
  void set(const std::vector<RowAct>& acts) {
    for (const std::size_t entry : entries_) load_[entry] = 0;
    for (std::size_t r = 0; r < rows_.size(); ++r)
      if (acts[r].closed()) add_impulse(rows_[r], acts[r].impulse(rows_[r]), load_);
    system_.fold(entries_, load_);
  }
  double norm() const {
    double sum = 0.0;
    for (const std::size_t entry : entries_)
      sum += static_cast<double>(load_[entry]) * static_cast<double>(load_[entry]);
    return std::sqrt(sum);
  }
  void add_to(std::vector<Real>& f) const {
    for (const std::size_t entry : entries_) f[entry] += load_[entry];
  }

 private:
  const std::vector<ContactRow>& rows_;
  const VelocitySystem& system_;
  std::vector<std::size_t> entries_;
  std::vector<Real> load_;
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
  Ray ray(parallel, rows, x);
  RowLoad load(rows, system);
  std::vector<Real> rest = f, left, before, z, d(f.size(), Real(0)), q;  // rest: f - G x; left: the residual
  system.multiply(parallel, x, q);
  linalg::add_scaled(parallel, rest, -1.0, q);
  system.fold(parallel, rest);
  double residual = 0.0, enough = 0.0;
  // The residual with the impulses of the rows, and the tolerance.
  const auto find_left = [&] {
    load.set(ray.acts());
    enough = std::max(target.least, target.of_impulse * load.norm());
    linalg::copy(parallel, left, rest);
    load.add_to(left);
    residual = linalg::norm(parallel, left);
  };
  find_left();
  double rz = 0.0;
  while (residual > enough && stats.iterations < kMostIterations) {
    // Search direction (Polak-Ribiere); steepest descent where it does not descend.
    if ((iterations + stats.iterations) % kRenew == 0) close_rows(parallel, rows, ray.acts(), system);
    system.precondition(parallel, left, z);
    double next = 0.0, beta = 0.0;
    if (rz > 0.0) {
      const auto [now, last] = linalg::dots(parallel, z, left, before);
      next = now;
      beta = std::max(0.0, (now - last) / rz);
    } else {
      next = linalg::dot(parallel, left, z);
    }
    if (!(linalg::turn(parallel, d, beta, z, left) > 0.0)) linalg::copy(parallel, d, z);
    rz = next;
    // Line search, in which rows open, stick and slide.
    system.apply_bare(parallel, d, q);
    const auto [start, slope] = linalg::dots(parallel, d, rest, q);
    system.follow_ties(d);
    ray.point(d);
    const double t = way(ray, start, slope);
    linalg::advance(parallel, t, d, q, x, rest);
    system.leave_ties(d);
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
