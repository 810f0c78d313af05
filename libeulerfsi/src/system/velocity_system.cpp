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
constexpr std::uint8_t kAllAxes = 7;
constexpr double kStiffSolid = 20.0;  // of the diagonal of G over inertia
constexpr double kRounding =
    8.0 * static_cast<double>(std::numeric_limits<Real>::epsilon());  // of what cancels in a residual
constexpr Real kFull = Real(0.999);  // solid fraction: a flush surface, up to rounding, cuts no cell

// A vector of three, and the value behind it.
constexpr std::size_t kBehind = 1;
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

void VelocitySystem::assemble(const Parallel& parallel, const Grid& global, const std::vector<std::uint8_t>& fixed,
                              std::span<const SolidRef> solids, const std::vector<Real>& mass, const SlipNodes& slip,
                              double dt, int slab) {
  across_slab_ = slab < 0 ? 0u : 1u << slab;
  h_ = global.h;
  start(global, solids, slip);
  const std::vector<double> damping = number_unknowns(fixed, slip, dt);
  weigh_unknowns(mass, slip, damping);
  moves_ = free_;
  ties_.clear();
  penalties_.clear();
  rigid_.reset();
  row_inverse_.reset();
  list_elements(parallel);
  weigh_elements(parallel, dt);
  list_gathers();
  invert_diagonal(parallel);
  multilevel_.reset();
  find_stiff(parallel);
}

// Forgets the last system. Shared nodes name their first entry in slip until they have their unknowns.
void VelocitySystem::start(const Grid& global, std::span<const SolidRef> solids, const SlipNodes& slip) {
  solids_.assign(solids.begin(), solids.end());
  global_ = global;
  if (unknown_of_node_.size() != global.node_count()) {
    unknown_of_node_.assign(global.node_count(), -1);
  } else {
    for (std::size_t n : node_) unknown_of_node_[n] = -1;
  }
  node_.clear();
  entry_.clear();
  unknown_of_entry_.assign(slip.nodes().size(), -1);
  solid_of_entry_.clear();
  for (std::size_t t = slip.nodes().size(); t-- > 0;)
    if (slip.nodes()[t].shared()) unknown_of_node_[slip.nodes()[t].node] = -2 - static_cast<std::int32_t>(t);
  for (const SlipNode& s : slip.nodes()) solid_of_entry_.push_back(s.solid);
  free_.clear();
  unknown_begin_.assign(1, 0);
  held_.assign(solids_.size(), 0);
  touching_.clear();
}

// Unknowns in node order per solid, solids in order; what walls hold of each solid, and which solids share a node.
std::vector<double> VelocitySystem::number_unknowns(const std::vector<std::uint8_t>& fixed, const SlipNodes& slip,
                                                    double dt) {
  std::vector<double> damping;
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    const SolidRef& s = solids_[l];
    const Grid& g = s.state->band.grid;
    const Vec3i lo = grid::offset(g, global_);
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) {
          const std::size_t local = g.node(i, j, k);
          if (!s.work->carries[local]) continue;
          const std::size_t n = global_.node(i + lo[0], j + lo[1], k + lo[2]);
          const bool own = unknown_of_node_[n] < -1;
          const std::size_t entry = own ? entry_of(l, n) : 0;
          std::int32_t& unknown = own ? unknown_of_entry_[entry] : unknown_of_node_[n];
          if (unknown < 0) {
            unknown = static_cast<std::int32_t>(node_.size());
            node_.push_back(n);
            entry_.push_back(own ? static_cast<std::int32_t>(entry) : -1);
            damping.push_back(0.0);
            const std::uint8_t held = own ? slip.nodes()[entry].held : fixed[n];
            for (unsigned a = 0; a < 3; ++a) free_.push_back(held & (1u << a) ? Real(0) : Real(1));
            held_[l] = static_cast<std::uint8_t>(held_[l] | held);
          } else {
            const std::size_t first = solid_of(static_cast<std::size_t>(unknown));
            held_[first] = held_[l] = kAllAxes;
            touching_.insert({first, l});
          }
          damping[static_cast<std::size_t>(unknown)] +=
              dt * s.rest->rayleigh_alpha * static_cast<double>(s.work->mass[local]);
        }
    unknown_begin_.push_back(node_.size());
  }
  return damping;
}

