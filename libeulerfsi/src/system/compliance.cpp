#include "system/compliance.hpp"

namespace efsi::system {

void Compliance::set(const std::vector<Real>& cells, const PressureGrid& level) {
  cells_.clear();
  values_.clear();
  if (cells.empty()) return;
  const Vec3i& n = level.grid.cells;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) {
        const std::size_t c = level.grid.padded(i, j, k);
        if (!(cells[c] > 0) || (!level.active.empty() && !level.active[c])) continue;
        cells_.push_back(c);
        values_.push_back(cells[c]);
      }
}

void Compliance::add_to_diagonal(std::vector<Real>& inverse_diagonal) const {
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    Real& d = inverse_diagonal[cells_[i]];
    d = d > 0 ? 1 / (1 / d + values_[i]) : 1 / values_[i];
  }
}

void Compliance::multiply(const Parallel& parallel, const std::vector<Real>& x, std::vector<Real>& out) const {
  out.resize(cells_.size());
  parallel.for_each(count(), [&](std::int64_t n) {
    const auto i = static_cast<std::size_t>(n);
    out[i] = values_[i] * x[cells_[i]];
  });
}

void Compliance::add(const Parallel& parallel, Real sign, const std::vector<Real>& x, std::vector<Real>& y) const {
  parallel.for_each(count(), [&](std::int64_t n) {
    const auto i = static_cast<std::size_t>(n);
    y[cells_[i]] += sign * values_[i] * x[cells_[i]];
  });
}

void Compliance::relax(const Parallel& parallel, Real weight, const std::vector<Real>& inverse_diagonal,
                       const std::vector<Real>& given, std::vector<Real>& x) const {
  parallel.for_each(count(), [&](std::int64_t n) {
    const auto i = static_cast<std::size_t>(n);
    x[cells_[i]] -= weight * inverse_diagonal[cells_[i]] * given[i];
  });
}

}  // namespace efsi::system
