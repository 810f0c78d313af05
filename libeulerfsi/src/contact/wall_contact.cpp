#include "contact/wall_contact.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "contact/hold.hpp"
#include "contact/push_out.hpp"
#include "frame/grid_loops.hpp"
#include "nodes/fixed_components.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

constexpr double kTouches = 0.2;    // cells: gap up to which an active row stays active
constexpr double kBetween = 0.075;  // cells: depth of a vertex between columns that a node in touch does not see
constexpr double kLetsGo = 0.5;     // of the force of a face in the last step: with less a contact ends
constexpr double kNoGap = 1e30;     // the column of a node does not meet the solid

// Distance of the undeformed surface of the material at a node [m].
double rest_distance(const solid::SolidRest& rest, const solid::SolidState& state, std::size_t node) {
  const auto [i, j, k] = state.band.grid.node_place(node);
  return solid::distance_of(rest, state)
      .sample(state.band.grid.node_position(i, j, k) - state.u.at(node).cast<double>());
}

// How far the solid's surface is from the wall along the column of nodes that starts on it [m]; < 0: it is beyond.
double column_gap(const solid::SolidRest& rest, const solid::SolidState& state, std::size_t node, std::size_t above) {
  const double h = state.band.grid.h;
  if (!state.valid[node] || !state.valid[above]) return kNoGap;
  const double on_wall = rest_distance(rest, state, node), inside = rest_distance(rest, state, above);
  if (on_wall > 0.0) return inside < 0.0 ? h * on_wall / (on_wall - inside) : kNoGap;
  const double fall = on_wall - inside;  // of the distance over one cell; at least a half of what is usual
  return std::max(-kDeepest * h, h * on_wall / std::max(fall, 0.5 * h));
}

std::uint8_t bit(int axis) { return static_cast<std::uint8_t>(1u << axis); }

// The nodes of a solid on one face of the box.
struct Footprint {
  std::vector<WallRow> rows;
  std::vector<std::size_t> nodes;  // of the band
};

Footprint footprint(const StepContext& step, const solid::SolidState& state, const solid::SolidWork& work,
                    std::size_t l, const CommonGrid& common, std::size_t face) {
  Footprint out;
  const Grid &g = common.grid, &band = state.band.grid;
  if (!grid::Walls::blocks(common.walls.face[face])) return out;
  if (static_cast<int>(face / 2) == grid::slab_axis(g, common.walls)) return out;  // a slab's faces always constrain it
  const Vec3i lo = grid::offset(band, g);
  const std::size_t a = face / 2, u = (a + 1) % 3, v = (a + 2) % 3;
  const bool below = face % 2 == 0;
  const int axis = static_cast<int>(a), plane = (below ? 0 : g.cells[a]) - lo[a];
  if (plane < 0 || plane > band.cells[a]) return out;
  const auto inwards = [&](std::size_t node, const Grid& of) {
    return below ? node + of.node_stride(axis) : node - of.node_stride(axis);
  };
  for (int p = 0; p <= band.cells[v]; ++p)
    for (int q = 0; q <= band.cells[u]; ++q) {
      Vec3i at;
      at[a] = plane;
      at[u] = q;
      at[v] = p;
      std::size_t local = band.node(at[0], at[1], at[2]);
      WallRow row;
      row.on_wall = work.carries[local];
      if (!row.on_wall) {  // a corner or an edge that fills little of the cell on the wall
        at[a] += below ? 1 : -1;
        if (at[a] < 1 || at[a] >= band.cells[a]) continue;
        local = band.node(at[0], at[1], at[2]);
        if (!work.carries[local]) continue;
      }
      row.solid = l;
      row.node = g.node(at[0] + lo[0], at[1] + lo[1], at[2] + lo[2]);
      row.above = inwards(row.node, g);
      for (std::size_t c = 0; c < 3; ++c) row.place[c] = at[c] + band.lo[c];
      row.axis = axis;
      row.out = below ? Real(1) : Real(-1);
      row.gap = row.on_wall ? column_gap(step.scene.solids[l], state, local, inwards(local, band)) : kNoGap;
      out.rows.push_back(row);
      out.nodes.push_back(local);
    }
  return out;
}

