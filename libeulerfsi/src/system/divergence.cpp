#include "system/divergence.hpp"

#include <algorithm>

#include "base/kernel.hpp"

namespace efsi::system {
namespace {

// A = D mobility D^T is swept through plane by plane of nodes. Sums and differences are passed on: between two planes
// of cells, then between two of their rows, then between two rows of nodes.

// low + high and high - low along a row.
EFSI_KERNEL void pair_row(int n, const Real* low, const Real* high, Real* sum, Real* difference) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    sum[i] = low[i] + high[i];
    difference[i] = high[i] - low[i];
  }
}

// g = mobility (p_high - p_low) along one row of n + 1 nodes, from sum s and difference d across the plane of the rows
// of n + 2 cells below (0) and above (1) it.
EFSI_KERNEL void gradient_row(int n, const Real* s0, const Real* d0, const Real* s1, const Real* d1, const Real* w,
                              Real* gx, Real* gy, Real* gz) {
#pragma omp simd
  for (int i = 0; i <= n; ++i) {
    gx[i] = w[i] * ((s0[i + 1] + s1[i + 1]) - (s0[i] + s1[i]));
    gy[i] = w[i] * ((s1[i + 1] - s0[i + 1]) + (s1[i] - s0[i]));
    gz[i] = w[i] * ((d0[i + 1] + d1[i + 1]) + (d0[i] + d1[i]));
  }
}

// A row of nodes.
struct GradientRow {
  std::vector<Real> x, y, z;
};

// D g of the cells between two rows of nodes of one plane: what x and y give is the same for the cells below the plane
// and above it, what z gives has opposite signs. value = carry + the share of the cells below, carry = the share of the
// cells above, for which the next plane of nodes brings the rest.
EFSI_KERNEL void divergence_row(int n, const Real* x0, const Real* x1, const Real* y0, const Real* y1, const Real* z0,
                                const Real* z1, Real* carry, Real* value) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const Real xy = ((x0[i + 1] + x1[i + 1]) - (x0[i] + x1[i])) + ((y1[i] - y0[i]) + (y1[i + 1] - y0[i + 1]));
    const Real z = (z0[i] + z1[i]) + (z0[i + 1] + z1[i + 1]);
    value[i] = carry[i] + (xy + z);
    carry[i] = xy - z;
  }
}

// A sweep over planes of nodes, k ascending, for the cells of a box; what the box has along z does not matter.
class Sweep {
 public:
  explicit Sweep(const PressureLevel& level) : Sweep(level, {Vec3i{0, 0, 0}, level.grid.cells}) {}
  Sweep(const PressureLevel& level, const CellBox& box)
      : level_(level),
        first_(box.first),
        rows_(box.second[1] - box.first[1]),
        n_(box.second[0] - box.first[0]),
        carry(static_cast<std::size_t>(n_) * static_cast<std::size_t>(rows_), Real(0)) {
    for (std::vector<Real>* v : {&sum_[0], &sum_[1], &difference_[0], &difference_[1], &value_})
      v->resize(static_cast<std::size_t>(n_ + 2));
    for (GradientRow& row : gradient_)
      for (std::vector<Real>* v : {&row.x, &row.y, &row.z}) v->resize(static_cast<std::size_t>(n_ + 1));
  }

  // g at row `row` of nodes of the plane k; rows in ascending order from 0.
  const GradientRow& gradient(const Real* p, int row, int k) {
    const Grid& g = level_.grid;
    const int now = row & 1, below = 1 - now;  // rows of cells `row` and row - 1
    const auto pair = [&](int cells, int slot) {
      const std::size_t at = g.padded(first_[0] - 1, first_[1] + cells, k - 1);
      pair_row(n_ + 2, p + at, p + at + g.padded(0, 0, 1) - g.padded(0, 0, 0), sum_[slot].data(),
               difference_[slot].data());
    };
    if (row == 0) pair(-1, below);
    pair(row, now);
    GradientRow& out = gradient_[now];
    const std::size_t node = g.node(first_[0], first_[1] + row, k);
    gradient_row(n_, sum_[below].data(), difference_[below].data(), sum_[now].data(), difference_[now].data(),
                 level_.mobility.data() + node, out.x.data(), out.y.data(), out.z.data());
    fix_walls(first_[1] + row, k, level_.fixed.data() + node, out);
    return out;
  }

