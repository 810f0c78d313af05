// Purpose: nodes at the surface of a solid that hold two velocities, the solid's and that of the fluid beside it, and
// nodes that several solids carry, which hold one of each and the fluid's.
//
// A cell sees the velocity of what owns it: the solid's in cells that carry stiffness, the fluid's in all others. Along
// the normal n both velocities are one, across it each has its own mass m_s, m_f, so that an inviscid fluid slips:
//   v_s -= n n.g / (m_s + m_f) + (I - n n^T) g_s / m_s,   g_s, g_f: J^T q of the solid's and of the fluid's cells,
//   v_f -= n n.g / (m_s + m_f) + (I - n n^T) g_f / m_f,   g = g_s + g_f
// n is the normal of the voxelised boundary, parallel to the g_s of a constant pressure: a constant pressure has no
// effect along the surface, and what the pressure does in the solid does not act on the fluid's own velocity at all.
// Where none of the cells is the solid's, at corners of slivers alone (solid/element/mass.hpp), n = 0 and g_s = 0: the
// pressure moves the fluid there, and elasticity the solid.
//
// Where several solids meet (l = a, b, ..., and f) each has its own mass, and in the pressure the node as a whole makes
// no volume: with S_l the sum of the sides of l's cells, so that sum_l S_l = 0,
//   v_l -= (g_l - S_l q) / m_l,   q = (sum_l S_l.g_l / m_l) / (sum_l |S_l|^2 / m_l)
// which for one solid is the above. The film between solids has the pressure of the fluid around it: it neither
// attracts nor separates them. Without fluid there is no film, and q = 0.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"

namespace efsi::system {

// A solid's own velocity at a node.
struct SlipNode {
  std::size_t node;  // of the grid
  int i, j, k;       // on no face of the box but those of a slab, unless several solids carry the node
  std::size_t solid;
  std::uint8_t solid_cells;     // bit a: the cell that has this node as corner a (grid::kCorner) belongs to the solid
  Vec3 normal = Vec3::Zero();   // out of the solid; 0: none of the cells is the solid's
  Real solid_mass, fluid_mass;  // [kg]
  // Of nodes that several solids carry:
  std::uint8_t solids = 1;       // that carry the node
  std::uint8_t fluid_cells = 0;  // bits: cells of the box that no solid owns, where there is fluid
  std::uint8_t fixed = 0;  // bit a: a wall prescribes component a of the solid's velocity, as the pressure sees it
  std::uint8_t held = 0;   // the same in Eq. 8
  std::uint8_t fluid_fixed = 0;  // the same of the fluid
  std::uint8_t base_fixed = 0;   // the same of a node with one velocity
  bool in_fluid = false;         // there is fluid in the scene
  Real mass = 0;                 // of all matter [kg]

