// Purpose: Eq. 8 with contact: the velocity of G v = f + B^T r under unilateral contact and Coulomb friction. A row is
// a point where two solids may touch. B v = sum of weight v over its parts is the velocity of the second solid's
// surface against the first's, r the impulse on the second, n out of the first:
//   n.Bv >= tau,  n.r >= 0,  one of both an equality,   |r_t| <= mu n.r,  (B v)_t against r_t where |r_t| = mu n.r,
//   else 0
// By augmented Lagrangian: kappa B^T P B stands in G for the rows that are closed (P = n n^T) or stick (P = I),
// semi-smooth Newton steps with line search find which, and r takes up what that leaves
// (docs/numerics/solid-contact.md).
#pragma once

#include <vector>

#include "system/velocity_system.hpp"

namespace efsi::system {

struct ContactRow {
  std::vector<RowPart> parts;    // weights of the second solid add up to 1, of the first to -1
  Vec3d normal = Vec3d::Zero();  // from the first solid to the second
  double least = 0.0;            // tau [m/s]
  double friction = 0.0;         // mu
  double push = 0.0;             // n.r, in and out [kg m/s]
  Vec3d pull = Vec3d::Zero();    // r_t, in and out [kg m/s]
  double penalty = 0.0;          // kappa [kg]; 0: nothing of the row can move
  bool sticks = false;           // out

  Vec3d impulse() const { return push * normal + pull; }
};

// B v of a row.
Vec3d row_velocity(const ContactRow& row, const std::vector<Real>& v);
// f += B^T r
void add_impulses(const std::vector<ContactRow>& rows, std::vector<Real>& f);

// Solves for x, in: start, and for the impulses, in: estimates. The rows that are closed stay in G as penalties.
// Iterations are those of all solves. f: without the rows. negligible: velocities below do not count [m/s].
linalg::SolveStats solve_contact(const Parallel& parallel, VelocitySolver solver, const std::vector<Real>& f,
                                 double tolerance, double negligible, VelocitySystem& system,
                                 std::vector<ContactRow>& rows, std::vector<Real>& x);

}  // namespace efsi::system
