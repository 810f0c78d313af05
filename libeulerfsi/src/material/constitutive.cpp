#include "material/constitutive.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace efsi::material {

Elastic from_youngs_modulus(Law law, double youngs_modulus, double poissons_ratio) {
  const double E = youngs_modulus, nu = poissons_ratio;
  return {law, E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))};
}

Elastic beside_pressure(Elastic elastic) {
  elastic.lambda = std::min(elastic.lambda, elastic.mu);
  return elastic;
}

double bulk_energy(double kappa, double J) { return 0.5 * kappa * (J - 1.0) * (J - 1.0); }

namespace {

// psi = mu sum (s_i - 1)^2 + lambda/2 (sum s_i - 3)^2
PrincipalResponse corotational(double mu, double lambda, const Vec3d& s) {
  PrincipalResponse r;
  const Vec3d strain = s - Vec3d::Ones();
  const double trace = strain.sum();
  r.energy = mu * strain.squaredNorm() + 0.5 * lambda * trace * trace;
  r.stress = 2.0 * mu * strain + Vec3d::Constant(lambda * trace);
  r.hessian = 2.0 * mu * Mat3d::Identity() + Mat3d::Constant(lambda);
  r.symmetric.setConstant(2.0 * mu);
  for (int p = 0; p < 3; ++p) {
    const int i = (p + 1) % 3, j = (p + 2) % 3;
    const double sum = std::max(s[i] + s[j], 1e-3);
    r.skew[p] = (r.stress[i] + r.stress[j]) / sum;
  }
  return r;
}

// psi = m/2 (I - 3) + l/2 (J - a)^2 - m/2 log(I + 1) + const, I = sum s_i^2, J = s_0 s_1 s_2.
// m = 4/3 mu, l = lambda + 5/6 mu make small strains agree with linear elasticity; a makes s = 1 stress free.
PrincipalResponse stable_neo_hookean(double mu, double lambda, const Vec3d& s) {
  const double m = 4.0 / 3.0 * mu, l = lambda + 5.0 / 6.0 * mu;
  const double a = 1.0 + m / l - m / (4.0 * l);
  const double I = s.squaredNorm(), J = s.prod();
  const Vec3d dJ(s[1] * s[2], s[2] * s[0], s[0] * s[1]);
  const double shear = m * (1.0 - 1.0 / (I + 1.0));
  PrincipalResponse r;
  const double rest = 0.5 * l * (1.0 - a) * (1.0 - a) - 0.5 * m * std::log(4.0);
  r.energy = 0.5 * m * (I - 3.0) + 0.5 * l * (J - a) * (J - a) - 0.5 * m * std::log(I + 1.0) - rest;
  r.stress = shear * s + l * (J - a) * dJ;
  r.hessian =
      shear * Mat3d::Identity() + (2.0 * m / ((I + 1.0) * (I + 1.0))) * s * s.transpose() + l * dJ * dJ.transpose();
  for (int p = 0; p < 3; ++p) {
    const int i = (p + 1) % 3, j = (p + 2) % 3;
    const double volumetric = l * (J - a) * s[p];  // l (J - a) d2J / ds_i ds_j
    r.hessian(i, j) += volumetric;
    r.hessian(j, i) += volumetric;
    r.symmetric[p] = shear - volumetric;
    r.skew[p] = shear + volumetric;
  }
  return r;
}

// psi = mu sum e_i^2 + lambda/2 (sum e_i)^2, e_i = (s_i^2 - 1) / 2: Green's strain. Pressed below 1/sqrt(3) it softens,
// and a cell pressed flat costs 3/8 mu at most.
PrincipalResponse st_venant_kirchhoff(double mu, double lambda, const Vec3d& s) {
  const Vec3d strain = 0.5 * (s.cwiseProduct(s) - Vec3d::Ones());
  const double trace = strain.sum();
  const Vec3d second = 2.0 * mu * strain + Vec3d::Constant(lambda * trace);  // second Piola-Kirchhoff stress
  PrincipalResponse r;
  r.energy = mu * strain.squaredNorm() + 0.5 * lambda * trace * trace;
  r.stress = second.cwiseProduct(s);
  r.hessian = lambda * s * s.transpose();
  for (int p = 0; p < 3; ++p) {
    const int i = (p + 1) % 3, j = (p + 2) % 3;
    r.hessian(p, p) += second[p] + 2.0 * mu * s[p] * s[p];
    const double squares = s[i] * s[i] + s[j] * s[j] - 1.0, product = s[i] * s[j];
    r.symmetric[p] = lambda * trace + mu * (squares + product);
    r.skew[p] = lambda * trace + mu * (squares - product);
  }
  return r;
}

PrincipalResponse response_of(const Elastic& material, const Vec3d& stretch) {
  switch (material.law) {
    case Law::kStableNeoHookean:
      return stable_neo_hookean(material.mu, material.lambda, stretch);
    case Law::kStVenantKirchhoff:
      return st_venant_kirchhoff(material.mu, material.lambda, stretch);
    case Law::kCorotational:
      break;
  }
  return corotational(material.mu, material.lambda, stretch);
}

// psi += mu sum (c / s_i - 1 + log(s_i / c)) of the s_i < c = kCrushed, continued below kFlat to second order.
void harden(double mu, const Vec3d& s, PrincipalResponse& r) {
  Vec3d stress = Vec3d::Zero(), slope = Vec3d::Zero();
  for (int i = 0; i < 3; ++i) {
    if (!(s[i] < kCrushed)) continue;
    const double x = std::max(s[i], kFlat), below = s[i] - x, at = mu * (x - kCrushed) / (x * x);
    slope[i] = mu * (2.0 * kCrushed - x) / (x * x * x);
    stress[i] = at + slope[i] * below;
    r.energy += mu * (kCrushed / x - 1.0 + std::log(x / kCrushed)) + (at + 0.5 * slope[i] * below) * below;
  }
  r.stress += stress;
  r.hessian += Mat3d(slope.asDiagonal());
  for (int p = 0; p < 3; ++p) {
    const int i = (p + 1) % 3, j = (p + 2) % 3;
    const double apart = s[i] - s[j];
    r.symmetric[p] += std::abs(apart) > 1e-6 ? (stress[i] - stress[j]) / apart : slope[i];
    r.skew[p] += (stress[i] + stress[j]) / std::max(s[i] + s[j], 1e-3);
  }
}

}  // namespace

PrincipalResponse principal_response(const Elastic& material, const Vec3d& stretch) {
  PrincipalResponse response = response_of(material, stretch);
  if (material.hardens && stretch.minCoeff() < kCrushed) harden(material.mu, stretch, response);
  return response;
}

PrincipalResponse make_definite(PrincipalResponse response) {
  response.symmetric = response.symmetric.cwiseMax(0.0);
  response.skew = response.skew.cwiseMax(0.0);
  // Gershgorin first: the usual case needs no eigenvalues.
  bool dominant = true;
  for (int i = 0; i < 3; ++i) {
    const double off = std::abs(response.hessian(i, (i + 1) % 3)) + std::abs(response.hessian(i, (i + 2) % 3));
    dominant = dominant && response.hessian(i, i) >= off;
  }
  if (!dominant) {
    Eigen::SelfAdjointEigenSolver<Mat3d> eigen(response.hessian);
    const Vec3d positive = eigen.eigenvalues().cwiseMax(0.0);
    response.hessian = eigen.eigenvectors() * positive.asDiagonal() * eigen.eigenvectors().transpose();
  }
  return response;
}

}  // namespace efsi::material
