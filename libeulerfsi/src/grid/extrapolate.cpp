#include "grid/extrapolate.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "grid/packed_field.hpp"

namespace efsi::grid {
namespace {

constexpr int kRadius = 3;
constexpr int kWidth = 2 * kRadius + 1;
constexpr int kRows = kWidth * kWidth;
constexpr std::size_t kAtOnce = 3;         // fields
constexpr Real kLeastWeight = Real(0.01);  // of data

using Lanes = double __attribute__((vector_size(8 * sizeof(double))));  // a row

// What the data of each node weigh, 0 without data, with a margin of zeros around them, wide enough for the box.
class PaddedWeights {
 public:
  explicit PaddedWeights(const Vec3i& n)
      : stride_{1, n[0] + 2 * kRadius + 1, std::ptrdiff_t{n[0] + 2 * kRadius + 1} * (n[1] + 2 * kRadius)},
        values_(static_cast<std::size_t>(stride_[2] * (n[2] + 2 * kRadius)), 0) {}
  std::ptrdiff_t stride(std::size_t axis) const { return stride_[axis]; }
  Real& at(int i, int j, int k) { return values_[static_cast<std::size_t>(index(i, j, k))]; }
  const Real* around(int i, int j, int k) const { return values_.data() + index(i, j, k); }

 private:
  std::ptrdiff_t index(int i, int j, int k) const {
    return i + kRadius + stride_[1] * (j + kRadius) + stride_[2] * (k + kRadius);
  }
  std::array<std::ptrdiff_t, 3> stride_;
  std::vector<Real> values_;
};

// The box around a node as rows along x of 7 nodes; lane i of a row lies at x = i - 3, lane 7 is not used.
struct Row {
  std::ptrdiff_t lead;         // from the node to lane 0
  std::ptrdiff_t weight_lead;  // the same in the padded weights
  double y, z;
  Lanes near;  // 1/r^4
};

struct Box {
  std::array<Row, kRows> rows;

  Box(const Grid& g, const PaddedWeights& weights) {
    std::size_t r = 0;
    for (int z = -kRadius; z <= kRadius; ++z)
      for (int y = -kRadius; y <= kRadius; ++y) {
        Row& row = rows[r++];
        row = {static_cast<std::ptrdiff_t>(g.node_stride(1)) * y + static_cast<std::ptrdiff_t>(g.node_stride(2)) * z -
                   kRadius,
               weights.stride(1) * y + weights.stride(2) * z - kRadius, 1.0 * y, 1.0 * z, Lanes{}};
        for (int x = -kRadius; x <= kRadius; ++x) {
          const double r2 = x * x + y * y + z * z;
          if (r2 > 0) row.near[x + kRadius] = 1.0 / (r2 * r2);
        }
      }
  }
};

EFSI_INLINE Lanes load_lanes(const Real* p) { return __builtin_convertvector(load_octet(p), Lanes); }

// Whether any of the 8 numbers, none of them negative, is not 0.
EFSI_INLINE bool any_positive(const Real* p) {
  const Octet eight = load_octet(p);
  Real sum = 0;
  for (int i = 0; i < 8; ++i) sum += eight[i];
  return sum > 0;
}

EFSI_INLINE double sum_of(const Lanes& v) { return ((v[0] + v[4]) + (v[1] + v[5])) + ((v[2] + v[6]) + (v[3] + v[7])); }

// The row of a least-squares fit that gives the value at the target: sum_j w_j (c0 + c.d_j) f_j = w_j (1/s + a.(d_j -
// m)) with the mean m of d and a = -C^-1 m, C the second moments about the mean. Falls back to the weighted mean where
// the data do not determine a gradient. s: sums of w, wx, wy, wz, wxx, wyy, wzz, wyz, wzx, wxy.
EFSI_INLINE void evaluation_row(const double s[10], double c[4]) {
  const double x = s[1] / s[0], y = s[2] / s[0], z = s[3] / s[0];
  const double xx = s[4] - s[1] * x, yy = s[5] - s[2] * y, zz = s[6] - s[3] * z;
  const double yz = s[7] - s[2] * z, zx = s[8] - s[3] * x, xy = s[9] - s[1] * y;
  const double i_xx = yy * zz - yz * yz, i_yy = zz * xx - zx * zx, i_zz = xx * yy - xy * xy;
  const double i_yz = zx * xy - yz * xx, i_zx = xy * yz - zx * yy, i_xy = yz * zx - xy * zz;
  const double det = xx * i_xx + xy * i_xy + zx * i_zx, trace = xx + yy + zz;
  const bool determined = det > 1e-10 * trace * trace * trace;
  const double scale = determined ? -1.0 / det : 0.0;
  c[1] = scale * (i_xx * x + i_xy * y + i_zx * z);
  c[2] = scale * (i_xy * x + i_yy * y + i_yz * z);
  c[3] = scale * (i_zx * x + i_yz * y + i_zz * z);
  c[0] = 1.0 / s[0] - (c[1] * x + c[2] * y + c[3] * z);
}

// Fits the fields at nodes [begin, end); result: the fields of each node, side by side. Lanes without data are read
// too, with weight 0, so nobody may write the fields meanwhile.
EFSI_KERNEL void extend_nodes(const Box& box, const Grid& g, const std::array<int, 3>* begin,
                              const std::array<int, 3>* end, const PaddedWeights& weights,
                              std::span<Real* const> fields, Real* result) {
  constexpr Lanes along = {-3, -2, -1, 0, 1, 2, 3, 4};
  struct Live {
    const Row* row;
    Lanes weights;
  };
  std::array<Live, kRows> live;
  const auto nodes = static_cast<std::ptrdiff_t>(g.node_count());
  for (const std::array<int, 3>* p = begin; p < end; ++p) {
    const auto target = static_cast<std::ptrdiff_t>(g.node((*p)[0], (*p)[1], (*p)[2]));
    const Real* around = weights.around((*p)[0], (*p)[1], (*p)[2]);
    // Rows with data around the node, and the moments of their weights.
    std::size_t count = 0;
    bool whole_rows = true;  // all lanes of the rows, also those without data, are in the arrays
    Lanes one = {}, y = one, z = one, yy = one, zz = one, yz = one;  // sums of w, w y, ... per lane
    for (const Row& row : box.rows) {
      if (!any_positive(around + row.weight_lead)) continue;
      const std::ptrdiff_t source = target + row.lead;
      whole_rows = whole_rows && source >= 0 && source + 8 <= nodes;
      const Lanes w = row.near * load_lanes(around + row.weight_lead);
      one += w;
      y += row.y * w;
      z += row.z * w;
      yy += row.y * row.y * w;
      zz += row.z * row.z * w;
      yz += row.y * row.z * w;
      live[count++] = {&row, w};
    }
    const double s[10] = {sum_of(one), sum_of(one * along), sum_of(y),  sum_of(z),         sum_of(one * along * along),
                          sum_of(yy),  sum_of(zz),          sum_of(yz), sum_of(z * along), sum_of(y * along)};
    // Weights by which the fit is evaluated at the node.
    double c[4];
    evaluation_row(s, c);
    for (std::size_t q = 0; q < count; ++q)
      live[q].weights *= c[1] * along + (c[0] + c[2] * live[q].row->y + c[3] * live[q].row->z);
    // The weighted sums, several fields at once.
    for (std::size_t first = 0; first < fields.size(); first += kAtOnce) {
      const std::size_t some = std::min(kAtOnce, fields.size() - first);
      const Real* source[kAtOnce];
      for (std::size_t f = 0; f < kAtOnce; ++f) source[f] = fields[first + std::min(f, some - 1)] + target;
      Lanes sums[kAtOnce] = {};
      if (whole_rows) {
        for (std::size_t q = 0; q < count; ++q) {
          const Lanes w = live[q].weights;
          const std::ptrdiff_t lead = live[q].row->lead;
#pragma GCC unroll 3
          for (std::size_t f = 0; f < kAtOnce; ++f) sums[f] += w * load_lanes(source[f] + lead);
        }
      } else {
        for (std::size_t q = 0; q < count; ++q)
          for (int lane = 0; lane < kWidth; ++lane)
            if (live[q].weights[lane] != 0.0)
              for (std::size_t f = 0; f < some; ++f)
                sums[f][lane] += live[q].weights[lane] * static_cast<double>(source[f][live[q].row->lead + lane]);
      }
      for (std::size_t f = 0; f < some; ++f) *result++ = static_cast<Real>(sum_of(sums[f]));
    }
  }
}

// Whether a node or one of its 26 neighbours is set.
void dilate(const Vec3i& n, std::vector<std::uint8_t>& set, std::vector<std::uint8_t>& old) {
  const std::size_t stride[3] = {1, static_cast<std::size_t>(n[0]),
                                 static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1])};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::swap(set, old);
    const std::size_t s = stride[axis], length = static_cast<std::size_t>(n[axis]) * s;
    for (std::size_t line = 0; line < old.size(); line += length) {
      const std::uint8_t* from = old.data() + line;
      std::uint8_t* to = set.data() + line;
      std::copy_n(from, s, to);
#pragma omp simd
      for (std::size_t q = s; q < length; ++q) to[q] = from[q] | from[q - s];
#pragma omp simd
      for (std::size_t q = 0; q < length - s; ++q) to[q] |= from[q + s];
    }
  }
}

}  // namespace

