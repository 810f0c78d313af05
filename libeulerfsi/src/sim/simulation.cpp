#include "sim/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <sstream>
#include <thread>

#include "base/byte_count.hpp"
#include "base/error.hpp"
#include "base/kernel.hpp"
#include "geometry/overlap.hpp"
#include "linalg/reduce.hpp"
#include "sim/checkpoint.hpp"
#include "sim/slab_state.hpp"
#include "solid/displacement.hpp"
#include "solid/mass.hpp"
#include "solid/material_force.hpp"
#include "solid/momentum.hpp"
#include "solid/plasticity.hpp"
#include "solid/surface.hpp"

namespace efsi::sim {
namespace {

constexpr int kMaxRetries = 4;
constexpr double kRetryTravel = 4.0;        // cells that a solid may have moved in a step before it is repeated smaller
constexpr double kRetryStrain = 0.5;        // strain of a compressible solid, which no pressure keeps from overshooting
constexpr double kLostShare = 0.1;          // of a solid's elements; more degenerate ones than that: its shape is lost
constexpr std::uint64_t kLostElements = 8;  // and no fewer than these

// Of a solid where it starts: along an axis, and of its volume. Further away det F is not told apart.
constexpr double kLeastStretch = 0.2, kMostStretch = 5.0, kLeastGrowth = 0.1, kMostGrowth = 10.0;

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

[[noreturn]] void refuse(const std::string& field, double value, const std::string& limit) {
  std::ostringstream text;
  text << field << " = " << value << ": must be " << limit;
  throw Error(ErrorCode::kArgument, text.str());
}

void validate(const SolidDesc& d) {
  const auto positive = [](const char* field, double value) {
    if (!(value > 0.0) || !std::isfinite(value))
      refuse(std::string("EfsiSolidDef.") + field, value, "a finite number > 0");
  };
  const auto not_negative = [](const char* field, double value) {
    if (!(value >= 0.0) || !std::isfinite(value))
      refuse(std::string("EfsiSolidDef.") + field, value, "a finite number >= 0");
  };
  positive("density", d.density);
  positive("youngs_modulus", d.youngs_modulus);
  if (!(d.poissons_ratio >= -0.9 && d.poissons_ratio <= 0.499))
    refuse("EfsiSolidDef.poissons_ratio", d.poissons_ratio, "between -0.9 and 0.499");
  not_negative("rayleigh_alpha", d.rayleigh_alpha);
  not_negative("rayleigh_beta", d.rayleigh_beta);
  not_negative("friction", d.friction);
  not_negative("contact_stiffness", d.contact_stiffness);
  not_negative("plastic_yield_stress", d.plastic.yield_stress);
  positive("plastic_flow_rate", d.plastic.flow_rate);
  not_negative("plastic_hardening", d.plastic.hardening);
  for (int a = 0; a < 3; ++a) {
    if (!std::isfinite(d.velocity[a])) refuse("EfsiSolidDef.velocity", d.velocity[a], "finite");
    if (!std::isfinite(d.angular_velocity[a])) refuse("EfsiSolidDef.angular_velocity", d.angular_velocity[a], "finite");
    if (!(d.stretch[a] >= kLeastStretch && d.stretch[a] <= kMostStretch))
      refuse("EfsiSolidDef.stretch", d.stretch[a], "between 0.2 and 5");
  }
  if (!(d.stretch.prod() >= kLeastGrowth && d.stretch.prod() <= kMostGrowth))
    refuse("EfsiSolidDef.stretch: product", d.stretch.prod(), "between 0.1 and 10");
}

// A solid's shape where it starts: that at rest, or that stretched about its centre of volume.
std::shared_ptr<const geometry::Surface> stretched(const SolidDesc& desc, const Vec3d& center, double spacing,
                                                   std::shared_ptr<const geometry::Surface> rest,
                                                   const std::optional<geometry::Slab>& slab,
                                                   const Parallel& parallel) {
  if (desc.stretch == Vec3d::Ones()) return rest;
  geometry::TriangleMesh mesh = rest->mesh;
  if (slab)  // as it was before it was laid in the slab
    for (std::size_t v = 0; v < mesh.points.size(); ++v) mesh.points[v][slab->axis] = rest->along[v];
  for (Vec3d& x : mesh.points) x = center + desc.stretch.cwiseProduct(x - center);
  auto surface = geometry::examine(std::move(mesh), spacing, parallel);
  return slab ? geometry::lay_in_slab(*surface, *slab, parallel) : surface;
}

constexpr double kTurning = 1e-6;  // what turning a scene to the axes of the box leaves

// In a slab solids start without a velocity across it, but for rounding.
void demand_flat(const SolidDesc& d, int axis) {
  constexpr const char* name[3] = {".x", ".y", ".z"};
  const std::string limit = std::string("0 in a slab, a domain one cell thick along ") + name[axis][1];
  if (std::abs(d.velocity[axis]) > kTurning * d.velocity.norm())
    refuse(std::string("EfsiSolidDef.velocity") + name[axis], d.velocity[axis], limit);
  if (d.stretch[axis] != 1.0)
    refuse(std::string("EfsiSolidDef.stretch") + name[axis], d.stretch[axis], std::string("1") + limit.substr(1));
  for (const int a : {(axis + 1) % 3, (axis + 2) % 3})
    if (std::abs(d.angular_velocity[a]) > kTurning * d.angular_velocity.norm())
      refuse(std::string("EfsiSolidDef.angular_velocity") + name[a], d.angular_velocity[a], limit);
}

constexpr double kOnBorder = 1e-3;  // cells: what is so near to the border of a region is in it

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

std::size_t Simulation::add_solid(const SolidDesc& desc, geometry::MeshReport& report) {
  return add_body(desc, false, report);
}

std::size_t Simulation::add_collider(const SolidDesc& desc, geometry::MeshReport& report) {
  SolidDesc body = desc;
  body.compressible = true;  // no pressure acts in it
  body.density = std::max(desc.density, params_.fluid.density);
  body.velocity = body.angular_velocity = Vec3d::Zero();
  Pin pin;
  pin.solid = add_body(body, true, report);
  pin.whole = true;
  pin.vertices.assign(solids_[pin.solid].surface.points.size(), 1);
  pin.low = report.extent_min;
  pin.high = report.extent_max;
  pin.motion.center = geometry::center_of_volume(solids_[pin.solid].surface);
  pins_.push_back(std::move(pin));
  return pins_.size() - 1;
}

void Simulation::demand_inside(const geometry::MeshReport& report) const {
  constexpr const char* axis[3] = {"x", "y", "z"};
  const Vec3d top = params_.domain_min + params_.domain_size;
  for (int a = 0; a < 3; ++a)
    if (report.extent_min[a] < params_.domain_min[a] - 1e-6 * grid_.h ||
        report.extent_max[a] > top[a] + 1e-6 * grid_.h) {
      std::ostringstream text;
      text << "EfsiSolidDef.mesh: extends from " << report.extent_min[a] << " to " << report.extent_max[a] << " in "
           << axis[a] << ", the domain from " << params_.domain_min[a] << " to " << top[a];
      throw Error(ErrorCode::kArgument, text.str());
    }
}

// Of the next solid. Colliders may lie in each other.
void Simulation::demand_apart(bool collider, const geometry::SignedDistance& distance) const {
  for (std::size_t other = 0; other < solids_.size(); ++other) {
    if (collider && is_collider(pins_, other)) continue;
    const geometry::Overlap found =
        geometry::overlap(starts_[other] ? starts_[other]->distance : solids_[other].distance, distance, parallel_);
    if (found.depth <= kMostOverlap * grid_.h) continue;
    throw Error(ErrorCode::kArgument,
                "EfsiSolidDef.mesh: solid " + std::to_string(solids_.size() + 1) + " overlaps solid " +
                    std::to_string(other + 1) + " by " + number(found.depth) + " m (" + number(found.volume) +
                    " m^3): must be at most half a voxel, " + number(kMostOverlap * grid_.h) + " m");
  }
}

std::size_t Simulation::add_body(const SolidDesc& desc, bool collider, geometry::MeshReport& report) {
  if (state_.steps > 0) throw Error(ErrorCode::kArgument, "efsi_solid_add: solids are added before the first step");
  validate(desc);
  solid::SolidRest rest;
  rest.elastic = material::from_youngs_modulus(desc.law, desc.youngs_modulus, desc.poissons_ratio);
  if (params_.numerics.volume_by_pressure && !desc.compressible) rest.elastic = material::beside_pressure(rest.elastic);
  rest.density = desc.density;
  rest.rayleigh_alpha = desc.rayleigh_alpha;
  rest.rayleigh_beta = desc.rayleigh_beta;
  rest.friction = desc.friction;
  rest.contact_stiffness = desc.contact_stiffness;
  rest.compressible = desc.compressible;
  rest.plastic = desc.plastic;
  const double spacing = kRestSpacing * grid_.h;
  auto surface = desc.examined ? desc.examined : geometry::examine(desc.surface, spacing, parallel_);
  if (surface->distance.spacing != spacing)
    refuse("EfsiSolidDef.surface: made for voxel_size", surface->distance.spacing / kRestSpacing,
           "the simulation's, " + number(grid_.h));
  const std::optional<geometry::Slab> slab = slab_of(params_, grid_);
  if (slab) {
    demand_flat(desc, slab->axis);
    if (surface->distance.flat != slab->axis) surface = geometry::lay_in_slab(*surface, *slab, parallel_);
  } else if (surface->distance.flat >= 0) {
    throw Error(ErrorCode::kArgument, "EfsiSolidDef.surface: laid in a slab: must not be, where the domain is none");
  }
  report = surface->report;
  if (report.repaired) log_.warning("mesh repaired: " + report.repairs);
  rest.distance = surface->distance;
  rest.surface = surface->mesh;
  if (params_.numerics.uses_particles()) rest.nearest = geometry::NearestTriangle(rest.surface);
  rest.along = surface->along;
  rest.clusters = solid::make_surface_clusters(rest.surface, rest.distance, grid_.h);
  rest.volume = report.solid_volume;
  rest.area = geometry::surface_area(rest.surface);
  if (!(rest.volume > 0.0)) throw Error(ErrorCode::kMesh, "EfsiSolidDef.mesh: encloses no volume");
  const Vec3d center = geometry::center_of_volume(rest.surface);
  auto start = stretched(desc, center, spacing, surface, slab, parallel_);
  const geometry::MeshReport& placed = start->report;
  if (!collider) demand_inside(placed);
  demand_apart(collider, start->distance);
  if (placed.thinnest_feature < 2.0 * grid_.h) {
    std::ostringstream text;
    text << "solid " << solids_.size() + 1 << ": its thinnest feature is about " << placed.thinnest_feature
         << " m, less than two voxels of " << grid_.h << " m; voxel size " << 0.5 * placed.thinnest_feature
         << " m would resolve it";
    log_.warning(text.str());
  }

  // Band and initial state: u = x - X, v = velocity + angular velocity x (x - centre).
  solid::SolidState state;
  Vec3i lo, hi;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    lo[s] = static_cast<int>(std::floor((placed.extent_min[a] - grid_.origin[a]) / grid_.h));
    hi[s] = static_cast<int>(std::ceil((placed.extent_max[a] - grid_.origin[a]) / grid_.h));
  }
  solid::move_band(state, solid::make_band(grid_, lo, hi));
  const grid::Grid& g = state.band.grid;
  std::fill(state.valid.begin(), state.valid.end(), solid::kKnown);
  const Vec3d shift = Vec3d::Ones() - desc.stretch.cwiseInverse();
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const Vec3d arm = g.node_position(i, j, k) - center, v = desc.velocity + desc.angular_velocity.cross(arm);
        state.u.set(g.node(i, j, k), shift.cwiseProduct(arm).cast<Real>());
        state.v.set(g.node(i, j, k), v.cast<Real>());
      }
  state.surface = start->mesh.points;
  if (slab) flatten(parallel_, rest, slab->axis, state);
  if (rest.plastic.yields()) {
    rest.plastic_lattice = solid::make_plastic_lattice(report.extent_min, report.extent_max, grid_.h);
    state.plastic.resize(rest.plastic_lattice.node_count());
  }
  double speed = 0.0;
  for (const Vec3d& x : state.surface)
    speed = std::max(speed, (desc.velocity + desc.angular_velocity.cross(x - center)).cwiseAbs().maxCoeff());

