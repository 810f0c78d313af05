#include "solid/map/displacement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "grid/extrapolate.hpp"

namespace efsi::solid {

using grid::PackedField;
using grid::PackedSampler;
using grid::Quad;

void take_velocity(const Parallel& parallel, const Grid& global, double dt, const VectorField& velocity,
                   SolidState& state, SolidWork& work) {
  const Grid& g = state.band.grid;
  const Vec3i lo = grid::offset(g, global);
  work.layer.assign(g.node_count(), grid::kNoLayer);
  const bool keeps = dt > 0.0, pushed = work.force_velocity.size() > 0;
  if (keeps) state.change.assign(g.node_count());
  state.change_time = dt;
  work.max_speed = parallel.max(g.cells[2] + 1, 0.0, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    Real top = 0;
    for (int j = 0; j <= g.cells[1]; ++j) {
      const std::size_t row = g.node(0, j, k), from = global.node(lo[0], j + lo[1], k + lo[2]);
      for (std::size_t i = 0; i <= static_cast<std::size_t>(g.cells[0]); ++i) {
        if (!work.carries[row + i]) continue;
        work.layer[row + i] = 0;
        const Vec3 v = velocity.at(from + i);
        if (keeps)
          state.change.set(row + i,
                           v - state.v.at(row + i) + (pushed ? work.force_velocity.at(row + i) : Vec3(Vec3::Zero())));
        state.v.set(row + i, v);
        top = std::max(top, v.cwiseAbs().maxCoeff());
      }
    }
    return static_cast<double>(top);
  });
}

void extend(const Parallel& parallel, const SolidRest& rest, SolidState& state, SolidWork& work) {
  const Grid& g = state.band.grid;
  const bool changes = state.change.size() > 0;
  std::array<Real*, 9> fields;
  for (std::size_t a = 0; a < 3; ++a) {
    fields[a] = state.u.c[a].data();
    fields[3 + a] = state.v.c[a].data();
    if (changes) fields[6 + a] = state.change.c[a].data();
  }
  // Data that move little mass, at a thin tip or at the rim of cut elements, are noisy.
  const grid::DataWeights by_mass{work.mass, static_cast<Real>(rest.density * g.h * g.h * g.h)};
  grid::extend_linear(parallel, g, kExtensionLayers, work.layer,
                      {fields.data(), changes ? std::size_t{9} : std::size_t{6}},
                      rest.stiff_by_part ? by_mass : grid::DataWeights{});
}

