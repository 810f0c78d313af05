#include "fluid/emitter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.hpp"

namespace efsi::fluid {
namespace {

constexpr double kInstant = 1e-9;   // s: being on for less is being off
constexpr double kOnBorder = 1e-3;  // cells: what is so near to the border of a mesh is in it
constexpr double kOnEdge = 1e-6;    // of a box or a ball: what is so near to its border is in it
constexpr int kSamples = 4;         // along each axis of a cell, for the part of it that a region fills

// A region as place_emitter() sees it: whether a place lies in it, and the box around it.
struct Shape {
  const Emitter& emitter;
  const geometry::Surface* volume;
  double border;  // [m]

  bool contains(const Vec3d& x) const {
    return volume ? volume->distance.sample(x) <= border : emitter.contains(x, kOnEdge);
  }
  Eigen::AlignedBox3d extent() const {
    if (volume) return {volume->report.extent_min, volume->report.extent_max};
    const Mat3d to_world = emitter.from_world.topLeftCorner<3, 3>().inverse();
    Vec3d reach;
    for (int a = 0; a < 3; ++a)
      reach[a] =
          0.5 * (emitter.shape == Region::Shape::kBox ? to_world.row(a).cwiseAbs().sum() : to_world.row(a).norm());
    const Vec3d middle = emitter.middle();
    return {middle - reach, middle + reach};
  }
};

// Index in a box of n cells, or n + 1 nodes, along an axis; periodic ones go round. -1: outside.
int wrap(int i, int n, bool periodic, int count) {
  if (periodic) return ((i % n) + n) % n;
  return i >= 0 && i < count ? i : -1;
}

// The same of all axes; false: outside.
bool wrap(const Grid& g, const Vec3i& at, bool nodes, Vec3i& place) {
  for (std::size_t a = 0; a < 3; ++a) {
    place[a] = wrap(at[a], g.cells[a], g.periodic[a], g.cells[a] + (nodes ? 1 : 0));
    if (place[a] < 0) return false;
  }
  return true;
}

template <class Body>
void for_block(const Vec3i& low, const Vec3i& high, const Body& body) {
  for (int k = low[2]; k < high[2]; ++k)
    for (int j = low[1]; j < high[1]; ++j)
      for (int i = low[0]; i < high[0]; ++i) body(Vec3i{i, j, k});
}

// Calls body(node) for a node of the box and for the others at the same place, which periodic axes have.
template <class Body>
void for_twins(const Grid& g, const Vec3i& place, const Body& body) {
  Vec3i high = place;
  for (std::size_t a = 0; a < 3; ++a)
    if (g.periodic[a] && place[a] == 0) high[a] = g.cells[a];
  for (const int k : {place[2], high[2]})
    for (const int j : {place[1], high[1]})
      for (const int i : {place[0], high[0]}) body(g.node(i, j, k));
}

// Nodes around an extent, not farther beyond the box than it is long.
NodeCover block_around(const Grid& g, const Eigen::AlignedBox3d& extent) {
  NodeCover cover;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto s = static_cast<Eigen::Index>(a);
    const auto index = [&](double x) { return std::clamp((x - g.origin[s]) / g.h, -1e6, 1e6); };
    cover.low[a] = std::max(-g.cells[a], static_cast<int>(std::floor(index(extent.min()[s]) - 0.5)));
    const int high = std::min(2 * g.cells[a], static_cast<int>(std::ceil(index(extent.max()[s]) + 0.5)));
    cover.size[a] = std::max(0, high - cover.low[a] + 1);
  }
  return cover;
}

Vec3i end_of(const NodeCover& cover) {
  return {cover.low[0] + cover.size[0], cover.low[1] + cover.size[1], cover.low[2] + cover.size[2]};
}

// The part of the cube around a node that a region fills, and of what of the cube lies in the box.
std::pair<double, double> sampled_part(const Grid& g, const Shape& shape, const Vec3i& at) {
  int in = 0, in_box = 0, box = 0;
  const Vec3d middle = g.node_position(at[0], at[1], at[2]);
  for_block({0, 0, 0}, {kSamples, kSamples, kSamples}, [&](const Vec3i& s) {
    const Vec3d offset = (Vec3d(s[0], s[1], s[2]) + Vec3d::Constant(0.5)) / kSamples - Vec3d::Constant(0.5);
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const double cell = at[a] + offset[static_cast<Eigen::Index>(a)];
      inside = inside && (g.periodic[a] || (cell > 0.0 && cell < g.cells[a]));
    }
    const bool held = shape.contains(middle + g.h * offset);
    in += held;
    in_box += held && inside;
    box += inside;
  });
  return {static_cast<double>(in) / (kSamples * kSamples * kSamples),
          box > 0 ? static_cast<double>(in_box) / box : 0.0};
}

