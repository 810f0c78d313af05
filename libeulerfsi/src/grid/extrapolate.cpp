#include "grid/extrapolate.hpp"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "grid/packed_field.hpp"

namespace efsi::grid {
namespace {

constexpr int kRadius = 3;
constexpr int kWidth = 2 * kRadius + 1;
constexpr int kRows = kWidth * kWidth;
constexpr int kMasks = 1 << kWidth;
constexpr std::size_t kAtOnce = 3;  // fields

using Doubles = double __attribute__((vector_size(4 * sizeof(double))));
using Lanes = double __attribute__((vector_size(8 * sizeof(double))));  // a row

// The layers with a margin of kNoLayer around them, wide enough for the box.
class PaddedLayers {
 public:
  explicit PaddedLayers(const Vec3i& n)
      : stride_{1, n[0] + 2 * kRadius + 1, std::ptrdiff_t{n[0] + 2 * kRadius + 1} * (n[1] + 2 * kRadius)},
        values_(static_cast<std::size_t>(stride_[2] * (n[2] + 2 * kRadius)), kNoLayer) {}
  std::ptrdiff_t stride(std::size_t axis) const { return stride_[axis]; }
  std::ptrdiff_t index(int i, int j, int k) const {
    return i + kRadius + stride_[1] * (j + kRadius) + stride_[2] * (k + kRadius);
  }
  std::uint8_t* data() { return values_.data(); }
  const std::uint8_t* data() const { return values_.data(); }

 private:
  std::array<std::ptrdiff_t, 3> stride_;
  std::vector<std::uint8_t> values_;
};

// The box around a node as rows along x of 7 nodes; lane i of a row lies at x = i - 3, lane 7 is not used. Which lanes
// of a row hold data is a mask of 7 bits.
struct Row {
  std::ptrdiff_t lead;        // from the node to lane 0
  std::ptrdiff_t layer_lead;  // the same in the padded layers
  int y, z, distance;         // distance: y^2 + z^2
  Doubles linear, quadratic;  // 1, y, z, y^2 and z^2, y z, 0, 0
};

struct Box {
  std::array<Row, kRows> rows;
  // By distance of the row and mask: 1/r^4 per lane that holds data; and the sums of w, w x, w x^2.
  Lanes lane_weight[2 * kRadius * kRadius + 1][kMasks] = {};
  double moment[2 * kRadius * kRadius + 1][kMasks][3] = {};