  // The plane of nodes k: consume(row, D g of a row of cells (., ., k - 1)), whose share of plane k - 1 is in the
  // carry. These cells are no longer read when consume() is called.
  template <class Consume>
  void plane(const Real* p, int k, const Consume& consume) {
    for (int row = 0; row <= rows_; ++row) {
      const GradientRow& high = gradient(p, row, k);
      if (row == 0) continue;
      const GradientRow& low = gradient_[1 - (row & 1)];
      divergence_row(n_, low.x.data(), high.x.data(), low.y.data(), high.y.data(), low.z.data(), high.z.data(),
                     carry_row(row - 1), value_.data());
      consume(row - 1, value_.data());
    }
  }

  Real* carry_row(int row) { return carry.data() + static_cast<std::size_t>(n_) * static_cast<std::size_t>(row); }

 private:
  // Where walls fix a component at all: whole rows on the y and z faces, the ends of all others.
  void fix_walls(int j, int k, const std::uint8_t* fixed, GradientRow& row) const {
    const Grid& g = level_.grid;
    const bool face = j == 0 || k == 0 || j == g.cells[1] || k == g.cells[2];
    for (int i = 0; i <= n_; i += face ? 1 : n_) {
      if (fixed[i] & 1u) row.x[static_cast<std::size_t>(i)] = 0;
      if (fixed[i] & 2u) row.y[static_cast<std::size_t>(i)] = 0;
      if (fixed[i] & 4u) row.z[static_cast<std::size_t>(i)] = 0;
    }
  }

  const PressureLevel& level_;
  Vec3i first_;
  int rows_, n_;
  std::vector<Real> sum_[2], difference_[2], value_;
  GradientRow gradient_[2];

 public:
  std::vector<Real> carry;  // of the cells above the last plane
};

// out = a + sign b
EFSI_KERNEL void add_row(int n, const Real* a, Real sign, const Real* b, Real* out) {
#pragma omp simd
  for (int i = 0; i < n; ++i) out[i] = a[i] + sign * b[i];
}

// mobility times the number of components that no wall fixes
EFSI_KERNEL void free_mobility(int n, const Real* mobility, const std::uint8_t* fixed, Real* out) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const int bits = fixed[i];
    out[i] = mobility[i] * static_cast<Real>(3 - (bits & 1) - ((bits >> 1) & 1) - ((bits >> 2) & 1));
  }
}

// 1 / sum over the 8 corners of each cell of a row; 0 where the sum is 0
EFSI_KERNEL void inverse_sum_row(int n, const Real* a, const Real* b, const Real* c, const Real* d, Real* out) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const Real sum = ((a[i] + b[i]) + (c[i] + d[i])) + ((a[i + 1] + b[i + 1]) + (c[i + 1] + d[i + 1]));
    out[i] = sum > 0 ? 1 / sum : Real(0);
  }
}

// x = weight d b along a row
EFSI_KERNEL void scale_row(int n, Real weight, const Real* d, const Real* b, Real* x) {
#pragma omp simd
  for (int i = 0; i < n; ++i) x[i] = weight * d[i] * b[i];
}

// out = x + weight d (b + value) along a row
EFSI_KERNEL void relax_row(int n, Real weight, const Real* d, const Real* b, const Real* value, const Real* x,
                           Real* out) {
#pragma omp simd
  for (int i = 0; i < n; ++i) out[i] = x[i] + weight * d[i] * (b[i] + value[i]);
}

}  // namespace

