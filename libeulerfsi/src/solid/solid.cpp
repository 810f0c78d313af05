#include "solid/solid.hpp"

#include <algorithm>

#include "base/byte_count.hpp"
#include "solid/hexahedron.hpp"

namespace efsi::solid {

std::size_t SolidWork::bytes() const {
  const std::size_t reals =
      fraction.size() + volume_ratio.size() + mass.size() + 3 * force_velocity.size() + dilatation.size();
  return reals * sizeof(Real) + (element.size() + element_cell.size() + element_corner.size()) * sizeof(std::int32_t) +
         point.size() * sizeof(PointBlock) + hourglass_force.size() * sizeof(hourglass_force[0]) + carries.size() +
         layer.size() + sliver.size() + element_factor.size() * sizeof(double) + element_middle.size() * sizeof(Vec3) +
         near_folds.size() * sizeof(NearPair) +
         fold_places.place.size() * (sizeof(fold_places.place[0]) + sizeof(fold_places.normal[0]));
}

std::size_t PrescribedShape::bytes() const {
  return surface->mesh.points.size() * sizeof(Vec3d) + surface->mesh.triangles.size() * sizeof(geometry::Triangle) +
         surface->distance.values.size() * sizeof(float) + nearest.bytes();
}

std::size_t state_bytes(const SolidState& state) {
  ByteCount count;
  visit_fields(state, count);
  return count.bytes;
}

std::size_t SolidWork::owned_cells() const {
  return static_cast<std::size_t>(std::count(sliver.begin(), sliver.end(), 0));
}

Vec3d SolidWork::middle(std::size_t e) const {
  return element_middle.empty() ? Vec3d(Vec3d::Zero()) : Vec3d(element_middle[e].cast<double>());
}

Vec3d SolidWork::local_point(std::size_t e, std::size_t q) const {
  return quadrature_point(static_cast<int>(q), points_per_element, middle(e));
}

void SolidWork::resize_elements(int points) {
  points_per_element = points;
  point.resize(blocks() * static_cast<std::size_t>(points));
  for (std::size_t e = element_cell.size(); e < blocks() * kBlock; ++e)
    for (std::size_t q = 0; q < static_cast<std::size_t>(points); ++q) set_element_point(e, q, ElementPoint{});
}

ElementPoint SolidWork::element_point(std::size_t e, std::size_t q) const {
  const PointBlock& block = point[e / kBlock * static_cast<std::size_t>(points_per_element) + q];
  const std::size_t lane = e % kBlock;
  ElementPoint value;
  for (int i = 0; i < 9; ++i) value.axes[i] = block.axes[i][lane];
  for (int i = 0; i < 6; ++i) value.normal[i] = block.normal[i][lane];
  for (int i = 0; i < 9; ++i) value.pair[i] = block.pair[i][lane];
  for (int i = 0; i < 6; ++i) value.stress[i] = block.stress[i][lane];
  for (int i = 0; i < 3; ++i) value.local[i] = block.local[i][lane];
  for (int i = 0; i < 4; ++i) value.hourglass[i] = block.hourglass[i][lane];
  return value;
}

void SolidWork::set_element_point(std::size_t e, std::size_t q, const ElementPoint& value) {
  PointBlock& block = point[e / kBlock * static_cast<std::size_t>(points_per_element) + q];
  const std::size_t lane = e % kBlock;
  for (int i = 0; i < 9; ++i) block.axes[i][lane] = value.axes[i];
  for (int i = 0; i < 6; ++i) block.normal[i][lane] = value.normal[i];
  for (int i = 0; i < 9; ++i) block.pair[i][lane] = value.pair[i];
  for (int i = 0; i < 6; ++i) block.stress[i][lane] = value.stress[i];
  for (int i = 0; i < 3; ++i) block.local[i][lane] = value.local[i];
  for (int i = 0; i < 4; ++i) block.hourglass[i][lane] = value.hourglass[i];
}

Band make_band(const Grid& global, Vec3i lo, Vec3i hi) {
  Band band;
  band.grid.h = global.h;
  for (std::size_t a = 0; a < 3; ++a) {
    lo[a] = std::clamp(lo[a] - kBandMargin, 0, global.cells[a] - 1);
    hi[a] = std::clamp(hi[a] + kBandMargin, lo[a] + 1, global.cells[a]);
    band.grid.cells[a] = hi[a] - lo[a];
  }
  band.grid.lo = lo;
  band.grid.origin = global.node_position(lo[0], lo[1], lo[2]);
  return band;
}

void move_band(SolidState& state, const Band& band) {
  const std::size_t n = band.grid.node_count();
  const Band& old = state.band;
  const Vec3i &new_lo = band.grid.lo, &old_lo = old.grid.lo;
  VectorField u, v, change;
  u.assign(n);
  v.assign(n);
  const bool changes = state.change.size() > 0;
  if (changes) change.assign(n);
  std::vector<std::uint8_t> valid(n, 0), stiff(state.stiff.empty() ? 0 : band.grid.cell_count(), 0);
  int begin[3], end[3];  // nodes that both bands have: begin .. end
  for (std::size_t a = 0; a < 3; ++a) {
    begin[a] = std::max(new_lo[a], old_lo[a]);
    end[a] = std::min(new_lo[a] + band.grid.cells[a], old_lo[a] + old.grid.cells[a]);
  }
  const auto for_box = [&](int last, const auto& body) {  // body(indices in the old band, in the new one)
    for (int k = begin[2]; k <= end[2] - last; ++k)
      for (int j = begin[1]; j <= end[1] - last; ++j)
        for (int i = begin[0]; i <= end[0] - last; ++i)
          body(Vec3i{i - old_lo[0], j - old_lo[1], k - old_lo[2]}, Vec3i{i - new_lo[0], j - new_lo[1], k - new_lo[2]});
  };
  if (!state.valid.empty())
    for_box(0, [&](const Vec3i& f, const Vec3i& t) {
      const std::size_t from = old.grid.node(f[0], f[1], f[2]), to = band.grid.node(t[0], t[1], t[2]);
      u.set(to, state.u.at(from));
      v.set(to, state.v.at(from));
      if (changes) change.set(to, state.change.at(from));
      valid[to] = state.valid[from];
    });
  if (!stiff.empty())
    for_box(1, [&](const Vec3i& f, const Vec3i& t) {
      stiff[band.grid.cell(t[0], t[1], t[2])] = state.stiff[old.grid.cell(f[0], f[1], f[2])];
    });
  state.band = band;
  state.u = std::move(u);
  state.v = std::move(v);
  state.change = std::move(change);
  state.valid = std::move(valid);
  state.stiff = std::move(stiff);
}

}  // namespace efsi::solid
