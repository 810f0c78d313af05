// Purpose: the coupling of line 10: elasticity responds within the step to what the pressure removes from v*
// (docs/numerics/coupling-step.md).
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solve/pressure_equation.hpp"
#include "solve/velocity_equation.hpp"

namespace efsi::sim {

inline constexpr int kMostCoupling = 8;  // coupling steps in a step, beside the first

// J^T q on the unknowns, where walls leave them free. Fills the ghosts of q.
void compute_impulses(const Parallel& parallel, const grid::Grid& grid, const system::VelocitySystem& system,
                      const system::SlipNodes& slip, std::vector<Real>& q, std::vector<Real>& impulse);
// Eq. 13: pressure.correction = G^-1 J^T q on the nodes that carry solids.
void solve_correction(const StepContext& step, const grid::Grid& g, const system::SlipNodes& slip, std::vector<Real>& q,
                      system::VelocitySystem& elasticity, PressureEquation& pressure);
// v -= M^-1 J^T q, but v = v* - share G^-1 J^T q on the nodes that carry solids.
void correct_velocity(const StepContext& step, std::vector<Real>& q, Real share, const VelocityEquation& elasticity,
                      PressureEquation& pressure, NodeVelocity& velocity);

// Whether elasticity has to respond to the pressure, by the divergence that this is to take.
bool needs_coupling(const Scene& scene, const system::DivergenceNorms& divergence);
// A pressure that leaves little of the divergence: where the first coupling step goes.
void estimate_direction(const StepContext& step, PressureEquation& pressure, std::vector<Real>& direction);
// A coupling step, from the velocity of the right-hand side of Eq. 12. direction: of the search, a pressure that the
// projection would take; becomes what the step has taken.
void couple_pressure(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     std::vector<Real>& direction, VelocityEquation& elasticity, PressureEquation& pressure,
                     NodeVelocity& velocity);
// Whether to project by pressure.q would strain the solids by more energy than it takes, and more than a part of
// theirs, or close active contact rows.
bool strains_much(const StepContext& step, const SolidWorks& solids, const grid::Grid& g, const system::SlipNodes& slip,
                  VelocityEquation& elasticity, PressureEquation& pressure);

}  // namespace efsi::sim
