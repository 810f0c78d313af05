// Purpose: loops of base/parallel and base/team for ThreadSanitizer. It does not see how GCC's OpenMP library starts
// and joins threads and would report races that are none; here std::thread does that (start_threads.cpp). Usage: team
// [race]. "race": one loop in which two threads write one value, which must be reported.
#include <chrono>
#include <cstdio>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include "base/parallel.hpp"

using efsi::Parallel;

namespace {

int failures = 0;

void check(bool holds, const char* what) {
  if (holds) return;
  std::printf("failed: %s\n", what);
  ++failures;
}

// Plain values that loops write and the caller reads, between loops and inside them.
void loops(const Parallel& parallel) {
  std::vector<long> values(301, 0);
  const auto n = static_cast<std::int64_t>(values.size());
  for (int loop = 1; loop <= 200; ++loop) {
    parallel.for_each(n, [&](std::int64_t i) { values[static_cast<std::size_t>(i)] += loop; });
    // Written by the caller alone, read by all in the next loop.
    values[0] = values[static_cast<std::size_t>(n - 1)];
    const double sum = parallel.sum(
        n, [&](std::int64_t i) { return static_cast<double>(values[static_cast<std::size_t>(n - 1 - i)]); });
    check(sum == 301.0 * loop * (loop + 1) / 2, "a sum over what the loop before it has written");
    // The members fall asleep, and are woken.
    if (loop % 50 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  // A loop inside a loop is its thread's own.
  std::vector<double> sums(9);
  parallel.for_each(9, [&](std::int64_t i) {
    sums[static_cast<std::size_t>(i)] = parallel.sum(10, [](std::int64_t k) { return static_cast<double>(k); });
  });
  check(std::accumulate(sums.begin(), sums.end(), 0.0) == 9 * 45.0, "loops inside a loop");
  try {
    parallel.for_each(9, [](std::int64_t i) {
      if (i == 7) throw std::runtime_error("seven");
    });
    check(false, "an exception comes out of a loop");
  } catch (const std::runtime_error&) {
  }
}

void race() {
  const Parallel parallel(2);
  long sum = 0;
  parallel.together([&] {
    for (int loop = 0; loop < 20; ++loop)
      parallel.for_each(2, [&](std::int64_t i) {
        sum += i;  // the pause leaves the other part to the other thread
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      });
  });
  std::printf("%ld\n", sum);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "race") == 0) {
    race();
    return 0;
  }
  for (const int threads : {1, 2, 3, 8}) {
    const Parallel parallel(threads);
    loops(parallel);
    for (int team = 0; team < 20; ++team) parallel.together([&] { loops(parallel); });
  }
  // Two teams at once.
  const auto own = [] {
    const Parallel parallel(2);
    parallel.together([&] { loops(parallel); });
  };
  std::thread other(own);
  own();
  other.join();
  std::printf("%d failures\n", failures);
  return failures != 0;
}
