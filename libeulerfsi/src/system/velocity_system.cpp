#include "system/velocity_system.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/kernel.hpp"
#include "linalg/reduce.hpp"
#include "solid/element/stiffness_block.hpp"
#include "system/multilevel.hpp"
#include "system/rigid_modes.hpp"
#include "system/row_inverse.hpp"

namespace efsi::system {
namespace {

constexpr std::size_t kLanes = solid::kBlock;
constexpr double kRounding =
    8.0 * static_cast<double>(std::numeric_limits<Real>::epsilon());  // of what cancels in a residual

// A vector of three, and the value behind it.
typedef Real Quad __attribute__((vector_size(4 * sizeof(Real))));
EFSI_INLINE Quad load_quad(const Real* p) {
  Quad quad;
  std::memcpy(&quad, p, sizeof(quad));
  return quad;
}
EFSI_INLINE void store_quad(const Quad& quad, Real* p) { std::memcpy(p, &quad, sizeof(quad)); }

// rows: what x has at the corners of a block, as block_stiffness takes it. x has kBehind values more than it needs.
EFSI_KERNEL void load_corners(const Real* x, const std::int32_t* corners, Real (*rows)[kLanes]) {
  Real vectors[8 * kLanes * 3 + kBehind];
  for (std::size_t c = 0; c < 8 * kLanes; ++c)
    store_quad(load_quad(x + 3 * static_cast<std::size_t>(corners[c])), vectors + 3 * c);
  for (std::size_t a = 0; a < 8; ++a) {
    const Real* at = vectors + 3 * kLanes * a;
#pragma omp simd
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      rows[3 * a][lane] = at[3 * lane];
      rows[3 * a + 1][lane] = at[3 * lane + 1];
      rows[3 * a + 2][lane] = at[3 * lane + 2];
    }
  }
}

// The rows of a block as vectors: corner, lane, component.
EFSI_KERNEL void store_corners(const Real (*rows)[kLanes], Real* vectors) {
  for (std::size_t a = 0; a < 8; ++a) {
    Real* at = vectors + 3 * kLanes * a;
#pragma omp simd
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      at[3 * lane] = rows[3 * a][lane];
      at[3 * lane + 1] = rows[3 * a + 1][lane];
      at[3 * lane + 2] = rows[3 * a + 2][lane];
    }
  }
}

constexpr auto kAsItIs = [](std::size_t, const Vec3& sum) -> Vec3 { return sum; };

}  // namespace

// Jacobi preconditioner.
void VelocitySystem::invert_diagonal(const Parallel& parallel) {
  std::vector<Real> diagonal;
  sum_blocks(
      parallel,
      [&](std::size_t l, std::size_t block, Real* out) {
        solid::block_stiffness_diagonal(*solids_[l].work, block, h_,
                                        &stiffness_factor_[(block_begin_[l] + block) * kLanes], out);
      },
      kAsItIs, diagonal);
  inverse_diagonal_.resize(diagonal.size());
  for (std::size_t i = 0; i < diagonal.size(); ++i) {
    const Real along = sliding_[i / 3] > 0 ? normal_[i / 3][static_cast<Eigen::Index>(i % 3)] : Real(0);
    const Real d = free_[i] > 0 ? diagonal[i] + inertia_[i / 3] - sliding_[i / 3] * (1 - along * along) : Real(1);
    inverse_diagonal_[i] = d > 0 ? 1 / d : Real(1);
  }
}

void VelocitySystem::build_multilevel(const Parallel& parallel) {
  if (multilevel_ || std::find(stiff_.begin(), stiff_.end(), 1) == stiff_.end()) return;
  multilevel_ = std::make_shared<MultilevelScaling>(parallel, *this, stiff_);
  if (!penalties_.empty()) multilevel_->set_penalties(parallel, penalties_);
}

// element_out_ -> sums per unknown, in the order of the elements; out = finish(unknown, sum).
template <class Finish>
void VelocitySystem::gather_elements(const Parallel& parallel, const Finish& finish, std::vector<Real>& out) {
  out.resize(node_.size() * 3);
  parallel.for_each(unknowns(), [&](std::int64_t u) {
    const auto i = static_cast<std::size_t>(u);
    Quad sum = {};
    for (std::int32_t t = gather_begin_[i]; t < gather_begin_[i + 1]; ++t)
      sum += load_quad(element_out_.data() + gather_[static_cast<std::size_t>(t)]);
    const Vec3 value = finish(i, Vec3(sum[0], sum[1], sum[2]));
    for (std::size_t a = 0; a < 3; ++a) out[3 * i + a] = value[static_cast<Eigen::Index>(a)];
  });
}

