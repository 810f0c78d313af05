// Purpose: loops on several threads, with and without a team that waits for them.
#include <atomic>
#include <catch2/catch.hpp>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include "base/parallel.hpp"

using namespace efsi;

namespace {

// Every iteration is made once, whatever the length of the loop.
void check_loops(const Parallel& parallel) {
  for (const int n : {0, 1, 2, 3, 7, 64, 1000}) {
    std::vector<std::atomic<int>> made(static_cast<std::size_t>(n));
    parallel.for_each(n, [&](std::int64_t i) { ++made[static_cast<std::size_t>(i)]; });
    for (const auto& count : made) CHECK(count == 1);
  }
}

double sum_of_thirds(const Parallel& parallel) {
  return parallel.sum(1000, [](std::int64_t i) { return 1.0 / (3.0 + static_cast<double>(i)); });
}

}  // namespace

TEST_CASE("Every iteration is made once, with any number of threads, in a team and outside", "[law]") {
  for (const int threads : {1, 2, 3, 8, 100}) {
    const Parallel parallel(threads);
    check_loops(parallel);
    parallel.together([&] { check_loops(parallel); });
    check_loops(parallel);
  }
}

TEST_CASE("Sums have the same bits with any number of threads, in a team and outside", "[law]") {
  const double expected = sum_of_thirds(Parallel(1));
  for (const int threads : {2, 3, 8}) {
    const Parallel parallel(threads);
    CHECK(sum_of_thirds(parallel) == expected);
    parallel.together([&] { CHECK(sum_of_thirds(parallel) == expected); });
  }
}

TEST_CASE("Thousands of short loops with pauses between them end, and all their parts are made", "[law]") {
  const Parallel parallel(4);
  std::vector<std::int64_t> values(64, 0);
  parallel.together([&] {
    for (int loop = 0; loop < 20000; ++loop) {
      parallel.for_each(64, [&](std::int64_t i) { values[static_cast<std::size_t>(i)] += i; });
      if (loop % 5000 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));  // the others fall asleep
    }
  });
  for (std::size_t i = 0; i < values.size(); ++i) CHECK(values[i] == 20000 * static_cast<std::int64_t>(i));
}

TEST_CASE("Two teams in one process, each with a leader of its own, do not meet", "[law]") {
  const auto work = [](std::int64_t& total) {
    const Parallel parallel(2);
    parallel.together([&] {
      for (int loop = 0; loop < 2000; ++loop)
        total += static_cast<std::int64_t>(parallel.sum(10, [](std::int64_t i) { return static_cast<double>(i); }));
    });
  };
  std::int64_t first = 0, second = 0;
  std::thread other([&] { work(second); });
  work(first);
  other.join();
  CHECK(first == 2000 * 45);
  CHECK(second == 2000 * 45);
}

TEST_CASE("A loop inside a loop is made by the thread that meets it") {
  const Parallel parallel(3);
  std::vector<double> sums(30);
  const auto nested = [&] {
    parallel.for_each(30, [&](std::int64_t i) { sums[static_cast<std::size_t>(i)] = sum_of_thirds(parallel); });
  };
  parallel.together(nested);
  for (const double sum : sums) CHECK(sum == sum_of_thirds(Parallel(1)));
}

TEST_CASE("An exception comes out of a loop and of a team, and the next loop works") {
  const Parallel parallel(3);
  const auto fail = [&] {
    parallel.for_each(100, [](std::int64_t i) {
      if (i == 77) throw std::runtime_error("seventy-seven");
    });
  };
  CHECK_THROWS_WITH(fail(), "seventy-seven");
  CHECK_THROWS_WITH(parallel.together([&] { fail(); }), "seventy-seven");
  CHECK_THROWS_WITH(parallel.together([] { throw std::runtime_error("outside a loop"); }), "outside a loop");
  check_loops(parallel);
}
