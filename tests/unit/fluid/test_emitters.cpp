// Purpose: emitters: where they are, when, what they leave alone, what jets bring in.
#include <catch2/catch.hpp>
#include <cmath>

#include "fluid/emitter.hpp"
#include "unit/geometry/shapes.hpp"

using namespace efsi;
using namespace efsi::fluid;

namespace {

struct EmptyBox {
  Grid g;
  FluidState state;
  VectorField velocity;
  std::vector<Real> fraction, specific_volume;
  EmptyBox() {
    g.cells = {20, 20, 20};
    g.h = 0.05;
    clear();
  }
  void clear() {
    state.smoke.assign(g.cell_count(), 0);
    state.temperature.assign(g.cell_count(), 0);
    velocity.assign(g.node_count());
  }
  void apply(const Emitter& e, double time, double dt = 0.01) {
    apply_emitters(g, {e}, time, dt, fraction, specific_volume, 1, state, &velocity);
  }
  // Sum of what a jet brings, and the flux that it reports [m^3/s].
  std::pair<double, double> flux(const Emitter& e, const std::vector<std::uint8_t>& owned = {},
                                 std::vector<SourceCell>* cells = nullptr) {
    std::vector<SourceCell> sources;
    const std::vector<std::uint8_t> fixed = grid::fixed_by_walls(g, {});
    const double told = find_sources(g, e, e.emission(0.0, 0.1), fixed, owned, specific_volume, 1, sources);
    double sum = 0.0;
    for (const SourceCell& s : sources) sum += static_cast<double>(s.rate) * g.h * g.h * g.h;
    if (cells) *cells = sources;
    return {sum, told};
  }
};

// An emitter with the given centre and edges (or diameters), turned about an axis.
Emitter emitter(Emitter::Shape shape, const Vec3d& center, const Vec3d& size, const Mat3d& turn = Mat3d::Identity()) {
  Emitter e;
  e.shape = shape;
  Eigen::Matrix4d to_world = Eigen::Matrix4d::Identity();
  to_world.topLeftCorner<3, 3>() = turn * size.asDiagonal();
  to_world.topRightCorner<3, 1>() = center;
  e.from_world = to_world.inverse();
  e.mode = Emitter::Mode::kContinuous;
  e.end_time = 10.0;
  return e;
}

Emitter jet(Emitter e, const Vec3d& velocity) {
  e.has_velocity = true;
  e.velocity = velocity;
  return e;
}

std::shared_ptr<const geometry::Surface> surface(const EmptyBox& s, const geometry::TriangleMesh& mesh) {
  return geometry::examine(mesh, 0.5 * s.g.h);
}

// About x, by 30 degrees.
Mat3d turned() {
  const double c = std::cos(M_PI / 6), w = std::sin(M_PI / 6);
  Mat3d turn;
  turn << 1, 0, 0, 0, c, -w, 0, w, c;
  return turn;
}

}  // namespace

TEST_CASE("Emitters fill the cells whose middles they contain") {
  EmptyBox s;
  Emitter box = emitter(Emitter::Shape::kBox, {0.3, 0.5, 0.5}, {0.4, 0.2, 0.6});
  Emitter ball = emitter(Emitter::Shape::kSphere, {0.7, 0.5, 0.5}, {0.4, 0.4, 0.4});
  box.density = 0.5;
  ball.density = 2.0;
  ball.temperature = 30.0;
  place_emitter(s.g, nullptr, box);
  place_emitter(s.g, nullptr, ball);
  apply_emitters(s.g, {box, ball}, 0.0, 0.1, {}, {}, 1, s.state, &s.velocity);
  std::size_t in_box = 0, in_ball = 0;
  for (int k = 0; k < 20; ++k)
    for (int j = 0; j < 20; ++j)
      for (int i = 0; i < 20; ++i) {
        const Vec3d x = s.g.cell_center(i, j, k);
        const double expected = ball.contains(x) ? 2.0 : (box.contains(x) ? 0.5 : 0.0);  // the later one wins
        CHECK(static_cast<double>(s.state.smoke[s.g.cell(i, j, k)]) == expected);
        CHECK(static_cast<double>(s.state.temperature[s.g.cell(i, j, k)]) == (ball.contains(x) ? 30.0 : 0.0));
        in_box += expected == 0.5;
        in_ball += expected == 2.0;
      }
  CHECK(in_box == 8 * 4 * 12);
  CHECK(static_cast<double>(in_ball) == Approx(4.0 / 3.0 * M_PI * 64).epsilon(0.05));
  CHECK(box.cells.size() == in_box);
  CHECK(box.bytes() == box.cells.capacity() * sizeof(std::size_t));  // nothing for a velocity that it has not
  for (const auto& c : s.velocity.c)
    for (Real v : c) CHECK(v == 0);
}

