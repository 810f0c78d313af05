#include "solid/element/material_force.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "solid/element/dilatation.hpp"
#include "solid/element/mass.hpp"
#include "solid/element/plasticity.hpp"
#include "solid/hexahedron.hpp"

namespace efsi::solid {
namespace {

constexpr int kPairFirst[3] = {1, 2, 0}, kPairSecond[3] = {2, 0, 1};

struct RealGradients {
  Real g[8][3];  // corner, axis: h grad N
  RealGradients(const SolidWork& work, std::size_t e, std::size_t q) {
    const ShapeGradients source = gradients_at(work.local_point(e, q));
    for (std::size_t a = 0; a < 8; ++a)
      for (int i = 0; i < 3; ++i) g[a][i] = static_cast<Real>(source[a][i]);
  }
};

ElementPoint linearise(const material::Elastic& elastic, const Deformation& d, double dv0, double& energy) {
  const material::PrincipalResponse r = material::make_definite(material::principal_response(elastic, d.stretch));
  energy = r.energy * dv0;
  ElementPoint point{};
  const Vec3d& s = d.stretch;
  for (int i = 0; i < 9; ++i) point.axes[i] = static_cast<Real>(d.axes.data()[i]);
  const auto normal = [&](int i, int j) { return static_cast<Real>(dv0 * s[i] * r.hessian(i, j) * s[j]); };
  point.normal[0] = normal(0, 0);
  point.normal[1] = normal(1, 1);
  point.normal[2] = normal(2, 2);
  point.normal[3] = normal(1, 2);
  point.normal[4] = normal(2, 0);
  point.normal[5] = normal(0, 1);
  for (int p = 0; p < 3; ++p) {
    const double si = s[kPairFirst[p]], sj = s[kPairSecond[p]];
    const double mean = 0.5 * (r.symmetric[p] + r.skew[p]), cross = 0.5 * (r.symmetric[p] - r.skew[p]);
    point.pair[3 * p] = static_cast<Real>(dv0 * mean * sj * sj);
    point.pair[3 * p + 1] = static_cast<Real>(dv0 * cross * si * sj);
    point.pair[3 * p + 2] = static_cast<Real>(dv0 * mean * si * si);
  }
  const Mat3d tau = d.axes * (r.stress.cwiseProduct(s) * dv0).asDiagonal() * d.axes.transpose();
  point.stress[0] = static_cast<Real>(tau(0, 0));
  point.stress[1] = static_cast<Real>(tau(1, 1));
  point.stress[2] = static_cast<Real>(tau(2, 2));
  point.stress[3] = static_cast<Real>(tau(1, 2));
  point.stress[4] = static_cast<Real>(tau(2, 0));
  point.stress[5] = static_cast<Real>(tau(0, 1));
  return point;
}

// T(E) in the frame of the principal axes.
Mat3 stress_change(const ElementPoint& p, const Mat3& e) {
  Mat3 t;
  t(0, 0) = p.normal[0] * e(0, 0) + p.normal[5] * e(1, 1) + p.normal[4] * e(2, 2);
  t(1, 1) = p.normal[5] * e(0, 0) + p.normal[1] * e(1, 1) + p.normal[3] * e(2, 2);
  t(2, 2) = p.normal[4] * e(0, 0) + p.normal[3] * e(1, 1) + p.normal[2] * e(2, 2);
  for (int q = 0; q < 3; ++q) {
    const int i = kPairFirst[q], j = kPairSecond[q];
    t(i, j) = p.pair[3 * q] * e(i, j) + p.pair[3 * q + 1] * e(j, i);
    t(j, i) = p.pair[3 * q + 1] * e(i, j) + p.pair[3 * q + 2] * e(j, i);
  }
  return t;
}

// out += K x on the hourglass modes. X of a mode is all there is of it on the grid, where nodes do not move: the energy
// is k/2 |F^-1 x - X|^2 with F at the centre, which a rotation leaves as it is; its force is k F^-T X and K = k F^-T
// F^-1.
void add_hourglass(const Mat3& k, const Real x[24], Real out[24]) {
  for (const auto& sign : kHourglassSign) {
    Vec3 amplitude = Vec3::Zero();
    for (int a = 0; a < 8; ++a)
      for (int i = 0; i < 3; ++i)
        amplitude[i] += static_cast<Real>(sign[a] * kHourglassNorm * kHourglassNorm) * x[3 * a + i];
    const Vec3 force = k * amplitude;
    for (int a = 0; a < 8; ++a)
      for (int i = 0; i < 3; ++i) out[3 * a + i] += static_cast<Real>(sign[a]) * force[i];
  }
}

// k F^-T F^-1 from the principal stretches.
Mat3 hourglass_stiffness(const ElementPoint& point) {
  const Eigen::Map<const Mat3> axes(point.axes);
  return axes * Vec3(point.hourglass[1], point.hourglass[2], point.hourglass[3]).asDiagonal() * axes.transpose();
}

Vec3d position_of(const Grid& g, std::size_t node) {
  const Vec3i place = g.node_place(node);
  return g.node_position(place[0], place[1], place[2]);
}

// Where the pressure keeps it.
double det_f_at_center(const Vec3d u[8], double h) {
  return deformation_from_displacement(displacement_gradient(u, center_gradients(), h)).det;
}

// Of the modes at an element's corners, k F^-T C_p X: what add_hourglass adds where nothing has yielded.
std::array<Real, 12> hourglass_force(const ElasticPoint& center, const Hourglass& modes) {
  std::array<Real, 12> out;
  const Mat3d turn = modes.stiffness * kHourglassNorm * center.inverse_f.transpose() * center.metric;
  for (std::size_t m = 0; m < 4; ++m) {
    const Vec3d force = turn * modes.amplitudes[m];
    for (std::size_t i = 0; i < 3; ++i) out[3 * m + i] = static_cast<Real>(force[static_cast<Eigen::Index>(i)]);
  }
  return out;
}

// det F over elements, their largest stretch, what they store, and how many of them are degenerate.
struct MaterialRange {
  double low = std::numeric_limits<double>::infinity(), high = 0.0, stretch = 1.0, energy = 0.0;
  std::uint64_t degenerate = 0;

