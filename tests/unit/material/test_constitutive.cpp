// Purpose: the elastic laws against finite differences, closed forms and linear elasticity.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

#include "material/constitutive.hpp"

using namespace efsi;
using namespace efsi::material;

namespace {

Vec3d random_stretch(std::mt19937& random) {
  std::uniform_real_distribution<double> stretch(0.2, 2.5);
  return {stretch(random), stretch(random), stretch(random)};
}

Mat3d random_matrix(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> entry(-size, size);
  Mat3d m;
  for (int i = 0; i < 9; ++i) m.data()[i] = entry(random);
  return m;
}

// First Piola-Kirchhoff stress through a singular value decomposition.
Mat3d piola(const Elastic& material, const Mat3d& f) {
  const Eigen::JacobiSVD<Mat3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * principal_response(material, svd.singularValues()).stress.asDiagonal() *
         svd.matrixV().transpose();
}

// The differential of the stress as the header defines it.
Mat3d stress_change(const PrincipalResponse& r, const Mat3d& d) {
  Mat3d q = Mat3d::Zero();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) q(i, i) += r.hessian(i, j) * d(j, j);
  for (int p = 0; p < 3; ++p) {
    const int i = (p + 1) % 3, j = (p + 2) % 3;
    const double even = r.symmetric[p] * (d(i, j) + d(j, i)) / 2.0, odd = r.skew[p] * (d(i, j) - d(j, i)) / 2.0;
    q(i, j) = even + odd;
    q(j, i) = even - odd;
  }
  return q;
}