// A node beside the solid, whose column does not meet it, has the least gap of its neighbours on the wall.
void fill_gaps(const Grid& band, const solid::SolidRest& rest, const solid::SolidState& solid, Footprint& print) {
  std::map<std::size_t, double> known;  // band node -> gap
  for (std::size_t r = 0; r < print.rows.size(); ++r)
    if (print.rows[r].gap < kNoGap) known[print.nodes[r]] = print.rows[r].gap;
  for (std::size_t r = 0; r < print.rows.size(); ++r) {
    double& gap = print.rows[r].gap;
    if (gap < kNoGap || !print.rows[r].on_wall) continue;
    const std::size_t along = band.node_stride((print.rows[r].axis + 1) % 3),
                      across = band.node_stride((print.rows[r].axis + 2) % 3);
    for (std::size_t p = 0; p <= 2; ++p)
      for (std::size_t q = 0; q <= 2; ++q) {
        const auto near = known.find(print.nodes[r] + p * along + q * across - along - across);
        if (near != known.end()) gap = std::min(gap, near->second);
      }
    if (!(gap < kNoGap)) gap = std::max(0.0, rest_distance(rest, solid, print.nodes[r]));
  }
}

// Between the columns the surface may lie deeper: its vertices are seen by the nearest node of the columns around them;
// midway, where rounding would choose, by all that are nearest. Above the wall only nodes that see some are kept. face:
// of the box.
void find_vertices(const CommonGrid& common, const solid::SolidState& solid, std::size_t face, Footprint& print) {
  const Grid& g = common.grid;
  const auto a = static_cast<Eigen::Index>(face / 2), u = (a + 1) % 3, v = (a + 2) % 3;
  const double wall = face % 2 ? g.origin[a] + g.h * g.cells[face / 2] : g.origin[a];
  std::map<std::pair<int, int>, WallRow*> at;
  for (WallRow& row : print.rows) {
    const Vec3i place = g.node_place(row.node);
    at[{place[static_cast<std::size_t>(u)], place[static_cast<std::size_t>(v)]}] = &row;
  }
  std::vector<std::pair<double, WallRow*>> around;
  for (const Vec3d& x : solid.surface) {
    const double gap = face % 2 ? wall - x[a] : x[a] - wall;
    if (gap > g.h || gap < -kDeepest * g.h) continue;
    const double i = (x[u] - g.origin[u]) / g.h, j = (x[v] - g.origin[v]) / g.h;
    // Columns at most so far away, and the rows of the nearest.
    constexpr double kAround = 1.5 - 1e-4, kMidway = 1e-4;  // cells, square cells
    double least = std::numeric_limits<double>::infinity();
    around.clear();
    for (int p = static_cast<int>(std::ceil(i - kAround)); p <= i + kAround; ++p)
      for (int q = static_cast<int>(std::ceil(j - kAround)); q <= j + kAround; ++q) {
        const auto row = at.find({p, q});
        if (row == at.end()) continue;
        around.emplace_back((i - p) * (i - p) + (j - q) * (j - q), row->second);
        least = std::min(least, around.back().first);
      }
    for (const auto& [square, row] : around)
      if (square <= least + kMidway) row->vertex = std::min(row->vertex, gap);
  }
  std::erase_if(print.rows, [](const WallRow& row) { return !row.on_wall && row.vertex >= kNoGap; });
}

using LastPresses = std::map<std::array<std::int32_t, 4>, const solid::WallImpulse*>;

LastPresses last_presses(const solid::SolidState& solid) {
  LastPresses last;
  for (const solid::WallImpulse& p : solid.presses) last[{p.node[0], p.node[1], p.node[2], p.axis}] = &p;
  return last;
}

