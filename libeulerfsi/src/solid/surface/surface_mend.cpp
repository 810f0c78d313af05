#include "solid/surface/surface_mend.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/disjoint_sets.hpp"
#include "solid/map/credible.hpp"

namespace efsi::solid {
namespace {

constexpr double kShortest = 5e-4;   // cells: of edges without a length
constexpr int kRounds = 8;           // of looking for torn edges
constexpr int kSweeps = 8;           // over clusters that have lost all points
constexpr int kSmoothings = 8;       // over lost points
constexpr int kMoreSmoothings = 32;  // where torn edges lie between lost points only
constexpr int kTurns = 12;           // towards the best rotation
constexpr double kSmallTurn = 1e-6;  // [rad]
constexpr double kHold = 0.01;       // of the rotation that a fit starts from, over the moment of its points
constexpr double kOnePlace = 1e-9;   // a moment below that part of the uncentred one is rounding
constexpr double kNearest = 1e-3;    // cells: nearer than that points weigh the same
constexpr double kSoftness = 1.0;    // cells: added to the distance of a lost cluster

// x = now + rotation (X - rest).
struct RigidFit {
  Vec3d rest, now;
  Eigen::Quaterniond rotation;
  Vec3d place(const Vec3d& material) const { return now + rotation * (material - rest); }
};

// Weighted sums over points at rest and now, seen from a place at rest and one now that are near them.
class WeightedPairs {
 public:
  WeightedPairs(const Vec3d& rest, const Vec3d& now) : from_rest_(rest), from_now_(now) {}
  void add(const Vec3d& rest, const Vec3d& now, double weight) {
    const Vec3d at_rest = rest - from_rest_, at_present = now - from_now_;
    weight_ += weight;
    rest_ += weight * at_rest;
    now_ += weight * at_present;
    moment_ += (weight * at_present) * at_rest.transpose();
  }
  bool empty() const { return weight_ == 0.0; }

  // The best fit. Turns `start` step by step (Mueller et al. 2016): what few points leave open stays as it was.
  RigidFit fit(const Eigen::Quaterniond& start) const {
    const Vec3d rest = rest_ / weight_, now = now_ / weight_;
    RigidFit best{from_rest_ + rest, from_now_ + now, start};
    Mat3d moment = moment_ / weight_ - now * rest.transpose();
    const double size = moment.norm();
    if (!(size > kOnePlace * moment_.norm() / weight_)) return best;
    moment = moment / size + kHold * start.toRotationMatrix();
    for (int n = 0; n < kTurns; ++n) {
      const Mat3d r = best.rotation.toRotationMatrix();
      Vec3d torque = Vec3d::Zero();
      for (int a = 0; a < 3; ++a) torque += r.col(a).cross(moment.col(a));
      const Vec3d turn = torque / (std::abs(r.cwiseProduct(moment).sum()) + kSmallTurn);
      const double angle = turn.norm();
      if (angle < kSmallTurn) break;
      best.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) * best.rotation;
      best.rotation.normalize();
    }
    return best;
  }

 private:
  Vec3d from_rest_, from_now_, rest_ = Vec3d::Zero(), now_ = Vec3d::Zero();
  Mat3d moment_ = Mat3d::Zero();
  double weight_ = 0.0;
};

// Where a cluster is: the mean of its points that are kept, of all of them where none is.
struct Mean {
  Vec3d rest = Vec3d::Zero(), now = Vec3d::Zero();
  double points = 0.0;
};

class Mending {
 public:
  Mending(const Parallel& parallel, const SolidRest& rest, double max_stretch,
          const std::vector<std::uint8_t>& extrapolated, std::vector<std::uint8_t>& lost, SolidState& state)
      : parallel_(parallel),
        rest_(rest.surface.points),
        triangles_(rest.surface.triangles),
        clusters_(rest.clusters),
        h_(state.band.grid.h),
        stretch_(max_stretch),
        made_up_(extrapolated),
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

