#include "frame/params.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/refuse.hpp"
#include "frame/window.hpp"

namespace efsi::sim {

Numerics numerics_of(Preset preset) {
  Numerics n;  // production
  if (preset == Preset::kFast) {
    n.step_tolerance = std::numeric_limits<double>::infinity();
    n.contact_travel = 0.6;  // of solids less than two cells apart (Sec. 5.2)
  }
  if (preset == Preset::kPaper2016) {
    n.velocity_solver = system::VelocitySolver::kPcr;
    n.pressure_solver = system::PressureSolver::kPcr;
    n.velocity_tolerance = 1e-3;
    n.pressure_tolerance = 0.02;
    n.points_per_element = 8;
    n.solid_advection = solid::AdvectionScheme::kPaper;
    n.corrected_fluid_advection = false;
    n.carries_pressure = false;
    n.stiff_correction = true;
    n.coupling_step = false;
    n.damping_by_pace = false;
    n.stiffness_by_part = false;
    n.resolve_impacts = false;
    n.repair_map = false;
    n.volume_by_pressure = false;
    n.unilateral_walls = false;
    n.volume_source = false;
    n.conserve_momentum = false;
    n.fluid_slips = false;
  }
  return n;
}

namespace {

void demand_positive(const std::string& field, double value) {
  if (!(value > 0.0) || !std::isfinite(value)) refuse(field, value, "a finite number > 0");
}

// A face moves along itself where the fluid sticks to it, and lets fluid through by its velocity across itself, of
// which in a box without an open face as much has to go out as comes in.
void validate_wall_velocities(const Params& p) {
  constexpr const char* axis[3] = {".x", ".y", ".z"};
  const int slab = grid::slab_axis(make_grid(p), p.walls);
  double net = 0.0, gross = 0.0;  // [m^3/s]
  for (int face = 0; face < 6; ++face) {
    const auto f = static_cast<std::size_t>(face);
    const int normal = face / 2;
    const Vec3d& v = p.walls.velocity[f];
    for (int a = 0; a < 3; ++a) {
      const std::string field = "EfsiSimulationDef.wall_velocity[" + std::to_string(face) + "]" + axis[a];
      if (!std::isfinite(v[a])) refuse(field, v[a], "finite");
      if (v[a] == 0.0) continue;
      if (!p.fluid.present) refuse(field, v[a], "0 without ambient fluid, which it moves");
      if (!grid::Walls::blocks(p.walls.face[f])) refuse(field, v[a], "0 on an open or periodic face, which is no wall");
      if (a != normal && p.walls.face[f] == grid::Wall::kSlip)
        refuse(field, v[a], "0 along a slip wall, which drags nothing along");
      if (a == normal && normal == slab) refuse(field, v[a], "0 across a slab");
    }
    const double area = p.domain_size[(normal + 1) % 3] * p.domain_size[(normal + 2) % 3];
    const double flux = (face % 2 ? -1.0 : 1.0) * v[normal] * area;
    net += flux;
    gross += std::abs(flux);
  }
  if (std::abs(net) > 1e-6 * gross && !p.walls.any_open())
    refuse("EfsiSimulationDef.wall_velocity: net inflow [m^3/s]", net,
           "0 in a box without an open face: open one, or let as much out");
}

}  // namespace

void validate(const Params& p) {
  constexpr const char* axis[3] = {".x", ".y", ".z"};
  demand_positive("EfsiSimulationDef.voxel_size", p.voxel_size);
  for (int a = 0; a < 3; ++a) {
    demand_positive(std::string("EfsiSimulationDef.domain_size") + axis[a], p.domain_size[a]);
    if (!std::isfinite(p.domain_min[a]))
      refuse(std::string("EfsiSimulationDef.domain_min") + axis[a], p.domain_min[a], "finite");
    if (!std::isfinite(p.gravity[a]))
      refuse(std::string("EfsiSimulationDef.gravity") + axis[a], p.gravity[a], "finite");
    const bool lower = p.walls.lower(a) == grid::Wall::kPeriodic, upper = p.walls.upper(a) == grid::Wall::kPeriodic;
    if (lower != upper)
      refuse(std::string("EfsiSimulationDef.wall") + axis[a], static_cast<double>(p.walls.lower(a)),
             "periodic on both faces of an axis or on none");
    const double cells = p.domain_size[a] / p.voxel_size;
    if (cells > 4096.0)
      refuse(std::string("EfsiSimulationDef.domain_size") + axis[a] + " / voxel_size", cells, "at most 4096 cells");
  }
  demand_positive("EfsiSimulationDef.fluid_density", p.fluid.density);
  if (!(p.fluid.viscosity >= 0.0) || !std::isfinite(p.fluid.viscosity))
    refuse("EfsiSimulationDef.fluid_viscosity", p.fluid.viscosity, "a finite number >= 0");
  validate_wall_velocities(p);
  demand_positive("EfsiSimulationDef.cfl_solid", p.cfl_solid);
  demand_positive("EfsiSimulationDef.cfl_fluid", p.cfl_fluid);
  if (p.cfl_solid > 1000.0) refuse("EfsiSimulationDef.cfl_solid", p.cfl_solid, "at most 1000");
  if (p.cfl_fluid > 8.0) refuse("EfsiSimulationDef.cfl_fluid", p.cfl_fluid, "at most 8");
  if (p.fluid.vorticity_confinement > 0.0 && grid::slab_axis(make_grid(p), p.walls) == 0)
    refuse("EfsiSimulationDef.vorticity_confinement", p.fluid.vorticity_confinement,
           "0 in a slab along x; along y or z a slab can have it");
  if (!(p.max_time_step >= 0.0)) refuse("EfsiSimulationDef.max_time_step", p.max_time_step, ">= 0");
  if (!(p.fluid.vorticity_confinement >= 0.0))
    refuse("EfsiSimulationDef.vorticity_confinement", p.fluid.vorticity_confinement, ">= 0");
  if (!(p.numerics.velocity_tolerance > 0.0 && p.numerics.velocity_tolerance <= 0.5))
    refuse("EfsiSimulationDef.velocity_tolerance", p.numerics.velocity_tolerance, "between 0 and 0.5");
  if (!(p.numerics.pressure_tolerance > 0.0 && p.numerics.pressure_tolerance <= 0.5))
    refuse("EfsiSimulationDef.pressure_tolerance", p.numerics.pressure_tolerance, "between 0 and 0.5");
  if (p.threads < 0) refuse("EfsiSimulationDef.threads", p.threads, ">= 0");
}

grid::Grid make_grid(const Params& p) {
  grid::Grid g;
  g.h = p.voxel_size;
  g.origin = p.domain_min;
  for (int a = 0; a < 3; ++a) {
    const auto s = static_cast<std::size_t>(a);
    g.cells[s] = std::max(1, static_cast<int>(std::ceil(p.domain_size[a] / p.voxel_size - 1e-6)));
    g.periodic[s] = p.walls.lower(a) == grid::Wall::kPeriodic;
  }
  return g;
}

double estimate_memory(const Params& p, double solid_volume) {
  // Bytes per cell of the global grid and of the solids' bands, measured by bench speed.
  constexpr double kBytesPerCell = 150.0, kBytesPerBandCell = 520.0;
  double cells = 1.0;
  for (int a = 0; a < 3; ++a) cells *= std::ceil(p.domain_size[a] / p.voxel_size) + 1.0;
  const bool flat = grid::slab_axis(make_grid(p), p.walls) >= 0;
  const auto around_solids = [&](double margin) {  // cells of a box with that many more on each side
    if (flat && solid_volume > 0.0)
      return 2.0 * std::pow(std::sqrt(solid_volume / p.voxel_size) / p.voxel_size + 2.0 * margin, 2);
    return solid_volume > 0.0 ? std::pow(std::cbrt(solid_volume) / p.voxel_size + 2.0 * margin, 3) : 0.0;
  };
  if (!p.fluid.present) cells = std::min(cells, around_solids(kWindowMargin + 0.25 * kWindowStep));
  return kBytesPerCell * cells + kBytesPerBandCell * around_solids(solid::kBandMargin);
}

}  // namespace efsi::sim
