#include "system/slip.hpp"

#include <algorithm>

#include "base/kernel.hpp"
#include "grid/packed_field.hpp"

namespace efsi::system {
namespace {

constexpr Real kInfiniteMass = Real(1e30);  // kg

}  // namespace

Vec3 stair_normal(std::uint8_t solid_cells, int slab) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner)
    if (solid_cells >> corner & 1u) sum += side_of(corner);
  if (slab >= 0) sum[slab] = 0;
  return sum.isZero() ? sum : sum.normalized();
}

SlipNodes::SlipNodes(const Parallel& parallel, const grid::Grid& g, std::vector<SlipNode> nodes, int slab)
    : grid_(g), nodes_(std::move(nodes)) {
  if (slab >= 0) moving_[slab] = 0;
  solid_velocity_.assign(nodes_.size(), Vec3::Zero());
  plane_begin_.assign(static_cast<std::size_t>(g.cells[2]) + 2, 0);
  for (const SlipNode& n : nodes_) ++plane_begin_[static_cast<std::size_t>(n.k) + 1];
  for (std::size_t k = 1; k < plane_begin_.size(); ++k) plane_begin_[k] += plane_begin_[k - 1];
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const auto& c = grid::kCorner[corner];
    back_[corner] = g.padded(c[0], c[1], c[2]) - g.padded(0, 0, 0);
  }
  for (const SlipNode& n : nodes_) {
    cell_.push_back(g.padded(n.i, n.j, n.k));
    std::uint8_t inside = 0;
    for (std::size_t corner = 0; corner < 8; ++corner) {
      const auto& c = grid::kCorner[corner];
      const int i = n.i - c[0], j = n.j - c[1], k = n.k - c[2];
      if (i >= 0 && j >= 0 && k >= 0 && i < g.cells[0] && j < g.cells[1] && k < g.cells[2])
        inside = static_cast<std::uint8_t>(inside | (1u << corner));
    }
    inside_.push_back(inside);
  }
  terms_.resize(nodes_.size());
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    if (!n.shared())
      terms_[t] = terms(n);
    else if (leads(t))
      terms_[t] = share_terms(t);
    else
      terms_[t] = {};
  });
}

std::size_t SlipNodes::find(std::size_t solid, std::size_t node) const {
  const auto at = std::lower_bound(nodes_.begin(), nodes_.end(), std::pair(node, solid),
                                   [](const SlipNode& n, auto key) { return std::pair(n.node, n.solid) < key; });
  return at != nodes_.end() && at->node == node && at->solid == solid ? static_cast<std::size_t>(at - nodes_.begin())
                                                                      : kNone;
}

std::size_t SlipNodes::find_shared(std::size_t solid, std::size_t node) const {
  const std::size_t t = find(solid, node);
  return t != kNone && nodes_[t].shared() ? t : kNone;
}

Vec3 SlipNodes::velocity_of(std::size_t solid, std::size_t node, const grid::VectorField& velocity) const {
  const std::size_t t = find(solid, node);
  return t == kNone ? velocity.at(node) : solid_velocity_[t];
}

void SlipNodes::set_velocity_of(std::size_t solid, std::size_t node, const Vec3& value, grid::VectorField& velocity) {
  const std::size_t t = find(solid, node);
  if (t == kNone)
    velocity.set(node, value);
  else
    solid_velocity_[t] = value;
}

void SlipNodes::prescribe(std::size_t t, std::uint8_t fixed, std::uint8_t held) {
  SlipNode& n = nodes_[t];
  n.held = held;
  if (n.fixed == fixed) return;
  n.fixed = fixed;
  while (!leads(t)) --t;
  terms_[t] = share_terms(t);
}

namespace {

Vec3 free_of(std::uint8_t fixed) {
  return Vec3(fixed & 1u ? Real(0) : Real(1), fixed & 2u ? Real(0) : Real(1), fixed & 4u ? Real(0) : Real(1));
}

// S of cells.
Vec3 sum_of_sides(std::uint8_t cells) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner)
    if (cells >> corner & 1u) sum += side_of(corner);
  return sum;
}

}  // namespace

