// Purpose: clients of other versions. An older one passes structs that end before the library's; a newer one passes
// longer ones and is refused.
#include <catch2/catch.hpp>
#include <cstddef>
#include <cstring>
#include <vector>

#include "capi/sized.hpp"
#include "unit/capi/scene.hpp"

using namespace efsi::test;

namespace {

// The first `size` bytes of a struct, followed by bytes that nobody may write.
template <class Struct>
class Older {
 public:
  explicit Older(std::size_t size) : size_(size), bytes_(size + 64, kMark) {}
  Struct* get() { return reinterpret_cast<Struct*>(bytes_.data()); }
  std::size_t size() const { return size_; }
  template <class T>
  void set(std::size_t offset, const T& value) {
    REQUIRE(offset + sizeof(T) <= size_);
    std::memcpy(bytes_.data() + offset, &value, sizeof(T));
  }
  template <class T>
  T value(std::size_t offset) const {
    T value;
    std::memcpy(&value, bytes_.data() + offset, sizeof(T));
    return value;
  }
  bool kept() const {
    return std::all_of(bytes_.begin() + static_cast<std::ptrdiff_t>(size_), bytes_.end(),
                       [](unsigned char b) { return b == kMark; });
  }

 private:
  static constexpr unsigned char kMark = 0xa5;
  std::size_t size_;
  std::vector<unsigned char> bytes_;
};

std::uint64_t hash_after_a_step(EfsiSim* sim) {
  std::uint64_t hash = 0;
  REQUIRE(efsi_simulation_step(sim, 0.02, nullptr, 0) == EFSI_OK);
  REQUIRE(efsi_simulation_get_hash(sim, &hash) == EFSI_OK);
  return hash;
}

}  // namespace

TEST_CASE("A definition of an older header is completed with defaults") {
  // Before friction, plasticity, stretch and contact stiffness were added.
  Older<EfsiSolidDef> old(offsetof(EfsiSolidDef, friction));
  REQUIRE(efsi_solid_def_init(old.get(), old.size()) == EFSI_OK);
  CHECK(old.kept());
  CHECK(old.value<std::uint32_t>(offsetof(EfsiSolidDef, struct_size)) == old.size());
  CHECK(old.value<double>(offsetof(EfsiSolidDef, density)) == 1000.0);
  old.set(offsetof(EfsiSolidDef, mesh), cube());
  const Sim short_one = create(box()), full_one = create(box());
  REQUIRE(efsi_solid_add(short_one.get(), old.get(), nullptr) == EFSI_OK);
  const EfsiSolidDef full = cube_def();
  REQUIRE(efsi_solid_add(full_one.get(), &full, nullptr) == EFSI_OK);
  CHECK(hash_after_a_step(short_one.get()) == hash_after_a_step(full_one.get()));
  CHECK(old.kept());
}

TEST_CASE("A simulation of an older header is completed with defaults") {
  Older<EfsiSimulationDef> old(offsetof(EfsiSimulationDef, cfl_fluid));
  REQUIRE(efsi_simulation_def_init(old.get(), old.size()) == EFSI_OK);
  const EfsiSimulationDef full = box();
  old.set(offsetof(EfsiSimulationDef, domain_size), full.domain_size);
  old.set(offsetof(EfsiSimulationDef, voxel_size), full.voxel_size);
  old.set(offsetof(EfsiSimulationDef, gravity), full.gravity);
  EfsiSim* sim = nullptr;
  REQUIRE(efsi_simulation_create(old.get(), &sim, nullptr) == EFSI_OK);
  const Sim owner{sim, efsi_simulation_destroy}, other = create(full);
  CHECK(hash_after_a_step(sim) == hash_after_a_step(other.get()));
  CHECK(old.kept());
}

TEST_CASE("Results fill the struct of an older header and no byte more") {
  const Sim sim = scene();
  Older<EfsiStepInfo> info(offsetof(EfsiStepInfo, velocity_residual));
  REQUIRE(efsi_simulation_step(sim.get(), 0.01, info.get(), info.size()) == EFSI_OK);
  CHECK(info.value<std::uint64_t>(offsetof(EfsiStepInfo, steps)) == 1);
  CHECK(info.kept());
  Older<EfsiStepInfo> sums(offsetof(EfsiStepInfo, steps));
  REQUIRE(efsi_simulation_advance(sim.get(), 0.01, sums.get(), sums.size(), nullptr, nullptr) == EFSI_OK);
  CHECK(sums.value<double>(0) > 0.0);
  CHECK(sums.kept());
  Older<EfsiSolidDiagnostics> solid(offsetof(EfsiSolidDiagnostics, volume_cells));
  REQUIRE(efsi_solid_get_diagnostics(sim.get(), 1, solid.get(), solid.size()) == EFSI_OK);
  CHECK(solid.value<double>(0) > 0.0);
  CHECK(solid.kept());

  // Arrays have the caller's stride.
  constexpr std::size_t kStride = offsetof(EfsiStageProfile, bytes);
  Older<EfsiStageProfile> stages(kStride * EFSI_STAGE_COUNT);
  std::uint64_t count = 0;
  REQUIRE(efsi_simulation_get_stages(sim.get(), stages.get(), kStride, EFSI_STAGE_COUNT, &count) == EFSI_OK);
  EfsiStageProfile own[EFSI_STAGE_COUNT];
  REQUIRE(efsi_simulation_get_stages(sim.get(), own, sizeof(own[0]), EFSI_STAGE_COUNT, nullptr) == EFSI_OK);
  for (std::size_t s = 0; s < count; ++s) {
    CHECK(stages.value<double>(s * kStride) == own[s].seconds);
    CHECK(stages.value<std::uint64_t>(s * kStride + sizeof(double)) == own[s].tiles);
  }
  CHECK(stages.kept());
}

TEST_CASE("A newer client is refused with the last member that the library has") {
  struct Newer {
    EfsiSolidDef known;
    double melting_point;
  } def;
  std::memset(static_cast<void*>(&def), 0xff, sizeof(def));
  REQUIRE(efsi_solid_def_init(&def.known, sizeof(def)) == EFSI_OK);
  CHECK(def.melting_point == 0.0);
  def.known.mesh = cube();
  const Sim sim = scene();
  CHECK(efsi_solid_add(sim.get(), &def.known, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("EfsiSolidDef.struct_size = " + std::to_string(sizeof(def))) &&
                                  Contains("ends with `") && Contains(efsi::capi::Layout<EfsiSolidDef>::last) &&
                                  Contains("newer version"));
  struct NewerRepairs {
    EfsiRepairs known;
    double cost;
  } repairs;
  CHECK(efsi_simulation_get_repairs(sim.get(), &repairs.known, sizeof(repairs)) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("EfsiRepairs") && Contains("`max_det_f_after`"));
}