  Box(const Grid& g, const PaddedLayers& layers) {
    std::size_t r = 0;
    for (int z = -kRadius; z <= kRadius; ++z)
      for (int y = -kRadius; y <= kRadius; ++y)
        rows[r++] = {static_cast<std::ptrdiff_t>(g.node_stride(1)) * y +
                         static_cast<std::ptrdiff_t>(g.node_stride(2)) * z - kRadius,
                     layers.stride(1) * y + layers.stride(2) * z - kRadius,
                     y,
                     z,
                     y * y + z * z,
                     Doubles{1, 1.0 * y, 1.0 * z, 1.0 * y * y},
                     Doubles{1.0 * z * z, 1.0 * y * z, 0, 0}};
    for (const Row& row : rows) {
      if (row.y < 0 || row.z < row.y) continue;  // one row of each distance
      for (int mask = 0; mask < kMasks; ++mask)
        for (int i = 0; i < kWidth; ++i) {
          const int r2 = row.distance + (i - kRadius) * (i - kRadius);
          if (r2 == 0 || !(mask >> i & 1)) continue;
          const double w = 1.0 / (static_cast<double>(r2) * r2);
          lane_weight[row.distance][mask][i] = w;
          for (int p = 0, x = 1; p < 3; ++p, x *= i - kRadius) moment[row.distance][mask][p] += w * x;
        }
    }
  }
};

EFSI_INLINE Lanes load_lanes(const Real* p) { return __builtin_convertvector(load_octet(p), Lanes); }

// Lanes of a row whose layer is below l; reads 8 bytes.
EFSI_INLINE unsigned data_mask(const std::uint8_t* row, int l) {
  static_assert(std::endian::native == std::endian::little);
  constexpr std::uint64_t ones = 0x0101010101010101u, high = 0x80u * ones;
  std::uint64_t bytes;
  std::memcpy(&bytes, row, sizeof bytes);
  // The high bit of a byte is set where its layer (the last one counts as 127) is l or more.
  const std::uint64_t above = (bytes & ~high) + (0x80u - static_cast<unsigned>(l)) * ones;
  return static_cast<unsigned>(((~above & high) >> 7) * 0x0102040810204080u >> 56) & (kMasks - 1);
}

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

// Fits the fields at nodes [begin, end) of layer l; result: the fields of each node, side by side. Lanes without data
// are read too, with weight 0, so nobody may write the fields meanwhile.
EFSI_KERNEL void extend_nodes(const Box& box, const Grid& g, const std::array<int, 3>* begin,
                              const std::array<int, 3>* end, int l, const PaddedLayers& layers,
                              std::span<Real* const> fields, Real* result) {
  constexpr Lanes along = {-3, -2, -1, 0, 1, 2, 3, 4};
  struct Live {
    const Row* row;
    unsigned mask;
    Lanes weights;
  };
  std::array<Live, kRows> live;
  const auto nodes = static_cast<std::ptrdiff_t>(g.node_count());
  for (const std::array<int, 3>* p = begin; p < end; ++p) {
    const auto target = static_cast<std::ptrdiff_t>(g.node((*p)[0], (*p)[1], (*p)[2]));
    const std::uint8_t* layer = layers.data() + layers.index((*p)[0], (*p)[1], (*p)[2]);
    std::size_t count = 0;
    bool whole_rows = true;  // all lanes of the rows, also those without data, are in the arrays
    Doubles sum_linear = {0, 0, 0, 0}, sum_quadratic = sum_linear, sum_x = sum_linear;
    double sum_xx = 0.0;
    for (const Row& row : box.rows) {
      const unsigned mask = data_mask(layer + row.layer_lead, l);
      if (mask == 0) continue;
      const std::ptrdiff_t source = target + row.lead;
      whole_rows = whole_rows && source >= 0 && source + 8 <= nodes;
      live[count].row = &row;
      live[count++].mask = mask;
      const double* m = box.moment[row.distance][mask];
      sum_linear += m[0] * row.linear;
      sum_quadratic += m[0] * row.quadratic;
      sum_x += m[1] * row.linear;
      sum_xx += m[2];
    }
    const double s[10] = {sum_linear[0], sum_x[0],         sum_linear[1],    sum_linear[2], sum_xx,
                          sum_linear[3], sum_quadratic[0], sum_quadratic[1], sum_x[2],      sum_x[1]};
    double c[4];
    evaluation_row(s, c);
    for (std::size_t q = 0; q < count; ++q) {
      const Row& row = *live[q].row;
      const double base = c[0] + c[2] * row.linear[1] + c[3] * row.linear[2];
      live[q].weights = box.lane_weight[row.distance][live[q].mask] * (c[1] * along + base);
    }
    for (std::size_t first = 0; first < fields.size(); first += kAtOnce) {
      const std::size_t some = std::min(kAtOnce, fields.size() - first);
      const Real* source[kAtOnce];
      for (std::size_t f = 0; f < kAtOnce; ++f) source[f] = fields[first + std::min(f, some - 1)] + target;
      Lanes sums[kAtOnce] = {};
      if (whole_rows) {
        for (std::size_t q = 0; q < count; ++q) {
          const Lanes weights = live[q].weights;
          const std::ptrdiff_t lead = live[q].row->lead;
#pragma GCC unroll 3
          for (std::size_t f = 0; f < kAtOnce; ++f) sums[f] += weights * load_lanes(source[f] + lead);
        }
      } else {
        for (std::size_t q = 0; q < count; ++q)
          for (int lane = 0; lane < kWidth; ++lane)
            if (live[q].mask >> lane & 1)
              for (std::size_t f = 0; f < some; ++f)
                sums[f][lane] += live[q].weights[lane] * static_cast<double>(source[f][live[q].row->lead + lane]);
      }
      for (std::size_t f = 0; f < some; ++f) {
        const Lanes& sum = sums[f];
        *result++ =
            static_cast<Real>(((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7])));
      }
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
                   std::span<Real* const> fields) {
  const Vec3i n = g.nodes();
  PaddedLayers padded(n);
  const Box box(g, padded);
  std::vector<std::array<int, 3>> next;
  std::vector<Real> result;
  std::vector<std::uint8_t> reached(layer.size()), scratch(layer.size());
  for (std::size_t m = 0; m < layer.size(); ++m) reached[m] = layer[m] == 0;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      std::copy_n(layer.data() + g.node(0, j, k), n[0], padded.data() + padded.index(0, j, k));
  for (int l = 1; l <= layers; ++l) {
    dilate(n, reached, scratch);
    next.clear();
    for (int k = 0; k < n[2]; ++k)
      for (int j = 0; j < n[1]; ++j)
        for (int i = 0; i < n[0]; ++i) {
          const std::size_t m = g.node(i, j, k);
          if (!reached[m] || layer[m] != kNoLayer) continue;
          layer[m] = padded.data()[padded.index(i, j, k)] = static_cast<std::uint8_t>(l);
          next.push_back({i, j, k});
        }
    result.resize(next.size() * fields.size());
    parallel.for_ranges(static_cast<std::int64_t>(next.size()), [&](std::int64_t begin, std::int64_t end) {
      extend_nodes(box, g, next.data() + begin, next.data() + end, l, padded, fields,
                   result.data() + static_cast<std::size_t>(begin) * fields.size());
    });
    parallel.for_each(static_cast<std::int64_t>(next.size()), [&](std::int64_t t) {
      const auto& p = next[static_cast<std::size_t>(t)];
      for (std::size_t f = 0; f < fields.size(); ++f)
        fields[f][g.node(p[0], p[1], p[2])] = result[static_cast<std::size_t>(t) * fields.size() + f];
    });
  }
}

}  // namespace efsi::grid