// M and M + dt C_M per unknown, and along which normals nodes slip.
void VelocitySystem::weigh_unknowns(const std::vector<Real>& mass, const SlipNodes& slip,
                                    const std::vector<double>& damping) {
  node_mass_.resize(node_.size());
  inertia_.resize(node_.size());
  for (std::size_t i = 0; i < node_.size(); ++i) {
    node_mass_[i] = entry_[i] < 0 ? mass[node_[i]] : slip.nodes()[static_cast<std::size_t>(entry_[i])].solid_mass;
    inertia_[i] = static_cast<Real>(static_cast<double>(node_mass_[i]) + damping[i]);
  }
  sliding_.assign(node_.size(), 0);
  normal_.assign(slip.empty() ? 0 : node_.size(), Vec3::Zero());
  for (std::size_t t = 0; t < slip.nodes().size(); ++t) {
    const SlipNode& s = slip.nodes()[t];
    if (s.shared()) continue;
    const auto u = static_cast<std::size_t>(unknown_of_node_[s.node]);
    entry_[u] = static_cast<std::int32_t>(t);
    sliding_[u] = s.fluid_mass;
    normal_[u] = s.normal;
  }
}

// The unknowns at the corners of elements, in blocks.
void VelocitySystem::list_elements(const Parallel& parallel) {
  block_begin_.assign(1, 0);
  for (const SolidRef& s : solids_) block_begin_.push_back(block_begin_.back() + s.work->blocks());
  corner_.assign(block_begin_.back() * 8 * kLanes, -1);
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    const SolidRef& s = solids_[l];
    const Grid& g = s.state->band.grid;
    const Vec3i lo = grid::offset(g, global_);
    parallel.for_each(static_cast<std::int64_t>(s.work->element_cell.size()), [&](std::int64_t e) {
      const auto c = static_cast<int>(s.work->element_cell[static_cast<std::size_t>(e)]);
      const int i = c % g.cells[0], j = c / g.cells[0] % g.cells[1], k = c / (g.cells[0] * g.cells[1]);
      const auto element = static_cast<std::size_t>(e);
      const std::size_t block = block_begin_[l] + element / kLanes, lane = element % kLanes;
      for (std::size_t a = 0; a < 8; ++a)
        corner_[(block * 8 + a) * kLanes + lane] = static_cast<std::int32_t>(
            unknown_of(l, global_.node(i + lo[0] + grid::kCorner[a][0], j + lo[1] + grid::kCorner[a][1],
                                       k + lo[2] + grid::kCorner[a][2])));
    });
  }
}

// What of an element's stiffness is implicit. In contact the cells that a surface cuts are damped.
void VelocitySystem::weigh_elements(const Parallel& parallel, double dt) {
  stiffness_factor_.assign(corner_.size() / 8, 0);
  past_factor_.assign(corner_.size() / 8, 0);
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    const solid::SolidWork& work = *solids_[l].work;
    const StiffnessShares &inside = shares(l), &cut = touches(l) ? solids_[l].held : inside;
    parallel.for_each(static_cast<std::int64_t>(work.element_cell.size()), [&](std::int64_t n) {
      const auto e = static_cast<std::size_t>(n);
      const auto cell = static_cast<std::size_t>(work.element_cell[e]);
      const StiffnessShares& share = work.fraction[cell] > kFull ? inside : cut;
      const double crushed = solids_[l].keeps_volume ? crushed_viscosity(static_cast<double>(work.volume_ratio[cell]),
                                                                         solids_[l].rest->plastic.yields())
                                                     : 0.0;
      const std::size_t i = block_begin_[l] * kLanes + e;
      stiffness_factor_[i] = static_cast<Real>((share.ahead + crushed) * dt * dt + dt * solids_[l].rest->rayleigh_beta);
      past_factor_[i] = static_cast<Real>(share.behind * dt * dt);
    });
  }
}

// The lists by which unknowns gather from elements.
void VelocitySystem::list_gathers() {
  gather_begin_.assign(node_.size() + 1, 0);
  for (std::int32_t u : corner_)
    if (u >= 0) ++gather_begin_[static_cast<std::size_t>(u) + 1];
  for (std::size_t i = 0; i < node_.size(); ++i) gather_begin_[i + 1] += gather_begin_[i];
  gather_.resize(static_cast<std::size_t>(gather_begin_.back()));
  std::vector<std::int32_t> fill(gather_begin_.begin(), gather_begin_.end() - 1);
  for (std::size_t c = 0; c < corner_.size(); ++c) {
    if (corner_[c] < 0) {
      corner_[c] = 0;  // a free lane: without stiffness, and nobody gathers from it
      continue;
    }
    gather_[static_cast<std::size_t>(fill[static_cast<std::size_t>(corner_[c])]++)] = static_cast<std::int32_t>(3 * c);
  }
  element_out_.resize(corner_.size() * 3 + kBehind);
}

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

