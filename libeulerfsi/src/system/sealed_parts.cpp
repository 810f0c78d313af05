#include "system/sealed_parts.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::system {
namespace {

constexpr double kOpens = 1e-4;  // of its own diagonal: what a constant pressure moves in a cell that is open

}  // namespace

void SealedParts::find(const Parallel& parallel, const PressureLevel& level, const std::vector<std::uint8_t>& moves,
                       const linalg::Operator& apply) {
  find_runs(parallel, level, moves);
  join_runs(level.grid, moves);
  find_openings(parallel, level, apply);
}

void SealedParts::find_runs(const Parallel& parallel, const PressureLevel& level,
                            const std::vector<std::uint8_t>& moves) {
  const Grid& g = level.grid;
  const std::size_t up = g.node_stride(1), out = g.node_stride(2);
  std::vector<std::vector<Run>> rows(static_cast<std::size_t>(g.cells[1]) * static_cast<std::size_t>(g.cells[2]));
  parallel.for_each(static_cast<std::int64_t>(rows.size()), [&](std::int64_t row) {
    const int j = static_cast<int>(row % g.cells[1]), k = static_cast<int>(row / g.cells[1]);
    std::vector<Run>& runs = rows[static_cast<std::size_t>(row)];
    const std::size_t c = g.padded(0, j, k), n = g.node(0, j, k);
    bool follows = false;
    for (int i = 0; i < g.cells[0]; ++i) {
      const auto x = static_cast<std::size_t>(i);
      if (!level.active.empty() && !level.active[c + x]) {
        follows = false;
        continue;
      }
      if (follows && (moves[n + x] | moves[n + x + up] | moves[n + x + out] | moves[n + x + up + out]))
        runs.back().end = i + 1;
      else
        runs.push_back({c + x, i, i + 1, 0, true});
      follows = true;
    }
  });
  runs_.clear();
  row_begin_.assign(1, 0);
  for (const std::vector<Run>& row : rows) {
    runs_.insert(runs_.end(), row.begin(), row.end());
    row_begin_.push_back(runs_.size());
  }
  for (std::size_t r = 0; r < runs_.size(); ++r) runs_[r].part = r;
}

std::size_t SealedParts::part_of(std::size_t run) {
  while (runs_[run].part != run) run = runs_[run].part = runs_[runs_[run].part].part;
  return run;
}

void SealedParts::join_runs(const Grid& g, const std::vector<std::uint8_t>& moves) {
  const auto join = [&](std::size_t a, std::size_t b) {
    a = part_of(a);
    b = part_of(b);
    runs_[std::max(a, b)].part = std::min(a, b);
  };
  // Rows with the nodes (j, k) between them, or (j, k) and (j2, k2).
  const auto join_rows = [&](std::size_t one, std::size_t other, Vec3i node, Vec3i second) {
    const std::size_t n = g.node(0, node[1], node[2]), m = g.node(0, second[1], second[2]);
    std::size_t a = row_begin_[one], b = row_begin_[other];
    while (a < row_begin_[one + 1] && b < row_begin_[other + 1]) {
      const int end = std::min(runs_[a].end, runs_[b].end);
      for (int i = std::max(runs_[a].begin, runs_[b].begin); i <= end; ++i)
        if (moves[n + static_cast<std::size_t>(i)] | moves[m + static_cast<std::size_t>(i)]) {
          join(a, b);
          break;
        }
      // Runs that end where another begins share its node.
      if (runs_[a].end < runs_[b].end || (runs_[a].end == runs_[b].end && a + 1 < row_begin_[one + 1]))
        ++a;
      else
        ++b;
    }
  };
  const auto row = [&](int j, int k) {
    return static_cast<std::size_t>(j) + static_cast<std::size_t>(g.cells[1]) * static_cast<std::size_t>(k);
  };
  for (int k = 0; k < g.cells[2]; ++k)
    for (int j = 0; j < g.cells[1]; ++j) {
      const bool last_j = j + 1 == g.cells[1], last_k = k + 1 == g.cells[2];
      const int next_j = last_j ? 0 : j + 1, next_k = last_k ? 0 : k + 1;
      const bool along_j = !last_j || g.periodic[1], along_k = !last_k || g.periodic[2];
      const std::size_t at = row(j, k);
      if (along_j) join_rows(at, row(next_j, k), {0, j + 1, k}, {0, j + 1, k + 1});
      if (along_k) join_rows(at, row(j, next_k), {0, j, k + 1}, {0, j + 1, k + 1});
      if (along_j && along_k) {
        join_rows(at, row(next_j, next_k), {0, j + 1, k + 1}, {0, j + 1, k + 1});
        join_rows(row(next_j, k), row(j, next_k), {0, j + 1, k + 1}, {0, j + 1, k + 1});
      }
      const std::size_t first = row_begin_[at], last = row_begin_[at + 1];
      if (!g.periodic[0] || first == last || runs_[first].begin > 0 || runs_[last - 1].end < g.cells[0]) continue;
      const std::size_t n = g.node(0, j, k), up = g.node_stride(1), out = g.node_stride(2);
      if (moves[n] | moves[n + up] | moves[n + out] | moves[n + up + out]) join(first, last - 1);
    }
}

void SealedParts::find_openings(const Parallel& parallel, const PressureLevel& level, const linalg::Operator& apply) {
  for (std::size_t r = 0; r < runs_.size(); ++r) runs_[r].part = part_of(r);
  std::vector<Real> one(level.grid.padded_count(), 0), moved(one.size(), 0);
  for_runs(parallel, [&](std::size_t run) {
    const Run& r = runs_[run];
    std::fill_n(one.begin() + static_cast<std::ptrdiff_t>(r.first), r.end - r.begin, Real(1));
  });
  apply(one, moved);
  std::vector<std::uint8_t> opens(runs_.size(), 0);
  for_runs(parallel, [&](std::size_t run) {
    const Run& r = runs_[run];
    for (std::size_t c = r.first; c < r.last(); ++c)
      if (static_cast<double>(std::abs(moved[c]) * level.inverse_diagonal[c]) > kOpens) opens[run] = 1;
  });
  for (std::size_t r = 0; r < runs_.size(); ++r)
    if (opens[r]) runs_[runs_[r].part].sealed = false;
  for (Run& r : runs_) r.sealed = runs_[r.part].sealed;
}

void SealedParts::subtract_means(const Parallel& parallel, std::vector<Real>& r) const {
  if (std::none_of(runs_.begin(), runs_.end(), [](const Run& run) { return run.sealed; })) return;
  struct Sum {
    double value = 0.0, cells = 0.0;
  };
  std::vector<Sum> sums(runs_.size());
  for_runs(parallel, [&](std::size_t run) {
    const Run& of = runs_[run];
    if (!of.sealed) return;
    sums[run].cells = of.end - of.begin;
    for (std::size_t c = of.first; c < of.last(); ++c) sums[run].value += static_cast<double>(r[c]);
  });
  for (std::size_t run = 0; run < runs_.size(); ++run)
    if (runs_[run].part != run) {
      sums[runs_[run].part].value += sums[run].value;
      sums[runs_[run].part].cells += sums[run].cells;
    }
  for_runs(parallel, [&](std::size_t run) {
    const Run& of = runs_[run];
    if (!of.sealed) return;
    const Sum& sum = sums[of.part];
    const auto mean = static_cast<Real>(sum.value / sum.cells);
    for (std::size_t c = of.first; c < of.last(); ++c) r[c] -= mean;
  });
}

}  // namespace efsi::system
