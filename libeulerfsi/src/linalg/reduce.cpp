#include "linalg/reduce.hpp"

#include <algorithm>
#include <cstring>

#include "base/kernel.hpp"

namespace efsi::linalg {
namespace {

constexpr int kLanes = 8;
// Eight entries, and eight partial sums: the compiler maps them to what the machine has, with the same bits.
typedef Real Entries __attribute__((vector_size(kLanes * sizeof(Real))));
typedef double Lanes __attribute__((vector_size(kLanes * sizeof(double))));

EFSI_INLINE Lanes load(const Real* a) {
  Entries entries;
  std::memcpy(&entries, a, sizeof(entries));
  return __builtin_convertvector(entries, Lanes);
}

EFSI_INLINE double sum_of(const Lanes& l) { return ((l[0] + l[1]) + (l[2] + l[3])) + ((l[4] + l[5]) + (l[6] + l[7])); }

EFSI_KERNEL double dot_entries(std::int64_t n, const Real* a, const Real* b) {
  Lanes lanes = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) lanes += load(a + i) * load(b + i);
  double rest = 0.0;
  for (; i < n; ++i) rest += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return sum_of(lanes) + rest;
}

EFSI_KERNEL void dots_entries(std::int64_t n, const Real* a, const Real* b, const Real* c, double* sums) {
  Lanes ab = {}, ac = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    const Lanes x = load(a + i);
    ab += x * load(b + i);
    ac += x * load(c + i);
  }
  double rest[2] = {0.0, 0.0};
  for (; i < n; ++i) {
    rest[0] += static_cast<double>(a[i]) * static_cast<double>(b[i]);
    rest[1] += static_cast<double>(a[i]) * static_cast<double>(c[i]);
  }
  sums[0] = sum_of(ab) + rest[0];
  sums[1] = sum_of(ac) + rest[1];
}

EFSI_KERNEL double sum_entries(std::int64_t n, const Real* a) {
  Lanes lanes = {};
  std::int64_t i = 0;
  for (; i + kLanes <= n; i += kLanes) lanes += load(a + i);
  double rest = 0.0;
  for (; i < n; ++i) rest += static_cast<double>(a[i]);
  return sum_of(lanes) + rest;
}

EFSI_KERNEL void add_entries(std::int64_t n, Real s, const Real* x, Real* y) {
#pragma omp simd
  for (std::int64_t i = 0; i < n; ++i) y[i] += s * x[i];
}

EFSI_KERNEL void scale_add_entries(std::int64_t n, Real s, const Real* x, Real* y) {
#pragma omp simd
  for (std::int64_t i = 0; i < n; ++i) y[i] = x[i] + s * y[i];
}

EFSI_KERNEL void multiply_entries(std::int64_t n, Real s, const Real* d, const Real* x, Real* y) {
#pragma omp simd
  for (std::int64_t i = 0; i < n; ++i) y[i] = s * d[i] * x[i];
}

EFSI_KERNEL void scale_entries(std::int64_t n, Real s, Real* y) {
#pragma omp simd
  for (std::int64_t i = 0; i < n; ++i) y[i] *= s;
}

// Calls term(begin, length) for each chunk of n entries; the sum of the results, in order.
template <class Term>
double sum_chunks(const Parallel& parallel, std::size_t n, const Term& term) {
  const auto entries = static_cast<std::int64_t>(n);
  return parallel.sum((entries + kReduceChunk - 1) / kReduceChunk, [&](std::int64_t chunk) {
    const std::int64_t begin = chunk * kReduceChunk;
    return term(begin, std::min(entries - begin, kReduceChunk));
  });
}

// Calls body(begin, length) for one range per thread.
template <class Body>
void for_parts(const Parallel& parallel, std::size_t n, const Body& body) {
  parallel.for_ranges(static_cast<std::int64_t>(n),
                      [&](std::int64_t begin, std::int64_t end) { body(begin, end - begin); });
}

}  // namespace

double dot(const Parallel& parallel, const std::vector<Real>& a, const std::vector<Real>& b) {
  return sum_chunks(parallel, a.size(), [&](std::int64_t begin, std::int64_t length) {
    return dot_entries(length, a.data() + begin, b.data() + begin);
  });
}