// Whether a row is active, and its friction. before: along `out`, at the start of the step; v: without the
// solid's own forces; fast: the solid is not at rest.
void decide(const StepContext& step, const solid::WallImpulse* last, bool fast, double friction, Real before,
            const Vec3& v, WallRow& row) {
  const double h = step.scene.grid.h;
  // Vertices a little deeper than the columns do not activate a row, and those of a solid at rest come and go at the
  // edge of a footprint.
  const double seen = row.vertex > 0.0 ? row.vertex : std::min(0.0, row.vertex + kBetween * h);
  if (fast || seen < 0.0) row.gap = std::min(row.gap, seen);
  row.least = static_cast<Real>(least_velocity(row.gap, step));
  const bool was_active = last && last->force > 0;
  if (last && row.gap < kTouches * h) {
    row.holds = was_active;
    row.least = std::max(row.least, Real(0));
  } else {
    row.holds = before < row.least;
  }
  if (!row.holds || !was_active) return;
  row.limit = static_cast<Real>(friction * static_cast<double>(last->force) * step.dt);
  if (!(row.limit > 0)) return;
  row.friction_state = last->slides ? FrictionState::kSlides : FrictionState::kSticks;
  if (row.friction_state == FrictionState::kSticks) return;
  Vec3 along = v;
  along[row.axis] = 0;
  row.sliding_direction = along.stableNormalized();
  const Vec3 tension(last->friction_force[0], last->friction_force[1], last->friction_force[2]);
  if (row.sliding_direction.dot(tension) > 0)
    row.sliding_direction = -tension.stableNormalized();  // a node that has just stuck has no sliding direction
}

// While a solid slides it leaves nodes and comes upon others, of which the last step says nothing: friction as a whole
// is that of the total normal impulse of the face.
void share_friction(double whole, std::vector<WallRow>& rows) {
  double sum = 0.0;
  for (const WallRow& row : rows) sum += static_cast<double>(row.limit);
  if (!(sum > 0.0)) return;
  const Real factor = static_cast<Real>(whole / sum);
  for (WallRow& row : rows) row.limit *= factor;
}

// All rows, the normal velocities of which are those in `velocity`.
std::vector<WallRow> find_rows(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                               const CommonGrid& common, const NodeVelocity& velocity) {
  std::vector<WallRow> rows;
  std::map<std::pair<std::size_t, std::size_t>, std::uint8_t> axes;  // solid, node -> axes with a row
  for (std::size_t l = 0; l < step.scene.solids.size(); ++l) {
    const LastPresses last = last_presses(states[l]);
    const grid::VectorField& own = states[l].v;
    const bool fast = states[l].speed * step.dt > kSlow * step.scene.grid.h;
    for (std::size_t face = 0; face < 6; ++face) {
      Footprint print = footprint(step, states[l], solids[l], l, common, face);
      if (print.rows.empty()) continue;
      fill_gaps(states[l].band.grid, step.scene.solids[l], states[l], print);
      find_vertices(common, states[l], face, print);
      std::erase_if(print.rows, [&](const WallRow& row) { return axes[{l, row.node}] & bit(row.axis); });
      for (WallRow& row : print.rows) {
        const Grid& band = states[l].band.grid;
        const std::size_t node =
            band.node(row.place[0] - band.lo[0], row.place[1] - band.lo[1], row.place[2] - band.lo[2]);
        const auto held = last.find({row.place[0], row.place[1], row.place[2], row.axis});
        decide(step, held == last.end() ? nullptr : held->second, fast, step.scene.solids[l].friction,
               row.out * own.c[static_cast<std::size_t>(row.axis)][node],
               velocity.slip.velocity_of(l, row.node, velocity.field), row);
        axes[{l, row.node}] |= bit(row.axis);
      }
      share_friction(step.scene.solids[l].friction * step.dt * pushed_at(states[l], face), print.rows);
      rows.insert(rows.end(), print.rows.begin(), print.rows.end());
    }
  }
  for (WallRow& row : rows) row.tangents = static_cast<std::uint8_t>(7u & ~axes[{row.solid, row.node}]);
  return rows;
}

