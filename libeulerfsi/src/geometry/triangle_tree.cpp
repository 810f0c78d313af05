// Purpose: a tree of boxes over triangles that answers winding numbers and rays.
#include "geometry/triangle_tree.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace efsi::geometry {

namespace {

constexpr double kFarFactor = 2.0;  // a node is far when X is farther than this many radii

// Beyond this many half edges of a cube the field of a node is smooth enough to be interpolated in the cube.
constexpr double kSmoothFactor = 2.5;
constexpr std::size_t kManyPoints = 128;  // from here on an interpolation is worth it
constexpr std::size_t kFewPoints = 16;    // up to here a cube is not divided
constexpr std::int64_t kFewNear = 8;      // nodes close to a cube that is not divided

// atan2 to 1e-9 by the Taylor series after one halving of the angle: the bits are the same on every machine, which
// those of the C library are not.
double arc_tangent(double y, double x) {
  const double low = std::min(std::abs(x), std::abs(y)), high = std::max(std::abs(x), std::abs(y));
  if (high == 0.0) return 0.0;
  constexpr double kTangentOfEighth = 0.41421356237309503;  // tan(pi / 8)
  const bool upper = low > kTangentOfEighth * high;
  const double t = upper ? (low - high) / (low + high) : low / high, s = t * t;
  constexpr double kSeries[] = {1.0 / 21, 1.0 / 19, 1.0 / 17, 1.0 / 15, 1.0 / 13, 1.0 / 11,
                                1.0 / 9,  1.0 / 7,  1.0 / 5,  1.0 / 3,  1.0};
  double series = 0.0;
  for (const double coefficient : kSeries) series = coefficient - s * series;
  double angle = (upper ? std::numbers::pi / 4.0 : 0.0) + t * series;
  if (std::abs(y) > std::abs(x)) angle = std::numbers::pi / 2.0 - angle;
  if (x < 0.0) angle = std::numbers::pi - angle;
  return y < 0.0 ? -angle : angle;
}

// Solid angle of a triangle over 4 pi (van Oosterom and Strackee 1983), positive behind the triangle.
double winding_of_triangle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double numerator = a.dot(b.cross(c));
  const double denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  return arc_tangent(numerator, denominator) / (2.0 * std::numbers::pi);
}

// Adds the third term of the series of a triangle, corners from the centre of expansion: 15/2 of the integral of
// (n . r) (d . r)^2 over its points d, as a form in r and without its part that is a multiple of r^2, which the field
// does not have.
void add_second_moment(const Vec3d& a, const Vec3d& b, const Vec3d& c, CubicForm& form) {
  const Vec3d n = 7.5 * 0.5 * (b - a).cross(c - a), sum = a + b + c;
  const Mat3d d = (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose()) / 12.0;
  const Vec3d x = n.x() * Vec3d(d(0, 0), 2.0 * d(0, 1), 2.0 * d(0, 2)) + d(0, 0) * Vec3d(0.0, n.y(), n.z());
  const Vec3d y = n.y() * Vec3d(2.0 * d(1, 0), d(1, 1), 2.0 * d(1, 2)) + d(1, 1) * Vec3d(n.x(), 0.0, n.z());
  const Vec3d z = n.z() * Vec3d(2.0 * d(2, 0), 2.0 * d(2, 1), d(2, 2)) + d(2, 2) * Vec3d(n.x(), n.y(), 0.0);
  // x, y, z: coefficients with x^2, y^2, z^2.
  const Vec3d squares = (x + y + z + 2.0 * Vec3d(x.x(), y.y(), z.z())) / 5.0;
  const Vec3d p = x - squares, q = y - squares, s = z - squares;
  const double mixed = 2.0 * (n.x() * d(1, 2) + n.y() * d(2, 0) + n.z() * d(0, 1));
  const CubicForm more = {p.x(), q.y(), s.z(), p.y(), p.z(), q.x(), q.z(), s.x(), s.y(), mixed};
  for (std::size_t i = 0; i < form.size(); ++i) form[i] += more[i];
}

