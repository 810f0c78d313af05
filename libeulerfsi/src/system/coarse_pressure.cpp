#include "system/coarse_pressure.hpp"

#include "base/kernel.hpp"

namespace efsi::system {
namespace {

// A row of cells and its neighbours.
struct Row {
  const Real *x, *back, *front, *below, *above;  // x of the row and of those beside it along y and z
  const Real *fx, *fy, *fy_front, *fz, *fz_above, *diagonal;
};

Row row_of(const CoarsePressureLevel& level, const std::vector<Real>& x, int j, int k) {
  const Grid& g = level.grid;
  const std::size_t c = g.padded(0, j, k), y = g.padded(0, 1, 0) - g.padded(0, 0, 0),
                    z = g.padded(0, 0, 1) - g.padded(0, 0, 0);
  const Real *v = x.data() + c, *fy = level.face[1].data() + c, *fz = level.face[2].data() + c;
  return {v,
          v - y,
          v + y,
          v - z,
          v + z,
          level.face[0].data() + c,
          fy,
          fy + y,
          fz,
          fz + z,
          level.inverse_diagonal.data() + c};
}

// b - A x at entry i.
EFSI_INLINE Real left_at(const Row& r, const Real* b, int i) {
  const Real along_x = r.fx[i + 1] * (r.x[i + 1] - r.x[i]) + r.fx[i] * (r.x[i - 1] - r.x[i]);
  const Real along_y = r.fy_front[i] * (r.front[i] - r.x[i]) + r.fy[i] * (r.back[i] - r.x[i]);
  const Real along_z = r.fz_above[i] * (r.above[i] - r.x[i]) + r.fz[i] * (r.below[i] - r.x[i]);
  return b[i] + ((along_x + along_y) + along_z);
}

EFSI_KERNEL void residual_row(int n, const Row& row, const Real* b, Real* out) {
  const Row r = row;
#pragma omp simd
  for (int i = 0; i < n; ++i) out[i] = r.diagonal[i] > 0 ? left_at(r, b, i) : Real(0);
}

EFSI_KERNEL void smooth_row(int n, const Row& row, const Real* b, Real weight, Real* out) {
  const Row r = row;
#pragma omp simd
  for (int i = 0; i < n; ++i) out[i] = r.x[i] + weight * r.diagonal[i] * left_at(r, b, i);
}

// Calls body(j, k) for every row of cells.
template <class Body>
void for_rows(const Parallel& parallel, const Grid& g, const Body& body) {
  parallel.for_each(g.cells[2], [&](std::int64_t k) {
    for (int j = 0; j < g.cells[1]; ++j) body(j, static_cast<int>(k));
  });
}

// factor times the sum of four rows.
EFSI_KERNEL void sum_row(int n, Real factor, const Real* a, const Real* b, const Real* c, const Real* d, Real* out) {
#pragma omp simd
  for (int i = 0; i < n; ++i) out[i] = factor * ((a[i] + b[i]) + (c[i] + d[i]));
}

// 1 / sum of the faces; 0 where that is 0.
EFSI_KERNEL void inverse_diagonal_row(int n, const Row& row, Real* out) {
  const Row r = row;
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const Real sum = ((r.fx[i] + r.fx[i + 1]) + (r.fy[i] + r.fy_front[i])) + (r.fz[i] + r.fz_above[i]);
    out[i] = sum > 0 ? 1 / sum : Real(0);
  }
}

// What a face number `index` along its axis counts: the pressure outside an open wall stands on the face.
Real face_weight(const CoarsePressureLevel& level, int axis, int index) {
  const auto a = static_cast<std::size_t>(axis);
  const int n = level.grid.cells[a];
  if (level.grid.periodic[a] || (index > 0 && index < n)) return 1;
  const bool blocked = Walls::blocks(index == 0 ? level.walls.lower(axis) : level.walls.upper(axis));
  return blocked ? Real(0) : static_cast<Real>(1.0 / (level.outer[a] - 0.5));
}

// What cell number `index` along an axis has of the length h.
Real cell_length(const CoarsePressureLevel& level, int axis, int index) {
  const auto a = static_cast<std::size_t>(axis);
  return index > 0 && index + 1 < level.grid.cells[a] ? Real(1) : static_cast<Real>(level.outer[a]);
}

void set_faces(const Parallel& parallel, const std::vector<Real>& specific_volume, int axis,
               CoarsePressureLevel& level) {
  const Grid& g = level.grid;
  const auto a = static_cast<std::size_t>(axis), b = (a + 1) % 3, c = (a + 2) % 3;
  std::vector<Real>& face = level.face[a];
  face.resize(g.padded_count(), 0);
  Vec3i faces = g.cells;
  ++faces[a];
  const std::size_t along_b = g.node_stride(static_cast<int>(b)), along_c = g.node_stride(static_cast<int>(c));
  const auto weight = [&](int along, int index) {
    return along == axis ? face_weight(level, along, index) : cell_length(level, along, index);
  };
  parallel.for_each(faces[2], [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j < faces[1]; ++j) {
      const Real* low = specific_volume.data() + g.node(0, j, k);
      Real* out = face.data() + g.padded(0, j, k);
      sum_row(faces[0], weight(1, j) * weight(2, k) * static_cast<Real>(g.h / 4.0), low, low + along_b, low + along_c,
              low + along_b + along_c, out);
      out[0] *= weight(0, 0);
      if (faces[0] > 1) out[faces[0] - 1] *= weight(0, faces[0] - 1);
    }
  });
}

}  // namespace

void build_coarse_pressure(const Parallel& parallel, const std::vector<Real>& specific_volume,
                           CoarsePressureLevel& level) {
  for (int axis = 0; axis < 3; ++axis) set_faces(parallel, specific_volume, axis, level);
  const Grid& g = level.grid;
  level.inverse_diagonal.resize(g.padded_count(), 0);
  for_rows(parallel, g, [&](int j, int k) {
    const std::size_t first = g.padded(0, j, k);
    inverse_diagonal_row(g.cells[0], row_of(level, level.inverse_diagonal, j, k), &level.inverse_diagonal[first]);
    if (level.active.empty()) return;
    for (std::size_t c = first; c < first + static_cast<std::size_t>(g.cells[0]); ++c)
      if (!level.active[c]) level.inverse_diagonal[c] = 0;
  });
}

void coarse_residual(const Parallel& parallel, const CoarsePressureLevel& level, const std::vector<Real>& b,
                     const std::vector<Real>& x, std::vector<Real>& r) {
  for_rows(parallel, level.grid, [&](int j, int k) {
    const std::size_t first = level.grid.padded(0, j, k);
    residual_row(level.grid.cells[0], row_of(level, x, j, k), b.data() + first, r.data() + first);
  });
}

void smooth_coarse(const Parallel& parallel, const CoarsePressureLevel& level, const std::vector<Real>& b, Real weight,
                   const std::vector<Real>& x, std::vector<Real>& y) {
  for_rows(parallel, level.grid, [&](int j, int k) {
    const std::size_t first = level.grid.padded(0, j, k);
    smooth_row(level.grid.cells[0], row_of(level, x, j, k), b.data() + first, weight, y.data() + first);
  });
}

}  // namespace efsi::system