// out = finish(unknown, sum over elements); body(solid, block of the solid, its rows).
template <class BlockBody, class Finish>
void VelocitySystem::sum_blocks(const Parallel& parallel, const BlockBody& body, const Finish& finish,
                                std::vector<Real>& out) {
  // One loop over all solids, of each of which a thread has its share: what is strained costs twice.
  const std::int64_t shares = parallel.threads();
  parallel.for_each(shares, [&](std::int64_t share) {
    Real rows[24][kLanes];
    for (std::size_t l = 0; l < solids_.size(); ++l) {
      const auto blocks = static_cast<std::int64_t>(solids_[l].work->blocks());
      for (std::int64_t n = blocks * share / shares; n < blocks * (share + 1) / shares; ++n) {
        const auto block = static_cast<std::size_t>(n);
        body(l, block, rows[0]);
        store_corners(rows, element_out_.data() + (block_begin_[l] + block) * 24 * kLanes);
      }
    }
  });
  gather_elements(parallel, finish, out);
}

// y = finish(unknown, factor K x)
template <class Finish>
void VelocitySystem::multiply_stiffness(const Parallel& parallel, const std::vector<Real>& factor,
                                        const std::vector<Real>& x, const Finish& finish, std::vector<Real>& y) {
  sum_blocks(
      parallel,
      [&](std::size_t l, std::size_t block, Real* out) {
        Real in[24][kLanes];
        load_corners(x.data(), &corner_[(block_begin_[l] + block) * 8 * kLanes], in);
        solid::block_stiffness(*solids_[l].work, block, h_, &factor[(block_begin_[l] + block) * kLanes], in, out);
      },
      finish, y);
}

void VelocitySystem::add_past_stiffness(const Parallel& parallel, const std::vector<Real>& v, std::vector<Real>& f) {
  if (std::all_of(past_factor_.begin(), past_factor_.end(), [](Real factor) { return factor == 0; })) return;
  linalg::copy(parallel, masked_, v);
  masked_.resize(v.size() + kBehind);
  multiply_stiffness(
      parallel, past_factor_, masked_,
      [&](std::size_t u, const Vec3& past) -> Vec3 { return Vec3(f[3 * u], f[3 * u + 1], f[3 * u + 2]) + past; }, f);
}

std::size_t VelocitySystem::entry_of(std::size_t solid, std::size_t node) const {
  auto entry = static_cast<std::size_t>(-2 - unknown_of_node_[node]);
  while (solid_of_entry_[entry] != solid) ++entry;
  return entry;
}

std::size_t VelocitySystem::unknown_of(std::size_t solid, std::size_t node) const {
  const std::int32_t unknown = unknown_of_node_[node];
  return static_cast<std::size_t>(unknown < -1 ? unknown_of_entry_[entry_of(solid, node)] : unknown);
}

std::size_t VelocitySystem::solid_of(std::size_t unknown) const {
  const auto next = std::upper_bound(unknown_begin_.begin(), unknown_begin_.end(), unknown);
  return static_cast<std::size_t>(next - unknown_begin_.begin()) - 1;
}

void VelocitySystem::tie(std::size_t unknown, std::size_t to, int axis) {
  multilevel_.reset();
  const std::size_t from = 3 * unknown + static_cast<std::size_t>(axis), i = 3 * to + static_cast<std::size_t>(axis);
  ties_.push_back({from, i});
  if (moves_[i] > 0)
    inverse_diagonal_[i] = 1 / (1 / inverse_diagonal_[i] + 1 / inverse_diagonal_[from]);
  else
    moves_[from] = 0;
  free_[from] = 0;
  inverse_diagonal_[from] = 1;
}

void VelocitySystem::fix(std::size_t unknown, int axis) {
  multilevel_.reset();
  const std::size_t entry = 3 * unknown + static_cast<std::size_t>(axis);
  std::erase_if(ties_, [&](const Tie& t) { return t.from == entry; });
  free_[entry] = moves_[entry] = 0;
  for (const Tie& t : ties_)
    if (t.to == entry) moves_[t.from] = 0;
  std::uint8_t& held = held_[solid_of(unknown)];
  held = static_cast<std::uint8_t>(held | (1u << axis));
}

