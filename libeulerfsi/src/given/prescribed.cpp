#include "given/prescribed.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "frame/grid_loops.hpp"
#include "given/given_shape.hpp"
#include "nodes/step_weight.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr std::uint8_t kAllAxes = 7;

// Largest component of a pin's velocity, over the box around it or over its vertices where those are given [m/s].
double fastest(const Pin& pin, const PinVelocity& velocity) {
  const auto& [pose, motion, points] = velocity;
  double speed = 0.0;
  if (points.moves()) {
    for (std::size_t v = 0; v < points.points().size(); ++v)
      speed = std::max(
          speed,
          (motion.at(pose.place(points.points()[v])) + pose.turn * points.velocities()[v]).cwiseAbs().maxCoeff());
    return speed;
  }
  for (unsigned corner = 0; corner < 8; ++corner) {
    Vec3d X;
    for (int a = 0; a < 3; ++a) X[a] = corner >> a & 1u ? pin.high[a] : pin.low[a];
    speed = std::max(speed, motion.at(pose.place(X)).cwiseAbs().maxCoeff());
  }
  return speed;
}

// Pinned nodes of a band: velocity, and the map where `map`.
void give(const Parallel& parallel, const Pin& pin, const PinVelocity& velocity, bool map, solid::SolidState& state) {
  const Grid& g = state.band.grid;
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t plane) {
    const int k = static_cast<int>(plane);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (!state.valid[n]) continue;
        const Vec3d x = g.node_position(i, j, k), X = velocity.pose.material(x);
        if (!pin.holds(X)) continue;
        state.v.set(n, velocity.at(x, X).cast<Real>());
        if (map) state.u.set(n, (x - X).cast<Real>());
      }
  });
}

template <class Body>
void for_pins(const Scene& scene, std::size_t solid, const Body& body) {
  for (const Pin& pin : scene.pins)
    if (pin.solid == solid) body(pin);
}

// A band around the surface where it is.
solid::Band band_around(const Grid& box, const std::vector<Vec3d>& surface) {
  Eigen::AlignedBox3d around;
  for (const Vec3d& x : surface) around.extend(x);
  Vec3i lo, hi;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    const double most = 2.0 * box.cells[s];
    lo[s] = static_cast<int>(std::floor(std::clamp((around.min()[a] - box.origin[a]) / box.h, -most, most)));
    hi[s] = static_cast<int>(std::ceil(std::clamp((around.max()[a] - box.origin[a]) / box.h, -most, most)));
  }
  return solid::make_band(box, lo, hi);
}

// Returns per node the fluid's velocity before, or that of all there, and the solid's.
std::vector<Vec3> set_velocities(const std::vector<PrescribedNode>& given, NodeVelocity& velocity) {
  std::vector<Vec3> before;
  for (const PrescribedNode& g : given) {
    const Vec3 fluid = velocity.field.at(g.node);
    before.push_back(fluid);
    const std::size_t t = velocity.slip.find(g.solid, g.node);
    if (t == system::SlipNodes::kNone) {
      before.push_back(fluid);
      velocity.field.set(g.node, g.velocity);
      continue;
    }
    const system::SlipNode& slip = velocity.slip.nodes()[t];
    Vec3& solid = velocity.slip.solid_velocity()[t];
    before.push_back(solid);
    solid = g.velocity;
    if (!slip.shared()) velocity.field.set(g.node, fluid + slip.normal.dot(g.velocity - fluid) * slip.normal);
  }
  return before;
}

}  // namespace

void begin_prescribed(const Parallel& parallel, const Scene& scene, double time, double remaining,
                      SolidStates& states) {
  for (const Pin& pin : scene.pins) {
    solid::SolidState& state = states[pin.solid];
    update_shape(parallel, scene, pin, time, state);
    const PinVelocity velocity = velocity_of(pin, state, time, time, remaining);
    const double speed = fastest(pin, velocity);
    state.speed = pin.whole ? speed : std::max(state.speed, speed);
    if (pin.whole) give(parallel, pin, velocity, false, state);
  }
}