// What a row prescribes of v, and what impulse that takes.
Vec3 prescribe(Real mass, Vec3 v, WallRow& row) {
  if (row.holds) {
    row.normal_impulse = mass * (row.least - row.out * v[row.axis]);
    v[row.axis] = row.out * row.least;
  }
  for (int a = 0; a < 3; ++a) {
    if (!(row.tangents & bit(a))) {
      row.sliding_direction[a] = 0;
    } else if (row.friction_state == FrictionState::kSticks) {
      row.friction_impulse[a] = -mass * v[a];
      v[a] = 0;
    }
  }
  return v;
}

// The same where solids share the node.
void prescribe_shared(std::size_t t, const WallRow& row, system::SlipNodes& slip) {
  std::uint8_t fixed = slip.nodes()[t].fixed, held = slip.nodes()[t].held;
  held = static_cast<std::uint8_t>(row.holds ? held | bit(row.axis) : held & ~bit(row.axis));
  if (row.friction_state == FrictionState::kSticks) {
    held = static_cast<std::uint8_t>(held | row.tangents);
    if (row.on_wall) fixed = static_cast<std::uint8_t>(fixed | row.tangents);
  }
  slip.prescribe(t, fixed, held);
}

// The face of the box on which a row was; a row above it is one node away.
std::size_t face_of(const solid::WallImpulse& p) {
  return 2 * static_cast<std::size_t>(p.axis) + (p.node[static_cast<std::size_t>(p.axis)] > 1);
}

using FaceForces = std::array<double, 6>;  // by which the faces of the box push a solid [N]

FaceForces face_forces(const solid::SolidState& solid) {
  FaceForces forces{};
  for (const solid::WallImpulse& p : solid.presses)
    if (p.force > 0) forces[face_of(p)] += static_cast<double>(p.force);
  return forces;
}

}  // namespace

double pushed_at(const solid::SolidState& solid, std::size_t face) { return face_forces(solid)[face]; }

void meet_walls(const StepContext& step, const SolidStates& states, const SolidWorks& solids, Matter& matter,
                NodeVelocity& velocity, std::vector<WallRow>& rows) {
  ScopedTimer timer(step.profile, Stage::kFluidForces);
  system::SlipNodes& slip = velocity.slip;
  slip.share_normal(step.parallel, velocity.field);
  rows.clear();
  if (step.scene.params.numerics.unilateral_walls) rows = find_rows(step, states, solids, matter.common, velocity);
  std::vector<Vec3> prescribed;
  for (WallRow& row : rows) {
    const std::size_t t = slip.find_shared(row.solid, row.node);
    const bool shared = t != system::SlipNodes::kNone;
    prescribed.push_back(prescribe(shared ? slip.nodes()[t].solid_mass : matter.mass[row.node],
                                   slip.velocity_of(row.solid, row.node, velocity.field), row));
    if (shared)
      prescribe_shared(t, row, slip);
    else if (row.friction_state == FrictionState::kSticks && row.on_wall)
      matter.fixed[row.node] = static_cast<std::uint8_t>(matter.fixed[row.node] | row.tangents);
  }
  enforce_walls(step.parallel, matter.common, matter.fixed, velocity.field);
  for (std::size_t t = 0; t < slip.nodes().size(); ++t)
    for (int a = 0; a < 3; ++a)
      if (slip.nodes()[t].fixed & bit(a)) slip.solid_velocity()[t][a] = 0;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    Vec3 v = slip.velocity_of(rows[r].solid, rows[r].node, velocity.field);
    v[rows[r].axis] = prescribed[r][rows[r].axis];
    slip.set_velocity_of(rows[r].solid, rows[r].node, rows[r].on_wall ? v : prescribed[r], velocity.field);
  }
}

bool is_on_wall(const std::vector<WallRow>& rows, std::size_t solid) {
  return std::any_of(rows.begin(), rows.end(), [&](const WallRow& row) { return row.solid == solid && row.holds; });
}

std::vector<std::uint8_t> held_components(const std::vector<std::uint8_t>& fixed, const std::vector<WallRow>& rows) {
  std::vector<std::uint8_t> held = fixed;
  for (const WallRow& row : rows) {
    std::uint8_t& components = held[row.node];
    components = static_cast<std::uint8_t>(row.holds ? components | bit(row.axis) : components & ~bit(row.axis));
    if (row.friction_state == FrictionState::kSticks) components = static_cast<std::uint8_t>(components | row.tangents);
  }
  return held;
}