void find_cover(const Grid& g, const Shape& shape, NodeCover& cover) {
  const auto count = static_cast<std::size_t>(cover.size[0]) * static_cast<std::size_t>(cover.size[1]) *
                     static_cast<std::size_t>(cover.size[2]);
  cover.part.assign(count, 0);
  cover.inner.assign(count, 0);
  cover.holds.assign(count, 0);
  const Vec3i end = end_of(cover);
  for_block(cover.low, end, [&](const Vec3i& at) {
    cover.holds[cover.index(at)] = shape.contains(g.node_position(at[0], at[1], at[2]));
  });
  for_block(cover.low, end, [&](const Vec3i& at) {
    int around = 0;  // of its 27 neighbours
    for_block({at[0] - 1, at[1] - 1, at[2] - 1}, {at[0] + 2, at[1] + 2, at[2] + 2},
              [&](const Vec3i& near) { around += cover.within(near) && cover.holds[cover.index(near)]; });
    const auto [part, inner] = around == 27 ? std::pair(1.0, 1.0) : sampled_part(g, shape, at);
    cover.part[cover.index(at)] = static_cast<Real>(part);
    cover.inner[cover.index(at)] = static_cast<Real>(inner);
  });
}

[[noreturn]] void refuse_empty(const Grid& g, const Shape& shape, const char* what) {
  const Eigen::AlignedBox3d extent = shape.extent();
  const Vec3d top = g.node_position(g.cells[0], g.cells[1], g.cells[2]);
  std::ostringstream text;
  text << "the region of the emitter reaches from (" << extent.min().transpose() << ") to (" << extent.max().transpose()
       << ") m and holds 0 " << what << " of the box: must be at least 1; ";
  if ((extent.min().array() > top.array()).any() || (extent.max().array() < g.origin.array()).any())
    text << "it lies outside the box, (" << g.origin.transpose() << ") to (" << top.transpose() << ") m";
  else
    text << "it is too small for voxels of " << g.h << " m";
  throw Error(ErrorCode::kArgument, text.str());
}

// The part of a step that an emission adds up.
struct Mean {
  Emission sum;
  // Values linear between two keys, over [from, to].
  void add(const EmitterKey& a, const EmitterKey& b, double from, double to) {
    const double length = b.time - a.time, middle = 0.5 * (from + to);
    const double t = length > 0.0 && std::isfinite(length) ? (middle - a.time) / length : 0.0;
    const double weight = to - from;
    sum.share += weight;
    sum.density += weight * ((1.0 - t) * a.density + t * b.density);
    sum.temperature += weight * ((1.0 - t) * a.temperature + t * b.temperature);
    sum.velocity += weight * ((1.0 - t) * a.velocity + t * b.velocity);
  }
};

// The keys of an emitter, or one that holds its values.
std::vector<EmitterKey> keys_of(const Emitter& e) {
  return e.keys.empty() ? std::vector<EmitterKey>{{0.0, e.density, e.temperature, e.velocity, true}} : e.keys;
}

}  // namespace

Emission Emitter::emission(double time, double dt) const {
  constexpr double kAlways = std::numeric_limits<double>::infinity();
  const std::vector<EmitterKey> all = keys_of(*this);
  double from = time, to = time + std::max(dt, 2.0 * kInstant);
  if (mode == Mode::kInitial) {
    if (time != 0.0) return {};
  } else {
    from = std::max(from, start_time);
    to = std::min(to, end_time);
  }
  Mean mean;
  for (std::size_t i = 0; i <= all.size(); ++i) {  // before key i and after the one before it
    const EmitterKey& b = all[std::min(i, all.size() - 1)];
    const EmitterKey& a = i == 0 ? b : all[i - 1];
    const double begin = std::max(from, i == 0 ? -kAlways : a.time),
                 end = std::min(to, i == all.size() ? kAlways : b.time);
    if (a.on && end - begin > kInstant) mean.add(a, b, begin, end);
  }
  if (!(mean.sum.share > 0.0)) return {};
  const double length = mean.sum.share;
  Emission emission = mean.sum;
  emission.share = dt > 0.0 ? std::min(1.0, length / dt) : 1.0;
  emission.density /= length;
  emission.temperature /= length;
  emission.velocity /= length;
  return emission;
}

