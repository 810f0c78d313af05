// Purpose: threads that wait for the next loop. An OpenMP region costs its threads' sleep and waking, fifty
// microseconds; a loop handed to a team costs one or two. Who is awake takes the next part of a loop, so that a thread
// without a processor delays nobody: any awake thread, including the caller, takes the next chunk.
#pragma once

#include <atomic>
#include <cstdint>

namespace efsi {

class Team {
 public:
  // Does part `part` of a loop; must not throw.
  using Work = void (*)(void* context, std::int64_t part);

  static constexpr std::int64_t kMostParts = 0xffff;

  // For the leader: work(context, part) for every part in [0, parts), parts at most kMostParts. Returns when all are
  // done.
  void run(std::int64_t parts, Work work, void* context);
  // For a member: takes part in loops until the leader dismisses the team.
  void serve();
  void dismiss();
  // Whether the calling thread does a part now: a loop inside a loop is its own.
  bool busy() const;

 private:
  void take_parts(std::uint32_t loop);

  Work work_ = nullptr;
  void* context_ = nullptr;
  bool leader_busy_ = false;
  std::atomic<bool> dismissed_{false};
  // Number of the loop (32 bits), its parts (16), the next part that nobody has taken (16).
  alignas(64) std::atomic<std::uint64_t> ticket_{0};
  alignas(64) std::atomic<std::uint32_t> loop_{0};  // members wait for it to change
  alignas(64) std::atomic<std::uint32_t> open_{0};  // parts that are not done; the leader waits for zero
};

}  // namespace efsi
