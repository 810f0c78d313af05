#include "solid/element/plasticity.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "solid/element/material_lattice.hpp"
#include "solid/hexahedron.hpp"

namespace efsi::solid {
namespace {

// Gathering: share of what reads a node, where no element covers it; cells that an element reaches at most.
constexpr double kReaderShare = 1e-3;
constexpr double kMostReach = 6.0;

Mat3d matrix_of(const double (&log)[5]) {
  Mat3d m;
  m << log[0], log[4], log[3], log[4], log[1], log[2], log[3], log[2], -log[0] - log[1];
  return m;
}

// exp(2 H)
Mat3d metric_of(const Mat3d& log) {
  const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(log);
  const Vec3d squares = (2.0 * eigen.eigenvalues()).array().exp().matrix();
  return eigen.eigenvectors() * squares.asDiagonal() * eigen.eigenvectors().transpose();
}

// 1/2 log C without its trace
Mat3d log_of(const Mat3d& metric) {
  const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(metric);
  Vec3d log = (0.5 * eigen.eigenvalues().array().log()).matrix();
  log -= Vec3d::Constant(log.mean());
  return eigen.eigenvectors() * log.asDiagonal() * eigen.eigenvectors().transpose();
}

std::array<double, 8> shape_values(const Vec3d& local) {
  std::array<double, 8> values;
  for (std::size_t a = 0; a < 8; ++a) {
    values[a] = 1.0;
    for (int i = 0; i < 3; ++i) values[a] *= 0.5 * (1.0 + (grid::kCorner[a][i] ? local[i] : -local[i]));
  }
  return values;
}

// What flows at a quadrature point.
struct PointFlow {
  Vec3d place = Vec3d::Zero();          // X
  Mat3d spread = Mat3d::Identity();     // F with stretches of at most 1
  Vec3d reach = Vec3d::Constant(-1.0);  // in the lattice [m]; < 0: the point has no part in it
  double change[6] = {};                // of a PlasticNode
  bool flows = false;
};

PointFlow flow_at(const SolidRest& rest, const ElasticPoint& p, double dt) {
  PointFlow out;
  if (!(p.inverse_f.determinant() > 0.0)) return out;
  const double h = rest.lattice.h;
  out.place = p.place;
  const Eigen::JacobiSVD<Mat3d> svd(p.inverse_f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vec3d wide = svd.singularValues().cwiseMax(1.0);
  out.spread = svd.matrixV() * wide.cwiseInverse().asDiagonal() * svd.matrixU().transpose();
  const Mat3d back = svd.matrixU() * wide.asDiagonal() * svd.matrixV().transpose();
  for (int i = 0; i < 3; ++i) out.reach[i] = std::clamp(h * back.row(i).cwiseAbs().sum(), h, kMostReach * h);
  const material::Flow flow =
      material::plastic_flow(rest.elastic, rest.plastic, p.elastic.stretch, p.strain.accumulated, dt);
  if (!(flow.accumulated > 0.0)) return out;
  const Vec3d inverse_squares = (-2.0 * flow.strain).array().exp().matrix();
  // C_p = F^T b_e^-1 F
  const Mat3d half = p.elastic.axes.transpose() * p.inverse_f.inverse();
  const Mat3d change = log_of(half.transpose() * inverse_squares.asDiagonal() * half) - p.strain.log;
  out.flows = true;
  const double values[6] = {change(0, 0), change(1, 1), change(1, 2), change(2, 0), change(0, 1), flow.accumulated};
  std::copy(values, values + 6, out.change);
  return out;
}

double hat(double x) { return std::max(0.0, 1.0 - std::abs(x)); }

// How much of a point a node of the lattice at X takes: its hat of a cell's width, in the world where that is wider, so
// that no node is left out, else in the rest shape, so that no point is; and a little of the hat by which the point
// reads the node.
double weight_of(const PointFlow& point, const Vec3d& X, double h) {
  const Vec3d away = (X - point.place) / h, wide = point.spread * away;
  return hat(wide[0]) * hat(wide[1]) * hat(wide[2]) + kReaderShare * hat(away[0]) * hat(away[1]) * hat(away[2]);
}

// Nodes of one axis that a point reaches.
struct Span {
  int begin, end;
};
Span span_of(const Grid& lattice, const PointFlow& point, int axis) {
  const double at = (point.place[axis] - lattice.origin[axis]) / lattice.h, reach = point.reach[axis] / lattice.h;
  const double last = lattice.cells[static_cast<std::size_t>(axis)];
  return {static_cast<int>(std::ceil(std::clamp(at - reach, 0.0, last))),
          static_cast<int>(std::floor(std::clamp(at + reach, -1.0, last))) + 1};
}

// Adds to the nodes of plane k the mean change of the points that reach them.
void gather_plane(const Grid& lattice, const std::vector<PointFlow>& points, const std::vector<std::uint32_t>& here,
                  int k, std::vector<PlasticNode>& nodes) {
  const Vec3i n = lattice.nodes();
  struct Sum {
    double weight = 0.0, change[6] = {};
  };
  std::vector<Sum> sums(static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]));
  for (const std::uint32_t q : here) {
    const PointFlow& point = points[q];
    const Span across = span_of(lattice, point, 0), up = span_of(lattice, point, 1);
    for (int j = up.begin; j < up.end; ++j)
      for (int i = across.begin; i < across.end; ++i) {
        const double weight = weight_of(point, lattice.node_position(i, j, k), lattice.h);
        Sum& sum = sums[lattice.node(i, j, 0)];
        sum.weight += weight;
        if (point.flows)
          for (int c = 0; c < 6; ++c) sum.change[c] += weight * point.change[c];
      }
  }
  PlasticNode* plane = nodes.data() + lattice.node(0, 0, k);
  for (std::size_t m = 0; m < sums.size(); ++m) {
    const Sum& sum = sums[m];
    if (!(sum.weight > 0.0)) continue;
    for (int c = 0; c < 5; ++c) plane[m].log[c] += static_cast<Real>(sum.change[c] / sum.weight);
    plane[m].accumulated += static_cast<Real>(sum.change[5] / sum.weight);
  }
}

void gather(const Parallel& parallel, const Grid& lattice, const std::vector<PointFlow>& points,
            std::vector<PlasticNode>& nodes) {
  std::vector<std::vector<std::uint32_t>> planes(static_cast<std::size_t>(lattice.nodes()[2]));
  std::vector<std::uint8_t> changes(planes.size(), 0);
  for (std::size_t q = 0; q < points.size(); ++q) {
    if (points[q].reach[2] < 0.0) continue;
    const Span span = span_of(lattice, points[q], 2);
    for (int k = span.begin; k < span.end; ++k) {
      planes[static_cast<std::size_t>(k)].push_back(static_cast<std::uint32_t>(q));
      changes[static_cast<std::size_t>(k)] |= points[q].flows;
    }
  }
  parallel.for_each(static_cast<std::int64_t>(planes.size()), [&](std::int64_t k) {
    const auto plane = static_cast<std::size_t>(k);
    if (changes[plane]) gather_plane(lattice, points, planes[plane], static_cast<int>(k), nodes);
  });
}

}  // namespace

