// Purpose: plastic strain of a solid: what it stores, how it flows, what elements that have yielded feel.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>

#include "solid/element/energy.hpp"
#include "solid/element/material_lattice.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/hexahedron.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kFast = 1e9;
constexpr int kCells = 6;

// A block that can yield, with a lattice around all that its displacements lead to.
TestSolid plastic_block(double yield_stress, double hardening = 0.0, double size = kCells * kH) {
  TestSolid s =
      make_block(cube_grid(kCells, kH), material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.0));
  s.rest.plastic = {yield_stress, kFast, hardening};
  s.rest.lattice = solid::make_material_lattice(Vec3d::Constant(-size), Vec3d::Constant(2.0 * size), kH);
  s.state.plastic.resize(s.rest.lattice.node_count());
  return s;
}

// x = F X about the middle
void deform_about_middle(TestSolid& s, const Mat3d& f) {
  const Mat3d change = Mat3d::Identity() - f.inverse();
  const Vec3d middle = Vec3d::Constant(0.5 * kCells * kH);
  set_displacement(s, [&](const Vec3d& x) -> Vec3d { return change * (x - middle); });
}

void yield(TestSolid& s, int points = 1, int threads = 1) {
  const Parallel parallel(threads);
  solid::compute_mass(parallel, s.rest, s.state, s.work);
  solid::flow(parallel, s.rest, 1e-3, points, s.work, s.state);
  solid::compute_material(parallel, s.rest, s.state, points, s.work);
}

double equivalent_stress(const TestSolid& s, std::size_t e) {
  const solid::ElementPoint point = s.work.element_point(e, 0);
  const double volume = kH * kH * kH;
  Mat3d tau;
  tau << point.stress[0], point.stress[5], point.stress[4], point.stress[5], point.stress[1], point.stress[3],
      point.stress[4], point.stress[3], point.stress[2];
  const Mat3d shear = tau - tau.trace() / 3.0 * Mat3d::Identity();
  return std::sqrt(1.5) * shear.norm() / volume;
}

// A bar bent at constant volume: r^2 = a^2 + 2 a Y, angle X / a (Rivlin 1949). It turns lines, stretches those along X
// by r / a, those along Y by a / r.
struct Bend {
  double a;
  double log_stretch(double Y) const { return 0.5 * std::log1p(2.0 * Y / a); }
  Vec3d material(const Vec3d& x) const {
    const double up = a + x[1], r2 = x[0] * x[0] + up * up;
    return {a * std::atan2(x[0], up), (r2 - a * a) / (2.0 * a), x[2]};
  }
};

void set_bend(TestSolid& s, const Bend& bend, bool yielded) {
  set_displacement(s, [&](const Vec3d& x) -> Vec3d { return x - bend.material(x); });
  const grid::Grid& lattice = s.rest.lattice;
  for (int k = 0; yielded && k <= lattice.cells[2]; ++k)
    for (int j = 0; j <= lattice.cells[1]; ++j)
      for (int i = 0; i <= lattice.cells[0]; ++i) {
        const auto log = static_cast<Real>(bend.log_stretch(lattice.node_position(i, j, k)[1]));
        s.state.plastic[lattice.node(i, j, k)] = {{log, -log, 0, 0, 0}, 1};
      }
}

// A deformed block with random displacements on top.
TestSolid rough_block() {
  TestSolid s = plastic_block(500.0, 1000.0);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> offset(-0.1 * kH, 0.1 * kH);
  const Mat3d f = rotation(0.5, {1, 2, 3}) * Vec3d(1.3, 0.9, 0.85).asDiagonal();
  const Mat3d change = Mat3d::Identity() - f.inverse();
  set_displacement(
      s, [&](const Vec3d& x) -> Vec3d { return change * x + Vec3d(offset(random), offset(random), offset(random)); });
  return s;
}

}  // namespace