std::vector<PrescribedNode> find_prescribed(const StepContext& step, const SolidStates& states,
                                            const SolidWorks& solids, Matter& matter, system::SlipNodes& slip) {
  std::vector<PrescribedNode> given;
  if (step.scene.pins.empty()) return given;
  const Grid& g = matter.common.grid;
  std::set<std::pair<std::size_t, std::size_t>> known;  // (solid, node): the first pin counts
  for (std::size_t p = 0; p < step.scene.pins.size(); ++p) {
    const Pin& pin = step.scene.pins[p];
    const PinVelocity velocity = velocity_of(pin, states[pin.solid], step.time, step.time, step.dt);
    const std::size_t first = given.size();
    const Grid& band = states[pin.solid].band.grid;
    const Vec3i lo = grid::offset(band, g);
    for (std::size_t local = 0; local < solids[pin.solid].carries.size(); ++local) {
      if (!solids[pin.solid].carries[local]) continue;
      const Vec3i at = band.node_place(local);
      const Vec3d x = band.node_position(at[0], at[1], at[2]);
      const Vec3d X = velocity.pose.material(x);
      if (!pin.holds(X)) continue;
      const std::size_t n = g.node(at[0] + lo[0], at[1] + lo[1], at[2] + lo[2]);
      if (!known.insert({pin.solid, n}).second) continue;
      given.push_back({p, pin.solid, n, velocity.at(x, X).cast<Real>(), Vec3d::Zero()});
    }
    if (velocity.points.moves())
      keep_volume(step.scene, velocity, step.dt, states[pin.solid], solids[pin.solid], g,
                  {&given[first], given.size() - first});
  }
  for (const PrescribedNode& node : given) matter.specific_volume[node.node] = 0;
  slip.hold(step.parallel, matter.specific_volume);
  for (const PrescribedNode& node : given) {
    const std::size_t t = slip.find_shared(node.solid, node.node);
    if (t != system::SlipNodes::kNone) slip.prescribe(t, kAllAxes, kAllAxes);
  }
  return given;
}

void prescribe_velocity(const StepContext& step, const SolidWorks& solids, const Matter& matter,
                        std::vector<PrescribedNode>& given, NodeVelocity& velocity) {
  if (given.empty()) return;
  const StepWeight weight = weight_in_step(step.scene, step.dt, solids);
  const std::vector<Vec3> before = set_velocities(given, velocity);
  for (std::size_t i = 0; i < given.size(); ++i) {
    PrescribedNode& g = given[i];
    const std::size_t t = velocity.slip.find(g.solid, g.node);
    const bool slips = t != system::SlipNodes::kNone, shared = slips && velocity.slip.nodes()[t].shared();
    const Real fluid_mass = matter.fluid_mass[g.node],
               own_mass = shared ? velocity.slip.nodes()[t].solid_mass : matter.mass[g.node] - fluid_mass;
    Vec3 impulse;
    if (shared) {
      impulse = own_mass * (g.velocity - before[2 * i + 1]);
    } else if (!slips) {
      impulse = matter.mass[g.node] * (g.velocity - before[2 * i]);
    } else {
      const Vec3& n = velocity.slip.nodes()[t].normal;
      impulse = own_mass * (g.velocity - before[2 * i + 1]) + fluid_mass * n.dot(g.velocity - before[2 * i]) * n;
    }
    if (step.scene.pins[g.pin].whole) impulse += own_mass * weight.solids[g.solid];
    g.impulse = impulse.cast<double>();
  }
}

void restore_given(const std::vector<PrescribedNode>& given, NodeVelocity& velocity) {
  set_velocities(given, velocity);
}

