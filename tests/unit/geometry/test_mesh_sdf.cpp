// Purpose: from meshes to signed distance fields: distances, signs, repairs, thickness, refusals, threads.
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.hpp"
#include "geometry/mesh_sdf.hpp"
#include "reference/plain_distance.hpp"
#include "unit/geometry/grids.hpp"
#include "unit/geometry/shapes.hpp"

using namespace efsi;
using namespace efsi::geometry;
using Catch::Matchers::Contains;
using Catch::Matchers::Equals;

namespace {

struct Built {
  SignedDistance phi;
  MeshReport report;
  std::string warnings;
};

Built build(const TriangleMesh& mesh, double spacing, int threads = 2) {
  Built built;
  built.phi = build_signed_distance(mesh, spacing, built.report, Parallel(threads));
  built.warnings = built.report.repairs;
  return built;
}

double box_distance(const Vec3d& X, const Vec3d& low, const Vec3d& high) {
  const Vec3d q = (X - 0.5 * (low + high)).cwiseAbs() - 0.5 * (high - low);
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

}  // namespace

TEST_CASE("Distances equal the smallest distance to any triangle, far from the surface nearly", "[law]") {
  for (const TriangleMesh& mesh : {shapes::torus(0.8, 0.3, 24, 12), shapes::sphere(0.7, 6, {3, -2, 1})}) {
    const Built built = build(mesh, 0.11);
    double worst_near = 0.0, worst_far = 0.0;
    for_each_node(built.phi, [&](const Vec3d& X, float phi) {
      const double exact = test::plain_distance(mesh, X), error = std::abs(std::abs(static_cast<double>(phi)) - exact);
      if (exact < 3 * built.phi.spacing) {
        worst_near = std::max(worst_near, error);
      } else {
        worst_far = std::max(worst_far, error / exact);
      }
    });
    CHECK(worst_near < 0.01 * built.phi.spacing);
    CHECK(worst_far < 0.02);
    CHECK(built.warnings.empty());
    CHECK_FALSE(built.report.repaired);
  }
}

TEST_CASE("A box has the box's distance, sign and volume; the grid leaves a margin", "[law]") {
  const Vec3d low(-0.31, 0.2, 1), high(0.5, 0.9, 1.4);
  const Built built = build(shapes::box(low, high), 0.05);
  double worst = 0.0;
  for_each_node(built.phi, [&](const Vec3d& X, float phi) {
    worst = std::max(worst, std::abs(static_cast<double>(phi) - box_distance(X, low, high)));
  });
  CHECK(worst < 1e-6);
  CHECK(built.report.solid_volume == Approx(0.81 * 0.7 * 0.4).epsilon(0.02));
  const Vec3d last = built.phi.node(built.phi.size[0] - 1, built.phi.size[1] - 1, built.phi.size[2] - 1);
  CHECK((last - high).minCoeff() >= 0.2 - 1e-9);
  CHECK((last - high).maxCoeff() < 0.2 + 0.025 + 1e-9);
  CHECK((built.phi.origin + last - low - high).norm() < 1e-12);  // the same on both sides
  CHECK((built.phi.gradient({0.45, 0.55, 1.2}) - Vec3d(1, 0, 0)).norm() < 1e-4);
}

TEST_CASE("An open box is closed by a flat lid", "[law]") {
  const Built built = build(shapes::box({0, 0, 0}, {1, 1, 1}, true), 0.05);
  CHECK(built.report.solid_volume == Approx(1.0).epsilon(0.01));
  CHECK(built.report.repaired);
  CHECK(built.report.closing_radius == 0.0);
  CHECK_THAT(built.warnings, Contains("1 hole, the largest 4 m around"));
  double worst = 0.0;
  for_each_node(built.phi, [&](const Vec3d& X, float phi) {
    worst = std::max(worst, std::abs(static_cast<double>(phi) - box_distance(X, {0, 0, 0}, {1, 1, 1})));
  });
  CHECK(worst < 0.35 * 0.05);  // the rim of the lid is bevelled where a node lies on it
}

TEST_CASE("A sphere with a large hole becomes a solid with a smooth cap", "[law]") {
  TriangleMesh bowl = shapes::sphere(1.0, 24);
  std::erase_if(bowl.triangles, [&](const Triangle& t) {
    return (bowl.points[t[0]] + bowl.points[t[1]] + bowl.points[t[2]]).z() / 3 > 0.6;
  });
  const Built built = build(bowl, 0.06);
  // The cap is near the plane through the rim: a ball without its cap of height 0.4.
  const double cap = std::numbers::pi * 0.4 * 0.4 * (3 - 0.4) / 3;
  CHECK(built.report.solid_volume == Approx(4 * std::numbers::pi / 3 - cap).epsilon(0.02));
  double across = 0.0;  // |grad phi| = 1 along the axis through the cap
  for (double z = 0.45; z < 0.8; z += 0.05)
    across = std::max(across, std::abs(built.phi.gradient({0.02, 0.03, z}).norm() - 1.0));
  CHECK(across < 0.1);
}

TEST_CASE("Overlapping parts are one solid: no surface is left inside", "[law]") {
  const TriangleMesh parts =
      shapes::together(shapes::box({0, 0, 0}, {2, 1, 1}), shapes::box({1.3, 0.2, 0.3}, {3, 0.8, 0.7}));
  const Built built = build(parts, 0.05);
  CHECK(built.report.solid_volume == Approx(2.0 + 1.0 * 0.6 * 0.4).epsilon(0.02));
  // Outside: distance to the union. Inside the first box, away from its wall: to the first box's walls.
  double outside = 0.0, inside = 0.0;
  int wrong = 0;
  for_each_node(built.phi, [&](const Vec3d& X, float phi) {
    const double first = box_distance(X, {0, 0, 0}, {2, 1, 1}),
                 second = box_distance(X, {1.3, 0.2, 0.3}, {3, 0.8, 0.7});
    if (std::min(first, second) > 0) outside = std::max(outside, std::abs(phi - std::min(first, second)));
    if (first < 0 && X.x() < 1.5) inside = std::max(inside, std::abs(phi - first));
    wrong += std::abs(std::min(first, second)) > 1e-6 && (phi < 0) != (std::min(first, second) < 0);
  });
  CHECK(wrong == 0);
  CHECK(outside < 1e-5);
  CHECK(inside < 1e-5);
  CHECK(built.phi.sample({1.3, 0.5, 0.5}) == Approx(-0.5).margin(0.01));
}

TEST_CASE("A cavity stays empty, an inside-out mesh is turned with a warning", "[law]") {
  const TriangleMesh hollow =
      shapes::together(shapes::box({0, 0, 0}, {2, 2, 2}), shapes::inside_out(shapes::sphere(0.5, 10, {1, 1, 1})));
  const Built built = build(hollow, 0.1);
  CHECK(built.phi.sample({1, 1, 1}) > 0.4);
  CHECK(built.report.solid_volume == Approx(signed_volume(hollow)).epsilon(0.02));
  CHECK(built.warnings.empty());

  const TriangleMesh sphere = shapes::sphere(0.5, 12);
  const Built right = build(sphere, 0.07), turned = build(shapes::inside_out(sphere), 0.07);
  CHECK(turned.phi.values == right.phi.values);
  CHECK(turned.report.surface_volume < 0);
  CHECK(turned.report.solid_volume == right.report.solid_volume);
  CHECK_THAT(turned.warnings, Contains("inside out"));
  CHECK(right.warnings.empty());
}

TEST_CASE("Pieces and triangles that are inside out count in volume and mesh as if they were not", "[law]") {
  const TriangleMesh ball = shapes::sphere(0.4, 12), other = shapes::sphere(0.4, 12, {1.2, 0, 0});
  const TriangleMesh right = shapes::together(ball, other);
  TriangleMesh mixed = right;
  for (std::size_t t = 0; t < mixed.triangles.size(); t += 3) std::swap(mixed.triangles[t][1], mixed.triangles[t][2]);
  const auto as_it_should = examine(right, 0.06);
  for (TriangleMesh wrong : {shapes::inside_out(right), shapes::together(ball, shapes::inside_out(other)), mixed}) {
    wrong.triangles.insert(wrong.triangles.begin(), {0, 0, 0});  // is left out: the others have other numbers then
    const auto surface = examine(wrong, 0.06);
    CHECK(surface->report.surface_volume == signed_volume(wrong));
    CHECK(surface->report.surface_volume < 0.7 * as_it_should->report.surface_volume);
    CHECK(surface->report.solid_volume == Approx(as_it_should->report.solid_volume).epsilon(1e-12));
    CHECK(signed_volume(surface->mesh) == surface->report.solid_volume);
    CHECK(surface->distance.values == as_it_should->distance.values);
    const std::vector<Vec3d> normals = vertex_normals(surface->mesh), expected = vertex_normals(as_it_should->mesh);
    double most = 0.0;
    for (std::size_t v = 0; v < normals.size(); ++v) most = std::max(most, (normals[v] - expected[v]).norm());
    CHECK(most < 1e-12);
  }
}

TEST_CASE("The thinnest feature of plate, sphere, torus and box, whatever the grid", "[law]") {
  CHECK(build(shapes::box({0, 0, 0}, {1, 1, 0.07}), 0.03).report.thinnest_feature == Approx(0.07).epsilon(0.1));
  CHECK(build(shapes::box({0, 0, 0}, {0.3, 0.5, 0.8}), 0.03).report.thinnest_feature == Approx(0.3).epsilon(0.1));
  CHECK(build(shapes::sphere(0.4, 12), 0.05).report.thinnest_feature == Approx(0.8).epsilon(0.1));
  CHECK(build(shapes::torus(1.0, 0.2, 60, 24), 0.06).report.thinnest_feature == Approx(0.4).epsilon(0.1));
  // A block on a thin fin: the fin counts.
  const TriangleMesh fin =
      shapes::together(shapes::box({0, 0, 0}, {1, 1, 1}), shapes::box({0.9, 0.2, 0.5}, {1.6, 0.8, 0.56}));
  CHECK(build(fin, 0.04).report.thinnest_feature == Approx(0.06).epsilon(0.1));
}

TEST_CASE("What is no solid at this spacing is refused with a reason") {
  const auto refusal = [](const TriangleMesh& mesh, double spacing, ErrorCode code) -> std::string {
    try {
      build(mesh, spacing);
    } catch (const Error& error) {
      CHECK(error.code() == code);
      return error.what();
    }
    return "accepted";
  };
  const TriangleMesh sheet = triangulate({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, std::vector<std::int32_t>{4},
                                         std::vector<std::int32_t>{0, 1, 2, 3});
  CHECK_THAT(refusal(sheet, 0.1, ErrorCode::kMesh), Contains("must bound a volume"));
  CHECK_THAT(refusal(shapes::box({0, 0, 0}, {1, 1, 0.01}), 0.2, ErrorCode::kMesh),
             Contains("thinnest feature about 0.01 m: use a spacing of at most 0.005 m"));
  const TriangleMesh point = triangulate({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {}, std::vector<std::int32_t>{0, 1, 2});
  CHECK_THAT(refusal(point, 0.1, ErrorCode::kMesh), Contains("1 triangles, none of them with an area"));
  const TriangleMesh box = shapes::box({0, 0, 0}, {1, 1, 1});
  CHECK_THAT(refusal(box, 0.0, ErrorCode::kArgument), Contains("spacing = 0: must be > 0"));
  CHECK_THAT(refusal(box, 1e-5, ErrorCode::kMemory), Contains("GB"));
}

TEST_CASE("The field is the same for any number of threads, TBB's too", "[law]") {
  const TriangleMesh mesh =
      shapes::together(shapes::torus(0.8, 0.3, 120, 60), shapes::box({-0.2, -1, -0.2}, {0.2, 1, 0.2}, true));
  std::vector<SignedDistance> fields;
  for (const std::size_t threads : {1, 2, 3, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    for (const int own : {1, 3, 8}) fields.push_back(build(mesh, 0.09, own).phi);
  }
  for (const SignedDistance& field : fields) CHECK(field.values == fields[0].values);
}

TEST_CASE("The report says what was repaired, and nothing of clean pieces") {
  const TriangleMesh ball = shapes::sphere(0.4, 12), other = shapes::sphere(0.3, 10, {1.2, 0, 0});
  const Built apart = build(shapes::together(ball, other), 0.05);
  CHECK(apart.warnings.empty());
  CHECK_FALSE(apart.report.repaired);
  CHECK(apart.report.pieces == 2);
  CHECK(apart.report.separate_pieces == 2);
  CHECK(apart.report.inner_triangles == 0);

  const Built turned = build(shapes::together(ball, shapes::inside_out(other)), 0.05);
  CHECK_THAT(turned.warnings, Contains("1 of 2 pieces inside out: turned"));
  CHECK(turned.report.reversed_triangles == other.triangles.size());
  CHECK(turned.report.repaired);

  TriangleMesh one = ball;
  std::swap(one.triangles[7][0], one.triangles[7][1]);
  const Built single = build(one, 0.05);
  CHECK_THAT(single.warnings, Equals("1 triangle against its neighbours: turned"));
  CHECK(single.report.reversed_triangles == 1);

  TriangleMesh soup;  // every triangle with points of its own
  for (const Triangle& t : ball.triangles) {
    const auto first = static_cast<std::int32_t>(soup.points.size());
    for (const std::int32_t corner : t) soup.points.push_back(ball.points[corner]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  const Built joined = build(soup, 0.05);
  CHECK(joined.report.merged_points == soup.points.size() - ball.points.size());
  CHECK_THAT(joined.warnings, Contains("doubled points: joined") && !Contains("three faces"));

  const Built crossing = build(shapes::together(ball, shapes::sphere(0.3, 10, {0.5, 0, 0})), 0.05);
  CHECK_THAT(crossing.warnings, Contains("triangles inside the solid") && !Contains("0 edges"));
  CHECK(crossing.report.inner_triangles > 0);
}

TEST_CASE("Separate pieces are those that do not touch, however they are wound") {
  const TriangleMesh box = shapes::box({0, 0, 0}, {1, 1, 1}), inner = shapes::sphere(0.3, 8, {0.5, 0.5, 0.5});
  const TriangleMesh rod = shapes::box({0.4, 0.4, -1}, {0.6, 0.6, 2}), away = shapes::sphere(0.3, 8, {3, 0, 0});
  const auto pieces = [](const TriangleMesh& mesh) { return build(mesh, 0.1).report.separate_pieces; };
  CHECK(pieces(box) == 1);
  CHECK(pieces(shapes::together(box, inner)) == 1);
  CHECK(pieces(shapes::together(box, shapes::inside_out(inner))) == 1);  // a cavity
  CHECK(pieces(shapes::together(box, rod)) == 1);
  CHECK(pieces(shapes::together(box, shapes::box({1, 0, 0}, {2, 1, 1}))) == 1);
  CHECK(pieces(shapes::together(box, shapes::inside_out(away))) == 2);
  CHECK(pieces(shapes::together(shapes::together(box, rod), shapes::together(away, inner))) == 2);
  const TriangleMesh cavity = shapes::inside_out(shapes::box({0.2, 0.2, 0.2}, {0.8, 0.8, 0.8}));
  const TriangleMesh loose = shapes::sphere(0.1, 8, {0.5, 0.5, 0.5});
  CHECK(pieces(shapes::together(shapes::together(box, cavity), loose)) == 2);
  // A dumb-bell whose bar the grid does not see is one piece.
  const TriangleMesh bar = shapes::box({0.5, 0.49, 0.49}, {2.5, 0.5, 0.5});
  CHECK(pieces(shapes::together(shapes::together(box, bar), shapes::box({2, 0, 0}, {3, 1, 1}))) == 1);
}

TEST_CASE("The examination of a mesh can be stopped and tells how far it is") {
  const TriangleMesh ball = shapes::together(shapes::sphere(0.4, 12), shapes::sphere(0.3, 10, {0.5, 0, 0}));
  double last = 0.0;
  bool rises = true;
  const auto whole = examine(ball, 0.05, Parallel(2), Progress([&](double fraction) {
                               rises = rises && fraction >= last && fraction <= 1.0;
                               last = fraction;
                               return false;
                             }));
  CHECK(rises);
  CHECK(last == 1.0);
  CHECK(whole->distance.values == build(ball, 0.05).phi.values);
  for (const double when : {0.0, 0.3, 0.7}) {
    try {
      examine(ball, 0.05, Parallel(2), Progress([&](double fraction) { return fraction >= when; }));
      FAIL("went on");
    } catch (const Error& error) {
      CHECK(error.code() == ErrorCode::kCancelled);
    }
  }
}

TEST_CASE("A moved mesh has the distances of the thorough way near it, the same solid, and any number of threads",
          "[law]") {
  const TriangleMesh crossing = shapes::together(shapes::sphere(0.5, 6), shapes::sphere(0.4, 5, {0.5, 0.1, 0}));
  for (const TriangleMesh& mesh :
       {shapes::torus(0.8, 0.3, 24, 12), shapes::box({0, 0, 0}, {1, 0.7, 2.1}), crossing,
        shapes::inside_out(shapes::box({0, 0, 0}, {1, 1, 1})), shapes::box({0, 0, 0}, {1, 1, 1}, true)}) {
    constexpr double kSpacing = 0.053;
    const auto slow = examine(mesh, kSpacing), fast = examine_moved(mesh, kSpacing);
    REQUIRE(fast->distance.values.size() == slow->distance.values.size());
    double near = 0.0, far = 0.0, least = 3.0;  // the last: of what is farther away
    std::size_t other_side = 0;
    for (std::size_t n = 0; n < fast->distance.values.size(); ++n) {
      const double a = static_cast<double>(slow->distance.values[n]) / kSpacing;
      const double b = static_cast<double>(fast->distance.values[n]) / kSpacing;
      other_side += (a < 0.0) != (b < 0.0);
      (std::abs(a) < 3.0 ? near : far) = std::max(std::abs(a) < 3.0 ? near : far, std::abs(b - a));
      least = std::abs(a) < 3.0 ? least : std::min(least, std::abs(b));
    }
    INFO("off by " << near << " spacings near the surface, " << far << " far away, " << fast->report.repairs);
    CHECK(near < 0.02);
    CHECK(least > 2.98);
    CHECK(far < 8.0);  // where the nearest point jumps, between nodes eight spacings apart
    CHECK(other_side == 0);
    CHECK(fast->report.solid_volume == Approx(slow->report.solid_volume).epsilon(1e-3));
    CHECK(fast->report.repairs == slow->report.repairs);
    CHECK(examine_moved(mesh, kSpacing, Parallel(2))->distance.values == fast->distance.values);
  }
}
