// Purpose: io.h: OpenVDB files. Smoke as it is, the velocity from the nodes to the cells and into world axes.
#include <algorithm>
#include <cmath>
#include <limits>

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
std::array<std::vector<float>, 3> cell_velocity(efsi::sim::Simulation& simulation, const efsi::Mat3d& linear,
                                                double threshold) {
  const Grid& grid = simulation.grid();
  const std::vector<efsi::Real>& smoke = simulation.state().fluid.smoke;
  const efsi::grid::VectorField& nodes = simulation.fluid_velocity();
  std::array<std::vector<float>, 3> velocity;
  for (auto& component : velocity) component.assign(grid.cell_count(), 0.0f);
  const auto corner = efsi::grid::corner_offsets(grid);
  simulation.parallel().for_each(grid.cells[2], [&](std::int64_t plane) {
    const int k = static_cast<int>(plane);
    for (int j = 0; j < grid.cells[1]; ++j)
      for (int i = 0; i < grid.cells[0]; ++i) {
        const std::size_t c = grid.cell(i, j, k), n = grid.node(i, j, k);
        if (!(std::abs(static_cast<double>(smoke[c])) > threshold)) continue;
        efsi::Vec3d sum = efsi::Vec3d::Zero();
        for (std::size_t offset : corner) sum += nodes.at(n + offset).cast<double>();
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

// The first cell along each axis whose centre does not lie below a corner of a region.
efsi::Vec3i first_cell(const Grid& grid, const EfsiVec3& corner) {
  const double x[3] = {corner.x, corner.y, corner.z};
  const efsi::Vec3d center = grid.cell_center(0, 0, 0);
  efsi::Vec3i cell;
  for (int a = 0; a < 3; ++a)
    cell[a] = static_cast<int>(std::clamp(std::ceil((x[a] - center[a]) / grid.h), 0.0, double(grid.cells[a])));
  return cell;
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
    options.low = first_cell(grid, full.region_min);
    options.high = first_cell(grid, full.region_max);
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

EfsiStatus efsi_vdb_open(const char* path, EfsiVdb** vdb, EfsiError* error) {
  if (vdb) *vdb = nullptr;
  return guarded(error, [&] {
    demand_path(path, "efsi_vdb_open: path");
    demand(vdb, "efsi_vdb_open: vdb");
    *vdb = new EfsiVdb{efsi::io::VdbFile(path)};
  });
}

EfsiStatus efsi_vdb_get_grid(const EfsiVdb* vdb, const char* name, EfsiVdbGrid* grid, size_t size, EfsiError* error) {
  return guarded(error, [&] {
    demand(vdb, "efsi_vdb_get_grid: vdb");
    demand(name, "efsi_vdb_get_grid: name");
    demand(grid, "efsi_vdb_get_grid: grid");
    const efsi::io::VdbGridInfo info = vdb->file.info(name);
    EfsiVdbGrid result{};
    std::copy(info.min.begin(), info.min.end(), result.min);
    std::copy(info.size.begin(), info.size.end(), result.size);
    std::copy(info.index_to_world.begin(), info.index_to_world.end(), result.transform);
    result.components = static_cast<std::uint32_t>(info.components);
    result.active_count = info.active_voxels;
    give(result, grid, size, "efsi_vdb_get_grid");
  });
}

EfsiStatus efsi_vdb_read(const EfsiVdb* vdb, const char* name, const int32_t min[3], const uint32_t cells[3],
                         uint32_t coarsen, float* values, uint64_t capacity, EfsiError* error) {
  return guarded(error, [&] {
    demand(vdb, "efsi_vdb_read: vdb");
    demand(name, "efsi_vdb_read: name");
    demand(min, "efsi_vdb_read: min");
    demand(cells, "efsi_vdb_read: cells");
    demand(values, "efsi_vdb_read: values");
    // What is too large stays so as an int.
    const auto whole = [](std::uint32_t n) {
      return static_cast<int>(std::min(n, std::uint32_t{std::numeric_limits<std::int32_t>::max()}));
    };
    vdb->file.read(name, {min[0], min[1], min[2]}, {whole(cells[0]), whole(cells[1]), whole(cells[2])}, whole(coarsen),
                   {values, static_cast<std::size_t>(capacity)});
  });
}

void efsi_vdb_destroy(EfsiVdb* vdb) { delete vdb; }
