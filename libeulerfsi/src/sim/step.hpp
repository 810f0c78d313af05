// Purpose: one step of Algorithm 1, one call per line.
// Paper: Alg. 1.
#pragma once

#include <optional>
#include <span>

#include "base/parallel.hpp"
#include "sim/energy_ledger.hpp"
#include "sim/params.hpp"
#include "sim/profile.hpp"
#include "sim/state.hpp"
#include "sim/step_record.hpp"
#include "sim/workspace.hpp"

namespace efsi::sim {

// What a step reports (EfsiStepInfo).
struct StepInfo {
  double time = 0.0, dt = 0.0;
  std::uint64_t steps = 0, velocity_iterations = 0, pressure_iterations = 0;
  double velocity_residual = 0.0, pressure_residual = 0.0;
  double divergence_before = 0.0, divergence_after = 0.0;
  double divergence_before_solid = 0.0, divergence_after_solid = 0.0;
  double max_speed_solid = 0.0, max_speed_fluid = 0.0;
  double min_det_f = 1.0, max_det_f = 1.0;
  std::uint64_t degenerate_cells = 0, retries = 0, unconverged = 0;
  Repairs repairs;                         // of the last step
  std::vector<TransportChange> transport;  // per solid, of the last step; empty where nothing restores momenta
  std::optional<EnergyRecord> energy;      // of the last step, where the ledger is on
};

struct Scene {
  const Params& params;
  const grid::Grid& grid;
  const std::vector<solid::SolidRest>& solids;
  const std::vector<fluid::Emitter>& emitters;
};

// Advances `state` by one step of at most `remaining` seconds, smaller by `shrink` than the limits allow.
StepInfo step(const Parallel& parallel, const Scene& scene, double remaining, double shrink, State& state,
              Workspace& work, Profile& profile);

}  // namespace efsi::sim