// Slab test of a box against a ray from `origin`; 1/0 = inf stands for a ray parallel to a slab.
bool ray_meets_box(const Vec3d& origin, const Vec3d& inverse, const Vec3d& min, const Vec3d& max) {
  double enter = 0.0, leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    double near = (min[axis] - origin[axis]) * inverse[axis];
    double far = (max[axis] - origin[axis]) * inverse[axis];
    if (near > far) std::swap(near, far);
    if (near > enter) enter = near;  // a NaN (0 * inf: origin on the slab) leaves the range as it is
    if (far < leave) leave = far;
  }
  return enter <= leave;
}

}  // namespace

TriangleTree::TriangleTree(const TriangleMesh& mesh, std::int32_t leaf_size) : leaf_size_(leaf_size) {
  corners_.reserve(mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    corners_.push_back({mesh.points[t[0]], mesh.points[t[1]], mesh.points[t[2]], static_cast<std::int32_t>(i)});
  }
  nodes_.reserve(4 * corners_.size() / static_cast<std::size_t>(leaf_size_) + 1);
  if (!corners_.empty()) build(0, static_cast<std::int32_t>(corners_.size()));
}

void TriangleTree::build(std::int32_t begin, std::int32_t end) {
  const std::size_t index = nodes_.size();
  nodes_.emplace_back();
  Node node;
  node.begin = begin;
  node.end = end;
  node.right = 0;
  node.min = Vec3d::Constant(std::numeric_limits<double>::infinity());
  node.max = -node.min;
  node.area_normal.setZero();
  node.moment.setZero();
  node.second_moment.fill(0.0);
  // The box, and the sums of areas.
  Vec3d weighted = Vec3d::Zero(), low = node.min, high = node.max;
  double area = 0.0;
  for (std::int32_t i = begin; i < end; ++i) {
    const Corners& t = corners_[i];
    node.min = node.min.cwiseMin(t.a).cwiseMin(t.b).cwiseMin(t.c);
    node.max = node.max.cwiseMax(t.a).cwiseMax(t.b).cwiseMax(t.c);
    const Vec3d middle = (t.a + t.b + t.c) / 3.0, vector_area = 0.5 * (t.b - t.a).cross(t.c - t.a);
    low = low.cwiseMin(middle);
    high = high.cwiseMax(middle);
    weighted += vector_area.norm() * middle;
    area += vector_area.norm();
    node.area_normal += vector_area;
  }
  node.centre = area > 0.0 ? Vec3d(weighted / area) : Vec3d(0.5 * (node.min + node.max));
  // Moments about the centre of area, for the series of far nodes.
  double radius_squared = 0.0;
  for (std::int32_t i = begin; i < end; ++i) {
    const Corners& t = corners_[i];
    node.moment += ((t.a + t.b + t.c) / 3.0 - node.centre) * (0.5 * (t.b - t.a).cross(t.c - t.a)).transpose();
    add_second_moment(t.a - node.centre, t.b - node.centre, t.c - node.centre, node.second_moment);
    for (const Vec3d& X : {t.a, t.b, t.c}) radius_squared = std::max(radius_squared, (X - node.centre).squaredNorm());
  }
  node.far_distance_squared = kFarFactor * kFarFactor * radius_squared;

  if (end - begin > leaf_size_) {
    // Halves by the order of the triangle centres along the longest side; equal centres by index, so that the tree
    // depends on the mesh alone.
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const std::int32_t middle = begin + (end - begin) / 2;
    const auto before = [axis](const Corners& s, const Corners& t) {
      const double p = s.a[axis] + s.b[axis] + s.c[axis], q = t.a[axis] + t.b[axis] + t.c[axis];
      return p != q ? p < q : s.triangle < t.triangle;
    };
    std::nth_element(corners_.begin() + begin, corners_.begin() + middle, corners_.begin() + end, before);
    build(begin, middle);
    node.right = static_cast<std::int32_t>(nodes_.size());
    build(middle, end);
  }
  nodes_[index] = node;
}

