// Purpose: what a step, or several, report of solids that normal_impulse each other (EfsiContactPair);
// record/contact_record.hpp fills it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::sim {

inline constexpr double kResolved = 3.0;  // cells, at rest: parts as thick as that keep solids out

// A vertex of a solid that has come out of another one on another side than it went in, and where [m].
struct PassedVertex {
  std::size_t solid, vertex;
  Vec3d place;
};

// Two solids with an active row between them, or that exchange sides, or one with an active row between its folds;
// counts are sums over the steps in which one did, overlaps are at their starts.
struct ContactPair {
  std::size_t one = 0, other = 0;  // one < other; folds: one = other
  std::uint64_t steps = 0;
  std::uint64_t rows = 0, active_rows = 0, sticking_rows = 0;  // within reach of each other; of these, and of these
  double row_overlap = 0.0;                                    // deepest of a row beyond the skin [cells]; < 0: apart
  double surface_overlap = 0.0;                                // the same of vertices and rows, without the skin
  double normal_impulse = 0.0;                                 // sum of all impulses along their normals [N s]
  Vec3d impulse = Vec3d::Zero();                               // of `one` on `other`, 0 of folds [N s]
  std::optional<PassedVertex> passed;     // one that has gone through a part of at least kResolved cells
  std::uint64_t exchanged_vertices = 0;   // that came out of the other solid on another side than they went in
  Vec3d exchanged_place = Vec3d::Zero();  // of the first of them [m]
};
using ContactPairs = std::vector<ContactPair>;  // in the order of (one, other)
// The record of a pair, one < other, made where it is not there.
ContactPair& find_pair(ContactPairs& pairs, std::size_t one, std::size_t other);

}  // namespace efsi::sim
