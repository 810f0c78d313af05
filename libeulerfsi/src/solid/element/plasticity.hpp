// Purpose: the plastic part of a solid's deformation: where it is stored, what it does to an element, how it flows.
// F = F_e F_p. The laws are isotropic, so that F_p counts by C_p = F_p^T F_p alone: (F_e F_e^T)^-1 = F^-T C_p F^-1.
// Stored is H = 1/2 log C_p, a symmetric matrix without trace (det F_p = 1 under sums and means), on the nodes of a
// lattice in the rest shape. Material does not move in it, so that no transport blurs it (docs/numerics/plasticity.md).
// Source: Bargteil et al. 2007; Fan et al. 2013, Sec. 3.7; the paper's Secs. 4, 5 (a grid of the reference
// coordinates).
#pragma once

#include <array>

#include "base/parallel.hpp"
#include "solid/map/reference_map.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// H and the accumulated equivalent strain at a point.
struct PlasticStrain {
  Mat3d log = Mat3d::Zero();
  double accumulated = 0.0;
  bool none = true;  // both are 0 all around
};

// Reads the lattice; everywhere `none` where the solid cannot yield.
class PlasticField {
 public:
  PlasticField(const SolidRest& rest, const SolidState& state);
  bool empty() const { return nodes_.empty(); }
  PlasticStrain at(const Vec3d& X) const;
  // C_p = exp(2 H)
  Mat3d metric(const Vec3d& X) const;
  // Its root: F_p but for a rotation.
  Mat3d stretch(const Vec3d& X) const;
  // Amplitudes of the hourglass modes (x,y), (x,z), (y,z) of X in an element of a body that only F_p deforms [m].
  // inverse_f: at its centre X; h: its edge.
  std::array<Vec3d, 3> hourglass(const Vec3d& X, const Mat3d& inverse_f, double h) const;

 private:
  const Grid& lattice_;
  const std::vector<PlasticNode>& nodes_;
};

// What an element is made of at one quadrature point, and its hourglass modes.
struct ElasticPoint {
  Deformation elastic;               // of F_e
  Mat3d metric = Mat3d::Identity();  // C_p
  double total_stretch = 1.0;        // largest principal stretch of F, at most kElementStretch.most
  // Of a solid that can yield:
  bool yielded = false;         // something has flown here
  Vec3d place = Vec3d::Zero();  // X
  PlasticStrain strain;
  Mat3d inverse_f = Mat3d::Identity();  // F^-1
};

// u: displacements of the 8 corners, x0: place of the lowest one; local: coordinates of the point (hexahedron.hpp).
ElasticPoint elastic_point(const PlasticField& plastic, const Vec3d u[8], const Vec3d& x0, double h,
                           const Vec3d& local);

// The hourglass modes of an element: what those of X lack of those of the yielded shape, without yield -u on them.
// Where a solid can yield their force grows no more beyond the energy that an element stores at the yield stress.
struct Hourglass {
  std::array<Vec3d, 4> amplitudes{Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};  // [m]
  double stiffness = 0.0;  // k: the force is k F^-T C_p X_m [N/m]
  double energy = 0.0;     // from which it derives [J]
};
// mu: of the element, its weight included [Pa].
Hourglass hourglass_modes(const SolidRest& rest, const PlasticField& plastic, const ElasticPoint& center,
                          const Vec3d u[8], double h, double mu);

// Plastic flow in the elements of `work` for a time [s], at constant displacement: changes state.plastic. Where stress
// is nowhere above the yield stress no plastic strain changes. Returns whether any did.
bool flow(const Parallel& parallel, const SolidRest& rest, double time, int points_per_element, const SolidWork& work,
          SolidState& state);

// Largest accumulated equivalent plastic strain; 0 where the solid cannot yield.
double largest_plastic_strain(const SolidState& state);

}  // namespace efsi::solid
