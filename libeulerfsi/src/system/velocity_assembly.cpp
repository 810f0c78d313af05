// Assembly of G: which unknowns there are, what they weigh, and which elements act on them.
#include <algorithm>
#include <cmath>

#include "solid/element/stiffness_block.hpp"
#include "system/multilevel.hpp"
#include "system/rigid_modes.hpp"
#include "system/row_inverse.hpp"
#include "system/velocity_system.hpp"

namespace efsi::system {
namespace {

constexpr std::size_t kLanes = solid::kBlock;
constexpr double kStiffSolid = 20.0;  // of the diagonal of G over inertia
constexpr Real kFull = Real(0.999);   // solid fraction: a flush surface, up to rounding, cuts no cell

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

}  // namespace efsi::system