std::pair<double, double> dots(const Parallel& parallel, const std::vector<Real>& a, const std::vector<Real>& b,
                               const std::vector<Real>& c) {
  const auto n = static_cast<std::int64_t>(a.size()), chunks = (n + kReduceChunk - 1) / kReduceChunk;
  std::vector<double> parts(static_cast<std::size_t>(2 * chunks));
  parallel.for_each(chunks, [&](std::int64_t chunk) {
    const std::int64_t begin = chunk * kReduceChunk;
    dots_entries(std::min(n - begin, kReduceChunk), a.data() + begin, b.data() + begin, c.data() + begin,
                 &parts[static_cast<std::size_t>(2 * chunk)]);
  });
  std::pair<double, double> total{0.0, 0.0};
  for (std::size_t chunk = 0; chunk < parts.size(); chunk += 2) {
    total.first += parts[chunk];
    total.second += parts[chunk + 1];
  }
  return total;
}

double sum(const Parallel& parallel, const std::vector<Real>& a) {
  return sum_chunks(parallel, a.size(),
                    [&](std::int64_t begin, std::int64_t length) { return sum_entries(length, a.data() + begin); });
}

double advance(const Parallel& parallel, double s, const std::vector<Real>& d, const std::vector<Real>& q,
               std::vector<Real>& x, std::vector<Real>& r) {
  const Real factor = static_cast<Real>(s);
  return sum_chunks(parallel, x.size(), [&](std::int64_t begin, std::int64_t length) {
    add_entries(length, factor, d.data() + begin, x.data() + begin);
    add_entries(length, -factor, q.data() + begin, r.data() + begin);
    return dot_entries(length, r.data() + begin, r.data() + begin);
  });
}

double turn(const Parallel& parallel, std::vector<Real>& d, double s, const std::vector<Real>& z,
            const std::vector<Real>& r) {
  return sum_chunks(parallel, d.size(), [&](std::int64_t begin, std::int64_t length) {
    scale_add_entries(length, static_cast<Real>(s), z.data() + begin, d.data() + begin);
    return dot_entries(length, d.data() + begin, r.data() + begin);
  });
}

void add_scaled(const Parallel& parallel, std::vector<Real>& y, double s, const std::vector<Real>& x) {
  for_parts(parallel, y.size(), [&](std::int64_t begin, std::int64_t length) {
    add_entries(length, static_cast<Real>(s), x.data() + begin, y.data() + begin);
  });
}

void scale_add(const Parallel& parallel, std::vector<Real>& y, double s, const std::vector<Real>& x) {
  for_parts(parallel, y.size(), [&](std::int64_t begin, std::int64_t length) {
    scale_add_entries(length, static_cast<Real>(s), x.data() + begin, y.data() + begin);
  });
}

void scale(const Parallel& parallel, std::vector<Real>& y, double s) {
  for_parts(parallel, y.size(), [&](std::int64_t begin, std::int64_t length) {
    scale_entries(length, static_cast<Real>(s), y.data() + begin);
  });
}

void fill(const Parallel& parallel, std::vector<Real>& y, std::size_t n, Real value) {
  y.resize(n);
  for_parts(parallel, n,
            [&](std::int64_t begin, std::int64_t length) { std::fill_n(y.data() + begin, length, value); });
}

void copy(const Parallel& parallel, std::vector<Real>& y, const std::vector<Real>& x) {
  y.resize(x.size());
  for_parts(parallel, y.size(),
            [&](std::int64_t begin, std::int64_t length) { std::copy_n(x.data() + begin, length, y.data() + begin); });
}

void multiply(const Parallel& parallel, std::vector<Real>& y, const std::vector<Real>& d, const std::vector<Real>& x,
              Real s) {
  for_parts(parallel, x.size(), [&](std::int64_t begin, std::int64_t length) {
    multiply_entries(length, s, d.data() + begin, x.data() + begin, y.data() + begin);
  });
}

}  // namespace efsi::linalg