// Stretch across a bar pulled along x with free sides, by bisection of the lateral stress.
double free_lateral_stretch(const Elastic& material, double along) {
  double low = 0.2, high = 2.0;
  for (int it = 0; it < 80; ++it) {
    const double middle = 0.5 * (low + high);
    (principal_response(material, {along, middle, middle}).stress[1] > 0.0 ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

// Every law, alone and hardening.
std::vector<Elastic> all_materials(double youngs_modulus, double poissons_ratio) {
  std::vector<Elastic> all;
  for (const Law law : kLaws)
    for (const bool hardens : {false, true}) {
      all.push_back(from_youngs_modulus(law, youngs_modulus, poissons_ratio));
      all.back().hardens = hardens;
    }
  return all;
}

}  // namespace

TEST_CASE("Stress is the derivative of the energy") {
  std::mt19937 random(1);
  for (const Elastic& material : all_materials(2e4, 0.3)) {
    for (int trial = 0; trial < 200; ++trial) {
      const Vec3d s = random_stretch(random);
      const Vec3d stress = principal_response(material, s).stress;
      const double step = 1e-5;
      for (int i = 0; i < 3; ++i) {
        Vec3d up = s, down = s;
        up[i] += step;
        down[i] -= step;
        const double difference =
            (principal_response(material, up).energy - principal_response(material, down).energy) / (2.0 * step);
        REQUIRE(std::abs(stress[i] - difference) <= 1e-6 * stress.norm());
      }
    }
  }
}

TEST_CASE("The moduli are the derivative of the stress for every direction of the increment") {
  std::mt19937 random(2);
  for (const Elastic& material : all_materials(2e4, 0.3)) {
    for (int trial = 0; trial < 100; ++trial) {
      Mat3d f = Mat3d::Identity() + random_matrix(random, 0.5);
      if (f.determinant() < 0.2) continue;
      const Mat3d df = random_matrix(random, 1.0);
      const Eigen::JacobiSVD<Mat3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
      const PrincipalResponse r = principal_response(material, svd.singularValues());
      const Mat3d change =
          svd.matrixU() * stress_change(r, svd.matrixU().transpose() * df * svd.matrixV()) * svd.matrixV().transpose();
      const double step = 1e-6;
      const Mat3d difference = (piola(material, f + step * df) - piola(material, f - step * df)) / (2.0 * step);
      REQUIRE((change - difference).norm() <= 1e-6 * (difference.norm() + 1e4));
    }
  }
}

TEST_CASE("Pair moduli are the difference quotients of the stress") {
  std::mt19937 random(3);
  for (const Elastic& material : all_materials(1.0, 0.4)) {
    for (int trial = 0; trial < 100; ++trial) {
      const Vec3d s = random_stretch(random);
      const PrincipalResponse r = principal_response(material, s);
      for (int p = 0; p < 3; ++p) {
        const int i = (p + 1) % 3, j = (p + 2) % 3;
        CHECK(r.symmetric[p] * (s[i] - s[j]) == Approx(r.stress[i] - r.stress[j]).margin(1e-10));
        CHECK(r.skew[p] * (s[i] + s[j]) == Approx(r.stress[i] + r.stress[j]).margin(1e-10));
      }
    }
  }
}

TEST_CASE("A material that hardens resists any pressure, and is as it was where it is pressed less") {
  for (const Law law : kLaws) {
    const Elastic plain = from_youngs_modulus(law, 1.0, 0.3), hard = {law, plain.mu, plain.lambda, true};
    const auto pressure = [](const Elastic& m, double s) { return -principal_response(m, {s, 1.0, 1.0}).stress[0]; };
    CHECK(pressure(plain, 0.1) < 2.0 * plain.mu + plain.lambda);
    CHECK(pressure(hard, 0.1) > 20.0 * plain.mu);
    double last = 0.0;
    for (double s = kCrushed; s > 0.1; s -= 0.01) {
      CHECK(pressure(hard, s) > last);
      last = pressure(hard, s);
    }
    const Vec3d less(1.001 * kCrushed, 1.3, 0.7);
    CHECK(principal_response(hard, less).stress == principal_response(plain, less).stress);
    CHECK(principal_response(hard, less).energy == principal_response(plain, less).energy);
  }
}

TEST_CASE("The rest shape has neither stress nor energy") {
  for (const Law law : kLaws) {
    const PrincipalResponse r = principal_response(from_youngs_modulus(law, 2e4, 0.45), Vec3d::Ones());
    CHECK(r.stress.norm() < 1e-9);
    CHECK(std::abs(r.energy) < 1e-9);
  }
}

TEST_CASE("Small strains follow linear elasticity") {
  for (const Law law : kLaws) {
    const Elastic m = from_youngs_modulus(law, 2e4, 0.3);
    CHECK(m.mu == Approx(2e4 / 2.6));
    CHECK(m.lambda == Approx(2e4 * 0.3 / (1.3 * 0.4)));
    const PrincipalResponse r = principal_response(m, Vec3d::Ones());
    const Mat3d expected = 2.0 * m.mu * Mat3d::Identity() + Mat3d::Constant(m.lambda);
    CHECK((r.hessian - expected).norm() < 1e-9 * expected.norm());
    for (int p = 0; p < 3; ++p) {
      CHECK(r.symmetric[p] == Approx(2.0 * m.mu));
      CHECK(std::abs(r.skew[p]) < 1e-9 * m.mu);  // rotations cost nothing
    }
  }
}

TEST_CASE("Corotational bar pulled with free sides: closed form", "[law]") {
  // Stretch along; across = 1 - nu (s - 1), stress E (s - 1); E = 1, nu = 0.3.
  const double table[][3] = {{0.5, 1.15, -0.5}, {0.8, 1.06, -0.2}, {0.9, 1.03, -0.1},
                             {1.1, 0.97, 0.1},  {1.5, 0.85, 0.5},  {2.0, 0.70, 1.0}};
  const Elastic material = from_youngs_modulus(Law::kCorotational, 1.0, 0.3);
  for (const auto& row : table) {
    const double across = free_lateral_stretch(material, row[0]);
    CHECK(across == Approx(row[1]).epsilon(1e-9));
    CHECK(principal_response(material, {row[0], across, across}).stress[0] == Approx(row[2]).epsilon(1e-9));
  }
}

TEST_CASE("Corotational solid at constant volume: closed form", "[law]") {
  // Difference of the Cauchy stresses in uniaxial tension with J = 1; mu = 1, nu = 0.3.
  const double table[][2] = {{0.8, -0.601138}, {0.9, -0.295929}, {1.1, 0.310266},
                             {1.2, 0.650162},  {1.5, 1.936012},  {2.0, 5.217514}};
  const Elastic material = from_youngs_modulus(Law::kCorotational, 2.6, 0.3);
  for (const auto& row : table) {
    const Vec3d s(row[0], 1.0 / std::sqrt(row[0]), 1.0 / std::sqrt(row[0]));
    const Vec3d cauchy = principal_response(material, s).stress.cwiseProduct(s);
    CHECK(cauchy[0] - cauchy[1] == Approx(row[1]).epsilon(2e-6));
  }
}

TEST_CASE("Neo-Hookean bar pulled with free sides has Young's modulus and Poisson's ratio at small strain", "[law]") {
  const Elastic material = from_youngs_modulus(Law::kStableNeoHookean, 1.0, 0.3);
  const double strain = 1e-4, across = free_lateral_stretch(material, 1.0 + strain);
  CHECK((1.0 - across) / strain == Approx(0.3).epsilon(1e-3));
  CHECK(principal_response(material, {1.0 + strain, across, across}).stress[0] / strain == Approx(1.0).epsilon(1e-3));
}

TEST_CASE("Neo-Hookean bar pulled with free sides at finite strain: closed form", "[law]") {
  // Free sides: m (1 - 1/(I + 1)) t + l (J - a) s t = 0, I = s^2 + 2 t^2, J = s t^2. With q = t^2 and the factor
  // w = 1 - 1/(I + 1) it is q = (a - m w / (l s)) / s, a contraction here; then P = m w s + l (J - a) q.
  const Elastic material = from_youngs_modulus(Law::kStableNeoHookean, 1.0, 0.3);
  const double m = 4.0 / 3.0 * material.mu, l = material.lambda + 5.0 / 6.0 * material.mu, a = 1.0 + 0.75 * m / l;
  for (const double s : {0.7, 1.3, 1.6}) {
    double q = 1.0, w = 0.0;
    for (int it = 0; it < 200; ++it) {
      w = 1.0 - 1.0 / (1.0 + s * s + 2.0 * q);
      q = (a - m * w / (l * s)) / s;
    }
    const double across = free_lateral_stretch(material, s);
    CHECK(across == Approx(std::sqrt(q)).epsilon(1e-9));
    CHECK(principal_response(material, {s, across, across}).stress[0] ==
          Approx(m * w * s + l * (s * q - a) * q).epsilon(1e-9));
  }
}

TEST_CASE("The definite linearisation has no negative modulus and keeps a definite one") {
  std::mt19937 random(4);
  int changed = 0;
  for (const Elastic& material : all_materials(1.0, 0.45)) {
    for (int trial = 0; trial < 300; ++trial) {
      const PrincipalResponse r = principal_response(material, random_stretch(random)), d = make_definite(r);
      const double lowest = Eigen::SelfAdjointEigenSolver<Mat3d>(r.hessian).eigenvalues().minCoeff();
      REQUIRE(Eigen::SelfAdjointEigenSolver<Mat3d>(d.hessian).eigenvalues().minCoeff() > -1e-12 * r.hessian.norm());
      REQUIRE(d.symmetric.minCoeff() >= 0.0);
      REQUIRE(d.skew.minCoeff() >= 0.0);
      if (lowest >= 0.0) REQUIRE((d.hessian - r.hessian).norm() <= 1e-12 * r.hessian.norm());
      changed += lowest < 0.0 || r.skew.minCoeff() < 0.0;
      // Stress and energy are those of the law.
      REQUIRE(d.stress == r.stress);
      REQUIRE(d.energy == r.energy);
    }
  }
  CHECK(changed > 20);
}

// The sides that turn over have a negative stretch, as in Deformation (solid/map/reference_map.hpp); a flat cell has 0,
// one that is pressed to a line two of them, to a point three.
TEST_CASE("Inverted and degenerate F: stress and moduli are derivatives, and none is infinite") {
  const Vec3d stretches[] = {{-0.2, 0.9, 1.4}, {-0.9, 1.2, 1.2}, {0.2, 0.2, 5.0}, {5.0, 5.0, 5.0}, {0.2, 0.2, 0.2},
                             {-0.2, 5.0, 5.0}, {1.1, 1.1, 1.1},  {0.0, 1.0, 1.0}, {1.3, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  const double step = 1e-5;
  for (const Elastic& material : all_materials(1.0, 0.3)) {
    for (const Vec3d& s : stretches) {
      const PrincipalResponse r = principal_response(material, s);
      REQUIRE(std::isfinite(r.energy));
      REQUIRE((r.stress.allFinite() && r.hessian.allFinite() && r.symmetric.allFinite() && r.skew.allFinite()));
      REQUIRE(r.energy >= -1e-9);
      for (int i = 0; i < 3; ++i) {
        const Vec3d up = s + step * Vec3d::Unit(i), down = s - step * Vec3d::Unit(i);
        const PrincipalResponse above = principal_response(material, up), below = principal_response(material, down);
        CHECK(r.stress[i] == Approx((above.energy - below.energy) / (2.0 * step)).epsilon(1e-6).margin(1e-6));
        const Vec3d change = (above.stress - below.stress) / (2.0 * step);
        CHECK((r.hessian.col(i) - change).norm() <= 1e-6 * (1.0 + change.norm()));
      }
      for (int p = 0; p < 3; ++p) {
        const int i = (p + 1) % 3, j = (p + 2) % 3;
        CHECK(r.symmetric[p] * (s[i] - s[j]) == Approx(r.stress[i] - r.stress[j]).margin(1e-9));
        // Where both are 0 there is no rotation to tell, and the quotient has no bound but the code's.
        if (s[i] + s[j] != 0.0) CHECK(r.skew[p] * (s[i] + s[j]) == Approx(r.stress[i] + r.stress[j]).margin(1e-9));
      }
      const PrincipalResponse d = make_definite(r);
      CHECK(Eigen::SelfAdjointEigenSolver<Mat3d>(d.hessian).eigenvalues().minCoeff() >= -1e-9 * d.hessian.norm());
      CHECK(d.symmetric.minCoeff() >= 0.0);
      CHECK(d.skew.minCoeff() >= 0.0);
    }
  }
}

TEST_CASE("St. Venant-Kirchhoff bar pulled with free sides: closed form", "[law]") {
  // e across = -nu e along, stress s E (s^2 - 1) / 2.
  const Elastic material = from_youngs_modulus(Law::kStVenantKirchhoff, 1.0, 0.3);
  for (const double s : {0.6, 0.8, 0.9, 1.1, 1.5, 2.0}) {
    const double strain = 0.5 * (s * s - 1.0), across = std::sqrt(1.0 - 0.6 * strain);
    const Vec3d stress = principal_response(material, {s, across, across}).stress;
    CHECK(stress[0] == Approx(s * strain).epsilon(1e-9));
    CHECK(std::abs(stress[1]) < 1e-9);
  }
}

TEST_CASE("Neo-Hookean bar at constant volume: closed form", "[law]") {
  // Difference of the Cauchy stresses m (1 - 1/(I + 1)) (s^2 - 1/s), m = 4/3 mu: J has no part in it.
  const Elastic material = from_youngs_modulus(Law::kStableNeoHookean, 2.6, 0.3);
  for (const double s : {0.7, 0.9, 1.1, 1.5, 2.0}) {
    const Vec3d stretch(s, 1.0 / std::sqrt(s), 1.0 / std::sqrt(s));
    const Vec3d cauchy = principal_response(material, stretch).stress.cwiseProduct(stretch);
    const double squares = s * s + 2.0 / s;
    CHECK(cauchy[0] - cauchy[1] ==
          Approx(4.0 / 3.0 * material.mu * (1.0 - 1.0 / (squares + 1.0)) * (s * s - 1.0 / s)).epsilon(1e-9));
  }
}

TEST_CASE("Simple shear: closed forms", "[law]") {
  // F = 1 + g e_x e_y^T. With t = g/2 and c = sqrt(1 + t^2):
  //   corotational          P = 2 mu (F - R) + lambda (2 c - 2) R,  R = [[1, t], [-t, 1]] / c
  //   St. Venant-Kirchhoff  P = F (2 mu E + lambda tr E),  E = [[0, t], [t, g^2/2]]
  //   stable neo-Hookean    P = m (1 - 1/(I + 1)) F + l (1 - a) F^-T,  I = 3 + g^2
  const double mu = 1.0, lambda = 1.5;
  for (const double g : {-0.8, 0.1, 0.5, 1.5}) {
    Mat3d f = Mat3d::Identity(), green = Mat3d::Zero(), turn = Mat3d::Identity();
    f(0, 1) = g;
    const double t = 0.5 * g, c = std::sqrt(1.0 + t * t);
    green(0, 1) = green(1, 0) = t;
    green(1, 1) = 0.5 * g * g;
    turn.topLeftCorner<2, 2>() << 1.0 / c, t / c, -t / c, 1.0 / c;
    const double m = 4.0 / 3.0 * mu, l = lambda + 5.0 / 6.0 * mu, a = 1.0 + 0.75 * m / l;
    const Mat3d expected[] = {
        2.0 * mu * (f - turn) + lambda * (2.0 * c - 2.0) * turn,
        m * (1.0 - 1.0 / (4.0 + g * g)) * f + l * (1.0 - a) * f.inverse().transpose(),
        f * (2.0 * mu * green + lambda * green.trace() * Mat3d::Identity()),
    };
    static_assert(std::size(expected) == std::size(kLaws));
    for (const Law law : kLaws)
      CHECK((piola({law, mu, lambda}, f) - expected[static_cast<std::size_t>(law)]).norm() < 1e-9);
  }
}
