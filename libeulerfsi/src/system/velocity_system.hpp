// Purpose: the semi-implicit system G of Eq. 8 on the nodes that carry solids, matrix-free.
// Paper: Alg. 1 lines 8, 9; Sec. 4.4, Eq. 8:  (M + dt C + dt^2 K) v* = M v^n + dt (f_ext - f_int),  C = alpha M + beta
// K. For nodes that carry no solid G is the diagonal mass matrix and v* is known at once.
#pragma once

#include <memory>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"
#include "linalg/pcg.hpp"
#include "linalg/pcr.hpp"
#include "solid/momentum.hpp"
#include "solid/solid.hpp"
#include "system/slip.hpp"
#include "system/stiffness_shares.hpp"

namespace efsi::system {

using grid::Grid;
using grid::VectorField;

constexpr std::uint8_t kAllAxes = 7;           // bits of the axes along which something holds a solid
constexpr std::size_t kBehind = 1;             // values behind the last vector of three, which is loaded as four
constexpr std::size_t kUnknownsPerSum = 1024;  // sums have parts of so many, whatever the number of threads

// One solid as the system sees it.
struct SolidRef {
  const solid::SolidRest* rest;
  solid::SolidState* state;
  solid::SolidWork* work;
  StiffnessShares loose, walled, held;  // while nothing touches it, while walls do, and while a solid does
  bool keeps_volume = false;            // whether elements that are off it are viscous (crushed_viscosity)
};

class MultilevelScaling;
class RigidModes;
class RowInverse;

// What one unknown has in a row of B.
struct RowPart {
  std::size_t unknown;
  Real weight;
};
// A row's part of G: B^T S B, S symmetric and positive semi-definite [kg].
struct Penalty {
  std::vector<RowPart> parts;
  Mat3 stiffness;
};

enum class VelocitySolver : std::int32_t { kPcg = 0, kPcr = 1 };

class VelocitySystem {
 public:
  // Numbers the unknown nodes, sets G for this dt. mass: all matter per global node [kg].
  // fixed: per global node, components that walls fix. slip: of their mass only the normal part moves with a solid;
  // those that solids share have an unknown for each of them. slab: axis of a slab, whose faces hold nothing back that
  // could move; -1: none.
  void assemble(const Parallel& parallel, const Grid& global, const std::vector<std::uint8_t>& fixed,
                std::span<const SolidRef> solids, const std::vector<Real>& mass, const SlipNodes& slip, double dt,
                int slab = -1);
  std::int64_t unknowns() const { return static_cast<std::int64_t>(node_.size()); }
  const std::vector<std::size_t>& nodes() const { return node_; }
  // Of a solid at a node that it carries.
  std::size_t unknown_of(std::size_t solid, std::size_t node) const;

  std::size_t solids() const { return solids_.size(); }
  const SolidRef& solid(std::size_t l) const { return solids_[l]; }
  const Grid& grid() const { return global_; }
  // The unknowns of solid l are those from begin_of(l) to begin_of(l + 1); one that solids share is the first one's.
  std::size_t begin_of(std::size_t solid) const { return unknown_begin_[solid]; }
  std::size_t solid_of(std::size_t unknown) const;
  // Whether solids share its node, so that it is none of the field's velocities.
  bool is_shared(std::size_t unknown) const { return entry_[unknown] >= 0; }
  Vec3d place(std::size_t unknown) const;  // of its node [m]
  double cell() const { return h_; }       // [m]
  // Mass of an unknown, with damping by it [kg]; of what slips the mean of all directions.
  double inertia(std::size_t unknown) const {
    return static_cast<double>(inertia_[unknown]) - 2.0 / 3.0 * static_cast<double>(sliding_[unknown]);
  }

