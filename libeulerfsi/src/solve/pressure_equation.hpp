// Purpose: Eqs. 11 to 13 of a step, and what the coupling steps keep.
#pragma once

#include <vector>

#include "sources/jets.hpp"
#include "system/pressure_solve.hpp"

namespace efsi::sim {

// Eqs. 11 to 13. The multiplier q of J has v = v* - M^-1 J^T q [Pa s]; J^T is minus the gradient, so q = -dt p.
struct PressureEquation {
  system::PressureSystem system;
  bool lasts = false;            // the system of a scene without solids is built
  std::vector<Real> source;      // wanted divergence per padded cell [1/s]; empty: none
  std::vector<Real> compliance;  // of cells under q, per padded cell [m^4/kg]; empty: all are rigid
  Jets jets;                     // the part of it that emitters bring
  std::vector<Real> q;           // the multiplier, padded cells; the state's pressure is put away in it meanwhile
  std::vector<Real> taken;       // the part of q that acts before the projection, padded cells
  bool takes = false;            // if this
  double carried = 0.0;          // of the carried part of the last pressure that has acted before the transport
  std::vector<Real> impulse;     // J^T q on the unknowns of Eq. 8 [kg m/s]
  double largest = 0.0;          // norm of those that Eq. 13 was solved for in the step [kg m/s]
  std::vector<Real> correction;  // G^-1 J^T q on them [m/s]
  std::vector<Vec3> answers;     // of contact to the correction, per penalty in G [kg m/s]
  Real coupled = 0;              // how much of it coupling steps have taken off; 0: there was none
  std::vector<Vec3d> left_over;  // of each solid's J^T q, by the solves of coupling steps; empty: not counted [kg m/s]
  std::vector<Real> corrected;   // v* less a share of the correction on them [m/s]
  std::vector<Real> direction;   // of q that the last coupling step went, padded cells
  std::vector<Real> left;        // the right-hand side of Eq. 12 before it [m^3/s]
  double slope = 0.0;            // that times the estimate from which the search direction was made
  double gain = 0.0;             // error that the last coupling step removed, in the norm of J A^-1 J^T [J]
  double led = 0.0;              // how fast the projection then leads surfaces in contact into each other [m/s]
};

}  // namespace efsi::sim
