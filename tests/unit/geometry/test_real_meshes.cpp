// Purpose: meshes that nobody here made, with holes, loose parts and crossings, become solids without leaks.
#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "geometry/mesh_sdf.hpp"
#include "geometry/mesh_topology.hpp"
#include "geometry/triangle_tree.hpp"
#include "shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;

namespace {

// Volume of a mesh whose open loops are closed by fans around their centres.
double volume_with_fans(const TriangleMesh& mesh) {
  TriangleMesh closed = weld(mesh);
  std::set<std::pair<int, int>> sides;
  for (const Triangle& t : closed.triangles)
    for (int n = 0; n < 3; ++n) sides.emplace(t[n], t[(n + 1) % 3]);
  std::map<int, int> next;
  for (const auto& [from, to] : sides)
    if (!sides.count({to, from})) next[to] = from;
  while (!next.empty()) {
    std::vector<int> loop;
    Vec3d centre = Vec3d::Zero();
    for (int at = next.begin()->first; next.count(at);) {
      loop.push_back(at);
      centre += closed.points[at];
      const int following = next[at];
      next.erase(at);
      at = following;
    }
    closed.points.push_back(centre / static_cast<double>(loop.size()));
    const auto middle = static_cast<std::int32_t>(closed.points.size() - 1);
    for (std::size_t i = 0; i < loop.size(); ++i)
      closed.triangles.push_back({loop[i], loop[(i + 1) % loop.size()], middle});
  }
  return signed_volume(closed);
}

// Volume where the winding number is above 1/2, at the points of a lattice much unlike the grid.
double volume_by_points(const TriangleMesh& mesh) {
  const TriangleTree tree(weld(mesh));
  const Extents box = extents(mesh);
  const Vec3d edges = box.max - box.min;
  constexpr int kPoints = 100000;
  int inside = 0;
  for (int n = 0; n < kPoints; ++n) {
    const Vec3d share(std::fmod(0.8191725133961645 * n, 1.0), std::fmod(0.6710436067037893 * n, 1.0),
                      std::fmod(0.5497004779019703 * n, 1.0));
    inside += tree.winding_number(box.min + edges.cwiseProduct(share)) > 0.5;
  }
  return edges.prod() * inside / kPoints;
}

struct Shape {
  int components = 0;  // regions of inside nodes, connected along grid edges, of more than eight nodes
  bool touches_border = false;
  double steepest = 0.0;  // largest |difference| between neighbours, in spacings
  double buried = 0.0;    // share of the inside nodes that lie near a surface although all 26 neighbours are inside
};

Shape examine(const SignedDistance& phi) {
  Shape shape;
  const Vec3i& size = phi.size;
  std::vector<bool> seen(phi.values.size(), false);
  std::size_t inside = 0, buried = 0;
  const auto is_inside = [&](int i, int j, int k) { return phi.values[phi.index(i, j, k)] < 0; };
  for (int k = 0; k < size[2]; ++k) {
    for (int j = 0; j < size[1]; ++j) {
      for (int i = 0; i < size[0]; ++i) {
        const float here = phi.values[phi.index(i, j, k)];
        const auto compare = [&](int x, int y, int z) {
          if (x < size[0] && y < size[1] && z < size[2])
            shape.steepest = std::max(shape.steepest, std::abs(phi.values[phi.index(x, y, z)] - here) / phi.spacing);
        };
        compare(i + 1, j, k);
        compare(i, j + 1, k);
        compare(i, j, k + 1);
        if (here >= 0) continue;
        ++inside;
        if (i == 0 || j == 0 || k == 0 || i + 1 == size[0] || j + 1 == size[1] || k + 1 == size[2]) {
          shape.touches_border = true;
          continue;
        }
        bool surrounded = true;
        for (int n = 0; n < 27; ++n)
          surrounded = surrounded && is_inside(i + n % 3 - 1, j + n / 3 % 3 - 1, k + n / 9 - 1);
        buried += surrounded && here > -0.4 * phi.spacing;
        if (seen[phi.index(i, j, k)]) continue;
        std::vector<Vec3i> region = {{i, j, k}};
        seen[phi.index(i, j, k)] = true;
        for (std::size_t head = 0; head < region.size(); ++head) {
          for (int side = 0; side < 6; ++side) {
            Vec3i at = region[head];
            at[side / 2] += side % 2 ? 1 : -1;
            if (at[side / 2] < 0 || at[side / 2] >= size[side / 2] || seen[phi.index(at[0], at[1], at[2])]) continue;
            if (!is_inside(at[0], at[1], at[2])) continue;
            seen[phi.index(at[0], at[1], at[2])] = true;
            region.push_back(at);
          }
        }
        shape.components += region.size() > 8;
      }
    }
  }
  shape.buried = static_cast<double>(buried) / static_cast<double>(inside);
  return shape;
}

void check_solid(const std::string& file, bool closed, std::uint64_t holes) {
  const auto mesh = shapes::shared_mesh(file);
  if (!mesh) {
    WARN("skipped: no folder " << EFSI_SHARED_DIR << "/meshes");
    return;
  }
  const Extents box = extents(*mesh);
  MeshReport report;
  const SignedDistance phi = build_signed_distance(*mesh, (box.max - box.min).maxCoeff() / 60.0, report, Parallel(2));
  const std::string& warnings = report.repairs;
  INFO(file << ": volume " << report.solid_volume << ", thinnest " << report.thinnest_feature << ", " << warnings);
  CHECK(report.closed == closed);
  CHECK(report.holes == holes);
  CHECK(report.repaired == !closed);
  CHECK(warnings.empty() == closed);
  CHECK(report.solid_volume == Approx(volume_by_points(*mesh)).epsilon(0.015));
  CHECK(report.thinnest_feature > 0.0);
  const Shape shape = examine(phi);
  CHECK(shape.components == 1);
  CHECK_FALSE(shape.touches_border);
  CHECK(shape.steepest < 1.5);
  CHECK(shape.buried < 0.001);
}

}  // namespace

TEST_CASE("The Stanford bunny with its five holes has the closed bunny's volume", "[law][nightly]") {
  check_solid("stanford-bunny.obj", false, 5);
  if (const auto bunny = shapes::shared_mesh("stanford-bunny.obj")) {
    MeshReport report;
    build_signed_distance(*bunny, 0.0025, report, Parallel(2));
    CHECK(report.solid_volume == Approx(volume_with_fans(*bunny)).epsilon(0.01));
  }
}

TEST_CASE("Suzanne's head and eyes are one solid") { check_solid("suzanne.obj", false, 4); }

TEST_CASE("Spot is closed and stays as it is") { check_solid("spot.obj", true, 0); }

TEST_CASE("The teapot's open body, spout, handle and lid are one solid") { check_solid("teapot.obj", false, 6); }
