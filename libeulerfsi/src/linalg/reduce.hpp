// Purpose: inner products with a fixed order of summation: partial sums of 4096 entries in double, added in order.
#pragma once

#include <cmath>
#include <vector>

#include "base/math_types.hpp"
#include "base/parallel.hpp"

namespace efsi::linalg {

inline constexpr std::int64_t kReduceChunk = 4096;

// One chunk of a dot product: four fixed lanes.
inline double dot_chunk(const Real* a, const Real* b, std::int64_t begin, std::int64_t end) {
  double lane[4] = {0, 0, 0, 0};
  std::int64_t i = begin;
  for (; i + 4 <= end; i += 4)
    for (int l = 0; l < 4; ++l) lane[l] += static_cast<double>(a[i + l]) * static_cast<double>(b[i + l]);
  for (; i < end; ++i) lane[0] += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

inline double dot(const Parallel& parallel, const std::vector<Real>& a, const std::vector<Real>& b) {
  const auto n = static_cast<std::int64_t>(a.size());
  const Real* pa = a.data();
  const Real* pb = b.data();
  return parallel.sum((n + kReduceChunk - 1) / kReduceChunk, [=](std::int64_t chunk) {
    const std::int64_t begin = chunk * kReduceChunk, end = std::min(n, begin + kReduceChunk);
    return dot_chunk(pa, pb, begin, end);
  });
}

inline double norm(const Parallel& parallel, const std::vector<Real>& a) { return std::sqrt(dot(parallel, a, a)); }

// x += s d, r -= s q; returns |r|^2, summed as dot does.
inline double advance(const Parallel& parallel, double s, const std::vector<Real>& d, const std::vector<Real>& q,
                      std::vector<Real>& x, std::vector<Real>& r) {
  const auto n = static_cast<std::int64_t>(x.size());
  const Real *pd = d.data(), *pq = q.data();
  Real *px = x.data(), *pr = r.data();
  const Real factor = static_cast<Real>(s);
  return parallel.sum((n + kReduceChunk - 1) / kReduceChunk, [=](std::int64_t chunk) {
    const std::int64_t begin = chunk * kReduceChunk, end = std::min(n, begin + kReduceChunk);
#pragma omp simd
    for (std::int64_t i = begin; i < end; ++i) {
      px[i] += factor * pd[i];
      pr[i] -= factor * pq[i];
    }
    return dot_chunk(pr, pr, begin, end);
  });
}

// y += s x
inline void add_scaled(const Parallel& parallel, std::vector<Real>& y, double s, const std::vector<Real>& x) {
  Real* py = y.data();
  const Real* px = x.data();
  const Real factor = static_cast<Real>(s);
  parallel.for_ranges(static_cast<std::int64_t>(y.size()), [=](std::int64_t begin, std::int64_t end) {
#pragma omp simd
    for (std::int64_t i = begin; i < end; ++i) py[i] += factor * px[i];
  });
}

// y = x + s y
inline void scale_add(const Parallel& parallel, std::vector<Real>& y, double s, const std::vector<Real>& x) {
  Real* py = y.data();
  const Real* px = x.data();
  const Real factor = static_cast<Real>(s);
  parallel.for_ranges(static_cast<std::int64_t>(y.size()), [=](std::int64_t begin, std::int64_t end) {
#pragma omp simd
    for (std::int64_t i = begin; i < end; ++i) py[i] = px[i] + factor * py[i];
  });
}

// y *= s
inline void scale(const Parallel& parallel, std::vector<Real>& y, double s) {
  Real* py = y.data();
  const Real factor = static_cast<Real>(s);
  parallel.for_ranges(static_cast<std::int64_t>(y.size()), [=](std::int64_t begin, std::int64_t end) {
#pragma omp simd
    for (std::int64_t i = begin; i < end; ++i) py[i] *= factor;
  });
}

// y = d * x, entry by entry
inline void multiply(const Parallel& parallel, std::vector<Real>& y, const std::vector<Real>& d,
                     const std::vector<Real>& x) {
  Real* py = y.data();
  const Real* pd = d.data();
  const Real* px = x.data();
  parallel.for_ranges(static_cast<std::int64_t>(y.size()), [=](std::int64_t begin, std::int64_t end) {
#pragma omp simd
    for (std::int64_t i = begin; i < end; ++i) py[i] = pd[i] * px[i];
  });
}

}  // namespace efsi::linalg