namespace {

std::size_t unknown_of(const WallRow& row, const system::VelocitySystem& system) {
  return system.unknown_of(row.solid, row.node);
}

}  // namespace

void tie_rows(const std::vector<WallRow>& rows, system::VelocitySystem& system) {
  for (const WallRow& row : rows)
    if (!row.holds && row.on_wall)
      system.tie(unknown_of(row, system), system.unknown_of(row.solid, row.above), row.axis);
}

namespace {

// Adds to the right-hand sides, `part` times, what brakes a row that slides.
void brake(const WallRow& row, Real part, const system::VelocitySystem& system, RightSides right) {
  const std::size_t u = 3 * unknown_of(row, system);
  for (std::size_t a = 0; a < 3; ++a) {
    if (!(row.tangents & bit(static_cast<int>(a)))) continue;
    const Real impulse = -row.limit * row.sliding_direction[static_cast<Eigen::Index>(a)];
    right.f_star[u + a] += part * impulse;
    right.momentum[u + a] += part * impulse;
  }
}

}  // namespace

void add_friction(const std::vector<WallRow>& rows, const system::VelocitySystem& system, RightSides right) {
  for (const WallRow& row : rows)
    if (row.friction_state == FrictionState::kSlides) brake(row, 1, system, right);
}

bool hold_more(std::vector<WallRow>& rows, system::VelocitySystem& system, RightSides right,
               std::vector<Real>& v_star) {
  bool any = false;
  for (WallRow& row : rows) {
    const std::size_t unknown = unknown_of(row, system), u = 3 * unknown;
    const Vec3 v(v_star[u], v_star[u + 1], v_star[u + 2]);
    if (!row.holds && row.out * v[row.axis] < row.least) {
      row.holds = any = true;
      v_star[u + static_cast<std::size_t>(row.axis)] = row.out * row.least;
      system.fix(unknown, row.axis);
    }
    if (row.friction_state != FrictionState::kSlides || !(v.dot(row.sliding_direction) < 0)) continue;
    row.friction_state = FrictionState::kSticks;
    any = row.late = true;
    brake(row, -1, system, right);
    for (std::size_t a = 0; a < 3; ++a) {
      if (!(row.tangents & bit(static_cast<int>(a)))) continue;
      v_star[u + a] = 0;
      system.fix(unknown, static_cast<int>(a));
    }
  }
  return any;
}

namespace {

// Of an active row: its part along the normal, and along the tangents where it sticks.
void add(const Vec3& impulse, WallRow& row) {
  if (row.holds) row.normal_impulse += row.out * impulse[row.axis];
  if (row.friction_state != FrictionState::kSticks) return;
  for (int a = 0; a < 3; ++a)
    if (row.tangents & bit(a)) row.friction_impulse[a] += impulse[a];
}

}  // namespace

void add_velocity_reactions(const Reaction& reaction, std::vector<WallRow>& rows) {
  for (WallRow& row : rows) add(reaction(row.solid, row.node), row);
}

void share_remainder(const std::vector<Vec3d>& sums, const Reaction& reaction, std::vector<WallRow>& rows) {
  const auto holds_along = [](const WallRow& row, int a) {
    return (row.holds && row.axis == a) || (row.friction_state == FrictionState::kSticks && (row.tangents & bit(a)));
  };
  std::vector<Vec3d> rest = sums;
  std::vector<std::array<int, 3>> count(sums.size(), std::array<int, 3>{});
  for (const WallRow& row : rows) {
    const Vec3 impulse = reaction(row.solid, row.node);
    for (int a = 0; a < 3; ++a)
      if (holds_along(row, a)) {
        rest[row.solid][a] -= static_cast<double>(impulse[a]);
        ++count[row.solid][static_cast<std::size_t>(a)];
      }
  }
  for (WallRow& row : rows) {
    Vec3 part = Vec3::Zero();
    for (int a = 0; a < 3; ++a)
      if (holds_along(row, a))
        part[a] = static_cast<Real>(rest[row.solid][a] / count[row.solid][static_cast<std::size_t>(a)]);
    add(part, row);
  }
}

