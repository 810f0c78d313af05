// Purpose: what efsi_vdb_read gives is what was written; nothing damaged reaches OpenVDB's reader.
#include <catch2/catch.hpp>
#include <fstream>
#include <functional>
#include <sstream>

#include "base/error.hpp"
#include "io/file_writer.hpp"
#include "io/vdb_checksum.hpp"
#include "io/vdb_io.hpp"
#include "unit/io/scratch.hpp"

using namespace efsi;
using namespace efsi::io;
using Catch::Matchers::Contains;

namespace {

constexpr Vec3i kSize = {11, 9, 10};

std::size_t at(int i, int j, int k) { return static_cast<std::size_t>(i + kSize[0] * (j + kSize[1] * k)); }

// Density 1 + i + 20 j + 400 k in voxels from (2, 1, 3) on, and a velocity that is active there.
struct Fields {
  std::vector<float> density = std::vector<float>(at(10, 8, 9) + 1, 0.0f), velocity = density;
  Fields() {
    for (int k = 3; k < kSize[2]; ++k)
      for (int j = 1; j < kSize[1]; ++j)
        for (int i = 2; i < kSize[0]; ++i) {
          density[at(i, j, k)] = static_cast<float>(1 + i + 20 * j + 400 * k);
          velocity[at(i, j, k)] = static_cast<float>(i);
        }
  }
  std::uint64_t write(const std::string& path, const VdbOptions& options = {}) const {
    const std::array<std::ptrdiff_t, 3> stride = {1, kSize[0], kSize[0] * kSize[1]};
    return write_vdb(path,
                     std::vector<DenseGrid>{
                         {"density", 1, kSize, {density.data(), nullptr, nullptr}, stride, ""},
                         {"vel", 3, kSize, {velocity.data(), velocity.data(), velocity.data()}, stride, "density"}},
                     options);
  }
};

}  // namespace

TEST_CASE("A box of a grid is read as it was written, whole, beside it and in half precision") {
  const Scratch scratch;
  const Fields fields;
  for (const bool half : {false, true}) {
    VdbOptions options;
    options.half_float = half;
    options.index_to_world[3] = 2.5;
    fields.write(scratch / "a.vdb", options);
    const VdbFile file(scratch / "a.vdb");
    const VdbGridInfo info = file.info("density");
    CHECK((info.min == Vec3i{2, 1, 3} && info.size == Vec3i{9, 8, 7}));
    CHECK((info.components == 1 && file.info("vel").components == 3));
    CHECK((info.active_voxels == 9 * 8 * 7 && info.index_to_world[3] == 2.5));
    std::vector<float> values(fields.density.size());
    file.read("density", {0, 0, 0}, kSize, 1, values);
    for (std::size_t n = 0; n < values.size(); ++n)
      REQUIRE(values[n] == Approx(fields.density[n]).epsilon(half ? 1e-3 : 0.0));
    // A box that is partly and one that is wholly outside.
    values.assign(8, -1.0f);
    file.read("density", {1, 1, 3}, {2, 2, 2}, 1, values);
    CHECK((values[0] == 0.0f && values[1] == Approx(1 + 2 + 20 + 1200).epsilon(1e-3)));
    file.read("density", {1 << 29, 0, 0}, {2, 2, 2}, 1, values);
    CHECK(values == std::vector<float>(8, 0.0f));
  }
}

TEST_CASE("A coarse cell has the mean of its voxels, of a vector that of the active ones") {
  const Scratch scratch;
  const Fields fields;
  fields.write(scratch / "a.vdb");
  const VdbFile file(scratch / "a.vdb");
  constexpr int kCoarse = 4;
  const Vec3i cells = {3, 3, 3};
  std::vector<float> density(27), vel(81);
  file.read("density", {0, 0, 0}, cells, kCoarse, density);
  file.read("vel", {0, 0, 0}, cells, kCoarse, vel);
  double mass = 0.0, whole = 0.0;
  for (const float value : density) mass += value * std::pow(kCoarse, 3.0);
  for (const float value : fields.density) whole += value;
  CHECK(mass == Approx(whole).epsilon(1e-6));
  CHECK(vel[0] == Approx(2.5));          // voxels 2 and 3 are active of 0 to 3
  CHECK(vel[3] == Approx(5.5));          // 4 to 7
  CHECK(vel[3 * 2 + 1] == Approx(9.0));  // 8 to 10
}

TEST_CASE("Only voxels of the region are active") {
  const Scratch scratch;
  const Fields fields;
  VdbOptions options;
  options.low = {4, 0, 5};
  options.high = {8, 100, 9};
  fields.write(scratch / "a.vdb", options);
  const VdbGridInfo info = VdbFile(scratch / "a.vdb").info("density");
  CHECK((info.min == Vec3i{4, 1, 5} && info.size == Vec3i{4, 8, 4}));
}

TEST_CASE("Every truncated prefix and every flipped byte of a file is refused") {
  const Scratch scratch;
  const Fields fields;
  fields.write(scratch / "a.vdb");
  const std::string bytes = bytes_of(scratch / "a.vdb"), path = scratch / "b.vdb";
  const auto put = [&](const std::string& text) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
    return refusal([&] { VdbFile file(path); }, ErrorCode::kIo);
  };
  CHECK(put(bytes) == "accepted");
  int missed = 0;
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    std::string flipped = bytes;
    flipped[n] = static_cast<char>(flipped[n] ^ (1 << n % 8));
    missed += checksum_fault(flipped).empty() + checksum_fault(bytes.substr(0, n)).empty();
    if (n % 997 != 0) continue;
    CHECK_THAT(put(flipped), Contains("b.vdb: cannot be read: "));
    CHECK_THAT(put(bytes.substr(0, n)), Contains("b.vdb: cannot be read: "));
  }
  CHECK(missed == 0);
  CHECK_THAT(put("density"), Contains("it has no checksum of eulerfsi"));
  CHECK_THAT(refusal([&] { VdbFile file(scratch / "none.vdb"); }, ErrorCode::kIo), Contains("No such file"));
}

TEST_CASE("A grid that is not there and a box that is too large are refused, and nothing is written") {
  const Scratch scratch;
  const Fields fields;
  fields.write(scratch / "a.vdb");
  const VdbFile file(scratch / "a.vdb");
  std::vector<float> values(8, -1.0f);
  const auto read = [&](const std::string& name, const Vec3i& min, const Vec3i& size, int coarsen) {
    return refusal([&] { file.read(name, min, size, coarsen, values); }, ErrorCode::kArgument);
  };
  CHECK_THAT(read("heat", {0, 0, 0}, {1, 1, 1}, 1), Contains("has no grid 'heat'; its grids: density, vel"));
  CHECK_THAT(read("density", {0, 0, 0}, {3, 3, 1}, 1),
             Contains("number of values = 9: must be at most the capacity of 8"));
  CHECK_THAT(read("vel", {0, 0, 0}, {3, 1, 1}, 1), Contains("number of values = 9"));
  CHECK_THAT(read("density", {0, 0, 0}, {0, 1, 1}, 1), Contains("size.x = 0: must be at least 1"));
  CHECK_THAT(read("density", {0, 0, 0}, {1, 1 << 30, 1}, 2), Contains("size.y"));
  CHECK_THAT(read("density", {0, 0, 0}, {1, 1, 1}, 0), Contains("coarsen = 0"));
  CHECK_THAT(read("density", {-(1 << 30) - 1, 0, 0}, {1, 1, 1}, 1), Contains("min.x"));
  CHECK(values == std::vector<float>(8, -1.0f));
}
