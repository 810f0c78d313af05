// Purpose: what a step reports of itself (EfsiStepInfo).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "frame/contact_pair.hpp"
#include "frame/energy_record.hpp"
#include "frame/given_motion.hpp"
#include "frame/step_limit.hpp"
#include "frame/transport_report.hpp"

namespace efsi::sim {

struct StepInfo {
  double time = 0.0, dt = 0.0;
  std::uint64_t steps = 0, velocity_iterations = 0, pressure_iterations = 0;
  double velocity_residual = 0.0, pressure_residual = 0.0;
  double divergence_before = 0.0, divergence_after = 0.0;
  double divergence_before_solid = 0.0, divergence_after_solid = 0.0;
  double max_speed_solid = 0.0, max_speed_fluid = 0.0;
  double min_det_f = 1.0, max_det_f = 1.0;
  std::uint64_t degenerate_cells = 0, retries = 0, unconverged = 0;
  StepRule limit_rule = StepRule::kEnd;                  // of the last step, as the next two
  std::uint32_t limiting_solid = 0, limiting_other = 0;  // StepLimit
  Repairs repairs;                                       // of the last step
  std::vector<TransportError> transport;  // per solid, of the last step; empty where nothing restores momenta
  std::vector<PinReaction> pins;          // of the last step
  std::vector<double> jets;               // what each emitter brings in, in the last step [m^3/s]
  std::optional<EnergyRecord> energy;     // of the last step, where the ledger is on
  ContactPairs contacts;                  // of the last step
};

}  // namespace efsi::sim
