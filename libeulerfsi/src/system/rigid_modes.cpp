#include "system/rigid_modes.hpp"

#include <algorithm>

namespace efsi::system {
namespace {

constexpr std::size_t kChunk = 1024;    // unknowns that are summed at a time
constexpr double kLeastInertia = 1e-3;  // of the mass times h^2: thin bodies may turn without any

// sum of add(sum, unknown) in a fixed order.
template <class Sum, class Add>
Sum ordered_sum(const Parallel& parallel, std::size_t begin, std::size_t end, const Sum& zero, const Add& add) {
  const std::size_t chunks = (end - begin + kChunk - 1) / kChunk;
  std::vector<Sum> sums(chunks, zero);
  parallel.for_each(static_cast<std::int64_t>(chunks), [&](std::int64_t chunk) {
    const auto c = static_cast<std::size_t>(chunk);
    for (std::size_t u = begin + c * kChunk; u < std::min(end, begin + (c + 1) * kChunk); ++u) add(sums[c], u);
  });
  Sum all = zero;
  for (const Sum& sum : sums) all += sum;
  return all;
}

}  // namespace

// Entries that walls hold move nothing.
RigidModes::Modes RigidModes::modes(const Body& body, std::size_t unknown) const {
  const Vec3d x = system_.place(unknown) - body.center;
  Modes m;
  m << Mat3d::Identity(), Mat3d::Zero();
  if (body.held == 0) m.rightCols<3>() << 0, x[2], -x[1], -x[2], 0, x[0], x[1], -x[0], 0;
  for (int a = 0; a < 3; ++a)
    if (body.held & (1u << a)) m.col(a).setZero();
  return m;
}

RigidModes::RigidModes(const Parallel& parallel, const std::vector<ContactRow>& rows, const std::vector<RowAct>& acts,
                       const VelocitySystem& system)
    : system_(system) {
  std::vector<std::int64_t> body_of(system.solids(), -1);
  for (const ContactRow& row : rows)
    for (const RowPart& part : row.parts) body_of[system.solid_of(part.unknown)] = 0;
  std::vector<Eigen::Triplet<double>> entries;
  const auto add = [&](Eigen::Index row, Eigen::Index column, const Eigen::Matrix<double, 6, 6>& block) {
    for (Eigen::Index j = 0; j < 6; ++j)
      for (Eigen::Index i = 0; i < 6; ++i) entries.emplace_back(row + i, column + j, block(i, j));
  };
  for (std::size_t l = 0; l < body_of.size(); ++l) {
    if (body_of[l] < 0) continue;
    body_of[l] = static_cast<std::int64_t>(bodies_.size());
    Body body;
    body.begin = system.begin_of(l);
    body.end = system.begin_of(l + 1);
    body.held = system.held_axes(l);
    body.first = 6 * static_cast<Eigen::Index>(bodies_.size());
    using Vec4d = Eigen::Vector4d;
    const Vec4d moments =
        ordered_sum<Vec4d>(parallel, body.begin, body.end, Vec4d::Zero(), [&](Vec4d& sum, std::size_t u) {
          const Vec3d x = system.place(u);
          sum += system.inertia(u) * Vec4d(1.0, x[0], x[1], x[2]);
        });
    body.center = moments.tail<3>() / moments[0];
    using Mat6d = Eigen::Matrix<double, 6, 6>;
    Mat6d mass = ordered_sum<Mat6d>(parallel, body.begin, body.end, Mat6d::Zero(), [&](Mat6d& sum, std::size_t u) {
      const Modes m = modes(body, u);
      sum += system.inertia(u) * m.transpose() * m;
    });
    const double h = system.cell();
    for (Eigen::Index a = 0; a < 6; ++a) mass(a, a) += (a < 3 ? 1e-9 : kLeastInertia * h * h) * moments[0];
    add(body.first, body.first, mass);
    bodies_.push_back(body);
  }
  for (std::size_t r = 0; r < rows.size(); ++r) {
    if (!acts[r].closed()) continue;
    const ContactRow& row = rows[r];
    const Mat3d along = row.normal * row.normal.transpose();
    const Mat3d stiffness = row.penalty * (along + acts[r].share * (Mat3d::Identity() - along));
    std::vector<std::pair<std::int64_t, Modes>> parts;  // what a row sees of each body
    for (const RowPart& part : row.parts) {
      const std::int64_t b = body_of[system.solid_of(part.unknown)];
      auto at = std::find_if(parts.begin(), parts.end(), [&](const auto& p) { return p.first == b; });
      if (at == parts.end()) at = parts.insert(at, {b, Modes::Zero()});
      at->second += static_cast<double>(part.weight) * modes(bodies_[static_cast<std::size_t>(b)], part.unknown);
    }
    for (const auto& [b, m] : parts)
      for (const auto& [c, n] : parts) add(6 * b, 6 * c, m.transpose() * stiffness * n);
  }
  const auto size = 6 * static_cast<Eigen::Index>(bodies_.size());
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  factors_.compute(matrix);
}

void RigidModes::add(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z) const {
  Eigen::VectorXd load = Eigen::VectorXd::Zero(6 * static_cast<Eigen::Index>(bodies_.size()));
  using Vec6d = Eigen::Matrix<double, 6, 1>;
  for (const Body& body : bodies_)
    load.segment<6>(body.first) =
        ordered_sum<Vec6d>(parallel, body.begin, body.end, Vec6d::Zero(), [&](Vec6d& sum, std::size_t u) {
          sum += modes(body, u).transpose() * Vec3(r[3 * u], r[3 * u + 1], r[3 * u + 2]).cast<double>();
        });
  const Eigen::VectorXd motion = factors_.solve(load);
  for (const Body& body : bodies_) {
    const Vec6d m = motion.segment<6>(body.first);
    parallel.for_each(static_cast<std::int64_t>(body.end - body.begin), [&](std::int64_t i) {
      const std::size_t u = body.begin + static_cast<std::size_t>(i);
      const Vec3d v = modes(body, u) * m;
      for (std::size_t a = 0; a < 3; ++a)
        z[3 * u + a] += system_.free()[3 * u + a] * static_cast<Real>(v[static_cast<Eigen::Index>(a)]);
    });
  }
}

}  // namespace efsi::system