  solid::SolidWork work;
  solid::compute_mass(parallel_, rest, state, work);
  if (work.element_cell.empty() && !collider) {
    std::ostringstream text;
    text << "EfsiSolidDef.mesh: no cell of size " << grid_.h
         << " m lies inside the solid; its thinnest feature is about " << placed.thinnest_feature << " m";
    throw Error(ErrorCode::kMesh, text.str());
  }
  state.rest_volume_cells = start == surface ? work.volume : rest.volume;  // few cells measure what is pressed
  state.speed = speed;
  starts_.push_back(start == surface ? nullptr : std::move(start));
  solids_.push_back(std::move(rest));
  state_.solids.push_back(std::move(state));
  work_.solids.push_back(std::move(work));
  prepared_ = false;
  return solids_.size() - 1;
}

std::size_t Simulation::add_emitter(fluid::Emitter emitter, const geometry::Surface* volume) {
  if (state_.steps > 0) throw Error(ErrorCode::kArgument, "efsi_emitter_add: emitters are added before the first step");
  if (volume && volume->distance.spacing != kRestSpacing * grid_.h)
    refuse("efsi_emitter_add: volume: made for voxel_size", volume->distance.spacing / kRestSpacing,
           "the simulation's, " + number(grid_.h));
  fluid::place_emitter(grid_, volume, emitter);
  emitters_.push_back(std::move(emitter));
  prepared_ = false;  // the first frame shows it, also when the fields were looked at before
  return emitters_.size() - 1;
}