  // After assemble(): from now on a component of an unknown is that of another one, until a wall fixes it.
  void tie(std::size_t unknown, std::size_t to, int axis);
  // Prescribes a component of an unknown from now on: a wall does.
  void fix(std::size_t unknown, int axis);
  // From now on apply(), solve() and precondition() have these in G; the last ones go. After assemble() there are none.
  void set_penalties(const Parallel& parallel, std::vector<Penalty> penalties);
  const std::vector<Penalty>& penalties() const { return penalties_; }
  // S B x of each.
  std::vector<Vec3> penalty_impulses(const std::vector<Real>& x) const;
  // y += s B^T of these, where something moves or everywhere.
  void add_penalty_impulses(Real s, const std::vector<Vec3>& impulses, std::vector<Real>& y,
                            bool everywhere = false) const;
  // Below this the residual of x is noise.
  double rounding(const Parallel& parallel, const std::vector<Real>& x) const;
  // Inverse of the diagonal of G, the mean of the components that move [1/kg].
  double mobility(std::size_t unknown) const;
  // y = G x without penalties and without the constraints of walls.
  void multiply(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y);
  // y = G x; 3 values per unknown node, components that walls fix are identity rows.
  void apply(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y);
  // The same without penalties.
  void apply_bare(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y);
  // y = what G has of the stiffness times x, between the components that are free.
  void apply_stiffness(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y);
  // z = about G^-1 r, as it was at the last solve() or set_penalties(): the diagonal with the penalties, coarser
  // levels of the solids in which stiffness outweighs inertia and, with penalties, the solids as a whole. r is 0 where
  // nothing is free.
  void precondition(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z);
  // z += what precondition() has of coarser levels.
  void add_coarse_levels(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z);
  // f += what the shares behind add to the right-hand side: behind dt^2 K v.
  void add_past_stiffness(const Parallel& parallel, const std::vector<Real>& v, std::vector<Real>& f);
  // sum of the elements' forces on each unknown [N].
  void internal_force(const Parallel& parallel, std::vector<Real>& force);
  // Solves G x = b for the components that walls leave free; the others of x are given, those of b do not count.
  // tolerance: of the first residual with conjugate gradients, which end at a residual of `least` in any case
  // [kg m/s]; of b with conjugate residuals.
  linalg::SolveStats solve(const Parallel& parallel, VelocitySolver solver, const std::vector<Real>& b,
                           std::vector<Real>& x, double tolerance, double least = 0.0);
  // Internal forces sum to nothing and turn nothing: gives each solid the linear and angular momentum of b, as far as
  // walls leave it free; solids that touch each other are left alone. The solve does that up to its tolerance and to
  // the turning of the stress during the step.
  void conserve_momentum(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x) const;

  // Sums of the entries of each solid's unknowns.
  std::vector<Vec3d> sum_by_solid(const Parallel& parallel, const std::vector<Real>& x) const;

  // |f - G x| of what moves.
  double residual(const Parallel& parallel, const std::vector<Real>& f, const std::vector<Real>& x);

  // Copies between the velocities of solids at nodes, field and slip as in assemble(), and vectors of unknowns.
  void gather(const Parallel& parallel, const VectorField& field, SlipNodes& slip, std::vector<Real>& x) const;
  void scatter(const Parallel& parallel, const std::vector<Real>& x, VectorField& field, SlipNodes& slip) const;
  // Zero where a wall fixes a component and where it is tied to another, one elsewhere.
  const std::vector<Real>& free() const { return free_; }
  // The same, but one where it is tied: what acts on it moves the other.
  const std::vector<Real>& moves() const { return moves_; }
  // x becomes that of the component which it is tied to.
  void follow_ties(std::vector<Real>& x) const;
  // x becomes 0 where it is tied.
  void leave_ties(std::vector<Real>& x) const;
  // y of what does not move becomes 0, that of what is tied goes to the other.
  void fold(const Parallel& parallel, std::vector<Real>& y) const;
  // The same where y is 0 but for these entries, and those that followed() names.
  void fold(const std::vector<std::size_t>& entries, std::vector<Real>& y) const;
  // The entries that those with y other than 0 are tied to.
  std::vector<std::size_t> followed(const std::vector<Real>& y) const;
  // y = M x
  void multiply_mass(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y) const;
  // x = M^-1 b
  void divide_by_mass(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x) const;
  // G = M + dt C_M + this times K [s^2].
  Real stiffness_factor(std::size_t solid, std::size_t element) const {
    return stiffness_factor_[block_begin_[solid] * solid::kBlock + element];
  }
  // Axes along which walls constrain a node of a solid: bit a: axis a; 7 where another solid does.
  unsigned fixed_axes(std::size_t solid) const { return held_[solid] == 7u ? 7u : held_[solid] & ~across_slab_; }
  bool touches(std::size_t solid) const { return fixed_axes(solid) != 0; }
  const StiffnessShares& shares(std::size_t solid) const {
    const SolidRef& ref = solids_[solid];
    return held_[solid] == 0 ? ref.loose : held_[solid] == 7 ? ref.held : ref.walled;
  }
  // Pairs of solids that share an unknown; of three or more at a node all with the first.
  const std::set<std::pair<std::size_t, std::size_t>>& touching() const { return touching_; }
  std::size_t bytes() const;

