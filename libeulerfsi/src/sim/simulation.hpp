// Purpose: a simulation: owns parameters, state and workspace; adds solids and emitters; advances to a frame.
// Paper: Sec. 4.3.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/log.hpp"
#include "base/parallel.hpp"
#include "frame/force_field.hpp"
#include "frame/params.hpp"
#include "frame/profile.hpp"
#include "frame/state.hpp"
#include "geometry/mesh_sdf.hpp"
#include "sim/step.hpp"
#include "sim/workspace.hpp"
#include "solid/particles/passengers.hpp"
#include "solid/solid.hpp"

namespace efsi::sim {

// Spacing of a rest shape's distance field, in voxels.
inline constexpr double kRestSpacing = 0.5;

// Solids may overlap by so many voxels where they start.
inline constexpr double kMostOverlap = 0.5;

// Threads to use: as many as asked for; 0: one per processor.
int thread_count(int requested);

// An elastic solid as the caller describes it (EfsiSolidDef).
struct SolidDesc : solid::Properties {
  geometry::TriangleMesh surface;                     // rest shape where it starts [m]
  std::shared_ptr<const geometry::Surface> examined;  // stands in for `surface` where it is given
  double youngs_modulus = 2e4;
  double poissons_ratio = 0.3;
  material::Law law = material::Law::kCorotational;
  Vec3d velocity = Vec3d::Zero();
  Vec3d angular_velocity = Vec3d::Zero();
  Vec3d stretch = Vec3d::Ones();  // of the rest shape where it starts, about its centre of volume
};

// Hash of the values of a solid's parameters.
std::uint64_t definition_hash(const SolidDesc& desc);

struct SolidDiagnostics {
  double mass = 0.0, rest_volume = 0.0, volume_cells = 0.0, rest_volume_cells = 0.0, volume_mesh = 0.0;
  Vec3d center = Vec3d::Zero(), momentum = Vec3d::Zero(), angular_momentum = Vec3d::Zero();
  double kinetic_energy = 0.0, elastic_energy = 0.0;
  Vec3d extent_min = Vec3d::Zero(), extent_max = Vec3d::Zero();
  double min_det_f = 1.0, max_det_f = 1.0, max_stretch = 1.0;
  std::uint64_t elements = 0, memory_bytes = 0, false_edges = 0;
  double max_plastic_strain = 0.0;
};

struct FluidDiagnostics {
  double kinetic_energy = 0.0, max_speed = 0.0, smoke = 0.0, max_divergence = 0.0, carried_energy = 0.0;
  Vec3d momentum = Vec3d::Zero();
};

class Simulation {
 public:
  // Returns true to cancel. fraction: of the requested interval.
  using Progress = std::function<bool(double fraction, const StepInfo& last)>;

  Simulation(const Params& params, Log log);

  // Before the first step. Returns the solid's index from 0.
  std::size_t add_solid(const SolidDesc& desc, geometry::MeshReport& report);
  // volume: made for the voxel size; it stands in for the emitter's box or ball where it is given.
  std::size_t add_emitter(fluid::Emitter emitter, const geometry::Surface* volume = nullptr);
  // In the place of the values of an emitter; before the first step.
  void set_keys(std::size_t emitter, std::vector<fluid::EmitterKey> keys);
  const std::vector<fluid::Emitter>& emitters() const { return emitters_; }
  // Before the first step. A solid whose motion is given; of its description surface and friction count. It may lie
  // across the faces of the box. Returns the index of its pin; that of the solid is the last one's.
  std::size_t add_collider(const SolidDesc& desc, geometry::MeshReport& report);
  // Pins a solid where its material lies in a volume, or beside marked vertices of its surface. Index from 0.
  std::size_t add_pin(std::size_t solid, const geometry::SignedDistance& volume);
  std::size_t add_pin(std::size_t solid, const std::vector<std::uint8_t>& vertices);
  // Sets the motion of a pin; the centre of its motion is kept. At any time.
  void set_motion(std::size_t pin, double start, double end, const Pose& from, const Pose& to);
  // The same for the points of a collider as its mesh has them, in material space, on which its motion acts. At any
  // time. Throws Error(kMesh) where those of now bound no volume.
  void set_points(std::size_t pin, PointMotion points);
  const std::vector<Pin>& pins() const { return pins_; }
  // Points that follow a solid, at rest in its rest shape [m]. At any time. Returns their index from 0.
  std::size_t add_passenger(std::size_t solid, std::vector<Vec3d> points);
  std::size_t add_force(const ForceField& force);

