// Purpose: solids that may change their volume and whose bulk stiffness the pressure has (SolidRest::bulk): what their
// cells are compliant under it, and the volume change that they request (docs/numerics/bulk-by-pressure.md).
#pragma once

#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"
#include "solve/pressure_equation.hpp"

namespace efsi::sim {

// D of their cells, h^3 / (dt^2 kappa theta), theta their dilatation, per padded cell [m^4/kg]; empty where no solid
// has a bulk stiffness. active: padded cells with a pressure; empty: all.
void compute_compliance(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                        const Matter& matter, const std::vector<std::uint8_t>& active, std::vector<Real>& compliance);
// Adds the divergence that would give them their volume at rest in the step.
void add_bulk_source(const StepContext& step, const SolidStates& states, const SolidWorks& solids, const Matter& matter,
                     std::vector<Real>& source);
// What the step has made of the dilatation of solid l's material, before it moves.
void carry_dilatation(const StepContext& step, std::size_t l, const Matter& matter, const PressureEquation& pressure,
                      const solid::SolidWork& work, solid::SolidState& state);
// The cells give direction to q, which acts from now on: what that is goes into the wanted divergence.
void deform_by_pressure(const Parallel& parallel, const grid::Grid& g, const std::vector<Real>& q,
                        PressureEquation& pressure);

}  // namespace efsi::sim
