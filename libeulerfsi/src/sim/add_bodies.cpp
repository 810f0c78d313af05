// Purpose: what is added to a simulation before its first step: solids, colliders, pins, emitters, forces.
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.hpp"
#include "base/refuse.hpp"
#include "frame/slab_state.hpp"
#include "geometry/overlap.hpp"
#include "given/given_shape.hpp"
#include "sim/simulation.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/material_lattice.hpp"
#include "solid/map/credible.hpp"
#include "solid/surface/fold_points.hpp"
#include "solid/surface/surface_clusters.hpp"

namespace efsi::sim {
namespace {

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
    if (!(d.stretch[a] >= solid::kPlausibleStretch.least && d.stretch[a] <= solid::kPlausibleStretch.most))
      refuse("EfsiSolidDef.stretch", d.stretch[a], "between 0.2 and 5");
  }
  if (!(d.stretch.prod() * solid::kMostDetF >= 1.0 && d.stretch.prod() <= solid::kMostDetF))
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
  return slab ? geometry::extrude_in_slab(*surface, *slab, parallel) : surface;
}

constexpr std::size_t kMostSolids = 255;  // a cell names its owner by a byte (Matter::owned)
constexpr double kTurning = 1e-6;         // what turning a scene to the axes of the box leaves

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

// What the description says of the material.
solid::SolidRest rest_of(const SolidDesc& desc, const Params& params, bool collider) {
  solid::SolidRest rest;
  rest.elastic = material::from_youngs_modulus(desc.law, desc.youngs_modulus, desc.poissons_ratio);
  if (params.numerics.volume_by_pressure && !collider) {
    const double lambda = rest.elastic.lambda;
    rest.elastic = material::beside_pressure(rest.elastic);
    if (desc.compressible) rest.bulk = lambda - rest.elastic.lambda;
    rest.elastic.hardens = desc.compressible;
  }
  static_cast<solid::Properties&>(rest) = desc;
  rest.stiff_by_part = params.numerics.stiffness_by_part;
  rest.wet = params.fluid.present;
  const bool by_part = rest.stiff_by_part && !collider;
  const bool owns = by_part && params.fluid.is_thin_beside(desc.density) && (!rest.wet || rest.bulk > 0.0);
  rest.element = owns ? solid::kElementPart : solid::kElementPartInFluid;
  const bool light = params.fluid.density < solid::kLightFluid * desc.density;
  if (by_part && light && rest.wet && !(rest.bulk > 0.0)) rest.sliver = solid::kElementPart.fraction;
  rest.definition = definition_hash(desc);
  return rest;
}

// The surface at rest, laid in the slab where the domain is one.
std::shared_ptr<const geometry::Surface> surface_of(const SolidDesc& desc, double h,
                                                    const std::optional<geometry::Slab>& slab,
                                                    const Parallel& parallel) {
  const double spacing = kRestSpacing * h;
  auto surface = desc.examined ? desc.examined : geometry::examine(desc.surface, spacing, parallel);
  if (surface->distance.spacing != spacing)
    refuse("EfsiSolidDef.surface: made for voxel_size", surface->distance.spacing / kRestSpacing,
           "the simulation's, " + number(h));
  if (slab) {
    demand_flat(desc, slab->axis);
    if (surface->distance.flat != slab->axis) surface = geometry::extrude_in_slab(*surface, *slab, parallel);
  } else if (surface->distance.flat >= 0) {
    throw Error(ErrorCode::kArgument, "EfsiSolidDef.surface: laid in a slab: must not be, where the domain is none");
  }
  return surface;
}

// What the solid keeps of it.
void set_surface(const Parallel& parallel, const geometry::Surface& surface, const Numerics& numerics, bool collider,
                 double h, solid::SolidRest& rest) {
  rest.distance = surface.distance;
  rest.thinnest = surface.report.thinnest_feature;
  rest.surface = surface.mesh;
  if (numerics.uses_particles()) rest.nearest = geometry::NearestTriangle(rest.surface);
  rest.along = surface.along;
  rest.clusters = solid::make_surface_clusters(rest.surface, rest.distance, h);
  if (numerics.unilateral_walls && !collider)
    rest.fold_points = solid::make_fold_points(rest.surface, rest.distance, h);
  // Of one that has yielded the rest shape does not tell what is thin.
  if (rest.stiff_by_part && !collider && !rest.plastic.yields())
    rest.thin = solid::ThinParts(parallel, rest.distance, h);
  rest.volume = surface.report.solid_volume;
  rest.area = geometry::surface_area(rest.surface);
  if (!(rest.volume > 0.0)) throw Error(ErrorCode::kMesh, "EfsiSolidDef.mesh: encloses no volume");
}

// Band and initial state: u = x - X, v = velocity + angular velocity x (x - center). start: the surface where it
// starts.
solid::SolidState state_of(const SolidDesc& desc, const Vec3d& center, const geometry::Surface& start,
                           const grid::Grid& grid) {
  solid::SolidState state;
  Vec3i lo, hi;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    lo[s] = static_cast<int>(std::floor((start.report.extent_min[a] - grid.origin[a]) / grid.h));
    hi[s] = static_cast<int>(std::ceil((start.report.extent_max[a] - grid.origin[a]) / grid.h));
  }
  solid::move_band(state, solid::make_band(grid, lo, hi));
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
  state.surface = start.mesh.points;
  return state;
}

// Of the surface, where a solid starts.
double starting_speed(const SolidDesc& desc, const Vec3d& center, const std::vector<Vec3d>& surface) {
  double speed = 0.0;
  for (const Vec3d& x : surface)
    speed = std::max(speed, (desc.velocity + desc.angular_velocity.cross(x - center)).cwiseAbs().maxCoeff());
  return speed;
}

