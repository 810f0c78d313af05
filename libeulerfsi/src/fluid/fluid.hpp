// Purpose: state of the ambient fluid and the smoke that it carries; regions of simple shape.
#pragma once

#include <vector>

#include "grid/boundary.hpp"
#include "grid/grid.hpp"

namespace efsi::fluid {

using grid::Grid;
using grid::VectorField;
using grid::Walls;

inline constexpr double kThinFluid = 0.01;  // of a solid's density: one that adds next to nothing to its inertia

struct FluidParams {
  bool present = true;
  double density = 1.0;    // rho_f [kg/m^3]
  double viscosity = 0.0;  // mu_f [Pa s]; 0: none, and the fluid slips along solids
  double vorticity_confinement = 0.0;
  double smoke_buoyancy = 0.0;        // [m/s^2]
  double temperature_buoyancy = 0.0;  // [m/s^2/K]

  bool is_thin_beside(double solid_density) const { return !present || density <= kThinFluid * solid_density; }
  bool is_viscous() const { return present && viscosity > 0.0; }
};

struct FluidState {
  VectorField velocity;           // nodes [m/s]
  std::vector<Real> pressure;     // padded cells [Pa]; where PCR starts on Eq. 12
  double carried_time = 0.0;      // for which the carried part of it has acted already; 0: none has [s]
  std::vector<Real> smoke;        // cells, density; empty where the scene has no smoke
  std::vector<Real> temperature;  // cells, above ambient [K]; empty where unused
};

// A box or a ball.
struct Region {
  enum class Shape : std::int32_t { kBox = 0, kSphere = 1 };
  static constexpr int kShapes = 2;
  Shape shape = Shape::kBox;
  Eigen::Matrix4d from_world = Eigen::Matrix4d::Identity();  // world [m] to the unit box or ball

  // edge: what is so near to the border of the unit box, or in its square to that of the ball, is in it, too.
  bool contains(const Vec3d& x, double edge = 0.0) const {
    const Vec3d p = (from_world * x.homogeneous()).head<3>();
    return shape == Shape::kBox ? p.cwiseAbs().maxCoeff() <= 0.5 + edge : p.squaredNorm() <= 0.25 + edge;
  }
  Vec3d middle() const { return -from_world.topLeftCorner<3, 3>().inverse() * from_world.topRightCorner<3, 1>(); }
};

}  // namespace efsi::fluid
