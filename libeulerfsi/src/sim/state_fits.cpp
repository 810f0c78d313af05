#include "sim/state_fits.hpp"

#include <algorithm>
#include <cmath>

namespace efsi::sim {
namespace {

std::string count_fault(const std::string& name, std::size_t count, std::size_t wanted) {
  if (count == wanted) return "";
  return name + ": " + std::to_string(count) + " values: must be " + std::to_string(wanted);
}

// Of an array that may be left out.
std::string optional_fault(const std::string& name, std::size_t count, std::size_t wanted) {
  return count == 0 ? "" : count_fault(name, count, wanted);
}

std::string finite_fault(const std::string& name, const std::vector<Real>& values) {
  const bool all = std::all_of(values.begin(), values.end(), [](Real value) { return std::isfinite(value); });
  return all ? "" : name + ": holds a value that is not finite";
}

std::string field_fault(const std::string& name, const grid::VectorField& field, std::size_t wanted) {
  std::string fault;
  for (std::size_t a = 0; a < 3 && fault.empty(); ++a) {
    fault = count_fault(name, field.c[a].size(), wanted);
    if (fault.empty()) fault = finite_fault(name, field.c[a]);
  }
  return fault;
}

// least: cells of an edge.
bool lies_in(const grid::Grid& box, const Vec3i& lo, const Vec3i& cells, int least) {
  for (std::size_t a = 0; a < 3; ++a)
    if (lo[a] < 0 || cells[a] < least || cells[a] > box.cells[a] || lo[a] > box.cells[a] - cells[a]) return false;
  return true;
}

std::string fluid_fault(const State& state, const State& ours, const grid::Grid& box) {
  const fluid::FluidState& fluid = state.fluid;
  std::string fault = field_fault("fluid: velocity", fluid.velocity, ours.fluid.velocity.size());
  grid::Grid of_pressure = box;
  if (fault.empty() && fluid.velocity.size() == 0) {
    if (!lies_in(box, state.window.lo, state.window.cells, 0)) return "window: must lie in the box";
    of_pressure.cells = state.window.cells;
  }
  if (fault.empty() && !(fluid.pressure.empty() && of_pressure.cells == Vec3i{0, 0, 0}))
    fault = count_fault("fluid: pressure", fluid.pressure.size(), of_pressure.padded_count());
  // What no emitter gives any more may still be there.
  const auto carried = [&](const std::string& name, const std::vector<Real>& values, const std::vector<Real>& own) {
    if (fault.empty() && !(values.empty() && own.empty())) fault = count_fault(name, values.size(), box.cell_count());
  };
  carried("fluid: smoke", fluid.smoke, ours.fluid.smoke);
  carried("fluid: temperature", fluid.temperature, ours.fluid.temperature);
  if (fault.empty() && !(std::isfinite(fluid.carried_time) && fluid.carried_time >= 0.0))
    fault = "fluid: carried_time: must be a finite number >= 0";
  for (const auto* values : {&fluid.pressure, &fluid.smoke, &fluid.temperature})
    if (fault.empty()) fault = finite_fault("fluid", *values);
  return fault;
}

}  // namespace

std::string body_fault(const solid::SolidState& state, const grid::Grid& box, const solid::SolidRest& rest) {
  const grid::Grid& band = state.band.grid;
  if (!lies_in(box, band.lo, band.cells, 1)) return "band: must lie in the box";
  if (band.h != box.h || band.origin != box.node_position(band.lo[0], band.lo[1], band.lo[2]))
    return "band: must lie on the nodes of the box";
  std::string fault = field_fault("u", state.u, band.node_count());
  if (fault.empty()) fault = field_fault("v", state.v, band.node_count());
  const bool changes =
      std::any_of(state.change.c.begin(), state.change.c.end(), [](const auto& c) { return !c.empty(); });
  if (fault.empty() && changes) fault = field_fault("change", state.change, band.node_count());
  if (fault.empty() && changes && !(std::isfinite(state.change_time) && state.change_time > 0.0))
    fault = "change_time: must be a finite number > 0";
  if (fault.empty()) fault = count_fault("valid", state.valid.size(), band.node_count());
  if (fault.empty()) fault = optional_fault("stiff", state.stiff.size(), band.cell_count());
  const auto lattice = [&](bool used) { return used ? rest.lattice.node_count() : 0; };
  if (fault.empty()) fault = count_fault("plastic", state.plastic.size(), lattice(rest.plastic.yields()));
  if (fault.empty()) fault = count_fault("dilatation", state.dilatation.size(), lattice(rest.bulk > 0.0));
  if (fault.empty()) fault = finite_fault("dilatation", state.dilatation);
  if (fault.empty()) fault = count_fault("surface", state.surface.size(), rest.surface.points.size());
  const auto finite = [](const Vec3d& x) { return x.allFinite(); };
  if (fault.empty() && !std::all_of(state.surface.begin(), state.surface.end(), finite))
    fault = "surface: holds a value that is not finite";
  const auto on_axis = [](const solid::WallImpulse& press) { return press.axis >= 0 && press.axis < 3; };
  const auto in_order = [](const solid::DeepVertex& one, const solid::DeepVertex& two) {
    return std::pair(one.other, one.vertex) < std::pair(two.other, two.vertex);
  };
  if (fault.empty() && !std::is_sorted(state.deep.begin(), state.deep.end(), in_order))
    fault = "deep: must be in the order of solids and vertices";
  if (fault.empty() && !std::all_of(state.presses.begin(), state.presses.end(), on_axis))
    fault = "presses: an axis must be 0, 1 or 2";
  return fault;
}

std::string state_fault(const State& state, const State& ours, const grid::Grid& box,
                        const std::vector<solid::SolidRest>& rests) {
  if (!std::isfinite(state.time) || state.time < 0) return "time: must be a finite number >= 0";
  if (!std::isfinite(state.fluid_speed)) return "fluid_speed: must be finite";
  std::string fault = fluid_fault(state, ours, box);
  for (std::size_t l = 0; l < state.solids.size() && fault.empty(); ++l) {
    fault = body_fault(state.solids[l], box, rests[l]);
    if (!fault.empty()) fault = "solid " + std::to_string(l + 1) + ": " + fault;
  }
  return fault;
}

}  // namespace efsi::sim
