#include "transport/wall_frames.hpp"

namespace efsi::sim {
namespace {

// What the flow moves a centre less than its velocity does, along axes without walls.
Vec3d missing_slide(const solid::AffineFlow& flow, const Vec3d& center, const Vec3d& velocity, unsigned axes,
                    double dt) {
  const solid::AffineStep step = solid::affine_step(flow, dt);
  Vec3d missing = dt * velocity - step.shift - step.forward * (center - flow.anchor);
  for (int a = 0; a < 3; ++a)
    if (axes >> a & 1) missing[a] = 0.0;
  return missing;
}

}  // namespace

solid::WallPlanes walls_of(const grid::Grid& box, std::span<const WallRow> rows, std::size_t l, unsigned axes,
                           const Vec3d& center) {
  const Vec3d high = box.node_position(box.cells[0], box.cells[1], box.cells[2]);
  unsigned lower = 0, upper = 0;
  for (const WallRow& row : rows)
    if (row.solid == l) (row.out > 0 ? lower : upper) |= 1u << row.axis;
  const unsigned one = lower ^ upper;  // across the other axes it cannot move
  solid::WallPlanes planes{axes, axes & ~one, center};
  for (int a = 0; a < 3; ++a)
    if (axes >> a & 1) planes.anchor[a] = upper >> a & 1 ? high[a] : box.origin[a];
  return planes;
}

void strain_wall_frames(const StepContext& step, const Holds& holds, std::span<const WallRow> rows,
                        const SolidStates& states, const SolidWorks& solids, const std::vector<solid::Momenta>& momenta,
                        const grid::Grid& common, NodeVelocity& velocity, std::vector<solid::BodyStep>& frames) {
  if (momenta.empty()) return;
  for (const Cluster& cluster : holds.clusters) {
    const std::size_t l = cluster.solids.front();
    if (cluster.solids.size() > 1 || !cluster.hold.touches() || is_pinned(step.scene.pins, l)) continue;
    if (step.scene.solids[l].plastic.yields()) continue;
    const solid::WallPlanes planes = walls_of(step.scene.grid, rows, l, cluster.hold.axes, momenta[l].center);
    const system::SolidView view(step.parallel, velocity.slip, l, velocity.field);
    frames[l].flow = solid::fit_affine_flow(step.parallel, states[l].band, solids[l], common, velocity.field, planes,
                                            solid::has_pressure(step.scene.solids[l]));
    if (!frames[l].flow.at_rest())
      frames[l].shift +=
          missing_slide(frames[l].flow, momenta[l].center, momenta[l].linear / momenta[l].mass, planes.axes, step.dt);
  }
}

}  // namespace efsi::sim
