#include "solid/particles/passengers.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "base/error.hpp"
#include "grid/interpolate.hpp"
#include "solid/map/inverse_map.hpp"

namespace efsi::solid {
namespace {

constexpr double kStride = 0.5;        // cells of material between two corrections
constexpr double kHeld = 0.01;         // cells: a place with more left does not hold the point
constexpr double kLeastVolume = 0.05;  // of det F^-1, below which the map is not followed
constexpr std::size_t kBuckets = 32;   // along an axis

// The vertices of a surface in boxes, for the nearest one.
class Vertices {
 public:
  explicit Vertices(const std::vector<Vec3d>& points) : points_(points), low_(points.front()) {
    Vec3d high = low_;
    for (const Vec3d& x : points) {
      low_ = low_.cwiseMin(x);
      high = high.cwiseMax(x);
    }
    size_ = std::max((high - low_).maxCoeff(), 1e-30) / static_cast<double>(kBuckets) * (1.0 + 1e-9);
    bucket_.resize(kBuckets * kBuckets * kBuckets);
    for (std::size_t i = 0; i < points.size(); ++i)
      bucket_[index(place(points[i]))].push_back(static_cast<std::int32_t>(i));
  }

  // The first of the nearest.
  std::int32_t nearest(const Vec3d& x) const {
    const Vec3i at = place(x);
    const Vec3d inside = x.cwiseMax(low_).cwiseMin(low_ + Vec3d::Constant(size_ * kBuckets));
    const double outside = (x - inside).norm();
    double least = std::numeric_limits<double>::infinity();
    std::int32_t found = 0;
    for (int ring = 0; ring < static_cast<int>(kBuckets); ++ring) {
      if (least < std::numeric_limits<double>::infinity() && std::sqrt(least) < (ring - 1) * size_ - outside) break;
      look_at_ring(at, ring, x, least, found);
    }
    return found;
  }

 private:
  Vec3i place(const Vec3d& x) const {
    Vec3i at;
    for (std::size_t a = 0; a < 3; ++a)
      at[a] = static_cast<int>(std::clamp((x - low_)[static_cast<Eigen::Index>(a)] / size_, 0.0, kBuckets - 1.0));
    return at;
  }
  static std::size_t index(const Vec3i& at) {
    return static_cast<std::size_t>(at[0]) +
           kBuckets * (static_cast<std::size_t>(at[1]) + kBuckets * static_cast<std::size_t>(at[2]));
  }
  void look_at_ring(const Vec3i& at, int ring, const Vec3d& x, double& least, std::int32_t& found) const {
    const int last = static_cast<int>(kBuckets) - 1;
    for (int k = std::max(0, at[2] - ring); k <= std::min(last, at[2] + ring); ++k)
      for (int j = std::max(0, at[1] - ring); j <= std::min(last, at[1] + ring); ++j)
        for (int i = std::max(0, at[0] - ring); i <= std::min(last, at[0] + ring); ++i) {
          if (std::max({std::abs(i - at[0]), std::abs(j - at[1]), std::abs(k - at[2])}) != ring) continue;
          for (const std::int32_t v : bucket_[index({i, j, k})]) {
            const double square = (points_[static_cast<std::size_t>(v)] - x).squaredNorm();
            if (square < least || (square == least && v < found)) {
              least = square;
              found = v;
            }
          }
        }
  }

