#include "system/multilevel.hpp"

#include <algorithm>

#include "system/velocity_system.hpp"

namespace efsi::system {
namespace {

constexpr std::size_t kMostCoarsest = 600, kOfUnknowns = 20;  // nodes that are solved directly

// Diagonal of G on a lattice, mean of the axes: the mass, and what trilinear elements of cells with these moduli have.
std::vector<Real> diagonal_of(const Parallel& parallel, const SolidLattice& lattice) {
  std::vector<Real> diagonal(lattice.size());
  const double part = 1.0 / (9.0 * lattice.h * lattice.h);
  parallel.for_each(static_cast<std::int64_t>(lattice.size()), [&](std::int64_t n) {
    const auto u = static_cast<std::size_t>(n);
    const auto& [b, at] = lattice.place[u];
    const SolidLattice::Box& box = lattice.boxes[b];
    double sum = 0.0;
    for (const auto& c : grid::kCorner) {
      const Vec3i cell{at[0] - c[0], at[1] - c[1], at[2] - c[2]};
      if (!SolidLattice::inside(box, cell)) continue;
      const std::size_t i = lattice.index(box, cell);
      sum += std::max(0.0, static_cast<double>(lattice.lambda[i]) + 4.0 * static_cast<double>(lattice.mu[i]));
    }
    diagonal[u] = static_cast<Real>(lattice.mass[u] + part * sum);
  });
  return diagonal;
}

// What a row has at the nodes of the next coarser lattice.
LatticeRow on_parents(const LatticeRow& row, const Interpolation& from) {
  LatticeRow coarse{{}, row.stiffness};
  for (const auto& [node, weight] : row.parts) {
    for (auto t = static_cast<std::size_t>(from.parent_begin[static_cast<std::size_t>(node)]);
         t < static_cast<std::size_t>(from.parent_begin[static_cast<std::size_t>(node) + 1]); ++t) {
      const std::int32_t parent = from.parent[t];
      const double share = weight * static_cast<double>(from.parent_weight[t]);
      auto at =
          std::find_if(coarse.parts.begin(), coarse.parts.end(), [&](const auto& p) { return p.first == parent; });
      if (at == coarse.parts.end())
        coarse.parts.emplace_back(parent, share);
      else
        at->second += share;
    }
  }
  return coarse;
}

}  // namespace

MultilevelScaling::MultilevelScaling(const Parallel& parallel, const VelocitySystem& system,
                                     const std::vector<std::uint8_t>& wanted) {
  SolidLattice lattice = finest_lattice(parallel, system, wanted);
  const std::size_t few = std::min(kMostCoarsest, lattice.size() / kOfUnknowns);
  for (std::size_t finer = lattice.size() + 1; lattice.size() > few && lattice.size() < finer;) {
    finer = lattice.size();
    Level& level = levels_.emplace_back();
    lattice = coarsen(parallel, lattice, level.from);
    level.diagonal = diagonal_of(parallel, lattice);
    level.inverse.resize(3 * lattice.size());
    level.r.resize(3 * lattice.size());
    level.z.resize(3 * lattice.size());
  }
  coarsest_.assemble(lattice);
  set_penalties(parallel, {});
}

void MultilevelScaling::set_penalties(const Parallel& parallel, const std::vector<Penalty>& penalties) {
  std::vector<LatticeRow> rows(penalties.size());
  const auto for_rows = [&](const auto& body) {
    parallel.for_each(static_cast<std::int64_t>(rows.size()),
                      [&](std::int64_t r) { body(static_cast<std::size_t>(r), rows[static_cast<std::size_t>(r)]); });
  };
  for_rows([&](std::size_t r, LatticeRow& row) {
    row.stiffness = penalties[r].stiffness.cast<double>();
    for (const RowPart& part : penalties[r].parts)
      row.parts.emplace_back(static_cast<std::int32_t>(part.unknown), static_cast<double>(part.weight));
  });
  for (Level& level : levels_) {
    parallel.for_each(static_cast<std::int64_t>(level.diagonal.size()), [&](std::int64_t n) {
      const auto u = static_cast<std::size_t>(n);
      for (std::size_t a = 0; a < 3; ++a) level.inverse[3 * u + a] = 1 / level.diagonal[u];
    });
    for_rows([&](std::size_t, LatticeRow& row) { row = on_parents(row, level.from); });
    for (const LatticeRow& row : rows)
      for (const auto& [node, weight] : row.parts)
        for (std::size_t a = 0; a < 3; ++a) {
          const auto e = static_cast<Eigen::Index>(a);
          Real& inverse = level.inverse[3 * static_cast<std::size_t>(node) + a];
          inverse = 1 / (1 / inverse + static_cast<Real>(weight * weight * row.stiffness(e, e)));
        }
  }
  coarsest_.set_rows(rows);
}

void MultilevelScaling::add(const Parallel& parallel, const std::vector<Real>& free, const std::vector<Real>& r,
                            std::vector<Real>& z) {
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    Level& level = levels_[l];
    const Real* fine = l == 0 ? r.data() : levels_[l - 1].r.data();
    parallel.for_each(static_cast<std::int64_t>(level.diagonal.size()), [&](std::int64_t n) {
      const auto u = static_cast<std::size_t>(n);
      Real sum[3] = {0, 0, 0};
      for (auto t = static_cast<std::size_t>(level.from.child_begin[u]);
           t < static_cast<std::size_t>(level.from.child_begin[u + 1]); ++t) {
        const Real* child = fine + 3 * static_cast<std::size_t>(level.from.child[t]);
        for (std::size_t a = 0; a < 3; ++a) sum[a] += level.from.child_weight[t] * child[a];
      }
      for (std::size_t a = 0; a < 3; ++a) {
        level.r[3 * u + a] = sum[a];
        level.z[3 * u + a] = level.inverse[3 * u + a] * sum[a];
      }
    });
  }
  coarsest_.solve(levels_.back().r, levels_.back().z);
  for (std::size_t l = levels_.size(); l-- > 0;) {
    const Level& level = levels_[l];
    std::vector<Real>& fine = l == 0 ? z : levels_[l - 1].z;
    parallel.for_each(static_cast<std::int64_t>(level.from.parent_begin.size()) - 1, [&](std::int64_t n) {
      const auto u = static_cast<std::size_t>(n);
      const auto begin = static_cast<std::size_t>(level.from.parent_begin[u]),
                 end = static_cast<std::size_t>(level.from.parent_begin[u + 1]);
      if (begin == end) return;
      Real sum[3] = {0, 0, 0};
      for (std::size_t t = begin; t < end; ++t) {
        const Real* parent = level.z.data() + 3 * static_cast<std::size_t>(level.from.parent[t]);
        for (std::size_t a = 0; a < 3; ++a) sum[a] += level.from.parent_weight[t] * parent[a];
      }
      for (std::size_t a = 0; a < 3; ++a) fine[3 * u + a] += l == 0 ? free[3 * u + a] * sum[a] : sum[a];
    });
  }
}

std::size_t MultilevelScaling::bytes() const {
  std::size_t sum = coarsest_.bytes();
  for (const Level& level : levels_)
    sum += level.from.bytes() +
           (level.diagonal.size() + level.inverse.size() + level.r.size() + level.z.size()) * sizeof(Real);
  return sum;
}

}  // namespace efsi::system