double TriangleTree::winding_number(const Vec3d& X) const {
  double near = 0.0, far = 0.0;
  std::int32_t stack[64];
  int top = 0;
  if (!nodes_.empty()) stack[top++] = 0;
  while (top > 0) {
    const std::int32_t index = stack[--top];
    const Node& node = nodes_[index];
    const Vec3d r = node.centre - X;
    const double distance_squared = r.squaredNorm();
    if (distance_squared > node.far_distance_squared) {
      // N . r / |r|^3, its first derivative along the spread of the triangles: (tr M - 3 r.M r / r^2) / |r|^3, and its
      // second derivative: C(r) / r^4 / |r|^3
      double bend = node.moment.trace() - 3.0 * r.dot(node.moment * r) / distance_squared;
      bend += cubic_form(node.second_moment, r.x(), r.y(), r.z()) / (distance_squared * distance_squared);
      far += (node.area_normal.dot(r) + bend) / (distance_squared * std::sqrt(distance_squared));
    } else if (node.right == 0) {
      for (std::int32_t i = node.begin; i < node.end; ++i)
        near += winding_of_triangle(corners_[i].a - X, corners_[i].b - X, corners_[i].c - X);
    } else {
      stack[top++] = node.right;
      stack[top++] = index + 1;
    }
  }
  return near + far / (4.0 * std::numbers::pi);
}

// Points of a cube and what was summed up at them.
struct TriangleTree::Targets {
  std::vector<Vec3d> points;
  std::vector<double> winding;
  std::vector<bool> on_surface;
};

// Adds the winding numbers of the nodes `sources` and all below. What is not far from the cube is left to its eighths,
// which are farther from it for their size.
void TriangleTree::add_winding(const Vec3d& centre, double half, const std::vector<std::int32_t>& sources,
                               Targets& targets) const {
  WindingSum sum(centre, targets.points);
  const bool interpolate = targets.points.size() >= kManyPoints;
  std::vector<Vec3d> support;
  if (interpolate) support = CubeInterpolation::support(centre, half);
  WindingSum smooth(centre, support);
  const double radius = std::sqrt(3.0) * half, smooth_distance = kSmoothFactor * half;
  std::int64_t near_triangles = 0;
  // Walk through the tree: far nodes by their series, others are collected in `near`.
  std::vector<std::int32_t> near, stack(sources.rbegin(), sources.rend());
  const bool divide = targets.points.size() > kFewPoints;
  while (!stack.empty()) {
    const std::int32_t index = stack.back();
    stack.pop_back();
    const Node& node = nodes_[index];
    const double distance = (node.centre - centre).norm(), nearest = std::max(0.0, distance - radius);
    if (nearest * nearest > node.far_distance_squared) {
      (interpolate && distance > smooth_distance ? smooth : sum)
          .add_far(node.centre, node.area_normal, node.moment, node.second_moment);
    } else if (node.right == 0 || (divide && radius * radius > node.far_distance_squared)) {
      near.push_back(index);  // the cube is large for the node
      near_triangles += node.end - node.begin;
    } else {
      stack.push_back(node.right);
      stack.push_back(index + 1);
    }
  }
  // Near triangles are summed exactly, or are left to the eighths of the cube.
  const bool eighths = divide && near_triangles > kFewNear;
  if (!eighths) {
    for (const std::int32_t index : near) {
      const Node& node = nodes_[index];
      for (std::int32_t i = node.begin; i < node.end; ++i) sum.add_near(corners_[i].a, corners_[i].b, corners_[i].c);
    }
  }
  sum.add_to(targets.winding, targets.on_surface);
  // What varies smoothly in the cube is interpolated.
  if (interpolate) {
    std::vector<double> values(support.size(), 0.0);
    std::vector<bool> none(support.size(), false);
    smooth.add_to(values, none);
    const CubeInterpolation interpolation(centre, half, values);
    for (std::size_t i = 0; i < targets.points.size(); ++i) targets.winding[i] += interpolation.at(targets.points[i]);
  }
  if (!eighths) return;
  // The same for each eighth of the cube with its points.
  std::array<std::vector<std::size_t>, 8> members;
  for (std::size_t i = 0; i < targets.points.size(); ++i) {
    const Vec3d& X = targets.points[i];
    members[(X.x() > centre.x()) | (X.y() > centre.y()) << 1 | (X.z() > centre.z()) << 2].push_back(i);
  }
  for (int c = 0; c < 8; ++c) {
    Targets eighth;
    for (const std::size_t i : members[c]) {
      eighth.points.push_back(targets.points[i]);
      eighth.winding.push_back(targets.winding[i]);
      eighth.on_surface.push_back(targets.on_surface[i]);
    }
    if (eighth.points.empty()) continue;
    const Vec3d way(c & 1 ? 0.5 : -0.5, c & 2 ? 0.5 : -0.5, c & 4 ? 0.5 : -0.5);
    add_winding(centre + half * way, 0.5 * half, near, eighth);
    for (std::size_t m = 0; m < members[c].size(); ++m) {
      targets.winding[members[c][m]] = eighth.winding[m];
      targets.on_surface[members[c][m]] = eighth.on_surface[m];
    }
  }
}

