#include "system/contact_solve.hpp"

#include <algorithm>
#include <cmath>

#include "linalg/reduce.hpp"

namespace efsi::system {
namespace {

constexpr double kStiff = 3.0;      // of a penalty, over the inverse of the mobility of its row by the diagonal of G
constexpr int kMostOuter = 20;      // updates of the impulses
constexpr int kMostNewton = 8;      // steps between two of them
constexpr double kSettled = 1e-3;   // change of the impulses in an update, over the largest
constexpr double kSameShare = 0.2;  // change of a share of friction that is of no account between two updates
constexpr double kDescends = 1e-3;  // slope at the end of a step over that at its start: no line search

// The largest vector along v that is no longer than `limit`.
Vec3d shorten(const Vec3d& v, double limit) {
  const double length = v.norm();
  return length > limit ? Vec3d(v * (limit / length)) : v;
}

Vec3d across(const ContactRow& row, const Vec3d& v) { return v - row.normal.dot(v) * row.normal; }

// What a row's multipliers become at the relative velocity w.
double next_push(const ContactRow& row, const Vec3d& w) {
  return std::max(0.0, row.push - row.penalty * (row.normal.dot(w) - row.least));
}
Vec3d next_pull(const ContactRow& row, const Vec3d& w) { return row.pull - row.penalty * across(row, w); }

// What a row does in a Newton step: friction as a spring that gives `share` of what would make it stick, 1 where it
// does. Where it slides that is a bound of its energy from above, so that a step never overshoots.
struct Act {
  bool closed = false;
  double limit = 0.0, share = 0.0;  // of friction [kg m/s]; share: of the force
};

std::vector<Act> decide(const std::vector<ContactRow>& rows, const std::vector<Real>& x) {
  std::vector<Act> acts(rows.size());
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const Vec3d w = row_velocity(rows[r], x);
    const double push = next_push(rows[r], w), pull = next_pull(rows[r], w).norm();
    acts[r] = {push > 0.0, rows[r].friction * push, 0.0};
    if (acts[r].limit > 0.0) acts[r].share = pull > acts[r].limit ? acts[r].limit / pull : 1.0;
  }
  return acts;
}

// Whether a step has changed nothing of account.
bool same(const std::vector<Act>& a, const std::vector<Act>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), [](const Act& one, const Act& other) {
    return one.closed == other.closed && std::abs(one.share - other.share) < kSameShare;
  });
}

void add_impulse(const ContactRow& row, const Vec3d& impulse, std::vector<Real>& f) {
  for (const RowPart& part : row.parts)
    for (std::size_t a = 0; a < 3; ++a)
      f[3 * part.unknown + a] += part.weight * static_cast<Real>(impulse[static_cast<Eigen::Index>(a)]);
}

// The linear system of a Newton step: penalties in G, the right-hand side.
void linearise(const std::vector<ContactRow>& rows, const std::vector<Act>& acts, VelocitySystem& system,
               std::vector<Real>& load) {
  std::vector<Penalty> penalties;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const ContactRow& row = rows[r];
    if (!acts[r].closed) continue;
    const Mat3d along = row.normal * row.normal.transpose(), beside = Mat3d::Identity() - along;
    penalties.push_back({row.parts, (row.penalty * (along + acts[r].share * beside)).cast<Real>()});
    add_impulse(row, (row.push + row.penalty * row.least) * row.normal + acts[r].share * row.pull, load);
  }
  system.set_penalties(std::move(penalties));
}

// The function that a Newton step lessens, along x + t d with the limits of friction as they are: its slope in t.
class Slope {
 public:
  Slope(const Parallel& parallel, const std::vector<ContactRow>& rows, const std::vector<Act>& acts,
        const std::vector<Real>& f, const std::vector<Real>& x, const std::vector<Real>& d, VelocitySystem& system)
      : rows_(rows), acts_(acts) {
    std::vector<Real> moved;
    system.multiply(parallel, x, moved);
    constant_ = linalg::dot(parallel, d, moved) - linalg::dot(parallel, d, f);
    system.multiply(parallel, d, moved);
    linear_ = linalg::dot(parallel, d, moved);
    for (const ContactRow& row : rows) {
      start_.push_back(row_velocity(row, x));
      change_.push_back(row_velocity(row, d));
    }
  }
  double at(double t) const {
    double slope = constant_ + t * linear_;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      const Vec3d w = start_[r] + t * change_[r];
      slope -= rows_[r].normal.dot(change_[r]) * next_push(rows_[r], w) +
               change_[r].dot(shorten(next_pull(rows_[r], w), acts_[r].limit));
    }
    return slope;
  }

 private:
  const std::vector<ContactRow>& rows_;
  const std::vector<Act>& acts_;
  double constant_ = 0.0, linear_ = 0.0;
  std::vector<Vec3d> start_, change_;
};

