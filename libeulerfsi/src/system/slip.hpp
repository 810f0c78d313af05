// Purpose: nodes at the surface of a solid that hold two velocities, the solid's and that of the fluid beside it.
//
// A cell sees the velocity of what owns it: the solid's in cells that carry stiffness, the fluid's in all others. Along
// the normal n both velocities are one, across it each has its own mass m_s, m_f, so that an inviscid fluid slips:
//   v_s -= n n.g / (m_s + m_f) + (I - n n^T) g_s / m_s,   g_s, g_f: J^T q of the solid's and of the fluid's cells,
//   v_f -= n n.g / (m_s + m_f) + (I - n n^T) g_f / m_f,   g = g_s + g_f
// n is the normal of the cells' stairs, parallel to the g_s of a constant pressure: no pressure as such pushes along
// the surface, and what the pressure does in the solid does not act on the fluid's own velocity at all.
#pragma once

#include <array>
#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"

namespace efsi::system {

struct SlipNode {
  std::size_t node;  // of the grid
  int i, j, k;       // on no face of the box
  std::size_t solid;
  std::uint8_t solid_cells;     // bit a: the cell that has this node as corner a (grid::kCorner) belongs to the solid
  Vec3 normal;                  // out of the solid
  Real solid_mass, fluid_mass;  // [kg]
};

// +-1 per component: on which side of a cell's center its corner lies.
inline Vec3 side_of(std::size_t corner) {
  const auto& c = grid::kCorner[corner];
  return Vec3(c[0] ? Real(1) : Real(-1), c[1] ? Real(1) : Real(-1), c[2] ? Real(1) : Real(-1));
}
// The normal at a node, out of its solid cells (bits as in SlipNode); zero where they lie on opposite sides.
Vec3 stair_normal(std::uint8_t solid_cells);

class SlipNodes {
 public:
  SlipNodes() = default;
  // nodes: in ascending order of their planes k.
  SlipNodes(const Parallel& parallel, const grid::Grid& g, std::vector<SlipNode> nodes);
  // The solid's velocity is given at nodes where this is 0: it has no end of mass there.
  void hold(const Parallel& parallel, const std::vector<Real>& specific_volume);
  bool empty() const { return nodes_.empty(); }
  const std::vector<SlipNode>& nodes() const { return nodes_; }
  // v_s; the fields below hold v_f at these nodes.
  std::vector<Vec3>& solid_velocity() { return solid_velocity_; }
  // Exchanges v_s and v_f.
  void swap(const Parallel& parallel, grid::VectorField& velocity);
  // Gives v_s and v_f the same component along n and keeps their momentum.
  void share_normal(const Parallel& parallel, grid::VectorField& velocity);
  // Gives v_f the component of v_s along n.
  void follow_solid(const Parallel& parallel, grid::VectorField& velocity) const;
  // Flux out of padded cells by v_f [m^3/s] -> by the velocity that each cell sees.
  void correct_flux(const Parallel& parallel, const grid::VectorField& velocity, std::vector<Real>& flux) const;

