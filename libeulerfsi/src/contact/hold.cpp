#include "contact/hold.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace efsi::sim {
namespace {

constexpr unsigned kAllAxes = 7;

}  // namespace

Holds find_constraints(std::size_t solids, const system::VelocitySystem& system, const SolidPairs& contacts) {
  std::vector<std::size_t> first(solids);  // of each solid's cluster
  std::iota(first.begin(), first.end(), std::size_t{0});
  const auto join = [&](const SolidPairs& pairs) {
    for (const auto& [one, other] : pairs) {
      const auto [low, high] = std::minmax({first[one], first[other]});
      for (std::size_t& f : first)
        if (f == high) f = low;
    }
  };
  join(system.touching());
  join(contacts);
  Holds holds;
  holds.cluster_of.resize(solids);
  for (std::size_t l = 0; l < solids; ++l) {
    if (first[l] == l) {
      holds.cluster_of[l] = holds.clusters.size();
      holds.clusters.emplace_back();
    }
    holds.cluster_of[l] = holds.cluster_of[first[l]];
    Cluster& cluster = holds.clusters[holds.cluster_of[l]];
    cluster.solids.push_back(l);
    cluster.hold.axes |= system.fixed_axes(l);
    cluster.walls |= system.fixed_axes(l);
    if (cluster.solids.size() > 1) cluster.hold.axes = kAllAxes;
  }
  return holds;
}

system::StiffnessShares shares_while(bool touches, double pace, double strain, double growth) {
  return system::stiffness_shares(pace, touches ? std::numeric_limits<double>::infinity() : strain, growth);
}

solid::BodyStep transport_frame(const Hold& hold, const solid::Momenta& before, const solid::Momenta& after,
                                double dt) {
  return hold.touches() ? solid::constrained_step(before, after, hold.axes, dt) : solid::free_step(before, after, dt);
}

std::vector<solid::BodyStep> transport_frames(const Holds& holds, const std::vector<solid::Momenta>& before,
                                              const std::vector<solid::Momenta>& after, double dt) {
  std::vector<solid::BodyStep> frames(holds.cluster_of.size());
  if (after.empty()) return frames;
  for (const Cluster& cluster : holds.clusters) {
    const auto whole = [&](const std::vector<solid::Momenta>& momenta) {
      std::vector<solid::Momenta> parts;
      for (const std::size_t l : cluster.solids) parts.push_back(momenta[l]);
      return solid::joined(parts);
    };
    if (cluster.floats()) {
      const solid::BodyStep frame = solid::free_step(whole(before), whole(after), dt);
      for (const std::size_t l : cluster.solids) frames[l] = frame;
    } else {
      for (const std::size_t l : cluster.solids) frames[l] = transport_frame(cluster.hold, before[l], after[l], dt);
    }
  }
  return frames;
}

bool has_element_hysteresis(bool on_wall, double cells) { return cells < kSlow || !on_wall; }

double lost_beyond_film(const Hold& hold, const solid::SolidRest& rest, double h, double lost) {
  if (hold.touches()) return lost;
  const double film = kFilm * h * rest.area / rest.volume;
  return lost - std::clamp(lost, -film, film);
}

}  // namespace efsi::sim
