// Purpose: meshes and solids through the C API; messages of calls without a simulation.
#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "unit/capi/scene.hpp"

using namespace efsi::test;

TEST_CASE("A mesh is the same as quads, as triangles and with gaps between its points") {
  EfsiError error;
  EfsiMeshReport quads, triangles, gaps;
  const EfsiMeshView view = cube();
  REQUIRE(efsi_mesh_check(&view, 0.05, &quads, &error) == EFSI_OK);
  CHECK(quads.triangles == 12);
  CHECK(quads.closed == 1);
  CHECK(quads.surface_volume == Approx(0.008).epsilon(1e-6));
  CHECK(quads.extent_min.y == Approx(0.25));
  CHECK(quads.extent_max.y == Approx(0.45));

  std::vector<int32_t> indices;
  for (std::size_t f = 0; f < 24; f += 4)
    for (std::size_t c : {0, 1, 2, 0, 2, 3}) indices.push_back(kIndices[f + c]);
  const EfsiMeshView as_triangles{kPoints, 8, 12, nullptr, 12, indices.data(), 36};
  REQUIRE(efsi_mesh_check(&as_triangles, 0.05, &triangles, &error) == EFSI_OK);
  CHECK(triangles.surface_volume == Approx(quads.surface_volume));

  std::vector<float> wide(8 * 5, std::numeric_limits<float>::quiet_NaN());
  for (std::size_t p = 0; p < 8; ++p)
    std::copy(kPoints + 3 * p, kPoints + 3 * p + 3, wide.begin() + 5 * static_cast<long>(p));
  EfsiMeshView with_gaps = cube();
  with_gaps.points = wide.data();
  with_gaps.point_stride = 20;
  REQUIRE(efsi_mesh_check(&with_gaps, 0.05, &gaps, &error) == EFSI_OK);
  CHECK(gaps.solid_volume == quads.solid_volume);

  // What efsi_mesh_check says is what efsi_solid_add finds at that voxel size.
  const Sim sim = create(box());
  const EfsiSolidDef def = cube_def();
  EfsiMeshReport added;
  REQUIRE(efsi_solid_add(sim.get(), &def, nullptr, &added) == EFSI_OK);
  CHECK(std::memcmp(&added, &quads, sizeof(added)) == 0);

  CHECK(efsi_mesh_check(&view, 0.0, &gaps, &error) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(error.message, Contains("voxel_size = 0"));
}

TEST_CASE("A mesh that cannot become a solid is refused as a mesh") {
  EfsiError error;
  float points[24];
  std::copy(kPoints, kPoints + 24, points);
  EfsiMeshView view = cube();
  view.points = points;
  points[7] = std::numeric_limits<float>::infinity();
  CHECK(efsi_mesh_check(&view, 0.05, nullptr, &error) == EFSI_ERROR_MESH);
  CHECK_THAT(error.message, Contains("inf"));

  int32_t indices[24];
  std::copy(kIndices, kIndices + 24, indices);
  indices[5] = 8;
  view = cube();
  view.face_vertex_indices = indices;
  CHECK(efsi_mesh_check(&view, 0.05, nullptr, &error) == EFSI_ERROR_MESH);
  CHECK_THAT(error.message, Contains("8"));
  CHECK(error.status == EFSI_ERROR_MESH);

  EfsiSimulationDef small = box();
  small.domain_size.x = 0.35;
  const Sim sim = create(small);
  const EfsiSolidDef def = cube_def();
  CHECK(efsi_solid_add(sim.get(), &def, nullptr, nullptr) == EFSI_ERROR_ARGUMENT);
  CHECK_THAT(last_error(sim), Contains("0.4") && Contains("0.35") && Contains("domain"));
}

TEST_CASE("A mesh file gives the view of its polygons") {
  const Folder folder;
  const std::string path = folder.file("cube.obj");
  {
    std::ofstream out(path);
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
  REQUIRE(efsi_mesh_check(&view, 0.05, &report, &error) == EFSI_OK);
  CHECK(report.surface_volume == Approx(0.008).epsilon(1e-6));
  CHECK(report.closed == 1);
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
  REQUIRE(efsi_solid_add(sim.get(), &solid, nullptr, &report) == EFSI_OK);
  CHECK(report.closed == 0);
  CHECK(report.repaired == 1);
  CHECK(report.holes == 1);
  CHECK(report.open_edges == 4);
  CHECK(report.largest_hole == Approx(0.8));
  REQUIRE(warnings.size() == 1);
  CHECK_THAT(warnings[0], Contains("hole"));
}
