// Purpose: io.h: OpenVDB output. Smoke as it is, the velocity from the nodes to the cells and into world axes.
#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/guard.hpp"
#include "io/vdb_io.hpp"

using namespace efsi::capi;
using efsi::grid::Grid;
using efsi::io::DenseGrid;

namespace {

constexpr float kNothing = 0.0f;  // every cell of a field that the scene does not have

DenseGrid describe(const char* name, const Grid& grid, const std::vector<float>& field, const char* mask) {
  DenseGrid dense;
  dense.name = name;
  dense.size = grid.cells;
  dense.mask = mask;
  dense.data[0] = &kNothing;
  if (field.empty()) return dense;
  dense.data[0] = field.data();
  dense.stride = {1, static_cast<std::ptrdiff_t>(grid.cell(0, 1, 0)), static_cast<std::ptrdiff_t>(grid.cell(0, 0, 1))};
  return dense;
}

// Mean of the corners' velocities, transformed by `linear`, in the cells whose density is above the threshold; 0
// elsewhere.
std::array<std::vector<float>, 3> cell_velocity(const efsi::sim::Simulation& simulation, const efsi::Mat3d& linear,
                                                double threshold) {
  const Grid& grid = simulation.grid();
  const efsi::fluid::FluidState& fluid = simulation.state().fluid;
  std::array<std::vector<float>, 3> velocity;
  for (auto& component : velocity) component.assign(grid.cell_count(), 0.0f);
  const auto corner = efsi::grid::corner_offsets(grid);
  simulation.parallel().for_each(grid.cells[2], [&](std::int64_t plane) {
    const int k = static_cast<int>(plane);
    for (int j = 0; j < grid.cells[1]; ++j)
      for (int i = 0; i < grid.cells[0]; ++i) {
        const std::size_t c = grid.cell(i, j, k), n = grid.node(i, j, k);
        if (!(std::abs(static_cast<double>(fluid.smoke[c])) > threshold)) continue;
        efsi::Vec3d sum = efsi::Vec3d::Zero();
        for (std::size_t offset : corner) sum += fluid.velocity.at(n + offset).cast<double>();
        const efsi::Vec3d world = linear * sum / 8.0;
        for (std::size_t a = 0; a < 3; ++a) velocity[a][c] = static_cast<float>(world[static_cast<Eigen::Index>(a)]);
      }
  });
  return velocity;
}

// transform * translate(centre of cell (0,0,0)) * scale(h): voxel centres at integer indices.
std::array<double, 16> index_to_world(const Grid& grid, const double (&transform)[16]) {
  Eigen::Matrix4d local = Eigen::Matrix4d::Identity();
  local.topLeftCorner<3, 3>() *= grid.h;
  local.topRightCorner<3, 1>() = grid.cell_center(0, 0, 0);
  const Eigen::Matrix4d world = to_matrix(transform) * local;
  std::array<double, 16> rows;
  for (std::size_t i = 0; i < 16; ++i)
    rows[i] = world(static_cast<Eigen::Index>(i / 4), static_cast<Eigen::Index>(i % 4));
  return rows;
}

}  // namespace

EfsiStatus efsi_vdb_def_init(EfsiVdbDef* def, size_t size) { return initialise(def, size); }

EfsiStatus efsi_vdb_write(EfsiSim* sim, const char* path, const EfsiVdbDef* def, uint64_t* content_hash) {
  return guarded(sim, [&] {
    demand_path(path, "efsi_vdb_write: path");
    const EfsiVdbDef full = receive(def, "efsi_vdb_write: def");
    sim->simulation.prepare();
    const Grid& grid = sim->simulation.grid();
    const efsi::fluid::FluidState& fluid = sim->simulation.state().fluid;
    efsi::io::VdbOptions options;
    options.index_to_world = index_to_world(grid, full.transform);
    options.half_float = full.half_float != 0;
    options.threshold = full.density_threshold;
    options.creator = "eulerfsi " + std::to_string(EFSI_VERSION_MAJOR) + '.' + std::to_string(EFSI_VERSION_MINOR) +
                      '.' + std::to_string(EFSI_VERSION_PATCH);

    std::vector<DenseGrid> grids = {describe("density", grid, fluid.smoke, "")};
    std::array<std::vector<float>, 3> velocity;
    if (full.write_velocity != 0) {
      if (!fluid.smoke.empty()) {
        const efsi::Mat3d linear = to_matrix(full.transform).topLeftCorner<3, 3>();
        velocity = cell_velocity(sim->simulation, linear, full.density_threshold);
      }
      DenseGrid vel = describe("vel", grid, velocity[0], "density");
      vel.components = 3;
      for (std::size_t c = 1; c < 3; ++c) vel.data[c] = velocity[c].empty() ? &kNothing : velocity[c].data();
      grids.push_back(vel);
    }
    // Where smoke is; in a scene without smoke density wherever it is warmer or colder than the surroundings.
    if (!fluid.temperature.empty())
      grids.push_back(describe("temperature", grid, fluid.temperature, fluid.smoke.empty() ? "" : "density"));
    const std::uint64_t hash = efsi::io::write_vdb(path, grids, options);
    if (content_hash) *content_hash = hash;
  });
}