namespace {

// A row of band nodes; node: index of its first.
struct Row {
  int j, k, count;
  std::size_t node;
};

EFSI_INLINE Quad position(const Row& row, int i) {
  return Quad{static_cast<Real>(i), static_cast<Real>(row.j), static_cast<Real>(row.k), 0};
}

// The marks of the 8 nodes around a place, two per number: combined by | or &; has_zero: whether a mark is 0, where
// none has its high bit set.
struct CornerMarks {
  std::uint16_t any, all;
  bool has_zero;
};
EFSI_INLINE CornerMarks combined(const std::uint16_t pair[4]) {
  unsigned counted = 0x8080;  // the high bit of a byte stays where no mark in it is 0
  for (std::size_t e = 0; e < 4; ++e) counted &= (pair[e] | 0x8080u) - 0x0101u;
  return {static_cast<std::uint16_t>(pair[0] | pair[1] | pair[2] | pair[3]),
          static_cast<std::uint16_t>(pair[0] & pair[1] & pair[2] & pair[3]), counted != 0x8080};
}
EFSI_INLINE CornerMarks corner_marks(const Vec3i& n, const std::uint8_t* mark, std::size_t node) {
  const std::size_t row = static_cast<std::size_t>(n[0]), slab = row * static_cast<std::size_t>(n[1]);
  std::uint16_t pair[4];
  for (std::size_t e = 0; e < 4; ++e) std::memcpy(pair + e, mark + node + (e & 1) * row + (e >> 1) * slab, 2);
  return combined(pair);
}

// A place this near to a node along an axis lies on it: which of the two cells rounding has chosen does not matter.
// False: there is no such axis.
EFSI_INLINE bool round_to_nodes(PackedSampler::Place& at) {
  const auto low = (at.part < grid::kBorder) & (at.part > -grid::kBorder),
             high = (at.part > 1 - grid::kBorder) & (at.part < 1 + grid::kBorder);
  const auto any = low | high;
  if ((any[0] | any[1] | any[2]) == 0) return false;
  at.part = low ? Quad{0, 0, 0, 0} : high ? Quad{1, 1, 1, 1} : at.part;
  return true;
}

// The same for such a place: nodes of which it takes nothing do not count.
CornerMarks rounded_marks(const Vec3i& n, const std::uint8_t* mark, const PackedSampler::Place& at) {
  const std::size_t row = static_cast<std::size_t>(n[0]), slab = row * static_cast<std::size_t>(n[1]);
  const auto step = [&](int axis, std::size_t end, std::size_t stride) {
    return end == 0 ? (at.part[axis] == 1 ? stride : 0) : (at.part[axis] == 0 ? 0 : stride);
  };
  std::uint16_t pair[4];
  for (std::size_t e = 0; e < 4; ++e) {
    const std::uint8_t* two = mark + at.node + step(1, e & 1, row) + step(2, e >> 1, slab);
    const std::uint8_t ends[2] = {two[at.part[0] == 1 ? 1 : 0], two[at.part[0] == 0 ? 0 : 1]};
    std::memcpy(pair + e, ends, 2);
  }
  return combined(pair);
}

// A motion of the frame over a step, in grid units: y -> c + s + R (y - c), or with an affine flow y + s + S (y - c).
class FrameMotion {
 public:
  FrameMotion(const Grid& g, const BodyStep& frame, double dt) : flows_(!frame.flow.at_rest()) {
    if (flows_) {
      follow(g, frame, dt);
      return;
    }
    // Where nothing turns the centre is of no account: what rests is to rest to the last bit.
    const bool turns = !(frame.turn.isZero(0) && frame.velocity.angular.isZero(0));
    if (turns) center_ = quad((frame.velocity.center - g.origin) / g.h);
    shift_ = quad(frame.shift / g.h);
    linear_ = quad(frame.velocity.linear * (dt / g.h));
    spin_ = quad(frame.velocity.angular * dt);
    const Mat3d r = rotation(frame.turn);
    for (int a = 0; a < 3; ++a) {
      column_[a] = quad(r.col(a));
      row_[a] = quad(r.row(a));
    }
  }
  EFSI_INLINE Quad forward(const Quad& y) const {
    return (flows_ ? y : center_) + shift_ + times(column_, y - center_);
  }
  EFSI_INLINE Quad back(const Quad& x) const {
    const Quad r = x - center_ - shift_;
    return (flows_ ? x - shift_ : center_) + times(row_, r);
  }
  // Cells per step.
  EFSI_INLINE Quad velocity(const Quad& x) const {
    const Quad r = x - center_;
    if (flows_) return linear_ + times(rate_, r);
    return linear_ + Quad{spin_[1] * r[2] - spin_[2] * r[1], spin_[2] * r[0] - spin_[0] * r[2],
                          spin_[0] * r[1] - spin_[1] * r[0], 0};
  }