 private:
  // The parts of assemble(), in their order.
  void start(const Grid& global, std::span<const SolidRef> solids, const SlipNodes& slip);
  // Returns dt alpha M_s per unknown [kg].
  std::vector<double> number_unknowns(const std::vector<std::uint8_t>& fixed, const SlipNodes& slip, double dt);
  void weigh_unknowns(const std::vector<Real>& mass, const SlipNodes& slip, const std::vector<double>& damping);
  void list_elements(const Parallel& parallel);
  void weigh_elements(const Parallel& parallel, double dt);
  void list_gathers();
  void invert_diagonal(const Parallel& parallel);
  std::size_t entry_of(std::size_t solid, std::size_t node) const;  // of a shared node, in slip
  void find_stiff(const Parallel& parallel);
  void build_multilevel(const Parallel& parallel);
  void apply(const Parallel& parallel, const std::vector<Real>& x, bool with_penalties, std::vector<Real>& y);
  // What the mass of the fluid that slips along unknown u would add to the momentum.
  Vec3 sliding_momentum(std::size_t u, const std::vector<Real>& x) const;
  solid::RigidMotion missing_motion(const Parallel& parallel, std::size_t solid, const std::vector<Real>& b,
                                    const std::vector<Real>& x) const;
  // Each calls finish(unknown, sum over its elements) for the values of `out`.
  template <class Finish>
  void gather_elements(const Parallel& parallel, const Finish& finish, std::vector<Real>& out);
  template <class BlockBody, class Finish>
  void sum_blocks(const Parallel& parallel, const BlockBody& body, const Finish& finish, std::vector<Real>& out);
  // The sum is factor K x, one factor per solid; x has a value behind the last one.
  template <class Finish>
  void multiply_stiffness(const Parallel& parallel, const std::vector<Real>& factor, const std::vector<Real>& x,
                          const Finish& finish, std::vector<Real>& out);

  std::vector<SolidRef> solids_;
  std::vector<std::int32_t> unknown_of_node_;   // global node -> unknown, -1; -2 - first entry of a shared node in slip
  std::vector<std::int32_t> unknown_of_entry_;  // slip node -> unknown
  std::vector<std::size_t> solid_of_entry_;     // slip node -> solid
  std::vector<std::int32_t> entry_;             // unknown -> slip node, -1: none
  std::vector<std::size_t> unknown_begin_;      // first unknown of each solid, and the end
  std::set<std::pair<std::size_t, std::size_t>> touching_;
  unsigned across_slab_ = 0;                         // bit of the axis of a slab
  std::vector<std::uint8_t> held_;                   // per solid: bit a: a wall fixes axis a; 7: shares a node
  std::vector<std::size_t> node_;                    // unknown -> global node
  std::vector<std::size_t> block_begin_;             // first block of each solid, and the end
  std::vector<std::int32_t> corner_;                 // unknowns: block, corner, lane
  std::vector<std::int32_t> gather_begin_, gather_;  // unknown -> where its entries of element_out_ are
  std::vector<Real> inertia_;                        // M + dt alpha M_s per unknown [kg]
  std::vector<Real> node_mass_;                      // M per unknown [kg]
  std::vector<Real> free_, moves_;
  struct Tie {
    std::size_t from, to;  // entries of the unknowns
  };
  std::vector<Tie> ties_;
  std::vector<Real> sliding_;  // mass per unknown that moves along the normal only: fluid beside the solid [kg]
  std::vector<Vec3> normal_;   // empty without such nodes
  std::vector<Real> stiffness_factor_;  // ahead dt^2 + dt beta per block and lane
  std::vector<Real> past_factor_;       // behind dt^2, the same
  std::vector<Real> inverse_diagonal_;
  std::vector<std::uint8_t> stiff_;                // per solid: diagonal scaling alone takes too many iterations
  std::shared_ptr<MultilevelScaling> multilevel_;  // of those solids; none: there are none, or it is not built yet
  std::vector<Penalty> penalties_;
  std::shared_ptr<const RowInverse> row_inverse_;  // none without penalties
  std::shared_ptr<const RigidModes> rigid_;        // the same
  std::vector<Real> element_out_;                  // block, corner, lane, component; and a value behind
  std::vector<Real> masked_, load_;                // of masked_ there is a value behind
  Grid global_;
  double h_ = 1.0;
  linalg::PcgWorkspace pcg_;
  linalg::PcrWorkspace pcr_;
};

}  // namespace efsi::system