  // Marks the ends of torn edges and what only torn edges join to the largest part of the surface; the next time the
  // clusters of the ends as well, then all that hangs together where the map is extrapolated, then the clusters around
  // too. Returns whether any point was not lost before.
  bool lose_torn(int time) {
    std::vector<std::uint8_t> apart = cut_off(), around(clusters_.size(), 0);
    for_sides([&](std::size_t a, std::size_t b) {
      if (torn(a, b)) apart[a] = apart[b] = around[cluster(a)] = around[cluster(b)] = 1;
    });
    if (time >= 2) add_made_up(apart);
    if (time >= 3) spread(around);
    bool any = false;
    for (std::size_t i = 0; i < now_.size(); ++i) {
      if (lost_[i] || !(apart[i] || (time >= 1 && around[cluster(i)]))) continue;
      lost_[i] = 1;
      any = true;
    }
    return any;
  }

  // Moves the lost points.
  void fill() {
    gather();
    if (empty_.size() == clusters_.size()) return;  // nothing to go by
    extend();
    settle();
    std::vector<Vec3d> moved(now_.size());
    parallel_.for_each(static_cast<std::int64_t>(now_.size()), [&](std::int64_t i) {
      if (lost_[index(i)]) moved[index(i)] = follow(index(i));
    });
    for (std::size_t i = 0; i < now_.size(); ++i)
      if (lost_[i]) now_[i] = moved[i];
    smooth(kSmoothings);
  }

