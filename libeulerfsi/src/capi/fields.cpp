// Purpose: fields.h: views of the grid fields, and replacing them.
#include <cmath>
#include <type_traits>

#include "capi/convert.hpp"
#include "capi/guard.hpp"
#include "capi/sized.hpp"
#include "capi/solid_id.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;
using efsi::grid::Grid;
using efsi::grid::VectorField;

static_assert(std::is_same_v<efsi::Real, float>, "views hand out the fields as they are");

namespace {

// Element (0,0,0) at data[c] + first; n elements; a row of elements every row, a plane every plane elements.
EfsiFieldView make_view(const Grid& grid, const efsi::Vec3i& n, std::size_t row, std::size_t plane, bool cells) {
  EfsiFieldView view{};
  for (int a = 0; a < 3; ++a) view.size[a] = n[static_cast<std::size_t>(a)];
  view.stride[0] = 1;
  view.stride[1] = static_cast<int64_t>(row);
  view.stride[2] = static_cast<int64_t>(plane);
  view.origin = to_c(cells ? grid.cell_center(0, 0, 0) : grid.node_position(0, 0, 0));
  view.spacing = grid.h;
  view.cell_centered = cells;
  return view;
}

// A field that the scene does not use.
EfsiFieldView empty_view(const Grid& grid, int32_t components, bool cells) {
  EfsiFieldView view = make_view(grid, {0, 0, 0}, 0, 0, cells);
  view.components = components;
  return view;
}

EfsiFieldView view_nodes(const Grid& grid, const VectorField& field) {
  if (field.size() != grid.node_count()) return empty_view(grid, 3, false);
  EfsiFieldView view = make_view(grid, grid.nodes(), grid.node_stride(1), grid.node_stride(2), false);
  view.components = 3;
  for (std::size_t c = 0; c < 3; ++c) view.data[c] = field.c[c].data();
  return view;
}

EfsiFieldView view_cells(const Grid& grid, const std::vector<float>& field) {
  if (field.size() != grid.cell_count()) return empty_view(grid, 1, true);
  EfsiFieldView view = make_view(grid, grid.cells, grid.cell(0, 1, 0), grid.cell(0, 0, 1), true);
  view.components = 1;
  view.data[0] = field.data();
  return view;
}

// Cells with one ghost layer: the view starts at the first inner cell.
EfsiFieldView view_padded(const Grid& grid, const std::vector<float>& field) {
  if (field.size() != grid.padded_count()) return empty_view(grid, 1, true);
  const std::size_t first = grid.padded(0, 0, 0);
  EfsiFieldView view = make_view(grid, grid.cells, grid.padded(0, 1, 0) - first, grid.padded(0, 0, 1) - first, true);
  view.components = 1;
  view.data[0] = field.data() + first;
  return view;
}

[[noreturn]] void refuse_field(const char* function, int32_t field) {
  throw Error(ErrorCode::kArgument,
              std::string(function) + ": field = " + std::to_string(field) + ": must be a value of EfsiField");
}

bool of_one_solid(int32_t field) {
  return field == EFSI_FIELD_SOLID_DISPLACEMENT || field == EFSI_FIELD_SOLID_VELOCITY;
}

// Checks field and solid; returns the solid's index, 0 for fields of the whole grid.
std::size_t check_target(const EfsiSim& sim, int32_t field, uint32_t solid, const char* function) {
  if (field < EFSI_FIELD_VELOCITY || field > EFSI_FIELD_SOLID_VELOCITY) refuse_field(function, field);
  if (of_one_solid(field)) return solid_index(sim, solid, function);
  if (solid != 0)
    throw Error(ErrorCode::kArgument, std::string(function) + ": solid = " + std::to_string(solid) +
                                          ": must be 0 for a field of the whole grid");
  return 0;
}

uint64_t count_of(int64_t components, const efsi::Vec3i& n) {
  return static_cast<uint64_t>(components) * static_cast<uint64_t>(n[0]) * static_cast<uint64_t>(n[1]) *
         static_cast<uint64_t>(n[2]);
}

}  // namespace