void apply_pressure_operator(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& x,
                             std::vector<Real>& y, const std::vector<Real>* b) {
  const Grid& g = level.grid;
  const int nx = g.cells[0];
  parallel.for_ranges(g.cells[2], [&](std::int64_t begin, std::int64_t end) {
    Sweep sweep(level);
    const std::vector<Real> zero(static_cast<std::size_t>(nx), Real(0));
    sweep.plane(x.data(), static_cast<int>(begin), [](int, const Real*) {});
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      sweep.plane(x.data(), k + 1, [&](int j, const Real* value) {
        // A x = -D g; b - A x = b + D g.
        const std::size_t cells = g.padded(0, j, k);
        Real* out = y.data() + cells;
        add_row(nx, b ? b->data() + cells : zero.data(), b ? Real(1) : Real(-1), value, out);
        if (level.active.empty()) return;
        const std::uint8_t* active = level.active.data() + cells;
        for (int i = 0; i < nx; ++i)
          if (!active[i]) out[i] = 0;
      });
  });
}

void smooth_pressure(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& b, Real weight,
                     std::vector<Real>& x) {
  const Grid& g = level.grid;
  const int nx = g.cells[0];
  // A row of cells may be overwritten when the planes of nodes on both sides are known; where two threads meet, that
  // plane comes first: what it gives the cells below it and above it.
  const int ranges = parallel.ranges(g.cells[2]);
  std::vector<std::vector<Real>> below(static_cast<std::size_t>(ranges + 1)), above(below.size());
  parallel.for_each(ranges + 1, [&](std::int64_t t) {
    Sweep sweep(level);
    std::vector<Real>& share = below[static_cast<std::size_t>(t)];
    share.reserve(sweep.carry.size());
    sweep.plane(x.data(), static_cast<int>(parallel.range_begin(g.cells[2], t)),
                [&](int, const Real* value) { share.insert(share.end(), value, value + nx); });
    above[static_cast<std::size_t>(t)] = std::move(sweep.carry);
  });
  parallel.for_each(ranges, [&](std::int64_t t) {
    const int begin = static_cast<int>(parallel.range_begin(g.cells[2], t));
    const int end = static_cast<int>(parallel.range_begin(g.cells[2], t + 1));
    Sweep sweep(level);
    sweep.carry = std::move(above[static_cast<std::size_t>(t)]);
    const auto smooth = [&](int j, int k, const Real* value) {
      const std::size_t cells = g.padded(0, j, k);
      Real* out = x.data() + cells;
      relax_row(nx, weight, level.inverse_diagonal.data() + cells, b.data() + cells, value, out, out);
    };
    for (int k = begin; k + 1 < end; ++k)
      sweep.plane(x.data(), k + 1, [&](int j, const Real* value) { smooth(j, k, value); });
    const Real* share = below[static_cast<std::size_t>(t) + 1].data();
    for (int j = 0; j < g.cells[1]; ++j, share += nx) {
      Real* carry = sweep.carry_row(j);
      add_row(nx, carry, Real(1), share, carry);
      smooth(j, end - 1, carry);
    }
  });
}

namespace {

// Calls body(box); each thread has about as many cells.
template <class Body>
void for_boxes(const Parallel& parallel, const std::vector<CellBox>& boxes, const Body& body) {
  const auto cells = [](const CellBox& box) {
    std::int64_t product = 1;
    for (std::size_t a = 0; a < 3; ++a) product *= box.second[a] - box.first[a];
    return product;
  };
  std::int64_t total = 0;
  for (const CellBox& box : boxes) total += cells(box);
  parallel.for_ranges(total, [&](std::int64_t begin, std::int64_t end) {
    std::int64_t before = 0;
    for (const CellBox& box : boxes) {
      if (before >= begin && before < end) body(box);
      before += cells(box);
    }
  });
}

// Calls body(first cell, cells, D g) for the rows of cells of boxes, g from x.
template <class Body>
void sweep_boxes(const Parallel& parallel, const PressureLevel& level, const std::vector<CellBox>& boxes,
                 const std::vector<Real>& x, const Body& body) {
  for_boxes(parallel, boxes, [&](const CellBox& box) {
    const Vec3i &begin = box.first, &end = box.second;
    Sweep sweep(level, box);
    sweep.plane(x.data(), begin[2], [](int, const Real*) {});
    for (int k = begin[2]; k < end[2]; ++k)
      sweep.plane(x.data(), k + 1, [&](int row, const Real* value) {
        body(level.grid.padded(begin[0], begin[1] + row, k), end[0] - begin[0], value);
      });
  });
}

}  // namespace

