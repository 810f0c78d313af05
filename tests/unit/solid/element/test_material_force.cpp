// Purpose: force and stiffness of the elements against the derivative of the energy at held material points.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>

#include "reference/lagrangian_element.hpp"
#include "unit/solid/ball.hpp"
#include "unit/solid/element/soft.hpp"

using namespace efsi;
using namespace efsi::test;
using reference::Corners;
using reference::LagrangianElement;

namespace {

material::Elastic elastic(material::Law law) { return material::from_youngs_modulus(law, 2e4, 0.3); }

// u of the affine map x = F X + t.
std::function<Vec3d(const Vec3d&)> affine(const Mat3d& f, const Vec3d& t) {
  const Mat3d inverse = f.inverse();
  return [inverse, t](const Vec3d& x) -> Vec3d { return x - inverse * (x - t); };
}

// A stretched, turned block with random corners on top of it.
TestSolid deformed_block(material::Law law, const Vec3d& stretch, double noise, int points, unsigned seed) {
  TestSolid s = make_block(cube_grid(3, kH), elastic(law));
  const Mat3d f = rotation(0.7, {1, 2, -1}) * stretch.asDiagonal() * rotation(-0.4, {0, 1, 1});
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> offset(-noise * kH, noise * kH);
  const auto u = affine(f, {0.02, -0.01, 0.03});
  set_displacement(
      s, [&](const Vec3d& x) -> Vec3d { return u(x) + Vec3d(offset(random), offset(random), offset(random)); });
  compute(s, points);
  return s;
}

std::size_t middle_element(const TestSolid& s) {
  return static_cast<std::size_t>(s.work.element[s.state.band.grid.cell(1, 1, 1)]);
}

LagrangianElement twin_of(const TestSolid& s, int points, Corners& x) {
  LagrangianElement twin;
  twin.elastic = s.rest.elastic;
  twin.points = points;
  for (std::size_t a = 0; a < 8; ++a) {
    const int i = 1 + grid::kCorner[a][0], j = 1 + grid::kCorner[a][1], k = 1 + grid::kCorner[a][2];
    x[a] = s.state.band.grid.node_position(i, j, k);
    twin.material[a] = x[a] - s.state.u.at(s.state.band.grid.node(i, j, k)).cast<double>();
  }
  return twin;
}

// F^-1 = dX/dx at the centre of an element.
Mat3d inverse_gradient(const Corners& x, const Corners& material) {
  Mat3d dx = Mat3d::Zero(), dm = Mat3d::Zero();
  for (std::size_t a = 0; a < 8; ++a) {
    Vec3d g;
    for (int i = 0; i < 3; ++i) g[i] = grid::kCorner[a][i] ? 0.25 : -0.25;
    dx += x[a] * g.transpose();
    dm += material[a] * g.transpose();
  }
  return dm * dx.inverse();
}

// Energy of the hourglass stiffness of a one-point element: k/2 |F^-1 x - X|^2 over its modes.
double hourglass_energy(double stiffness, const Mat3d& inverse_f, const Corners& x, const Corners& material) {
  constexpr int kMode[4][3] = {{1, 1, 0}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};  // products of the coordinates
  double energy = 0.0;
  for (const auto& mode : kMode) {
    Vec3d amplitude = Vec3d::Zero();
    for (std::size_t a = 0; a < 8; ++a) {
      double sign = 1.0;
      for (int i = 0; i < 3; ++i)
        if (mode[i]) sign *= grid::kCorner[a][i] ? 1.0 : -1.0;
      amplitude += sign / std::sqrt(8.0) * (inverse_f * x[a] - material[a]);
    }
    energy += 0.5 * stiffness * amplitude.squaredNorm();
  }
  return energy;
}

}  // namespace

