#include "capi/definition.hpp"

#include <cctype>
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
  if (limits.least > 0.0)
    text << "0, or between " << limits.least << " and " << limits.max;
  else if (below && above && !limits.min_exclusive)
    text << "between " << limits.min << " and " << limits.max;
  else if (below)
    text << (limits.min_exclusive ? "> " : ">= ") << limits.min;
  if (above && !(below && !limits.min_exclusive)) text << (below ? " and " : "") << "at most " << limits.max;
  return text.str();
}

void check_value(const std::string& field, double value, const Limits& limits) {
  const bool in = (limits.min_exclusive ? value > limits.min : value >= limits.min) && value <= limits.max;
  const bool too_little = value > 0.0 && value < limits.least;
  if (in && !too_little && std::isfinite(value)) return;
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

namespace {

constexpr std::uint32_t kMagic = 0x49534645u;  // "EFSI"

// "EfsiSolidDef" -> "efsi_solid_def_init"; the names of the C API follow one rule.
template <class Def>
std::string initializer() {
  std::string name;
  for (const char* c = Layout<Def>::name; *c; ++c) {
    if (std::isupper(static_cast<unsigned char>(*c)) && !name.empty()) name += '_';
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(*c)));
  }
  return name + "_init";
}

void check_header(const DefinitionHeader& header, const std::string& name, const std::string& init) {
  const std::string hint = ": initialise the definition with " + init;
  if (header.magic != kMagic) throw Error(ErrorCode::kArgument, name + ".magic is wrong" + hint);
  if (header.struct_size < sizeof(DefinitionHeader))
    throw Error(ErrorCode::kArgument, name + ".struct_size = " + std::to_string(header.struct_size) +
                                          ": must be at least " + std::to_string(sizeof(DefinitionHeader)) + hint);
}

void set_identity(double (&transform)[16]) {
  for (int a = 0; a < 4; ++a) transform[5 * a] = 1.0;
}

#define EFSI_DEFAULT(name, field, kind, initial, min, max, exclusive, least, unit) def.field = initial;

void set_defaults(EfsiSimulationDef& def) {
  EFSI_DOMAIN_PARAMETERS(EFSI_DEFAULT)
  def.domain_size = {1.0, 1.0, 1.0};
}
void set_defaults(EfsiSolidDef& def) { EFSI_SOLID_PARAMETERS(EFSI_DEFAULT) }
void set_defaults(EfsiEmitterDef& def) {
  EFSI_EMITTER_PARAMETERS(EFSI_DEFAULT)
  set_identity(def.transform);
}
void set_defaults(EfsiForceDef& def) {
  EFSI_FORCE_PARAMETERS(EFSI_DEFAULT)
  set_identity(def.transform);
}
void set_defaults(EfsiVdbDef& def) {
  constexpr double kDensityThreshold = 1e-3;
  set_identity(def.transform);
  def.density_threshold = kDensityThreshold;
  def.write_velocity = 1;
  def.region_min = {-kInfinity, -kInfinity, -kInfinity};
  def.region_max = {kInfinity, kInfinity, kInfinity};
}

#undef EFSI_DEFAULT

#define EFSI_CHECK(name, field, kind, initial, min, max, exclusive, least, unit) \
  check((owner + "." #field).c_str(), def.field, Limits{min, max, (exclusive) != 0, least});

void check_values(const EfsiSimulationDef& def, const std::string& owner) {
  EFSI_DOMAIN_PARAMETERS(EFSI_CHECK)
  check("EfsiSimulationDef.domain_min", def.domain_min, {});
  check("EfsiSimulationDef.domain_size", def.domain_size, {0.0, kInfinity, true});
  check("EfsiSimulationDef.gravity", def.gravity, {});
  check("EfsiSimulationDef.threads", def.threads, {0.0, 1024.0, false});
}
void check_values(const EfsiSolidDef& def, const std::string& owner) { EFSI_SOLID_PARAMETERS(EFSI_CHECK) }

constexpr Limits kShapes{0, EFSI_REGION_COUNT - 1, false};

void check_values(const EfsiEmitterDef& def, const std::string& owner) {
  EFSI_EMITTER_PARAMETERS(EFSI_CHECK)
  check("EfsiEmitterDef.shape", def.shape, kShapes);
  check_transform("EfsiEmitterDef.transform", def.transform);
}
void check_values(const EfsiForceDef& def, const std::string& owner) {
  EFSI_FORCE_PARAMETERS(EFSI_CHECK)
  check("EfsiForceDef.shape", def.shape, kShapes);
  check_transform("EfsiForceDef.transform", def.transform);
}
void check_values(const EfsiVdbDef& def, const std::string&) {
  check_transform("EfsiVdbDef.transform", def.transform);
  check("EfsiVdbDef.density_threshold", def.density_threshold, {0.0, kInfinity, false});
  check("EfsiVdbDef.half_float", def.half_float, {0.0, 1.0, false});
  check("EfsiVdbDef.write_velocity", def.write_velocity, {0.0, 1.0, false});
  const double low[3] = {def.region_min.x, def.region_min.y, def.region_min.z};
  const double high[3] = {def.region_max.x, def.region_max.y, def.region_max.z};
  for (int a = 0; a < 3; ++a)
    if (!(low[a] < high[a])) {
      std::ostringstream limit;
      limit << "below EfsiVdbDef.region_max."
            << "xyz"[a] << " = " << high[a];
      refuse(std::string("EfsiVdbDef.region_min.") + "xyz"[a], low[a], limit.str());
    }
}

#undef EFSI_CHECK

}  // namespace

template <class Def>
EfsiStatus initialise(Def* def, std::size_t size) noexcept {
  if (!def || size < sizeof(DefinitionHeader) || size > std::numeric_limits<std::uint32_t>::max())
    return EFSI_ERROR_ARGUMENT;
  Def full{};
  full.struct_size = static_cast<std::uint32_t>(size);
  full.magic = kMagic;
  set_defaults(full);
  auto* bytes = reinterpret_cast<unsigned char*>(def);
  const std::size_t own = std::min(size, sizeof(Def));
  std::memcpy(bytes, &full, own);
  std::memset(bytes + own, 0, size - own);
  return EFSI_OK;
}

template <class Def>
Def receive(const Def* def, const char* argument) {
  demand(def, argument);
  DefinitionHeader header;
  std::memcpy(&header, def, sizeof(header));
  check_header(header, Layout<Def>::name, initializer<Def>());
  check_size<Def>(header.struct_size, std::string(Layout<Def>::name) + ".struct_size");
  Def full{};
  set_defaults(full);
  std::memcpy(static_cast<void*>(&full), def, header.struct_size);
  check_values(full, Layout<Def>::name);
  return full;
}

#define EFSI_INSTANTIATE(Def)                                     \
  template EfsiStatus initialise(Def* def, std::size_t) noexcept; \
  template Def receive(const Def* def, const char* argument);
EFSI_INSTANTIATE(EfsiSimulationDef)
EFSI_INSTANTIATE(EfsiSolidDef)
EFSI_INSTANTIATE(EfsiEmitterDef)
EFSI_INSTANTIATE(EfsiForceDef)
EFSI_INSTANTIATE(EfsiVdbDef)
#undef EFSI_INSTANTIATE

}  // namespace efsi::capi