  StepInfo step(double max_dt);
  StepInfo advance(double duration, const Progress& progress);

  const Params& params() const { return params_; }
  const grid::Grid& grid() const { return grid_; }
  const State& state() const { return state_; }
  const Workspace& workspace() const { return work_; }
  const std::vector<solid::SolidRest>& solids() const { return solids_; }
  const Parallel& parallel() const { return parallel_; }
  const Log& log() const { return log_; }
  const Profile& profile() const { return profile_; }
  // What the last good step reported; its initial value before there was one.
  const StepInfo& last_step() const { return last_step_; }
  // Contacts between solids in the last call of step or advance, so far.
  const ContactPairs& contacts() const { return contacts_; }
  void reset_profile() { profile_ = Profile{}; }

  SolidDiagnostics diagnose_solid(std::size_t index);
  FluidDiagnostics diagnose_fluid();
  // Of a solid's surface, as the mesh was given: what lies beyond a slab stays there.
  std::vector<Vec3d> surface_points(std::size_t index) const;
  std::vector<Vec3d> surface_velocity(std::size_t index) const;
  std::size_t passenger_count() const { return passengers_.size(); }
  std::size_t passenger_points(std::size_t index) const { return passengers_[index].second.points.size(); }
  // Positions [m] and velocities [m/s] of a passenger's points now.
  void locate_passenger(std::size_t index, std::vector<Vec3d>& points, std::vector<Vec3d>& velocities) const;
  // Fields of the whole box, until the next step. Part of each cell that solids fill, cells; empty without solids.
  const std::vector<Real>& solid_fraction();
  const std::vector<Real>& pressure();        // padded cells [Pa]
  const grid::VectorField& fluid_velocity();  // nodes [m/s]
  std::uint64_t memory_bytes() const;

  // Fields for initial conditions and tests; values by component in view order.
  void set_velocity(const float* values);
  void set_smoke(const float* values, bool temperature);
  void set_solid_field(std::size_t index, bool velocity, const float* values);

  // A number that tells scenes apart: parameters and solids, not state.
  std::uint64_t scene_hash() const;
  // Replaces the state (checkpoint).
  void set_state(State state);
  // Replaces the states of all solids; before the first step.
  void set_solids(std::vector<solid::SolidState> solids);
  // Reserves what the first step needs and applies initial emitters; done once.
  void prepare();

 private:
  std::size_t add_body(const SolidDesc& desc, bool collider, geometry::MeshReport& report);
  void demand_inside(const geometry::MeshReport& report) const;
  void demand_apart(bool collider, const geometry::SignedDistance& distance) const;
  std::size_t add_pin(Pin pin);
  StepInfo try_step(const Scene& scene, double remaining, double shrink);
  StepInfo checked_step(double remaining);
  void keep_backup();
  bool fills_box() const { return params_.fluid.present; }  // the common grid
  std::string lost_shape() const;
  std::string crosses_periodic_face() const;
  std::string passed_through(const StepInfo& info) const;

  Params params_;
  Log log_;
  Parallel parallel_;
  grid::Grid grid_;
  std::vector<solid::SolidRest> solids_;
  std::vector<std::shared_ptr<const geometry::Surface>> starts_;  // of solids that are stretched where they start
  std::vector<fluid::Emitter> emitters_;
  std::vector<Pin> pins_;
  std::vector<std::pair<std::size_t, solid::Passenger>> passengers_;  // with their solids
  std::vector<ForceField> forces_;
  State state_;
  Workspace work_;
  struct {
    std::vector<Real> fraction, pressure;
    grid::VectorField velocity;
  } box_;  // what was asked for where the common grid is not the box
  Profile profile_;
  StepInfo last_step_;
  ContactPairs contacts_;
  bool prepared_ = false;
};

}  // namespace efsi::sim