  // Where neighbouring clusters disagree the difference is spread over more edges: every lost point moves to where
  // those beside it expect it, x = mean of y + R (X - Y) with weights 1/|X - Y|^2, so that edges share the difference
  // in proportion to their lengths. Point by point (Gauss-Seidel): two points in one place would change places for ever
  // if both moved at once.
  void smooth(int sweeps) {
    struct Side {
      std::size_t end, other;
      Vec3d edge;  // from `end` to `other`
      double weight;
    };
    std::vector<Side> sides;
    for_sides([&](std::size_t a, std::size_t b) {
      if (!placed_[cluster(a)] || !placed_[cluster(b)]) return;
      const Vec3d at_rest = rest_[b] - rest_[a];
      const Vec3d edge = 0.5 * (rotation_[cluster(a)] * at_rest + rotation_[cluster(b)] * at_rest);
      const double weight = h_ * h_ / (at_rest.squaredNorm() + kNearest * kNearest * h_ * h_);
      if (lost_[a]) sides.push_back({a, b, edge, weight});
      if (lost_[b]) sides.push_back({b, a, -edge, weight});
    });
    std::stable_sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) { return p.end < q.end; });
    for (int sweep = 0; sweep < sweeps; ++sweep)
      for (std::size_t s = 0; s < sides.size();) {
        const std::size_t end = sides[s].end;
        Vec3d sum = Vec3d::Zero();
        double weights = 0.0;
        for (; s < sides.size() && sides[s].end == end; ++s) {
          sum += sides[s].weight * (now_[sides[s].other] - sides[s].edge);
          weights += sides[s].weight;
        }
        now_[end] = sum / weights;
      }
  }

 private:
  static std::size_t index(std::int64_t i) { return static_cast<std::size_t>(i); }
  std::size_t cluster(std::size_t point) const { return index(clusters_.of_point[point]); }
  template <class Visit>
  void for_points(std::size_t c, const Visit& visit) const {
    for (std::int32_t m = clusters_.first[c]; m < clusters_.first[c + 1]; ++m) visit(index(clusters_.points[index(m)]));
  }
  template <class Visit>
  void for_links(std::size_t c, const Visit& visit) const {
    for (std::int32_t l = clusters_.first_link[c]; l < clusters_.first_link[c + 1]; ++l)
      visit(index(clusters_.link[index(l)]));
  }
  void spread(std::vector<std::uint8_t>& marked) const {
    const std::vector<std::uint8_t> before = marked;
    for (std::size_t c = 0; c < before.size(); ++c)
      if (before[c]) for_links(c, [&](std::size_t other) { marked[other] = 1; });
  }

  bool torn(std::size_t a, std::size_t b) const {
    const double limit = kSurfaceStretch.most * stretch_ * (rest_[a] - rest_[b]).norm() + kShortest * h_;
    return (now_[a] - now_[b]).squaredNorm() > limit * limit;
  }

  // Per point: whether edges that are not torn leave it out of the largest part of its piece of the surface.
  std::vector<std::uint8_t> cut_off() const {
    const std::size_t count = now_.size();
    DisjointSets pieces(count), parts(count);
    for_sides([&](std::size_t a, std::size_t b) {
      pieces.unite(a, b);
      if (!torn(a, b)) parts.unite(a, b);
    });
    std::vector<std::size_t> size(count, 0), largest(count, count);  // of a part, by its first point; of a piece
    for (std::size_t i = 0; i < count; ++i) ++size[parts.find(i)];
    for (std::size_t i = 0; i < count; ++i) {
      if (size[i] == 0) continue;
      std::size_t& best = largest[pieces.find(i)];
      if (best == count || size[i] > size[best]) best = i;
    }
    std::vector<std::uint8_t> out(count);
    for (std::size_t i = 0; i < count; ++i) out[i] = parts.find(i) != largest[pieces.find(i)];
    return out;
  }

  // Adds what edges between points with an extrapolated map connect with a marked one.
  void add_made_up(std::vector<std::uint8_t>& marked) const {
    DisjointSets blobs(now_.size());
    for_sides([&](std::size_t a, std::size_t b) {
      if (made_up_[a] && made_up_[b]) blobs.unite(a, b);
    });
    std::vector<std::uint8_t> any(now_.size(), 0);
    for (std::size_t i = 0; i < now_.size(); ++i)
      if (marked[i]) any[blobs.find(i)] = 1;
    for (std::size_t i = 0; i < now_.size(); ++i)
      if (any[blobs.find(i)]) marked[i] = 1;
  }

  template <class Visit>
  void for_sides(const Visit& visit) const {
    for (const geometry::Triangle& t : triangles_)
      for (std::size_t side = 0; side < 3; ++side) visit(index(t[side]), index(t[(side + 1) % 3]));
  }

  void gather() {
    mean_.assign(clusters_.size(), {});
    empty_.clear();
    std::vector<std::size_t> kept;
    for (std::size_t c = 0; c < clusters_.size(); ++c) {
      Mean& mean = mean_[c];
      const auto add = [&](std::size_t i) {
        mean.rest += rest_[i];
        mean.now += now_[i];
        mean.points += 1.0;
      };
      for_points(c, [&](std::size_t i) {
        if (!lost_[i]) add(i);
      });
      (mean.points > 0.0 ? kept : empty_).push_back(c);
      if (mean.points == 0.0) for_points(c, add);
      mean.rest /= mean.points;
      mean.now /= mean.points;
    }
    placed_.assign(clusters_.size(), 0);
    rotation_.assign(clusters_.size(), Eigen::Quaterniond::Identity());
    if (kept.empty()) return;
    WeightedPairs all(mean_[kept[0]].rest, mean_[kept[0]].now);
    for (const std::size_t c : kept) all.add(mean_[c].rest, mean_[c].now, 1.0);
    const Eigen::Quaterniond whole = all.fit(Eigen::Quaterniond::Identity()).rotation;
    rotation_.assign(clusters_.size(), whole);
    for (const std::size_t c : kept) placed_[c] = 1;
    for (const std::size_t c : kept) {
      bool beside = false;
      for_points(c, [&](std::size_t i) { beside = beside || lost_[i]; });
      for_links(c, [&](std::size_t other) { beside = beside || !placed_[other]; });
      if (beside) rotation_[c] = fit_placed(c, whole).rotation;
    }
  }

  // How the placed clusters linked to c move, and c itself where it is placed.
  RigidFit fit_placed(std::size_t c, const Eigen::Quaterniond& start) const {
    WeightedPairs around(mean_[c].rest, mean_[c].now);
    const auto add = [&](std::size_t other) {
      const Mean& m = mean_[other];
      if (placed_[other]) around.add(m.rest, m.now, h_ * h_ / ((m.rest - mean_[c].rest).squaredNorm() + h_ * h_));
    };
    add(c);
    for_links(c, add);
    return around.fit(start);
  }

  // Places the clusters without kept points as those linked to them move that are placed already.
  void extend() {
    std::vector<std::size_t> left = empty_, later;
    std::vector<std::pair<std::size_t, Vec3d>> found;
    for (; !left.empty(); left.swap(later)) {
      found.clear();
      later.clear();
      for (const std::size_t c : left) {
        std::size_t nearest = c;
        for_links(c, [&](std::size_t other) {
          const auto far = [&](std::size_t o) { return (mean_[o].rest - mean_[c].rest).squaredNorm(); };
          if (placed_[other] && (nearest == c || far(other) < far(nearest))) nearest = other;
        });
        if (nearest == c) {
          later.push_back(c);
          continue;
        }
        const RigidFit fit = fit_placed(c, rotation_[nearest]);
        rotation_[c] = fit.rotation;
        found.emplace_back(c, fit.place(mean_[c].rest));
      }
      if (found.empty()) return;  // nothing leads to what is left: it stays
      for (const auto& [c, now] : found) {
        mean_[c].now = now;
        placed_[c] = 1;
      }
    }
  }

  // Evens out what the places found from different sides do not agree in.
  void settle() {
    std::vector<Vec3d> next(empty_.size());
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      parallel_.for_each(static_cast<std::int64_t>(empty_.size()), [&](std::int64_t e) {
        const std::size_t c = empty_[index(e)];
        next[index(e)] = mean_[c].now;
        if (!placed_[c]) return;
        const RigidFit fit = fit_placed(c, rotation_[c]);
        rotation_[c] = fit.rotation;
        next[index(e)] = fit.place(mean_[c].rest);
      });
      for (std::size_t e = 0; e < empty_.size(); ++e) mean_[empty_[e]].now = next[e];
    }
  }

  // Where the points around it take point i.
  Vec3d follow(std::size_t i) const {
    const std::size_t own = cluster(i);
    WeightedPairs around(rest_[i], mean_[own].now);
    const auto weigh = [&](const Vec3d& rest, const Vec3d& now, double softness, double points) {
      const double d = (rest - rest_[i]).squaredNorm() / (h_ * h_) + softness * softness;
      around.add(rest, now, points / (d * d));
    };
    const auto add_cluster = [&](std::size_t c) {
      bool any = false;
      for_points(c, [&](std::size_t j) {
        if (lost_[j]) return;
        any = true;
        weigh(rest_[j], now_[j], kNearest, 1.0);
      });
      if (!any && placed_[c]) weigh(mean_[c].rest, mean_[c].now, kSoftness, mean_[c].points);
    };
    if (!placed_[own]) return now_[i];
    add_cluster(own);
    for_links(own, add_cluster);
    return around.fit(rotation_[own]).place(rest_[i]);
  }

  const Parallel& parallel_;
  const std::vector<Vec3d>& rest_;
  const std::vector<geometry::Triangle>& triangles_;
  const SurfaceClusters& clusters_;
  double h_, stretch_;
  const std::vector<std::uint8_t>& made_up_;
  std::vector<std::uint8_t>& lost_;
  std::vector<Vec3d>& now_;
  std::vector<Mean> mean_;                    // per cluster
  std::vector<Eigen::Quaterniond> rotation_;  // per cluster
  std::vector<std::uint8_t> placed_;          // per cluster: known to be at its mean
  std::vector<std::size_t> empty_;            // clusters without points that are kept
};

}  // namespace

void repair_surface(const Parallel& parallel, const SolidRest& rest, double max_stretch,
                    const std::vector<std::uint8_t>& extrapolated, std::vector<std::uint8_t>& lost, SolidState& state) {
  if (rest.clusters.size() == 0) return;
  Mending mending(parallel, rest, max_stretch, extrapolated, lost, state);
  if (std::find(lost.begin(), lost.end(), 1) != lost.end()) mending.fill();
  for (int round = 0; round < kRounds && mending.any_torn(); ++round) {
    if (mending.lose_torn(round))
      mending.fill();
    else
      mending.smooth(kMoreSmoothings);
  }
}

}  // namespace efsi::solid
