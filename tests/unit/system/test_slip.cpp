// Purpose: two velocities at the nodes of a surface: the pressure operator against assembled matrices, and its laws.
#include <Eigen/Eigenvalues>
#include <bit>
#include <catch2/catch.hpp>

#include "reference/assembled_slip.hpp"
#include "unit/system/pressure_case.hpp"

using namespace efsi;
using namespace efsi::test;

namespace {

constexpr double kSlipTolerance = sizeof(Real) == 8 ? 1e-12 : 5e-6;

// A ball of `density` times the fluid's in a box, its surface along the faces of cells.
struct SlipCase : PressureCase {
  system::SlipNodes slip;
  std::vector<std::uint8_t> owned;  // padded cells

  SlipCase(Vec3i cells, double density)
      : PressureCase("slip", cells, std::array<grid::Wall, 6>{}, density), owned(g.padded_count(), 0) {
    const Vec3d center = g.h * Vec3d(0.5 * cells[0] + 0.3, 0.5 * cells[1] - 0.2, 0.5 * cells[2] + 0.1);
    for (int k = 0; k < cells[2]; ++k)
      for (int j = 0; j < cells[1]; ++j)
        for (int i = 0; i < cells[0]; ++i)
          owned[g.padded(i, j, k)] = (g.cell_center(i, j, k) - center).norm() < 0.3 * g.h * cells[0];
    std::vector<system::SlipNode> nodes;
    const double eighth = g.h * g.h * g.h / 8.0;
    for (int k = 1; k < cells[2]; ++k)
      for (int j = 1; j < cells[1]; ++j)
        for (int i = 1; i < cells[0]; ++i) {
          system::SlipNode n{g.node(i, j, k), i, j, k, 0, 0, Vec3::Zero(), 0, 0};
          int inside = 0;
          for (std::size_t a = 0; a < 8; ++a) {
            const auto& c = grid::kCorner[a];
            if (!owned[g.padded(i - c[0], j - c[1], k - c[2])]) continue;
            ++inside;
            n.solid_cells = static_cast<std::uint8_t>(n.solid_cells | (1u << a));
          }
          specific_volume[n.node] = static_cast<Real>(8.0 / (inside * density + 8 - inside));
          n.normal = system::stair_normal(n.solid_cells);
          if (inside == 0 || inside == 8 || n.normal.isZero()) continue;
          n.solid_mass = static_cast<Real>(density * eighth * inside);
          n.fluid_mass = static_cast<Real>(eighth * (8 - inside));
          nodes.push_back(n);
        }
    slip = system::SlipNodes(Parallel(), g, std::move(nodes));
  }

  system::PressureSystem system(int threads = 1) {
    system::PressureSystem out;
    out.assemble(Parallel(threads), g, walls, fixed, specific_volume, {}, owned, &slip);
    return out;
  }

  // Random velocities, the same along the normals.
  grid::VectorField random_velocities(unsigned seed) {
    grid::VectorField v = random_velocity(seed);
    const grid::VectorField other = random_velocity(seed + 7);
    for (std::size_t t = 0; t < slip.nodes().size(); ++t) slip.solid_velocity()[t] = other.at(slip.nodes()[t].node);
    slip.share_normal(Parallel(1), v);
    return v;
  }

  double kinetic_energy(const grid::VectorField& v) {
    double sum = 0.0;
    std::vector<std::uint8_t> two(g.node_count(), 0);
    for (std::size_t t = 0; t < slip.nodes().size(); ++t) {
      const system::SlipNode& n = slip.nodes()[t];
      two[n.node] = 1;
      sum += static_cast<double>(n.solid_mass) * slip.solid_velocity()[t].cast<double>().squaredNorm() +
             static_cast<double>(n.fluid_mass) * v.at(n.node).cast<double>().squaredNorm();
    }
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) {
          const std::size_t n = g.node(i, j, k);
          double volume = g.h * g.h * g.h;
          const int at[3] = {i, j, k};
          for (std::size_t a = 0; a < 3; ++a) volume *= at[a] == 0 || at[a] == g.cells[a] ? 0.5 : 1.0;
          if (!two[n]) sum += volume / static_cast<double>(specific_volume[n]) * v.at(n).cast<double>().squaredNorm();
        }
    return 0.5 * sum;
  }
};