void extend_linear(const Parallel& parallel, const Grid& g, int layers, std::vector<std::uint8_t>& layer,
                   std::span<Real* const> fields, const DataWeights& data) {
  const Vec3i n = g.nodes();
  PaddedWeights weights(n);
  const Box box(g, weights);
  std::vector<std::array<int, 3>> next;
  std::vector<Real> result;
  std::vector<std::uint8_t> reached(layer.size()), scratch(layer.size());
  // Weights of the data.
  for (std::size_t m = 0; m < layer.size(); ++m) reached[m] = layer[m] == 0;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i) {
        const std::size_t m = g.node(i, j, k);
        if (reached[m])
          weights.at(i, j, k) =
              data.node.empty() ? Real(1) : std::clamp(data.node[m] / data.whole, kLeastWeight, Real(1));
      }
  // Layer by layer: its nodes, their values, then both become data.
  for (int l = 1; l <= layers; ++l) {
    dilate(n, reached, scratch);
    next.clear();
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i) {
          const std::size_t m = g.node(i, j, k);
          if (!reached[m] || layer[m] != kNoLayer) continue;
          layer[m] = static_cast<std::uint8_t>(l);
          next.push_back({i, j, k});
        }
    result.resize(next.size() * fields.size());
    parallel.for_ranges(static_cast<std::int64_t>(next.size()), [&](std::int64_t begin, std::int64_t end) {
      extend_nodes(box, g, next.data() + begin, next.data() + end, weights, fields,
                   result.data() + static_cast<std::size_t>(begin) * fields.size());
    });
    parallel.for_each(static_cast<std::int64_t>(next.size()), [&](std::int64_t t) {
      const auto& p = next[static_cast<std::size_t>(t)];
      weights.at(p[0], p[1], p[2]) = 1;
      for (std::size_t f = 0; f < fields.size(); ++f)
        fields[f][g.node(p[0], p[1], p[2])] = result[static_cast<std::size_t>(t) * fields.size() + f];
    });
  }
}

}  // namespace efsi::grid
