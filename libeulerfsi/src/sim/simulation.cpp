#include "sim/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <thread>

#include "base/error.hpp"
#include "base/kernel.hpp"
#include "base/refuse.hpp"
#include "linalg/reduce.hpp"
#include "record/contact_record.hpp"
#include "record/step_record.hpp"
#include "sim/checkpoint.hpp"
#include "sim/step_loss.hpp"
#include "sim/time_step.hpp"
#include "solid/element/mass.hpp"
#include "solid/map/displacement.hpp"
#include "solid/surface/surface.hpp"
#include "solve/carried_pressure.hpp"

namespace efsi::sim {
namespace {

constexpr int kMaxRetries = 4;
constexpr double kRetryStrain = 0.5;        // strain of a compressible solid, which no pressure keeps from overshooting
constexpr double kLostShare = 0.1;          // of a solid's elements; more degenerate ones than that: its shape is lost
constexpr std::uint64_t kLostElements = 8;  // and no fewer than these

std::string diverged(double time, const std::string& reason) {
  std::ostringstream text;
  text << "diverged at time " << time << " s: " << reason << "; the state is that of the last good step";
  return text.str();
}

// Whether all are: what is not finite leaves another difference from itself than 0.
EFSI_KERNEL bool finite(std::int64_t n, const Real* values) {
  int bad = 0;
#pragma omp simd reduction(| : bad)
  for (std::int64_t i = 0; i < n; ++i) bad |= !(values[i] - values[i] == 0);
  return bad == 0;
}

bool finite(const Parallel& parallel, const std::vector<Real>& values) {
  constexpr std::int64_t kChunk = 65536;
  const auto n = static_cast<std::int64_t>(values.size());
  return parallel.sum((n + kChunk - 1) / kChunk, [&](std::int64_t chunk) {
    return finite(std::min(n - chunk * kChunk, kChunk), values.data() + chunk * kChunk) ? 0.0 : 1.0;
  }) == 0.0;
}

bool finite(const Parallel& parallel, const grid::VectorField& field) {
  return finite(parallel, field.c[0]) && finite(parallel, field.c[1]) && finite(parallel, field.c[2]);
}

// Copies the fields of one state to another.
struct Copy {
  const Parallel& parallel;
  template <class T>
  void value(T& to, const T& from) {
    to = from;
  }
  template <class T>
  void array(std::vector<T>& to, const std::vector<T>& from) {
    linalg::copy(parallel, to, from);
  }
};

}  // namespace

int thread_count(int requested) {
  return requested > 0 ? requested : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

Simulation::Simulation(const Params& params, Log log)
    : params_(params), log_(std::move(log)), parallel_(thread_count(params.threads)) {
  validate(params_);
  grid_ = make_grid(params_);
  if (params_.memory_limit > 0) {
    const double need = estimate_memory(params_, 0.0);
    if (need > static_cast<double>(params_.memory_limit)) {
      const double fit = params_.voxel_size * std::cbrt(need / static_cast<double>(params_.memory_limit));
      std::ostringstream text;
      text << "EfsiSimulationDef.voxel_size = " << params_.voxel_size << ": the simulation needs about "
           << need / 1048576.0 << " MiB, the limit is " << static_cast<double>(params_.memory_limit) / 1048576.0
           << " MiB; voxel_size " << fit << " would fit";
      throw Error(ErrorCode::kMemory, text.str());
    }
  }
}

void Simulation::prepare() {
  if (prepared_) return;
  prepared_ = true;
  if (!params_.fluid.present) return;
  state_.window = {{0, 0, 0}, grid_.cells};
  if (state_.fluid.velocity.size() != grid_.node_count()) state_.fluid.velocity.assign(grid_.node_count());
  if (state_.fluid.pressure.size() != grid_.padded_count()) state_.fluid.pressure.assign(grid_.padded_count(), 0);
  bool smoke = false, temperature = false;
  for (const fluid::Emitter& e : emitters_) {
    smoke = smoke || e.gives_smoke();
    temperature = temperature || e.gives_heat();
  }
  if (smoke && state_.fluid.smoke.empty()) state_.fluid.smoke.assign(grid_.cell_count(), 0);
  if (temperature && state_.fluid.temperature.empty()) state_.fluid.temperature.assign(grid_.cell_count(), 0);
  // What the first frame shows; the steps apply emitters again. Solids may have come since the last time.
  if (state_.steps == 0) {
    const std::vector<Real>& fraction = solid_fraction();
    fluid::apply_emitters(grid_, emitters_, state_.time, 0.0, fraction, {}, 0, state_.fluid, nullptr);
    for (auto* field : {&state_.fluid.smoke, &state_.fluid.temperature})
      for (std::size_t c = 0; c < field->size() && c < fraction.size(); ++c)
        if (fraction[c] > Real(0.5)) (*field)[c] = 0;
  }
}

StepInfo Simulation::step(double max_dt) {
  if (!(max_dt > 0.0) || !std::isfinite(max_dt)) refuse("efsi_simulation_step: max_dt", max_dt, "a finite number > 0");
  prepare();
  contacts_.clear();
  StepInfo info;
  parallel_.together([&] { info = checked_step(max_dt); });
  return info;
}

StepInfo Simulation::advance(double duration, const Progress& progress) {
  if (!(duration > 0.0) || !std::isfinite(duration))
    refuse("efsi_simulation_advance: duration", duration, "a finite number > 0");
  prepare();
  contacts_.clear();
  const double start = state_.time, end = start + duration;
  StepInfo total;
  while (end - state_.time > 1e-9 * duration) {
    StepInfo info;
    parallel_.together([&] { info = checked_step(end - state_.time); });
    const StepInfo sums = total;
    total = info;
    total.steps += sums.steps;
    total.velocity_iterations += sums.velocity_iterations;
    total.pressure_iterations += sums.pressure_iterations;
    total.degenerate_cells += sums.degenerate_cells;
    total.retries += sums.retries;
    total.unconverged += sums.unconverged;
    if (end - state_.time <= 1e-9 * duration) state_.time = total.time = end;  // lands exactly
    if (progress && progress((state_.time - start) / duration, total))
      throw Error(ErrorCode::kCancelled, "cancelled by the progress callback");
  }
  return total;
}

// The fields of the fluid are most of the state.
void Simulation::keep_backup() {
  Copy copy{parallel_};
  const State& from = state_;
  visit_box_fields(copy, work_.backup, from);
  work_.backup.window = state_.window;
  work_.backup.solids = state_.solids;
}

// A step; where it fails on the way, since the points of a collider bound no volume, the state is that before it.
StepInfo Simulation::try_step(const Scene& scene, double remaining, double shrink) {
  try {
    return sim::step(parallel_, scene, remaining, shrink, state_, work_, profile_);
  } catch (const Error&) {
    state_ = work_.backup;
    work_.forget();
    throw;
  }
}

// A step whose result is looked at: a bad one is rolled back and repeated, shorter.
StepInfo Simulation::checked_step(double remaining) {
  const auto begin = std::chrono::steady_clock::now();
  box_ = {};
  {
    ScopedTimer timer(profile_, Stage::kCheck);
    keep_backup();
  }
  const Scene scene{params_, grid_, solids_, emitters_, forces_, pins_};
  double shrink = 1.0;
  std::string reason;
  for (int attempt = 0; attempt <= kMaxRetries; ++attempt) {
    StepInfo info = try_step(scene, remaining, shrink);
    {
      ScopedTimer timer(profile_, Stage::kCheck);
      reason.clear();
      if (!finite(parallel_, state_.fluid.velocity) || !finite(parallel_, state_.fluid.pressure))
        reason = "a value of the fluid is not finite";
      if (!std::isfinite(info.velocity_residual) || !std::isfinite(info.pressure_residual))
        reason = "a solve met values that are not finite";
      for (std::size_t l = 0; l < solids_.size() && reason.empty(); ++l) {
        const bool given = is_collider(pins_, l);
        if (work_.solids[l].element_cell.empty() && !given && state_.solids[l].whole)
          reason = "solid " + std::to_string(l + 1) + " has vanished";
        if (!finite(parallel_, state_.solids[l].u) || !finite(parallel_, state_.solids[l].v))
          reason = "solid " + std::to_string(l + 1) + ": a value is not finite";
        if (solids_[l].compressible && !given && params_.cfl_solid <= kRetryTravel &&
            solid::largest_strain_rate(parallel_, state_.solids[l], state_.solids[l].valid) * info.dt > kRetryStrain)
          reason = "solid " + std::to_string(l + 1) + " was strained by more than " + std::to_string(kRetryStrain);
        const double travel = std::max(kRetryTravel, params_.cfl_solid);
        if (work_.solids[l].max_speed * info.dt > travel * grid_.h)
          reason = "solid " + std::to_string(l + 1) + " moved more than " + std::to_string(travel) + " cells";
      }
    }
    const bool errs = reason.empty() && attempt < kMaxRetries && work_.masses_ready &&
                      keep_energy(parallel_, scene, info.dt, work_.solids, work_.backup.solids, state_.solids);
    if (reason.empty() && !errs) {
      std::string end = lost_shape();
      if (end.empty()) end = crosses_periodic_face();
      if (end.empty()) end = passed_through(info);
      if (!end.empty()) {
        state_ = work_.backup;
        work_.masses_ready = false;
        throw Error(ErrorCode::kDiverged, diverged(state_.time, end));
      }
      info.retries = static_cast<std::uint64_t>(attempt);
      last_step_ = info;
      add_contacts(info.contacts, contacts_);
      profile_.total_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      ++profile_.steps;
      double staged = 0.0;
      for (std::size_t s = 0; s + 1 < Profile::kStages; ++s) staged += profile_.seconds[s];
      profile_.seconds[static_cast<std::size_t>(Stage::kOther)] = std::max(0.0, profile_.total_seconds - staged);
      return info;
    }
    if (!errs) shrink = std::min(0.5 * info.dt / remaining, 0.5 * shrink);
    state_ = work_.backup;
    work_.forget();
  }
  throw Error(ErrorCode::kDiverged,
              diverged(state_.time, reason + " after " + std::to_string(kMaxRetries) + " retries with smaller steps"));
}

// Why the run cannot go on: a solid touches a periodic face, whose two copies of a node would then hold different
// matter. Empty: it can.
std::string Simulation::crosses_periodic_face() const {
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    if (solid::has_left(state_.solids[l])) continue;
    for (const Vec3d& x : state_.solids[l].surface)
      for (int a = 0; a < 3; ++a) {
        const auto axis = static_cast<std::size_t>(a);
        const double cell = (x[a] - grid_.origin[a]) / grid_.h;
        if (!grid_.periodic[axis] || (cell > 1.0 && cell < grid_.cells[axis] - 1.0)) continue;
        return "solid " + std::to_string(l + 1) + " has come within a cell of the periodic faces along " + "xyz"[a] +
               ", which solids cannot cross; a larger box, or walls there, keep it away";
      }
  }
  return {};
}

// Why the run cannot go on: solids have passed through each other where they are thick enough to be resolved. Empty: it
// can. The paper's contact does not keep them apart.
std::string Simulation::passed_through(const StepInfo& info) const {
  if (!params_.numerics.unilateral_walls) return {};
  for (const ContactPair& pair : info.contacts) {
    if (!pair.passed) continue;
    const auto& [solid, vertex, place] = *pair.passed;
    const std::size_t other = solid == pair.one ? pair.other : pair.one;
    std::ostringstream text;
    text << "solid " << solid + 1 << " has passed through solid " << other + 1 << ": its vertex " << vertex
         << " has come out at (" << place[0] << ", " << place[1] << ", " << place[2]
         << ") m, on another side than it went in; stiffer or thicker parts, smaller voxels or a lower speed may keep "
            "them apart";
    return text.str();
  }
  return {};
}

// Why the run cannot go on: a solid is torn to shreds, which smaller steps do not mend. Empty: it can.
std::string Simulation::lost_shape() const {
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    const solid::SolidWork& work = work_.solids[l];
    if (work.degenerate <= kLostElements ||
        static_cast<double>(work.degenerate) <= kLostShare * static_cast<double>(work.element_cell.size()))
      continue;
    return "solid " + std::to_string(l + 1) + " has lost its shape: " + std::to_string(work.degenerate) + " of its " +
           std::to_string(work.element_cell.size()) +
           " cells are crushed, torn or inverted; a stiffer or more damped material, smaller voxels or a lower speed "
           "may keep it";
  }
  return {};
}