TEST_CASE("A closed mesh is a region like any other") {
  EmptyBox s;
  const Vec3d center(0.52, 0.49, 0.5);
  Emitter ball = jet(emitter(Emitter::Shape::kSphere, center, Vec3d::Constant(0.5)), {0, 1, 0});
  Emitter mesh = jet(emitter(Emitter::Shape::kBox, {9, 9, 9}, Vec3d::Constant(1.0)), {0, 1, 0});  // does not count
  const auto examined = surface(s, geometry::shapes::sphere(0.25, 32, center));
  place_emitter(s.g, nullptr, ball);
  place_emitter(s.g, examined.get(), mesh);
  s.apply(ball, 0.0);
  EmptyBox other;
  other.apply(mesh, 0.0);
  int different = 0, held = 0;
  for (std::size_t c = 0; c < s.state.smoke.size(); ++c) {
    different += s.state.smoke[c] != other.state.smoke[c];
    held += s.state.smoke[c] > 0;
  }
  CHECK(held > 400);
  CHECK(different < held / 50);
  CHECK(mesh.area_across({0, 1, 0}) == Approx(M_PI * 0.0625).epsilon(0.01));
  CHECK(s.flux(mesh).first == Approx(s.flux(ball).first).epsilon(0.01));
}

TEST_CASE("Emitters act when they are on: initial ones once, others in their interval and by their keys") {
  EmptyBox s;
  Emitter once = emitter(Emitter::Shape::kBox, {0.5, 0.5, 0.5}, {0.2, 0.2, 0.2});
  once.mode = Emitter::Mode::kInitial;
  Emitter blown = jet(emitter(Emitter::Shape::kBox, {0.5, 0.5, 0.5}, {0.2, 0.2, 0.2}), {1, 2, 3});
  blown.start_time = 1.0;
  blown.end_time = 2.0;
  place_emitter(s.g, nullptr, once);
  place_emitter(s.g, nullptr, blown);
  const std::size_t c = s.g.cell(10, 10, 10), n = s.g.node(10, 10, 10);
  const auto smoke_at = [&](const Emitter& e, double time, double dt = 0.01) {
    s.clear();
    s.apply(e, time, dt);
    return s.state.smoke[c] > 0;
  };
  CHECK(smoke_at(once, 0.0));
  CHECK(s.velocity.at(n) == Vec3(0, 0, 0));
  CHECK_FALSE(smoke_at(once, 0.01));
  CHECK_FALSE(smoke_at(blown, 0.98));
  CHECK(smoke_at(blown, 0.995));
  CHECK(s.velocity.at(n) == Vec3(1, 2, 3));
  CHECK(s.velocity.at(s.g.node(16, 16, 16)) == Vec3(0, 0, 0));
  CHECK(smoke_at(blown, 1.99));
  CHECK_FALSE(smoke_at(blown, 2.0));
  CHECK(smoke_at(blown, 1.0, 0.0));
  CHECK_FALSE(smoke_at(blown, 2.0, 0.0));

  Emitter ramp = blown;
  ramp.start_time = 0.0;
  ramp.end_time = 10.0;
  ramp.keys = {{1.0, 0.0, 10.0, {0, 0, 0}, true},
               {2.0, 1.0, 20.0, {4, 0, 0}, true},
               {2.0, 3.0, 20.0, {4, 0, 0}, true},
               {3.0, 3.0, 20.0, {8, 0, 0}, false},
               {4.0, 5.0, 20.0, {1, 0, 0}, true}};
  const auto at = [&](double time, double dt) { return ramp.emission(time, dt); };
  CHECK(at(0.0, 0.5).density == 0.0);
  CHECK(at(1.0, 0.5).density == Approx(0.25));
  CHECK(at(1.0, 0.5).temperature == Approx(12.5));
  CHECK(at(1.0, 0.5).velocity[0] == Approx(1.0));
  CHECK(at(1.9, 0.2).density == Approx(0.5 * (0.95 + 3.0)));  // across the jump
  CHECK(at(2.5, 1.0).share == Approx(0.5));
  CHECK(at(2.5, 1.0).velocity[0] == Approx(7.0));
  CHECK(at(3.2, 0.5).share == 0.0);
  CHECK(at(7.0, 0.5).density == 5.0);
  CHECK(ramp.fastest(0.0, 0.5) == 0.0);
  CHECK(ramp.fastest(1.0, 1.5) == Approx(2.0));
  CHECK(ramp.fastest(2.0, 2.9) == Approx(7.6));
  CHECK(ramp.fastest(3.1, 3.9) == 0.0);
  CHECK(ramp.fastest(5.0, 6.0) == Approx(1.0));
}

