#include "fluid/conserve_smoke.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/kernel.hpp"
#include "fluid/transport.hpp"

namespace efsi::fluid {

using grid::kTileSize;
using grid::Octet;
using grid::PackedSampler;
using grid::Quad;
using grid::TileMask;

namespace {

constexpr std::size_t kCells = 512;   // of a tile
constexpr std::size_t kWithin = 27;   // functions that are not 0 in a tile
constexpr std::size_t kAround = 128;  // those of the tile and its neighbours, 5^3, and room to write rows of four
constexpr double kNegligible = 1e-6;  // of the largest room
constexpr int kRounds = 32;           // intervals over which an amount without capacity is passed on, at most

using Cells = Real[kCells];
using Sums = Real[kWithin];

// A place along an axis; where the box ends the last one stands for those beyond.
int place_along(int place, int count, bool periodic) {
  return periodic ? (place % count + count) % count : std::clamp(place, 0, count - 1);
}

// Functions -1, 0, 1 at a place 0..1 in an interval.
EFSI_INLINE void spline(Real place, Real before, Real after, Real (&w)[3]) {
  const Real left = 1 - place;
  w[0] = before * (left * left);
  w[2] = after * (place * place);
  w[1] = 1 - w[0] - w[2];
}

// Intervals along an axis: what is left of a tile at its end belongs to the one before, since the functions of a narrow
// one would bend sharply.
int intervals_along(int cells) { return std::max(1, cells / kTileSize); }

std::vector<TileSpline> splines_along(int cells, int tiles, bool periodic) {
  const int count = intervals_along(cells);
  const auto width = [&](int q) {
    const int place = place_along(q, count, periodic);
    return static_cast<Real>(place == count - 1 ? cells - kTileSize * place : kTileSize);
  };
  std::vector<TileSpline> all(static_cast<std::size_t>(tiles));
  for (int t = 0; t < tiles; ++t) {
    TileSpline& s = all[static_cast<std::size_t>(t)];
    const int q = std::min(t, count - 1), first = kTileSize * (t - q);
    const int last = std::min(kTileSize, cells - kTileSize * t) - 1;
    s.begin = static_cast<Real>(kTileSize * q);
    for (int m = -2; m <= 2; ++m) s.function[m + 2] = place_along(q + m, count, periodic);
    for (int m = -1; m <= 1; ++m) {
      s.width[m + 1] = width(q + m);
      s.before[m + 1] = width(q + m) / (width(q + m) + width(q + m - 1));
      s.after[m + 1] = width(q + m) / (width(q + m) + width(q + m + 1));
    }
    for (int i = 0; i < kTileSize; ++i) {
      const int low = std::min(i - i % 2, last), high = std::min(low + 1, last);
      Real cell[3], block[3];
      spline((static_cast<Real>(first + std::min(i, last)) + Real(0.5)) / s.width[1], s.before[1], s.after[1], cell);
      spline((static_cast<Real>(2 * first + low + high + 1) * Real(0.5)) / s.width[1], s.before[1], s.after[1], block);
      for (int f = 0; f < 3; ++f) {
        s.cell[f][i] = cell[f];
        s.block[f][i] = block[f];
      }
    }
  }
  return all;
}

// A tile of cells and the functions along its axes, null where smoke is not kept.
struct Tile {
  Tile(const TileMask& tiles, std::int64_t t, const std::array<std::vector<TileSpline>, 3>& splines) {
    tiles.range(t, begin, end);
    for (std::size_t a = 0; a < 3; ++a) {
      axis[a] = splines[a].empty() ? nullptr : &splines[a][static_cast<std::size_t>(begin[a] / kTileSize)];
      count[a] = end[a] - begin[a];
    }
  }
  Vec3i begin, end, count;
  const TileSpline* axis[3];
};

// A row of a tile; 0 beyond the box.
EFSI_INLINE Octet load_row(const Real* row, int count) {
  if (count == kTileSize) return grid::load_octet(row);
  Octet v = {};
  for (int i = 0; i < count; ++i) v[i] = row[i];
  return v;
}
EFSI_INLINE void store_row(Real* row, int count, const Octet& v) {
  using Unaligned = Real __attribute__((vector_size(8 * sizeof(Real)), aligned(alignof(Real)), may_alias));
  if (count == kTileSize)
    *reinterpret_cast<Unaligned*>(row) = v;
  else
    for (int i = 0; i < count; ++i) row[i] = v[i];
}
EFSI_INLINE bool any_of(const std::uint8_t* flags, int count) {
  std::uint64_t all = 0;
  if (count == kTileSize)
    std::memcpy(&all, flags, sizeof(all));
  else
    for (int i = 0; i < count; ++i) all |= flags[i];
  return all != 0;
}
EFSI_INLINE Octet size_of(const Octet& v) { return v < Octet{} ? -v : v; }

// Copies a tile's values; 0 beyond the box and in solid cells. False where all are 0.
EFSI_KERNEL bool load(const Grid& g, const Tile& tile, const Real* field, const std::uint8_t* solid, Cells& cells) {
  const Vec3i n = tile.count;
  const std::size_t row = static_cast<std::size_t>(g.cells[0]), plane = row * static_cast<std::size_t>(g.cells[1]);
  const std::size_t first = g.cell(tile.begin[0], tile.begin[1], tile.begin[2]);
  if (n[1] * n[2] < kTileSize * kTileSize) std::fill_n(cells, kCells, Real(0));
  const Octet zero = {};
  auto any = zero != zero;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j) {
      const std::size_t at = first + static_cast<std::size_t>(k) * plane + static_cast<std::size_t>(j) * row;
      Octet v = load_row(field + at, n[0]);
      if (solid && any_of(solid + at, n[0]))
        for (int i = 0; i < n[0]; ++i) v[i] = solid[at + static_cast<std::size_t>(i)] ? Real(0) : v[i];
      store_row(cells + kTileSize * (j + kTileSize * k), kTileSize, v);
      any |= v != zero;
    }
  bool found = false;
  for (int i = 0; i < kTileSize; ++i) found = found || any[i] != 0;
  return found;
}

// sum psi cells for the functions of a tile: at the cells, or in the middle of blocks of 2^3.
EFSI_KERNEL void sum_up(const Cells& cells, const Tile& tile, bool blocks, Sums& sums) {
  const auto along = [&](int a) { return blocks ? tile.axis[a]->block : tile.axis[a]->cell; };
  const TileSpline::Row *x = along(0), *y = along(1), *z = along(2);
  Octet part[9] = {};
  for (int k = 0; k < kTileSize; ++k) {
    Octet plane[3] = {};
    for (int j = 0; j < kTileSize; ++j) {
      const Octet v = grid::load_octet(cells + kTileSize * (j + kTileSize * k));
      for (int f = 0; f < 3; ++f) plane[f] += y[f][j] * v;
    }
    for (int f = 0; f < 9; ++f) part[f] += z[f / 3][k] * plane[f % 3];
  }
  for (int m = 0; m < 9; ++m)
    for (int f = 0; f < 3; ++f) {
      const Octet all = grid::load_octet(x[f]) * part[m];
      const Quad half = grid::lower_half(all) + grid::upper_half(all);
      sums[3 * m + f] = (half[0] + half[2]) + (half[1] + half[3]);
    }
}

void add(const Sums& sums, Real sign, Real* around) {
  for (int z = 0; z < 3; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 3; ++x) around[(x + 1) + 5 * (y + 1) + 25 * (z + 1)] += sign * sums[x + 3 * y + 9 * z];
}

// Takes what has arrived from the functions around a tile, psi(X) r, for blocks of 2^3 cells.
EFSI_KERNEL void take_arrivals(const Grid& g, const PackedSampler& sampler, const Tile& tile, const Cells& cells,
                               const grid::VectorField& back, Real* around) {
  const PackedSampler box = sampler;
  const auto axes = [&](const auto& value) { return Quad{value(0), value(1), value(2), Real(1)}; };
  // The three intervals around the tile along each axis.
  Quad width[3], begin[3], before[3], after[3];
  for (int m = 0; m < 3; ++m) {
    width[m] = 1 / axes([&](int a) { return tile.axis[a]->width[m]; });
    before[m] = axes([&](int a) { return tile.axis[a]->before[m]; });
    after[m] = axes([&](int a) { return tile.axis[a]->after[m]; });
  }
  begin[1] = axes([&](int a) { return tile.axis[a]->begin; });
  begin[0] = begin[1] - axes([&](int a) { return tile.axis[a]->width[0]; });
  begin[2] = begin[1] + axes([&](int a) { return tile.axis[a]->width[1]; });
  const Quad zero = {0, 0, 0, 0}, one = {1, 1, 1, 1};
  const Vec3i last = {tile.end[0] - 1, tile.end[1] - 1, tile.end[2] - 1};
  // Blocks of 2^3 cells.
  for (int k = tile.begin[2]; k < tile.end[2]; k += 2)
    for (int j = tile.begin[1]; j < tile.end[1]; j += 2) {
      const int after_j = std::min(j + 1, last[1]), after_k = std::min(k + 1, last[2]);
      const std::size_t low = g.cell(0, j, k), high = g.cell(0, after_j, after_k);
      const Real* row = cells + kTileSize * ((j - tile.begin[1]) + kTileSize * (k - tile.begin[2]));
      const Octet pairs = (grid::load_octet(row) + grid::load_octet(row + kTileSize)) +
                          (grid::load_octet(row + 8 * kTileSize) + grid::load_octet(row + 9 * kTileSize));
      for (int i = tile.begin[0]; i < tile.end[0]; i += 2) {
        const Real amount = pairs[i - tile.begin[0]] + pairs[i - tile.begin[0] + 1];
        if (amount == 0) continue;
        // The middle of the block, and the mean displacement of two opposite corners.
        const int after_i = std::min(i + 1, last[0]);
        const Quad middle = Real(0.5) * Quad{static_cast<Real>(i + after_i + 1), static_cast<Real>(j + after_j + 1),
                                             static_cast<Real>(k + after_k + 1), 0};
        const Quad way = Real(0.5) * (node_value(back, low + static_cast<std::size_t>(i)) +
                                      node_value(back, high + static_cast<std::size_t>(after_i)));
        const Quad from = box.keep_inside(middle + way);
        // The splines at the origin of the block, and the tiles that they belong to.
        const auto is_before = from < begin[1], is_after = from >= begin[2];
        const auto choose = [&](const Quad(&of)[3]) { return is_before ? of[0] : (is_after ? of[2] : of[1]); };
        const Quad place = grid::clamp((from - choose(begin)) * choose(width), zero, one), left = one - place;
        const Quad w0 = choose(before) * (left * left), w2 = choose(after) * (place * place), w1 = one - w0 - w2;
        const grid::QuadIndex start =
            __builtin_convertvector(is_before ? zero : (is_after ? one + one : one), grid::QuadIndex);
        Real* to = around + (start[0] + 5 * start[1] + 25 * start[2]);
        const Quad x = {w0[0], w1[0], w2[0], 0};
        const Real y[3] = {w0[1], w1[1], w2[1]}, z[3] = {amount * w0[2], amount * w1[2], amount * w2[2]};
        for (int c = 0; c < 3; ++c)
          for (int b = 0; b < 3; ++b) {
            Real* at = to + 5 * b + 25 * c;
            grid::store_quad(at, grid::load_quad(at) - (z[c] * y[b]) * x);
          }
      }
    }
}

// Whether there is or was a solid cell in a tile.
EFSI_KERNEL bool holds_solid(const Grid& g, const Tile& tile, const std::uint8_t* was, const Real* fraction) {
  bool any = false;
  Octet top = {};
  for (int k = 0; k < tile.count[2]; ++k)
    for (int j = 0; j < tile.count[1]; ++j) {
      const std::size_t row = g.cell(tile.begin[0], tile.begin[1] + j, tile.begin[2] + k);
      const Octet part = load_row(fraction + row, tile.count[0]);
      top = part > top ? part : top;
      any |= any_of(was + row, tile.count[0]);
    }
  for (int i = 0; i < kTileSize; ++i) any = any || top[i] > Real(0.5);
  return any;
}

// Empties the cells that solids fill now. change: what was lost so, less what is new where they were.
void move_solids(const Grid& g, const Tile& tile, const std::uint8_t* was, const Real* fraction, Real* field,
                 Cells& change) {
  std::fill_n(change, kCells, Real(0));
  for (int k = 0; k < tile.count[2]; ++k)
    for (int j = 0; j < tile.count[1]; ++j) {
      const std::size_t row = g.cell(tile.begin[0], tile.begin[1] + j, tile.begin[2] + k);
      Real* to = change + kTileSize * (j + kTileSize * k);
      for (int i = 0; i < tile.count[0]; ++i) {
        const std::size_t c = row + static_cast<std::size_t>(i);
        const bool now = fraction[c] > Real(0.5), before = was[c] != 0;
        if (now != before) to[i] = now ? field[c] : -field[c];
        if (now) field[c] = 0;
      }
    }
}

EFSI_INLINE Octet room(const Octet& v, Real top, Real inverse) {
  const Octet zero = {}, size = size_of(v), left = top - size;
  return size * ((left > zero ? left : zero) * inverse);
}

// Turns a tile's values into w.
EFSI_KERNEL void find_room(Real top, Cells& cells) {
  const Real inverse = top > 0 ? 1 / top : Real(0);
  for (std::size_t i = 0; i < kCells; i += kTileSize)
    store_row(cells + i, kTileSize, room(grid::load_octet(cells + i), top, inverse));
}

// r += q w; share: of the functions of the tile.
EFSI_KERNEL void give(const Grid& g, const Tile& tile, const Sums& share, Real top, Real* field) {
  const Real inverse = top > 0 ? 1 / top : Real(0);
  const TileSpline::Row *x = tile.axis[0]->cell, *y = tile.axis[1]->cell, *z = tile.axis[2]->cell;
  const Octet x0 = grid::load_octet(x[0]), x1 = grid::load_octet(x[1]), x2 = grid::load_octet(x[2]);
  for (int k = 0; k < tile.count[2]; ++k) {
    Real plane[9] = {};
    for (int f = 0; f < 9; ++f)
      for (int c = 0; c < 3; ++c) plane[f] += z[c][k] * share[f + 9 * c];
    for (int j = 0; j < tile.count[1]; ++j) {
      Real q[3] = {};
      for (int f = 0; f < 3; ++f)
        for (int b = 0; b < 3; ++b) q[f] += y[b][j] * plane[f + 3 * b];
      Real* row = field + g.cell(tile.begin[0], tile.begin[1] + j, tile.begin[2] + k);
      const Octet v = load_row(row, tile.count[0]);
      store_row(row, tile.count[0], v + (q[0] * x0 + q[1] * x1 + q[2] * x2) * room(v, top, inverse));
    }
  }
}

// The largest of each tile and its 26 neighbours.
std::vector<Real> largest_around(const TileMask& tiles, const std::array<bool, 3>& periodic, std::vector<Real> top) {
  const Vec3i& n = tiles.tiles();
  const std::int64_t stride[3] = {1, n[0], std::int64_t{1} * n[0] * n[1]};
  for (std::size_t a = 0; a < 3; ++a) {
    const std::vector<Real> old = top;
    for (std::int64_t t = 0; t < tiles.count(); ++t) {
      const int i = static_cast<int>(t / stride[a] % n[a]);
      Real& v = top[static_cast<std::size_t>(t)];
      for (const int d : {-1, 1}) {
        const std::int64_t near = t + (place_along(i + d, n[a], periodic[a]) - i) * stride[a];
        v = std::max(v, old[static_cast<std::size_t>(near)]);
      }
    }
  }
  return top;
}

template <class Body>
void for_active(const Parallel& parallel, const TileMask& tiles, const Body& body) {
  parallel.for_each(tiles.count(), [&](std::int64_t t) {
    if (tiles.active(t)) body(t, static_cast<std::size_t>(t));
  });
}

}  // namespace