namespace {

// The part of an impulse along the components of a row that the projection holds as well.
Vec3 held_in_projection(Vec3 impulse, const WallRow& row) {
  for (int a = 0; a < 3; ++a)
    if (!row.on_wall || (row.late && a != row.axis)) impulse[a] = 0;
  return impulse;
}

}  // namespace

void add_pressure_reactions(const Reaction& reaction, std::vector<WallRow>& rows) {
  for (WallRow& row : rows) add(held_in_projection(reaction(row.solid, row.node), row), row);
}

void add_projection_reactions(const Reaction& reaction, std::vector<WallRow>& rows) {
  for (WallRow& row : rows)
    if (row.on_wall && !row.holds) row.normal_impulse += row.out * reaction(row.solid, row.node)[row.axis];
}

void add_coupling_reactions(const Reaction& reaction, std::vector<WallRow>& rows) {
  for (WallRow& row : rows) {
    const Vec3 impulse = reaction(row.solid, row.node);
    add(impulse - held_in_projection(impulse, row), row);
  }
}

void reset_above_walls(const std::vector<Real>& mass, NodeVelocity& velocity, std::vector<WallRow>& rows) {
  for (WallRow& row : rows) {
    if (row.on_wall || !row.holds) continue;
    const std::size_t t = velocity.slip.find_shared(row.solid, row.node);
    const bool shared = t != system::SlipNodes::kNone;
    Vec3 v = velocity.slip.velocity_of(row.solid, row.node, velocity.field);
    const Real missing = std::max(Real(0), row.least - row.out * v[row.axis]);
    v[row.axis] += row.out * missing;
    velocity.slip.set_velocity_of(row.solid, row.node, v, velocity.field);
    row.normal_impulse += (shared ? velocity.slip.nodes()[t].solid_mass : mass[row.node]) * missing;
  }
}

namespace {

// A contact ends where its force has fallen by more than half in a step: in the next one it would pull. Its rows are
// forgotten; those that should have held are activated after the velocity solve.
void let_go(const std::vector<FaceForces>& before, SolidStates& states) {
  for (std::size_t l = 0; l < states.size(); ++l) {
    const FaceForces now = face_forces(states[l]);
    for (solid::WallImpulse& p : states[l].presses) {
      const std::size_t face = face_of(p);
      if (now[face] < kLetsGo * before[l][face]) p.force = 0;
    }
  }
}

}  // namespace

void remember_rows(double dt, const std::vector<WallRow>& rows, SolidStates& states) {
  std::vector<FaceForces> before;
  for (solid::SolidState& solid : states) {
    before.push_back(face_forces(solid));
    solid.presses.clear();
  }
  const Real rate = static_cast<Real>(1.0 / dt);
  for (const WallRow& row : rows) {
    if (!row.holds) continue;
    const Vec3 friction =
        rate * (row.friction_state == FrictionState::kSlides ? Vec3(-row.limit * row.sliding_direction)
                                                             : row.friction_impulse);
    // A sticking node slides once its friction has exceeded the limit.
    const bool slides = row.friction_state == FrictionState::kSlides ||
                        (row.friction_state == FrictionState::kSticks && row.friction_impulse.norm() > row.limit);
    states[row.solid].presses.push_back({{row.place[0], row.place[1], row.place[2]},
                                         row.axis,
                                         rate * row.normal_impulse,
                                         {friction[0], friction[1], friction[2]},
                                         slides || row.friction_state == FrictionState::kNone});
  }
  let_go(before, states);
}

void still_fluid(const std::vector<WallRow>& rows, grid::VectorField& flow) {
  for (const WallRow& row : rows)
    if (row.on_wall) flow.c[static_cast<std::size_t>(row.axis)][row.node] = 0;
}

}  // namespace efsi::sim
