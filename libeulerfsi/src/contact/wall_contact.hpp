// Purpose: unilateral contact with walls and Coulomb friction: what a step prescribes at the nodes of
// solids on walls. Along n out of the wall, for the gap g to the solid's surface, the wall's impulse p and its
// tangential part r (docs/numerics/wall-contact.md):
//   n.v >= tau,  tau = least_velocity(g) (push_out.hpp),   p >= 0,   |r| <= mu p,   v_t = 0 if <
// An active row prescribes n.v; an inactive one moves with the node above it. The active set follows from the wall
// impulses of the last step, from where the solid would be after this one, and from the velocity solve.
#pragma once

#include "contact/wall_row.hpp"
#include "frame/reaction.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

// Normal force of a face of the box on a solid in the last step [N]; face: -x +x -y +y -z +z.
double pushed_at(const solid::SolidState& solid, std::size_t face);
// One normal velocity where the fluid slips; then the rows of the step, by the velocity that the solids have with all
// forces but their own, and the velocity that walls and rows prescribe. Fixes in matter.fixed what sticks.
void meet_walls(const StepContext& step, const SolidStates& states, const SolidWorks& solids, Matter& matter,
                NodeVelocity& velocity, std::vector<WallRow>& rows);
// Whether a row of the solid is active.
bool is_on_wall(const std::vector<WallRow>& rows, std::size_t solid);
// What is fixed in the velocity solve: matter.fixed without inactive rows, and what sticks above walls.
std::vector<std::uint8_t> held_components(const std::vector<std::uint8_t>& fixed, const std::vector<WallRow>& rows);
// Ties the nodes of inactive rows to those above them.
void tie_rows(const std::vector<WallRow>& rows, system::VelocitySystem& system);
// The right-hand side of Eq. 8, and the momentum that its solution has to have [kg m/s].
struct RightSides {
  std::vector<Real>&f_star, &momentum;
};
// Adds the friction of what slides to the right-hand sides.
void add_friction(const std::vector<WallRow>& rows, const system::VelocitySystem& system, RightSides right);
// After a velocity solve, whose answer is v: rows that it has led beyond what they allow hold, too, and what friction
// has turned around sticks. Whether there are any: the solve has to be repeated.
bool hold_more(std::vector<WallRow>& rows, system::VelocitySystem& system, RightSides right, std::vector<Real>& v);
// Normal and friction impulses of walls in the velocity solve, and by the pressure, which moves no node on a wall.
void add_velocity_reactions(const Reaction& reaction, std::vector<WallRow>& rows);
// Normal impulses by the projection at nodes on walls that Eq. 8 lets leave: the projection holds them.
void add_projection_reactions(const Reaction& reaction, std::vector<WallRow>& rows);
// Those of a coupling step along what Eq. 8 holds and the projection does not: above walls, and where a row sticks
// late.
void add_coupling_reactions(const Reaction& reaction, std::vector<WallRow>& rows);
// The velocity solve ends at a tolerance: what it leaves of a solid's momentum along axes that walls hold is theirs,
// too. sums: of the reactions of all nodes of each solid.
void share_remainder(const std::vector<Vec3d>& sums, const Reaction& reaction, std::vector<WallRow>& rows);
void add_pressure_reactions(const Reaction& reaction, std::vector<WallRow>& rows);
// The pressure moves nodes above walls: those of active rows are reset to what these prescribe. mass: of all matter.
void reset_above_walls(const std::vector<Real>& mass, NodeVelocity& velocity, std::vector<WallRow>& rows);
// What the next step wants to know.
void remember_rows(double dt, const std::vector<WallRow>& rows, SolidStates& states);
// The fluid's own velocity at the nodes of rows, fixed by walls.
void still_fluid(const std::vector<WallRow>& rows, grid::VectorField& flow);

}  // namespace efsi::sim