// Solids whose cells an owner tells, 0 the fluid, each with its density over the fluid's. Nodes that several carry have
// a velocity of each; where it slips, those between one and the fluid have two.
struct OwnedCase : PressureCase {
  system::SlipNodes slip;
  std::vector<std::uint8_t> owned;  // padded cells: 1 + the solid

  template <class Owner>
  OwnedCase(Vec3i cells_of_box, const std::vector<double>& density, bool slips, const Owner& owner)
      : PressureCase("owned", cells_of_box, std::array<grid::Wall, 6>{}, 1.0) {
    owned.assign(g.padded_count(), 0);
    for (int k = 0; k < g.cells[2]; ++k)
      for (int j = 0; j < g.cells[1]; ++j)
        for (int i = 0; i < g.cells[0]; ++i) owned[g.padded(i, j, k)] = owner(i, j, k);
    std::vector<system::SlipNode> nodes;
    const double eighth = g.h * g.h * g.h / 8.0;
    for (int k = 0; k <= g.cells[2]; ++k)
      for (int j = 0; j <= g.cells[1]; ++j)
        for (int i = 0; i <= g.cells[0]; ++i) {
          std::vector<std::uint8_t> cells(density.size() + 1, 0);  // bits, of the fluid and of each solid
          for (std::size_t a = 0; a < 8; ++a) {
            const auto& c = grid::kCorner[a];
            const Vec3i q{i - c[0], j - c[1], k - c[2]};
            bool inside = true;
            for (std::size_t x = 0; x < 3; ++x) inside = inside && q[x] >= 0 && q[x] < g.cells[x];
            if (inside) cells[owned[g.padded(q[0], q[1], q[2])]] |= static_cast<std::uint8_t>(1u << a);
          }
          const auto count = [&](std::size_t m) { return std::popcount(static_cast<unsigned>(cells[m])); };
          int solids = 0, all = count(0);
          double mass = eighth * count(0);
          for (std::size_t m = 1; m < cells.size(); ++m) {
            solids += count(m) > 0;
            all += count(m);
            mass += eighth * density[m - 1] * count(m);
          }
          specific_volume[g.node(i, j, k)] = static_cast<Real>(eighth * all / mass);
          const bool inner = i > 0 && j > 0 && k > 0 && i < g.cells[0] && j < g.cells[1] && k < g.cells[2];
          if (solids == 0 || (solids == 1 && !(slips && inner && cells[0]))) continue;
          for (std::size_t m = 1; m < cells.size(); ++m) {
            if (!cells[m]) continue;
            system::SlipNode n{};
            n.node = g.node(i, j, k);
            n.i = i;
            n.j = j;
            n.k = k;
            n.solid = m - 1;
            n.solid_cells = cells[m];
            n.solid_mass = static_cast<Real>(eighth * density[m - 1] * count(m));
            n.fluid_mass = static_cast<Real>(eighth * count(0));
            n.solids = static_cast<std::uint8_t>(solids);
            if (solids == 1) {
              n.normal = system::stair_normal(n.solid_cells);
              if (!n.normal.isZero()) nodes.push_back(n);
              continue;
            }
            n.fluid_cells = cells[0];
            n.in_fluid = true;
            n.fixed = n.held = n.fluid_fixed = n.base_fixed = fixed[n.node];
            n.mass = static_cast<Real>(mass);
            nodes.push_back(n);
          }
        }
    slip = system::SlipNodes(Parallel(), g, std::move(nodes));
  }
};

