#include "frame/force_field.hpp"

#include <cmath>

namespace efsi::sim {
namespace {

constexpr double kNoiseScale = 0.602;  // makes the mean square of noise_velocity 1
constexpr double kTimeShift = 0.38;    // of the lattice per unit of time: eddies change and do not only fade
constexpr std::uint64_t kSeeds[3] = {0x9e3779b97f4a7c15ull, 0xbf58476d1ce4e5b9ull, 0x94d049bb133111ebull};

// -1 to 1, one number per point of a lattice.
double lattice_value(const std::int64_t (&at)[4], std::uint64_t seed) {
  std::uint64_t state = seed;
  for (const std::int64_t i : at) {
    state ^= static_cast<std::uint64_t>(i) + 0x9e3779b97f4a7c15ull + (state << 6) + (state >> 2);
    state = (state ^ (state >> 30)) * 0xbf58476d1ce4e5b9ull;
    state = (state ^ (state >> 27)) * 0x94d049bb133111ebull;
    state ^= state >> 31;
  }
  return static_cast<double>(state >> 11) / 4503599627370496.0 - 1.0;
}

// Smooth step and its slope.
double blend(double t) { return t * t * t * (t * (6.0 * t - 15.0) + 10.0); }
double blend_slope(double t) { return 30.0 * t * t * (t * (t - 2.0) + 1.0); }

// Gradient in space of smooth noise between the points of a lattice in space and time.
Vec3d noise_gradient(const Vec3d& x, double time, std::uint64_t seed) {
  const double p[4] = {x[0], x[1], x[2], time};
  double part[4];
  std::int64_t low[4];
  for (int a = 0; a < 4; ++a) {
    low[a] = static_cast<std::int64_t>(std::floor(p[a]));
    part[a] = p[a] - static_cast<double>(low[a]);
  }
  Vec3d gradient = Vec3d::Zero();
  for (int corner = 0; corner < 16; ++corner) {
    std::int64_t at[4];
    double weight[4], slope[4];
    for (int a = 0; a < 4; ++a) {
      const int up = corner >> a & 1;
      at[a] = low[a] + up;
      weight[a] = up ? blend(part[a]) : 1.0 - blend(part[a]);
      slope[a] = up ? blend_slope(part[a]) : -blend_slope(part[a]);
    }
    const double value = lattice_value(at, seed) * weight[3];
    gradient += value * Vec3d(slope[0] * weight[1] * weight[2], weight[0] * slope[1] * weight[2],
                              weight[0] * weight[1] * slope[2]);
  }
  return gradient;
}

}  // namespace

Vec3d noise_velocity(const Vec3d& x, double time) {
  const Vec3d moved = x + Vec3d::Constant(kTimeShift * time);
  Vec3d slope[3];  // of the components of a potential, whose curl it is
  for (int c = 0; c < 3; ++c) slope[c] = noise_gradient(moved, time, kSeeds[c]);
  return kNoiseScale * Vec3d(slope[2][1] - slope[1][2], slope[0][2] - slope[2][0], slope[1][0] - slope[0][1]);
}

Vec3d ForceField::velocity_change(const Vec3d& x, const Vec3d& v, double time, double duration) const {
  switch (kind) {
    case Kind::kRadial: {
      const Vec3d away = x - middle();
      const double distance = away.norm();
      return distance > 0.0 ? Vec3d(duration * radial_acceleration / distance * away) : Vec3d(Vec3d::Zero());
    }
    case Kind::kWind: {
      Vec3d wind = wind_velocity;
      if (noise_speed > 0.0) wind += noise_speed * noise_velocity(x / noise_size, time * noise_frequency);
      return -std::expm1(-wind_drag * duration) * (wind - v);
    }
    case Kind::kConstant:
      break;
  }
  return duration * acceleration;
}

}  // namespace efsi::sim