TEST_CASE("Steps of any length add up to the same emission", "[law]") {
  Emitter e = emitter(Emitter::Shape::kBox, {0.5, 0.5, 0.5}, {0.2, 0.2, 0.2});
  e.start_time = 0.13;
  e.end_time = 0.91;
  e.keys = {{0.2, 0.0, 0.0, {0, 0, 0}, true}, {0.5, 0.0, 0.0, {3, 0, 0}, true}, {0.7, 0.0, 0.0, {1, 0, 0}, false}};
  for (const int steps : {1, 3, 16, 77}) {
    double sum = 0.0;
    for (int i = 0; i < steps; ++i) {
      const Emission part = e.emission(i / static_cast<double>(steps), 1.0 / steps);
      sum += part.share * part.velocity[0] / steps;
    }
    CHECK(sum == Approx(0.3 * 1.5 + 0.2 * 2.0).epsilon(1e-6));
  }
}

TEST_CASE("Solids and walls are left as they are") {
  EmptyBox s;
  Emitter e = jet(emitter(Emitter::Shape::kBox, {0.5, 0.5, 0.5}, {0.4, 0.4, 0.4}), {0, 2, 0});
  place_emitter(s.g, nullptr, e);
  s.fraction.assign(s.g.cell_count(), 0);
  s.specific_volume.assign(s.g.node_count(), 1);
  const std::size_t c = s.g.cell(10, 10, 10), cut = s.g.cell(9, 10, 10), n = s.g.node(10, 10, 10);
  s.fraction[c] = Real(0.6);
  s.fraction[cut] = Real(0.4);
  s.specific_volume[n] = Real(0.01);
  s.apply(e, 0.0);
  CHECK(s.state.smoke[c] == 0);
  CHECK(s.state.smoke[cut] == 1);
  CHECK(s.velocity.at(n) == Vec3(0, 0, 0));
  CHECK(s.velocity.at(s.g.node(9, 10, 10)) == Vec3(0, 2, 0));
}

TEST_CASE("A jet brings its speed times the area of its region across it", "[law]") {
  EmptyBox s;
  const Vec3d center(0.49, 0.52, 0.47);
  for (const Vec3d& v : {Vec3d(2, 0, 0), Vec3d(0, -1, 0), Vec3d(1.0, 0.5, -2.0)}) {
    for (const Mat3d& turn : {Mat3d(Mat3d::Identity()), turned()}) {
      const Vec3d size(0.3, 0.37, 0.26);
      Emitter box = jet(emitter(Emitter::Shape::kBox, center, size, turn), v);
      place_emitter(s.g, nullptr, box);
      double area = 0.0;  // of the three faces that look along v
      for (int a = 0; a < 3; ++a)
        area += size[(a + 1) % 3] * size[(a + 2) % 3] * std::abs(turn.col(a).dot(v)) / v.norm();
      CHECK(box.area_across(v.normalized()) == Approx(area));
      CHECK(s.flux(box).first == Approx(area * v.norm()).epsilon(1e-5));
      CHECK(s.flux(box).second == Approx(area * v.norm()).epsilon(1e-5));
    }
    Emitter ball = jet(emitter(Emitter::Shape::kSphere, center, Vec3d::Constant(0.3)), v);
    place_emitter(s.g, nullptr, ball);
    CHECK(s.flux(ball).first == Approx(M_PI * 0.0225 * v.norm()).epsilon(1e-5));
  }
}