// Two blocks and a third one on them, on the floor of a box, without room between them: nodes that two and three solids
// carry, on the floor too, with and without fluid beside.
struct SharedCase : OwnedCase {
  explicit SharedCase(double density)
      : OwnedCase({11, 9, 8}, {density, 0.5 * density, 2.0 * density}, false, [](int i, int j, int k) -> std::uint8_t {
          const auto in = [&](Vec3i low, Vec3i high) {
            return i >= low[0] && j >= low[1] && k >= low[2] && i < high[0] && j < high[1] && k < high[2];
          };
          return in({2, 0, 2}, {5, 4, 6}) ? 1 : in({5, 0, 3}, {9, 4, 7}) ? 2 : in({3, 4, 2}, {7, 7, 5}) ? 3 : 0;
        }) {}
};

// Two solids with a film of fluid between them that is a cell thick and climbs by stairs; at one side they touch.
struct FilmCase : OwnedCase {
  explicit FilmCase(double density)
      : OwnedCase({24, 24, 20}, {density, density}, true, [](int i, int j, int k) -> std::uint8_t {
          if (i < 4 || i >= 20 || k < 4 || k >= 16 || j < 3 || j >= 21) return 0;
          const int film = 8 + i / 4 + k / 7;
          return j < film ? 1 : j > film || k == 4 ? 2 : 0;
        }) {}
};

}  // namespace

TEST_CASE("Where solids share nodes operator and projection are the assembled ones, and pressure as such moves nothing",
          "[nightly]") {
  for (const double density : {0.1, 3.0, 1000.0}) {
    INFO("density ratio " << density);
    SharedCase c(density);
    std::size_t three = 0, wall = 0, dry = 0;
    for (const system::SlipNode& n : c.slip.nodes()) {
      three += n.solids == 3;
      wall += n.j == 0;
      dry += n.fluid_cells == 0;
    }
    REQUIRE(three > 0);
    REQUIRE(wall > 4);
    REQUIRE(dry > 4);
    const Parallel parallel(2);
    // What sticks to the floor.
    const std::size_t stuck = c.slip.find(1, c.g.node(5, 0, 4));
    REQUIRE(stuck != system::SlipNodes::kNone);
    c.slip.prescribe(stuck, 7, 7);
    const reference::AssembledSlip twin(c.g, c.walls, c.specific_volume, c.slip);
    const Eigen::MatrixXd a = twin.j * twin.w * twin.j.transpose();
    system::PressureSystem system;
    system.assemble(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, c.owned, &c.slip);
    system::PressureMultigrid multigrid;
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, &c.slip);
    std::vector<Real> p = c.random_cells(31), y(p.size(), 0);
    multigrid.apply(parallel, p, y);
    const Eigen::VectorXd q = to_vector(c, p), expected = a * q;
    CHECK((to_vector(c, y) - expected).norm() < kSlipTolerance * expected.norm());
    const Eigen::VectorXd root = to_vector(c, multigrid.finest().inverse_diagonal).cwiseSqrt();
    const Eigen::MatrixXd scaled = root.asDiagonal() * a * root.asDiagonal();
    CHECK(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff() <
          8.0 / 3.0 * (1 + 10 * kSlipTolerance));

    grid::VectorField v = c.random_velocity(5);
    const grid::VectorField other = c.random_velocity(6);
    for (std::size_t t = 0; t < c.slip.nodes().size(); ++t)
      c.slip.solid_velocity()[t] = static_cast<Real>(c.slip.nodes()[t].solid + 1) * other.at(c.slip.nodes()[t].node);
    const Eigen::VectorXd before = twin.unknowns(v, c.slip);
    const double norm = (twin.j * before).norm() / (c.g.h * c.g.h * c.g.h);
    CHECK(system.norms(parallel, v, {}).all == Approx(norm).epsilon(10 * kSlipTolerance));
    system.project(parallel, p, v);
    const Eigen::VectorXd after = before - twin.w * twin.j.transpose() * q;
    CHECK((twin.unknowns(v, c.slip) - after).norm() < kSlipTolerance * after.norm());

    std::vector<Real> one(c.g.padded_count(), 1);
    system.project(parallel, one, v);
    CHECK((twin.unknowns(v, c.slip) - after).norm() < 10 * kSlipTolerance * after.norm());
  }
}