TEST_CASE("Element force is minus the derivative of the energy when nodes carry their material points along", "[law]") {
  for (const auto law : material::kLaws)
    for (const int points : {1, 8}) {
      const TestSolid s = deformed_block(law, {1.3, 1.15, 0.9}, 0.1, points, 11);
      REQUIRE(s.work.degenerate == 0);
      const std::size_t e = middle_element(s);
      Corners x;
      const LagrangianElement twin = twin_of(s, points, x);
      Real force[24];
      solid::element_force(s.state, s.work, e, force);
      const double stiffness = static_cast<double>(s.work.element_point(e, 0).hourglass[0]);
      CHECK((stiffness > 0.0) == (points == 1));
      const auto energy = [&](const Corners& y) {
        return twin.energy(y) + hourglass_energy(stiffness, inverse_gradient(y, twin.material), y, twin.material);
      };
      const double scale = s.rest.elastic.mu * kH * kH;
      for (std::size_t a = 0; a < 8; ++a)
        for (int i = 0; i < 3; ++i) {
          const double step = 1e-5 * kH;
          Corners up = x, down = x;
          up[a][i] += step;
          down[a][i] -= step;
          const double difference = -(energy(up) - energy(down)) / (2.0 * step);
          CHECK(static_cast<double>(force[3 * a + static_cast<std::size_t>(i)]) ==
                Approx(difference).margin(2e-5 * scale));
        }
    }
}

TEST_CASE("The energy of the elements is that of their twins") {
  for (const auto law : material::kLaws) {
    TestSolid s = deformed_block(law, {1.3, 1.15, 0.9}, 0.1, 8, 12);
    double total = 0.0;
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
          LagrangianElement twin;
          twin.elastic = s.rest.elastic;
          Corners x;
          for (std::size_t a = 0; a < 8; ++a) {
            const auto& c = grid::kCorner[a];
            x[a] = s.state.band.grid.node_position(i + c[0], j + c[1], k + c[2]);
            twin.material[a] = x[a] - s.state.u.at(s.state.band.grid.node(i + c[0], j + c[1], k + c[2])).cast<double>();
          }
          total += twin.energy(x);
        }
    CHECK(s.work.elastic_energy == Approx(total).epsilon(1e-5));
  }
}

TEST_CASE("Element stiffness is minus the derivative of the force at held material points", "[law]") {
  // States whose linearisation is definite as it stands: nothing is clamped.
  std::mt19937 random(13);
  std::normal_distribution<double> normal;
  for (const auto law : material::kLaws)
    for (const int points : {1, 8}) {
      const bool corotational = law == material::Law::kCorotational;
      const Vec3d stretch = corotational ? Vec3d(1.3, 1.15, 1.25) : Vec3d(1.25, 1.1, 0.95);
      const material::PrincipalResponse r = material::principal_response(elastic(law), stretch);
      REQUIRE((material::make_definite(r).hessian - r.hessian).norm() < 1e-12 * r.hessian.norm());
      REQUIRE(std::min(r.symmetric.minCoeff(), r.skew.minCoeff()) > 0.0);
      const TestSolid s = deformed_block(law, stretch, corotational ? 0.03 : 0.01, points, 14);
      const std::size_t e = middle_element(s);
      Corners x;
      LagrangianElement twin = twin_of(s, points, x);
      const double hourglass = static_cast<double>(s.work.element_point(e, 0).hourglass[0]);
      Real in[24], out[24];
      Corners direction;
      for (std::size_t a = 0; a < 8; ++a)
        for (int i = 0; i < 3; ++i) {
          direction[a][i] = normal(random);
          in[3 * a + static_cast<std::size_t>(i)] = static_cast<Real>(direction[a][i]);
        }
      solid::element_stiffness(s.work, kH, e, in, out);
      const double step = 1e-6 * kH;
      Corners up = x, down = x, force_up, force_down;
      for (std::size_t a = 0; a < 8; ++a) {
        up[a] += step * direction[a];
        down[a] -= step * direction[a];
      }
      twin.energy(up, &force_up);
      twin.energy(down, &force_down);
      const double scale = s.rest.elastic.mu * kH;
      double worst = 0.0;
      for (std::size_t a = 0; a < 8; ++a)
        for (int i = 0; i < 3; ++i) {
          double expected = -(force_up[a][i] - force_down[a][i]) / (2.0 * step);
          // The hourglass energy is quadratic: a unit step gives its exact derivative.
          Corners plus = direction, minus = direction;
          plus[a][i] += 0.5;
          minus[a][i] -= 0.5;
          const Corners origin = [] {
            Corners c;
            c.fill(Vec3d::Zero());
            return c;
          }();
          const Mat3d inverse_f = inverse_gradient(x, twin.material);
          expected += hourglass_energy(hourglass, inverse_f, plus, origin) -
                      hourglass_energy(hourglass, inverse_f, minus, origin);
          const double value = static_cast<double>(out[3 * a + static_cast<std::size_t>(i)]);
          worst = std::max(worst, std::abs(value - expected));
        }
      INFO("law " << static_cast<int>(law) << ", points " << points);
      CHECK(worst < 1e-4 * scale);
    }
}