 private:
  void follow(const Grid& g, const BodyStep& frame, double dt) {
    const AffineStep step = affine_step(frame.flow, dt);
    center_ = quad((frame.flow.anchor - g.origin) / g.h);
    shift_ = quad((step.shift + frame.shift) / g.h);
    linear_ = quad(frame.flow.drift * (dt / g.h));
    for (int a = 0; a < 3; ++a) {
      column_[a] = quad(step.forward.col(a));
      row_[a] = quad(step.back.col(a));
      rate_[a] = quad(dt * frame.flow.gradient.col(a));
    }
  }
  static Quad quad(const Vec3d& v) {
    return Quad{static_cast<Real>(v[0]), static_cast<Real>(v[1]), static_cast<Real>(v[2]), 0};
  }
  static EFSI_INLINE Quad times(const Quad columns[3], const Quad& x) {
    return columns[0] * x[0] + columns[1] * x[1] + columns[2] * x[2];
  }
  bool flows_;
  Quad center_ = {0, 0, 0, 0}, shift_, linear_, spin_, column_[3], row_[3], rate_[3];
};

constexpr Real kBeyondWall = 1;  // cells over which what lies beyond a wall is extrapolated, there and back alike

// Where what is at x after the step was before it, and where what is at x before it will be: the flow v of the frame,
// and the frame's motion after that.
EFSI_INLINE Quad place_before(const PackedSampler& sampler, const FrameMotion& frame, const PackedField& v,
                              const Quad& x, Real step) {
  const Quad y = frame.back(x);
  return sampler.keep_near(sampler.trace_rk3(v, y, sampler.value(v, y), step), kBeyondWall);
}
EFSI_INLINE Quad place_after(const PackedSampler& sampler, const FrameMotion& frame, const PackedField& v,
                             const Quad& x, const Quad& v0, Real step) {
  return sampler.keep_near(frame.forward(sampler.trace_rk3(v, x, v0, -step)), kBeyondWall);
}

// First sweep: f1(x) = f(x_d). reached: what the nodes hold, kNoData where not all around x_d there is data.
EFSI_KERNEL void carry_row(const PackedSampler& nodes, const FrameMotion& motion, const Vec3i& points, const Row& row,
                           bool paper, Real step, const std::uint8_t* layer, AdvectWorkspace& packed,
                           std::uint8_t* reached, VectorField& change) {
  const PackedSampler sampler = nodes;
  const FrameMotion frame = motion;
  const PackedField& v = packed.v;
  const bool changes = change.size() > 0;
  for (int i = 0; i < row.count; ++i) {
    const std::size_t n = row.node + static_cast<std::size_t>(i);
    reached[n] = kNoData;
    if (changes) change.set(n, Vec3::Zero());
    if (layer[n] == grid::kNoLayer) continue;
    const Quad x = position(row, i);
    const Quad from = paper ? sampler.keep_inside(sampler.trace_midpoint(v, x, grid::load_quad(v.at(n)), step))
                            : place_before(sampler, frame, v, x, step);
    PackedSampler::Place at = sampler.place_beyond(from);
    static_assert(kExtensionLayers < 0x80 && grid::kNoLayer >= 0x80);
    CornerMarks around = corner_marks(points, layer, at.node);
    if (PackedSampler::Place near = at; around.any != 0 && round_to_nodes(near)) {  // at the edge of the data
      if (around.any & 0x8080) at = near;
      around = rounded_marks(points, layer, near);
    }
    if (around.any & 0x8080) continue;
    grid::store_quad(packed.from.at(n), from);
    grid::store_quad(packed.first_u.at(n), sampler.value(packed.u, at));
    if (changes) {
      const Quad moved = sampler.value(packed.change(), at);
      for (std::size_t a = 0; a < 3; ++a) change.c[a][n] = moved[a];
    }
    grid::store_quad(packed.first_v.at(n),
                     paper ? grid::load_quad(v.at(n)) : sampler.value(v, at) + frame.velocity(from) / step);
    reached[n] = paper || around.any == 0 ? kKnown : around.has_zero ? kEdge : kExtrapolated;
  }
}

// Second sweep, forwards: half the error of going there and back, (0, 0, 0, 0) where the place ahead is not surrounded
// by data.
EFSI_KERNEL void measure_row(const PackedSampler& nodes, const FrameMotion& motion, const Vec3i& points, const Row& row,
                             Real step, const std::uint8_t* layer, AdvectWorkspace& packed) {
  const PackedSampler sampler = nodes;
  const FrameMotion frame = motion;
  for (int i = 0; i < row.count; ++i) {
    const std::size_t n = row.node + static_cast<std::size_t>(i);
    Quad error_u = {0, 0, 0, 0}, error_v = error_u;
    if (layer[n] == 0) {
      const Quad x = position(row, i), v0 = grid::load_quad(packed.v.at(n));
      PackedSampler::Place ahead = sampler.place_beyond(place_after(sampler, frame, packed.v, x, v0, step));
      bool known = corner_marks(points, layer, ahead.node).any == 0;
      if (!known && round_to_nodes(ahead)) known = rounded_marks(points, layer, ahead).any == 0;
      if (known) {
        error_u = Real(0.5) * (grid::load_quad(packed.u.at(n)) - sampler.value(packed.first_u, ahead));
        error_v = Real(0.5) * (v0 + frame.velocity(x) / step - sampler.value(packed.first_v, ahead));
        error_u[3] = error_v[3] = 1;
      }
    }
    grid::store_quad(packed.error_u.at(n), error_u);
    grid::store_quad(packed.error_v.at(n), error_v);
  }
}

constexpr Real kLeastWeight = Real(1e-3);  // of known errors around a place

// Takes the error off. Where it is not known, at the edge of the data, the error at x_d is taken (the scheme of Beam
// and Warming) and there are no new extremes; what came from beyond a wall is such an extreme and stays as it is. u
// also takes what x has moved.
EFSI_KERNEL void correct_row(const PackedSampler& nodes, const FrameMotion& motion, const Row& row, Real step, Real h,
                             const std::uint8_t* reached, const AdvectWorkspace& packed, SolidState& state) {
  const PackedSampler sampler = nodes;
  const FrameMotion frame = motion;
  for (int i = 0; i < row.count; ++i) {
    const std::size_t n = row.node + static_cast<std::size_t>(i);
    Quad u_new = {0, 0, 0, 0}, v_new = u_new;
    if (reached[n]) {
      const Quad x = position(row, i), from = grid::load_quad(packed.from.at(n));
      Quad error_u = grid::load_quad(packed.error_u.at(n)), error_v = grid::load_quad(packed.error_v.at(n));
      u_new = grid::load_quad(packed.first_u.at(n));
      v_new = grid::load_quad(packed.first_v.at(n));
      if (error_u[3] > 0) {
        u_new += error_u;
        v_new += error_v;
      } else if (sampler.is_near(from, grid::kBorder)) {
        const PackedSampler::Place behind = sampler.place(from);
        error_u = sampler.value(packed.error_u, behind);
        error_v = sampler.value(packed.error_v, behind);
        if (error_u[3] > kLeastWeight) {
          u_new = sampler.limit(packed.u, behind, u_new + error_u / error_u[3]);
          const Quad moving = frame.velocity(from) / step;
          v_new = moving + sampler.limit(packed.v, behind, v_new - moving + error_v / error_v[3]);
        }
      }
      u_new += h * (x - from);
    }
    for (std::size_t a = 0; a < 3; ++a) {
      state.u.c[a][n] = u_new[a];
      state.v.c[a][n] = v_new[a];
    }
  }
}

}  // namespace

