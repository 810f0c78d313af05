#include "system/rigid_modes.hpp"

#include <algorithm>

#include "system/velocity_system.hpp"

namespace efsi::system {
namespace {

using Vec6d = Eigen::Matrix<double, 6, 1>;
using Mat6d = Eigen::Matrix<double, 6, 6>;
using Modes = Eigen::Matrix<double, 3, 6>;

constexpr double kLeast =
    1e-3;  // of the mass, and times h^2 of the inertia: lower bound for thin or constrained bodies

// sum of add(sum, unknown) in a fixed order.
template <class Sum, class Add>
Sum ordered_sum(const Parallel& parallel, std::size_t begin, std::size_t end, const Sum& zero, const Add& add) {
  const std::size_t chunks = (end - begin + kUnknownsPerSum - 1) / kUnknownsPerSum;
  std::vector<Sum> sums(chunks, zero);
  parallel.for_each(static_cast<std::int64_t>(chunks), [&](std::int64_t chunk) {
    const auto c = static_cast<std::size_t>(chunk);
    for (std::size_t u = begin + c * kUnknownsPerSum; u < std::min(end, begin + (c + 1) * kUnknownsPerSum); ++u)
      add(sums[c], u);
  });
  Sum all = zero;
  for (const Sum& sum : sums) all += sum;
  return all;
}

void add_block(Eigen::Index row, Eigen::Index column, const Mat6d& block,
               std::vector<Eigen::Triplet<double>>& entries) {
  for (Eigen::Index j = 0; j < 6; ++j)
    for (Eigen::Index i = 0; i < 6; ++i) entries.emplace_back(row + i, column + j, block(i, j));
}

}  // namespace

// Entries constrained by walls have no effect.
Modes RigidModes::modes(const Body& body, std::size_t unknown) const {
  const Vec3d& x = place_[unknown];
  Modes m;
  m << Mat3d::Identity(), Mat3d::Zero();
  m.rightCols<3>() << 0, x[2], -x[1], -x[2], 0, x[0], x[1], -x[0], 0;
  return m * body.moves.asDiagonal();
}

void RigidModes::add_body(const Parallel& parallel, const VelocitySystem& system, std::size_t solid, Entries& entries) {
  Body body;
  body.begin = system.begin_of(solid);
  body.end = system.begin_of(solid + 1);
  body.first = 6 * static_cast<Eigen::Index>(bodies_.size());
  const unsigned held = system.fixed_axes(solid);
  for (Eigen::Index a = 0; a < 3; ++a) body.moves[a] = held & (1u << a) ? 0.0 : 1.0;
  if (held != 0) body.moves.tail<3>().setZero();
  const Eigen::Vector4d moments = ordered_sum<Eigen::Vector4d>(
      parallel, body.begin, body.end, Eigen::Vector4d::Zero(),
      [&](Eigen::Vector4d& sum, std::size_t u) { sum += system.inertia(u) * system.place(u).homogeneous(); });
  const Vec3d center = moments.head<3>() / moments[3];
  for (std::size_t u = body.begin; u < body.end; ++u) place_[u] = system.place(u) - center;
  Mat6d mass = ordered_sum<Mat6d>(parallel, body.begin, body.end, Mat6d::Zero(), [&](Mat6d& sum, std::size_t u) {
    const Modes m = modes(body, u);
    sum += system.inertia(u) * m.transpose() * m;
  });
  const double least = kLeast * moments[3], turns = least * system.cell() * system.cell();
  for (Eigen::Index a = 0; a < 6; ++a) mass(a, a) += a < 3 ? least : turns;
  add_block(body.first, body.first, mass, entries);
  bodies_.push_back(body);
}

RigidModes::RigidModes(const Parallel& parallel, const VelocitySystem& system, const std::vector<Penalty>& penalties) {
  Entries entries;
  constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> body_of(system.solids(), kNone);
  place_.resize(system.begin_of(system.solids()));
  for (const Penalty& p : penalties)
    for (const RowPart& part : p.parts) {
      const std::size_t solid = system.solid_of(part.unknown);
      if (body_of[solid] != kNone) continue;
      body_of[solid] = bodies_.size();
      add_body(parallel, system, solid, entries);
    }
  for (const Penalty& p : penalties) {
    std::vector<std::pair<std::size_t, Modes>> seen;  // of each body that it acts on
    for (const RowPart& part : p.parts) {
      const std::size_t b = body_of[system.solid_of(part.unknown)];
      auto at = std::find_if(seen.begin(), seen.end(), [&](const auto& s) { return s.first == b; });
      if (at == seen.end()) at = seen.insert(at, {b, Modes::Zero()});
      at->second += static_cast<double>(part.weight) * modes(bodies_[b], part.unknown);
    }
    const Mat3d stiffness = p.stiffness.cast<double>();
    for (const auto& [b, m] : seen)
      for (const auto& [c, n] : seen)
        add_block(bodies_[b].first, bodies_[c].first, m.transpose() * stiffness * n, entries);
  }
  const auto size = 6 * static_cast<Eigen::Index>(bodies_.size());
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  factors_.compute(matrix);
}

void RigidModes::add(const Parallel& parallel, const VelocitySystem& system, const std::vector<Real>& r,
                     std::vector<Real>& z) const {
  Eigen::VectorXd load(6 * static_cast<Eigen::Index>(bodies_.size()));
  for (const Body& body : bodies_)
    load.segment<6>(body.first) =
        ordered_sum<Vec6d>(parallel, body.begin, body.end, Vec6d::Zero(), [&](Vec6d& sum, std::size_t u) {
          const Vec3d impulse = Vec3(r[3 * u], r[3 * u + 1], r[3 * u + 2]).cast<double>();
          sum.head<3>() += impulse;
          sum.tail<3>() += place_[u].cross(impulse);
        }).cwiseProduct(body.moves);
  const Eigen::VectorXd motion = factors_.solve(load);
  for (const Body& body : bodies_) {
    const Vec6d m = motion.segment<6>(body.first).cwiseProduct(body.moves);
    const Vec3d shift = m.head<3>(), turn = m.tail<3>();
    parallel.for_ranges(static_cast<std::int64_t>(body.end - body.begin), [&](std::int64_t begin, std::int64_t end) {
      for (std::size_t u = body.begin + static_cast<std::size_t>(begin); u < body.begin + static_cast<std::size_t>(end);
           ++u) {
        const Vec3d v = shift + turn.cross(place_[u]);
        for (std::size_t a = 0; a < 3; ++a)
          z[3 * u + a] += system.free()[3 * u + a] * static_cast<Real>(v[static_cast<Eigen::Index>(a)]);
      }
    });
  }
}

}  // namespace efsi::system
