#include "base/team.hpp"

#include <omp.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace efsi {
namespace {

// A thread looks this often for news before it sleeps: about as long as waking it takes. A longer wait gains nothing
// where there is work and takes the processor from others where there is none.
constexpr int kLooks = 1000;

void relax() {
#if defined(__x86_64__)
  _mm_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

// Waits until the value is no longer `old`.
void wait_for_news(const std::atomic<std::uint32_t>& value, std::uint32_t old) {
  for (int look = 0; look < kLooks; ++look) {
    if (value.load(std::memory_order_acquire) != old) return;
    relax();
  }
  value.wait(old, std::memory_order_acquire);
}

}  // namespace

void Team::run(std::int64_t parts, Work work, void* context) {
  work_ = work;
  context_ = context;
  open_.store(static_cast<std::uint32_t>(parts), std::memory_order_relaxed);
  const std::uint32_t loop = loop_.load(std::memory_order_relaxed) + 1;
  ticket_.store(static_cast<std::uint64_t>(loop) << 32 | static_cast<std::uint64_t>(parts) << 16,
                std::memory_order_release);
  loop_.store(loop, std::memory_order_release);
  loop_.notify_all();
  leader_busy_ = true;
  take_parts(loop);
  leader_busy_ = false;
  for (std::uint32_t left = open_.load(std::memory_order_acquire); left != 0;
       left = open_.load(std::memory_order_acquire))
    wait_for_news(open_, left);
}

// A part is taken from the ticket of the loop that it belongs to: while it is not done the leader cannot begin another,
// so that work_ and context_ are those of this loop.
void Team::take_parts(std::uint32_t loop) {
  std::uint64_t ticket = ticket_.load(std::memory_order_acquire);
  while (true) {
    const std::uint64_t parts = ticket >> 16 & 0xffff, next = ticket & 0xffff;
    if (static_cast<std::uint32_t>(ticket >> 32) != loop || next >= parts) return;
    if (!ticket_.compare_exchange_weak(ticket, ticket + 1, std::memory_order_acq_rel, std::memory_order_acquire))
      continue;
    work_(context_, static_cast<std::int64_t>(next));
    if (open_.fetch_sub(1, std::memory_order_acq_rel) == 1) open_.notify_one();
    ticket = ticket_.load(std::memory_order_acquire);
  }
}

// Of the threads of a team only the leader reads what the leader writes.
bool Team::busy() const { return omp_get_thread_num() != 0 || leader_busy_; }

void Team::serve() {
  std::uint32_t seen = 0;
  while (true) {
    wait_for_news(loop_, seen);
    seen = loop_.load(std::memory_order_acquire);
    if (dismissed_.load(std::memory_order_relaxed)) return;  // perhaps before the loop that it was woken for is over
    take_parts(seen);
  }
}

void Team::dismiss() {
  dismissed_.store(true, std::memory_order_relaxed);
  loop_.fetch_add(1, std::memory_order_release);
  loop_.notify_all();
}

}  // namespace efsi
