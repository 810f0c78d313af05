// Purpose: the state on disk, and its 64-bit hash. Values only: padding, statistics and thread counts do not count.
#pragma once

#include <cstdint>
#include <string>

#include "frame/state.hpp"

namespace efsi::sim {

class Simulation;

// Accumulates a 64-bit hash over values in the order given.
class Hash {
 public:
  void add(const void* data, std::size_t bytes);
  template <class T>
  void add_value(const T& value) {
    add(&value, sizeof(T));
  }
  template <class T>
  void add_array(const std::vector<T>& values) {
    add_value(static_cast<std::uint64_t>(values.size()));
    add(values.data(), values.size() * sizeof(T));
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0x9e3779b97f4a7c15ull;
};

std::uint64_t state_hash(const State& state);
// Writes to a temporary name beside `path`, then renames. Throws Error(kIo).
void save_checkpoint(const Simulation& simulation, const std::string& path);
// Throws Error(kIo) for a file that cannot be read or is damaged, Error(kCheckpoint) for another scene or version.
void restore_checkpoint(Simulation& simulation, const std::string& path);
// At any time: the whole state, from a checkpoint of a simulation with the same box, voxel size, fluid, periodic axes
// and rest shapes of solids and colliders in the same order. Parameters, emitters, forces, pins and motions may differ.
// Throws as above, with what differs.
void restore_state(Simulation& simulation, const std::string& path);
// Before the first step: the solids, but no colliders, get the state that they have in a checkpoint of a simulation
// with the same box, voxel size and rest shapes in the same order. All else may differ: what touches them is not taken
// over. Throws Error(kArgument) after a step; else as above, with what differs.
void restore_solids(Simulation& simulation, const std::string& path);

}  // namespace efsi::sim