void ScalarBudget::open(const Parallel& parallel, const Grid& g, bool keep, const TileMask& tiles,
                        const std::vector<Real>& top, const std::vector<Real>& field,
                        const std::vector<std::uint8_t>& solid) {
  tiles_ = tiles;
  keep_ = keep;
  if (!keep) return;
  for (std::size_t a = 0; a < 3; ++a) {
    splines_[a] = splines_along(g.cells[a], tiles.tiles()[a], g.periodic[a]);
    functions_[a] = intervals_along(g.cells[a]);
  }
  top_ = largest_around(tiles, g.periodic, top);
  parts_.resize(kAround * static_cast<std::size_t>(tiles.count()));
  room_parts_.resize(kWithin * static_cast<std::size_t>(tiles.count()));
  for_active(parallel, tiles_, [&](std::int64_t number, std::size_t t) {
    const Tile tile(tiles_, number, splines_);
    Cells cells;
    Sums sums;
    std::fill_n(&parts_[kAround * t], kAround, Real(0));
    if (!load(g, tile, field.data(), solid.empty() ? nullptr : solid.data(), cells)) return;
    sum_up(cells, tile, false, sums);
    add(sums, 1, &parts_[kAround * t]);
  });
}

// psi(X) = psi(x) + (psi(X) - psi(x)), the first for every cell, what is in brackets for blocks of 2^3 cells: exact
// where nothing moves.
void ScalarBudget::bring_in(const Grid& g, double dt, std::span<const SourceCell> sources,
                            const std::vector<Real>& field) {
  if (!keep_) return;
  for (const SourceCell& source : sources) {
    const auto& [i, j, k] = source.place;
    const std::int64_t number = tiles_.at({i / kTileSize, j / kTileSize, k / kTileSize});
    if (!tiles_.active(number)) continue;
    const Tile tile(tiles_, number, splines_);
    const Real amount = static_cast<Real>(dt) * source.rate * field[g.cell(i, j, k)];
    Sums sums;
    for (std::size_t f = 0; f < kWithin; ++f)
      sums[f] = amount * tile.axis[0]->cell[f % 3][i - tile.begin[0]] *
                tile.axis[1]->cell[f / 3 % 3][j - tile.begin[1]] * tile.axis[2]->cell[f / 9][k - tile.begin[2]];
    add(sums, 1, &parts_[kAround * static_cast<std::size_t>(number)]);
  }
}

