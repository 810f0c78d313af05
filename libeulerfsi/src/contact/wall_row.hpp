// Purpose: the rows of walls: nodes of solids on them, and what walls do there (contact/wall_contact.hpp).
#pragma once

#include "base/math_types.hpp"

namespace efsi::sim {

// Friction at a row: none, sliding, or sticking.
enum class FrictionState : std::uint8_t { kNone, kSlides, kSticks };

// A node of a solid on a wall.
struct WallRow {
  std::size_t solid = 0, node = 0, above = 0;  // nodes of the common grid
  Vec3i place{};                               // of the node, in the box
  bool on_wall = true;                         // or it is the first node above it that carries the solid
  int axis = 0;                                // normal of the wall
  Real out = 1;                                // +-1: along the axis, out of the wall
  double gap = 0.0;                            // to the solid's surface, < 0: beyond the wall [m]
  double vertex = 1e30;                        // the same of the lowest vertex that is nearest to the node [m]
  Real least = 0;                              // velocity along that [m/s]
  bool holds = false;                          // prescribes it
  FrictionState friction_state = FrictionState::kNone;
  bool late = false;                      // sticks since the velocity solve: the projection moves it along the wall
  std::uint8_t tangents = 0;              // bit a: friction acts along axis a
  Real limit = 0;                         // impulse of friction at most [kg m/s]
  Vec3 sliding_direction = Vec3::Zero();  // unit vector along which it slides
  Real normal_impulse = 0;                // impulse of the wall along `out` in this step [kg m/s]
  Vec3 friction_impulse = Vec3::Zero();   // along the tangents, where it sticks [kg m/s]
};

}  // namespace efsi::sim