// Where the diagonal of G is s times the inertia, in the mean, elastic waves pass some sqrt(s) cells in the step, and
// so many iterations does conjugate gradients take by the diagonal. Coarser levels take a dozen at any s, each half as
// long again, so that both are equal at s of about 20.
void VelocitySystem::find_stiff(const Parallel& parallel) {
  stiff_.assign(solids_.size(), 0);
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    const std::size_t begin = unknown_begin_[l], end = unknown_begin_[l + 1];
    const auto chunks = static_cast<std::int64_t>((end - begin + kUnknownsPerSum - 1) / kUnknownsPerSum);
    const auto sum = [&](const auto& term) {
      return parallel.sum(chunks, [&](std::int64_t chunk) {
        const std::size_t first = begin + static_cast<std::size_t>(chunk) * kUnknownsPerSum;
        double part = 0.0;
        for (std::size_t i = 3 * first; i < 3 * std::min(end, first + kUnknownsPerSum); ++i)
          if (free_[i] > 0) part += term(i);
        return part;
      });
    };
    const double count = sum([](std::size_t) { return 1.0; });
    const double ratios =
        sum([&](std::size_t i) { return 1.0 / (static_cast<double>(inverse_diagonal_[i]) * inertia(i / 3)); });
    stiff_[l] = ratios > kStiffSolid * count;
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

// The rigid motion that gives the unknowns of a solid the momenta that x lacks of b, nearly: where the fluid slips a
// third of its mass stands for the part along the normal.
solid::RigidMotion VelocitySystem::missing_motion(const Parallel& parallel, std::size_t solid,
                                                  const std::vector<Real>& b, const std::vector<Real>& x) const {
  const std::size_t begin = unknown_begin_[solid], end = unknown_begin_[solid + 1];
  const auto& band = solids_[solid].state->band.grid;
  const Vec3d origin = band.node_position(band.cells[0] / 2, band.cells[1] / 2, band.cells[2] / 2);
  const std::size_t chunks = (end - begin + kUnknownsPerSum - 1) / kUnknownsPerSum;
  std::vector<solid::MomentSums> sums(chunks);
  parallel.for_each(static_cast<std::int64_t>(chunks), [&](std::int64_t chunk) {
    const auto c = static_cast<std::size_t>(chunk);
    for (std::size_t u = begin + c * kUnknownsPerSum; u < std::min(end, begin + (c + 1) * kUnknownsPerSum); ++u) {
      const double m = static_cast<double>(inertia_[u]);
      const Vec3d slides = sliding_momentum(u, x).cast<double>();
      Vec3d missing;
      for (std::size_t a = 0; a < 3; ++a)
        missing[static_cast<Eigen::Index>(a)] =
            static_cast<double>(b[3 * u + a]) - m * static_cast<double>(x[3 * u + a]);
      sums[c].add(inertia(u), place(u) - origin, (missing + slides) / inertia(u));
    }
  });
  for (std::size_t c = 1; c < chunks; ++c) sums[0].add(sums[c]);
  return chunks > 0 ? solid::rigid_motion(sums[0].momenta(origin), held_[solid]) : solid::RigidMotion{};
}

void VelocitySystem::conserve_momentum(const Parallel& parallel, const std::vector<Real>& b,
                                       std::vector<Real>& x) const {
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    if (held_[l] == kAllAxes) continue;
    const std::size_t begin = unknown_begin_[l], end = unknown_begin_[l + 1];
    for (int pass = 0; pass < (normal_.empty() ? 1 : 2); ++pass) {
      const solid::RigidMotion missing = missing_motion(parallel, l, b, x);
      parallel.for_each(static_cast<std::int64_t>(end - begin), [&](std::int64_t i) {
        const std::size_t u = begin + static_cast<std::size_t>(i);
        const Vec3d v = missing.at(place(u));
        for (std::size_t a = 0; a < 3; ++a) x[3 * u + a] += static_cast<Real>(v[static_cast<Eigen::Index>(a)]);
      });
    }
  }
}

std::vector<Vec3d> VelocitySystem::sum_by_solid(const Parallel& parallel, const std::vector<Real>& x) const {
  std::vector<Vec3d> sums(solids_.size());
  for (std::size_t l = 0; l < solids_.size(); ++l) {
    const std::size_t begin = unknown_begin_[l], end = unknown_begin_[l + 1];
    const auto chunks = static_cast<std::int64_t>((end - begin + kUnknownsPerSum - 1) / kUnknownsPerSum);
    for (std::size_t a = 0; a < 3; ++a)
      sums[l][static_cast<Eigen::Index>(a)] = parallel.sum(chunks, [&](std::int64_t chunk) {
        const std::size_t first = begin + static_cast<std::size_t>(chunk) * kUnknownsPerSum;
        double part = 0.0;
        for (std::size_t u = first; u < std::min(end, first + kUnknownsPerSum); ++u)
          part += static_cast<double>(x[3 * u + a]);
        return part;
      });
  }
  return sums;
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