void ScalarBudget::count(const Parallel& parallel, const Grid& g, const grid::VectorField& back,
                         const std::vector<Real>& field, const std::vector<std::uint8_t>& solid) {
  if (!keep_) return;
  const PackedSampler box(g);
  for_active(parallel, tiles_, [&](std::int64_t number, std::size_t t) {
    const Tile tile(tiles_, number, splines_);
    Cells cells;
    Sums sums;
    Real* around = &parts_[kAround * t];
    if (!load(g, tile, field.data(), solid.empty() ? nullptr : solid.data(), cells)) return;
    sum_up(cells, tile, false, sums);
    add(sums, -1, around);
    sum_up(cells, tile, true, sums);
    add(sums, 1, around);
    take_arrivals(g, box, tile, cells, back, around);
  });
}

void ScalarBudget::settle(const Parallel& parallel, const Grid& g, const grid::Walls& walls,
                          const std::vector<std::uint8_t>& was, const std::vector<Real>& cell_fraction,
                          std::vector<Real>& field) {
  if (tiles_.count() == 0) return;
  for_active(parallel, tiles_, [&](std::int64_t number, std::size_t t) {
    const Tile tile(tiles_, number, splines_);
    Cells cells;
    Sums sums;
    if (!was.empty() && holds_solid(g, tile, was.data(), cell_fraction.data())) {
      move_solids(g, tile, was.data(), cell_fraction.data(), field.data(), cells);
      if (keep_) {
        sum_up(cells, tile, false, sums);
        add(sums, 1, &parts_[kAround * t]);
      }
    }
    if (!keep_) return;
    std::fill_n(&room_parts_[kWithin * t], kWithin, Real(0));
    if (!load(g, tile, field.data(), nullptr, cells)) return;
    find_room(top_[t], cells);
    sum_up(cells, tile, false, sums);
    std::copy_n(sums, kWithin, &room_parts_[kWithin * t]);
  });
  if (!keep_) return;
  gather(parallel, walls);
  exchange(parallel, g);
  for_active(parallel, tiles_, [&](std::int64_t number, std::size_t t) {
    const Tile tile(tiles_, number, splines_);
    Sums share;
    bool any = false;
    for (std::size_t f = 0; f < kWithin; ++f) {
      share[f] = share_[function(tile.axis[0]->function[f % 3 + 1], tile.axis[1]->function[f / 3 % 3 + 1],
                                 tile.axis[2]->function[f / 9 + 1])];
      any = any || share[f] != 0;
    }
    if (any) give(g, tile, share, top_[t], field.data());
  });
}