std::vector<Vec3d> Simulation::surface_points(std::size_t index) const {
  std::vector<Vec3d> points = state_.solids[index].surface;
  const std::vector<double>& along = solids_[index].along;
  const int slab = grid::slab_axis(grid_, params_.walls);
  for (std::size_t v = 0; v < along.size(); ++v) points[v][slab] = along[v];
  return points;
}

std::vector<Vec3d> Simulation::surface_velocity(std::size_t index) const {
  std::vector<Vec3d> velocity;
  solid::sample_surface_velocity(parallel_, state_.solids[index], velocity);
  return velocity;
}

void Simulation::locate_passenger(std::size_t index, std::vector<Vec3d>& points, std::vector<Vec3d>& velocities) const {
  const auto& [solid, passenger] = passengers_[index];
  solid::carry(parallel_, solids_[solid], state_.solids[solid], passenger, points, velocities);
}

const std::vector<Real>& Simulation::solid_fraction() {
  if (fills_box() && work_.masses_ready) return work_.matter.cell_fraction;
  std::vector<Real>& fraction = fills_box() ? work_.matter.cell_fraction : box_.fraction;
  fraction.clear();
  if (solids_.empty()) return fraction;
  fraction.assign(grid_.cell_count(), 0);
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    if (!work_.masses_ready) solid::compute_mass(parallel_, solids_[l], state_.solids[l], work_.solids[l]);
    const grid::Grid& band = state_.solids[l].band.grid;
    for (int k = 0; k < band.cells[2]; ++k)
      for (int j = 0; j < band.cells[1]; ++j)
        for (int i = 0; i < band.cells[0]; ++i) {
          Real& f = fraction[grid_.cell(i + band.lo[0], j + band.lo[1], k + band.lo[2])];
          f = std::min(Real(1), f + work_.solids[l].fraction[band.cell(i, j, k)]);
        }
  }
  return fraction;
}

