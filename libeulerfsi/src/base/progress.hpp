// Purpose: how far a long call is, and the wish to stop it; silent unless the caller installs a callback.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>

#include "base/error.hpp"
#include "base/parallel.hpp"

namespace efsi {

class Progress {
 public:
  // Called on the caller's thread with the part that is done, 0..1. Returns true to stop.
  using Callback = std::function<bool(double fraction)>;
  Progress() = default;
  explicit Progress(Callback callback) : callback_(std::move(callback)) {}

  // Throws Error(kCancelled) where the callback asks to stop.
  void at(double fraction) const {
    if (callback_ && callback_(from_ + fraction * (to_ - from_))) throw Error(ErrorCode::kCancelled, "cancelled");
  }

  // The progress of a stage that is the part from..to of this one.
  Progress part(double from, double to) const {
    Progress stage = *this;
    stage.from_ = from_ + from * (to_ - from_);
    stage.to_ = from_ + to * (to_ - from_);
    return stage;
  }

  // parallel.for_each(n, body), reporting between batches.
  template <class Body>
  void for_each(const Parallel& parallel, std::int64_t n, const Body& body) const {
    constexpr std::int64_t kBatches = 64;
    const std::int64_t batch = std::max<std::int64_t>(4 * parallel.threads(), (n + kBatches - 1) / kBatches);
    for (std::int64_t begin = 0; begin < n; begin += batch) {
      at(static_cast<double>(begin) / static_cast<double>(n));
      parallel.for_each(std::min(batch, n - begin), [&](std::int64_t i) { body(begin + i); });
    }
  }

 private:
  Callback callback_;
  double from_ = 0.0, to_ = 1.0;
};

}  // namespace efsi