std::size_t ScalarBudget::function(int i, int j, int k) const {
  return static_cast<std::size_t>(i) +
         static_cast<std::size_t>(functions_[0]) *
             (static_cast<std::size_t>(j) + static_cast<std::size_t>(functions_[1]) * static_cast<std::size_t>(k));
}

// What is missing of each function and how much finds room there, from the tiles that it reaches.
void ScalarBudget::gather(const Parallel& parallel, const grid::Walls& walls) {
  const Vec3i& n = functions_;
  const std::size_t count = function(0, 0, n[2]);
  missing_.resize(count);
  room_.resize(count);
  // Per axis and function: the tiles that hold a part of it, and as which of their five.
  std::array<std::vector<std::vector<std::pair<int, int>>>, 3> holders;
  for (std::size_t a = 0; a < 3; ++a) {
    holders[a].resize(static_cast<std::size_t>(n[a]));
    for (std::size_t t = 0; t < splines_[a].size(); ++t)
      for (int m = 0; m < 5; ++m)
        holders[a][static_cast<std::size_t>(splines_[a][t].function[m])].emplace_back(static_cast<int>(t), m);
  }
  const auto near_open = [&](int axis, int i) {
    return (walls.lower(axis) == grid::Wall::kOpen && i < 2) ||
           (walls.upper(axis) == grid::Wall::kOpen && i >= n[static_cast<std::size_t>(axis)] - 2);
  };
  parallel.for_each(static_cast<std::int64_t>(count), [&](std::int64_t at) {
    const int i = static_cast<int>(at % n[0]), j = static_cast<int>(at / n[0] % n[1]),
              k = static_cast<int>(at / n[0] / n[1]);
    double missing = 0.0, room = 0.0;
    for (const auto& [tz, z] : holders[2][static_cast<std::size_t>(k)])
      for (const auto& [ty, y] : holders[1][static_cast<std::size_t>(j)])
        for (const auto& [tx, x] : holders[0][static_cast<std::size_t>(i)]) {
          const std::int64_t tile = tiles_.at({tx, ty, tz});
          if (!tiles_.active(tile)) continue;
          const auto t = static_cast<std::size_t>(tile);
          missing += static_cast<double>(parts_[kAround * t + static_cast<std::size_t>(x + 5 * y + 25 * z)]);
          if (x % 4 == 0 || y % 4 == 0 || z % 4 == 0) continue;  // two intervals away
          room += static_cast<double>(
              room_parts_[kWithin * t + static_cast<std::size_t>((x - 1) + 3 * (y - 1) + 9 * (z - 1))]);
        }
    missing_[static_cast<std::size_t>(at)] = near_open(0, i) || near_open(1, j) || near_open(2, k) ? 0.0 : missing;
    room_[static_cast<std::size_t>(at)] = room;
  });
}