const std::vector<Real>& Simulation::pressure() {
  if (fills_box()) return state_.fluid.pressure;
  return box_.pressure = move_cells(state_.fluid.pressure, state_.window, {{0, 0, 0}, grid_.cells});
}

const grid::VectorField& Simulation::fluid_velocity() {
  if (!fills_box()) {
    box_.velocity.assign(grid_.node_count());
    return box_.velocity;
  }
  const fluid::FluidState& fluid = state_.fluid;
  if (!(fluid.carried_time > 0.0)) return fluid.velocity;
  grid::VectorField& velocity = work_.velocity.field;  // of no use between two steps
  velocity = fluid.velocity;
  take_back_carried(parallel_, {grid_, params_.walls}, state_.solids, fluid.pressure, fluid.carried_time,
                    params_.fluid.density, work_.pressure.q, velocity);
  return velocity;
}

void Simulation::set_velocity(const float* values) {
  prepare();
  const std::size_t n = grid_.node_count();
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t i = 0; i < n; ++i) state_.fluid.velocity.c[a][i] = static_cast<Real>(values[a * n + i]);
  state_.fluid_speed = largest_component(parallel_, grid_, state_.fluid.velocity);
  state_.fluid.carried_time = 0.0;
}

void Simulation::set_smoke(const float* values, bool temperature) {
  prepare();
  auto& field = temperature ? state_.fluid.temperature : state_.fluid.smoke;
  field.assign(values, values + grid_.cell_count());
}