void VelocitySystem::multiply(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y) {
  linalg::copy(parallel, masked_, x);
  masked_.resize(x.size() + kBehind);
  multiply_stiffness(
      parallel, stiffness_factor_, masked_,
      [&](std::size_t u, const Vec3& stiffness) -> Vec3 {
        return stiffness + inertia_[u] * Vec3(x[3 * u], x[3 * u + 1], x[3 * u + 2]) - sliding_momentum(u, x);
      },
      y);
}

void VelocitySystem::apply(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y) {
  apply(parallel, x, !penalties_.empty(), y);
}

void VelocitySystem::apply_bare(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y) {
  apply(parallel, x, false, y);
}

void VelocitySystem::apply(const Parallel& parallel, const std::vector<Real>& x, bool with_penalties,
                           std::vector<Real>& y) {
  masked_.resize(x.size() + kBehind);
  linalg::multiply(parallel, masked_, free_, x);
  for (const Tie& t : ties_) masked_[t.from] = x[t.to];
  multiply_stiffness(
      parallel, stiffness_factor_, masked_,
      [&](std::size_t u, const Vec3& stiffness) -> Vec3 {
        const Vec3 v(masked_[3 * u], masked_[3 * u + 1], masked_[3 * u + 2]);
        const Vec3 all = stiffness + inertia_[u] * v - sliding_momentum(u, x);
        Vec3 out;
        for (std::size_t a = 0; a < 3; ++a) {
          const auto e = static_cast<Eigen::Index>(a);
          out[e] = moves_[3 * u + a] > 0 ? all[e] : x[3 * u + a];
        }
        return out;
      },
      y);
  if (with_penalties) add_penalty_impulses(1, penalty_impulses(masked_), y);
  for (const Tie& t : ties_) {
    y[t.to] += y[t.from];
    y[t.from] = x[t.from];
  }
}

void VelocitySystem::apply_stiffness(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y) {
  masked_.resize(x.size() + kBehind);
  linalg::multiply(parallel, masked_, free_, x);
  multiply_stiffness(
      parallel, stiffness_factor_, masked_, [](std::size_t, const Vec3& stiffness) { return stiffness; }, y);
  linalg::multiply(parallel, y, free_, y);
}

void VelocitySystem::add_coarse_levels(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z) {
  build_multilevel(parallel);
  if (multilevel_) multilevel_->add(parallel, free_, r, z);
}

void VelocitySystem::precondition(const Parallel& parallel, const std::vector<Real>& r, std::vector<Real>& z) {
  z.resize(r.size());
  linalg::multiply(parallel, z, inverse_diagonal_, r);
  if (row_inverse_) row_inverse_->correct(parallel, z);
  if (multilevel_) multilevel_->add(parallel, free_, r, z);
  if (rigid_) rigid_->add(parallel, *this, r, z);
}

void VelocitySystem::set_penalties(const Parallel& parallel, std::vector<Penalty> penalties) {
  penalties_ = std::move(penalties);
  row_inverse_ =
      penalties_.empty() ? nullptr : std::make_shared<RowInverse>(parallel, penalties_, inverse_diagonal_, free_);
  if (multilevel_)
    multilevel_->set_penalties(parallel, penalties_);
  else
    build_multilevel(parallel);
  rigid_ = penalties_.empty() ? nullptr : std::make_shared<RigidModes>(parallel, *this, penalties_);
}

std::vector<Vec3> VelocitySystem::penalty_impulses(const std::vector<Real>& x) const {
  std::vector<Vec3> impulses;
  impulses.reserve(penalties_.size());
  for (const Penalty& p : penalties_) {
    Vec3 v = Vec3::Zero();
    for (const RowPart& part : p.parts)
      for (std::size_t a = 0; a < 3; ++a) v[static_cast<Eigen::Index>(a)] += part.weight * x[3 * part.unknown + a];
    impulses.push_back(p.stiffness * v);
  }
  return impulses;
}

