// Purpose: the error of the paper's split of a step, in a slab, against velocity and pressure solved as one system.
#include <Eigen/Dense>
#include <iostream>
#include <sstream>

#include "contact/wall_contact.hpp"
#include "nodes/masses.hpp"
#include "nodes/node_velocity.hpp"
#include "reference/direct_step.hpp"
#include "solid/element/material_force.hpp"
#include "solve/pressure.hpp"
#include "solve/velocity_solve.hpp"
#include "sources/external_forces.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
using reference::DirectStep;

namespace {

constexpr double kH = 0.02, kStep = 0.01;
constexpr int kCells = 24;

enum class Split { kPaper, kProjection, kCoupled };  // Eq. 13, its projection by M, that after a coupling step

// A disc of R = 4.8 cells that is squashed by 15 % and thrown down through fluid that swirls. pace: cells that
// compression waves pass in the step.
SimulationPtr impact(double ratio, double pace, Split split) {
  const double edge = kCells * kH;
  sim::Params p = box_params({edge, edge, kH}, kH);
  p.numerics = sim::numerics_of(sim::Preset::kPaper2016);
  p.numerics.stiff_correction = split == Split::kPaper;
  p.numerics.coupling_step = split == Split::kCoupled;
  p.numerics.velocity_tolerance = 1e-6;
  p.numerics.pressure_tolerance = 1e-5;
  sim::SolidDesc disc = ball_desc(Vec3d::Zero());
  disc.surface = cylinder_mesh(2, {0.52 * edge, 0.47 * edge, 0.5 * kH}, 0.2 * edge, 2 * kH);
  p.fluid.density = disc.density / ratio;
  const double wave = pace * kH / kStep;  // sqrt((lambda + 2 mu) / rho), of the authors' ball 5 m/s
  disc.youngs_modulus *= wave * wave / 25.0;
  disc.stretch = {1.0 / 0.85, 0.85, 1.0};
  disc.velocity = {0.0, -2.0, 0.0};
  auto s = make_simulation(p, {disc});
  const grid::Grid& g = s->grid();
  std::vector<float> swirl(3 * g.node_count(), 0.0f);
  for (std::size_t n = 0; n < g.node_count(); ++n) {
    const Vec3i at = g.node_place(n);
    const double x = M_PI * at[0] / kCells, y = M_PI * at[1] / kCells;
    swirl[n] = static_cast<float>(std::sin(x) * std::sin(x) * std::sin(2 * y));
    swirl[g.node_count() + n] = static_cast<float>(-std::sin(y) * std::sin(y) * std::sin(2 * x));
  }
  s->set_velocity(swirl.data());
  return s;
}

struct Measured {
  double error;   // of the split: kinetic-energy norm over that of what the step changes
  double inside;  // divergence in the solid after over before
  double flux, residual;
};

// Lines 3 to 11 of one step, and the same of the direct solve.
Measured measure(double ratio, double pace, Split split) {
  const auto s = impact(ratio, pace, split);
  const Parallel parallel(1);
  const std::vector<solid::SolidRest>& rest = s->solids();
  const std::vector<sim::ForceField> forces;
  const sim::Scene scene{s->params(), s->grid(), rest, s->emitters(), forces, s->pins()};
  sim::State state = s->state();
  sim::Workspace work;
  work.solids.resize(1);
  sim::Profile profile;
  sim::StepInfo info;
  const sim::StepContext step{parallel, scene, 0.0, kStep, kStep, profile, info};
  sim::SolidWorks& solids = work.solids;
  sim::Matter& matter = work.matter;
  sim::NodeVelocity& velocity = work.velocity;
  sim::VelocityEquation& elasticity = work.elasticity;
  sim::PressureEquation& pressure = work.pressure;
  sim::compute_masses(step, state.solids, solids);
  sim::combine_masses(step, state.solids, solids, state.window, state.fluid.pressure, matter, velocity.slip);
  solid::compute_material(parallel, rest[0], state.solids[0], scene.params.numerics.points_per_element, solids[0]);
  sim::combine_velocities(step, state.solids, solids, matter, state.fluid.velocity, velocity);
  const Eigen::VectorXd before = DirectStep::of_field(velocity.field);
  sim::add_external_forces(step, matter, state.fluid, velocity);
  sim::meet_walls(step, state.solids, solids, matter, velocity, elasticity.walls);
  sim::assemble_velocity_system(step, state.solids, solids, matter, velocity, elasticity);
  sim::set_right_side(step, state.solids, solids, matter.common.grid, velocity, elasticity);
  sim::prepare_pressure(step, state.solids, solids, matter, state.fluid.pressure, elasticity, velocity, pressure);
  REQUIRE(velocity.slip.nodes().empty());
  const DirectStep direct(parallel, matter, velocity.field, elasticity);
  sim::solve_velocity(step, elasticity, velocity);
  sim::solve_pressure(step, state.solids, solids, matter, state.fluid, elasticity, velocity, pressure);
  sim::project_velocity(step, matter.common.grid, elasticity, pressure, velocity, state.fluid.pressure);
  REQUIRE(info.unconverged == 0);
  const Eigen::VectorXd after = DirectStep::of_field(velocity.field);
  return {direct.length(after - direct.v) / direct.length(direct.v - before),
          info.divergence_after_solid / info.divergence_before_solid, direct.flux, direct.residual};
}

}  // namespace

// What bounds it: at 64 cells a side (disc of 12.8 cells, another swirl) the same experiment gave 0.05 at 1000:1 and 5
// cells a step, 0.28 at 1.3:1 and 25, and 0.38 for the projection there. Here it is 0.057, 0.284 and 0.380. The bars
// leave a factor of 1.5 or so for what the grid makes of the disc.
TEST_CASE("The paper's split of a step is off by what a direct solve of velocity and pressure tells", "[law]") {
  for (const double pace : {5.0, 25.0}) {
    double last = 0.0;
    for (const double ratio : {1000.0, 1.3}) {
      const Measured paper = measure(ratio, pace, Split::kPaper), plain = measure(ratio, pace, Split::kProjection),
                     coupled = measure(ratio, pace, Split::kCoupled);
      std::ostringstream text;
      text << ratio << ":1, " << pace << " cells a step: paper " << paper.error
           << " (divergence inside: " << paper.inside << " of it left), projection " << plain.error << ", coupled "
           << coupled.error;
      std::cout << text.str() << '\n';
      INFO(text.str());
      CHECK(paper.flux < 1e-9);  // both equations hold in the direct solve
      CHECK(paper.residual < 1e-9);
      CHECK(paper.inside > 0.5);  // Eq. 13 leaves it to the next steps
      CHECK(plain.inside < 0.01);
      if (ratio == 1000.0) {
        CHECK(paper.error == Approx(0.07).margin(0.035));
        CHECK(plain.error < 0.5 * paper.error);
        CHECK(coupled.error < 0.5 * plain.error);
      } else {
        CHECK(paper.error == Approx(0.23).margin(0.12));
        CHECK(plain.error > paper.error);
        CHECK(plain.error < 0.57);
        CHECK(paper.error > 2.0 * last);
      }
      last = paper.error;
    }
  }
}