void residual_in_boxes(const Parallel& parallel, const PressureLevel& level, const std::vector<CellBox>& boxes,
                       const std::vector<Real>& b, const std::vector<Real>& x, std::vector<Real>& r) {
  sweep_boxes(parallel, level, boxes, x, [&](std::size_t cells, int n, const Real* value) {
    add_row(n, b.data() + cells, Real(1), value, r.data() + cells);
    if (level.active.empty()) return;
    for (std::size_t c = cells; c < cells + static_cast<std::size_t>(n); ++c)
      if (!level.active[c]) r[c] = 0;
  });
}

void relax_in_boxes(const Parallel& parallel, const PressureLevel& level, const std::vector<CellBox>& boxes,
                    const std::vector<Real>& b, Real weight, const std::vector<Real>& x, std::vector<Real>& out) {
  sweep_boxes(parallel, level, boxes, x, [&](std::size_t cells, int n, const Real* value) {
    relax_row(n, weight, level.inverse_diagonal.data() + cells, b.data() + cells, value, x.data() + cells,
              out.data() + cells);
  });
}

void relax_from_zero(const Parallel& parallel, const PressureLevel& level, const std::vector<CellBox>& boxes,
                     const std::vector<Real>& b, Real weight, std::vector<Real>& x) {
  for_boxes(parallel, boxes, [&](const CellBox& box) {
    const auto& [begin, end] = box;
    for (int k = begin[2]; k < end[2]; ++k)
      for (int j = begin[1]; j < end[1]; ++j) {
        const std::size_t cells = level.grid.padded(begin[0], j, k);
        scale_row(end[0] - begin[0], weight, level.inverse_diagonal.data() + cells, b.data() + cells, x.data() + cells);
      }
  });
}

void copy_in_boxes(const Parallel& parallel, const Grid& g, const std::vector<CellBox>& boxes,
                   const std::vector<Real>& from, std::vector<Real>& to) {
  for_boxes(parallel, boxes, [&](const CellBox& box) {
    const auto& [begin, end] = box;
    for (int k = begin[2]; k < end[2]; ++k)
      for (int j = begin[1]; j < end[1]; ++j) {
        const std::size_t cells = g.padded(begin[0], j, k);
        std::copy_n(from.data() + cells, end[0] - begin[0], to.data() + cells);
      }
  });
}

void compute_pressure_diagonal(const Parallel& parallel, PressureLevel& level) {
  const Grid& g = level.grid;
  const auto row = static_cast<std::size_t>(g.cells[0] + 1);
  level.inverse_diagonal.resize(g.padded_count(), 0);
  parallel.for_ranges(g.cells[2], [&](std::int64_t begin, std::int64_t end) {
    // Mobility times the number of free components, per node of a plane.
    std::vector<Real> low(row * static_cast<std::size_t>(g.cells[1] + 1)), high(low.size());
    const auto fill = [&](std::vector<Real>& plane, int k) {
      const std::size_t first = g.node(0, 0, k);
      free_mobility(static_cast<int>(plane.size()), level.mobility.data() + first, level.fixed.data() + first,
                    plane.data());
    };
    fill(low, static_cast<int>(begin));
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
      fill(high, k + 1);
      for (int j = 0; j < g.cells[1]; ++j) {
        const std::size_t j0 = row * static_cast<std::size_t>(j), cells = g.padded(0, j, k);
        Real* out = level.inverse_diagonal.data() + cells;
        inverse_sum_row(g.cells[0], &low[j0], &low[j0 + row], &high[j0], &high[j0 + row], out);
        if (level.active.empty()) continue;
        for (std::size_t i = 0; i + 1 < row; ++i)
          if (!level.active[cells + i]) out[i] = 0;
      }
      std::swap(low, high);
    }
  });
}