TEST_CASE("At shared nodes the fluid fills what solids leave, and both keep their momentum where they meet it",
          "[law]") {
  SharedCase c(2.0);
  const Parallel parallel(1);
  grid::VectorField v = c.random_velocity(5);
  const grid::VectorField other = c.random_velocity(6);
  for (std::size_t t = 0; t < c.slip.nodes().size(); ++t)
    c.slip.solid_velocity()[t] = static_cast<Real>(c.slip.nodes()[t].solid + 1) * other.at(c.slip.nodes()[t].node);
  const auto made = [&](const system::SlipNode& n) {  // volume by a node, times 4 / h^2
    Real sum = 0;
    for (std::size_t t = 0; t < c.slip.nodes().size(); ++t) {
      const system::SlipNode& s = c.slip.nodes()[t];
      if (s.node != n.node) continue;
      for (std::size_t a = 0; a < 8; ++a)
        if (s.solid_cells >> a & 1u) sum += system::side_of(a).dot(c.slip.solid_velocity()[t]);
    }
    for (std::size_t a = 0; a < 8; ++a)
      if (n.fluid_cells >> a & 1u) sum += system::side_of(a).dot(v.at(n.node));
    return std::abs(sum);
  };
  grid::VectorField flow = v;
  c.slip.follow_solid(parallel, v);
  double opening = 0.0, inner = 0.0;
  for (const system::SlipNode& n : c.slip.nodes()) {
    Vec3 side = Vec3::Zero();
    for (std::size_t a = 0; a < 8; ++a)
      if (n.fluid_cells >> a & 1u) side += system::side_of(a);
    if (n.j > 0) (side.isZero() ? opening : inner) = std::max(side.isZero() ? opening : inner, double(made(n)));
  }
  CHECK(inner < 1e-4);
  CHECK(opening > 0.1);
  CHECK(std::abs(c.slip.opening(v)) > 0.0);

  std::swap(v, flow);
  const auto momentum = [&](std::size_t t) {  // of a node, t: its first entry
    const system::SlipNode& n = c.slip.nodes()[t];
    Vec3 sum = n.fluid_mass * v.at(n.node);
    for (std::size_t s = t; s < t + n.solids; ++s) sum += c.slip.nodes()[s].solid_mass * c.slip.solid_velocity()[s];
    return sum;
  };
  std::vector<Vec3> before;
  for (std::size_t t = 0; t < c.slip.nodes().size(); t += c.slip.nodes()[t].solids) before.push_back(momentum(t));
  c.slip.share_normal(parallel, v);
  std::size_t node = 0;
  for (std::size_t t = 0; t < c.slip.nodes().size(); t += c.slip.nodes()[t].solids, ++node) {
    const system::SlipNode& n = c.slip.nodes()[t];
    if (n.j > 0) CHECK((momentum(t) - before[node]).norm() < 1e-5 * double(n.mass) * 3.0);
  }
}