std::string thin_feature(std::size_t number, double feature, double h) {
  std::ostringstream text;
  text << "solid " << number << ": its thinnest feature is about " << feature << " m, less than two voxels of " << h
       << " m; voxel size " << 0.5 * feature << " m would resolve it";
  return text.str();
}

std::string no_cell_inside(double feature, double h) {
  std::ostringstream text;
  text << "EfsiSolidDef.mesh: no cell of size " << h << " m lies inside the solid; its thinnest feature is about "
       << feature << " m";
  return text.str();
}

constexpr double kOnBorder = 1e-3;  // cells: what is so near to the border of a region is in it

}  // namespace

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
  for (int a = 0; a < 3; ++a) {
    // Points are floats: one on a face is off by the rounding of its coordinate, whatever the voxel size.
    const double slack = 1e-6 * grid_.h + static_cast<double>(std::numeric_limits<float>::epsilon()) *
                                              std::max(std::abs(params_.domain_min[a]), std::abs(top[a]));
    if (report.extent_min[a] < params_.domain_min[a] - slack || report.extent_max[a] > top[a] + slack) {
      std::ostringstream text;
      text << "EfsiSolidDef.mesh: extends from " << report.extent_min[a] << " to " << report.extent_max[a] << " in "
           << axis[a] << ", the domain from " << params_.domain_min[a] << " to " << top[a];
      throw Error(ErrorCode::kArgument, text.str());
    }
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
  if (solids_.size() == kMostSolids)
    throw Error(ErrorCode::kArgument, "efsi_solid_add: solid " + std::to_string(kMostSolids + 1) +
                                          ": must be at most " + std::to_string(kMostSolids) +
                                          " solids, colliders included");
  validate(desc);
  solid::SolidRest rest = rest_of(desc, params_, collider);
  const std::optional<geometry::Slab> slab = slab_of(params_, grid_);
  const std::shared_ptr<const geometry::Surface> surface = surface_of(desc, grid_.h, slab, parallel_);
  report = surface->report;
  if (report.repaired) log_.warning("mesh repaired: " + report.repairs);
  set_surface(parallel_, *surface, params_.numerics, collider, grid_.h, rest);

  const Vec3d center = geometry::center_of_volume(rest.surface);
  auto start = stretched(desc, center, kRestSpacing * grid_.h, surface, slab, parallel_);
  const double thinnest = start->report.thinnest_feature;
  if (!collider) demand_inside(start->report);
  demand_apart(collider, start->distance);
  if (thinnest < 2.0 * grid_.h) log_.warning(thin_feature(solids_.size() + 1, thinnest, grid_.h));

  solid::SolidState state = state_of(desc, center, *start, grid_);
  if (slab) flatten(parallel_, rest, slab->axis, state);
  if (rest.plastic.yields() || rest.bulk > 0.0)
    rest.lattice = solid::make_material_lattice(report.extent_min, report.extent_max, grid_.h);
  if (rest.plastic.yields()) state.plastic.resize(rest.lattice.node_count());
  if (rest.bulk > 0.0) state.dilatation.resize(rest.lattice.node_count());
  state.speed = starting_speed(desc, center, state.surface);
  solid::SolidWork work;
  solid::compute_mass(parallel_, rest, state, work);
  if (work.owned_cells() == 0 && !collider) throw Error(ErrorCode::kMesh, no_cell_inside(thinnest, grid_.h));
  state.rest_volume_cells = start == surface ? work.volume : rest.volume;  // few cells measure what is pressed
  rest.mass_volume = collider ? state.rest_volume_cells : rest.volume;     // a collider may reach out of the box

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
  geometry::SignedDistance region = slab ? geometry::flattened(volume, *slab) : volume;
  for (float& distance : region.values) distance -= static_cast<float>(kOnBorder * grid_.h);
  pin.region = std::make_shared<const geometry::SignedDistance>(std::move(region));
  return add_pin(std::move(pin));
}

std::size_t Simulation::add_pin(std::size_t solid, const std::vector<std::uint8_t>& vertices) {
  Pin pin;
  pin.solid = solid;
  geometry::SignedDistance region = region_of(solids_[solid].surface, vertices, grid_.h);
  if (const auto slab = slab_of(params_, grid_)) region = geometry::flattened(region, *slab);
  pin.region = std::make_shared<const geometry::SignedDistance>(std::move(region));
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
  pin.low = pin.region->origin;
  pin.high = pin.region->node(pin.region->size[0] - 1, pin.region->size[1] - 1, pin.region->size[2] - 1);
  pin.motion.center = sum / static_cast<double>(held);
  solids_[pin.solid].held.push_back(pin.region);
  pins_.push_back(std::move(pin));
  return pins_.size() - 1;
}

void Simulation::set_motion(std::size_t pin, double start, double end, const Pose& from, const Pose& to) {
  PrescribedMotion motion{start, end, from, to, pins_[pin].motion.center};
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

void Simulation::set_points(std::size_t pin, PointMotion points) {
  Pin changed = pins_[pin];
  const solid::SolidRest& rest = solids_[changed.solid];
  if (const int slab = grid::slab_axis(grid_, params_.walls); slab >= 0)  // nothing moves across a slab
    for (std::size_t v = 0; v < rest.along.size(); ++v) points.from[v][slab] = points.to[v][slab] = rest.along[v];
  changed.points = std::move(points);
  solid::SolidState& state = state_.solids[changed.solid];
  const auto before = state.shape;
  update_shape(parallel_, {params_, grid_, solids_, emitters_, forces_, pins_}, changed, state_.time, state);
  if (state.shape != before) work_.masses_ready = false;  // after a restart it is that of the rest until now
  pins_[pin] = std::move(changed);
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

}  // namespace efsi::sim
