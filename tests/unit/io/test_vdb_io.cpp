// Purpose: what is written to a VDB file is what is read back; the content hash; failures leave nothing behind.
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <regex>
#include <set>
#include <sstream>

#include "base/error.hpp"
#include "io/file_writer.hpp"
#include "io/vdb_io.hpp"
#include "unit/io/scratch.hpp"
#include "unit/io/vdb_values.hpp"

using namespace efsi;
using namespace efsi::io;
using Catch::Matchers::Contains;

namespace {

// A puff of smoke that moves, on 20 x 17 x 11 cells; the vectors lie interleaved in memory.
struct Puff {
  Vec3i size = {20, 17, 11};
  std::vector<float> density, velocity;

  Puff() {
    for (int k = 0; k < size[2]; ++k) {
      for (int j = 0; j < size[1]; ++j) {
        for (int i = 0; i < size[0]; ++i) {
          const double r = std::hypot(i - 8.0, j - 9.0, k - 5.0);
          density.push_back(static_cast<float>(std::max(0.0, 1.0 - r / 4.3)));
          for (const double v : {0.1 * i, -0.2 * j, 3.0 + k}) velocity.push_back(static_cast<float>(v));
        }
      }
    }
  }
  std::size_t cell(int i, int j, int k) const { return i + size[0] * (j + static_cast<std::size_t>(size[1]) * k); }
  std::vector<DenseGrid> grids() const {
    const std::ptrdiff_t row = size[0], slab = row * size[1];
    DenseGrid smoke{"density", 1, size, {density.data(), nullptr, nullptr}, {1, row, slab}, ""};
    DenseGrid vel{"vel", 3, size, {&velocity[0], &velocity[1], &velocity[2]}, {3, 3 * row, 3 * slab}, "density"};
    return {smoke, vel};
  }
};

}  // namespace

TEST_CASE("Values, active voxels, classes and names survive the file") {
  const Scratch scratch;
  const Puff fields;
  VdbOptions options;
  options.creator = "eulerfsi test";
  const std::uint64_t hash = write_vdb(scratch / "a.vdb", fields.grids(), options);
  const VdbSummary summary = read_vdb_summary(scratch / "a.vdb");
  CHECK(summary.content_hash == hash);
  CHECK(summary.creator == "eulerfsi test");
  REQUIRE(summary.grids.size() == 2);
  const std::size_t first = summary.grids[0].name == "density" ? 0 : 1;
  const VdbGridSummary &density = summary.grids[first], &vel = summary.grids[1 - first];
  const auto active = std::count_if(fields.density.begin(), fields.density.end(), [](float v) { return v > 0; });
  CHECK(density.type == "float");
  CHECK(density.grid_class == "Fog Volume");
  CHECK(density.active_voxels == static_cast<std::uint64_t>(active));
  CHECK(density.max[0] == 1.0);
  CHECK(density.min[0] > 0.0);
  CHECK_FALSE(density.half_float);
  CHECK(vel.name == "vel");
  CHECK(vel.type == "vec3s");
  CHECK_THAT(vel.vector_type, Contains("contravariant relative"));
  CHECK(vel.active_voxels == density.active_voxels);

  const std::vector<float> smoke = vdb_values(scratch / "a.vdb", "density", fields.size);
  CHECK(smoke == fields.density);
  const std::vector<float> velocity = vdb_values(scratch / "a.vdb", "vel", fields.size);
  for (std::size_t n = 0; n < smoke.size(); ++n)
    for (int c = 0; c < 3; ++c) REQUIRE(velocity[3 * n + c] == (smoke[n] > 0 ? fields.velocity[3 * n + c] : 0.0f));
  CHECK(scratch.count() == 1);
}

TEST_CASE("Transforms with uniform scale, rotation and translation survive the file", "[law]") {
  const Scratch scratch;
  const Puff fields;
  const double c = std::cos(0.7), s = std::sin(0.7), h = 0.05;
  const std::vector<std::array<double, 16>> transforms = {
      {h, 0, 0, -1.5, 0, h, 0, 2.25, 0, 0, h, 0.125, 0, 0, 0, 1},
      {h * c, -h * s, 0, 3, h * s, h * c, 0, -4, 0, 0, h, 5, 0, 0, 0, 1},
      {0, 0, h, 1, h, 0, 0, 2, 0, h, 0, 3, 0, 0, 0, 1},
      {h, 0, 0, 0, 0, 2 * h, 0, 0, 0, 0, 3 * h, 1, 0, 0, 0, 1},
  };
  std::vector<std::uint64_t> hashes;
  for (const auto& transform : transforms) {
    VdbOptions options;
    options.index_to_world = transform;
    hashes.push_back(write_vdb(scratch / "t.vdb", fields.grids(), options));
    const VdbSummary summary = read_vdb_summary(scratch / "t.vdb");
    CHECK(summary.content_hash == hashes.back());
    for (const VdbGridSummary& grid : summary.grids)
      for (int n = 0; n < 16; ++n) CHECK(grid.index_to_world[n] == Approx(transform[n]).margin(1e-12));
  }
  std::sort(hashes.begin(), hashes.end());
  CHECK(std::unique(hashes.begin(), hashes.end()) == hashes.end());
}

