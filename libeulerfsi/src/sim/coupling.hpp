// Purpose: the lines of Algorithm 1 that join solids and fluid on the common grid.
// Paper: Alg. 1 lines 7-9, 22; Sec. 4.2. Where the paper has one velocity at a node, the fluid slips
// (docs/deviations.md).
#pragma once

#include "sim/step.hpp"

namespace efsi::sim {

// Line 3.
void compute_solid_masses(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work,
                          Profile& profile);
// Lines 3 and 7: the solids' masses; where the common grid then lies; the fluid's where they leave room, part of the
// cells that is solid, fixed components.
void compute_masses(const Parallel& parallel, const Scene& scene, State& state, Workspace& work, Profile& profile);
// Puts broken cells back in shape after the transport; where there are any, computes the masses anew. Returns how many.
std::uint64_t repair_maps(const Parallel& parallel, const Scene& scene, State& state, Workspace& work,
                          Profile& profile);
// What gravity changes in the velocities of the fluid and of each solid in a step [m/s].
struct Weight {
  Vec3 fluid;
  std::vector<Vec3> solids;
};
// Weight less the buoyancy in an ambient density, whose hydrostatic pressure the pressure leaves out: the fluid's. So a
// solid floats by what it weighs and not by how the stairs of its cells sum up the pressure, and what has the fluid's
// density stays at rest. A light solid is not pushed up with more than its weight, which the elastic solve would follow
// before the pressure answers; the rest of its buoyancy is the pressure's.
Weight weight_in_step(const Scene& scene, double dt, const Workspace& work);
// v = sum_l m_l v_l / sum_l m_l over the solids and the fluid, each with its weight less its buoyancy; at slip nodes
// the two stay apart. Takes the fluid's velocity out of the state until its advection.
void combine_velocities(const Parallel& parallel, const Scene& scene, const Weight& weight, State& state,
                        Workspace& work);
// v += dt f_ext / m of the other forces, emitters.
void add_external_forces(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                         ScopedTimer& timer);
// Components that walls fix; one normal velocity where the fluid slips.
void impose_walls(const Parallel& parallel, Workspace& work);
// Line 8: G and f* on the nodes that carry solids.
void assemble_velocity_system(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                              Profile& profile);
// Line 9, Eq. 8.
void solve_velocity(const Parallel& parallel, const Scene& scene, Workspace& work, Profile& profile, StepInfo& info);
// The frame in which a solid's velocity field keeps its shape for the step: that of the rigid body with its momenta,
// which moves by the mean of those at the step's start and now. While walls hold a solid its field rests on the grid,
// and the mean moves it along them only.
solid::RigidStep transport_frame(const Scene& scene, const Workspace& work, std::size_t l, double dt);
// Which cells carry stiffness, for the next step's choice.
void remember_elements(const Scene& scene, const Workspace& work, std::size_t l, double dt, State& state);
// Line 22: velocity and smoke.
void advect_fluid(const Parallel& parallel, const Scene& scene, double dt, State& state, Workspace& work,
                  Profile& profile);
// The solids' momenta at the start of the step, of the state's velocities.
void measure_first_momenta(const Parallel& parallel, const State& state, Workspace& work);
// Momenta before the transport, lines 19 to 22, and their restoration after it. The fluid's is kept along periodic axes
// of a box without open faces.
void measure_momentum(const Parallel& parallel, const Scene& scene, const State& state, Workspace& work);
void restore_momentum(const Parallel& parallel, const Scene& scene, State& state, Workspace& work, Profile& profile);
// Speeds, det F, clamped cells.
void measure(const Parallel& parallel, const Scene& scene, State& state, const Workspace& work, StepInfo& info);

}  // namespace efsi::sim
