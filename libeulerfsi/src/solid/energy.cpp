#include "solid/energy.hpp"

#include "solid/hexahedron.hpp"
#include "solid/reference_map.hpp"

namespace efsi::solid {
namespace {

// Of a whole cell with these displacements at its corners, per element that it would be [J].
double cell_energy(const material::Elastic& elastic, const Vec3d u[8], double h, int points) {
  double energy = 0.0;
  for (std::size_t q = 0; q < static_cast<std::size_t>(points); ++q) {
    const ShapeGradients& gradients = points == 1 ? center_gradients() : gauss_gradients()[q];
    const Deformation d = deformation_from_displacement(displacement_gradient(u, gradients, h));
    energy += h * h * h / (points * d.det) * material::principal_response(elastic, d.stretch).energy;
  }
  if (points > 1) return energy;
  for (const auto& sign : kHourglassSign) {
    Vec3d amplitude = Vec3d::Zero();
    for (std::size_t a = 0; a < 8; ++a) amplitude += sign[a] * kHourglassNorm * u[a];
    energy += 0.5 * kHourglassFactor * elastic.mu * h * amplitude.squaredNorm();
  }
  return energy;
}

}  // namespace

double elastic_energy(const Parallel& parallel, const SolidRest& rest, const SolidState& state, const SolidWork& work,
                      int points_per_element) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  constexpr std::int64_t kChunk = 256;
  const auto elements = static_cast<std::int64_t>(work.element_corner.size());
  return work.element_weight * parallel.sum((elements + kChunk - 1) / kChunk, [&](std::int64_t chunk) {
    double sum = 0.0;
    for (std::int64_t e = chunk * kChunk; e < std::min(elements, (chunk + 1) * kChunk); ++e) {
      const auto n = static_cast<std::size_t>(work.element_corner[static_cast<std::size_t>(e)]);
      Vec3d u[8];
      for (std::size_t a = 0; a < 8; ++a) u[a] = state.u.at(n + corner[a]).cast<double>();
      sum += cell_energy(rest.elastic, u, g.h, points_per_element);
    }
    return sum;
  });
}

ShapeEnergies measure_shape(const Parallel& parallel, const SolidRest& rest, const SolidState& state,
                            const SolidWork& work, int points_per_element) {
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  struct Sums {
    double mass = 0.0;  // over rho0 h^3
    double kinetic = 0.0, elastic = 0.0;
    Vec3d moment = Vec3d::Zero();
  };
  std::vector<Sums> planes(static_cast<std::size_t>(g.cells[2]));
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
        s.elastic += fraction * cell_energy(rest.elastic, u, g.h, points_per_element);
      }
  });
  Sums total;
  for (const Sums& s : planes) {
    total.mass += s.mass;
    total.kinetic += s.kinetic;
    total.elastic += s.elastic;
    total.moment += s.moment;
  }
  ShapeEnergies out;
  if (!(total.mass > 0.0)) return out;
  const double counted = rest.density * g.h * g.h * g.h * total.mass;
  out.kinetic = work.total_mass * total.kinetic / total.mass;
  out.elastic = work.total_mass / counted * total.elastic;
  out.center = total.moment / total.mass;
  return out;
}

}  // namespace efsi::solid