  void add(const MaterialRange& other) {
    low = std::min(low, other.low);
    high = std::max(high, other.high);
    stretch = std::max(stretch, other.stretch);
    energy += other.energy;
    degenerate += other.degenerate;
  }
};

// The quadrature points of element e.
void compute_element(const SolidRest& rest, const SolidState& state, const PlasticField& plastic,
                     const Dilatation& dilatation, const std::array<std::size_t, 8>& corner, std::size_t e,
                     SolidWork& work, MaterialRange& range) {
  const Grid& g = state.band.grid;
  const auto points = static_cast<std::size_t>(work.points_per_element);
  const auto n = static_cast<std::size_t>(work.element_corner[e]);
  Vec3d u[8];
  for (std::size_t a = 0; a < 8; ++a) u[a] = state.u.at(n + corner[a]).cast<double>();
  const bool places = !plastic.empty() || !work.dilatation.empty();
  const Vec3d x0 = places ? position_of(g, n) : Vec3d(Vec3d::Zero());
  bool degenerate = false;
  material::Elastic elastic = rest.elastic;
  elastic.mu *= work.element_weight * work.factor(e);
  elastic.lambda *= work.element_weight * work.factor(e);
  const double bulk = rest.bulk * bulk_weight(rest, work, e);
  for (std::size_t q = 0; q < points; ++q) {
    const Vec3d local = work.local_point(e, q);
    const ElasticPoint p = elastic_point(plastic, u, x0, g.h, local);
    const Deformation& d = p.elastic;
    double energy = 0.0;
    const double volume = g.h * g.h * g.h / (static_cast<double>(points) * d.det);
    ElementPoint point = linearise(elastic, d, volume, energy);
    if (points == 1) {
      for (int i = 0; i < 3; ++i) point.local[i] = static_cast<Real>(local[i]);
      const Hourglass modes = hourglass_modes(rest, plastic, p, u, g.h, elastic.mu);
      const double k = modes.stiffness;
      point.hourglass[0] = static_cast<Real>(k);
      for (int i = 0; i < 3; ++i) point.hourglass[i + 1] = static_cast<Real>(k / (d.stretch[i] * d.stretch[i]));
      energy += modes.energy;
      if (!plastic.empty()) work.hourglass_force[e] = hourglass_force(p, modes);
    }
    work.set_element_point(e, q, point);
    const double det = points != 1 || local.isZero(0.0) ? d.det : det_f_at_center(u, g.h);
    const double ratio = work.dilatation.empty() ? det : dilatation.at_center(u, x0, g.h, det);
    if (!work.dilatation.empty()) work.dilatation[e] = static_cast<Real>(ratio);
    energy += volume * d.det / det * material::bulk_energy(bulk, ratio);
    range.energy += energy;
    range.low = std::min(range.low, det);
    range.high = std::max(range.high, det);
    if (!d.degenerate) range.stretch = std::max(range.stretch, p.total_stretch);
    degenerate = degenerate || d.degenerate;
  }
  range.degenerate += degenerate;
}

}  // namespace

void compute_material(const Parallel& parallel, const SolidRest& rest, const SolidState& state, int points_per_element,
                      SolidWork& work) {
  const auto corner = grid::corner_offsets(state.band.grid);
  const std::size_t elements = work.element_cell.size();
  work.resize_elements(points_per_element);
  const PlasticField plastic(rest, state);
  const Dilatation dilatation(rest, state);
  work.dilatation.resize(state.dilatation.empty() ? 0 : elements);
  work.hourglass_force.resize(plastic.empty() || points_per_element != 1 ? 0 : elements);

  constexpr std::int64_t kChunk = 256;
  const auto chunks = (static_cast<std::int64_t>(elements) + kChunk - 1) / kChunk;
  std::vector<MaterialRange> ranges(static_cast<std::size_t>(chunks));
  parallel.for_each(chunks, [&](std::int64_t chunk) {
    const std::size_t end = std::min(elements, static_cast<std::size_t>((chunk + 1) * kChunk));
    for (std::size_t e = static_cast<std::size_t>(chunk * kChunk); e < end; ++e)
      compute_element(rest, state, plastic, dilatation, corner, e, work, ranges[static_cast<std::size_t>(chunk)]);
  });
  MaterialRange total;
  for (const MaterialRange& range : ranges) total.add(range);
  work.min_det_f = elements ? total.low : 1.0;
  work.max_det_f = elements ? total.high : 1.0;
  work.max_stretch = total.stretch;
  work.elastic_energy = total.energy;
  work.degenerate = total.degenerate;
}

void element_force(const SolidState& state, const SolidWork& work, std::size_t e, Real out[24]) {
  const Grid& g = state.band.grid;
  const Real inverse_h = static_cast<Real>(1.0 / g.h);
  std::fill(out, out + 24, Real(0));
  for (std::size_t q = 0; q < static_cast<std::size_t>(work.points_per_element); ++q) {
    const ElementPoint point = work.element_point(e, q);
    const RealGradients at(work, e, q);
    const Real* s = point.stress;
    for (int a = 0; a < 8; ++a) {
      const Real* grad = at.g[a];
      out[3 * a + 0] -= inverse_h * (s[0] * grad[0] + s[5] * grad[1] + s[4] * grad[2]);
      out[3 * a + 1] -= inverse_h * (s[5] * grad[0] + s[1] * grad[1] + s[3] * grad[2]);
      out[3 * a + 2] -= inverse_h * (s[4] * grad[0] + s[3] * grad[1] + s[2] * grad[2]);
    }
  }
  if (!work.hourglass_force.empty()) {
    for (std::size_t m = 0; m < 4; ++m)
      for (std::size_t a = 0; a < 8; ++a)
        for (std::size_t i = 0; i < 3; ++i)
          out[3 * a + i] += static_cast<Real>(kHourglassSign[m][a]) * work.hourglass_force[e][3 * m + i];
  } else if (work.points_per_element == 1) {
    const auto corner = grid::corner_offsets(g);
    const auto n = static_cast<std::size_t>(work.element_corner[e]);
    Real u[24];
    Mat3 inverse_f = Mat3::Identity();
    const RealGradients at(work, e, 0);
    for (std::size_t a = 0; a < 8; ++a)
      for (std::size_t i = 0; i < 3; ++i) {
        u[3 * a + i] = state.u.c[i][n + corner[a]];
        for (std::size_t j = 0; j < 3; ++j)
          inverse_f(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) -=
              inverse_h * u[3 * a + i] * at.g[a][j];
      }
    add_hourglass(-work.element_point(e, 0).hourglass[0] * inverse_f.transpose(), u, out);  // X = -u on these modes
  }
}

void element_stiffness(const SolidWork& work, double h, std::size_t e, const Real x[24], Real out[24]) {
  const Real inverse_h = static_cast<Real>(1.0 / h);
  std::fill(out, out + 24, Real(0));
  for (std::size_t q = 0; q < static_cast<std::size_t>(work.points_per_element); ++q) {
    const ElementPoint point = work.element_point(e, q);
    const RealGradients at(work, e, q);
    Mat3 gradient = Mat3::Zero();
    for (int a = 0; a < 8; ++a)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) gradient(i, j) += x[3 * a + i] * at.g[a][j];
    const Eigen::Map<const Mat3> axes(point.axes);
    const Mat3 local = axes.transpose() * (gradient * inverse_h) * axes;
    const Mat3 stress = axes * stress_change(point, local) * axes.transpose() * inverse_h;
    for (int a = 0; a < 8; ++a) {
      const Real* grad = at.g[a];
      for (int i = 0; i < 3; ++i)
        out[3 * a + i] += stress(i, 0) * grad[0] + stress(i, 1) * grad[1] + stress(i, 2) * grad[2];
    }
  }
  if (work.points_per_element == 1) add_hourglass(hourglass_stiffness(work.element_point(e, 0)), x, out);
}

void element_stiffness_diagonal(const SolidWork& work, double h, std::size_t e, Real out[24]) {
  const Real inverse_h = static_cast<Real>(1.0 / h);
  std::fill(out, out + 24, Real(0));
  if (work.points_per_element == 1) {
    const Mat3 k = hourglass_stiffness(work.element_point(e, 0));
    for (int i = 0; i < 24; ++i) out[i] = Real(4 * kHourglassNorm * kHourglassNorm) * k(i % 3, i % 3);
  }
  for (std::size_t q = 0; q < static_cast<std::size_t>(work.points_per_element); ++q) {
    const ElementPoint point = work.element_point(e, q);
    const RealGradients at(work, e, q);
    const Eigen::Map<const Mat3> axes(point.axes);
    for (int a = 0; a < 8; ++a) {
      const Vec3 grad(at.g[a][0], at.g[a][1], at.g[a][2]);
      const Vec3 b = axes.transpose() * (grad * inverse_h);
      for (int i = 0; i < 3; ++i) {
        const Vec3 p = axes.row(i).transpose();
        const Mat3 local = p * b.transpose();
        out[3 * a + i] += local.cwiseProduct(stress_change(point, local)).sum();
      }
    }
  }
}

}  // namespace efsi::solid