void VelocitySystem::add_penalty_impulses(Real s, const std::vector<Vec3>& impulses, std::vector<Real>& y,
                                          bool everywhere) const {
  for (std::size_t p = 0; p < penalties_.size(); ++p) {
    const Vec3 impulse = s * impulses[p];
    for (const RowPart& part : penalties_[p].parts)
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t i = 3 * part.unknown + a;
        if (everywhere || moves_[i] > 0) y[i] += part.weight * impulse[static_cast<Eigen::Index>(a)];
      }
  }
}

double VelocitySystem::residual(const Parallel& parallel, const std::vector<Real>& f, const std::vector<Real>& x) {
  std::vector<Real> left = f, moved;
  multiply(parallel, x, moved);
  linalg::add_scaled(parallel, left, -1.0, moved);
  linalg::multiply(parallel, left, moves_, left);
  return linalg::norm(parallel, left);
}

double VelocitySystem::rounding(const Parallel& parallel, const std::vector<Real>& x) const {
  return kRounding * std::sqrt(parallel.sum(unknowns(), [&](std::int64_t u) {
           double sum = 0.0;
           for (std::size_t i = 3 * static_cast<std::size_t>(u); i < 3 * static_cast<std::size_t>(u) + 3; ++i) {
             if (!(free_[i] > 0)) continue;
             const double term = static_cast<double>(x[i] / inverse_diagonal_[i]);
             sum += term * term;
           }
           return sum;
         }));
}

double VelocitySystem::mobility(std::size_t unknown) const {
  double sum = 0.0;
  for (std::size_t i = 3 * unknown; i < 3 * unknown + 3; ++i)
    if (free_[i] > 0) sum += static_cast<double>(inverse_diagonal_[i]);
  return sum / 3.0;
}

Vec3 VelocitySystem::sliding_momentum(std::size_t u, const std::vector<Real>& x) const {
  if (!(sliding_[u] > 0)) return Vec3::Zero();
  const Vec3 v(x[3 * u], x[3 * u + 1], x[3 * u + 2]);
  return sliding_[u] * (v - normal_[u].dot(v) * normal_[u]);
}

void VelocitySystem::follow_ties(std::vector<Real>& x) const {
  for (const Tie& t : ties_) x[t.from] = x[t.to];
}

void VelocitySystem::fold(const Parallel& parallel, std::vector<Real>& y) const {
  linalg::multiply(parallel, y, moves_, y);
  fold(std::vector<std::size_t>{}, y);  // the ties
}

void VelocitySystem::fold(const std::vector<std::size_t>& entries, std::vector<Real>& y) const {
  for (const std::size_t entry : entries) y[entry] *= moves_[entry];
  for (const Tie& t : ties_) {
    y[t.to] += y[t.from];
    y[t.from] = 0;
  }
}

std::vector<std::size_t> VelocitySystem::followed(const std::vector<Real>& y) const {
  std::vector<std::size_t> entries;
  for (const Tie& t : ties_)
    if (y[t.from] != 0) entries.push_back(t.to);
  return entries;
}

void VelocitySystem::leave_ties(std::vector<Real>& x) const {
  for (const Tie& t : ties_) x[t.from] = 0;
}

void VelocitySystem::multiply_mass(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& y) const {
  y.resize(x.size());
  parallel.for_each(unknowns(), [&](std::int64_t node) {
    const auto u = static_cast<std::size_t>(node);
    const Vec3 slide = sliding_momentum(u, x);
    for (std::size_t a = 0; a < 3; ++a)
      y[3 * u + a] = node_mass_[u] * x[3 * u + a] - slide[static_cast<Eigen::Index>(a)];
  });
}

void VelocitySystem::divide_by_mass(const Parallel& parallel, const std::vector<Real>& b, std::vector<Real>& x) const {
  x.resize(b.size());
  parallel.for_each(unknowns(), [&](std::int64_t node) {
    const auto u = static_cast<std::size_t>(node);
    const Real all = node_mass_[u], own = all - sliding_[u];
    Vec3 v = all > 0 ? Vec3(Vec3(b[3 * u], b[3 * u + 1], b[3 * u + 2]) / all) : Vec3(Vec3::Zero());
    if (sliding_[u] > 0 && own > 0) v += (all / own - 1) * (v - normal_[u].dot(v) * normal_[u]);
    for (std::size_t a = 0; a < 3; ++a) x[3 * u + a] = v[static_cast<Eigen::Index>(a)];
  });
}

