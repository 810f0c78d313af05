// Purpose: the plastic part of a solid's deformation: where it is stored, what it does to an element, how it flows.
// F = F_e F_p. The laws are isotropic, so that F_p counts by C_p = F_p^T F_p alone: (F_e F_e^T)^-1 = F^-T C_p F^-1.
// Stored is H = 1/2 log C_p, a symmetric matrix without trace (det F_p = 1 whatever is done to it), on the nodes of a
// lattice in the rest shape. Material does not move in it, so that no transport blurs it (docs/numerics/plasticity.md).
// Source: Bargteil et al. 2007; Fan et al. 2013, Sec. 3.7; the paper's Secs. 4, 5 (a grid of the reference
// coordinates).
#pragma once

#include <array>

#include "base/parallel.hpp"
#include "solid/reference_map.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// Spacing h; covers `low` to `high`, the extent of the rest shape [m], and a cell more.
Grid make_plastic_lattice(const Vec3d& low, const Vec3d& high, double h);

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
  double total_stretch = 1.0;        // largest principal stretch of F, at most kMaxStretch
  // Of a solid that can yield:
  bool yielded = false;         // something has flown here
  Vec3d place = Vec3d::Zero();  // X
  PlasticStrain strain;
  Mat3d inverse_f = Mat3d::Identity();  // F^-1
};

// u: displacements of the 8 corners, x0: place of the lowest one; local: coordinates of the point (hexahedron.hpp).
ElasticPoint elastic_point(const PlasticField& plastic, const Vec3d u[8], const Vec3d& x0, double h,
                           const Vec3d& local);

// What the hourglass modes of X lack of those of the yielded shape, elastic amplitudes [m]; without yield -u on them.
std::array<Vec3d, 4> hourglass_amplitudes(const PlasticField& plastic, const ElasticPoint& center, const Vec3d u[8],
                                          double h);

// Energy k/2 sum_m X_m^T C_p X_m of these amplitudes, k in N/m [J].
double hourglass_energy(double k, const ElasticPoint& center, const std::array<Vec3d, 4>& amplitudes);

// Plastic flow in the elements of `work` at the start of a step of dt: changes state.plastic. The displacement state.u
// stands for the time from the middle of the last step to that of this one (trapezoidal rule; state.flow_due). Where
// stress is nowhere above the yield stress no plastic strain changes.
void flow(const Parallel& parallel, const SolidRest& rest, double dt, int points_per_element, const SolidWork& work,
          SolidState& state);

// Largest accumulated equivalent plastic strain; 0 where the solid cannot yield.
double largest_plastic_strain(const SolidState& state);

}  // namespace efsi::solid