void Simulation::set_keys(std::size_t emitter, std::vector<fluid::EmitterKey> keys) {
  if (state_.steps > 0) throw Error(ErrorCode::kArgument, "efsi_emitter_set_keys: keys are set before the first step");
  emitters_[emitter].keys = std::move(keys);
  prepared_ = false;
}

std::size_t Simulation::add_pin(std::size_t solid, const geometry::SignedDistance& volume) {
  Pin pin;
  pin.solid = solid;
  const std::optional<geometry::Slab> slab = slab_of(params_, grid_);
  pin.region = slab ? geometry::flattened(volume, *slab) : volume;
  for (float& distance : pin.region.values) distance -= static_cast<float>(kOnBorder * grid_.h);
  return add_pin(std::move(pin));
}

std::size_t Simulation::add_pin(std::size_t solid, const std::vector<std::uint8_t>& vertices) {
  Pin pin;
  pin.solid = solid;
  pin.region = region_of(solids_[solid].surface, vertices, grid_.h);
  if (const auto slab = slab_of(params_, grid_)) pin.region = geometry::flattened(pin.region, *slab);
  return add_pin(std::move(pin));
}

std::size_t Simulation::add_pin(Pin pin) {
  if (state_.steps > 0) throw Error(ErrorCode::kArgument, "efsi_pin_add: pins are added before the first step");
  const std::string name = "pin " + std::to_string(pins_.size() + 1) + " of solid " + std::to_string(pin.solid + 1);
  if (is_collider(pins_, pin.solid))
    throw Error(ErrorCode::kArgument, name + ": must hold a solid that moves, and that is a collider");
  if (starts_[pin.solid])
    throw Error(ErrorCode::kArgument,
                name + ": must hold a solid that starts in its shape at rest, and that is stretched");
  const solid::SolidState& state = state_.solids[pin.solid];
  const grid::Grid& g = state.band.grid;
  std::size_t held = 0;
  Vec3d sum = Vec3d::Zero();
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    const auto [i, j, k] = g.node_place(n);
    const Vec3d X = g.node_position(i, j, k);
    if (!work_.solids[pin.solid].carries[n] || !pin.holds(X)) continue;
    ++held;
    sum += X;
  }
  if (held == 0)
    throw Error(ErrorCode::kArgument, name +
                                          ": the region holds 0 nodes of the solid: must be at least 1; it lies beside "
                                          "the solid or between the nodes of voxels of " +
                                          number(grid_.h) + " m");
  for (const Vec3d& X : solids_[pin.solid].surface.points) pin.vertices.push_back(pin.holds(X));
  pin.low = pin.region.origin;
  pin.high = pin.region.node(pin.region.size[0] - 1, pin.region.size[1] - 1, pin.region.size[2] - 1);
  pin.motion.center = sum / static_cast<double>(held);
  pins_.push_back(std::move(pin));
  return pins_.size() - 1;
}