// Where the slope, which grows, vanishes in [0, 1]; 1 where it does not.
double step_length(const Slope& slope) {
  const double start = slope.at(0.0);
  if (!(start < 0.0) || slope.at(1.0) <= -kDescends * start) return 1.0;
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 30; ++i) {
    const double middle = 0.5 * (low + high);
    (slope.at(middle) < 0.0 ? low : high) = middle;
  }
  return high;
}

// Takes up in the impulses what the penalties have done. Whether that is settled: a small part of the largest impulse,
// or what leads the surfaces into each other, or along each other where they stick, at less than `negligible`.
bool update(const std::vector<Real>& x, double negligible, std::vector<ContactRow>& rows) {
  double change = 0.0, largest = 0.0, fastest = 0.0;
  for (ContactRow& row : rows) {
    if (!(row.penalty > 0.0)) continue;
    const Vec3d w = row_velocity(row, x), before = row.impulse();
    const Vec3d pull = next_pull(row, w);
    row.push = next_push(row, w);
    row.sticks = row.push > 0.0 && pull.norm() < row.friction * row.push;
    row.pull = shorten(pull, row.friction * row.push);
    const double changed = (row.impulse() - before).norm();
    change = std::max(change, changed);
    largest = std::max(largest, row.impulse().norm());
    fastest = std::max(fastest, changed / row.penalty);
  }
  return fastest <= negligible || change <= kSettled * largest;
}

// |f + B^T r - G x| of what moves, r the impulses that the rows have at x.
double first_residual(const Parallel& parallel, const std::vector<Real>& f, const std::vector<Real>& x,
                      const std::vector<ContactRow>& rows, VelocitySystem& system) {
  std::vector<Real> pushed = f;
  for (const ContactRow& row : rows) {
    const Vec3d w = row_velocity(row, x);
    const double push = next_push(row, w);
    add_impulse(row, push * row.normal + shorten(next_pull(row, w), row.friction * push), pushed);
  }
  return system.residual(parallel, pushed, x);
}

}  // namespace

Vec3d row_velocity(const ContactRow& row, const std::vector<Real>& v) {
  Vec3d sum = Vec3d::Zero();
  for (const RowPart& part : row.parts)
    for (std::size_t a = 0; a < 3; ++a)
      sum[static_cast<Eigen::Index>(a)] +=
          static_cast<double>(part.weight) * static_cast<double>(v[3 * part.unknown + a]);
  return sum;
}

void add_impulses(const std::vector<ContactRow>& rows, std::vector<Real>& f) {
  for (const ContactRow& row : rows) add_impulse(row, row.impulse(), f);
}

linalg::SolveStats solve_contact(const Parallel& parallel, VelocitySolver solver, const std::vector<Real>& f,
                                 double tolerance, double negligible, VelocitySystem& system,
                                 std::vector<ContactRow>& rows, std::vector<Real>& x) {
  if (rows.empty()) return system.solve(parallel, solver, f, x, tolerance);
  system.set_penalties({});
  for (ContactRow& row : rows) {
    double mobility = 0.0;
    for (const RowPart& part : row.parts)
      mobility += static_cast<double>(part.weight * part.weight) * system.mobility(part.unknown);
    row.penalty = mobility > 0.0 ? kStiff / mobility : 0.0;
    if (row.penalty == 0.0) row.push = 0.0;
    row.pull = shorten(across(row, row.pull), row.friction * row.push);
  }
  linalg::SolveStats stats;
  std::vector<Real> load, start, way;
  const double reference =
      std::max(first_residual(parallel, f, x, rows, system), system.rounding(parallel, x) / tolerance);
  for (int outer = 0; outer < kMostOuter; ++outer) {
    std::vector<Act> acts = decide(rows, x);
    for (int newton = 0; newton < kMostNewton; ++newton) {
      load = f;
      linearise(rows, acts, system, load);
      start = x;
      const linalg::SolveStats solve = system.solve(parallel, solver, load, x, tolerance, reference);
      stats.iterations += solve.iterations;
      stats.converged = solve.converged;
      stats.residual = solve.residual;
      std::vector<Act> next = decide(rows, x);
      if (same(acts, next)) break;
      way = x;
      linalg::add_scaled(parallel, way, -1.0, start);
      const double length = step_length(Slope(parallel, rows, acts, f, start, way, system));
      if (length < 1.0) {
        x = start;
        linalg::add_scaled(parallel, x, length, way);
        next = decide(rows, x);
      }
      acts = std::move(next);
    }
    if (update(x, negligible, rows)) return stats;
  }
  stats.converged = false;
  return stats;
}

}  // namespace efsi::system