TEST_CASE("Element stiffness is symmetric, positive semi-definite and has the given diagonal") {
  for (const auto law : material::kLaws)
    for (const int points : {1, 8}) {
      // Compressed and sheared, so that clamping acts.
      TestSolid s = make_block(cube_grid(3, kH), elastic(law));
      const Mat3d f = rotation(0.3, {1, 0, 2}) * Vec3d(0.4, 0.7, 1.5).asDiagonal();
      set_displacement(s, affine(f, {0.01, 0, 0.02}));
      compute(s, points);
      const std::size_t e = middle_element(s);
      Eigen::Matrix<double, 24, 24> k;
      Real diagonal[24];
      solid::element_stiffness_diagonal(s.work, kH, e, diagonal);
      for (int c = 0; c < 24; ++c) {
        Real in[24] = {}, out[24];
        in[c] = 1;
        solid::element_stiffness(s.work, kH, e, in, out);
        for (int r = 0; r < 24; ++r) k(r, c) = static_cast<double>(out[r]);
        CHECK(static_cast<double>(diagonal[c]) == Approx(k(c, c)).epsilon(1e-5));
      }
      CHECK((k - k.transpose()).norm() < 1e-5 * k.norm());
      const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(k).eigenvalues();
      CHECK(values.minCoeff() > -1e-5 * values.maxCoeff());
      // Translations cost nothing.
      for (int i = 0; i < 3; ++i) {
        Real in[24] = {}, out[24];
        for (int a = 0; a < 8; ++a) in[3 * a + i] = 1;
        solid::element_stiffness(s.work, kH, e, in, out);
        for (Real v : out) CHECK(std::abs(static_cast<double>(v)) < 1e-5 * values.maxCoeff());
      }
    }
}

TEST_CASE("Material force vanishes under rigid rotation and translation", "[law]") {
  for (const auto law : material::kLaws)
    for (const int points : {1, 8})
      for (const double angle : {0.0, 0.5, 2.0, 3.14}) {
        TestSolid s = make_block(cube_grid(3, kH), elastic(law));
        set_displacement(s, affine(rotation(angle, {1, -2, 0.5}), {0.1, 0.2, -0.3}));
        compute(s, points);
        CHECK(s.work.degenerate == 0);
        CHECK(s.work.min_det_f == Approx(1.0).margin(1e-5));
        CHECK(s.work.elastic_energy < 1e-9 * s.rest.elastic.mu);
        for (std::size_t e = 0; e < 27; ++e) {
          Real force[24];
          solid::element_force(s.state, s.work, e, force);
          for (Real f : force) REQUIRE(std::abs(static_cast<double>(f)) < 3e-5 * s.rest.elastic.mu * kH * kH);
        }
      }
}

TEST_CASE("A rotation turns the forces and leaves the energy", "[law]") {
  // A quarter turn of the whole map about z takes cells to cells.
  const Mat3d quarter = rotation(1.5707963267948966, {0, 0, 1});
  for (const auto law : material::kLaws)
    for (const int points : {1, 8}) {
      const Mat3d f = rotation(0.3, {1, 0, 2}) * Vec3d(1.2, 0.8, 1.1).asDiagonal();
      TestSolid a = make_block(cube_grid(1, kH), elastic(law)), b = a;
      // Material points of an affine map and bent on top of it, so that hourglass modes take part.
      const auto stretched = affine(f, {0.01, 0.02, 0.03});
      const Vec3d origin = a.state.band.grid.origin;
      const auto material = [&](const Vec3d& x) -> Vec3d {
        const Vec3d q = (x - origin) / kH;
        return x - stretched(x) + 0.05 * kH * Vec3d(q[0] * q[1], q[1] * q[2], q[0] * q[1] * q[2]);
      };
      const auto before_turn = [&](const Vec3d& y) -> Vec3d {
        return {origin[0] + (y[1] - origin[1]), origin[1] + kH - (y[0] - origin[0]), y[2]};
      };
      set_displacement(a, [&](const Vec3d& x) -> Vec3d { return x - material(x); });
      set_displacement(b, [&](const Vec3d& y) -> Vec3d { return y - material(before_turn(y)); });
      compute(a, points);
      compute(b, points);
      CHECK(a.work.elastic_energy == Approx(b.work.elastic_energy).epsilon(1e-5));
      Real fa[24], fb[24];
      solid::element_force(a.state, a.work, 0, fa);
      solid::element_force(b.state, b.work, 0, fb);
      for (std::size_t c = 0; c < 8; ++c) {
        // Corner (i, j, k) of a turns to (1 - j, i, k) of b.
        const auto& o = grid::kCorner[c];
        const std::size_t d = static_cast<std::size_t>((1 - o[1]) + 2 * o[0] + 4 * o[2]);
        const Vec3d before(fa[3 * c], fa[3 * c + 1], fa[3 * c + 2]), after(fb[3 * d], fb[3 * d + 1], fb[3 * d + 2]);
        CHECK((quarter * before - after).norm() < 1e-4 * a.rest.elastic.mu * kH * kH);
      }
    }
}