  const std::vector<Vec3d>& points_;
  Vec3d low_;
  double size_ = 1.0;
  std::vector<std::vector<std::int32_t>> bucket_;
};

void check_points(const SolidRest& rest, double h, const std::vector<Vec3d>& points) {
  if (points.empty()) throw Error(ErrorCode::kArgument, "points: there are none");
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::ostringstream text;
    text << "points[" << i << "] = (" << points[i][0] << ", " << points[i][1] << ", " << points[i][2] << ") m: ";
    if (!points[i].allFinite()) throw Error(ErrorCode::kArgument, text.str() + "must be finite");
    const double distance = rest.distance.sample(points[i]);
    if (distance <= kPassengerReach * h) continue;
    text << "is " << distance << " m out of the solid: must be at most " << kPassengerReach << " voxels, "
         << kPassengerReach * h << " m";
    throw Error(ErrorCode::kArgument, text.str());
  }
}

// State of the integration through the material.
struct Walker {
  Vec3d x, velocity;
  Mat3d f = Mat3d::Identity(), velocity_gradient = Mat3d::Zero();
  bool on_map = true;
};

// F, v and grad v where the walker is; false where the map holds no data or cannot be followed.
bool look(const SolidState& state, const std::array<std::size_t, 8>& corner, const grid::NodeSampler& sampler,
          Walker& walker) {
  Vec3d u;
  Mat3d gradient;
  if (!sample_displacement(state, corner, walker.x, u, gradient)) return false;
  const Mat3d inverse_f = Mat3d::Identity() - gradient;
  if (!(inverse_f.determinant() > kLeastVolume)) return false;
  walker.f = inverse_f.inverse();
  const Grid& g = state.band.grid;
  const auto velocity_at = [&](const Vec3d& x) {
    return Vec3d(sampler.vector(state.v, ((x - g.origin) / g.h).cast<Real>()).cast<double>());
  };
  walker.velocity = velocity_at(walker.x);
  double f[3];
  const std::size_t base = lower_node(g, walker.x, f);
  walker.velocity_gradient.setZero();
  for (std::size_t a = 0; a < 8; ++a) {
    Vec3d slope;
    for (int i = 0; i < 3; ++i) {
      slope[i] = grid::kCorner[a][i] ? 1.0 : -1.0;
      for (int j = 0; j < 3; ++j)
        if (j != i) slope[i] *= grid::kCorner[a][j] ? f[j] : 1.0 - f[j];
    }
    walker.velocity_gradient += state.v.at(base + corner[a]).cast<double>() * slope.transpose() / g.h;
  }
  return true;
}

void walk(const SolidState& state, const std::array<std::size_t, 8>& corner, const grid::NodeSampler& sampler,
          const Vec3d& from, const Vec3d& to, Walker& walker) {
  const double h = state.band.grid.h;
  const int strides = std::max(1, static_cast<int>(std::ceil((to - from).norm() / (kStride * h))));
  walker.on_map = look(state, corner, sampler, walker);
  for (int s = 1; s <= strides; ++s) {
    const Vec3d move = walker.f * (to - from) / strides;
    const Vec3d start = walker.x;
    walker.x += move;
    if (walker.on_map) {
      Vec3d x = walker.x;
      const double left = correct_point(state, corner, from + (to - from) * s / strides, x);
      if (left < kHeld * h && (x - walker.x).norm() < h) {
        walker.x = x;
        if (look(state, corner, sampler, walker)) continue;
        walker.on_map = false;
        walker.velocity += walker.velocity_gradient * (x - start);
        continue;
      }
      walker.on_map = false;
    }
    walker.velocity += walker.velocity_gradient * move;
  }
}

}  // namespace

Passenger make_passenger(const Parallel& parallel, const SolidRest& rest, double h, std::vector<Vec3d> points) {
  check_points(rest, h, points);
  Passenger passenger;
  passenger.anchor.resize(points.size());
  const Vertices vertices(rest.surface.points);
  parallel.for_each(static_cast<std::int64_t>(points.size()), [&](std::int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    passenger.anchor[p] = vertices.nearest(points[p]);
  });
  passenger.points = std::move(points);
  return passenger;
}

void carry(const Parallel& parallel, const SolidRest& rest, const SolidState& state, const Passenger& passenger,
           std::vector<Vec3d>& points, std::vector<Vec3d>& velocities) {
  const auto corner = grid::corner_offsets(state.band.grid);
  const grid::NodeSampler sampler(state.band.grid);
  points.resize(passenger.points.size());
  velocities.resize(passenger.points.size());
  parallel.for_each(static_cast<std::int64_t>(points.size()), [&](std::int64_t i) {
    const auto p = static_cast<std::size_t>(i);
    const auto vertex = static_cast<std::size_t>(passenger.anchor[p]);
    Walker walker;
    walker.x = state.surface[vertex];
    walker.velocity =
        sampler.vector(state.v, ((walker.x - state.band.grid.origin) / state.band.grid.h).cast<Real>()).cast<double>();
    walk(state, corner, sampler, rest.surface.points[vertex], passenger.points[p], walker);
    points[p] = walker.x;
    velocities[p] = walker.velocity;
  });
}

}  // namespace efsi::solid