void TriangleTree::winding_numbers(const Vec3d& centre, double half, const std::vector<Vec3d>& points,
                                   std::vector<double>& winding, std::vector<bool>& on_surface) const {
  Targets targets{points, std::vector<double>(points.size(), 0.0), std::vector<bool>(points.size(), false)};
  if (!nodes_.empty() && !points.empty()) add_winding(centre, half, {0}, targets);
  winding = std::move(targets.winding);
  on_surface = std::move(targets.on_surface);
}

namespace {

// On which side of the directed edge p -> q the line from `origin` along `direction` passes: the same answer for both
// directions of an edge, up to the sign.
bool passes_left(const Vec3d& p, const Vec3d& q, const Vec3d& origin, const Vec3d& direction) {
  const bool ordered = std::lexicographical_compare(p.data(), p.data() + 3, q.data(), q.data() + 3);
  const Vec3d &low = ordered ? p : q, &high = ordered ? q : p;
  return (direction.dot((low - origin).cross(high - origin)) > 0.0) == ordered;
}

}  // namespace

// Calls visit(corners) for the triangles of the leaves whose boxes, and those above them, meets(node) lets pass.
template <class Meets, class Visit>
void TriangleTree::for_corners(const Meets& meets, const Visit& visit) const {
  std::int32_t stack[64];
  int top = 0;
  if (!nodes_.empty()) stack[top++] = 0;
  while (top > 0) {
    const std::int32_t index = stack[--top];
    const Node& node = nodes_[index];
    if (!meets(node)) continue;
    if (node.right != 0) {
      stack[top++] = node.right;
      stack[top++] = index + 1;
      continue;
    }
    for (std::int32_t i = node.begin; i < node.end; ++i) visit(corners_[i]);
  }
}

int TriangleTree::winding_change(const Vec3d& from, const Vec3d& to) const {
  const Vec3d low = from.cwiseMin(to), high = from.cwiseMax(to), direction = to - from;
  int change = 0;
  const auto meets = [&](const Node& node) {
    return !(low.array() > node.max.array()).any() && !(high.array() < node.min.array()).any();
  };
  for_corners(meets, [&](const Corners& t) {
    const Vec3d normal = (t.b - t.a).cross(t.c - t.a);
    const bool from_front = normal.dot(from - t.a) > 0.0, to_front = normal.dot(to - t.a) > 0.0;
    if (from_front == to_front) return;
    const bool left = passes_left(t.a, t.b, from, direction);
    if (left == passes_left(t.b, t.c, from, direction) && left == passes_left(t.c, t.a, from, direction))
      change += to_front ? -1 : 1;
  });
  return change;
}

void TriangleTree::cast(const Vec3d& origin, const Vec3d& direction, std::vector<Hit>& hits) const {
  hits.clear();
  const Vec3d inverse = direction.cwiseInverse();
  const auto meets = [&](const Node& node) { return ray_meets_box(origin, inverse, node.min, node.max); };
  for_corners(meets, [&](const Corners& corner) {
    // Moller-Trumbore: origin + t direction = a + u e1 + v e2
    const Vec3d e1 = corner.b - corner.a, e2 = corner.c - corner.a, normal = e1.cross(e2);
    const double slope = direction.dot(normal);
    if (slope == 0.0) return;
    const Vec3d from_a = origin - corner.a;
    const double t = -from_a.dot(normal) / slope;
    const Vec3d turned = direction.cross(from_a);
    const double u = e2.dot(turned) / slope, v = -e1.dot(turned) / slope;
    if (t > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0) hits.push_back({t, slope / normal.norm(), corner.triangle});
  });
  std::sort(hits.begin(), hits.end(), [](const Hit& s, const Hit& t) {
    return s.distance != t.distance ? s.distance < t.distance : s.triangle < t.triangle;
  });
}

}  // namespace efsi::geometry
