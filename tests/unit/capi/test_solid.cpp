// Purpose: meshes and solids through the C API; messages of calls without a simulation.
#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "unit/capi/scene.hpp"

using namespace efsi::test;

namespace {

using Surface = std::unique_ptr<EfsiSurface, void (*)(EfsiSurface*)>;

Surface examine(const EfsiMeshView& view, double voxel_size) {
  EfsiSurface* surface = nullptr;
  EfsiError error;
  const EfsiStatus status = efsi_surface_create(&view, voxel_size, 2, nullptr, nullptr, &surface, &error);
  INFO(error.message);
  REQUIRE(status == EFSI_OK);
  return {surface, efsi_surface_destroy};
}

// The report alone.
EfsiStatus check_mesh(const EfsiMeshView* view, double voxel_size, EfsiMeshReport* report, EfsiError* error) {
  EfsiSurface* surface = nullptr;
  const EfsiStatus status = efsi_surface_create(view, voxel_size, 1, nullptr, nullptr, &surface, error);
  if (status == EFSI_OK && report) REQUIRE(efsi_surface_get_report(surface, report, sizeof(*report)) == EFSI_OK);
  efsi_surface_destroy(surface);
  return status;
}

// The cube moved by `x` and made `scale` as large; keeps its points.
struct MovedCube {
  MovedCube(float x, float scale) {
    for (int i = 0; i < 24; ++i) {
      const float middle = i % 3 == 1 ? 0.35f : 0.3f;
      points[i] = middle + scale * (kPoints[i] - middle) + (i % 3 == 0 ? x : 0.0f);
    }
  }
  EfsiMeshView view() const {
    EfsiMeshView moved = cube();
    moved.points = points;
    return moved;
  }
  float points[24];
};

std::uint64_t hash_after_steps(EfsiSim* sim) {
  std::uint64_t hash = 0;
  for (int step = 0; step < 3; ++step) REQUIRE(efsi_simulation_step(sim, 0.01, nullptr, 0) == EFSI_OK);
  REQUIRE(efsi_simulation_get_hash(sim, &hash) == EFSI_OK);
  return hash;
}

}  // namespace