namespace {

// Flux out of a row of cells through the four rows of nodes around it, less what the source wants; o: steps to the
// corners of a cell.
template <bool has_source>
EFSI_INLINE void flux_row(int n, Real area, const std::size_t* o, const Real* x, const Real* y, const Real* z,
                          Real volume, const Real* source, Real* out) {
  const std::size_t o2 = o[2], o3 = o[3], o4 = o[4], o5 = o[5], o6 = o[6], o7 = o[7];
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const Real *xi = x + i, *yi = y + i, *zi = z + i;
    const Real dx = ((xi[1] - xi[0]) + (xi[o3] - xi[o2])) + ((xi[o5] - xi[o4]) + (xi[o7] - xi[o6]));
    const Real dy = ((yi[o2] - yi[0]) + (yi[o3] - yi[1])) + ((yi[o6] - yi[o4]) + (yi[o7] - yi[o5]));
    const Real dz = ((zi[o4] - zi[0]) + (zi[o5] - zi[1])) + ((zi[o6] - zi[o2]) + (zi[o7] - zi[o3]));
    out[i] = area * (dx + dy + dz) - (has_source ? volume * source[i] : Real(0));
  }
}
EFSI_KERNEL void flux_row(int n, Real area, const std::size_t* o, const Real* x, const Real* y, const Real* z,
                          Real volume, const Real* source, Real* out) {
  if (source)
    flux_row<true>(n, area, o, x, y, z, volume, source, out);
  else
    flux_row<false>(n, area, o, x, y, z, volume, source, out);
}

}  // namespace

void compute_flux(const Parallel& parallel, const Grid& g, const VectorField& velocity, const std::vector<Real>& source,
                  std::vector<Real>& flux) {
  const auto o = grid::corner_offsets(g);
  const Real area = static_cast<Real>(0.25 * g.h * g.h), volume = static_cast<Real>(g.h * g.h * g.h);
  flux.resize(g.padded_count());
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j) {
      const std::size_t n = g.node(0, j, k), cells = g.padded(0, j, k);
      flux_row(g.cells[0], area, o.data(), velocity.c[0].data() + n, velocity.c[1].data() + n, velocity.c[2].data() + n,
               volume, source.empty() ? nullptr : source.data() + cells, flux.data() + cells);
    }
  });
}

Vec3 pressure_impulse(const Grid& g, const std::vector<Real>& q, int i, int j, int k) {
  const Real area = static_cast<Real>(g.h * g.h / 4.0);
  Vec3 sum = Vec3::Zero();
  for (const auto& corner : grid::kCorner) {
    const Real p = q[g.padded(i - corner[0], j - corner[1], k - corner[2])];
    for (int a = 0; a < 3; ++a) sum[a] += corner[a] ? p : -p;
  }
  return area * sum;
}

void subtract_pressure_gradient(const Parallel& parallel, const PressureLevel& level, const std::vector<Real>& q,
                                VectorField& velocity) {
  const Grid& g = level.grid;
  const Real scale = static_cast<Real>(4.0 / (g.h * g.h));  // mobility holds (h^2/4)^2, a velocity needs h^2/4
  parallel.for_ranges(g.cells[2] + 1, [&](std::int64_t begin, std::int64_t end) {
    Sweep sweep(level);
    for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
      for (int j = 0; j <= g.cells[1]; ++j) {
        const GradientRow& gradient = sweep.gradient(q.data(), j, k);
        const std::size_t n = g.node(0, j, k);
        const std::vector<Real>* rows[3] = {&gradient.x, &gradient.y, &gradient.z};
        for (std::size_t c = 0; c < 3; ++c) {
          Real* v = velocity.c[c].data() + n;
          add_row(g.cells[0] + 1, v, scale, rows[c]->data(), v);
        }
      }
  });
}

}  // namespace efsi::system
