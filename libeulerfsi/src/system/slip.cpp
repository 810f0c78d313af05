#include "system/slip.hpp"

namespace efsi::system {

Vec3 stair_normal(std::uint8_t solid_cells) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t corner = 0; corner < 8; ++corner)
    if (solid_cells >> corner & 1u) sum += side_of(corner);
  return sum.isZero() ? sum : sum.normalized();
}

SlipNodes::SlipNodes(const grid::Grid& g, std::vector<SlipNode> nodes) : grid_(g), nodes_(std::move(nodes)) {
  solid_velocity_.assign(nodes_.size(), Vec3::Zero());
  plane_begin_.assign(static_cast<std::size_t>(g.cells[2]) + 2, 0);
  for (const SlipNode& n : nodes_) ++plane_begin_[static_cast<std::size_t>(n.k) + 1];
  for (std::size_t k = 1; k < plane_begin_.size(); ++k) plane_begin_[k] += plane_begin_[k - 1];
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const auto& c = grid::kCorner[corner];
    back_[corner] = g.padded(c[0], c[1], c[2]) - g.padded(0, 0, 0);
  }
  for (const SlipNode& n : nodes_) cell_.push_back(g.padded(n.i, n.j, n.k));
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

void SlipNodes::correct_divergence(const Parallel& parallel, const grid::VectorField& velocity,
                                   std::vector<Real>& divergence) const {
  const Real scale = static_cast<Real>(0.25 / grid_.h);
  for_cells(parallel, [&](std::size_t t, std::size_t corner, std::size_t cell) {
    if (!in_solid(nodes_[t], corner)) return;
    divergence[cell] += scale * side_of(corner).dot(solid_velocity_[t] - velocity.at(nodes_[t].node));
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

std::vector<Real> SlipNodes::excess(const Parallel& parallel, const std::vector<Real>& x) const {
  std::vector<Real> out(8 * nodes_.size());
  for_nodes(parallel, [&](const SlipNode& n, std::size_t t) {
    const Pair both = slip(n, impulses(t, x));
    for (std::size_t corner = 0; corner < 8; ++corner)
      out[8 * t + corner] = area() * side_of(corner).dot(in_solid(n, corner) ? both.solid : both.fluid);
  });
  return out;
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
  return nodes_.size() * sizeof(SlipNode) + plane_begin_.size() * sizeof(std::size_t) +
         solid_velocity_.size() * sizeof(Vec3);
}

}  // namespace efsi::system
