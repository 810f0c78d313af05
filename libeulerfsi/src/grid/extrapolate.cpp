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

using Doubles = double __attribute__((vector_size(8 * sizeof(double))));
using Lanes = decltype(Octet{} < Octet{});

// The box around a node as rows along x of 7 nodes; lane i of a row lies at x = i - 3, lane 7 is not used. Which lanes
// of a row hold data is a mask of 7 bits.
struct Row {
  std::ptrdiff_t lead;  // from the node to lane 0
  int y, z, distance;   // distance: y^2 + z^2
};

struct Box {
  std::array<Row, kRows> rows;
  // By distance of the row: 1/r^4 per lane; and sum of w, w x, w x^2 over the lanes of each mask.
  double weight[2 * kRadius * kRadius + 1][8] = {};
  double moment[2 * kRadius * kRadius + 1][kMasks][3] = {};

  explicit Box(const Grid& g) {
    std::size_t r = 0;
    for (int z = -kRadius; z <= kRadius; ++z)
      for (int y = -kRadius; y <= kRadius; ++y)
        rows[r++] = {static_cast<std::ptrdiff_t>(g.node_stride(1)) * y +
                         static_cast<std::ptrdiff_t>(g.node_stride(2)) * z - kRadius,
                     y, z, y * y + z * z};
    for (const Row& row : rows) {
      if (row.y < 0 || row.z < row.y) continue;  // one row of each distance
      double* w = weight[row.distance];
      for (int i = 0; i < kWidth; ++i) {
        const int r2 = row.distance + (i - kRadius) * (i - kRadius);
        w[i] = r2 == 0 ? 0.0 : static_cast<double>(static_cast<Real>(1.0 / (static_cast<double>(r2) * r2)));
      }
      for (int mask = 0; mask < kMasks; ++mask)
        for (int i = 0; i < kWidth; ++i)
          if (mask >> i & 1)
            for (int p = 0, x = 1; p < 3; ++p, x *= i - kRadius) moment[row.distance][mask][p] += w[i] * x;
    }
  }
};

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

// Fits the fields at nodes [begin, end) of layer l.
EFSI_KERNEL void extend_nodes(const Box& box, const Vec3i& n, const std::array<int, 3>* begin,
                              const std::array<int, 3>* end, int l, const std::uint8_t* layer,
                              std::span<Real* const> fields) {
  constexpr Lanes bit = {1, 2, 4, 8, 16, 32, 64, 0};
  constexpr Doubles position = {-3, -2, -1, 0, 1, 2, 3, 4};
  struct Live {
    std::ptrdiff_t source;
    unsigned mask;
    Doubles weight;
  };
  std::array<Live, kRows> live;
  std::array<int, kRows> index;
  for (const std::array<int, 3>* p = begin; p < end; ++p) {
    const auto [i, j, k] = *p;
    const std::ptrdiff_t target = i + std::ptrdiff_t{n[0]} * (j + std::ptrdiff_t{n[1]} * k);
    // Lane 7 reaches one node further.
    const bool inside = i >= kRadius && j >= kRadius && k >= kRadius && i + kRadius + 1 < n[0] && j + kRadius < n[1] &&
                        k + kRadius < n[2];
    std::size_t count = 0;
    double s[10] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    for (int r = 0; r < kRows; ++r) {
      const Row& row = box.rows[static_cast<std::size_t>(r)];
      unsigned mask = 0;
      if (inside) {
        mask = data_mask(layer + target + row.lead, l);
      } else if (j + row.y >= 0 && j + row.y < n[1] && k + row.z >= 0 && k + row.z < n[2]) {
        for (int lane = 0; lane < kWidth; ++lane) {
          const int x = i + lane - kRadius;
          if (x >= 0 && x < n[0] && layer[target + row.lead + lane] < l) mask |= 1u << lane;
        }
      }
      if (mask == 0) continue;
      index[count] = r;
      live[count].source = target + row.lead;
      live[count++].mask = mask;
      const double* m = box.moment[row.distance][mask];
      const double y = row.y, z = row.z;
      s[0] += m[0];
      s[1] += m[1];
      s[2] += m[0] * y;
      s[3] += m[0] * z;
      s[4] += m[2];
      s[5] += m[0] * (y * y);
      s[6] += m[0] * (z * z);
      s[7] += m[0] * (y * z);
      s[8] += m[1] * z;
      s[9] += m[1] * y;
    }
    double c[4];
    evaluation_row(s, c);
    for (std::size_t q = 0; q < count; ++q) {
      const Row& row = box.rows[static_cast<std::size_t>(index[q])];
      Doubles w;
      std::memcpy(&w, box.weight[row.distance], sizeof w);
      live[q].weight = w * (c[1] * position + (c[0] + c[2] * row.y + c[3] * row.z));
    }
    for (Real* field : fields) {
      Doubles sum = {0, 0, 0, 0, 0, 0, 0, 0};
      for (std::size_t q = 0; q < count; ++q) {
        const Real* source = field + live[q].source;
        const Lanes data = (static_cast<int>(live[q].mask) & bit) != 0;
        Octet value = {0, 0, 0, 0, 0, 0, 0, 0};
        if (inside) {
          value = data ? load_octet(source) : value;
        } else {
          for (int lane = 0; lane < kWidth; ++lane)
            if (data[lane]) value[lane] = source[lane];
        }
        sum += live[q].weight * __builtin_convertvector(value, Doubles);
      }
      field[target] = static_cast<Real>(((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + sum[3]));
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
  const Box box(g);
  const Vec3i n = g.nodes();
  std::vector<std::array<int, 3>> next;
  std::vector<std::uint8_t> reached(layer.size()), scratch(layer.size());
  for (std::size_t m = 0; m < layer.size(); ++m) reached[m] = layer[m] == 0;
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
    parallel.for_ranges(static_cast<std::int64_t>(next.size()), [&](std::int64_t begin, std::int64_t end) {
      extend_nodes(box, n, next.data() + begin, next.data() + end, l, layer.data(), fields);
    });
  }
}

}  // namespace efsi::grid
