#include "grid/extrapolate.hpp"

#include <Eigen/Dense>
#include <array>
#include <cmath>

namespace efsi::grid {
namespace {

constexpr int kRadius = 3;

// Offsets of the box, their weights and where they lead.
struct Neighbour {
  int offset[3];
  Real d[3];
  Real weight;
};

std::vector<Neighbour> box_neighbours() {
  std::vector<Neighbour> box;
  for (int k = -kRadius; k <= kRadius; ++k)
    for (int j = -kRadius; j <= kRadius; ++j)
      for (int i = -kRadius; i <= kRadius; ++i) {
        const int r2 = i * i + j * j + k * k;
        if (r2 == 0) continue;
        box.push_back({{i, j, k},
                       {static_cast<Real>(i), static_cast<Real>(j), static_cast<Real>(k)},
                       static_cast<Real>(1.0 / (static_cast<double>(r2) * r2))});
      }
  return box;
}

// First row of the inverse of the 4x4 moment matrix: the fit's value at the target is sum_j w_j (m0 + m.d_j) f_j.
// Falls back to a weighted mean where the data do not determine a gradient.
Eigen::Vector4d evaluation_row(const double s[10]) {
  Eigen::Matrix4d m;
  m << s[0], s[1], s[2], s[3],  //
      s[1], s[4], s[9], s[8],   //
      s[2], s[9], s[5], s[7],   //
      s[3], s[8], s[7], s[6];
  const Eigen::LDLT<Eigen::Matrix4d> factor(m);
  const Eigen::Vector4d d = factor.vectorD();
  const Eigen::Vector4d mean(1.0 / s[0], 0.0, 0.0, 0.0);
  if (factor.info() != Eigen::Success || !(d.minCoeff() > 1e-3 * d.maxCoeff() * 1e-2)) return mean;
  return factor.solve(Eigen::Vector4d(1.0, 0.0, 0.0, 0.0));
}

}  // namespace

void extend_linear(const Parallel& parallel, const Grid& g, int layers, std::vector<std::uint8_t>& layer,
                   std::span<Real* const> fields) {
  const std::vector<Neighbour> box = box_neighbours();
  std::vector<std::ptrdiff_t> lead(box.size());
  for (std::size_t b = 0; b < box.size(); ++b)
    lead[b] = box[b].offset[0] + static_cast<std::ptrdiff_t>(g.node_stride(1)) * box[b].offset[1] +
              static_cast<std::ptrdiff_t>(g.node_stride(2)) * box[b].offset[2];
  const Vec3i n = g.nodes();
  std::vector<std::array<int, 3>> front, next;
  // Nodes of layer 0 that touch other nodes start the front; then each layer starts the next.
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i)
        if (layer[g.node(i, j, k)] == 0) front.push_back({i, j, k});
  for (int l = 1; l <= layers; ++l) {
    next.clear();
    for (const auto& p : front)
      for (int dk = -1; dk <= 1; ++dk)
        for (int dj = -1; dj <= 1; ++dj)
          for (int di = -1; di <= 1; ++di) {
            const int i = p[0] + di, j = p[1] + dj, k = p[2] + dk;
            if (i < 0 || j < 0 || k < 0 || i >= n[0] || j >= n[1] || k >= n[2]) continue;
            std::uint8_t& mark = layer[g.node(i, j, k)];
            if (mark != kNoLayer) continue;
            mark = static_cast<std::uint8_t>(l);
            next.push_back({i, j, k});
          }
    parallel.for_each(static_cast<std::int64_t>(next.size()), [&](std::int64_t t) {
      const auto& p = next[static_cast<std::size_t>(t)];
      const std::size_t target = g.node(p[0], p[1], p[2]);
      const bool inside = p[0] >= kRadius && p[1] >= kRadius && p[2] >= kRadius && p[0] + kRadius < n[0] &&
                          p[1] + kRadius < n[1] && p[2] + kRadius < n[2];
      std::array<std::uint16_t, (2 * kRadius + 1) * (2 * kRadius + 1) * (2 * kRadius + 1)> used;
      std::size_t count = 0;
      double s[10] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0};  // w, wx, wy, wz, wxx, wyy, wzz, wyz, wzx, wxy
      for (std::size_t b = 0; b < box.size(); ++b) {
        const Neighbour& q = box[b];
        if (!inside) {
          const int i = p[0] + q.offset[0], j = p[1] + q.offset[1], k = p[2] + q.offset[2];
          if (i < 0 || j < 0 || k < 0 || i >= n[0] || j >= n[1] || k >= n[2]) continue;
        }
        if (layer[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(target) + lead[b])] >= l) continue;
        used[count++] = static_cast<std::uint16_t>(b);
        const double w = static_cast<double>(q.weight), x = static_cast<double>(q.d[0]),
                     y = static_cast<double>(q.d[1]), z = static_cast<double>(q.d[2]);
        s[0] += w;
        s[1] += w * x;
        s[2] += w * y;
        s[3] += w * z;
        s[4] += w * x * x;
        s[5] += w * y * y;
        s[6] += w * z * z;
        s[7] += w * y * z;
        s[8] += w * z * x;
        s[9] += w * x * y;
      }
      const Eigen::Vector4d row = evaluation_row(s);
      std::array<double, 8> sum{};
      for (std::size_t c = 0; c < count; ++c) {
        const Neighbour& q = box[used[c]];
        const double weight = static_cast<double>(q.weight) *
                              (row[0] + row[1] * static_cast<double>(q.d[0]) + row[2] * static_cast<double>(q.d[1]) +
                               row[3] * static_cast<double>(q.d[2]));
        const auto source = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(target) + lead[used[c]]);
        for (std::size_t f = 0; f < fields.size(); ++f) sum[f] += weight * static_cast<double>(fields[f][source]);
      }
      for (std::size_t f = 0; f < fields.size(); ++f) fields[f][target] = static_cast<Real>(sum[f]);
    });
    std::swap(front, next);
  }
}

}  // namespace efsi::grid
