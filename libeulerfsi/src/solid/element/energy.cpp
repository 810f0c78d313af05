#include "solid/element/energy.hpp"

#include "solid/element/dilatation.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/hexahedron.hpp"

namespace efsi::solid {
namespace {

// Of a cell with these displacements at its corners, the lowest at x0, that is `stiff` times as stiff as a whole one
// and has `bulk` times the pressure's part [J].
double cell_energy(const SolidRest& rest, const PlasticField& plastic, const Dilatation& dilatation, const Vec3d u[8],
                   const Vec3d& x0, double h, const Vec3d& middle, int points, double stiff, double bulk) {
  const material::Elastic& elastic = rest.elastic;
  double energy = 0.0;
  for (int q = 0; q < points; ++q) {
    const ElasticPoint p = elastic_point(plastic, u, x0, h, quadrature_point(q, points, middle));
    const double volume = h * h * h / (points * p.elastic.det);
    energy += volume * material::principal_response(elastic, p.elastic.stretch).energy;
    if (points == 1) energy += hourglass_modes(rest, plastic, p, u, h, elastic.mu).energy;
  }
  const double det = deformation_from_displacement(displacement_gradient(u, center_gradients(), h)).det;
  const double ratio = dilatation.at_center(u, x0, h, det);
  return stiff * energy + h * h * h / det * material::bulk_energy(bulk * rest.bulk, ratio);
}

}  // namespace

double elastic_energy(const Parallel& parallel, const SolidRest& rest, const SolidState& state, const SolidWork& work,
                      int points_per_element) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const PlasticField plastic(rest, state);
  const Dilatation dilatation(rest, state);
  constexpr std::int64_t kChunk = 256;
  const auto elements = static_cast<std::int64_t>(work.element_corner.size());
  return parallel.sum((elements + kChunk - 1) / kChunk, [&](std::int64_t chunk) {
    double sum = 0.0;
    for (std::int64_t e = chunk * kChunk; e < std::min(elements, (chunk + 1) * kChunk); ++e) {
      const auto index = static_cast<std::size_t>(e);
      const auto n = static_cast<std::size_t>(work.element_corner[index]);
      Vec3d u[8];
      for (std::size_t a = 0; a < 8; ++a) u[a] = state.u.at(n + corner[a]).cast<double>();
      const Vec3i place = g.node_place(n);
      sum += cell_energy(rest, plastic, dilatation, u, g.node_position(place[0], place[1], place[2]), g.h,
                         work.middle(index), points_per_element, work.element_weight * work.factor(index),
                         bulk_weight(rest, work, index));
    }
    return sum;
  });
}

ShapeEnergies measure_shape(const Parallel& parallel, const SolidRest& rest, const SolidState& state,
                            const SolidWork& work, int points_per_element) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const PlasticField plastic(rest, state);
  const Dilatation dilatation(rest, state);
  struct Sums {
    double mass = 0.0;  // over rho0 h^3
    double kinetic = 0.0, elastic = 0.0;
    Vec3d moment = Vec3d::Zero();
  };
  std::vector<Sums> planes(static_cast<std::size_t>(g.cells[2]));
  // Sums per plane of cells.
  parallel.for_each(g.cells[2], [&](std::int64_t kk) {
    Sums& s = planes[static_cast<std::size_t>(kk)];
    const int k = static_cast<int>(kk);
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.cell(i, j, k), n = g.node(i, j, k);
        const double fraction = static_cast<double>(work.fraction[c]);
        if (!(fraction > 0.0)) continue;
        Vec3d u[8];
        double square = 0.0;
        for (std::size_t a = 0; a < 8; ++a) {
          u[a] = state.u.at(n + corner[a]).cast<double>();
          square += state.v.at(n + corner[a]).cast<double>().squaredNorm();
        }
        const double mass = fraction / static_cast<double>(work.volume_ratio[c]);
        s.mass += mass;
        s.kinetic += mass * square / 16.0;
        s.moment += mass * g.cell_center(i, j, k);
        s.elastic += fraction * cell_energy(rest, plastic, dilatation, u, g.node_position(i, j, k), g.h, Vec3d::Zero(),
                                            points_per_element, 1.0, 1.0);
      }
  });
  Sums total;
  for (const Sums& s : planes) {
    total.mass += s.mass;
    total.kinetic += s.kinetic;
    total.elastic += s.elastic;
    total.moment += s.moment;
  }
  // Scaled to the mass of the solid.
  ShapeEnergies out;
  if (!(total.mass > 0.0)) return out;
  const double counted = rest.density * g.h * g.h * g.h * total.mass;
  out.kinetic = work.total_mass * total.kinetic / total.mass;
  out.elastic = work.total_mass / counted * total.elastic;
  out.center = total.moment / total.mass;
  return out;
}

}  // namespace efsi::solid