  // A = J W J^T with two velocities here is A_1, with one velocity of mass m_s + m_f, and more: the terms of (A - A_1)
  // x that each node gives its 8 cells, corner by corner.
  void excess(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& out) const;
  // Calls body(padded cell, term) for these terms, which add up.
  template <class Body>
  void for_terms(const Parallel& parallel, const std::vector<Real>& excess, const Body& body) const {
    for_cells(parallel,
              [&](std::size_t t, std::size_t corner, std::size_t cell) { body(cell, excess[8 * t + corner]); });
  }
  // Calls body(padded cell, value) for the terms that, added to the diagonal of A_1, make a D with D^-1 A <= 8/3, as it
  // is elsewhere. With the diagonal of A itself a node with two velocities reaches 4 (two solid cells that share an
  // edge), so that its share is taken one and a half times.
  template <class Body>
  void for_smoother_terms(const Parallel& parallel, const Body& body) const {
    for_cells(parallel, [&](std::size_t t, std::size_t corner, std::size_t cell) {
      const SlipNode& n = nodes_[t];
      const Real one = 1 / (n.solid_mass + n.fluid_mass), own = 1 / (in_solid(n, corner) ? n.solid_mass : n.fluid_mass);
      const Real excess = (own - one) * across(n.normal, side_of(corner)).squaredNorm();
      body(cell, area() * area() * (Real(1.5) * excess + Real(0.5) * 3 * one));
    });
  }
  // After v_f -= g / (m_s + m_f): what is left to do for both velocities.
  void subtract_gradient(const Parallel& parallel, const std::vector<Real>& q, grid::VectorField& velocity);
  // (I - n n^T) g_f per node: the part of J^T q that the fluid's own velocity takes [kg m/s].
  std::vector<Vec3> sliding_impulse(const Parallel& parallel, const std::vector<Real>& q) const;
  // sum of m_s (v_s - v_f) [kg m/s]
  Vec3d relative_momentum(const grid::VectorField& velocity) const;
  std::size_t bytes() const;

 private:
  static bool in_solid(const SlipNode& n, std::size_t corner) { return n.solid_cells >> corner & 1u; }
  static Vec3 across(const Vec3& normal, const Vec3& v) { return v - normal.dot(v) * normal; }
  Real area() const { return static_cast<Real>(grid_.h * grid_.h / 4.0); }
  // Calls body(index, corner, padded cell) for the cells around the nodes; layers of cells in parallel.
  template <class Body>
  void for_cells(const Parallel& parallel, const Body& body) const {
    if (nodes_.empty()) return;
    parallel.for_each(grid_.cells[2], [&](std::int64_t layer) {
      const auto k = static_cast<std::size_t>(layer);
      for (const std::size_t upper : {0u, 1u})  // the nodes below the layer and above it
        for (std::size_t t = plane_begin_[k + upper]; t < plane_begin_[k + upper + 1]; ++t)
          for (std::size_t corner = 4 * upper; corner < 4 * upper + 4; ++corner)
            body(t, corner, cell_[t] - back_[corner]);
    });
  }
  template <class Body>
  void for_nodes(const Parallel& parallel, const Body& body) const {
    parallel.for_each(static_cast<std::int64_t>(nodes_.size()),
                      [&](std::int64_t t) { body(nodes_[static_cast<std::size_t>(t)], static_cast<std::size_t>(t)); });
  }
  // (A - A_1) between the 8 cells of a node: what a value in each of them gives all of them.
  using Terms = std::array<std::array<Real, 8>, 8>;
  static Terms terms(const SlipNode& n, Real area);
  struct Pair {
    Vec3 solid, fluid;
  };
  Pair impulses(std::size_t t, const std::vector<Real>& q) const;
  static Pair slip(const SlipNode& node, const Pair& g);

  grid::Grid grid_;
  std::vector<SlipNode> nodes_;
  std::vector<std::size_t> plane_begin_;  // first node of each plane of nodes, and the end
  std::vector<Vec3> solid_velocity_;
  std::vector<Terms> terms_;
  std::vector<std::size_t> cell_;      // padded cell of which the node is corner 0
  std::array<std::size_t, 8> back_{};  // from there to the cell of which it is another corner
};

// While it lives the field holds what the solids see.
class SolidView {
 public:
  SolidView(const Parallel& parallel, SlipNodes& slip, grid::VectorField& velocity)
      : parallel_(parallel), slip_(slip), velocity_(velocity) {
    slip_.swap(parallel_, velocity_);
  }
  SolidView(const SolidView&) = delete;
  SolidView& operator=(const SolidView&) = delete;
  ~SolidView() { slip_.swap(parallel_, velocity_); }

 private:
  const Parallel& parallel_;
  SlipNodes& slip_;
  grid::VectorField& velocity_;
};

}  // namespace efsi::system