TEST_CASE("With two velocities at surface nodes divergence, operator and projection are the assembled ones") {
  for (const double density : {0.1, 1.0, 1000.0}) {
    INFO("density ratio " << density);
    SlipCase c({7, 6, 8}, density);
    REQUIRE(c.slip.nodes().size() > 40);
    const reference::AssembledSlip twin(c.g, c.walls, c.specific_volume, c.slip);
    const Eigen::MatrixXd a = twin.j * twin.w * twin.j.transpose();
    system::PressureMultigrid multigrid;
    const Parallel parallel(2);
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, &c.slip);
    std::vector<Real> p = c.random_cells(31), y(p.size(), 0);
    multigrid.apply(parallel, p, y);
    const Eigen::VectorXd expected = a * to_vector(c, p);
    CHECK((to_vector(c, y) - expected).norm() < kSlipTolerance * expected.norm());
    const Eigen::VectorXd inverse = to_vector(c, multigrid.finest().inverse_diagonal);
    for (Eigen::Index i = 0; i < inverse.size(); ++i) {
      CHECK(inverse[i] * a(i, i) < 1.0 + 10 * kSlipTolerance);
      CHECK(inverse[i] * a(i, i) > 1.0 / 1.5 - 10 * kSlipTolerance);
    }
    const Eigen::VectorXd root = inverse.cwiseSqrt();
    const Eigen::MatrixXd scaled = root.asDiagonal() * a * root.asDiagonal();
    CHECK(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scaled, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff() <
          8.0 / 3.0 * (1 + 10 * kSlipTolerance));

    system::PressureSystem system = c.system();
    grid::VectorField v = c.random_velocities(5);
    const Eigen::VectorXd before = twin.unknowns(v, c.slip), q = to_vector(c, p);
    const double norm = (twin.j * before).norm() / (c.g.h * c.g.h * c.g.h);
    CHECK(system.norms(parallel, v, {}).all == Approx(norm).epsilon(10 * kSlipTolerance));
    system.project(parallel, p, v);
    const Eigen::VectorXd after = before - twin.w * twin.j.transpose() * q;
    CHECK((twin.unknowns(v, c.slip) - after).norm() < kSlipTolerance * after.norm());
  }
}

TEST_CASE("What the pressure gives a surface node is shared between the solid and the fluid that slips") {
  SlipCase c({12, 11, 13}, 3.0);
  const Parallel parallel(1);
  system::PressureSystem system = c.system();
  std::vector<Real> q = c.random_cells(17);
  grid::VectorField v;
  v.assign(c.g.node_count());
  for (Vec3& solid : c.slip.solid_velocity()) solid.setZero();
  system.project(parallel, q, v);  // from rest: -W J^T q
  const std::vector<Vec3> slides = c.slip.sliding_impulse(parallel, q);
  for (std::size_t t = 0; t < c.slip.nodes().size(); ++t) {
    const system::SlipNode& n = c.slip.nodes()[t];
    const Vec3 solid = c.slip.solid_velocity()[t], fluid = v.at(n.node), &normal = n.normal;
    const Vec3 slip = fluid - normal.dot(fluid) * normal;
    const Vec3 all = system::pressure_impulse(c.g, q, n.i, n.j, n.k);
    const double scale = static_cast<double>(all.norm() + slides[t].norm());
    CHECK(static_cast<double>((n.fluid_mass * slip + slides[t]).norm()) < 10 * kSlipTolerance * scale);
    CHECK(static_cast<double>(
              (n.solid_mass * solid + n.fluid_mass * normal.dot(solid) * normal + all - slides[t]).norm()) <
          10 * kSlipTolerance * scale);
  }
}

TEST_CASE("The preconditioner is symmetric and positive definite where the fluid slips") {
  for (const double density : {0.01, 1000.0}) {
    SlipCase c({16, 14, 13}, density);
    system::PressureMultigrid multigrid;
    const Parallel parallel(1);
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, &c.slip);
    check_symmetric_definite(c, multigrid, 2 * kSlipTolerance);
  }
}

TEST_CASE("In films between solids no correction of the V-cycle overshoots", "[law]") {
  for (const double density : {10.0, 1000.0, 1e5}) {
    INFO("density ratio " << density);
    FilmCase c(density);
    const Parallel parallel(1);
    system::PressureMultigrid multigrid;
    multigrid.build(parallel, c.g, c.walls, c.fixed, c.specific_volume, {}, &c.slip);
    // Power iterations: the Rayleigh quotients of V A x in the energy of x grow to the largest eigenvalue.
    std::vector<Real> x = c.random_cells(17), ax(x.size(), 0), z(x.size(), 0);
    double largest = 0.0;
    for (int it = 0; it < 60; ++it) {
      multigrid.apply(parallel, x, ax);
      multigrid.precondition(parallel, ax, z);
      largest = c.dot(ax, z) / c.dot(ax, x);
      const Real scale = static_cast<Real>(1.0 / std::sqrt(c.dot(z, z)));
      for (std::size_t n = 0; n < x.size(); ++n) x[n] = scale * z[n];
    }
    CHECK(largest < 1.1);
  }
}

