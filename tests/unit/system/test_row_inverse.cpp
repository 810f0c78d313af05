// Purpose: the inverse of a diagonal with the penalties of rows against a dense one.
#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <random>

#include "system/row_inverse.hpp"
#include "system/velocity_system.hpp"

using namespace efsi;

TEST_CASE("Rows that share nodes, stick, slide and are held in part: the inverse is the dense one") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> some(0.1, 1.0);
  constexpr std::size_t kUnknowns = 12;
  constexpr auto kSize = static_cast<Eigen::Index>(3 * kUnknowns);
  for (const double stiff : {1.0, 1e3}) {
    INFO("penalties over the diagonal: " << stiff);
    std::vector<Real> inverse(3 * kUnknowns), free(3 * kUnknowns, 1), r(3 * kUnknowns);
    for (std::size_t i = 0; i < inverse.size(); ++i) {
      inverse[i] = static_cast<Real>(some(random));
      r[i] = static_cast<Real>(some(random) - 0.5);
    }
    free[4] = free[9] = free[10] = free[11] = 0;
    std::vector<system::Penalty> penalties;
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kSize, kSize);
    for (Eigen::Index i = 0; i < kSize; ++i)
      dense(i, i) = 1.0 / static_cast<double>(inverse[static_cast<std::size_t>(i)]);
    for (std::size_t p = 0; p < 5; ++p) {
      const Vec3d normal = Vec3d(some(random), some(random), -some(random)).normalized();
      const double slides = p == 0 ? 0.0 : p == 1 ? 0.3 : 1.0;
      const Mat3d along = normal * normal.transpose();
      system::Penalty penalty{{}, (stiff * (along + slides * (Mat3d::Identity() - along))).cast<Real>()};
      for (std::size_t k = 0; k < 4; ++k)
        penalty.parts.push_back({2 * p + k, static_cast<Real>(k < 2 ? -some(random) : some(random))});
      Eigen::MatrixXd b = Eigen::MatrixXd::Zero(3, kSize);
      for (const system::RowPart& part : penalty.parts)
        for (std::size_t a = 0; a < 3; ++a)
          if (free[3 * part.unknown + a] > 0)
            b(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(3 * part.unknown + a)) =
                static_cast<double>(part.weight);
      dense += b.transpose() * penalty.stiffness.cast<double>() * b;
      penalties.push_back(std::move(penalty));
    }
    std::vector<Real> z(r.size());
    for (std::size_t i = 0; i < r.size(); ++i) z[i] = inverse[i] * r[i];
    const Parallel parallel(2);
    const system::RowInverse rows(parallel, penalties, inverse, free);
    rows.correct(parallel, z);
    Eigen::VectorXd right(kSize), found(kSize);
    for (Eigen::Index i = 0; i < kSize; ++i) {
      right[i] = static_cast<double>(r[static_cast<std::size_t>(i)]);
      found[i] = static_cast<double>(z[static_cast<std::size_t>(i)]);
    }
    const Eigen::VectorXd expected = dense.fullPivLu().solve(right);
    CHECK((found - expected).norm() < 2e-4 * expected.norm());  // S is in single precision
    CHECK(z[9] == inverse[9] * r[9]);                           // nothing of the rows where nothing moves
  }
}