void advect(const Parallel& parallel, AdvectionScheme scheme, double dt, const BodyStep& frame, const SolidWork& work,
            SolidState& state, AdvectWorkspace& packed) {
  const Grid& g = state.band.grid;
  const PackedSampler sampler(g);
  const Real step = static_cast<Real>(dt / g.h);
  const bool paper = scheme == AdvectionScheme::kPaper;
  const FrameMotion motion(g, paper ? BodyStep{} : frame, dt);
  packed.reserve(g.node_count());
  state.valid.resize(g.node_count());
  const bool changes = state.change.size() > 0;
  const auto for_rows = [&](const auto& body) {
    parallel.for_each(g.cells[2] + 1, [&](std::int64_t k) {
      for (int j = 0; j <= g.cells[1]; ++j)
        body(Row{j, static_cast<int>(k), g.cells[0] + 1, g.node(0, j, static_cast<int>(k))});
    });
  };
  // Pack u, v relative to the frame, and the change of v.
  const Real lead = paper ? static_cast<Real>(dt) : Real(0);  // paper: u + dt v at the nodes (line 19)
  for_rows([&](const Row& row) {
    for (int i = 0; i < row.count; ++i) {
      const std::size_t n = row.node + static_cast<std::size_t>(i);
      const Quad u = {state.u.c[0][n], state.u.c[1][n], state.u.c[2][n], 0};
      const Quad v = {state.v.c[0][n], state.v.c[1][n], state.v.c[2][n], 0};
      grid::store_quad(packed.u.at(n), u + lead * v);
      grid::store_quad(packed.v.at(n), v - motion.velocity(position(row, i)) / step);
      if (changes)
        grid::store_quad(packed.change().at(n),
                         Quad{state.change.c[0][n], state.change.c[1][n], state.change.c[2][n], 0});
    }
  });
  // Semi-Lagrangian transport.
  for_rows([&](const Row& row) {
    carry_row(sampler, motion, g.nodes(), row, paper, step, work.layer.data(), packed, state.valid.data(),
              state.change);
  });
  // Error by the forward trace, then the correction.
  if (!paper) {
    for_rows([&](const Row& row) { measure_row(sampler, motion, g.nodes(), row, step, work.layer.data(), packed); });
    for_rows([&](const Row& row) {
      correct_row(sampler, motion, row, step, static_cast<Real>(g.h), state.valid.data(), packed, state);
    });
    return;
  }
  for_rows([&](const Row& row) {
    for (std::size_t n = row.node; n < row.node + static_cast<std::size_t>(row.count); ++n)
      for (std::size_t a = 0; a < 3; ++a) {
        state.u.c[a][n] = state.valid[n] ? packed.first_u.at(n)[a] : Real(0);
        state.v.c[a][n] = state.valid[n] ? packed.first_v.at(n)[a] : Real(0);
      }
  });
}

void predict_surface(const Parallel& parallel, double dt, const BodyStep& frame, const AdvectWorkspace& packed,
                     SolidState& state) {
  const Grid& g = state.band.grid;
  const PackedSampler sampler(g);
  const FrameMotion motion(g, frame, dt);
  const Real step = static_cast<Real>(dt / g.h);
  parallel.for_each(static_cast<std::int64_t>(state.surface.size()), [&](std::int64_t i) {
    Vec3d& x = state.surface[static_cast<std::size_t>(i)];
    const Vec3 at = ((x - g.origin) / g.h).cast<Real>();
    const Quad from = {at[0], at[1], at[2], 0};
    const Quad v0 = sampler.value(packed.v, from);
    const Quad way = motion.forward(sampler.trace_rk3(packed.v, from, v0, -step)) - from;
    for (int a = 0; a < 3; ++a) x[a] += g.h * static_cast<double>(way[a]);
  });
}

