#include "capi/definition.hpp"

#include <cmath>
#include <sstream>
#include <string>

#include "base/error.hpp"
#include "base/math_types.hpp"
#include "base/refuse.hpp"
#include "frame/parameter_table.inc"

namespace efsi::capi {
namespace {

std::string describe(const Limits& limits) {
  std::ostringstream text;
  const bool below = std::isfinite(limits.min), above = std::isfinite(limits.max);
  if (below && above && !limits.min_exclusive)
    text << "between " << limits.min << " and " << limits.max;
  else if (below)
    text << (limits.min_exclusive ? "> " : ">= ") << limits.min;
  if (above && !(below && !limits.min_exclusive)) text << (below ? " and " : "") << "at most " << limits.max;
  return text.str();
}

void check_value(const std::string& field, double value, const Limits& limits) {
  const bool in = (limits.min_exclusive ? value > limits.min : value >= limits.min) && value <= limits.max;
  if (in && std::isfinite(value)) return;
  const std::string bounds = describe(limits);
  if (std::isfinite(value)) refuse(field, value, bounds);
  refuse(field, value, bounds.empty() ? "a finite number" : "a finite number, " + bounds);
}

}  // namespace

void check(const char* field, double value, const Limits& limits) { check_value(field, value, limits); }

void check(const char* field, std::int32_t value, const Limits& limits) { check_value(field, value, limits); }

void check(const char* field, const EfsiVec3& value, const Limits& limits) {
  const std::string name = field;
  check_value(name + ".x", value.x, limits);
  check_value(name + ".y", value.y, limits);
  check_value(name + ".z", value.z, limits);
}

void check_transform(const char* field, const double (&transform)[16]) {
  const std::string name = field;
  for (int i = 0; i < 16; ++i) {
    const std::string entry = name + "[" + std::to_string(i) + "]";
    if (!std::isfinite(transform[i])) refuse(entry, transform[i], "a finite number");
    const double last = i == 15 ? 1.0 : 0.0;
    if (i >= 12 && transform[i] != last) refuse(entry, transform[i], i == 15 ? "1" : "0");
  }
  // Relative to the lengths of the columns, so that small regions are no smaller than large ones.
  Mat3d linear;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) linear(r, c) = transform[4 * r + c];
  const double size = linear.col(0).norm() * linear.col(1).norm() * linear.col(2).norm();
  const double determinant = linear.determinant();
  if (!(std::abs(determinant) > 1e-9 * size) || !std::isfinite(1.0 / determinant)) {
    std::ostringstream text;
    text << field << ": its determinant is " << determinant << ": must be invertible";
    throw Error(ErrorCode::kArgument, text.str());
  }
}

void check_header(const char* type, const char* initializer, std::uint32_t struct_size, std::uint32_t expected_size,
                  std::uint32_t magic) {
  const std::string hint = std::string(": initialise the definition with ") + initializer;
  if (magic != kMagic) throw Error(ErrorCode::kArgument, std::string(type) + ".magic is wrong" + hint);
  if (struct_size != expected_size)
    throw Error(ErrorCode::kArgument, std::string(type) + ".struct_size = " + std::to_string(struct_size) +
                                          ": must be " + std::to_string(expected_size) + hint +
                                          " of the same version of the library");
}

#define EFSI_CHECK_PARAMETER(type, field, min, max, exclusive) \
  check(#type "." #field, def.field, Limits{min, max, (exclusive) != 0});

void check_definition(const EfsiSimulationDef& def) {
  check_header("EfsiSimulationDef", "efsi_simulation_def_init", def.struct_size, sizeof(def), def.magic);
#define EFSI_CHECK(name, field, kind, initial, min, max, exclusive, unit) \
  EFSI_CHECK_PARAMETER(EfsiSimulationDef, field, min, max, exclusive)
  EFSI_DOMAIN_PARAMETERS(EFSI_CHECK)
#undef EFSI_CHECK
  check("EfsiSimulationDef.domain_min", def.domain_min, {});
  check("EfsiSimulationDef.domain_size", def.domain_size, {0.0, kInfinity, true});
  check("EfsiSimulationDef.gravity", def.gravity, {});
  check("EfsiSimulationDef.threads", def.threads, {0.0, 1024.0, false});
}

void check_definition(const EfsiSolidDef& def) {
  check_header("EfsiSolidDef", "efsi_solid_def_init", def.struct_size, sizeof(def), def.magic);
#define EFSI_CHECK(name, field, kind, initial, min, max, exclusive, unit) \
  EFSI_CHECK_PARAMETER(EfsiSolidDef, field, min, max, exclusive)
  EFSI_SOLID_PARAMETERS(EFSI_CHECK)
#undef EFSI_CHECK
}

void check_definition(const EfsiEmitterDef& def) {
  check_header("EfsiEmitterDef", "efsi_emitter_def_init", def.struct_size, sizeof(def), def.magic);
#define EFSI_CHECK(name, field, kind, initial, min, max, exclusive, unit) \
  EFSI_CHECK_PARAMETER(EfsiEmitterDef, field, min, max, exclusive)
  EFSI_EMITTER_PARAMETERS(EFSI_CHECK)
#undef EFSI_CHECK
  check("EfsiEmitterDef.shape", def.shape, {0.0, 1.0, false});
  check_transform("EfsiEmitterDef.transform", def.transform);
}

void check_definition(const EfsiForceDef& def) {
  check_header("EfsiForceDef", "efsi_force_def_init", def.struct_size, sizeof(def), def.magic);
#define EFSI_CHECK(name, field, kind, initial, min, max, exclusive, unit) \
  EFSI_CHECK_PARAMETER(EfsiForceDef, field, min, max, exclusive)
  EFSI_FORCE_PARAMETERS(EFSI_CHECK)
#undef EFSI_CHECK
  check("EfsiForceDef.shape", def.shape, {0.0, 1.0, false});
  check_transform("EfsiForceDef.transform", def.transform);
}

void check_definition(const EfsiVdbDef& def) {
  check_header("EfsiVdbDef", "efsi_vdb_def_init", def.struct_size, sizeof(def), def.magic);
  check_transform("EfsiVdbDef.transform", def.transform);
  check("EfsiVdbDef.density_threshold", def.density_threshold, {0.0, kInfinity, false});
  check("EfsiVdbDef.half_float", def.half_float, {0.0, 1.0, false});
  check("EfsiVdbDef.write_velocity", def.write_velocity, {0.0, 1.0, false});
}

}  // namespace efsi::capi