SlipNodes::Share SlipNodes::share_of(std::size_t t) const {
  const SlipNode& first = nodes_[t];
  Share share;
  Vec3 inner = Vec3::Ones();  // 0 along axes that end here
  const int at[3] = {first.i, first.j, first.k};
  for (int a = 0; a < 3; ++a)
    if (at[a] == 0 || at[a] == grid_.cells[static_cast<std::size_t>(a)]) inner[a] = 0;
  const auto add = [&](std::uint8_t cells, std::uint8_t fixed, Real mass) {
    Member m;
    m.cells = cells;
    m.inverse_mass = free_of(fixed) / mass;
    m.side = sum_of_sides(cells).cwiseProduct(free_of(fixed)).cwiseProduct(inner);
    share.members.push_back(m);
  };
  for (std::size_t s = t; s < t + first.solids; ++s) add(nodes_[s].solid_cells, nodes_[s].fixed, nodes_[s].solid_mass);
  share.fluid = first.fluid_cells != 0;
  if (share.fluid) add(first.fluid_cells, first.fluid_fixed, first.fluid_mass);
  if (!first.in_fluid) return share;
  Real sum = 0;
  for (const Member& m : share.members) sum += m.side.dot(m.inverse_mass.cwiseProduct(m.side));
  share.reaction = sum > 0 ? 1 / sum : Real(0);
  return share;
}

void SlipNodes::respond(Share& share) {
  Real making = 0;  // of volume
  for (Member& m : share.members) {
    m.loss = m.inverse_mass.cwiseProduct(m.impulse);
    making += m.side.dot(m.loss);
  }
  for (Member& m : share.members) m.loss -= share.reaction * making * m.inverse_mass.cwiseProduct(m.side);
}

Vec3 SlipNodes::base_inverse_mass(const SlipNode& n) const { return free_of(n.base_fixed) / n.mass; }

SlipNodes::Terms SlipNodes::share_terms(std::size_t t) const {
  Share share = share_of(t);
  const Vec3 base = base_inverse_mass(nodes_[t]);
  Terms out{};
  std::uint8_t all = 0;
  for (const Member& m : share.members) all = static_cast<std::uint8_t>(all | m.cells);
  for (std::size_t c = 0; c < 8; ++c) {
    if (!(all >> c & 1u)) continue;
    for (Member& m : share.members) m.impulse = m.cells >> c & 1u ? side_of(c) : Vec3::Zero();
    respond(share);
    const Vec3 one = base.cwiseProduct(side_of(c));
    for (const Member& m : share.members)
      for (std::size_t d = 0; d < 8; ++d)
        if (m.cells >> d & 1u) out[c][d] = area() * area() * side_of(d).dot(m.loss - one);
  }
  return out;
}

Real SlipNodes::slipping_volume(std::size_t t) const {
  Real sum = 0;
  for (std::size_t c = 0; c < 8; ++c) sum += terms_[t][c][c];
  return static_cast<Real>(grid_.h * grid_.h * grid_.h) / (8 * moving_.sum() * area() * area()) * sum;
}

// By the sum of the row of the node's block of A, |x.Ax| <= sum over c of x_c^2 sum over d |A_cd|: 3/8 of it leave
// D^-1 A <= 8/3. Less what A_1 has for it.
Real SlipNodes::smoother_share(std::size_t t, std::size_t corner) const {
  const Vec3 one = area() * area() * base_inverse_mass(nodes_[t]);
  Real sum = 0;
  for (std::size_t d = 0; d < 8; ++d)
    sum += std::abs(one.cwiseProduct(side_of(corner)).dot(side_of(d)) + terms_[t][corner][d]);
  return Real(0.375) * sum - one.sum();
}

// A pressure q in cell c exerts the impulse area q side(c). Its own velocity loses the tangential part of that over its
// own mass, both gain the same over their common mass, and cell d sees area side(d) times what its velocity loses.
SlipNodes::Terms SlipNodes::terms(const SlipNode& n) const {
  using grid::Octet;
  Octet sides[3], solid;  // per cell
  for (std::size_t d = 0; d < 8; ++d) {
    const Vec3 s = side(d);
    for (int a = 0; a < 3; ++a) sides[a][d] = s[a];
    solid[d] = in_solid(n, d) ? Real(1) : Real(0);
  }
  const Octet normal = n.normal[0] * sides[0] + n.normal[1] * sides[1] + n.normal[2] * sides[2];
  const Real square = area() * area(), common = square / (n.solid_mass + n.fluid_mass);
  const Real solid_share = square / n.solid_mass, fluid_share = square / n.fluid_mass;
  Terms out;
  for (std::size_t c = 0; c < 8; ++c) {
    const Octet across = sides[0][c] * sides[0] + sides[1][c] * sides[1] + sides[2][c] * sides[2] - normal[c] * normal;
    const Octet own = in_solid(n, c) ? solid_share * solid : fluid_share * (Real(1) - solid);
    grid::store_octet(out[c].data(), across * (own - common));
  }
  return out;
}

void SlipNodes::hold(const Parallel& parallel, const std::vector<Real>& specific_volume) {
  parallel.for_each(static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t i) {
    const auto t = static_cast<std::size_t>(i);
    if (specific_volume[nodes_[t].node] > 0) return;
    if (nodes_[t].shared()) {
      nodes_[t].base_fixed = 7;
      if (leads(t)) terms_[t] = share_terms(t);
      return;
    }
    nodes_[t].solid_mass = kInfiniteMass;
    terms_[t] = terms(nodes_[t]);
  });
}

