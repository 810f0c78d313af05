#include "material/plastic_flow.hpp"

#include <cmath>

namespace efsi::material {
namespace {

constexpr int kMostHalvings = 60;
constexpr double kTightness = 1e-12;  // of the strain that flows, relative

Vec3d deviator(const Vec3d& v) { return v - Vec3d::Constant(v.mean()); }

// Root of a function that is > 0 at 0 and < 0 at `high`: false position that halves a value which stays (Illinois).
template <class Function>
double root(const Function& function, double at_zero, double high) {
  double low = 0.0, f_low = at_zero, f_high = function(high);
  if (!(f_high < 0.0)) return high;
  int side = 0;
  for (int it = 0; it < kMostHalvings && high - low > kTightness * high; ++it) {
    const double x = (low * f_high - high * f_low) / (f_high - f_low), f = function(x);
    if (f == 0.0) return x;
    if (f > 0.0) {
      low = x;
      f_low = f;
      if (side > 0) f_high *= 0.5;
      side = 1;
    } else {
      high = x;
      f_high = f;
      if (side < 0) f_low *= 0.5;
      side = -1;
    }
    if (std::abs(f) <= kTightness * at_zero) return x;
  }
  return 0.5 * (low + high);
}

}  // namespace

double equivalent_stress(const Elastic& elastic, const Vec3d& stretch) {
  const Vec3d kirchhoff = principal_response(elastic, stretch).stress.cwiseProduct(stretch);
  return std::sqrt(1.5) * deviator(kirchhoff).norm();
}

Flow plastic_flow(const Elastic& elastic, const Plastic& plastic, const Vec3d& stretch, double accumulated, double dt) {
  Flow flow;
  flow.strain = stretch.array().log().matrix();
  const double above = equivalent_stress(elastic, stretch) - plastic.yield_stress - plastic.hardening * accumulated;
  const Vec3d shear = deviator(flow.strain);
  const double size = shear.norm();
  if (!(above > 0.0) || !(size > 0.0)) return flow;
  const Vec3d way = shear / size;
  const double per_strain = std::sqrt(2.0 / 3.0);  // equivalent strain of a deviator of norm 1
  const auto excess = [&](double strain) {
    const Vec3d rest = (flow.strain - strain * way).array().exp().matrix();
    return equivalent_stress(elastic, rest) - plastic.yield_stress -
           plastic.hardening * (accumulated + per_strain * strain);
  };
  const double strain = root(excess, above, size) * -std::expm1(-plastic.flow_rate * dt);
  flow.strain -= strain * way;
  flow.accumulated = per_strain * strain;
  return flow;
}

}  // namespace efsi::material