void VelocitySystem::internal_force(const Parallel& parallel, std::vector<Real>& force) {
  sum_blocks(
      parallel,
      [&](std::size_t l, std::size_t block, Real* out) {
        solid::block_force(*solids_[l].state, *solids_[l].work, block, out);
      },
      kAsItIs, force);
}

linalg::SolveStats VelocitySystem::solve(const Parallel& parallel, VelocitySolver solver, const std::vector<Real>& b,
                                         std::vector<Real>& x, double tolerance, double least) {
  if (solver == VelocitySolver::kPcg) build_multilevel(parallel);  // the paper's is the diagonal alone
  const linalg::Operator g = [&](const std::vector<Real>& in, std::vector<Real>& out) { apply(parallel, in, out); };
  linalg::SolveOptions options;
  options.tolerance = tolerance;
  const linalg::Operator inverse = [&](const std::vector<Real>& in, std::vector<Real>& out) {
    precondition(parallel, in, out);
  };
  // What is prescribed stands on the right; the rest is solved for.
  for (const Tie& t : ties_)
    if (moves_[t.to] == 0) x[t.from] = x[t.to];
  std::vector<Real> given(b.size());
  const auto entries = static_cast<std::int64_t>(b.size());
  parallel.for_each(entries, [&](std::int64_t n) {
    const auto i = static_cast<std::size_t>(n);
    given[i] = moves_[i] == 0 ? x[i] : Real(0);
    if (free_[i] == 0) x[i] = 0;
  });
  const bool any = linalg::dot(parallel, given, given) != 0.0;  // not a number counts, too
  if (any) {
    multiply(parallel, given, load_);
    add_penalty_impulses(1, penalty_impulses(given), load_);
    linalg::scale_add(parallel, load_, -1.0, b);
  } else {
    linalg::copy(parallel, load_, b);
  }
  fold(parallel, load_);
  linalg::SolveStats stats;
  if (solver == VelocitySolver::kPcr) {
    stats = linalg::pcr(parallel, g, inverse, load_, x, options, pcr_);
  } else {
    options.against_start = true;
    options.least = least;
    stats = linalg::pcg(parallel, g, inverse, load_, x, options, pcg_);
  }
  if (any) linalg::add_scaled(parallel, x, 1.0, given);
  follow_ties(x);
  return stats;
}

Vec3d VelocitySystem::place(std::size_t u) const {
  const auto [i, j, k] = global_.node_place(node_[u]);
  return global_.node_position(i, j, k);
}

void VelocitySystem::gather(const Parallel& parallel, const VectorField& field, SlipNodes& slip,
                            std::vector<Real>& x) const {
  x.resize(node_.size() * 3);
  parallel.for_each(unknowns(), [&](std::int64_t u) {
    const auto i = static_cast<std::size_t>(u);
    const Vec3 v = entry_[i] < 0 ? field.at(node_[i]) : slip.solid_velocity()[static_cast<std::size_t>(entry_[i])];
    for (std::size_t a = 0; a < 3; ++a) x[3 * i + a] = v[static_cast<Eigen::Index>(a)];
  });
}

void VelocitySystem::scatter(const Parallel& parallel, const std::vector<Real>& x, VectorField& field,
                             SlipNodes& slip) const {
  parallel.for_each(unknowns(), [&](std::int64_t u) {
    const auto i = static_cast<std::size_t>(u);
    const Vec3 v(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
    if (entry_[i] < 0)
      field.set(node_[i], v);
    else
      slip.solid_velocity()[static_cast<std::size_t>(entry_[i])] = v;
  });
}

std::size_t VelocitySystem::bytes() const {
  return (inertia_.size() + node_mass_.size() + free_.size() + inverse_diagonal_.size() + element_out_.size() +
          masked_.size() + load_.size() + moves_.size() + sliding_.size() + 3 * normal_.size()) *
             sizeof(Real) +
         (unknown_of_node_.size() + unknown_of_entry_.size() + entry_.size() + corner_.size() + gather_begin_.size() +
          gather_.size()) *
             sizeof(std::int32_t) +
         (node_.size() + solid_of_entry_.size()) * sizeof(std::size_t) + (rigid_ ? rigid_->bytes() : 0) +
         (row_inverse_ ? row_inverse_->bytes() : 0) + (multilevel_ ? multilevel_->bytes() : 0) + pcg_.bytes() +
         pcr_.bytes();
}

}  // namespace efsi::system