void SlipNodes::swap(const Parallel& parallel, std::size_t solid, grid::VectorField& velocity) {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    if (n.solid != solid) return;
    const Vec3 v = velocity.at(n.node);
    velocity.set(n.node, solid_velocity_[t]);
    solid_velocity_[t] = v;
  });
}

// Volume that a shared node makes, times 4 / h^2, where it has fluid.
Real SlipNodes::making(std::size_t t, const Share& share, const Vec3& fluid) const {
  Real sum = share.members.back().side.dot(fluid);
  for (std::size_t s = 0; s < nodes_[t].solids; ++s) sum += share.members[s].side.dot(solid_velocity_[t + s]);
  return sum;
}

void SlipNodes::share_normal(const Parallel& parallel, grid::VectorField& velocity) {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Vec3 fluid = velocity.at(n.node);
    if (n.shared()) {
      if (!leads(t)) return;
      const Share share = share_of(t);
      if (!share.fluid || share.members.back().side.isZero()) return;
      const Real made = share.reaction * making(t, share, fluid);
      const auto loss = [&](const Member& m) -> Vec3 { return made * m.inverse_mass.cwiseProduct(m.side); };
      for (std::size_t s = 0; s < n.solids; ++s) solid_velocity_[t + s] -= loss(share.members[s]);
      velocity.set(n.node, fluid - loss(share.members.back()));
      return;
    }
    const Vec3 jump = n.normal.dot(fluid - solid_velocity_[t]) * n.normal / (n.solid_mass + n.fluid_mass);
    solid_velocity_[t] += n.fluid_mass * jump;
    velocity.set(n.node, fluid - n.solid_mass * jump);
  });
}

// What the fluid at a shared node moves with: the part along S_f fills what the solids leave; without cells of its own
// it is where they are.
Vec3 SlipNodes::filling(std::size_t t, const Vec3& fluid) const {
  const SlipNode& n = nodes_[t];
  const Share share = share_of(t);
  if (!share.fluid) {
    Vec3 momentum = Vec3::Zero();
    Real mass = 0;
    for (std::size_t s = t; s < t + n.solids; ++s) {
      momentum += nodes_[s].solid_mass * solid_velocity_[s];
      mass += nodes_[s].solid_mass;
    }
    return momentum / mass;
  }
  const Vec3& side = share.members.back().side;
  if (side.isZero()) return fluid;
  return fluid - making(t, share, fluid) / side.squaredNorm() * side;
}

double SlipNodes::opening(const grid::VectorField& velocity) const {
  double sum = 0.0;
  for (std::size_t t = 0; t < nodes_.size(); ++t) {
    const SlipNode& n = nodes_[t];
    if (!n.shared() || !n.in_fluid) continue;
    sum += static_cast<double>(sum_of_sides(n.solid_cells).dot(solid_velocity_[t]));
    if (leads(t)) sum += static_cast<double>(sum_of_sides(n.fluid_cells).dot(velocity.at(n.node)));
  }
  return static_cast<double>(area()) * sum;
}

void SlipNodes::follow_solid(const Parallel& parallel, grid::VectorField& velocity) const {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Vec3 fluid = velocity.at(n.node);
    if (n.shared()) {
      if (leads(t)) velocity.set(n.node, filling(t, fluid));
      return;
    }
    velocity.set(n.node, fluid + n.normal.dot(solid_velocity_[t] - fluid) * n.normal);
  });
}

void SlipNodes::correct_flux(const Parallel& parallel, const grid::VectorField& velocity,
                             std::vector<Real>& flux) const {
  for_cells(parallel, [&](std::size_t t, std::size_t corner, std::size_t cell) {
    if (!in_solid(nodes_[t], corner)) return;
    flux[cell] += area() * side_of(corner).dot(solid_velocity_[t] - velocity.at(nodes_[t].node));
  });
}

// g_s and g_f [kg m/s] at a node.
SlipNodes::Pair SlipNodes::impulses(std::size_t t, const std::vector<Real>& q) const {
  Pair g{Vec3::Zero(), Vec3::Zero()};
  for (std::size_t corner = 0; corner < 8; ++corner)
    (in_solid(nodes_[t], corner) ? g.solid : g.fluid) += q[cell_[t] - back_[corner]] * side(corner);
  return {area() * g.solid, area() * g.fluid};
}

// What the two velocities lose beyond g / (m_s + m_f).
SlipNodes::Pair SlipNodes::slip(const SlipNode& n, const Pair& g) {
  const Vec3 common = (g.solid + g.fluid) / (n.solid_mass + n.fluid_mass);
  return {across(n.normal, g.solid / n.solid_mass - common), across(n.normal, g.fluid / n.fluid_mass - common)};
}

