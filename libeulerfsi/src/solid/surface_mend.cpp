#include "solid/surface_mend.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/disjoint_sets.hpp"

namespace efsi::solid {
namespace {

constexpr double kRounding = 5e-4;    // cells: of edges without a length
constexpr int kRounds = 4;            // of looking for torn edges and moving their ends
constexpr int kSweeps = 16;           // over clusters that have lost all points
constexpr double kRelaxation = 0.5;   // of these
constexpr int kTurns = 12;            // towards the best rotation
constexpr double kSmallTurn = 1e-6;   // [rad]
constexpr double kNearest = 1e-3;     // cells: nearer than that points weigh the same
constexpr double kSoftness = 1.0;     // cells: added to the distance of a lost cluster

// A point at rest and now, and how much it counts.
struct Pair {
  Vec3d rest, now;
  double weight;
};

// x = now + rotation (X - rest), the best fit to weighted pairs.
struct RigidFit {
  Vec3d rest = Vec3d::Zero(), now = Vec3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Vec3d place(const Vec3d& material) const { return now + rotation * (material - rest); }
};

// Turns `start` step by step until the pairs fit best; where few pairs leave a turn open it stays as it was (Mueller et
// al. 2016).
RigidFit fit_rigid(const std::vector<Pair>& pairs, const Eigen::Quaterniond& start) {
  RigidFit fit;
  double sum = 0.0;
  for (const Pair& p : pairs) {
    sum += p.weight;
    fit.rest += p.weight * p.rest;
    fit.now += p.weight * p.now;
  }
  fit.rest /= sum;
  fit.now /= sum;
  Mat3d moment = Mat3d::Zero();
  for (const Pair& p : pairs) moment += p.weight * (p.now - fit.now) * (p.rest - fit.rest).transpose();
  const double size = moment.norm();
  fit.rotation = start;
  if (!(size > 0.0)) return fit;
  moment /= size;
  for (int n = 0; n < kTurns; ++n) {
    const Mat3d r = fit.rotation.toRotationMatrix();
    const Vec3d torque = r.col(0).cross(moment.col(0)) + r.col(1).cross(moment.col(1)) + r.col(2).cross(moment.col(2));
    const double grip = std::abs(r.cwiseProduct(moment).sum());
    const Vec3d turn = torque / (grip + 1e-9);
    const double angle = turn.norm();
    if (angle < kSmallTurn) break;
    fit.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) * fit.rotation;
    fit.rotation.normalize();
  }
  return fit;
}

class Mending {
 public:
  Mending(const Parallel& parallel, const SolidRest& rest, double max_stretch, std::vector<std::uint8_t>& lost,
          SolidState& state)
      : parallel_(parallel),
        rest_(rest.surface.points),
        triangles_(rest.surface.triangles),
        clusters_(rest.clusters),
        h_(state.band.grid.h),
        longest_(kTornStretch * max_stretch),
        lost_(lost),
        now_(state.surface) {}

  bool any_torn() const {
    const auto n = static_cast<std::int64_t>(triangles_.size());
    return parallel_.max(parallel_.ranges(n), 0.0, [&](std::int64_t range) {
      const std::int64_t begin = parallel_.range_begin(n, range), end = parallel_.range_begin(n, range + 1);
      for (std::int64_t t = begin; t < end; ++t)
        for (std::size_t side = 0; side < 3; ++side) {
          const auto& corner = triangles_[static_cast<std::size_t>(t)];
          if (torn(index(corner[side]), index(corner[(side + 1) % 3]))) return 1.0;
        }
      return 0.0;
    }) > 0.0;
  }

  // Marks the ends of torn edges, and the smaller of two parts between which there are no other edges.
  void lose_torn() {
    DisjointSets parts(now_.size());
    for_sides([&](std::size_t a, std::size_t b) {
      if (!torn(a, b)) parts.unite(a, b);
    });
    std::vector<std::size_t> size(now_.size(), 0);
    for (std::size_t i = 0; i < now_.size(); ++i) ++size[parts.find(i)];
    std::vector<std::uint8_t> smaller(now_.size(), 0);
    for_sides([&](std::size_t a, std::size_t b) {
      if (!torn(a, b)) return;
      lost_[a] = lost_[b] = 1;
      a = parts.find(a);
      b = parts.find(b);
      if (a != b) smaller[size[a] < size[b] || (size[a] == size[b] && a > b) ? a : b] = 1;
    });
    for (std::size_t i = 0; i < now_.size(); ++i)
      if (smaller[parts.find(i)]) lost_[i] = 1;
  }

  // Moves the lost points.
  void fill() {
    gather();
    if (kept_.empty()) return;  // nothing to go by
    settle();
    std::vector<Vec3d> moved(now_.size());
    parallel_.for_each(static_cast<std::int64_t>(now_.size()), [&](std::int64_t i) {
      if (lost_[index(i)]) moved[index(i)] = follow(index(i));
    });
    for (std::size_t i = 0; i < now_.size(); ++i)
      if (lost_[i]) now_[i] = moved[i];
  }

 private:
  static std::size_t index(std::int64_t i) { return static_cast<std::size_t>(i); }