PlasticField::PlasticField(const SolidRest& rest, const SolidState& state)
    : lattice_(rest.lattice), nodes_(state.plastic) {}

PlasticStrain PlasticField::at(const Vec3d& X) const {
  PlasticStrain strain;
  if (nodes_.empty()) return strain;
  const LatticePoint point = lattice_point(lattice_, X);
  double log[5] = {};
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const PlasticNode& node = nodes_[point.node[corner]];
    if (!(node.accumulated > 0)) continue;
    const double weight = point.weight[corner];
    for (int c = 0; c < 5; ++c) log[c] += weight * static_cast<double>(node.log[c]);
    strain.accumulated += weight * static_cast<double>(node.accumulated);
    strain.none = false;
  }
  if (!strain.none) strain.log = matrix_of(log);
  return strain;
}

Mat3d PlasticField::metric(const Vec3d& X) const {
  const PlasticStrain strain = at(X);
  return strain.none ? Mat3d::Identity() : metric_of(strain.log);
}

Mat3d PlasticField::stretch(const Vec3d& X) const {
  const PlasticStrain strain = at(X);
  return strain.none ? Mat3d::Identity() : metric_of(0.5 * strain.log);
}

std::array<Vec3d, 3> PlasticField::hourglass(const Vec3d& X, const Mat3d& inverse_f, double h) const {
  std::array<Vec3d, 3> amplitude{Vec3d::Zero(), Vec3d::Zero(), Vec3d::Zero()};
  if (nodes_.empty()) return amplitude;
  // dC_p / dX_c
  Mat3d slope[3];
  bool none = true;
  for (int c = 0; c < 3; ++c) {
    const Vec3d step = 0.5 * lattice_.h * Vec3d::Unit(c);
    const PlasticStrain behind = at(X - step), ahead = at(X + step);
    slope[c] = (metric_of(ahead.log) - metric_of(behind.log)) / lattice_.h;
    none = none && behind.none && ahead.none;
  }
  if (none) return amplitude;
  const Mat3d raise = metric(X).inverse();
  // Christoffel's symbols of C_p: d2X_c / dx_j dx_k = -Gamma^c_ab dX_a/dx_j dX_b/dx_k in a body with F^T F = C_p
  Mat3d gamma[3] = {Mat3d::Zero(), Mat3d::Zero(), Mat3d::Zero()};
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) {
      Vec3d lowered;
      for (int d = 0; d < 3; ++d) lowered[d] = 0.5 * (slope[a](d, b) + slope[b](d, a) - slope[d](a, b));
      const Vec3d raised = raise * lowered;
      for (int c = 0; c < 3; ++c) gamma[c](a, b) = raised[c];
    }
  constexpr int kFirst[3] = {0, 0, 1}, kSecond[3] = {1, 2, 2};
  for (std::size_t m = 0; m < 3; ++m)
    for (int c = 0; c < 3; ++c)
      amplitude[m][c] =
          -2.0 * kHourglassNorm * h * h * inverse_f.col(kFirst[m]).dot(gamma[c] * inverse_f.col(kSecond[m]));
  return amplitude;
}

