// Purpose: passenger.h: points that follow a solid.
#include "capi/convert.hpp"
#include "capi/guard.hpp"
#include "capi/solid_id.hpp"

using namespace efsi::capi;
using efsi::Error;
using efsi::ErrorCode;

EfsiStatus efsi_passenger_add(EfsiSim* sim, uint32_t solid, const float* points, uint64_t point_count, uint32_t* id) {
  return guarded(sim, [&] {
    const std::size_t index = solid_index(*sim, solid, "efsi_passenger_add");
    demand(points, "efsi_passenger_add: points");
    std::vector<efsi::Vec3d> rest(point_count);
    for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
    const std::size_t added = sim->simulation.add_passenger(index, std::move(rest));
    if (id) *id = static_cast<uint32_t>(added + 1);
  });
}

EfsiStatus efsi_passenger_get_points(const EfsiSim* sim, uint32_t id, float* points, float* velocities,
                                     uint64_t point_count) {
  return guarded(sim, [&] {
    const std::size_t index =
        check_id(id, sim->simulation.passenger_count(), "efsi_passenger_get_points: id", "passenger");
    const std::size_t count = sim->simulation.passenger_points(index);
    if (point_count != count)
      throw Error(ErrorCode::kArgument, "efsi_passenger_get_points: point_count = " + std::to_string(point_count) +
                                            ": must be " + std::to_string(count) + ", as it was added");
    std::vector<efsi::Vec3d> places, rates;
    sim->simulation.locate_passenger(index, places, rates);
    if (points) copy_points(places, points);
    if (velocities) copy_points(rates, velocities);
  });
}