Vec3d material_in_cell(const SolidState& state, const Vec3i& cell) {
  const Grid& g = state.band.grid;
  const std::size_t n = g.node(cell[0], cell[1], cell[2]);
  Vec3d u = Vec3d::Zero();
  for (const std::size_t offset : grid::corner_offsets(g)) u += 0.125 * state.u.at(n + offset).cast<double>();
  return g.cell_center(cell[0], cell[1], cell[2]) - u;
}

double largest_strain_rate(const Parallel& parallel, const SolidState& state, const std::vector<std::uint8_t>& marked) {
  const Grid& g = state.band.grid;
  const std::size_t stride[3] = {1, g.node_stride(1), g.node_stride(2)};
  return parallel.max(g.cells[2] + 1, 0.0, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    Real top = 0;
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const bool inside[3] = {i < g.cells[0], j < g.cells[1], k < g.cells[2]};
        for (std::size_t a = 0; a < 3; ++a)
          if (inside[a] && marked[n] && marked[n + stride[a]])
            top = std::max(top, (state.v.at(n + stride[a]) - state.v.at(n)).cwiseAbs().maxCoeff());
      }
    return static_cast<double>(top) / g.h;
  });
}

CellMotion measure_motion(const Parallel& parallel, const SolidRest& rest, const SolidState& state) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const double volume = g.h * g.h * g.h;
  const auto own = [&](std::size_t n) {
    return std::all_of(corner.begin(), corner.end(), [&](std::size_t offset) {
      return state.valid[n + offset] == kKnown || state.valid[n + offset] == kEdge;
    });
  };
  std::vector<CellMotion> slabs(static_cast<std::size_t>(g.cells[2]));
  parallel.for_each(g.cells[2], [&](std::int64_t k) {
    CellMotion& slab = slabs[static_cast<std::size_t>(k)];
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, static_cast<int>(k));
        if (!own(n)) continue;
        Mat3d gradient = Mat3d::Zero();
        Vec3d mean = Vec3d::Zero();
        for (std::size_t a = 0; a < 8; ++a) {
          const Vec3d v = state.v.at(n + corner[a]).cast<double>();
          mean += 0.125 * v;
          for (int b = 0; b < 3; ++b)
            gradient.col(b) += (grid::kCorner[a][static_cast<std::size_t>(b)] ? 0.25 : -0.25) / g.h * v;
        }
        const Mat3d rate = 0.5 * (gradient + gradient.transpose());
        const double dilation = rate.trace();
        slab.volume += volume;
        slab.half_square += 0.5 * volume * mean.squaredNorm();
        slab.root +=
            volume * std::sqrt(2.0 * rest.elastic.mu * rate.squaredNorm() + rest.elastic.lambda * dilation * dilation);
      }
  });
  CellMotion all;
  for (const CellMotion& slab : slabs) {
    all.volume += slab.volume;
    all.half_square += slab.half_square;
    all.root += slab.root;
  }
  return all;
}

void follow_solid(const Grid& global, const SolidRest& rest, SolidState& state) {
  const Grid& g = state.band.grid;
  Vec3i lo = {global.cells[0], global.cells[1], global.cells[2]}, hi = {0, 0, 0};
  bool any = false;
  const auto inside = [&](int i, int j, int k) {
    const std::size_t n = g.node(i, j, k);
    return state.valid[n] && !(rest.distance.sample(g.node_position(i, j, k) - state.u.at(n).cast<double>()) > g.h);
  };
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j) {
      // The ends of each row are enough.
      int first = 0, last = g.cells[0];
      while (first <= last && !inside(first, j, k)) ++first;
      if (first > last) continue;
      while (!inside(last, j, k)) --last;
      any = true;
      const int low[3] = {first, j, k}, high[3] = {last, j, k};
      for (std::size_t a = 0; a < 3; ++a) {
        lo[a] = std::min(lo[a], low[a] + g.lo[a]);
        hi[a] = std::max(hi[a], high[a] + g.lo[a]);
      }
    }
  if (!any) return;
  const Band band = make_band(global, lo, hi);
  if (band.grid.lo != g.lo || band.grid.cells != g.cells) move_band(state, band);
}

}  // namespace efsi::solid