TEST_CASE("Patch test: an affine map gives one stress and no force inside", "[law]") {
  for (const auto law : material::kLaws)
    for (const int points : {1, 8}) {
      TestSolid s = make_block(cube_grid(4, kH), elastic(law));
      Mat3d f;
      f << 1.2, 0.15, -0.1, 0.05, 0.9, 0.2, 0.0, -0.1, 1.05;
      set_displacement(s, affine(f, {0.03, 0, 0.01}));
      compute(s, points);
      REQUIRE(s.work.element_cell.size() == 64);
      CHECK(s.work.min_det_f == Approx(f.determinant()).epsilon(1e-5));
      CHECK(s.work.max_det_f == Approx(f.determinant()).epsilon(1e-5));
      const Eigen::JacobiSVD<Mat3d> svd(f);
      const double psi = material::principal_response(s.rest.elastic, svd.singularValues()).energy;
      CHECK(s.work.elastic_energy == Approx(psi * 64 * kH * kH * kH / f.determinant()).epsilon(1e-4));
      const grid::Grid& g = s.state.band.grid;
      const auto corner = grid::corner_offsets(g);
      std::vector<Vec3d> sum(g.node_count(), Vec3d::Zero());
      double largest = 0.0;
      for (std::size_t e = 0; e < 64; ++e) {
        Real force[24];
        solid::element_force(s.state, s.work, e, force);
        for (std::size_t a = 0; a < 8; ++a) {
          const Vec3d one(force[3 * a], force[3 * a + 1], force[3 * a + 2]);
          sum[static_cast<std::size_t>(s.work.element_corner[e]) + corner[a]] += one;
          largest = std::max(largest, one.norm());
        }
        for (std::size_t q = 0; q < static_cast<std::size_t>(points); ++q)
          for (int c = 0; c < 6; ++c)
            REQUIRE(static_cast<double>(s.work.element_point(e, q).stress[c]) ==
                    Approx(static_cast<double>(s.work.element_point(0, 0).stress[c]))
                        .margin(1e-4 * s.rest.elastic.mu * kH * kH * kH));
      }
      CHECK(largest > 0.01 * s.rest.elastic.mu * kH * kH);
      for (int k = 1; k < 4; ++k)
        for (int j = 1; j < 4; ++j)
          for (int i = 1; i < 4; ++i) CHECK(sum[g.node(i, j, k)].norm() < 1e-3 * largest);
    }
}