void Simulation::set_motion(std::size_t pin, double start, double end, const Pose& from, const Pose& to) {
  GivenMotion motion{start, end, from, to, pins_[pin].motion.center};
  if (const int slab = grid::slab_axis(grid_, params_.walls); slab >= 0)
    for (Pose* pose : {&motion.from, &motion.to}) {
      if (pose->turn(slab, slab) < 1.0 - kTurning)
        throw Error(ErrorCode::kArgument, "pin " + std::to_string(pin + 1) +
                                              ": its pose turns out of the slab: must turn about its axis, " +
                                              "xyz"[slab]);
      pose->shift[slab] = 0.0;  // nothing moves across a slab
    }
  pins_[pin].motion = motion;
}

std::size_t Simulation::add_passenger(std::size_t solid, std::vector<Vec3d> points) {
  passengers_.emplace_back(solid, solid::make_passenger(parallel_, solids_[solid], grid_.h, std::move(points)));
  return passengers_.size() - 1;
}

std::size_t Simulation::add_force(const ForceField& force) {
  if (state_.steps > 0) throw Error(ErrorCode::kArgument, "efsi_force_add: forces are added before the first step");
  if (force.end_time < force.start_time)
    refuse("EfsiForceDef.end_time", force.end_time, "at least start_time, " + number(force.start_time));
  forces_.push_back(force);
  return forces_.size() - 1;
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

// A step whose result is looked at: a bad one is rolled back and repeated with half the size.
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
    StepInfo info = sim::step(parallel_, scene, remaining, shrink, state_, work_, profile_);
    {
      ScopedTimer timer(profile_, Stage::kCheck);
      reason.clear();
      if (!finite(parallel_, state_.fluid.velocity) || !finite(parallel_, state_.fluid.pressure))
        reason = "a value of the fluid is not finite";
      if (!std::isfinite(info.velocity_residual) || !std::isfinite(info.pressure_residual))
        reason = "a solve met values that are not finite";
      for (std::size_t l = 0; l < solids_.size() && reason.empty(); ++l) {
        const bool given = is_collider(pins_, l);
        if (work_.solids[l].element_cell.empty() && !given) reason = "solid " + std::to_string(l + 1) + " has vanished";
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
    if (reason.empty()) {
      std::string end = lost_shape();
      if (end.empty()) end = crosses_periodic_face();
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
    shrink = std::min(0.5 * info.dt / remaining, 0.5 * shrink);
    state_ = work_.backup;
    work_.forget();
  }
  throw Error(ErrorCode::kDiverged,
              diverged(state_.time, reason + " after " + std::to_string(kMaxRetries) + " retries with smaller steps"));
}

// Why the run cannot go on: a solid touches a periodic face, whose two copies of a node would then hold different
// matter. Empty: it can.
std::string Simulation::crosses_periodic_face() const {
  for (std::size_t l = 0; l < solids_.size(); ++l)
    for (const Vec3d& x : state_.solids[l].surface)
      for (int a = 0; a < 3; ++a) {
        const auto axis = static_cast<std::size_t>(a);
        const double cell = (x[a] - grid_.origin[a]) / grid_.h;
        if (!grid_.periodic[axis] || (cell > 1.0 && cell < grid_.cells[axis] - 1.0)) continue;
        return "solid " + std::to_string(l + 1) + " has come within a cell of the periodic faces along " + "xyz"[a] +
               ", which solids cannot cross; a larger box, or walls there, keep it away";
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

SolidDiagnostics Simulation::diagnose_solid(std::size_t index) {
  const solid::SolidRest& rest = solids_[index];
  const solid::SolidState& state = state_.solids[index];
  solid::SolidWork& work = work_.solids[index];
  solid::compute_mass(parallel_, rest, state, work);
  solid::compute_material(parallel_, rest, state, params_.numerics.points_per_element, work);

  SolidDiagnostics d;
  const solid::Momenta momenta = solid::measure_momenta(parallel_, state.band, work, state.band.grid, state.v);
  d.mass = momenta.mass;
  d.center = momenta.center;
  d.momentum = momenta.linear;
  d.angular_momentum = momenta.angular;
  d.kinetic_energy = momenta.kinetic_energy;
  d.elastic_energy = work.elastic_energy;
  d.rest_volume = rest.volume;
  d.rest_volume_cells = state.rest_volume_cells;
  d.volume_cells = work.volume;
  d.volume_mesh = rest.volume * solid::volume_ratio(rest, state);
  d.extent_min.setConstant(std::numeric_limits<double>::infinity());
  d.extent_max = -d.extent_min;
  for (const Vec3d& x : state.surface) {
    d.extent_min = d.extent_min.cwiseMin(x);
    d.extent_max = d.extent_max.cwiseMax(x);
  }
  d.min_det_f = work.min_det_f;
  d.max_det_f = work.max_det_f;
  d.max_stretch = work.max_stretch;
  d.false_edges = solid::count_false_edges(rest, state, work.max_stretch);
  d.elements = work.element_cell.size();
  d.memory_bytes = work.bytes() + solid::state_bytes(state);
  d.max_plastic_strain = solid::largest_plastic_strain(state);
  return d;
}

FluidDiagnostics Simulation::diagnose_fluid() {
  prepare();
  FluidDiagnostics d;
  if (!params_.fluid.present) return d;
  const std::vector<Real>& fraction = solid_fraction();
  struct Sums {
    double energy = 0.0, smoke = 0.0, speed = 0.0, divergence = 0.0;
    Vec3d momentum = Vec3d::Zero();
  };
  const double h3 = grid_.h * grid_.h * grid_.h;
  const auto corner = grid::corner_offsets(grid_);
  std::vector<Sums> planes(static_cast<std::size_t>(grid_.cells[2]));
  parallel_.for_each(grid_.cells[2], [&](std::int64_t kk) {
    Sums& s = planes[static_cast<std::size_t>(kk)];
    const int k = static_cast<int>(kk);
    for (int j = 0; j < grid_.cells[1]; ++j)
      for (int i = 0; i < grid_.cells[0]; ++i) {
        const std::size_t c = grid_.cell(i, j, k), n = grid_.node(i, j, k);
        const double part = fraction.empty() ? 1.0 : 1.0 - static_cast<double>(fraction[c]);
        if (!state_.fluid.smoke.empty()) s.smoke += h3 * static_cast<double>(state_.fluid.smoke[c]);
        double divergence = 0.0;
        for (std::size_t a = 0; a < 8; ++a) {
          const Vec3d v = state_.fluid.velocity.at(n + corner[a]).cast<double>();
          const double m = params_.fluid.density * h3 * part / 8.0;
          s.energy += 0.5 * m * v.squaredNorm();
          s.momentum += m * v;
          s.speed = std::max(s.speed, part > 0.0 ? v.norm() : 0.0);
          for (int x = 0; x < 3; ++x) divergence += (grid::kCorner[a][x] ? v[x] : -v[x]) / (4.0 * grid_.h);
        }
        if (part == 1.0) s.divergence = std::max(s.divergence, std::abs(divergence));
      }
  });
  for (const Sums& s : planes) {
    d.kinetic_energy += s.energy;
    d.momentum += s.momentum;
    d.smoke += s.smoke;
    d.max_speed = std::max(d.max_speed, s.speed);
    d.max_divergence = std::max(d.max_divergence, s.divergence);
  }
  return d;
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
  std::vector<Real>& fraction = fills_box() ? work_.matter.cell_fraction : box_.fraction;
  fraction.clear();
  if (solids_.empty()) return fraction;
  fraction.assign(grid_.cell_count(), 0);
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    solid::compute_mass(parallel_, solids_[l], state_.solids[l], work_.solids[l]);
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
  if (fills_box()) return state_.fluid.velocity;
  box_.velocity.assign(grid_.node_count());
  return box_.velocity;
}

std::uint64_t Simulation::memory_bytes() const {
  const Matter& matter = work_.matter;
  const VelocityEquation& elasticity = work_.elasticity;
  const PressureEquation& pressure = work_.pressure;
  ByteCount count;
  visit_fields(state_, count);
  visit_fields(work_.backup, count);
  for (const auto* field : {&work_.velocity.field, &box_.velocity})
    for (const auto& c : field->c) count.array(c);
  for (const auto* values :
       {&matter.fluid_mass, &matter.mass, &matter.specific_volume, &matter.cell_fraction, &elasticity.f_star,
        &elasticity.v_star, &elasticity.momentum, &pressure.source, &pressure.q, &pressure.taken, &pressure.impulse,
        &pressure.correction, &pressure.corrected, &box_.fraction, &box_.pressure})
    count.array(*values);
  count.array(matter.fixed);
  count.array(matter.owned);
  std::uint64_t sum = count.bytes + work_.velocity.slip.bytes() + elasticity.system.bytes() + pressure.system.bytes() +
                      work_.advect.bytes() + work_.solid_advect.bytes() + work_.viscous.bytes();
  for (const auto& solid : work_.solids) sum += solid.bytes();
  for (const auto& particles : work_.particles) sum += particles.bytes();
  for (const auto& solid : solids_) sum += solid.nearest.bytes();
  for (const fluid::Emitter& emitter : emitters_) sum += emitter.bytes();
  return sum;
}

void Simulation::set_velocity(const float* values) {
  prepare();
  const std::size_t n = grid_.node_count();
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t i = 0; i < n; ++i) state_.fluid.velocity.c[a][i] = static_cast<Real>(values[a * n + i]);
  state_.fluid_speed = 0.0;
  for (const auto& c : state_.fluid.velocity.c)
    for (Real v : c) state_.fluid_speed = std::max(state_.fluid_speed, static_cast<double>(std::abs(v)));
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
    for (const auto& c : field.c)
      for (Real v : c) solid.speed = std::max(solid.speed, static_cast<double>(std::abs(v)));
  } else {
    solid::place_surface(parallel_, solids_[index], solid);
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
