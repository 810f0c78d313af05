// Purpose: the velocity solve with contact against dense algebra.
#include <catch2/catch.hpp>

#include "reference/dense_contact.hpp"
#include "system/rigid_modes.hpp"
#include "unit/solid/ball.hpp"

using namespace efsi;
using namespace efsi::test;
using reference::dense_contact;
using reference::DenseContact;
using system::ContactRow;
using system::SolidRef;
using system::VelocitySystem;

namespace {

constexpr double kStep = 0.01;

// A ball above another one that is stiffer, three cells apart; both fall towards each other and one of them sideways.
// Four rows between the nodes that face each other, spread over four nodes each.
struct FacingBalls {
  grid::Grid g = cube_grid(16, 0.05);
  TestSolid solids[2];
  VelocitySystem system;
  std::vector<ContactRow> rows;
  std::vector<Real> start, f;

  explicit FacingBalls(double friction, int threads = 1) {
    const auto soft = material::from_youngs_modulus(material::Law::kCorotational, 2e4, 0.3);
    const auto stiff = material::from_youngs_modulus(material::Law::kCorotational, 1e5, 0.4);
    solids[0] = make_ball(g, soft, {0.4, 0.2, 0.4}, 0.13);
    solids[1] = make_ball(g, stiff, {0.4, 0.6, 0.4}, 0.13);
    std::vector<Real> mass(g.node_count(), 0);
    std::vector<SolidRef> refs;
    for (TestSolid& s : solids) {
      compute(s, 1, threads);
      for (std::size_t n = 0; n < mass.size(); ++n) mass[n] += s.work.mass[n];
      refs.push_back({&s.rest, &s.state, &s.work, {}, {}, {}});
    }
    system.assemble(Parallel(threads), g, std::vector<std::uint8_t>(g.node_count(), 0), refs, mass, {}, kStep);
    REQUIRE(system.touching().empty());
    int top = 0, bottom = g.cells[1];
    for (const std::size_t n : system.nodes()) {
      const Vec3i at = g.node_place(n);
      if (at[0] == 8 && at[2] == 8)
        (at[1] < 8 ? top : bottom) = at[1] < 8 ? std::max(top, at[1]) : std::min(bottom, at[1]);
    }
    for (int i = 7; i <= 8; ++i)
      for (int k = 7; k <= 8; ++k) {
        ContactRow row;
        row.normal = Vec3d(0.1 * (i - 7), 1.0, -0.1 * (k - 7)).normalized();
        row.least = -0.05 * (i - 7);
        row.friction = friction;
        for (const auto& [y, sign] : {std::pair{top, -1.0}, std::pair{bottom, 1.0}})
          for (int p = 0; p < 2; ++p)
            row.parts.push_back({system.unknown_of(sign > 0.0 ? 1 : 0, g.node(i - p, y, k)),
                                 static_cast<Real>(sign * (p ? 0.3 : 0.7))});
        rows.push_back(row);
      }
    const auto unknowns = static_cast<std::size_t>(system.unknowns());
    for (std::size_t u = 0; u < unknowns; ++u) {
      const bool upper = g.node_place(system.nodes()[u])[1] >= 8;
      for (const double v : {upper ? 0.4 : 0.0, upper ? -1.0 : 0.5, 0.0}) start.push_back(static_cast<Real>(v));
    }
    system.multiply_mass(Parallel(threads), start, f);
  }
  Eigen::MatrixXd matrix() {
    const std::size_t size = start.size();
    Eigen::MatrixXd m(size, size);
    std::vector<Real> unit(size, 0), column;
    for (std::size_t c = 0; c < size; ++c) {
      unit[c] = 1;
      system.multiply(Parallel(1), unit, column);
      for (std::size_t r = 0; r < size; ++r)
        m(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) = static_cast<double>(column[r]);
      unit[c] = 0;
    }
    return 0.5 * (m + m.transpose());
  }
  std::vector<Real> solve(int threads = 1) {
    std::vector<Real> x = start;
    const auto stats =
        system::solve_contact(Parallel(threads), system::VelocitySolver::kPcg, f, 1e-4, 1e-4, system, rows, x);
    INFO("friction " << rows[0].friction << ", " << stats.iterations << " iterations, residual " << stats.residual);
    CHECK(stats.converged);
    return x;
  }
};

}  // namespace