bool Emitter::gives_smoke() const {
  const std::vector<EmitterKey> all = keys_of(*this);
  return std::any_of(all.begin(), all.end(), [](const EmitterKey& key) { return key.density > 0.0; });
}

bool Emitter::gives_heat() const {
  const std::vector<EmitterKey> all = keys_of(*this);
  return std::any_of(all.begin(), all.end(), [](const EmitterKey& key) { return key.temperature != 0.0; });
}

double Emitter::fastest(double from, double to) const {
  if (!has_velocity || !(emission(from, to - from).share > 0.0)) return 0.0;
  double speed = 0.0;
  const std::vector<EmitterKey> all = keys_of(*this);
  const auto include = [&](const Vec3d& v) { speed = std::max(speed, v.cwiseAbs().maxCoeff()); };
  for (std::size_t i = 0; i < all.size(); ++i) {
    const EmitterKey& a = all[i];
    const EmitterKey& b = all[std::min(i + 1, all.size() - 1)];
    const bool lasts = i + 1 == all.size(), begins = i == 0;
    if (a.time > to && !begins) continue;
    if (b.time < from && !lasts) continue;
    for (const double at : {from, to}) {
      const double t = b.time > a.time ? std::clamp((at - a.time) / (b.time - a.time), 0.0, 1.0) : 0.0;
      include((1.0 - t) * a.velocity + t * b.velocity);
    }
  }
  return speed;
}

std::size_t Emitter::bytes() const {
  return cells.capacity() * sizeof(std::size_t) + (cover.part.capacity() + cover.inner.capacity()) * sizeof(Real) +
         cover.holds.capacity() + faces.capacity() * sizeof(Vec3d) + keys.capacity() * sizeof(EmitterKey);
}

double Emitter::area_across(const Vec3d& direction) const {
  if (!faces.empty()) {
    double area = 0.0;
    for (const Vec3d& face : faces) area += std::max(0.0, face.dot(direction));
    return area;
  }
  // Of the unit box or ball, along the direction as it is there, times how a volume grows.
  const Mat3d from = from_world.topLeftCorner<3, 3>();
  const Vec3d unit = from * direction;
  const double across = shape == Shape::kBox ? unit.cwiseAbs().sum() : 0.25 * M_PI * unit.norm();
  return across / std::abs(from.determinant());
}

void place_emitter(const Grid& g, const geometry::Surface* volume, Emitter& emitter) {
  const Shape shape{emitter, volume, kOnBorder * g.h};
  NodeCover block = block_around(g, shape.extent());
  const Vec3i end = end_of(block);
  bool inside = false;
  emitter.cells.clear();
  for_block(block.low, end, [&](const Vec3i& at) {
    Vec3i place;
    if (!wrap(g, at, false, place) || !shape.contains(g.cell_center(at[0], at[1], at[2]))) return;
    inside = inside || place == at;
    emitter.cells.push_back(g.cell(place[0], place[1], place[2]));
  });
  if (!inside) refuse_empty(g, shape, "middles of cells");
  emitter.cells.shrink_to_fit();
  emitter.faces.clear();
  emitter.cover = {};
  if (!emitter.has_velocity) return;
  find_cover(g, shape, block);
  inside = false;
  for_block(block.low, end, [&](const Vec3i& at) {
    Vec3i place;
    inside = inside || (block.holds[block.index(at)] && wrap(g, at, true, place));
  });
  if (!inside) refuse_empty(g, shape, "nodes");
  emitter.cover = std::move(block);
  if (!volume) return;
  for (const geometry::Triangle& t : volume->mesh.triangles) {
    const Vec3d& a = volume->mesh.points[static_cast<std::size_t>(t[0])];
    const Vec3d &b = volume->mesh.points[static_cast<std::size_t>(t[1])],
                &c = volume->mesh.points[static_cast<std::size_t>(t[2])];
    emitter.faces.push_back(0.5 * (b - a).cross(c - a));
  }
}