TEST_CASE("A block that is stretched beyond its yield stress keeps the rest, however it turns", "[law]") {
  const Vec3d stretch(1.5, 1.0 / std::sqrt(1.5), 1.0 / std::sqrt(1.5));
  const double yield_stress = 2000.0;
  for (const int points : {1, 8})
    for (const double angle : {0.0, 0.8}) {
      TestSolid s = plastic_block(yield_stress);
      const Mat3d turn = rotation(angle, {1, -2, 1});
      deform_about_middle(s, turn * stretch.asDiagonal());
      yield(s, points);
      if (points == 1)
        for (std::size_t e = 0; e < s.work.element_cell.size(); ++e)
          CHECK(equivalent_stress(s, e) == Approx(yield_stress).epsilon(1e-3));
      const double loaded = s.work.elastic_energy;
      // The elastic stretch at yield: 2 mu (s^2 - s - 1/s + 1/sqrt(s)) = yield stress
      double low = 1.0, high = 1.3;
      for (int it = 0; it < 60; ++it) {
        const double x = 0.5 * (low + high);
        (2.0 * s.rest.elastic.mu * (x * x - x - 1.0 / x + 1.0 / std::sqrt(x)) > yield_stress ? high : low) = x;
      }
      // Without its elastic part it has no stress, also after a quarter turn.
      const double kept = 1.5 / low;
      deform_about_middle(s, rotation(M_PI / 2.0, {0, 1, 0}) * turn *
                                 Vec3d(kept, 1.0 / std::sqrt(kept), 1.0 / std::sqrt(kept)).asDiagonal());
      compute(s, points);
      CHECK(s.work.elastic_energy < 0.02 * loaded);  // of the outermost cells, which read what lay outside
      const grid::Grid& g = s.state.band.grid;
      const auto middle = static_cast<std::size_t>(s.work.element[g.cell(kCells / 2, kCells / 2, kCells / 2)]);
      if (points == 1) CHECK(equivalent_stress(s, middle) < 1e-3 * yield_stress);
      CHECK(solid::elastic_energy(Parallel(1), s.rest, s.state, s.work, points) ==
            Approx(s.work.elastic_energy).epsilon(1e-9).margin(1e-9));
      CHECK(solid::largest_plastic_strain(s.state) == Approx(std::log(kept)).epsilon(1e-3));
    }
}

TEST_CASE("Plastic flow keeps volume: det F_p = 1") {
  TestSolid s = rough_block();
  yield(s);
  const solid::PlasticField plastic(s.rest, s.state);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(0.0, kCells * kH);
  double largest = 0.0;
  for (int n = 0; n < 100; ++n) {
    const Mat3d metric = plastic.metric({place(random), place(random), place(random)});
    CHECK(metric.determinant() == Approx(1.0).epsilon(1e-12));
    largest = std::max(largest, (metric - Mat3d::Identity()).norm());
  }
  CHECK(largest > 0.1);
}

TEST_CASE("Where nothing flows nothing changes, and flow has the same bits for any number of threads") {
  const auto bits = [](const TestSolid& s) {
    std::vector<Real> values;
    for (const solid::PlasticNode& node : s.state.plastic) {
      values.insert(values.end(), node.log, node.log + 5);
      values.push_back(node.accumulated);
    }
    return values;
  };
  TestSolid one = rough_block(), many = rough_block();
  yield(one, 1, 1);
  yield(many, 1, 3);
  CHECK(bits(one) == bits(many));
  // A material that has hardened beyond the stress stands still.
  const std::vector<Real> before = bits(one);
  one.rest.plastic.yield_stress = 1e6;
  yield(one);
  CHECK(bits(one) == before);
  for (const Real x : bits(plastic_block(1.0))) CHECK(x == 0);
}

TEST_CASE("A bent bar that has yielded has neither energy nor forces, its hourglass modes neither") {
  const Bend bend{0.6};
  TestSolid elastic = plastic_block(1e9), yielded = plastic_block(1e9);
  set_bend(elastic, bend, false);
  set_bend(yielded, bend, true);
  compute(elastic, 1);
  compute(yielded, 1);
  CHECK(yielded.work.elastic_energy < 1e-3 * elastic.work.elastic_energy);
  const auto modes = [](const TestSolid& s) {
    double sum = 0.0;
    for (const auto& force : s.work.hourglass_force)
      for (const Real x : force) sum += static_cast<double>(x) * static_cast<double>(x);
    return std::sqrt(sum);
  };
  CHECK(modes(yielded) < 0.1 * modes(elastic));
}

TEST_CASE("Hourglass forces of a solid that can yield are those of one that cannot, until it does") {
  TestSolid can = rough_block(), cannot = rough_block();
  can.rest.plastic.yield_stress = 1e9;
  cannot.state.plastic.clear();
  compute(can, 1);
  compute(cannot, 1);
  REQUIRE(can.work.hourglass_force.size() == can.work.element_cell.size());
  REQUIRE(cannot.work.hourglass_force.empty());
  CHECK(can.work.elastic_energy == Approx(cannot.work.elastic_energy).epsilon(1e-12));
  for (std::size_t e = 0; e < can.work.element_cell.size(); ++e) {
    Real a[24], b[24];
    solid::element_force(can.state, can.work, e, a);
    solid::element_force(cannot.state, cannot.work, e, b);
    for (int i = 0; i < 24; ++i) CHECK(a[i] == Approx(b[i]).epsilon(1e-4).margin(1e-3));
  }
}