void Simulation::set_solid_field(std::size_t index, bool velocity, const float* values) {
  solid::SolidState& solid = state_.solids[index];
  auto& field = velocity ? solid.v : solid.u;
  const std::size_t n = field.size();
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t i = 0; i < n; ++i) field.c[a][i] = static_cast<Real>(values[a * n + i]);
  std::fill(solid.valid.begin(), solid.valid.end(), solid::kKnown);
  solid.stiff.clear();
  work_.masses_ready = false;
  if (velocity) {
    solid.change = {};
    solid.acceleration = -1.0;
    for (const auto& c : field.c)
      for (Real v : c) solid.speed = std::max(solid.speed, static_cast<double>(std::abs(v)));
  } else {
    std::fill(solid.dilatation.begin(), solid.dilatation.end(), Real(0));
    solid::place_surface(parallel_, solids_[index], solid);
    for (solid::SolidState& any : state_.solids) any.deep.clear();  // it has not moved there through what is there
  }
}

void Simulation::set_state(State state) {
  prepare();
  if (fills_box()) state.window = state_.window;
  state_ = std::move(state);
  contacts_.clear();
  work_.forget();
}

void Simulation::set_solids(std::vector<solid::SolidState> solids) {
  if (state_.steps > 0)
    throw Error(ErrorCode::kArgument, "efsi_simulation_restore_solids: solids are restored before the first step");
  state_.solids = std::move(solids);
  work_.forget();
  prepared_ = false;  // the smoke at the start is where they are not
}

}  // namespace efsi::sim