  bool shared() const { return solids > 1; }
  // The fluid passes as if no solid were there: no cell at the node is the solid's.
  bool is_free() const { return !shared() && solid_cells == 0; }
};

// +-1 per component: on which side of a cell's center its corner lies.
inline Vec3 side_of(std::size_t corner) {
  const auto& c = grid::kCorner[corner];
  return Vec3(c[0] ? Real(1) : Real(-1), c[1] ? Real(1) : Real(-1), c[2] ? Real(1) : Real(-1));
}
// The normal at a node, out of its solid cells (bits as in SlipNode); zero where they lie on opposite sides. slab: axis
// of a slab, along which nothing changes; -1: none.
Vec3 stair_normal(std::uint8_t solid_cells, int slab = -1);

class SlipNodes {
 public:
  SlipNodes() = default;
  // nodes: in ascending order, of one node in that of the solids. slab: its axis, along which nothing moves; -1: none.
  SlipNodes(const Parallel& parallel, const grid::Grid& g, std::vector<SlipNode> nodes, int slab = -1);
  // The solid's velocity is given at nodes where this is 0: it has no end of mass there. Of shared nodes prescribe()
  // tells whose.
  void hold(const Parallel& parallel, const std::vector<Real>& specific_volume);
  bool empty() const { return nodes_.empty(); }
  const std::vector<SlipNode>& nodes() const { return nodes_; }
  // v_s; the fields below hold v_f at these nodes.
  std::vector<Vec3>& solid_velocity() { return solid_velocity_; }
  // Where a solid's own velocity at a node is among them; none: kNone, it is the field's.
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::size_t find(std::size_t solid, std::size_t node) const;
  // The same of shared nodes alone.
  std::size_t find_shared(std::size_t solid, std::size_t node) const;
  Vec3 velocity_of(std::size_t solid, std::size_t node, const grid::VectorField& velocity) const;
  void set_velocity_of(std::size_t solid, std::size_t node, const Vec3& value, grid::VectorField& velocity);
  // At a shared node: what walls prescribe of the solid's velocity, bits of axes.
  void prescribe(std::size_t t, std::uint8_t fixed, std::uint8_t held);
  // Exchanges v_s of a solid and v_f.
  void swap(const Parallel& parallel, std::size_t solid, grid::VectorField& velocity);
  // Gives v_s and v_f the same component along n, and shared nodes with fluid velocities that make no volume; keeps
  // their momentum.
  void share_normal(const Parallel& parallel, grid::VectorField& velocity);
  // Gives v_f the component of v_s along n; at shared nodes it fills what the solids leave.
  void follow_solid(const Parallel& parallel, grid::VectorField& velocity) const;
  // Volume that shared nodes make [m^3/s]: solids that part with no fluid between them leave a gap.
  double opening(const grid::VectorField& velocity) const;
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
      if (n.shared()) {
        if (leads(t)) body(cell, smoother_share(t, corner));
        return;
      }
      const Real one = 1 / (n.solid_mass + n.fluid_mass), own = 1 / (in_solid(n, corner) ? n.solid_mass : n.fluid_mass);
      const Real excess = (own - one) * across(n.normal, side(corner)).squaredNorm();
      body(cell, area() * area() * (Real(1.5) * excess + Real(0.5) * moving_.sum() * one));
    });
  }
  // After v_f -= g / (m_s + m_f): what is left to do for both velocities.
  void subtract_gradient(const Parallel& parallel, const std::vector<Real>& q, grid::VectorField& velocity);
  // The part of J^T q [kg m/s] that does not act on the solid: (I - n n^T) g_f per node with one solid.
  std::vector<Vec3> sliding_impulse(const Parallel& parallel, const std::vector<Real>& q) const;
  // The rest of it, which does: what the pressure gives the solid at a node [kg m/s].
  Vec3 solid_impulse(std::size_t t, const std::vector<Real>& q) const;
  // What its velocities add to the 1/density of node t, the first entry of it: the mean over the cells around it and
  // the axes [m^3/kg].
  Real slipping_volume(std::size_t t) const;
  // Whether any node is free.
  bool any_free() const {
    return std::any_of(nodes_.begin(), nodes_.end(), [](const SlipNode& n) { return n.is_free(); });
  }
  // Whether entry t is the first one of its node.
  bool leads(std::size_t t) const { return t == 0 || nodes_[t - 1].node != nodes_[t].node; }
  // Whether these are nodes of more than one solid.
  bool between_solids() const {
    return std::any_of(nodes_.begin(), nodes_.end(), [&](const SlipNode& n) { return n.solid != nodes_[0].solid; });
  }
  // sum of m_s (v_s - v_f) [kg m/s]
  Vec3d relative_momentum(const grid::VectorField& velocity) const;
  std::size_t bytes() const;

 private:
  static bool in_solid(const SlipNode& n, std::size_t corner) { return n.solid_cells >> corner & 1u; }
  static Vec3 across(const Vec3& normal, const Vec3& v) { return v - normal.dot(v) * normal; }
  // side_of(corner) along the axes along which something moves.
  Vec3 side(std::size_t corner) const { return side_of(corner).cwiseProduct(moving_); }
  Real area() const { return static_cast<Real>(grid_.h * grid_.h / 4.0); }
  // Calls body(index, corner, padded cell) for the cells of the grid around the nodes; layers of cells in parallel.
  template <class Body>
  void for_cells(const Parallel& parallel, const Body& body) const {
    if (nodes_.empty()) return;
    parallel.for_each(grid_.cells[2], [&](std::int64_t layer) {
      const auto k = static_cast<std::size_t>(layer);
      for (const std::size_t upper : {0u, 1u})  // the nodes below the layer and above it
        for (std::size_t t = plane_begin_[k + upper]; t < plane_begin_[k + upper + 1]; ++t)
          for (std::size_t corner = 4 * upper; corner < 4 * upper + 4; ++corner)
            if (inside_[t] >> corner & 1u) body(t, corner, cell_[t] - back_[corner]);
    });
  }
  template <class Body>
  void for_nodes(const Parallel& parallel, const Body& body) const {
    parallel.for_each(static_cast<std::int64_t>(nodes_.size()),
                      [&](std::int64_t t) { body(nodes_[static_cast<std::size_t>(t)], static_cast<std::size_t>(t)); });
  }
  // (A - A_1) between the 8 cells of a node: what a value in each of them gives all of them.
  using Terms = std::array<std::array<Real, 8>, 8>;
  Terms terms(const SlipNode& n) const;
  struct Pair {
    Vec3 solid, fluid;
  };
  Pair impulses(std::size_t t, const std::vector<Real>& q) const;
  static Pair slip(const SlipNode& node, const Pair& g);
  // A shared node: its solids, and the fluid as the last one where there is some, as equals.
  struct Member {
    std::uint8_t cells = 0;            // bits
    Vec3 side = Vec3::Zero();          // S, 0 along what is fixed
    Vec3 inverse_mass = Vec3::Zero();  // [1/kg], 0 along what is fixed
    Vec3 impulse = Vec3::Zero();       // g [kg m/s]
    Vec3 loss = Vec3::Zero();          // of the velocity by that [m/s]
  };
  struct Share {
    std::vector<Member> members;
    bool fluid = false;  // the last one
    Real reaction = 0;   // 1 / sum S.S / m; 0: nothing ties them
  };
  Share share_of(std::size_t t) const;  // t: the first of the node
  static void respond(Share& share);
  void add_pressure_impulse(std::size_t t, const std::vector<Real>& q, Share& share) const;
  void subtract_share(std::size_t t, const std::vector<Real>& q, grid::VectorField& velocity);
  Vec3 share_impulse(std::size_t t, const std::vector<Real>& q) const;
  Vec3 filling(std::size_t t, const Vec3& fluid) const;
  Real making(std::size_t t, const Share& share, const Vec3& fluid) const;
  Terms share_terms(std::size_t t) const;
  Real smoother_share(std::size_t t, std::size_t corner) const;
  Vec3 base_inverse_mass(const SlipNode& n) const;

  grid::Grid grid_;
  Vec3 moving_ = Vec3::Ones();  // 0 along the axis of a slab
  std::vector<SlipNode> nodes_;
  std::vector<std::size_t> plane_begin_;  // first node of each plane of nodes, and the end
  std::vector<Vec3> solid_velocity_;
  std::vector<Terms> terms_;
  std::vector<std::size_t> cell_;      // padded cell of which the node is corner 0
  std::vector<std::uint8_t> inside_;   // bits: the cell of which the node is that corner is one of the grid
  std::array<std::size_t, 8> back_{};  // from there to the cell of which it is another corner
};

// While it lives the field holds what a solid sees.
class SolidView {
 public:
  SolidView(const Parallel& parallel, SlipNodes& slip, std::size_t solid, grid::VectorField& velocity)
      : parallel_(parallel), slip_(slip), solid_(solid), velocity_(velocity) {
    slip_.swap(parallel_, solid_, velocity_);
  }
  SolidView(const SolidView&) = delete;
  SolidView& operator=(const SolidView&) = delete;
  ~SolidView() { slip_.swap(parallel_, solid_, velocity_); }

 private:
  const Parallel& parallel_;
  SlipNodes& slip_;
  std::size_t solid_;
  grid::VectorField& velocity_;
};

}  // namespace efsi::system
