#include "solid/affine_flow.hpp"

#include <Eigen/Dense>
#include <unsupported/Eigen/MatrixFunctions>

namespace efsi::solid {
namespace {

// Of masses and velocities about a point: of (1, x) with itself and with v.
struct Moments {
  Eigen::Matrix4d places = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 4, 3> velocities = Eigen::Matrix<double, 4, 3>::Zero();
};

Moments measure(const Parallel& parallel, const Band& band, const SolidWork& work, const Grid& nodes,
                const VectorField& velocity, const Vec3d& anchor) {
  const Grid& g = band.grid;
  const Vec3i lo = grid::offset(g, nodes);
  std::vector<Moments> planes(static_cast<std::size_t>(g.cells[2] + 1));
  parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    Moments& plane = planes[static_cast<std::size_t>(kk)];
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const double m = static_cast<double>(work.mass[g.node(i, j, k)]);
        if (!(m > 0.0)) continue;
        const Vec3d v = velocity.at(nodes.node(i + lo[0], j + lo[1], k + lo[2])).cast<double>();
        const Eigen::Vector4d place = (Eigen::Vector4d() << 1.0, g.node_position(i, j, k) - anchor).finished();
        plane.places += m * place * place.transpose();
        plane.velocities += m * place * v.transpose();
      }
  });
  Moments all;
  for (const Moments& plane : planes) {
    all.places += plane.places;
    all.velocities += plane.velocities;
  }
  return all;
}

// Takes the trace off, of the axes between opposite walls nothing.
void remove_trace(unsigned opposite, Mat3d& gradient) {
  Vec3d free;
  for (int a = 0; a < 3; ++a) free[a] = opposite >> a & 1 ? 0.0 : 1.0;
  if (free.sum() > 0.0) gradient.diagonal() -= gradient.trace() / free.sum() * free;
}

}  // namespace

AffineFlow fit_affine_flow(const Parallel& parallel, const Band& band, const SolidWork& work, const Grid& nodes,
                           const VectorField& velocity, const WallPlanes& walls, bool keeps_volume) {
  AffineFlow flow;
  flow.anchor = walls.anchor;
  const Moments moments = measure(parallel, band, work, nodes, velocity, flow.anchor);
  const Eigen::Matrix<double, 4, 3> fit = moments.places.ldlt().solve(moments.velocities);
  for (int a = 0; a < 3; ++a) {
    if (!(walls.axes >> a & 1)) {
      flow.drift[a] = fit(0, a);
      flow.gradient.row(a) = fit.col(a).tail<3>().transpose();
    } else if (!(walls.opposite >> a & 1)) {
      flow.gradient(a, a) = moments.velocities(a + 1, a) / moments.places(a + 1, a + 1);
    }
  }
  if (keeps_volume) remove_trace(walls.opposite, flow.gradient);
  return flow.drift.allFinite() && flow.gradient.allFinite() ? flow : AffineFlow{};
}

AffineStep affine_step(const AffineFlow& flow, double dt) {
  Eigen::Matrix4d rate = Eigen::Matrix4d::Zero();  // of (x - anchor, 1)
  rate.topLeftCorner<3, 3>() = dt * flow.gradient;
  rate.topRightCorner<3, 1>() = dt * flow.drift;
  const Eigen::Matrix4d moved = rate.exp();
  const Mat3d forward = moved.topLeftCorner<3, 3>();
  return {moved.topRightCorner<3, 1>(), forward - Mat3d::Identity(), forward.inverse() - Mat3d::Identity()};
}

}  // namespace efsi::solid