// The share of each function. An amount without capacity is passed on to the six neighbours.
void ScalarBudget::exchange(const Parallel& parallel, const Grid& g) {
  const Vec3i& n = functions_;
  const auto near = [&](std::size_t a, int i) { return place_along(i, n[a], g.periodic[a]); };
  const double largest = *std::max_element(room_.begin(), room_.end());
  given_.assign(missing_.size(), 0.0);
  over_.resize(missing_.size());
  for (int round = 0;; ++round) {
    const double most = parallel.max(static_cast<std::int64_t>(missing_.size()), 0.0, [&](std::int64_t i) {
      const auto f = static_cast<std::size_t>(i);
      const double all = given_[f] + missing_[f];
      given_[f] = std::clamp(all, -room_[f], room_[f]);
      over_[f] = all - given_[f];
      return std::abs(over_[f]);
    });
    if (most <= kNegligible * largest || round == kRounds) break;
    parallel.for_each(std::int64_t{1} * n[1] * n[2], [&](std::int64_t row) {
      const int j = static_cast<int>(row % n[1]), k = static_cast<int>(row / n[1]);
      const auto at = [&](int b, int c) { return over_.data() + function(0, near(1, b), near(2, c)); };
      const double *here = at(j, k), *left = at(j - 1, k), *right = at(j + 1, k), *below = at(j, k - 1),
                   *above = at(j, k + 1);
      double* to = missing_.data() + function(0, j, k);
      for (int i = 0; i < n[0]; ++i) {
        const int low = i > 0 ? i - 1 : near(0, -1), high = i + 1 < n[0] ? i + 1 : near(0, n[0]);
        to[i] = ((here[low] + here[high]) + (left[i] + right[i]) + (below[i] + above[i])) / 6.0;
      }
    });
  }
  share_.resize(missing_.size());
  for (std::size_t f = 0; f < share_.size(); ++f)
    share_[f] = room_[f] > 0.0 ? static_cast<Real>(given_[f] / room_[f]) : Real(0);
}

std::size_t ScalarBudget::bytes() const {
  return (top_.capacity() + parts_.capacity() + room_parts_.capacity() + share_.capacity()) * sizeof(Real) +
         (missing_.capacity() + room_.capacity() + given_.capacity() + over_.capacity()) * sizeof(double);
}

}  // namespace efsi::fluid