TEST_CASE("The projection of solid and fluid takes energy, keeps what slips and is idempotent", "[law]") {
  for (const double density : {0.1, 10.0, 1000.0}) {
    INFO("density ratio " << density);
    SlipCase c({16, 14, 15}, density);
    const Parallel parallel(1);
    system::PressureSystem system = c.system();
    grid::VectorField v = c.random_velocities(11);
    const double start = c.kinetic_energy(v), before = system.norms(parallel, v, {}).all;
    std::vector<Real> q(c.g.padded_count(), 0);
    const auto stats =
        system.solve(parallel, system::PressureSolver::kMultigridPcg, 1e-3, system.set_right_side(parallel, v, {}), q);
    CHECK(stats.converged);
    CHECK(stats.iterations < 30);
    system.project(parallel, q, v);
    CHECK(system.norms(parallel, v, {}).all < 2e-3 * before);
    const double once = c.kinetic_energy(v);
    CHECK(once < start);
    double slip = 0.0, tied = 0.0;
    for (std::size_t t = 0; t < c.slip.nodes().size(); ++t) {
      const Vec3 jump = c.slip.solid_velocity()[t] - v.at(c.slip.nodes()[t].node);
      tied = std::max(tied, static_cast<double>(std::abs(jump.dot(c.slip.nodes()[t].normal))));
      slip = std::max(slip, static_cast<double>(jump.norm()));
    }
    CHECK(tied < 1e-5);
    CHECK(slip > 0.5);
    std::vector<Real> again(c.g.padded_count(), 0);
    system.solve(parallel, system::PressureSolver::kMultigridPcg, 1e-3, system.set_right_side(parallel, v, {}), again);
    system.project(parallel, again, v);
    CHECK(c.kinetic_energy(v) == Approx(once).epsilon(1e-4));
  }
}

TEST_CASE("A constant pressure moves nothing, and inner pressures keep the momentum of solid and fluid", "[law]") {
  SlipCase c({14, 12, 13}, 20.0);
  const Parallel parallel(1);
  system::PressureSystem system = c.system();
  grid::VectorField v = c.random_velocities(3);
  const grid::VectorField start = v;
  const std::vector<Vec3> solids = c.slip.solid_velocity();
  std::vector<Real> one(c.g.padded_count(), 1);
  system.project(parallel, one, v);
  for (std::size_t t = 0; t < solids.size(); ++t) {
    CHECK((c.slip.solid_velocity()[t] - solids[t]).norm() < 1e-5);
    const std::size_t n = c.slip.nodes()[t].node;
    CHECK((v.at(n) - start.at(n)).norm() < 1e-5);
  }

  const auto momentum = [&] {
    Vec3d sum = Vec3d::Zero();
    const double full = c.g.h * c.g.h * c.g.h;
    for (int k = 1; k < c.g.cells[2]; ++k)
      for (int j = 1; j < c.g.cells[1]; ++j)
        for (int i = 1; i < c.g.cells[0]; ++i) {
          const std::size_t n = c.g.node(i, j, k);
          sum += full / static_cast<double>(c.specific_volume[n]) * v.at(n).cast<double>();
        }
    return Vec3d(sum + c.slip.relative_momentum(v));
  };
  std::vector<Real> inner = c.random_cells(9);
  for (int k = 0; k < c.g.cells[2]; ++k)
    for (int j = 0; j < c.g.cells[1]; ++j)
      for (int i = 0; i < c.g.cells[0]; ++i)
        if (i == 0 || j == 0 || k == 0 || i == c.g.cells[0] - 1 || j == c.g.cells[1] - 1 || k == c.g.cells[2] - 1)
          inner[c.g.padded(i, j, k)] = 0;
  const Vec3d before = momentum();
  system.project(parallel, inner, v);
  CHECK((momentum() - before).norm() < 1e-5 * c.g.h * c.g.h * static_cast<double>(c.g.cell_count()));
}