TEST_CASE("What flows in a block that is held does not depend on the steps") {
  const double rate = 40.0, time = 0.05, stretch = 1.4;
  const auto accumulated = [&](double flow_rate, int steps) {
    TestSolid s = plastic_block(1000.0, 500.0);
    s.rest.plastic.flow_rate = flow_rate;
    deform_about_middle(s, Vec3d(stretch, 1.0 / std::sqrt(stretch), 1.0 / std::sqrt(stretch)).asDiagonal());
    solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
    for (int n = 0; n < steps; ++n) CHECK(solid::flow(Parallel(1), s.rest, time / steps, 1, s.work, s.state));
    return solid::largest_plastic_strain(s.state);
  };
  const double expected = accumulated(kFast, 1) * (1.0 - std::exp(-rate * time));
  for (const int steps : {1, 2, 10}) CHECK(accumulated(rate, steps) == Approx(expected).epsilon(1e-3));
}

TEST_CASE("Flow takes energy, also where the material is stretched so that points are closer than nodes", "[law]") {
  const Vec3d stretch = GENERATE(Vec3d(1.1, 1.0, 0.9), Vec3d(2.0, 2.0, 0.25), Vec3d(4.0, 0.5, 0.5));
  CAPTURE(stretch);
  TestSolid s = plastic_block(500.0, 0.0, 1.2);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(-0.2, 0.2);
  const Vec3d middle = Vec3d::Constant(0.5 * kCells * kH);
  set_displacement(s, [&](const Vec3d& x) -> Vec3d {
    const Vec3d rough(part(random), part(random), part(random));
    return x - (x - middle + kH * rough).cwiseQuotient(stretch);
  });
  solid::compute_mass(Parallel(1), s.rest, s.state, s.work);
  // The rest shape is as long as the block, and the plastic strain is that of the block.
  for (solid::PlasticNode& node : s.state.plastic) {
    for (int a = 0; a < 2; ++a) node.log[a] = static_cast<Real>(std::log(stretch[a]));
    node.accumulated = 1;
  }
  const auto energy = [&] { return solid::elastic_energy(Parallel(1), s.rest, s.state, s.work, 1); };
  double before = energy();
  const double first = before;
  for (int n = 0; n < 20; ++n) {
    solid::flow(Parallel(1), s.rest, 1e-3, 1, s.work, s.state);
    CHECK(energy() <= before * (1.0 + 1e-6));
    before = energy();
  }
  CHECK(before < 0.95 * first);
}

TEST_CASE("Hourglass modes of what can yield resist no more than its yield stress, and their force is its energy's") {
  const double yield_stress = 500.0;
  TestSolid s = plastic_block(yield_stress);
  const solid::PlasticField plastic(s.rest, s.state);
  const double mu = s.rest.elastic.mu;
  const auto modes = [&](double amplitude) {
    Vec3d u[8];
    for (std::size_t a = 0; a < 8; ++a)
      u[a] = solid::kHourglassSign[0][a] * solid::kHourglassNorm * amplitude * Vec3d(0.6, 0.0, 0.8);
    const solid::ElasticPoint center = solid::elastic_point(plastic, u, Vec3d::Zero(), kH, Vec3d::Zero());
    return solid::hourglass_modes(s.rest, plastic, center, u, kH, mu);
  };
  const double k = solid::kHourglassFactor * mu * kH;
  const double most = kH * kH * kH * yield_stress * yield_stress / (6.0 * mu), limit = std::sqrt(2.0 * most / k);
  for (const double part : {0.2, 0.9, 1.1, 3.0, 20.0}) {
    const double amplitude = part * limit, small = 1e-6 * limit;
    const solid::Hourglass at = modes(amplitude);
    CHECK(at.amplitudes[0].norm() == Approx(amplitude));
    const double slope = (modes(amplitude + small).energy - modes(amplitude - small).energy) / (2.0 * small);
    CHECK(at.stiffness * amplitude == Approx(slope).epsilon(1e-5));
    CHECK(at.stiffness * amplitude == Approx(k * std::min(amplitude, limit)).epsilon(1e-9));
  }
}
