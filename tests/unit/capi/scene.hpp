// Purpose: the small scene that the tests of the C API share, and short forms of what they ask it.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <string>

#include "eulerfsi/eulerfsi.h"

namespace efsi::test {

#if CATCH_VERSION_MAJOR >= 3
inline auto Contains(const std::string& text) { return Catch::Matchers::ContainsSubstring(text); }
#else
using Catch::Matchers::Contains;
#endif

using Sim = std::unique_ptr<EfsiSim, void (*)(EfsiSim*)>;

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// A cube of edge 0.2 m around (0.3, 0.35, 0.3), quads, counter-clockwise seen from outside.
inline constexpr float kPoints[24] = {0.2f, 0.25f, 0.2f, 0.4f, 0.25f, 0.2f, 0.4f, 0.45f, 0.2f, 0.2f, 0.45f, 0.2f,
                                      0.2f, 0.25f, 0.4f, 0.4f, 0.25f, 0.4f, 0.4f, 0.45f, 0.4f, 0.2f, 0.45f, 0.4f};
inline constexpr int32_t kCounts[6] = {4, 4, 4, 4, 4, 4};
inline constexpr int32_t kIndices[24] = {0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 3, 7, 6, 2, 0, 4, 7, 3, 1, 2, 6, 5};

inline EfsiMeshView cube() { return {kPoints, 8, 0, kCounts, 6, kIndices, 24}; }

// A box of 0.6 m with cells of 0.05 m.
inline EfsiSimulationDef box() {
  EfsiSimulationDef def;
  REQUIRE(efsi_simulation_def_init(&def, sizeof(def)) == EFSI_OK);
  def.domain_size = {0.6, 0.6, 0.6};
  def.voxel_size = 0.05;
  def.gravity = {0.0, -9.8, 0.0};
  def.threads = 2;
  return def;
}

inline Sim create(const EfsiSimulationDef& def) {
  EfsiSim* sim = nullptr;
  EfsiError error;
  const EfsiStatus status = efsi_simulation_create(&def, &sim, &error);
  INFO(error.message);
  REQUIRE(status == EFSI_OK);
  return {sim, efsi_simulation_destroy};
}

inline EfsiSolidDef cube_def() {
  EfsiSolidDef def;
  REQUIRE(efsi_solid_def_init(&def, sizeof(def)) == EFSI_OK);
  def.mesh = cube();
  return def;
}

// Smoke in y < 0.1: two layers of cells.
inline EfsiEmitterDef carpet_def() {
  EfsiEmitterDef def;
  REQUIRE(efsi_emitter_def_init(&def, sizeof(def)) == EFSI_OK);
  const double transform[16] = {0.6, 0, 0, 0.3, 0, 0.1, 0, 0.05, 0, 0, 0.6, 0.3, 0, 0, 0, 1};
  std::copy(transform, transform + 16, def.transform);
  def.mode = EFSI_EMITTER_INITIAL;
  return def;
}

// The cube above the carpet.
inline Sim scene(EfsiSimulationDef def = box()) {
  Sim sim = create(def);
  const EfsiSolidDef solid = cube_def();
  const EfsiEmitterDef carpet = carpet_def();
  uint32_t id = 0;
  REQUIRE(efsi_solid_add(sim.get(), &solid, &id) == EFSI_OK);
  REQUIRE(id == 1);
  REQUIRE(efsi_emitter_add(sim.get(), &carpet, &id) == EFSI_OK);
  REQUIRE(id == 1);
  return sim;
}

inline uint64_t hash_of(const Sim& sim) {
  uint64_t hash = 0;
  REQUIRE(efsi_simulation_get_hash(sim.get(), &hash) == EFSI_OK);
  return hash;
}

inline std::string last_error(const Sim& sim) { return efsi_simulation_last_error(sim.get()); }

inline EfsiFieldView view_of(const Sim& sim, int32_t field, uint32_t solid = 0) {
  EfsiFieldView view;
  REQUIRE(efsi_field_get_view(sim.get(), field, solid, &view, sizeof(view)) == EFSI_OK);
  return view;
}

inline uint64_t count_of(const EfsiFieldView& view) {
  return static_cast<uint64_t>(view.components) * static_cast<uint64_t>(view.size[0]) *
         static_cast<uint64_t>(view.size[1]) * static_cast<uint64_t>(view.size[2]);
}

inline float value(const EfsiFieldView& view, int component, int i, int j, int k) {
  return view.data[component][i + j * view.stride[1] + k * view.stride[2]];
}

inline void for_each_element(const EfsiFieldView& view, const std::function<void(int, int, int, int)>& body) {
  for (int c = 0; c < view.components; ++c)
    for (int k = 0; k < view.size[2]; ++k)
      for (int j = 0; j < view.size[1]; ++j)
        for (int i = 0; i < view.size[0]; ++i) body(c, i, j, k);
}

// A folder that is removed at the end of the test.
struct Folder {
  std::filesystem::path path;
  Folder() {
    for (int i = 0; path.empty(); ++i) {
      const auto candidate = std::filesystem::temp_directory_path() / ("efsi_test_capi_" + std::to_string(i));
      if (std::filesystem::create_directory(candidate)) path = candidate;
    }
  }
  ~Folder() { std::filesystem::remove_all(path); }
  std::string file(const std::string& name) const { return (path / name).string(); }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path), {}));
  }
};

}  // namespace efsi::test
