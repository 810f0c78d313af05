// Purpose: the affine motion nearest to a solid's velocity that leaves the walls which hold it where they are.
// The transport carries the rest of the velocity in a frame with this motion (docs/numerics/transport-frame.md).
// Departs from the paper: its fields rest on the grid (docs/deviations.md).
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// v(x) = drift + gradient (x - anchor); [m/s], [1/s], [m].
struct AffineFlow {
  Vec3d anchor = Vec3d::Zero(), drift = Vec3d::Zero();
  Mat3d gradient = Mat3d::Zero();
  bool at_rest() const { return drift.isZero(0) && gradient.isZero(0); }
};

// Walls that hold a solid. Bit a of axes: one across axis a; of opposite: one on either side.
struct WallPlanes {
  unsigned axes = 0, opposite = 0;
  Vec3d anchor = Vec3d::Zero();  // in the walls, and along the other axes the solid's centre of mass [m]
};

// Least squares fit to a velocity on `nodes`, weighed by work.mass: across a wall it vanishes in the wall and grows
// with the distance, between opposite walls it vanishes. keeps_volume: the gradient has no trace.
AffineFlow fit_affine_flow(const Parallel& parallel, const Band& band, const SolidWork& work, const Grid& nodes,
                           const VectorField& velocity, const WallPlanes& walls, bool keeps_volume);

// Where it takes points in dt, and back: x -> x + shift + forward (x - anchor), x -> x - shift + back (x - anchor -
// shift).
struct AffineStep {
  Vec3d shift;          // [m]
  Mat3d forward, back;  // less the identity
};
AffineStep affine_step(const AffineFlow& flow, double dt);

}  // namespace efsi::solid
