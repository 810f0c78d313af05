// Purpose: the only place that starts threads. Loops are split into contiguous ranges whose results do not depend on
// the split; sums are taken over fixed slabs in a fixed order, so every thread count gives the same bits.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/team.hpp"

namespace efsi {

class Parallel {
 public:
  explicit Parallel(int threads = 1) : threads_(std::max(1, threads)) {}
  int threads() const { return threads_; }

  // Runs body(). Loops of this object inside it are handed to threads that wait for them: they cost a microsecond
  // instead of an OpenMP region of their own. An exception of the body is rethrown.
  template <class Body>
  void together(const Body& body) const {
    // More threads than processors would only wait for each other.
    const int members = std::min<int>(threads_, static_cast<int>(std::max(1u, std::thread::hardware_concurrency())));
    if (members == 1 || team_) {
      body();
      return;
    }
    Team team;
    std::exception_ptr error;
#pragma omp parallel num_threads(members)
    {
      bool leads = false;
#pragma omp master
      leads = true;
      if (leads) {
        team_ = &team;
        try {
          body();
        } catch (...) {
          error = std::current_exception();
        }
        team_ = nullptr;
        team.dismiss();
      } else {
        team.serve();
      }
    }
    if (error) std::rethrow_exception(error);
  }

  // Calls body(i) for i in [0, n); the iterations must not depend on each other.
  template <class Body>
  void for_each(std::int64_t n, const Body& body) const {
    for_ranges(n, [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t i = begin; i < end; ++i) body(i);
    });
  }

  // The ranges that for_ranges makes of [0, n).
  int ranges(std::int64_t n) const { return static_cast<int>(std::clamp<std::int64_t>(n, 1, threads_)); }
  std::int64_t range_begin(std::int64_t n, std::int64_t range) const { return n * range / ranges(n); }

  // Calls body(begin, end) on one contiguous range per thread. An exception of a body is rethrown on the caller's
  // thread.
  template <class Body>
  void for_ranges(std::int64_t n, const Body& body) const {
    if (threads_ == 1 || n < 2 || (team_ && team_->busy())) {
      body(std::int64_t{0}, n);
      return;
    }
    const int count = ranges(n);
    std::vector<std::exception_ptr> errors(static_cast<std::size_t>(count));
    auto range = [&](std::int64_t t) noexcept {
      try {
        body(range_begin(n, t), range_begin(n, t + 1));
      } catch (...) {
        errors[static_cast<std::size_t>(t)] = std::current_exception();
      }
    };
    if (team_) {
      team_->run(
          count, [](void* context, std::int64_t t) { (*static_cast<decltype(range)*>(context))(t); }, &range);
    } else {
#pragma omp parallel for num_threads(count) schedule(static, 1)
      for (int t = 0; t < count; ++t) range(t);
    }
    for (const auto& error : errors)
      if (error) std::rethrow_exception(error);
  }

  // Sum over i in [0, n) of term(i), a double, added up in the order of i.
  template <class Term>
  double sum(std::int64_t n, const Term& term) const {
    std::vector<double> parts(static_cast<std::size_t>(n));
    for_each(n, [&](std::int64_t i) { parts[static_cast<std::size_t>(i)] = term(i); });
    double total = 0.0;
    for (double part : parts) total += part;
    return total;
  }

  template <class Term>
  double max(std::int64_t n, double start, const Term& term) const {
    std::vector<double> parts(static_cast<std::size_t>(n), start);
    for_each(n, [&](std::int64_t i) { parts[static_cast<std::size_t>(i)] = term(i); });
    double best = start;
    for (double part : parts) best = std::max(best, part);
    return best;
  }

 private:
  int threads_;
  mutable Team* team_ = nullptr;  // inside together()
};

}  // namespace efsi