TEST_CASE("A mesh is the same as quads, as triangles and with gaps between its points") {
  EfsiError error;
  EfsiMeshReport quads, triangles, gaps;
  const EfsiMeshView view = cube();
  REQUIRE(check_mesh(&view, 0.05, &quads, &error) == EFSI_OK);
  CHECK(quads.triangles == 12);
  CHECK(quads.closed == 1);
  CHECK(quads.surface_volume == Approx(0.008).epsilon(1e-6));
  CHECK(quads.extent_min.y == Approx(0.25));
  CHECK(quads.extent_max.y == Approx(0.45));

  std::vector<int32_t> indices;
  for (std::size_t f = 0; f < 24; f += 4)
    for (std::size_t c : {0, 1, 2, 0, 2, 3}) indices.push_back(kIndices[f + c]);
  const EfsiMeshView as_triangles{kPoints, 8, 12, nullptr, 12, indices.data(), 36};
  REQUIRE(check_mesh(&as_triangles, 0.05, &triangles, &error) == EFSI_OK);
  CHECK(triangles.surface_volume == Approx(quads.surface_volume));

  std::vector<float> wide(8 * 5, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t p = 0; p < 8; ++p)
    std::copy(kPoints + 3 * p, kPoints + 3 * p + 3, wide.begin() + 5 * static_cast<long>(p));
  EfsiMeshView with_gaps = cube();
  with_gaps.points = wide.data();
  with_gaps.point_stride = 20;
  REQUIRE(check_mesh(&with_gaps, 0.05, &gaps, &error) == EFSI_OK);
  CHECK(gaps.solid_volume == quads.solid_volume);

  // What an examined surface says is what efsi_solid_add finds at that voxel size.
  const Sim sim = create(box());
  const EfsiSolidDef def = cube_def();
  EfsiMeshReport added;
  REQUIRE(efsi_solid_add(sim.get(), &def, nullptr) == EFSI_OK);
  REQUIRE(efsi_solid_get_mesh_report(sim.get(), 1, &added, sizeof(added)) == EFSI_OK);
  CHECK(std::memcmp(&added, &quads, sizeof(added)) == 0);

  CHECK(check_mesh(&view, 0.0, &gaps, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("voxel_size = 0"));
}

TEST_CASE("A mesh that cannot become a solid is refused as a mesh") {
  EfsiError error;
  float points[24];
  std::copy(kPoints, kPoints + 24, points);
  EfsiMeshView view = cube();
  view.points = points;
  points[7] = std::numeric_limits<float>::infinity();
  CHECK(check_mesh(&view, 0.05, nullptr, &error) == EFSI_ERROR_MESH);
  CHECK_THAT(error.message, Contains("inf"));

  int32_t indices[24];
  std::copy(kIndices, kIndices + 24, indices);
  indices[5] = 8;
  view = cube();
  view.face_vertex_indices = indices;
  CHECK(check_mesh(&view, 0.05, nullptr, &error) == EFSI_ERROR_MESH);
  CHECK_THAT(error.message, Contains("8"));
  CHECK(error.status == EFSI_ERROR_MESH);

  EfsiSimulationDef small = box();
  small.domain_size.x = 0.35;
  const Sim sim = create(small);
  const EfsiSolidDef def = cube_def();
  CHECK(efsi_solid_add(sim.get(), &def, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("0.4") && Contains("0.35") && Contains("domain"));
}

TEST_CASE("A mesh file gives the view of its polygons") {
  const Folder folder;
  const std::string path = folder.file("cube.obj");
  {
    std::ofstream out(path);
    out << "o a cube\n";
    for (int i = 0; i < 24; i += 3) out << "v " << kPoints[i] << ' ' << kPoints[i + 1] << ' ' << kPoints[i + 2] << '\n';
    for (int f = 0; f < 24; f += 4)
      out << "f " << kIndices[f] + 1 << ' ' << kIndices[f + 1] + 1 << ' ' << kIndices[f + 2] + 1 << ' '
          << kIndices[f + 3] + 1 << '\n';
  }
  EfsiMesh* mesh = nullptr;
  EfsiError error;
  REQUIRE(efsi_mesh_load(path.c_str(), &mesh, &error) == EFSI_OK);
  EfsiMeshView view;
  REQUIRE(efsi_mesh_get_view(mesh, &view) == EFSI_OK);
  CHECK(efsi_mesh_get_view(mesh, nullptr) == EFSI_ERROR_ARGUMENT);
  EfsiMeshReport report;
  REQUIRE(check_mesh(&view, 0.05, &report, &error) == EFSI_OK);
  CHECK(report.surface_volume == Approx(0.008).epsilon(1e-6));
  CHECK(report.closed == 1);
  EfsiMeshObject object;
  std::uint64_t count = 0;
  REQUIRE(efsi_mesh_get_objects(mesh, nullptr, 0, 0, &count, nullptr) == EFSI_OK);
  CHECK(count == 1);
  REQUIRE(efsi_mesh_get_objects(mesh, &object, sizeof object, 1, &count, &error) == EFSI_OK);
  CHECK(object.name == std::string("a cube"));
  CHECK(object.first_face == 0);
  CHECK(object.face_count == view.face_count);
  CHECK(efsi_mesh_get_objects(mesh, nullptr, sizeof object, 1, &count, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("efsi_mesh_get_objects: objects"));
  CHECK(efsi_mesh_get_objects(mesh, &object, sizeof object + 8, 1, &count, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("ends with `face_count`"));
  efsi_mesh_destroy(mesh);

  const std::string missing = folder.file("missing.obj");
  CHECK(efsi_mesh_load(missing.c_str(), &mesh, &error) == EFSI_ERROR_IO);
  CHECK(mesh == nullptr);
  CHECK_THAT(error.message, Contains("missing.obj"));
}

TEST_CASE("A message that is too long ends at a whole character") {
  std::string path = "/no/";
  for (int i = 0; i < 1000; ++i) path += "\u00e9";  // two bytes each
  for (const char* shift : {"", "x"}) {
    EfsiMesh* mesh = nullptr;
    EfsiError error;
    std::memset(&error, 0x7f, sizeof(error));
    CHECK(efsi_mesh_load((shift + path).c_str(), &mesh, &error) == EFSI_ERROR_IO);
    const std::size_t length = strnlen(error.message, sizeof(error.message));
    REQUIRE(length < sizeof(error.message));
    CHECK(length >= sizeof(error.message) - 2);
    CHECK(static_cast<unsigned char>(error.message[length - 1]) == 0xa9);  // second byte of the character
  }
}

TEST_CASE("An open mesh is closed with a warning to the log callback") {
  std::vector<std::string> warnings;
  EfsiSimulationDef def = box();
  def.log_user = &warnings;
  def.log = [](void* user, int32_t level, const char* message) {
    if (level == EFSI_LOG_WARNING) static_cast<std::vector<std::string>*>(user)->push_back(message);
  };
  const Sim sim = create(def);
  EfsiSolidDef solid = cube_def();
  solid.mesh.face_count = 5;
  solid.mesh.index_count = 20;
  EfsiMeshReport report;
  REQUIRE(efsi_solid_add(sim.get(), &solid, nullptr) == EFSI_OK);
  REQUIRE(efsi_solid_get_mesh_report(sim.get(), 1, &report, sizeof(report)) == EFSI_OK);
  CHECK(report.closed == 0);
  CHECK(report.repaired == 1);
  CHECK(report.holes == 1);
  CHECK(report.open_edges == 4);
  CHECK(report.largest_hole == Approx(0.8));
  REQUIRE(warnings.size() == 1);
  CHECK_THAT(warnings[0], Contains("hole"));
}

TEST_CASE("A solid that stands on a face of the box is inside at every voxel size") {
  float points[24];
  for (std::size_t i = 0; i < 24; ++i) points[i] = i % 3 != 1 ? kPoints[i] : kPoints[i] < 0.3f ? -0.27f : -0.07f;
  for (const double voxel : {0.05, 0.02, 0.01}) {
    EfsiSimulationDef def = box();
    def.domain_min.y = -0.27;
    def.voxel_size = voxel;
    const Sim sim = create(def);
    EfsiSolidDef solid = cube_def();
    solid.mesh.points = points;
    CHECK(efsi_solid_add(sim.get(), &solid, nullptr) == EFSI_OK);
    points[1] -= 1e-5f;  // not any more
    CHECK(efsi_solid_add(create(def).get(), &solid, nullptr) == EFSI_ERROR_ARGUMENT);
    points[1] += 1e-5f;
  }
}

TEST_CASE("A surface serves many simulations with the bits of its mesh", "[law]") {
  const EfsiMeshView view = cube();
  std::vector<std::uint64_t> hashes;
  Surface surface = examine(view, 0.05);
  for (const bool examined : {false, true, true}) {
    const Sim sim = create(box());
    EfsiSolidDef def = cube_def();
    if (examined) {
      def.mesh = {};
      def.surface = surface.get();
    }
    EfsiMeshReport report;
    REQUIRE(efsi_solid_add(sim.get(), &def, nullptr) == EFSI_OK);
    REQUIRE(efsi_solid_get_mesh_report(sim.get(), 1, &report, sizeof(report)) == EFSI_OK);
    CHECK(report.triangles == 12);
    if (hashes.size() == 2) surface.reset();  // the simulation keeps what it needs
    hashes.push_back(hash_after_steps(sim.get()));
  }
  CHECK(hashes[1] == hashes[0]);
  CHECK(hashes[2] == hashes[0]);
}

TEST_CASE("A surface of another voxel size is refused with both sizes") {
  const Surface surface = examine(cube(), 0.04);
  const Sim sim = create(box());
  EfsiSolidDef def = cube_def();
  def.surface = surface.get();
  CHECK(efsi_solid_add(sim.get(), &def, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("EfsiSolidDef.surface") && Contains("0.04") && Contains("0.05"));

  EfsiSurface* none = nullptr;
  EfsiError error;
  const EfsiMeshView view = cube();
  CHECK(efsi_surface_create(&view, 0.05, -1, nullptr, nullptr, &none, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("threads = -1"));
  CHECK(none == nullptr);
}

TEST_CASE("The progress callback of a surface sees the whole way and cancels it") {
  const EfsiMeshView view = cube();
  EfsiSurface* surface = nullptr;
  EfsiError error;
  std::vector<double> seen;
  const auto note = [](void* user, double fraction) -> int32_t {
    static_cast<std::vector<double>*>(user)->push_back(fraction);
    return 0;
  };
  REQUIRE(efsi_surface_create(&view, 0.02, 2, note, &seen, &surface, &error) == EFSI_OK);
  efsi_surface_destroy(surface);
  CHECK(std::is_sorted(seen.begin(), seen.end()));
  CHECK(seen.front() == 0.0);
  CHECK(seen.back() == 1.0);
  const auto stop = [](void*, double fraction) -> int32_t { return fraction > 0.5; };
  CHECK(efsi_surface_create(&view, 0.02, 2, stop, nullptr, &surface, &error) == EFSI_ERROR_CANCELLED);
  CHECK(surface == nullptr);
}

TEST_CASE("Overlapping solids are refused with both ids, touching ones are not") {
  double depth = -1.0, volume = -1.0;
  EfsiError error;
  const auto overlap_of = [&](float x, float scale) {
    const MovedCube moved(x, scale);
    REQUIRE(efsi_surface_get_overlap(examine(cube(), 0.05).get(), examine(moved.view(), 0.05).get(), &depth, &volume,
                                     &error) == EFSI_OK);
  };
  overlap_of(0.12f, 1.0f);  // 0.08 m of 0.2 m
  CHECK(depth == Approx(0.08).margin(0.0125));
  CHECK(volume == Approx(0.08 * 0.2 * 0.2).epsilon(0.1));
  // One within the other. Not of whole cells, where rounding would choose whether nodes on its faces are in it.
  overlap_of(0.0f, 0.7f);
  CHECK(depth == Approx(0.14).margin(0.0125));
  CHECK(volume == Approx(0.14 * 0.14 * 0.14).epsilon(0.1));
  overlap_of(0.5f, 1.0f);
  CHECK(depth == 0.0);
  CHECK(volume == 0.0);

  EfsiSimulationDef wide = box();
  wide.domain_size.x = 1.0;
  for (const auto& [x, allowed] : {std::pair{0.12f, false}, {0.0f, false}, {0.19f, true}, {0.2f, true}, {0.4f, true}}) {
    const Sim sim = create(wide);
    EfsiSolidDef def = cube_def();
    REQUIRE(efsi_solid_add(sim.get(), &def, nullptr) == EFSI_OK);
    const MovedCube moved(x, 1.0f);
    def.mesh = moved.view();
    CAPTURE(x);
    CHECK(efsi_solid_add(sim.get(), &def, nullptr) == (allowed ? EFSI_OK : EFSI_ERROR_ARGUMENT));
    if (!allowed) CHECK_THAT(last_error(sim), Contains("solid 2 overlaps solid 1") && Contains("0.025 m"));
  }
  CHECK(efsi_surface_get_overlap(nullptr, nullptr, &depth, &volume, &error) == EFSI_ERROR_ARGUMENT);
}
