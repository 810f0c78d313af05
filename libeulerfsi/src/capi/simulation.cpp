// Purpose: simulation.h: creation, stepping, cancel, checkpoint, hash.
#include <algorithm>

#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "sim/checkpoint.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

namespace {

constexpr double kMaxCells = 4096.0;  // along an axis, the finest grid that is looked at
constexpr int kBisections = 60;

// The smallest voxel size whose estimate stays within the limit. Throws Error(kMemory) when not even one cell fits.
double fitting_voxel(efsi::sim::Params params, double solid_volume) {
  const auto fits = [&](double voxel) {
    params.voxel_size = voxel;
    return efsi::sim::estimate_memory(params, solid_volume) <= static_cast<double>(params.memory_limit);
  };
  double coarse = params.domain_size.maxCoeff(), fine = coarse / kMaxCells;
  if (fits(fine)) return fine;
  if (!fits(coarse))
    throw Error(ErrorCode::kMemory, "EfsiSimulationDef.memory_limit = " + std::to_string(params.memory_limit) +
                                        ": no voxel size needs so few bytes");
  for (int i = 0; i < kBisections; ++i) {
    const double middle = 0.5 * (fine + coarse);
    (fits(middle) ? coarse : fine) = middle;
  }
  return coarse;
}

}  // namespace

EfsiStatus efsi_simulation_def_init(EfsiSimulationDef* def, size_t size) { return initialise(def, size); }

EfsiStatus efsi_simulation_estimate_memory(const EfsiSimulationDef* def, double solid_volume, uint64_t* bytes,
                                           double* fitting_voxel_size, EfsiError* error) {
  return guarded(error, [&] {
    const efsi::sim::Params params = to_params(receive(def, "efsi_simulation_estimate_memory: def"));
    check("efsi_simulation_estimate_memory: solid_volume", solid_volume, {0.0, kInfinity, false});
    if (bytes) *bytes = to_bytes(efsi::sim::estimate_memory(params, solid_volume));
    if (fitting_voxel_size) *fitting_voxel_size = params.memory_limit > 0 ? fitting_voxel(params, solid_volume) : 0.0;
  });
}

EfsiStatus efsi_simulation_def_get_slab_axis(const EfsiSimulationDef* def, int32_t* axis, EfsiError* error) {
  return guarded(error, [&] {
    const efsi::sim::Params params = to_params(receive(def, "efsi_simulation_def_get_slab_axis: def"));
    demand(axis, "efsi_simulation_def_get_slab_axis: axis");
    *axis = efsi::grid::slab_axis(efsi::sim::make_grid(params), params.walls);
  });
}

EfsiStatus efsi_simulation_def_get_step_limits(const EfsiSimulationDef* def, double lightest_density,
                                               EfsiStepLimits* limits, size_t size, EfsiError* error) {
  return guarded(error, [&] {
    constexpr const char* kName = "efsi_simulation_def_get_step_limits";
    const efsi::sim::Params params = to_params(receive(def, "efsi_simulation_def_get_step_limits: def"));
    check("efsi_simulation_def_get_step_limits: lightest_density", lightest_density, {0.0, kInfinity, true});
    demand(limits, "efsi_simulation_def_get_step_limits: limits");
    give(to_c(efsi::sim::step_limits(params, lightest_density)), limits, size, kName);
  });
}

EfsiStatus efsi_simulation_create(const EfsiSimulationDef* def, EfsiSim** sim, EfsiError* error) {
  if (sim) *sim = nullptr;
  return guarded(error, [&] {
    const EfsiSimulationDef full = receive(def, "efsi_simulation_create: def");
    demand(sim, "efsi_simulation_create: sim");
    *sim = new EfsiSim(to_params(full), to_log(full.log, full.log_user));
  });
}

void efsi_simulation_destroy(EfsiSim* sim) { delete sim; }

const char* efsi_simulation_last_error(const EfsiSim* sim) { return sim ? sim->last_error.c_str() : ""; }

EfsiStatus efsi_simulation_step(EfsiSim* sim, double max_dt, EfsiStepInfo* info, size_t size) {
  return guarded(sim, [&] {
    if (info) check_size<EfsiStepInfo>(size, "efsi_simulation_step: size");
    const EfsiStepInfo done = to_c(sim->simulation.step(max_dt));
    if (info) give(done, info, size, "efsi_simulation_step");
  });
}

EfsiStatus efsi_simulation_advance(EfsiSim* sim, double duration, EfsiStepInfo* info, size_t size,
                                   EfsiProgressCallback progress, void* user) {
  return guarded(sim, [&] {
    // Also after a cancel or a failure, info describes the completed steps.
    const auto tell = [&](const EfsiStepInfo& done) {
      if (info) give(done, info, size, "efsi_simulation_advance");
    };
    tell(EfsiStepInfo{});
    const auto between_steps = [&](double fraction, const efsi::sim::StepInfo& last) {
      const EfsiStepInfo done = to_c(last);
      tell(done);
      return progress && progress(user, std::min(1.0, fraction), &done) != 0;
    };
    tell(to_c(sim->simulation.advance(duration, between_steps)));
  });
}

EfsiStatus efsi_simulation_get_time(const EfsiSim* sim, double* time, uint64_t* steps) {
  return guarded(sim, [&] {
    if (time) *time = sim->simulation.state().time;
    if (steps) *steps = sim->simulation.state().steps;
  });
}

EfsiStatus efsi_simulation_get_hash(EfsiSim* sim, uint64_t* hash) {
  return guarded(sim, [&] {
    demand(hash, "efsi_simulation_get_hash: hash");
    sim->simulation.prepare();
    *hash = efsi::sim::state_hash(sim->simulation.state());
  });
}

EfsiStatus efsi_simulation_save_checkpoint(EfsiSim* sim, const char* path) {
  return guarded(sim, [&] {
    demand_path(path, "efsi_simulation_save_checkpoint: path");
    sim->simulation.prepare();
    efsi::sim::save_checkpoint(sim->simulation, path);
  });
}

EfsiStatus efsi_simulation_restore_checkpoint(EfsiSim* sim, const char* path) {
  return guarded(sim, [&] {
    demand_path(path, "efsi_simulation_restore_checkpoint: path");
    efsi::sim::restore_checkpoint(sim->simulation, path);
  });
}

EfsiStatus efsi_simulation_restore_state(EfsiSim* sim, const char* path) {
  return guarded(sim, [&] {
    demand_path(path, "efsi_simulation_restore_state: path");
    efsi::sim::restore_state(sim->simulation, path);
  });
}

EfsiStatus efsi_simulation_restore_solids(EfsiSim* sim, const char* path) {
  return guarded(sim, [&] {
    demand_path(path, "efsi_simulation_restore_solids: path");
    efsi::sim::restore_solids(sim->simulation, path);
  });
}