TEST_CASE("Patch test on cut cells: an affine map of a ball gives one stress in all of its elements", "[law]") {
  for (const int points : {1, 8}) {
    TestSolid s = make_ball(cube_grid(24, kH), elastic(material::Law::kCorotational), Vec3d::Constant(0.6), 0.3);
    Mat3d f;
    f << 1.15, 0.12, -0.1, 0.05, 0.95, 0.15, 0.0, -0.1, 1.05;
    set_displacement(s, affine(f, Vec3d::Constant(0.6) - f * Vec3d::Constant(0.6)));
    compute(s, points);
    std::size_t cut = 0;
    for (std::size_t e = 0; e < s.work.element_cell.size(); ++e) {
      cut += s.work.fraction[static_cast<std::size_t>(s.work.element_cell[e])] < Real(1);
      for (std::size_t q = 0; q < static_cast<std::size_t>(points); ++q)
        for (int c = 0; c < 6; ++c)
          REQUIRE(static_cast<double>(s.work.element_point(e, q).stress[c]) ==
                  Approx(static_cast<double>(s.work.element_point(0, 0).stress[c]))
                      .margin(1e-4 * s.rest.elastic.mu * kH * kH * kH));
    }
    CHECK(cut > 50);
    // Force acts on the ball's surface alone: nodes whose 8 cells are elements feel none.
    const grid::Grid& g = s.state.band.grid;
    const auto corner = grid::corner_offsets(g);
    std::vector<Vec3d> sum(g.node_count(), Vec3d::Zero());
    std::vector<int> around(g.node_count(), 0);
    double largest = 0.0;
    for (std::size_t e = 0; e < s.work.element_cell.size(); ++e) {
      Real force[24];
      solid::element_force(s.state, s.work, e, force);
      for (std::size_t a = 0; a < 8; ++a) {
        const std::size_t n = static_cast<std::size_t>(s.work.element_corner[e]) + corner[a];
        const Vec3d one(force[3 * a], force[3 * a + 1], force[3 * a + 2]);
        sum[n] += one;
        ++around[n];
        largest = std::max(largest, one.norm());
      }
    }
    std::size_t inside = 0;
    for (std::size_t n = 0; n < sum.size(); ++n) {
      if (around[n] < 8) continue;
      ++inside;
      REQUIRE(sum[n].norm() < 2e-3 * largest);
    }
    CHECK(inside > 300);
    // The cut cells hold the ball's volume.
    CHECK(s.work.volume == Approx(f.determinant() * 4.0 / 3.0 * 3.14159265358979 * 0.027).epsilon(0.01));
  }
}

TEST_CASE("Forces of one element carry neither momentum nor angular momentum", "[law]") {
  const TestSolid s = deformed_block(material::Law::kCorotational, {1.3, 1.15, 0.9}, 0.1, 8, 15);
  Real force[24];
  solid::element_force(s.state, s.work, middle_element(s), force);
  Vec3d sum = Vec3d::Zero(), moment = Vec3d::Zero();
  for (std::size_t a = 0; a < 8; ++a) {
    const Vec3d f(force[3 * a], force[3 * a + 1], force[3 * a + 2]);
    const Vec3d x = kH * Vec3d(grid::kCorner[a][0], grid::kCorner[a][1], grid::kCorner[a][2]);
    sum += f;
    moment += x.cross(f);
  }
  CHECK(sum.norm() < 1e-5 * s.rest.elastic.mu * kH * kH);
  CHECK(moment.norm() < 1e-5 * s.rest.elastic.mu * kH * kH * kH);
}

TEST_CASE("Collapsed and inverted elements are counted and stay finite") {
  for (const auto law : material::kLaws) {
    TestSolid s = make_block(cube_grid(2, kH), elastic(law));
    set_displacement(s, [](const Vec3d& x) { return Vec3d(2.0 * x[0], 0, 0); });  // du/dx = 2: F^-1 = -1 along x
    compute(s, 8);
    CHECK(s.work.degenerate == 8);
    Real force[24];
    solid::element_force(s.state, s.work, 0, force);
    for (Real f : force) CHECK(std::isfinite(f));
  }
}

TEST_CASE("Material of a solid gives the same bits for 1, 2, 3 and 8 threads", "[determinism]") {
  const auto run = [](int threads) {
    TestSolid s = make_ball(cube_grid(16, kH), elastic(material::Law::kCorotational), Vec3d::Constant(0.4), 0.22);
    set_displacement(s,
                     [](const Vec3d& x) { return Vec3d(0.02 * std::sin(9 * x[1]), 0.01 * x[2], 0.03 * x[0] * x[1]); });
    compute(s, 1, threads);
    return s;
  };
  const TestSolid one = run(1);
  for (int threads : {2, 3, 8}) {
    const TestSolid s = run(threads);
    CHECK(s.work.elastic_energy == one.work.elastic_energy);
    CHECK(s.work.mass == one.work.mass);
    CHECK(s.work.fraction == one.work.fraction);
    bool same = s.work.point.size() == one.work.point.size();
    for (std::size_t p = 0; same && p < s.work.point.size(); ++p)
      for (int c = 0; c < 6; ++c)
        for (std::size_t l = 0; l < solid::kBlock; ++l)
          same = same && s.work.point[p].stress[c][l] == one.work.point[p].stress[c][l];
    CHECK(same);
  }
}
