// Purpose: definition structs: their header, and limits of values. The table of parameters is the source of the limits.
#pragma once

#include <cstdint>
#include <limits>

#include "eulerfsi/eulerfsi.h"

namespace efsi::capi {

inline constexpr std::uint32_t kMagic = 0x49534645u;  // "EFSI"
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A finite value in [min, max], or in (min, max] with min_exclusive.
struct Limits {
  double min = -kInfinity;
  double max = kInfinity;
  bool min_exclusive = false;
};

// Throw Error(kArgument) "EfsiSolidDef.density = -3: must be > 0".
void check(const char* field, double value, const Limits& limits);
void check(const char* field, std::int32_t value, const Limits& limits);
void check(const char* field, const EfsiVec3& value, const Limits& limits);
// Row-major affine 4x4 matrix: finite, last row 0 0 0 1, invertible.
void check_transform(const char* field, const double (&transform)[16]);
// Throws Error(kArgument) for a definition that its efsi_*_def_init has not filled; initializer: that function's name.
void check_header(const char* type, const char* initializer, std::uint32_t struct_size, std::uint32_t expected_size,
                  std::uint32_t magic);

template <class Def>
void start_definition(Def& def) {
  def = Def{};
  def.struct_size = static_cast<std::uint32_t>(sizeof(Def));
  def.magic = kMagic;
}

// Header and every field, against parameters.toml and the rules that the header states.
void check_definition(const EfsiSimulationDef& def);
void check_definition(const EfsiSolidDef& def);
void check_definition(const EfsiEmitterDef& def);
void check_definition(const EfsiForceDef& def);
void check_definition(const EfsiVdbDef& def);

}  // namespace efsi::capi