  bool torn(std::size_t a, std::size_t b) const {
    const double limit = longest_ * (rest_[a] - rest_[b]).norm() + kRounding * h_;
    return (now_[a] - now_[b]).squaredNorm() > limit * limit;
  }

  template <class Visit>
  void for_sides(const Visit& visit) const {
    for (const geometry::Triangle& t : triangles_)
      for (std::size_t side = 0; side < 3; ++side) visit(index(t[side]), index(t[(side + 1) % 3]));
  }

  // Where the clusters are: by the points that are not lost, by all where all are.
  void gather() {
    const std::size_t count = clusters_.size();
    mean_.assign(count, {Vec3d::Zero(), Vec3d::Zero(), 0.0});
    empty_.clear();
    kept_.clear();
    for (std::size_t c = 0; c < count; ++c) {
      const auto add = [&](bool all) {
        for (std::int32_t m = clusters_.first[c]; m < clusters_.first[c + 1]; ++m) {
          const std::size_t i = index(clusters_.points[index(m)]);
          if (lost_[i] && !all) continue;
          mean_[c].rest += rest_[i];
          mean_[c].now += now_[i];
          mean_[c].weight += 1.0;
        }
      };
      add(false);
      const bool empty = mean_[c].weight == 0.0;
      if (empty) add(true);
      mean_[c].rest /= mean_[c].weight;
      mean_[c].now /= mean_[c].weight;
      (empty ? empty_ : kept_).push_back(c);
    }
    std::vector<Pair> all;
    for (const std::size_t c : kept_) all.push_back(mean_[c]);
    whole_ = all.empty() ? Eigen::Quaterniond::Identity() : fit_rigid(all, Eigen::Quaterniond::Identity()).rotation;
    rotation_.assign(count, whole_);
  }

  // Clusters without points that are kept move as those linked to them do.
  void settle() {
    std::vector<Vec3d> next(empty_.size());
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      parallel_.for_each(static_cast<std::int64_t>(empty_.size()), [&](std::int64_t e) {
        const std::size_t c = empty_[index(e)];
        std::vector<Pair> around;
        for (std::int32_t l = clusters_.first_link[c]; l < clusters_.first_link[c + 1]; ++l) {
          Pair p = mean_[index(clusters_.link[index(l)])];
          p.weight = 1.0 / ((p.rest - mean_[c].rest).squaredNorm() + h_ * h_);
          around.push_back(p);
        }
        next[index(e)] = mean_[c].now;
        if (around.empty()) return;
        const RigidFit fit = fit_rigid(around, rotation_[c]);
        rotation_[c] = fit.rotation;
        next[index(e)] += kRelaxation * (fit.place(mean_[c].rest) - mean_[c].now);
      });
      for (std::size_t e = 0; e < empty_.size(); ++e) mean_[empty_[e]].now = next[e];
    }
  }

  // Where the points around it take point i.
  Vec3d follow(std::size_t i) const {
    const std::size_t own = index(clusters_.of_point[i]);
    std::vector<Pair> around;
    const auto add_cluster = [&](std::size_t c) {
      const auto weigh = [&](const Vec3d& rest, const Vec3d& now, double softness, double count) {
        const double d = (rest - rest_[i]).squaredNorm() + softness * softness * h_ * h_;
        around.push_back({rest, now, count * h_ * h_ * h_ * h_ / (d * d)});
      };
      bool any = false;
      for (std::int32_t m = clusters_.first[c]; m < clusters_.first[c + 1]; ++m) {
        const std::size_t j = index(clusters_.points[index(m)]);
        if (lost_[j]) continue;
        any = true;
        weigh(rest_[j], now_[j], kNearest, 1.0);
      }
      if (!any) weigh(mean_[c].rest, mean_[c].now, kSoftness, mean_[c].weight);
    };
    add_cluster(own);
    for (std::int32_t l = clusters_.first_link[own]; l < clusters_.first_link[own + 1]; ++l)
      add_cluster(index(clusters_.link[index(l)]));
    return fit_rigid(around, rotation_[own]).place(rest_[i]);
  }

  const Parallel& parallel_;
  const std::vector<Vec3d>& rest_;
  const std::vector<geometry::Triangle>& triangles_;
  const SurfaceClusters& clusters_;
  double h_, longest_;
  std::vector<std::uint8_t>& lost_;
  std::vector<Vec3d>& now_;
  std::vector<Pair> mean_;                 // per cluster
  std::vector<std::size_t> kept_, empty_;  // clusters with and without points that are kept
  Eigen::Quaterniond whole_;
  std::vector<Eigen::Quaterniond> rotation_;  // per cluster
};

}  // namespace

void mend_surface(const Parallel& parallel, const SolidRest& rest, double max_stretch, std::vector<std::uint8_t>& lost,
                  SolidState& state) {
  if (rest.clusters.size() == 0) return;
  Mending mending(parallel, rest, max_stretch, lost, state);
  bool any = std::find(lost.begin(), lost.end(), 1) != lost.end();
  for (int round = 0; round < kRounds; ++round) {
    const bool torn = mending.any_torn();
    if (!torn && !(any && round == 0)) break;
    if (torn) mending.lose_torn();
    mending.fill();
  }
}

}  // namespace efsi::solid
