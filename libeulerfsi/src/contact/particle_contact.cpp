#include "contact/particle_contact.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <optional>

#include "contact/repulsion.hpp"
#include "contact/solid_contact.hpp"
#include "grid/extrapolate.hpp"
#include "solid/map/inverse_map.hpp"

namespace efsi::sim {
namespace {

constexpr std::int64_t kChunk = 1024;  // particles whose impulses are added up together

// What a solid has done to the particles of another one.
struct Sums {
  std::uint64_t near = 0, active = 0, stuck = 0;
  double deepest = -std::numeric_limits<double>::infinity();  // of a particle below the surface [m]
  double normal_impulse = 0.0;
  Vec3d impulse = Vec3d::Zero();
  void add(const Sums& more) {
    near += more.near;
    active += more.active;
    stuck += more.stuck;
    deepest = std::max(deepest, more.deepest);
    normal_impulse += more.normal_impulse;
    impulse += more.impulse;
  }
};

// The normal out of a solid near the material point X, which lies at x: that of the nearest triangle in the world, or,
// where that has no area, the gradient of the distance carried to the world by the map.
Vec3d normal_out(const solid::SolidRest& rest, const solid::SolidState& state, const Vec3d& X,
                 const Mat3d& displacement_gradient) {
  const Vec3d gradient = solid::distance_of(rest, state).gradient(X);
  const std::int32_t found = solid::nearest_of(rest, state).find(X).triangle;
  if (found >= 0) {
    const geometry::Triangle& t = rest.surface.triangles[static_cast<std::size_t>(found)];
    const auto area = [&](const std::vector<Vec3d>& points) -> Vec3d {
      const Vec3d& a = points[static_cast<std::size_t>(t[0])];
      return (points[static_cast<std::size_t>(t[1])] - a).cross(points[static_cast<std::size_t>(t[2])] - a);
    };
    const Vec3d now = area(state.surface);
    // A mesh may be inside out.
    if (const double length = now.norm(); length > 0.0)
      return (area(solid::points_of(rest, state)).dot(gradient) < 0.0 ? -1.0 : 1.0) / length * now;
  }
  return ((Mat3d::Identity() - displacement_gradient).transpose() * gradient).normalized();
}

// Where a particle meets another solid: how deep it is in the reach of it, and what it then sees.
struct Meeting {
  double distance = 0.0;  // phi [m]
  Vec3d normal;
  Vec3 velocity;  // of the other solid there
};
std::optional<Meeting> meet(const solid::SolidRest& rest, const solid::SolidState& state,
                            const std::vector<std::uint8_t>& layer, const Vec3d& x, double reach) {
  const grid::Grid& g = state.band.grid;
  const Vec3d at = (x - g.origin) / g.h;
  for (int a = 0; a < 3; ++a)
    if (at[a] < 0.0 || at[a] > g.cells[static_cast<std::size_t>(a)]) return {};
  Vec3d u;
  Mat3d gradient;
  if (!solid::sample_displacement(state, grid::corner_offsets(g), x, u, gradient)) return {};
  Meeting m;
  m.distance = solid::distance_of(rest, state).sample(x - u);
  if (!(m.distance < reach) || !solid::velocity_at(state, layer, x, m.velocity)) return {};
  m.normal = normal_out(rest, state, x - u, gradient);
  return m;
}

// Applies Eqs. 14 and 15 to a particle, relative to the velocity `other`.
void repel_particle(const Meeting& m, double reach, double stiffness, double friction, double dt, double mass, Vec3& v,
                    Sums& sums) {
  const solid::Repulsion r =
      solid::repel((v - m.velocity).cast<double>(), m.normal, reach - m.distance, mass, stiffness, friction, dt);
  ++sums.near;
  sums.deepest = std::max(sums.deepest, -m.distance);
  if (!(r.normal_impulse > 0.0)) return;
  const Vec3d impulse = r.normal_impulse * m.normal + r.friction_impulse;
  v += (impulse / mass).cast<Real>();
  ++sums.active;
  sums.stuck += r.sticks;
  sums.normal_impulse += r.normal_impulse;
  sums.impulse += impulse;
}

// Calls body(p, sums) for every particle; the sums of chunks are added in their order.
template <class Body>
Sums for_particles(const Parallel& parallel, std::size_t count, const Body& body) {
  const auto n = static_cast<std::int64_t>(count);
  std::vector<Sums> chunks(static_cast<std::size_t>((n + kChunk - 1) / kChunk));
  parallel.for_each(static_cast<std::int64_t>(chunks.size()), [&](std::int64_t c) {
    for (std::int64_t p = c * kChunk; p < std::min(n, (c + 1) * kChunk); ++p)
      body(static_cast<std::size_t>(p), chunks[static_cast<std::size_t>(c)]);
  });
  Sums sums;
  for (const Sums& chunk : chunks) sums.add(chunk);
  return sums;
}

void repel_at_walls(const StepContext& step, const solid::SolidRest& rest, double reach, solid::Particles& particles) {
  const grid::Grid& g = step.scene.grid;
  const grid::Walls& walls = step.scene.params.walls;
  const Vec3d top = g.node_position(g.cells[0], g.cells[1], g.cells[2]);
  for_particles(step.parallel, particles.size(), [&](std::size_t p, Sums& sums) {
    for (int a = 0; a < 3; ++a)
      for (const bool upper : {false, true}) {
        if (!grid::Walls::blocks(upper ? walls.upper(a) : walls.lower(a))) continue;
        Meeting m{upper ? top[a] - particles.x[p][a] : particles.x[p][a] - g.origin[a], Vec3d::Zero(), Vec3::Zero()};
        if (!(m.distance < reach)) continue;
        m.normal[a] = upper ? -1.0 : 1.0;
        repel_particle(m, reach, rest.contact_stiffness, rest.friction, step.dt, static_cast<double>(particles.mass[p]),
                       particles.v[p], sums);
      }
  });
}

// The report of two solids from what each did to the particles of the other. one: < other.
ContactPair report(const StepContext& step, const SolidStates& states, std::size_t one, std::size_t other,
                   const Sums& on_one, const Sums& on_other) {
  ContactPair pair;
  pair.one = one;
  pair.other = other;
  pair.steps = 1;
  Sums both = on_one;
  both.add(on_other);
  pair.rows = both.near;
  pair.active_rows = both.active;
  pair.sticking_rows = both.stuck;
  pair.row_overlap = both.deepest / step.scene.grid.h;
  const bool given = is_collider(step.scene.pins, other);
  pair.normal_impulse = given ? on_one.normal_impulse : on_other.normal_impulse;
  pair.impulse = given ? Vec3d(-on_one.impulse) : on_other.impulse;
  const double gap = least_gap(step.scene, states, one, other) / step.scene.grid.h + kContactSkin;
  pair.surface_overlap = std::max(pair.row_overlap, -gap);
  return pair;
}

}  // namespace

ContactPairs repel_particles(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                             std::vector<solid::Particles>& particles) {
  ScopedTimer timer(step.profile, Stage::kContact);
  const double reach = step.scene.params.numerics.contact_distance * step.scene.grid.h;
  const std::size_t count = states.size();
  std::vector<Sums> sums(count * count);  // of what `other` did to l at l * count + other
  for (std::size_t l = 0; l < count; ++l) {
    solid::Particles& own = particles[l];
    const solid::SolidRest& rest = step.scene.solids[l];
    for (std::size_t other = 0; other < count; ++other) {
      if (other == l) continue;
      const solid::SolidRest& there = step.scene.solids[other];
      const double stiffness = 0.5 * (rest.contact_stiffness + there.contact_stiffness),
                   friction = 0.5 * (rest.friction + there.friction);
      sums[l * count + other] = for_particles(step.parallel, own.size(), [&](std::size_t p, Sums& s) {
        if (const auto m = meet(there, states[other], solids[other].layer, own.x[p], reach))
          repel_particle(*m, reach, stiffness, friction, step.dt, static_cast<double>(own.mass[p]), own.v[p], s);
      });
    }
    repel_at_walls(step, rest, reach, own);
    timer.visited(own.size(), sizeof(Vec3d) + sizeof(Vec3));
  }
  ContactPairs pairs;
  for (std::size_t one = 0; one < count; ++one)
    for (std::size_t other = one + 1; other < count; ++other) {
      const Sums &on_one = sums[one * count + other], &on_other = sums[other * count + one];
      if (on_one.active + on_other.active > 0) pairs.push_back(report(step, states, one, other, on_one, on_other));
    }
  return pairs;
}

}  // namespace efsi::sim
