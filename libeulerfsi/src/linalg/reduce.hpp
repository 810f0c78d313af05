// Purpose: sums and updates of whole vectors. Inner products have a fixed order of summation: chunks of 4096 entries in
// eight partial sums in double, added in order.
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "base/math_types.hpp"
#include "base/parallel.hpp"

namespace efsi::linalg {

inline constexpr std::int64_t kReduceChunk = 4096;

double dot(const Parallel& parallel, const std::vector<Real>& a, const std::vector<Real>& b);
// a.b and a.c, of which each is summed as dot does.
std::pair<double, double> dots(const Parallel& parallel, const std::vector<Real>& a, const std::vector<Real>& b,
                               const std::vector<Real>& c);
double sum(const Parallel& parallel, const std::vector<Real>& a);  // in the same order
inline double norm(const Parallel& parallel, const std::vector<Real>& a) { return std::sqrt(dot(parallel, a, a)); }

// x += s d, r -= s q; returns |r|^2, summed as dot does.
double advance(const Parallel& parallel, double s, const std::vector<Real>& d, const std::vector<Real>& q,
               std::vector<Real>& x, std::vector<Real>& r);
// d = z + s d; returns d.r, summed as dot does.
double turn(const Parallel& parallel, std::vector<Real>& d, double s, const std::vector<Real>& z,
            const std::vector<Real>& r);
// y += s x
void add_scaled(const Parallel& parallel, std::vector<Real>& y, double s, const std::vector<Real>& x);
// y = x + s y
void scale_add(const Parallel& parallel, std::vector<Real>& y, double s, const std::vector<Real>& x);
// y *= s
void scale(const Parallel& parallel, std::vector<Real>& y, double s);
// y = n times a value
void fill(const Parallel& parallel, std::vector<Real>& y, std::size_t n, Real value);
// y = x
void copy(const Parallel& parallel, std::vector<Real>& y, const std::vector<Real>& x);
// y = s d x, entry by entry; y may be longer
void multiply(const Parallel& parallel, std::vector<Real>& y, const std::vector<Real>& d, const std::vector<Real>& x,
              Real s = 1);

}  // namespace efsi::linalg