EfsiStatus efsi_field_get_view(EfsiSim* sim, int32_t field, uint32_t solid, EfsiFieldView* view, size_t size) {
  return guarded(sim, [&] {
    demand(view, "efsi_field_get_view: view");
    const std::size_t index = check_target(*sim, field, solid, "efsi_field_get_view");
    efsi::sim::Simulation& simulation = sim->simulation;
    simulation.prepare();
    const Grid& grid = simulation.grid();
    const efsi::sim::State& state = simulation.state();
    const auto found = [&]() -> EfsiFieldView {
      switch (field) {
        case EFSI_FIELD_VELOCITY:
          return view_nodes(grid, simulation.fluid_velocity());
        case EFSI_FIELD_PRESSURE:
          return view_padded(grid, simulation.pressure());
        case EFSI_FIELD_SMOKE_DENSITY:
          return view_cells(grid, state.fluid.smoke);
        case EFSI_FIELD_SMOKE_TEMPERATURE:
          return view_cells(grid, state.fluid.temperature);
        case EFSI_FIELD_SOLID_FRACTION:
          return view_cells(grid, simulation.solid_fraction());
        case EFSI_FIELD_SOLID_DISPLACEMENT:
          return view_nodes(state.solids[index].band.grid, state.solids[index].u);
        case EFSI_FIELD_SOLID_VELOCITY:
          return view_nodes(state.solids[index].band.grid, state.solids[index].v);
        default:
          refuse_field("efsi_field_get_view", field);
      }
    };
    give(found(), view, size, "efsi_field_get_view");
  });
}

EfsiStatus efsi_field_set(EfsiSim* sim, int32_t field, uint32_t solid, const float* values, uint64_t count) {
  return guarded(sim, [&] {
    demand(values, "efsi_field_set: values");
    const std::size_t index = check_target(*sim, field, solid, "efsi_field_set");
    efsi::sim::Simulation& simulation = sim->simulation;
    const bool smoke = field == EFSI_FIELD_SMOKE_DENSITY || field == EFSI_FIELD_SMOKE_TEMPERATURE;
    if (!smoke && field != EFSI_FIELD_VELOCITY && !of_one_solid(field))
      throw Error(ErrorCode::kArgument, "efsi_field_set: field = " + std::to_string(field) +
                                            ": pressure and solid fraction are results and cannot be set");
    if ((smoke || field == EFSI_FIELD_VELOCITY) && !simulation.params().fluid.present)
      throw Error(ErrorCode::kArgument, "efsi_field_set: field = " + std::to_string(field) +
                                            ": a field of the fluid needs EfsiSimulationDef.ambient_fluid = 1");

    const Grid& grid = of_one_solid(field) ? simulation.state().solids[index].band.grid : simulation.grid();
    const uint64_t expected = smoke ? count_of(1, grid.cells) : count_of(3, grid.nodes());
    if (count != expected)
      throw Error(ErrorCode::kArgument,
                  "efsi_field_set: count = " + std::to_string(count) + ": must be " + std::to_string(expected));
    for (uint64_t i = 0; i < count; ++i)
      if (!std::isfinite(values[i]))
        throw Error(ErrorCode::kArgument, "efsi_field_set: values[" + std::to_string(i) +
                                              "] = " + std::to_string(values[i]) + ": must be a finite number");

    simulation.prepare();
    if (field == EFSI_FIELD_VELOCITY)
      simulation.set_velocity(values);
    else if (smoke)
      simulation.set_smoke(values, field == EFSI_FIELD_SMOKE_TEMPERATURE);
    else
      simulation.set_solid_field(index, field == EFSI_FIELD_SOLID_VELOCITY, values);
  });
}
