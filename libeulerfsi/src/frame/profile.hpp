// Purpose: time, tiles and bytes per stage: the columns of the paper's Table 2 plus "other".
#pragma once

#include <array>
#include <chrono>
#include <cstdint>

namespace efsi::sim {

// Values equal EFSI_STAGE_*.
enum class Stage : std::int32_t {
  kTimeStep = 0,
  kSolidMass,
  kComputeG,
  kFluidForces,
  kVelocitySolve,
  kPressureSolve,
  kSolidAdvection,
  kFluidAdvection,
  kSmoke,
  kContact,
  kSurface,
  kCheck,
  kOther,
  kCount
};

struct Profile {
  static constexpr std::size_t kStages = static_cast<std::size_t>(Stage::kCount);
  std::array<double, kStages> seconds{};
  std::array<std::uint64_t, kStages> tiles{};  // blocks of 8^3 points visited
  std::array<std::uint64_t, kStages> bytes{};  // field data visited, one pass each
  double total_seconds = 0.0;
  std::uint64_t steps = 0;
};

// Adds the time of its scope to a stage.
class ScopedTimer {
 public:
  ScopedTimer(Profile& profile, Stage stage) : profile_(profile), stage_(stage), start_(Clock::now()) {}
  ~ScopedTimer() {
    profile_.seconds[static_cast<std::size_t>(stage_)] += std::chrono::duration<double>(Clock::now() - start_).count();
  }
  ScopedTimer(const ScopedTimer&) = delete;
  ScopedTimer& operator=(const ScopedTimer&) = delete;
  // Records what the stage visited: points of the grid and bytes per point.
  void visited(std::uint64_t points, std::uint64_t bytes_per_point) {
    profile_.tiles[static_cast<std::size_t>(stage_)] += (points + 511) / 512;
    profile_.bytes[static_cast<std::size_t>(stage_)] += points * bytes_per_point;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Profile& profile_;
  Stage stage_;
  Clock::time_point start_;
};

}  // namespace efsi::sim