void apply_emitters(const Grid& g, const std::vector<Emitter>& emitters, double time, double dt,
                    const std::vector<Real>& cell_fraction, const std::vector<Real>& specific_volume, Real fluid_volume,
                    FluidState& state, VectorField* velocity) {
  for (const Emitter& emitter : emitters) {
    const Emission emission = emitter.emission(time, dt);
    if (!(emission.share > 0.0)) continue;
    for (const std::size_t c : emitter.cells) {
      if (!cell_fraction.empty() && cell_fraction[c] > Real(0.5)) continue;
      if (!state.smoke.empty()) state.smoke[c] = static_cast<Real>(emission.density);
      if (!state.temperature.empty()) state.temperature[c] = static_cast<Real>(emission.temperature);
    }
    if (!emitter.has_velocity || !velocity) continue;
    const Vec3 v = emission.velocity.cast<Real>();
    for_block(emitter.cover.low, end_of(emitter.cover), [&](const Vec3i& at) {
      Vec3i place;
      if (!emitter.cover.holds[emitter.cover.index(at)] || !wrap(g, at, true, place)) return;
      for_twins(g, place, [&](std::size_t n) {
        if (specific_volume.empty() || specific_volume[n] == fluid_volume) velocity->set(n, v);
      });
    });
  }
}

double find_sources(const Grid& g, const Emitter& emitter, const Emission& emission,
                    const std::vector<std::uint8_t>& fixed, const std::vector<std::uint8_t>& owned,
                    const std::vector<Real>& specific_volume, Real fluid_volume, std::vector<SourceCell>& sources) {
  const double speed = emission.velocity.norm();
  if (!(speed > 0.0)) return 0.0;
  const Vec3d v = emission.share * emission.velocity;
  const double wanted = emission.share * speed * emitter.area_across(emission.velocity / speed);
  const NodeCover& cover = emitter.cover;
  const std::size_t first = sources.size();
  double alone = 0.0, total = 0.0;  // what a region without walls and solids would bring; what it brings [m^3/s]
  const Vec3i low = cover.low, end = end_of(cover);
  // Positive flux out of each cell of the block, with all corners and with those that are free.
  for_block({low[0] - 1, low[1] - 1, low[2] - 1}, end, [&](const Vec3i& at) {
    double all = 0.0, here = 0.0;
    Vec3i place;
    const bool inside = wrap(g, at, false, place) && (owned.empty() || !owned[g.padded(place[0], place[1], place[2])]);
    for (const auto& corner : grid::kCorner) {
      const Vec3i node = {at[0] + corner[0], at[1] + corner[1], at[2] + corner[2]};
      if (!cover.within(node)) continue;
      const double part = static_cast<double>(cover.part[cover.index(node)]),
                   inner = static_cast<double>(cover.inner[cover.index(node)]);
      const std::size_t n = inside ? g.node(place[0] + corner[0], place[1] + corner[1], place[2] + corner[2]) : 0;
      const bool flows = inside && (specific_volume.empty() || specific_volume[n] == fluid_volume);
      for (int a = 0; a < 3; ++a) {
        const double out = (corner[a] ? 0.25 : -0.25) * g.h * g.h * v[a];
        all += part * out;
        if (flows && !(fixed[n] & (1u << a))) here += inner * out;
      }
    }
    alone += std::max(0.0, all);
    if (!(here > 0.0)) return;
    total += here;
    sources.push_back(
        {place, static_cast<Real>(here), static_cast<Real>(emission.density), static_cast<Real>(emission.temperature)});
  });
  // Scaled to the flux of the region.
  if (!(alone > 0.0) || !(total > 0.0)) return 0.0;
  const double flux = std::min(wanted, total * wanted / alone);
  const double to_rate = flux / total / (g.h * g.h * g.h);
  for (std::size_t s = first; s < sources.size(); ++s)
    sources[s].rate = static_cast<Real>(to_rate * static_cast<double>(sources[s].rate));
  return flux;
}

}  // namespace efsi::fluid