namespace {

using Terms = std::array<std::array<Real, 8>, 8>;

// cell: of which the node is corner 0; back: steps from there to the others.
EFSI_KERNEL void give(std::int64_t count, const Terms* terms, const std::size_t* cell, const std::size_t* back,
                      const Real* x, Real* out) {
  for (std::int64_t t = 0; t < count; ++t) {
    grid::Octet sum{};
#pragma GCC unroll 8
    for (std::size_t c = 0; c < 8; ++c) sum += x[cell[t] - back[c]] * grid::load_octet(terms[t][c].data());
    grid::store_octet(out + 8 * t, sum);
  }
}

}  // namespace

void SlipNodes::excess(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& out) const {
  out.resize(8 * nodes_.size());
  parallel.for_ranges(static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t begin, std::int64_t end) {
    give(end - begin, terms_.data() + begin, cell_.data() + begin, back_.data(), x.data(), out.data() + 8 * begin);
  });
}

// J^T q by the members of a shared node.
void SlipNodes::add_pressure_impulse(std::size_t t, const std::vector<Real>& q, Share& share) const {
  for (Member& m : share.members) {
    m.impulse.setZero();
    for (std::size_t corner = 0; corner < 8; ++corner)
      if (m.cells >> corner & 1u) m.impulse += area() * q[cell_[t] - back_[corner]] * side_of(corner);
  }
}

// The field has lost what the node would with one velocity.
void SlipNodes::subtract_share(std::size_t t, const std::vector<Real>& q, grid::VectorField& velocity) {
  const SlipNode& n = nodes_[t];
  Share share = share_of(t);
  add_pressure_impulse(t, q, share);
  respond(share);
  for (std::size_t s = 0; s < n.solids; ++s) solid_velocity_[t + s] -= share.members[s].loss;
  Vec3 all = Vec3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner) all += area() * q[cell_[t] - back_[corner]] * side_of(corner);
  Vec3 fluid = velocity.at(n.node) + base_inverse_mass(n).cwiseProduct(all);
  if (share.fluid) fluid -= share.members.back().loss;
  velocity.set(n.node, fluid);
}

// What acts on a solid of a shared node: its own cells, less the pressure of the fluid in front of S_f on its own side.
Vec3 SlipNodes::share_impulse(std::size_t t, const std::vector<Real>& q) const {
  std::size_t first = t;
  while (!leads(first)) --first;
  Share share = share_of(first);
  add_pressure_impulse(first, q, share);
  const Member& own = share.members[t - first];
  if (!share.fluid || share.reaction == 0) return own.impulse;
  const Member& fluid = share.members.back();
  const Real square = fluid.side.squaredNorm();
  return square > 0 ? Vec3(own.impulse - fluid.side.dot(fluid.impulse) / square * own.side) : own.impulse;
}

void SlipNodes::subtract_gradient(const Parallel& parallel, const std::vector<Real>& q, grid::VectorField& velocity) {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    if (n.shared()) {
      if (leads(t)) subtract_share(t, q, velocity);
      return;
    }
    const Pair g = impulses(t, q), both = slip(n, g);
    solid_velocity_[t] -= (g.solid + g.fluid) / (n.solid_mass + n.fluid_mass) + both.solid;
    velocity.set(n.node, velocity.at(n.node) - both.fluid);
  });
}

Vec3 SlipNodes::solid_impulse(std::size_t t, const std::vector<Real>& q) const {
  const SlipNode& n = nodes_[t];
  if (n.shared()) return share_impulse(t, q);
  const Pair g = impulses(t, q);
  return g.solid + n.normal.dot(g.fluid) * n.normal;
}

std::vector<Vec3> SlipNodes::sliding_impulse(const Parallel& parallel, const std::vector<Real>& q) const {
  std::vector<Vec3> out(nodes_.size());
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Pair g = impulses(t, q);
    out[t] = n.shared() ? Vec3(g.solid + g.fluid - share_impulse(t, q)) : across(n.normal, g.fluid);
  });
  return out;
}

Vec3d SlipNodes::relative_momentum(const grid::VectorField& velocity) const {
  Vec3d sum = Vec3d::Zero();
  for (std::size_t t = 0; t < nodes_.size(); ++t)
    sum +=
        static_cast<double>(nodes_[t].solid_mass) * (solid_velocity_[t] - velocity.at(nodes_[t].node)).cast<double>();
  return sum;
}

std::size_t SlipNodes::bytes() const {
  return nodes_.size() * (sizeof(SlipNode) + sizeof(Terms) + sizeof(std::size_t) + 1) +
         plane_begin_.size() * sizeof(std::size_t) + solid_velocity_.size() * sizeof(Vec3);
}

}  // namespace efsi::system
