// Purpose: what constrains a solid in a step, and all that changes at once in contact: how much of its
// stiffness is implicit, the frame of its transport, whether the choice of its elements lags, which loss of volume
// counts.
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "solid/momentum.hpp"
#include "solid/solid.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

using SolidPairs = std::set<std::pair<std::size_t, std::size_t>>;

struct Hold {
  unsigned axes = 0;  // bit a: a wall constrains it along axis a; 7: another solid does
  bool touches() const { return axes != 0; }
};

// Solids joined by shared nodes or by contact, directly or through others, in ascending order; one that stands alone,
// too.
struct Cluster {
  std::vector<std::size_t> solids;
  Hold hold;           // of each of them
  unsigned walls = 0;  // bit a: a wall constrains one of them along axis a
  // Solids that constrain only each other move together.
  bool floats() const { return solids.size() > 1 && walls == 0; }
};

struct Holds {
  std::vector<Cluster> clusters;        // by their first solids
  std::vector<std::size_t> cluster_of;  // per solid
  const Hold& of(std::size_t solid) const { return clusters[cluster_of[solid]].hold; }
};
// solids: how many there are in the system; contacts: pairs with active rows.
Holds find_constraints(std::size_t solids, const system::VelocitySystem& system, const SolidPairs& contacts);

// What pace and growth of a step leave of the stiffness: where a solid touches another, as if it were strained much.
system::StiffnessShares shares_while(bool touches, double pace, double strain, double growth);

// The frame in which a solid's velocity field keeps its shape for the step: that of the rigid body with its momenta,
// which moves by the mean of those at the step's start and now. While walls constrain a solid its field is at rest on
// the grid, and the mean moves it along them only (transport/wall_frames.hpp adds to that).
solid::BodyStep transport_frame(const Hold& hold, const solid::Momenta& before, const solid::Momenta& after, double dt);
// Of each solid; those that constrain only each other have that of the rigid body with the momenta of all of them.
// Momenta: per solid; empty: at rest.
std::vector<solid::BodyStep> transport_frames(const Holds& holds, const std::vector<solid::Momenta>& before,
                                              const std::vector<solid::Momenta>& after, double dt);

// Whether the cells that carry stiffness are remembered for the next step's choice. In an impact on a wall cells fill
// and empty faster than the choice may lag. on_wall: a wall of the box holds the solid; cells: that it moves in the
// step.
inline constexpr double kSlow = 0.3;  // cells per step: a solid at rest, or sliding, at a wall
bool has_element_hysteresis(bool on_wall, double cells);

// The part of what a solid has lost, over its volume at rest, that counts: while nothing touches it a film does not.
inline constexpr double kFilm = 0.005;  // cells: thickness over a free surface; its loss under a load stays below that
double lost_beyond_film(const Hold& hold, const solid::SolidRest& rest, double h, double lost);

}  // namespace efsi::sim