TEST_CASE("Half floats are rounded to the nearest, and the hash is that of the rounded values") {
  const Scratch scratch;
  const Puff fields;
  VdbOptions options;
  const std::uint64_t full = write_vdb(scratch / "full.vdb", fields.grids(), options);
  options.half_float = true;
  const std::uint64_t half = write_vdb(scratch / "half.vdb", fields.grids(), options);
  CHECK(half != full);
  const VdbSummary summary = read_vdb_summary(scratch / "half.vdb");
  CHECK(summary.content_hash == half);
  CHECK(summary.grids[0].half_float);
  const std::vector<float> smoke = vdb_values(scratch / "half.vdb", "density", fields.size);
  float worst = 0.0f;
  for (std::size_t n = 0; n < smoke.size(); ++n) worst = std::max(worst, std::abs(smoke[n] - fields.density[n]));
  CHECK(worst > 0.0f);
  CHECK(worst <= 1.0f / 4096);  // half a unit in the last of 11 bits, below 1
  CHECK(bytes_of(scratch / "half.vdb").size() < bytes_of(scratch / "full.vdb").size());

  // What half floats cannot hold becomes the largest one, not infinity.
  const float huge = 1e6f;
  const DenseGrid one{"density", 1, {1, 1, 1}, {&huge, nullptr, nullptr}, {1, 1, 1}, ""};
  write_vdb(scratch / "huge.vdb", std::span(&one, 1), options);
  CHECK(read_vdb_summary(scratch / "huge.vdb").grids[0].max[0] == 65504.0);
}

TEST_CASE("The content hash depends on names, values and places", "[law]") {
  const Scratch scratch;
  Puff fields;
  const VdbOptions options;
  const std::uint64_t hash = write_vdb(scratch / "a.vdb", fields.grids(), options);
  CHECK(write_vdb(scratch / "b.vdb", fields.grids(), options) == hash);

  std::vector<DenseGrid> grids = fields.grids();
  std::swap(grids[0], grids[1]);
  CHECK(write_vdb(scratch / "b.vdb", grids, options) == hash);
  grids[0].name = "velocity";
  CHECK(write_vdb(scratch / "b.vdb", grids, options) != hash);
  CHECK(write_vdb(scratch / "b.vdb", std::span(&grids[1], 1), options) != hash);

  float& value = fields.density[fields.cell(8, 9, 5)];
  value = std::nextafter(value, 2.0f);
  CHECK(write_vdb(scratch / "b.vdb", fields.grids(), options) != hash);
  value = std::nextafter(value, 0.0f);
  CHECK(write_vdb(scratch / "b.vdb", fields.grids(), options) == hash);
  std::swap(fields.density[fields.cell(8, 9, 5)], fields.density[fields.cell(9, 9, 5)]);
  CHECK(write_vdb(scratch / "b.vdb", fields.grids(), options) != hash);
}

TEST_CASE("Same content, same bytes: the id in the header belongs to the content", "[law]") {
  const Scratch scratch;
  Puff fields;
  VdbOptions options;
  const auto bytes = [&](const std::string& name) {
    write_vdb(scratch / name, fields.grids(), options);
    return bytes_of(scratch / name);
  };
  // The header: 8 bytes of magic number, 4 of the format's version, 8 of the library's, 1 flag, then the id.
  const auto id = [&](const std::string& name) { return bytes_of(scratch / name).substr(21, 36); };
  for (const bool half : {false, true}) {
    options.half_float = half;
    CHECK(bytes("a.vdb") == bytes("b.vdb"));
    CHECK(read_vdb_summary(scratch / "a.vdb").grids.size() == 2);
  }
  const std::string first = id("a.vdb");
  INFO(first);
  CHECK(std::regex_match(first, std::regex("[0-9a-f]{8}-[0-9a-f]{4}-8[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}")));
  CHECK(id("b.vdb") == first);

  std::set<std::string> ids = {first};
  for (int n = 1; n <= 20; ++n) {
    float& value = fields.density[fields.cell(8, 9, 5)];
    value = std::nextafter(value, 0.0f);
    options.half_float = false;
    bytes("c.vdb");
    CHECK(ids.insert(id("c.vdb")).second);
  }
}