TEST_CASE("A jet brings its volume on the side that it comes from, at a wall and off a solid, too") {
  EmptyBox s;
  std::vector<SourceCell> cells;
  Emitter e = jet(emitter(Emitter::Shape::kBox, {0.5, 0.5, 0.5}, {0.5, 0.25, 0.25}), {2, 0, 0});
  place_emitter(s.g, nullptr, e);
  const double flux = s.flux(e, {}, &cells).first;
  for (const SourceCell& cell : cells) CHECK(s.g.cell_center(cell.place[0], 0, 0)[0] < 0.35);
  // Half of it behind the wall: what comes in comes from the wall.
  Emitter wall = jet(emitter(Emitter::Shape::kBox, {0.0, 0.5, 0.5}, {0.5, 0.25, 0.25}), {2, 0, 0});
  place_emitter(s.g, nullptr, wall);
  CHECK(s.flux(wall, {}, &cells).first == Approx(flux).epsilon(0.01));
  for (const SourceCell& cell : cells) CHECK(cell.place[0] == 0);
  // A solid over the half that it comes from: off its surface.
  std::vector<std::uint8_t> owned(s.g.padded_count(), 0);
  s.specific_volume.assign(s.g.node_count(), 1);
  for (int k = 0; k < 20; ++k)
    for (int j = 0; j < 20; ++j)
      for (int i = 0; i < 10; ++i) {
        owned[s.g.padded(i, j, k)] = 1;
        for (const auto& c : grid::kCorner) s.specific_volume[s.g.node(i + c[0], j + c[1], k + c[2])] = Real(0.01);
      }
  CHECK(s.flux(e, owned, &cells).first == Approx(flux).epsilon(0.01));
  for (const SourceCell& cell : cells) CHECK(cell.place[0] == 10);
  // A solid over all of it: nothing.
  owned.assign(s.g.padded_count(), 1);
  CHECK(s.flux(e, owned).first == 0.0);
}

TEST_CASE("A jet beside walls, or as wide as a slab of one cell, brings all of its flux") {
  EmptyBox s;
  Emitter corner = jet(emitter(Emitter::Shape::kBox, {0.5, 0.1, 0.1}, {0.3, 0.2, 0.2}), {2, 0, 0});
  place_emitter(s.g, nullptr, corner);
  CHECK(s.flux(corner).first == Approx(2.0 * 0.04).epsilon(1e-5));
  s.g.cells = {20, 20, 1};
  s.clear();
  Emitter slab = jet(emitter(Emitter::Shape::kBox, {0.5, 0.5, 0.025}, {0.3, 0.22, 0.05}), {0, 2, 0});
  place_emitter(s.g, nullptr, slab);
  CHECK(s.flux(slab).first == Approx(2.0 * 0.3 * 0.05).epsilon(1e-5));
  s.apply(slab, 0.0);
  for (const int k : {0, 1}) CHECK(s.velocity.at(s.g.node(10, 10, k)) == Vec3(0, 2, 0));
}

TEST_CASE("A jet goes round periodic faces") {
  EmptyBox s;
  s.g.periodic = {true, false, false};
  Emitter e = jet(emitter(Emitter::Shape::kBox, {0.0, 0.5, 0.5}, {0.3, 0.25, 0.25}), {0, 2, 0});
  place_emitter(s.g, nullptr, e);
  s.apply(e, 0.0);
  for (const int i : {0, 2, 18, 20}) CHECK(s.velocity.at(s.g.node(i, 10, 10)) == Vec3(0, 2, 0));
  CHECK(s.velocity.at(s.g.node(10, 10, 10)) == Vec3(0, 0, 0));
  CHECK(s.state.smoke[s.g.cell(18, 10, 10)] == 1);
  CHECK(s.flux(e).first == Approx(2.0 * 0.3 * 0.25).epsilon(0.01));
}

TEST_CASE("Emitters that hold nothing of the box are refused") {
  EmptyBox s;
  const auto message = [&](Emitter e, const geometry::Surface* volume = nullptr) -> std::string {
    try {
      place_emitter(s.g, volume, e);
    } catch (const Error& error) {
      CHECK(error.code() == ErrorCode::kArgument);
      return error.what();
    }
    return "";
  };
  const auto names = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  CHECK(names(message(emitter(Emitter::Shape::kBox, {1.5, 0.5, 0.5}, Vec3d::Constant(0.2))), "lies outside the box"));
  CHECK(names(message(emitter(Emitter::Shape::kSphere, {0.5, 0.5, 0.5}, Vec3d::Constant(0.02))), "too small"));
  CHECK(message(emitter(Emitter::Shape::kSphere, {0.525, 0.525, 0.525}, Vec3d::Constant(0.02))).empty());
  const auto tiny = jet(emitter(Emitter::Shape::kSphere, {0.525, 0.525, 0.525}, Vec3d::Constant(0.02)), {1, 0, 0});
  CHECK(names(message(tiny), "holds 0 nodes"));
  const auto away = surface(s, geometry::shapes::sphere(0.1, 8, {0.5, 2.0, 0.5}));
  CHECK(names(message({}, away.get()), "lies outside the box"));
}
