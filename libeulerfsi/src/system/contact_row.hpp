// Purpose: a row of contact. It is a point where two solids may touch. B v = sum of weight v over its parts is the
// velocity of the second solid's surface against the first's, r the impulse on the second, n out of the first:
//   n.Bv >= tau,  n.r >= 0,  one of both an equality,   |r_t| <= mu n.r,  (B v)_t against r_t where |r_t| = mu n.r,
//   else 0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <vector>

#include "system/velocity_system.hpp"

namespace efsi::system {

struct ContactRow {
  std::vector<RowPart> parts;              // weights of the second solid add up to 1, of the first to -1
  Vec3d normal = Vec3d::Zero();            // from the first solid to the second
  double least = 0.0;                      // tau [m/s]
  double friction = 0.0;                   // mu
  double normal_impulse = 0.0;             // n.r, in and out [kg m/s]
  Vec3d friction_impulse = Vec3d::Zero();  // r_t, in and out [kg m/s]
  double penalty = 0.0;                    // kappa [kg]; 0: nothing of the row can move
  double hold = 1.0;                       // of the penalty while the pressure acts, over kappa
  bool sticks = false;                     // out
  std::int32_t pair = 0;                   // the same for all rows between two bodies, or of one with itself

  Vec3d impulse() const { return normal_impulse * normal + friction_impulse; }
};

// What a row does while its velocity is w: the multipliers r - kappa (w - tau n), brought back to what they may be.
struct RowAct {
  double normal_impulse = 0.0;             // n.r >= 0 [kg m/s]; 0: open
  Vec3d friction_impulse = Vec3d::Zero();  // r_t, |r_t| <= mu n.r [kg m/s]
  double share = 0.0;                      // of what would make it stick: 1 where it does

  bool closed() const { return normal_impulse > 0.0; }
  Vec3d impulse(const ContactRow& row) const { return normal_impulse * row.normal + friction_impulse; }
};

RowAct act(const ContactRow& row, const Vec3d& w);
// B v of a row.
Vec3d row_velocity(const ContactRow& row, const std::vector<Real>& v);
std::vector<RowAct> acts(const std::vector<ContactRow>& rows, const std::vector<Real>& v);
// Closed rows are penalties in G from now on, friction with its share. held: as stiff as they are
// while the pressure acts.
void close_rows(const Parallel& parallel, const std::vector<ContactRow>& rows, const std::vector<RowAct>& acts,
                VelocitySystem& system, bool held = false);
// f += B^T r of a row.
void add_impulse(const ContactRow& row, const Vec3d& impulse, std::vector<Real>& f);
// f += B^T r with the impulses of all rows.
void add_impulses(const std::vector<ContactRow>& rows, std::vector<Real>& f);

// The largest motion of the rows of a pair, in the root mean square by what they push: a few rows that hardly push
// anything say nothing of two surfaces.
class PairMotion {
 public:
  // weight: impulse [kg m/s]; velocity of the row [m/s].
  void add(const ContactRow& row, double weight, double velocity) {
    Sums& sums = pairs_[row.pair];
    sums.weight += weight;
    sums.square += weight * velocity * velocity;
  }
  double largest() const {  // [m/s]
    double most = 0.0;
    for (const auto& [pair, sums] : pairs_)
      if (sums.weight > 0.0) most = std::max(most, std::sqrt(sums.square / sums.weight));
    return most;
  }

 private:
  struct Sums {
    double weight = 0.0, square = 0.0;
  };
  std::map<std::int32_t, Sums> pairs_;
};

}  // namespace efsi::system
