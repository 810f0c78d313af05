#include "sim/time_step.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "contact/fold_contact.hpp"
#include "contact/solid_contact.hpp"
#include "contact/wall_contact.hpp"
#include "grid/interpolate.hpp"
#include "sim/step_loss.hpp"
#include "solid/map/displacement.hpp"

namespace efsi::sim {
namespace {

constexpr double kContactReach = 2.0;     // cells
constexpr double kContactDistance = 1.0;  // cells: 2 less what a step in contact moves
constexpr double kPaperCfl = 0.6;         // cells per step of solids less than kContactReach apart (Sec. 5.2)
constexpr double kPairReach = 6.0;        // cells between solids, from which on they do not limit each other
constexpr double kMeetingDistance = 0.4;  // cells that they keep, where they come from farther away
constexpr double kUnseen = 3.0;           // cells between solids neither of which reaches the other's map
// The surfaces of two solids may approach each other in a step by contact_travel, or by the smaller of these if more:
constexpr double kTravelOfSize = 1.0 / 32.0;     // of the cubic root of a solid's volume
constexpr double kTravelOfThinnest = 1.0 / 8.0;  // of its thinnest feature
// Cells per step in flight over those elsewhere: through vacuum (4 where these are 1.8) and through a fluid of at most
// kThinFluid of a solid's density. The pressure of the fluid grows with what a solid moves in a step, and presses it.
constexpr double kVacuumReach = 20.0 / 9.0, kFluidReach = 1.5;
constexpr double kMoreAcceleration = 8.0;  // of that in the last step
constexpr double kStart = 0.1;             // cells in the first step, in which a dense fluid adapts to solids that move
constexpr double kFarthest = 3.95;         // cells per step: one of more than four is repeated
constexpr double kFlightStrain = 0.1;      // or angle [rad], in a step in flight

// Largest dt with (speed + a dt) dt <= distance.
double time_to_move(double speed, double a, double distance) {
  if (a > 0.0) return 2.0 * distance / (speed + std::sqrt(speed * speed + 4.0 * a * distance));
  return speed > 0.0 ? distance / speed : std::numeric_limits<double>::infinity();
}

// What a solid may be accelerated by in a step [m/s^2]: eight times what it was in the last one, at most a fall.
double expected_acceleration(const Params& params, const solid::SolidState& state) {
  const double fall = params.gravity.norm();
  return state.acceleration < 0.0 ? fall : std::min(fall, kMoreAcceleration * state.acceleration);
}

// How a step approaches what it may touch: by `travel` at least, or up to `distance` from it [cells].
struct Approach {
  double travel, distance;
  double cells(double gap) const { return std::max(travel, gap - distance); }
};

// Cells that the surface of a solid may approach that of another one by in a step, by the size of the solid. Not that
// of a collider, which flattens a layer of cells at once, nor where the solid is compressible: the cells would be
// crushed.
double contact_travel(const Scene& scene, std::size_t l) {
  const Numerics& numerics = scene.params.numerics;
  const solid::SolidRest& rest = scene.solids[l];
  if (!numerics.resolve_impacts || rest.compressible || is_collider(scene.pins, l)) return numerics.contact_travel;
  const double of_solid = std::min(kTravelOfSize * std::cbrt(rest.volume), kTravelOfThinnest * rest.thinnest);
  return std::max(numerics.contact_travel, of_solid / scene.grid.h);
}

// Whether two solids, one < other, pushed each other in the last step. What pushes a solid also holds it; towards
// anything else it may fall, since what it rests on may give way.
bool push_each_other(const SolidStates& states, std::size_t one, std::size_t other) {
  const std::vector<solid::ContactImpulse>& contacts = states[one].contacts;
  return std::any_of(contacts.begin(), contacts.end(),
                     [&](const solid::ContactImpulse& c) { return c.other == static_cast<std::int32_t>(other); });
}

// Cells that a solid may move in a step where nothing is near it.
double flight_cells(const Params& params, double density) {
  if (!params.numerics.conserve_momentum || !params.fluid.is_thin_beside(density)) return params.cfl_solid;
  const double far = (params.fluid.present ? kFluidReach : kVacuumReach) * params.cfl_solid;
  return std::max(params.cfl_solid, std::min(kFarthest, far));
}

// A step resolves the shear waves of a solid, or is as long as its energy allows (step_loss.hpp).
void limit_by_loss(const Parallel& parallel, const Scene& scene, std::size_t l, const solid::SolidState& solid,
                   StepRule rule, solid::SolidWork& work, StepLimit& limit) {
  const Numerics& numerics = scene.params.numerics;
  if (!numerics.resolve_impacts || !std::isfinite(numerics.step_tolerance)) return;
  if (work.keeps_energy) return;  // its limit is known, whatever else it touches
  work.keeps_energy = true;
  work.touches = rule != StepRule::kFlightWave;
  if (limit.dt > resolved_step(scene, scene.solids[l]))
    limit.lower(longest_step(parallel, scene, scene.solids[l], solid, work.touches), rule, l + 1);
}

// What is between a solid and the faces that are walls: -x +x -y +y -z +z.
struct Gaps {
  std::array<double, 6> cells;      // infinite where there is no wall
  std::array<double, 6> closing{};  // speed towards the wall of what could reach it in the step [m/s]
  double least() const { return *std::min_element(cells.begin(), cells.end()); }
};

Gaps measure_gaps(const Scene& scene, const solid::SolidState& solid) {
  const grid::Grid& g = scene.grid;
  const grid::NodeSampler sampler(solid.band.grid);
  Gaps gaps;
  gaps.cells.fill(std::numeric_limits<double>::infinity());
  const double reach = std::clamp(scene.params.cfl_solid, kContactReach, kFarthest);
  const int slab = grid::slab_axis(g, scene.params.walls);
  for (const Vec3d& x : solid.surface)
    for (std::size_t face = 0; face < 6; ++face) {
      const std::size_t axis = face / 2;
      if (!grid::Walls::blocks(scene.params.walls.face[face]) || static_cast<int>(axis) == slab) continue;
      const double at = (x[static_cast<Eigen::Index>(axis)] - g.origin[static_cast<Eigen::Index>(axis)]) / g.h;
      const double distance = face % 2 ? g.cells[axis] - at : at;
      gaps.cells[face] = std::min(gaps.cells[face], distance);
      if (distance > reach) continue;
      const Vec3 local = ((x - solid.band.grid.origin) / g.h).cast<Real>();
      const double v = static_cast<double>(sampler.vector(solid.v, local)[static_cast<Eigen::Index>(axis)]);
      gaps.closing[face] = std::max(gaps.closing[face], face % 2 ? v : -v);
    }
  return gaps;
}

// What walls near a solid allow: its surface may reach them, or move by contact_travel in contact (Sec. 5.2 uses 0.6
// for solids less than 2 cells apart). Sliding along a wall is free.
void limit_by_walls(const Parallel& parallel, const Scene& scene, std::size_t l, const solid::SolidState& solid,
                    const Gaps& gaps, solid::SolidWork& work, StepLimit& limit) {
  const Params& params = scene.params;
  const Approach approach{params.numerics.contact_travel, kContactDistance};
  for (std::size_t face = 0; face < 6; ++face)
    if (approach.cells(gaps.cells[face]) < params.cfl_solid)
      limit.lower(
          time_to_move(gaps.closing[face],
                       pushed_at(solid, face) > 0.0 ? expected_acceleration(params, solid) : params.gravity.norm(),
                       approach.cells(gaps.cells[face]) * scene.grid.h),
          StepRule::kWall, l + 1);
  if (gaps.least() < kContactReach) limit_by_loss(parallel, scene, l, solid, StepRule::kWallWave, work, limit);
}

// Empty, and far from all, for what has left the box.
using Box = Eigen::AlignedBox3d;
std::vector<Box> surface_boxes(const SolidStates& states) {
  std::vector<Box> boxes(states.size());
  for (std::size_t l = 0; l < boxes.size(); ++l) {
    if (solid::has_left(states[l])) continue;
    for (const Vec3d& x : states[l].surface) boxes[l].extend(x);
  }
  return boxes;
}

// What two solids near each other allow: as walls do, every vertex by its own gap, which rows of contact see. What is
// between solids of which neither reaches the other's map is taken to be kUnseen, and to close at their largest
// relative speed.
void limit_by_pair(const Parallel& parallel, const Scene& scene, const SolidStates& states,
                   const std::vector<Box>& boxes, std::size_t one, std::size_t other, SolidWorks& solids,
                   StepLimit& limit) {
  const Params& params = scene.params;
  const double h = scene.grid.h, apart = boxes[one].exteriorDistance(boxes[other]) / h;
  if (apart > kPairReach) return;
  const double acceleration =
      push_each_other(states, one, other)
          ? std::max(expected_acceleration(params, states[one]), expected_acceleration(params, states[other]))
          : params.gravity.norm();
  const auto time_for = [&](double speed, double cells) {
    return time_to_move(speed, params.gravity.norm(), cells * h);
  };
  const Approach approach{std::min(contact_travel(scene, one), contact_travel(scene, other)), kMeetingDistance};
  double least = std::numeric_limits<double>::infinity(), meeting = least;
  visit_gaps(scene, states, one, other, [&](double gap, double closing) {
    least = std::min(least, gap);
    meeting = std::min(meeting, time_to_move(closing, acceleration, approach.cells(gap / h) * h));
  });
  if (params.numerics.uses_particles()) {
    if (least + kContactSkin * h < kContactReach * h)
      limit.lower(time_for(std::max(states[one].speed, states[other].speed), kPaperCfl), StepRule::kSolid, one + 1,
                  other + 1);
    return;
  }
  if (!params.numerics.unilateral_walls) return;
  if (!std::isfinite(least))
    meeting = time_for(relative_speed(states, one, other), approach.cells(std::max(kUnseen, apart)));
  limit.lower(meeting, StepRule::kSolid, one + 1, other + 1);
  if (least < kContactReach * h)
    for (const std::size_t l : {one, other})
      if (!is_collider(scene.pins, l))
        limit_by_loss(parallel, scene, l, states[l], StepRule::kSolidWave, solids[l], limit);
}

// What the folds of a solid allow: as two solids do. Not where the caller has taken the limit of its speed away.
void limit_by_folds(const Parallel& parallel, const Scene& scene, std::size_t l, const solid::SolidState& solid,
                    solid::SolidWork& work, StepLimit& limit) {
  if (scene.params.cfl_solid > kRetryTravel) return;
  const double h = scene.grid.h, travel = contact_travel(scene, l);
  double least = std::numeric_limits<double>::infinity();
  visit_fold_gaps(solid, work, [&](double gap, double closing) {
    least = std::min(least, gap);
    limit.lower(time_to_move(closing, 0.0, std::max(travel, gap / h - kContactDistance) * h), StepRule::kFold, l + 1);
  });
  if (least < kContactReach * h) limit_by_loss(parallel, scene, l, solid, StepRule::kFoldWave, work, limit);
}

// How many cells a solid may move in a step: cfl_solid, or more in flight, away from walls and from other solids, which
// come towards it as far.
double free_cells(const Scene& scene, const std::vector<Box>& boxes, std::size_t l, const Gaps& gaps) {
  const Params& params = scene.params;
  const double far = flight_cells(params, scene.solids[l].density);
  if (far == params.cfl_solid) return far;
  double room = gaps.least() - kContactDistance;
  for (std::size_t other = 0; other < boxes.size(); ++other)
    if (other != l)
      room = std::min(room, 0.5 * (boxes[l].exteriorDistance(boxes[other]) / scene.grid.h - kContactReach));
  return std::max(params.cfl_solid, std::min(room, far));
}

// The limit by the speed of a solid. A step that turns or strains it much is no longer than elsewhere.
void limit_by_speed(const Parallel& parallel, const Scene& scene, std::size_t l, const solid::SolidState& solid,
                    double cells, StepLimit& limit) {
  const Params& params = scene.params;
  const double h = scene.grid.h, acceleration = expected_acceleration(params, solid);
  const double near = time_to_move(solid.speed, acceleration, params.cfl_solid * h);
  if (!(cells > params.cfl_solid) || near >= limit.dt) {
    limit.lower(near, StepRule::kSpeed, l + 1);
    return;
  }
  const double rate = solid::largest_strain_rate(parallel, solid, solid.valid);
  limit.lower(time_to_move(solid.speed, acceleration, cells * h), StepRule::kSpeed, l + 1);
  if (rate > 0.0) limit.lower(std::max(near, kFlightStrain / rate), StepRule::kStrain, l + 1);
}

}  // namespace

StepLimits step_limits(const Params& params, double lightest_density) {
  const Numerics& n = params.numerics;
  const bool resolves = n.resolve_impacts && std::isfinite(n.step_tolerance);
  const double part = resolves ? n.step_tolerance / kNormalTolerance : 0.0;
  return {kContactReach, n.contact_travel, part * kContactPace, flight_cells(params, lightest_density),
          part * kContactShare};
}

StepLimit compute_time_step(const Parallel& parallel, const Scene& scene, const SolidStates& states, double fluid_speed,
                            double time, double remaining, SolidWorks& solids) {
  const Params& params = scene.params;
  const grid::Grid& g = scene.grid;
  StepLimit limit{remaining, StepRule::kEnd};
  if (params.max_time_step > 0.0) limit.lower(params.max_time_step, StepRule::kMaximum);
  const std::vector<Box> boxes = surface_boxes(states);
  for (solid::SolidWork& solid : solids) solid.keeps_energy = false;
  for (std::size_t l = 0; l < scene.solids.size(); ++l) {
    if (solid::has_left(states[l])) continue;
    const bool given = is_collider(scene.pins, l);
    for (std::size_t other = 0; other < l; ++other)
      if (!given || !is_collider(scene.pins, other))
        limit_by_pair(parallel, scene, states, boxes, other, l, solids, limit);
    if (given) {  // walls do not stop it, nor does anything drive it
      limit.lower(time_to_move(states[l].speed, 0.0, params.cfl_solid * g.h), StepRule::kCollider, l + 1);
      continue;
    }
    limit_by_folds(parallel, scene, l, states[l], solids[l], limit);
    const Gaps gaps = measure_gaps(scene, states[l]);
    limit_by_walls(parallel, scene, l, states[l], gaps, solids[l], limit);
    limit_by_speed(parallel, scene, l, states[l], free_cells(scene, boxes, l, gaps), limit);
    if (params.numerics.step_tolerance < kNormalTolerance)  // else vibrations in flight may be damped
      limit_by_loss(parallel, scene, l, states[l], StepRule::kFlightWave, solids[l], limit);
    if (params.numerics.resolve_impacts &&
        !params.fluid.is_thin_beside(scene.solids[l].density))  // then twice as long each
      limit.lower(time + time_to_move(states[l].speed, 0.0, kStart * g.h), StepRule::kStart, l + 1);
  }
  for (const Vec3d& v : params.walls.velocity) fluid_speed = std::max(fluid_speed, v.cwiseAbs().maxCoeff());
  if (params.fluid.present) limit.lower(time_to_move(fluid_speed, 0.0, params.cfl_fluid * g.h), StepRule::kFluid);
  limit.dt = remaining / std::ceil(remaining / limit.dt - 1e-6);
  return limit;
}

}  // namespace efsi::sim