TEST_CASE("Contact with and without friction is that of the dense Delassus operator") {
  const double friction = GENERATE(0.0, 0.1, 2.0);
  FacingBalls scene(friction);
  Eigen::VectorXd f(static_cast<Eigen::Index>(scene.f.size()));
  for (std::size_t i = 0; i < scene.f.size(); ++i) f[static_cast<Eigen::Index>(i)] = static_cast<double>(scene.f[i]);
  const DenseContact dense = dense_contact(scene.matrix(), f, scene.rows);
  const std::vector<Real> x = scene.solve();
  Vec3d sum = Vec3d::Zero(), dense_sum = Vec3d::Zero();
  for (std::size_t r = 0; r < scene.rows.size(); ++r) {
    const ContactRow& row = scene.rows[r];
    sum += row.impulse();
    dense_sum += dense.impulses[r];
    INFO("row " << r << ": " << row.impulse().transpose() << " for " << dense.impulses[r].transpose());
    CHECK((row.impulse() - dense.impulses[r]).norm() < 0.02 * dense_sum.norm());
    CHECK(row.normal_impulse >= 0.0);
    CHECK(row.friction_impulse.norm() <= friction * row.normal_impulse * (1.0 + 1e-9));
    CHECK(row.normal.dot(system::row_velocity(row, x)) > row.least - 2e-3);
  }
  CHECK((sum - dense_sum).norm() < 0.005 * dense_sum.norm());
  CHECK(dense_sum[1] > 0.0);
  double error = 0.0, change = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double exact = dense.velocity[static_cast<Eigen::Index>(i)];
    error += std::pow(static_cast<double>(x[i]) - exact, 2);
    change += std::pow(static_cast<double>(scene.start[i]) - exact, 2);
  }
  CHECK(std::sqrt(error / change) < 0.02);
  // Steep friction holds all rows, none of which slides; a little one none.
  for (const ContactRow& row : scene.rows)
    if (row.normal_impulse > 0.0) CHECK(row.sticks == (friction > 1.0));
}

TEST_CASE("What the solve leaves is little of what the rows push, however stiff their penalties are") {
  FacingBalls scene(0.3);
  scene.rows.resize(2);  // on one side of the middle: they turn the solids
  const Parallel parallel(1);
  std::vector<Real> x = scene.start, gx;
  const auto stats =
      system::solve_contact(parallel, system::VelocitySolver::kPcg, scene.f, 0.01, 1e-3, scene.system, scene.rows, x);
  CHECK(stats.converged);
  std::vector<Real> left = scene.f;
  system::add_impulses(scene.rows, left);
  scene.system.multiply(parallel, x, gx);
  for (std::size_t i = 0; i < left.size(); ++i) left[i] -= gx[i];
  double push = 0.0;
  for (const ContactRow& row : scene.rows) push += row.normal_impulse;
  REQUIRE(push > 0.0);
  for (const std::size_t solid : {0u, 1u}) {
    Vec3d shifts = Vec3d::Zero(), turns = Vec3d::Zero();
    for (std::size_t u = scene.system.begin_of(solid); u < scene.system.begin_of(solid + 1); ++u) {
      const Vec3d r = Vec3(left[3 * u], left[3 * u + 1], left[3 * u + 2]).cast<double>();
      shifts += r;
      turns += (scene.system.place(u) - Vec3d(0.4, solid ? 0.6 : 0.2, 0.4)).cross(r);
    }
    INFO("solid " << solid << ": " << shifts.norm() / push << ", " << turns.norm() / (0.13 * push));
    CHECK(shifts.norm() < 2e-3 * push);
    CHECK(turns.norm() < 2e-3 * 0.13 * push);
  }
}

TEST_CASE("Surfaces are judged by what their rows push, each pair by itself") {
  ContactRow large, small;
  small.pair = 1;
  system::PairMotion motion;
  CHECK(motion.largest() == 0.0);
  for (int r = 0; r < 1000; ++r) motion.add(large, 1.0, r % 2 ? 3e-3 : 4e-3);
  motion.add(large, 1e-4, 1.0);  // pushes next to nothing
  CHECK(motion.largest() == Approx(std::sqrt(0.5 * (9e-6 + 16e-6) + 1e-7)).epsilon(1e-3));
  motion.add(small, 1e-6, 0.5);  // of a small body beside them
  CHECK(motion.largest() == Approx(0.5));
  motion.add(small, 0.0, 10.0);  // open
  CHECK(motion.largest() == Approx(0.5));
}