TEST_CASE("The threshold drops thin smoke; empty and constant grids are written too") {
  const Scratch scratch;
  const Puff fields;
  VdbOptions options;
  options.threshold = 0.5;
  write_vdb(scratch / "a.vdb", fields.grids(), options);
  for (const VdbGridSummary& grid : read_vdb_summary(scratch / "a.vdb").grids) {
    CHECK(grid.active_voxels == static_cast<std::uint64_t>(std::count_if(fields.density.begin(), fields.density.end(),
                                                                         [](float v) { return v > 0.5f; })));
    if (grid.name == "density") CHECK(grid.min[0] > 0.5);
  }
  options.threshold = 2.0;
  const std::uint64_t none = write_vdb(scratch / "a.vdb", fields.grids(), options);
  const VdbSummary empty = read_vdb_summary(scratch / "a.vdb");
  CHECK(empty.content_hash == none);
  REQUIRE(empty.grids.size() == 2);
  CHECK(empty.grids[0].active_voxels == 0);

  // A constant block becomes tiles; voxels and hash are counted the same.
  const std::vector<float> ones(32 * 32 * 32, 1.0f);
  const DenseGrid block{"density", 1, {32, 32, 32}, {ones.data(), nullptr, nullptr}, {1, 32, 1024}, ""};
  options.threshold = 0.0;
  const std::uint64_t hash = write_vdb(scratch / "ones.vdb", std::span(&block, 1), options);
  const VdbSummary constant = read_vdb_summary(scratch / "ones.vdb");
  CHECK(constant.grids[0].active_voxels == ones.size());
  CHECK(constant.content_hash == hash);
  CHECK(bytes_of(scratch / "ones.vdb").size() < 20000);
}

TEST_CASE("Grids that cannot be written are refused by name") {
  const Scratch scratch;
  const Puff fields;
  const auto write = [&](const auto& change) {
    std::vector<DenseGrid> grids = fields.grids();
    VdbOptions options;
    change(grids, options);
    return refusal([&] { write_vdb(scratch / "a.vdb", grids, options); }, ErrorCode::kArgument);
  };
  CHECK_THAT(write([](auto& g, auto&) { g[1].mask = "smoke"; }), Contains("'vel': no grid 'smoke'"));
  CHECK_THAT(write([](auto& g, auto&) { g[1].name = "density"; }), Contains("the name is used twice"));
  CHECK_THAT(write([](auto& g, auto&) { g[0].components = 2; }), Contains("components = 2: must be 1 or 3"));
  CHECK_THAT(write([](auto& g, auto&) { g[0].size[1] = 0; }), Contains("size[1] = 0"));
  CHECK_THAT(write([](auto& g, auto&) { g[1].data[2] = nullptr; }), Contains("data[2] is null"));
  CHECK_THAT(write([](auto& g, auto&) { g[0].size[2] = 5; }), Contains("another size"));
  CHECK_THAT(write([](auto&, auto& o) { o.index_to_world[0] = 0; }), Contains("invertible"));
  CHECK_THAT(write([](auto&, auto& o) { o.index_to_world[12] = 1; }), Contains("affine"));
  CHECK(scratch.count() == 0);
}

TEST_CASE("A failed write names path and reason and leaves nothing but what was there") {
  const Scratch scratch;
  const Puff fields;
  const VdbOptions options;
  const auto write = [&](const std::string& path) {
    return refusal([&] { write_vdb(path, fields.grids(), options); }, ErrorCode::kIo);
  };
  CHECK_THAT(write(scratch / "no/such/a.vdb"), Contains("no/such/a.vdb: cannot be written: No such file"));
  std::filesystem::create_directory(scratch / "taken.vdb");
  CHECK_THAT(write(scratch / "taken.vdb"), Contains("taken.vdb: cannot be replaced"));
  CHECK(scratch.count() == 1);

  // A disk that is full after 1000 bytes, as a limit on the size of files.
  write_vdb(scratch / "old.vdb", fields.grids(), options);
  const std::string before = bytes_of(scratch / "old.vdb");
  REQUIRE(before.size() > 1000);
  rlimit usual{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &usual) == 0);
  rlimit full = usual;
  full.rlim_cur = 1000;
  const auto handler = ::signal(SIGXFSZ, SIG_IGN);
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &full) == 0);
  const std::string message = write(scratch / "old.vdb");
  ::setrlimit(RLIMIT_FSIZE, &usual);
  ::signal(SIGXFSZ, handler);
  CHECK_THAT(message, Contains("old.vdb: cannot be written: File too large"));
  CHECK(bytes_of(scratch / "old.vdb") == before);
  CHECK(scratch.count() == 2);
}

TEST_CASE("A file that is missing, cut short or no VDB is refused when it is read") {
  const Scratch scratch;
  const Puff fields;
  write_vdb(scratch / "a.vdb", fields.grids(), VdbOptions());
  const std::string bytes = bytes_of(scratch / "a.vdb");
  for (const double share : {0.98, 0.5, 0.05}) {
    replace_file(scratch / "cut.vdb", bytes.substr(0, static_cast<std::size_t>(share * bytes.size())));
    INFO(share);
    CHECK_THAT(refusal([&] { read_vdb_summary(scratch / "cut.vdb"); }, ErrorCode::kIo),
               Contains("cut.vdb: cannot be read"));
  }
  replace_file(scratch / "text.vdb", "density");
  CHECK_THAT(refusal([&] { read_vdb_summary(scratch / "text.vdb"); }, ErrorCode::kIo), Contains("text.vdb: "));
  CHECK_THAT(refusal([&] { read_vdb_summary(scratch / "none.vdb"); }, ErrorCode::kIo), Contains("none.vdb: "));
}