void fix_prescribed(const std::vector<PrescribedNode>& given, system::VelocitySystem& system) {
  for (const PrescribedNode& g : given)
    for (int axis = 0; axis < 3; ++axis) system.fix(system.unknown_of(g.solid, g.node), axis);
}

void close_prescribed_cells(const StepContext& step, const SolidStates& states, const Matter& matter,
                            const system::SlipNodes& slip, std::vector<std::uint8_t>& active) {
  if (step.scene.pins.empty()) return;
  const Grid& g = matter.common.grid;
  if (active.empty()) active.assign(g.padded_count(), 1);
  const auto corner = grid::corner_offsets(g);
  std::vector<std::uint8_t> slips(g.node_count(), 0);
  for (const system::SlipNode& n : slip.nodes()) slips[n.node] = 1;
  for (const solid::SolidState& state : states)
    for_band_cells(step.parallel, g, state.band, [&](std::size_t, int i, int j, int k) {
      const std::size_t n = g.node(i, j, k), c = g.padded(i, j, k);
      const std::uint8_t owner = matter.owned[c];
      const bool moves = std::any_of(corner.begin(), corner.end(), [&](std::size_t o) {
        if (matter.specific_volume[n + o] > 0) return true;
        if (owner == 0) return slips[n + o] != 0;
        const std::size_t t = slips[n + o] ? slip.find_shared(owner - 1u, n + o) : system::SlipNodes::kNone;
        return t != system::SlipNodes::kNone && slip.nodes()[t].fixed != kAllAxes;
      });
      if (!moves) active[c] = 0;
    });
}

void add_pin_reactions(const Reaction& reaction, std::vector<PrescribedNode>& given) {
  for (PrescribedNode& g : given) g.impulse += reaction(g.solid, g.node).cast<double>();
}

std::vector<PinReaction> sum_reactions(const StepContext& step, const Grid& grid,
                                       const std::vector<PrescribedNode>& given) {
  std::vector<PinReaction> sums;
  for (const Pin& pin : step.scene.pins) {
    sums.emplace_back();
    sums.back().center = pin.motion.pose(step.time).place(pin.motion.center);
  }
  for (const PrescribedNode& g : given) {
    const auto [i, j, k] = grid.node_place(g.node);
    sums[g.pin].add(grid.node_position(i, j, k), g.impulse, g.velocity.cast<double>());
  }
  return sums;
}

void prescribe_map(const StepContext& step, std::size_t l, solid::SolidState& state) {
  for_pins(step.scene, l, [&](const Pin& pin) {
    give(step.parallel, pin, velocity_of(pin, state, step.time + step.dt, step.time, step.dt), true, state);
  });
}

void prescribe_surface(const StepContext& step, std::size_t l, solid::SolidState& state) {
  for_pins(step.scene, l, [&](const Pin& pin) {
    const Pose pose = pin.motion.pose(step.time + step.dt);
    const std::vector<Vec3d>& points = solid::points_of(step.scene.solids[l], state);
    for (std::size_t v = 0; v < pin.vertices.size(); ++v)
      if (pin.vertices[v]) state.surface[v] = pose.place(points[v]);
  });
}

void place_collider(const StepContext& step, std::size_t l, solid::SolidState& state, solid::SolidWork& work) {
  const solid::Band old = state.band;
  for_pins(step.scene, l, [&](const Pin& pin) {
    work.max_speed = fastest(pin, velocity_of(pin, state, step.time, step.time, step.dt));
    update_shape(step.parallel, step.scene, pin, step.time + step.dt, state);
  });
  prescribe_surface(step, l, state);
  const solid::Band band = band_around(step.scene.grid, state.surface);
  if (band.grid.lo != old.grid.lo || band.grid.cells != old.grid.cells) solid::move_band(state, band);
  state.valid.assign(state.band.grid.node_count(), solid::kKnown);
  prescribe_map(step, l, state);
  state.stiff.clear();
}

}  // namespace efsi::sim
