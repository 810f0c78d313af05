// Purpose: definition structs: their header, and limits of values. The table of parameters is the source of the limits.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "capi/guard.hpp"
#include "capi/sized.hpp"
#include "eulerfsi/eulerfsi.h"

namespace efsi::capi {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A finite value in [min, max], or in (min, max] with min_exclusive, without what is in (0, least).
struct Limits {
  double min = -kInfinity;
  double max = kInfinity;
  bool min_exclusive = false;
  double least = 0.0;
};

// Throw Error(kArgument) "EfsiSolidDef.density = -3: must be > 0".
void check(const char* field, double value, const Limits& limits);
void check(const char* field, std::int32_t value, const Limits& limits);
void check(const char* field, const EfsiVec3& value, const Limits& limits);
// Row-major affine 4x4 matrix: finite, last row 0 0 0 1, invertible.
void check_transform(const char* field, const double (&transform)[16]);

// What is common to all definitions: the size that the caller's header gives it, and a mark that it was initialised.
struct DefinitionHeader {
  std::uint32_t struct_size, magic;
};

// Header and defaults of a caller's definition of `size` bytes; what lies beyond the library's own is zero.
template <class Def>
EfsiStatus initialise(Def* def, std::size_t size) noexcept;

// The caller's definition, checked field by field against parameters.toml and the rules that the headers state; members
// that the caller's header did not have are at their defaults. argument: "efsi_solid_add: def".
template <class Def>
Def receive(const Def* def, const char* argument);

}  // namespace efsi::capi