TEST_CASE("The preconditioner undoes what penalties do to rigid solids") {
  FacingBalls scene(0.0);
  const Parallel parallel(1);
  std::vector<Real> v;  // two rigid motions
  for (std::size_t u = 0; u < scene.system.nodes().size(); ++u) {
    const Vec3d x = scene.system.place(u) - Vec3d(0.4, 0.4, 0.4);
    const bool upper = u >= scene.system.begin_of(1);
    const Vec3d w = upper ? Vec3d(0.3, -1.0, 0.1) + Vec3d(0.5, 1.0, -2.0).cross(x) : Vec3d(0.0, 0.5, 0.2);
    for (Eigen::Index a = 0; a < 3; ++a) v.push_back(static_cast<Real>(w[a]));
  }
  std::vector<system::Penalty> penalties;
  for (const ContactRow& row : scene.rows) penalties.push_back({row.parts, Real(1e3) * Mat3::Identity()});
  scene.system.set_penalties(parallel, penalties);
  std::vector<Real> r, z(v.size(), 0);
  scene.system.multiply_mass(parallel, v, r);
  scene.system.add_penalty_impulses(1, scene.system.penalty_impulses(v), r);
  system::RigidModes(parallel, scene.system, penalties).add(parallel, scene.system, r, z);
  double off = 0.0;
  for (std::size_t i = 0; i < v.size(); ++i) off = std::max(off, std::abs(static_cast<double>(z[i] - v[i])));
  CHECK(off < 0.01);
  // It is symmetric, as conjugate gradients ask for.
  std::vector<Real> one(v.size()), other(v.size()), z_one, z_other;
  for (std::size_t i = 0; i < v.size(); ++i) {
    one[i] = static_cast<Real>(std::sin(static_cast<double>(i)));
    other[i] = static_cast<Real>(std::cos(3.0 * static_cast<double>(i)));
  }
  scene.system.precondition(parallel, one, z_one);
  scene.system.precondition(parallel, other, z_other);
  double forth = 0.0, back = 0.0;
  for (std::size_t i = 0; i < v.size(); ++i) {
    forth += static_cast<double>(z_one[i] * other[i]);
    back += static_cast<double>(z_other[i] * one[i]);
  }
  CHECK(forth == Approx(back).epsilon(1e-3));
}

TEST_CASE("Rows that part push nothing, and what they start from is forgotten") {
  FacingBalls scene(0.5);
  for (Real& v : scene.start) v = -v;
  for (Real& v : scene.f) v = -v;
  for (ContactRow& row : scene.rows) row.normal_impulse = 0.1;
  scene.solve();
  for (const ContactRow& row : scene.rows) CHECK(row.impulse().norm() == 0.0);
}

TEST_CASE("Contact is the same to the bit with several threads", "[determinism]") {
  FacingBalls one(0.3), many(0.3, 3);
  CHECK(one.solve(1) == many.solve(3));
}

TEST_CASE("Penalties are symmetric, and leave nothing behind when they go") {
  FacingBalls scene(0.0);
  std::vector<Real> before, with, after, before_inverse, with_inverse, after_inverse;
  scene.system.apply(Parallel(1), scene.start, before);
  scene.system.precondition(Parallel(1), before, before_inverse);
  Mat3 stiffness = Mat3::Identity();
  stiffness(0, 1) = stiffness(1, 0) = Real(0.5);
  scene.system.set_penalties(Parallel(1), {{scene.rows[0].parts, stiffness}, {scene.rows[1].parts, stiffness}});
  scene.system.apply(Parallel(1), scene.start, with);
  scene.system.precondition(Parallel(1), before, with_inverse);
  CHECK(with != before);
  CHECK(with_inverse != before_inverse);
  scene.system.set_penalties(Parallel(1), {});
  scene.system.apply(Parallel(1), scene.start, after);
  scene.system.precondition(Parallel(1), before, after_inverse);
  CHECK(after == before);
  CHECK(after_inverse == before_inverse);
  // B^T S B moves nothing that both sides share.
  std::vector<Real> even(scene.start.size(), 1), none(scene.start.size(), 0);
  scene.system.set_penalties(Parallel(1), {{scene.rows[0].parts, stiffness}});
  scene.system.add_penalty_impulses(1, scene.system.penalty_impulses(even), none);
  for (const Real v : none) CHECK(std::abs(static_cast<double>(v)) < 1e-6);
}
