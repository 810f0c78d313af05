// Purpose: simulation.h: creation, stepping, cancel, checkpoint, hash.
#include <algorithm>

#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "frame/parameter_table.inc"
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

EfsiStatus efsi_simulation_def_init(EfsiSimulationDef* def) {
  if (!def) return EFSI_ERROR_ARGUMENT;
  start_definition(*def);
#define EFSI_DEFAULT(name, field, kind, initial, min, max, exclusive, unit) def->field = initial;
  EFSI_DOMAIN_PARAMETERS(EFSI_DEFAULT)
#undef EFSI_DEFAULT
  def->domain_size = {1.0, 1.0, 1.0};
  return EFSI_OK;
}

EfsiStatus efsi_simulation_estimate_memory(const EfsiSimulationDef* def, double solid_volume, uint64_t* bytes,
                                           double* fitting_voxel_size, EfsiError* error) {
  return guarded(error, [&] {
    demand(def, "efsi_simulation_estimate_memory: def");
    check_definition(*def);
    check("efsi_simulation_estimate_memory: solid_volume", solid_volume, {0.0, kInfinity, false});
    const efsi::sim::Params params = to_params(*def);
    if (bytes) *bytes = to_bytes(efsi::sim::estimate_memory(params, solid_volume));
    if (fitting_voxel_size) *fitting_voxel_size = def->memory_limit > 0 ? fitting_voxel(params, solid_volume) : 0.0;
  });
}

EfsiStatus efsi_simulation_create(const EfsiSimulationDef* def, EfsiSim** sim, EfsiError* error) {
  if (sim) *sim = nullptr;
  return guarded(error, [&] {
    demand(def, "efsi_simulation_create: def");
    demand(sim, "efsi_simulation_create: sim");
    check_definition(*def);
    *sim = new EfsiSim(to_params(*def), to_log(def->log, def->log_user));
  });
}

void efsi_simulation_destroy(EfsiSim* sim) { delete sim; }

const char* efsi_simulation_last_error(const EfsiSim* sim) { return sim ? sim->last_error.c_str() : ""; }

EfsiStatus efsi_simulation_step(EfsiSim* sim, double max_dt, EfsiStepInfo* info) {
  return guarded(sim, [&] {
    const EfsiStepInfo done = to_c(sim->simulation.step(max_dt));
    if (info) *info = done;
  });
}

EfsiStatus efsi_simulation_advance(EfsiSim* sim, double duration, EfsiStepInfo* info, EfsiProgressCallback progress,
                                   void* user) {
  return guarded(sim, [&] {
    if (info) *info = EfsiStepInfo{};
    // Also after a cancel or a failure, info describes the completed steps.
    const auto between_steps = [&](double fraction, const efsi::sim::StepInfo& last) {
      const EfsiStepInfo done = to_c(last);
      if (info) *info = done;
      return progress && progress(user, std::min(1.0, fraction), &done) != 0;
    };
    const EfsiStepInfo done = to_c(sim->simulation.advance(duration, between_steps));
    if (info) *info = done;
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

EfsiStatus efsi_simulation_restore_solids(EfsiSim* sim, const char* path) {
  return guarded(sim, [&] {
    demand_path(path, "efsi_simulation_restore_solids: path");
    efsi::sim::restore_solids(sim->simulation, path);
  });
}