ElasticPoint elastic_point(const PlasticField& plastic, const Vec3d u[8], const Vec3d& x0, double h,
                           const Vec3d& local) {
  ElasticPoint p;
  const Mat3d gradient = displacement_gradient(u, gradients_at(local), h);
  if (!plastic.empty()) {
    const std::array<double, 8> shape = shape_values(local);
    p.inverse_f -= gradient;
    for (std::size_t a = 0; a < 8; ++a)
      p.place += shape[a] * (x0 + h * Vec3d(grid::kCorner[a][0], grid::kCorner[a][1], grid::kCorner[a][2]) - u[a]);
    p.strain = plastic.at(p.place);
    p.yielded = !p.strain.none;
  }
  p.elastic = deformation_from_displacement(gradient);
  p.total_stretch = p.elastic.stretch.maxCoeff();
  if (p.yielded) {
    p.metric = metric_of(p.strain.log);
    p.elastic = elastic_deformation(gradient, p.metric);
  }
  return p;
}

Hourglass hourglass_modes(const SolidRest& rest, const PlasticField& plastic, const ElasticPoint& center,
                          const Vec3d u[8], double h, double mu) {
  Hourglass modes;
  modes.stiffness = kHourglassFactor * mu * h;
  for (std::size_t m = 0; m < 4; ++m)
    for (std::size_t a = 0; a < 8; ++a) modes.amplitudes[m] -= kHourglassSign[m][a] * kHourglassNorm * u[a];
  if (!plastic.empty()) {
    const std::array<Vec3d, 3> yielded = plastic.hourglass(center.place, center.inverse_f, h);
    for (std::size_t m = 0; m < 3; ++m) modes.amplitudes[m] -= yielded[m];
  }
  for (const Vec3d& x : modes.amplitudes)
    modes.energy += 0.5 * modes.stiffness * (center.yielded ? x.dot(center.metric * x) : x.squaredNorm());
  if (plastic.empty()) return modes;
  const double yield_stress = rest.plastic.yield_stress + rest.plastic.hardening * center.strain.accumulated;
  const double strain = yield_stress / rest.elastic.mu, most = h * h * h * mu * strain * strain / 6.0;  // E_Y
  if (!(modes.energy > most)) return modes;
  const double share = std::sqrt(most / modes.energy);
  modes.stiffness *= share;  // E -> 2 sqrt(E E_Y) - E_Y
  modes.energy *= share * (2.0 - share);
  return modes;
}

bool flow(const Parallel& parallel, const SolidRest& rest, double time, int points_per_element, const SolidWork& work,
          SolidState& state) {
  if (state.plastic.empty()) return false;
  const Grid& g = state.band.grid;
  const auto corner = grid::corner_offsets(g);
  const auto points = static_cast<std::size_t>(points_per_element);
  const PlasticField plastic(rest, state);
  const std::size_t elements = work.element_corner.size();
  std::vector<PointFlow> flows(elements * points);
  constexpr std::int64_t kChunk = 256;
  const auto chunks = (static_cast<std::int64_t>(elements) + kChunk - 1) / kChunk;
  const double flowing = parallel.sum(chunks, [&](std::int64_t chunk) {
    double count = 0.0;
    const std::size_t end = std::min(elements, static_cast<std::size_t>((chunk + 1) * kChunk));
    for (auto e = static_cast<std::size_t>(chunk * kChunk); e < end; ++e) {
      const auto n = static_cast<std::size_t>(work.element_corner[e]);
      const Vec3i place = g.node_place(n);
      Vec3d u[8];
      for (std::size_t a = 0; a < 8; ++a) u[a] = state.u.at(n + corner[a]).cast<double>();
      for (std::size_t q = e * points; q < (e + 1) * points; ++q) {
        const Vec3d x0 = g.node_position(place[0], place[1], place[2]);
        flows[q] = flow_at(rest, elastic_point(plastic, u, x0, g.h, work.local_point(e, q - e * points)), time);
        count += flows[q].flows;
      }
    }
    return count;
  });
  if (!(flowing > 0.0)) return false;
  gather(parallel, rest.lattice, flows, state.plastic);
  return true;
}

double largest_plastic_strain(const SolidState& state) {
  Real largest = 0;
  for (const PlasticNode& node : state.plastic) largest = std::max(largest, node.accumulated);
  return static_cast<double>(largest);
}

}  // namespace efsi::solid
