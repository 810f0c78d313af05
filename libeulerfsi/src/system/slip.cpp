#include "system/slip.hpp"

#include "base/kernel.hpp"
#include "grid/packed_field.hpp"

namespace efsi::system {
namespace {

constexpr Real kNoEndOfMass = Real(1e30);  // kg

}  // namespace

Vec3 stair_normal(std::uint8_t solid_cells) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner)
    if (solid_cells >> corner & 1u) sum += side_of(corner);
  return sum.isZero() ? sum : sum.normalized();
}

SlipNodes::SlipNodes(const Parallel& parallel, const grid::Grid& g, std::vector<SlipNode> nodes)
    : grid_(g), nodes_(std::move(nodes)) {
  solid_velocity_.assign(nodes_.size(), Vec3::Zero());
  plane_begin_.assign(static_cast<std::size_t>(g.cells[2]) + 2, 0);
  for (const SlipNode& n : nodes_) ++plane_begin_[static_cast<std::size_t>(n.k) + 1];
  for (std::size_t k = 1; k < plane_begin_.size(); ++k) plane_begin_[k] += plane_begin_[k - 1];
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const auto& c = grid::kCorner[corner];
    back_[corner] = g.padded(c[0], c[1], c[2]) - g.padded(0, 0, 0);
  }
  for (const SlipNode& n : nodes_) cell_.push_back(g.padded(n.i, n.j, n.k));
  terms_.resize(nodes_.size());
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) { terms_[t] = terms(n, area()); });
}

// A pressure q in cell c pushes with area q side(c). Its own velocity loses the part of that across the normal over its
// own mass, both gain the same over their common mass, and cell d sees area side(d) times what its velocity loses.
SlipNodes::Terms SlipNodes::terms(const SlipNode& n, Real area) {
  using grid::Octet;
  Octet side[3], solid;  // per cell
  for (std::size_t d = 0; d < 8; ++d) {
    const Vec3 s = side_of(d);
    for (int a = 0; a < 3; ++a) side[a][d] = s[a];
    solid[d] = in_solid(n, d) ? Real(1) : Real(0);
  }
  const Octet normal = n.normal[0] * side[0] + n.normal[1] * side[1] + n.normal[2] * side[2];
  const Real square = area * area, common = square / (n.solid_mass + n.fluid_mass);
  const Real solid_share = square / n.solid_mass, fluid_share = square / n.fluid_mass;
  Terms out;
  for (std::size_t c = 0; c < 8; ++c) {
    const Octet across = side[0][c] * side[0] + side[1][c] * side[1] + side[2][c] * side[2] - normal[c] * normal;
    const Octet own = in_solid(n, c) ? solid_share * solid : fluid_share * (Real(1) - solid);
    grid::store_octet(out[c].data(), across * (own - common));
  }
  return out;
}

void SlipNodes::hold(const Parallel& parallel, const std::vector<Real>& specific_volume) {
  parallel.for_each(static_cast<std::int64_t>(nodes_.size()), [&](std::int64_t i) {
    const auto t = static_cast<std::size_t>(i);
    if (specific_volume[nodes_[t].node] > 0) return;
    nodes_[t].solid_mass = kNoEndOfMass;
    terms_[t] = terms(nodes_[t], area());
  });
}

void SlipNodes::swap(const Parallel& parallel, grid::VectorField& velocity) {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Vec3 v = velocity.at(n.node);
    velocity.set(n.node, solid_velocity_[t]);
    solid_velocity_[t] = v;
  });
}

void SlipNodes::share_normal(const Parallel& parallel, grid::VectorField& velocity) {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Vec3 fluid = velocity.at(n.node);
    const Vec3 jump = n.normal.dot(fluid - solid_velocity_[t]) * n.normal / (n.solid_mass + n.fluid_mass);
    solid_velocity_[t] += n.fluid_mass * jump;
    velocity.set(n.node, fluid - n.solid_mass * jump);
  });
}

void SlipNodes::follow_solid(const Parallel& parallel, grid::VectorField& velocity) const {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Vec3 fluid = velocity.at(n.node);
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
    (in_solid(nodes_[t], corner) ? g.solid : g.fluid) += q[cell_[t] - back_[corner]] * side_of(corner);
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

void SlipNodes::subtract_gradient(const Parallel& parallel, const std::vector<Real>& q, grid::VectorField& velocity) {
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Pair g = impulses(t, q), both = slip(n, g);
    solid_velocity_[t] -= (g.solid + g.fluid) / (n.solid_mass + n.fluid_mass) + both.solid;
    velocity.set(n.node, velocity.at(n.node) - both.fluid);
  });
}

std::vector<Vec3> SlipNodes::sliding_impulse(const Parallel& parallel, const std::vector<Real>& q) const {
  std::vector<Vec3> out(nodes_.size());
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) { out[t] = across(n.normal, impulses(t, q).fluid); });
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
  return nodes_.size() * (sizeof(SlipNode) + sizeof(Terms)) + plane_begin_.size() * sizeof(std::size_t) +
         solid_velocity_.size() * sizeof(Vec3);
}

}  // namespace efsi::system
