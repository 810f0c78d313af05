// Purpose: a solid alone in a box: the state that it starts with, what it is loaded by, and the period of its swing.
#pragma once

#include "unit/sim/scene.hpp"

namespace efsi::test {

// Calls value(position of the node, component) for every value of a node field of the solid's band.
template <class Value>
std::vector<float> band_field(const sim::Simulation& s, const Value& value) {
  const grid::Grid& g = s.state().solids[0].band.grid;
  const std::size_t nodes = g.node_count();
  std::vector<float> out(3 * nodes);
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        for (std::size_t a = 0; a < 3; ++a)
          out[a * nodes + g.node(i, j, k)] = static_cast<float>(value(g.node(i, j, k), g.node_position(i, j, k), a));
  return out;
}

// u = x - X of X = c + F^-1 (x - c), F = diag(stretch).
inline void stretch(sim::Simulation& s, const Vec3d& center, const Vec3d& stretch) {
  const auto u = band_field(s, [&](std::size_t, const Vec3d& x, std::size_t a) {
    const auto i = static_cast<Eigen::Index>(a);
    return (x[i] - center[i]) * (1.0 - 1.0 / stretch[i]);
  });
  s.set_solid_field(0, false, u.data());
}

// Mean square of the points' distance to their centroid along x, less that along the other axes [m^2].
inline double elongation(const std::vector<Vec3d>& points) {
  Vec3d mean = Vec3d::Zero(), square = Vec3d::Zero();
  for (const Vec3d& x : points) mean += x / static_cast<double>(points.size());
  for (const Vec3d& x : points) square += (x - mean).cwiseAbs2() / static_cast<double>(points.size());
  return square[0] - 0.5 * (square[1] + square[2]);
}

// Gives the solid the velocity that a force per mass of `push`(place, axis) adds in steps of dt, until it is at rest.
template <class Push>
void load(sim::Simulation& s, double dt, int steps, const Push& push) {
  for (int n = 0; n < steps; ++n) {
    const auto& v = s.state().solids[0].v;
    const auto pushed = band_field(s, [&](std::size_t node, const Vec3d& x, std::size_t a) {
      return static_cast<double>(v.c[a][node]) + dt * push(x, a);
    });
    s.set_solid_field(0, true, pushed.data());
    REQUIRE(s.step(dt).dt == Approx(dt));
  }
}

// A time [s] after each of the first three sign changes of measure(), in steps of a part of the period at which they
// are expected; each(): after a step. Two in the same direction are a period.
template <class Measure, class Each>
std::vector<double> sign_changes(sim::Simulation& s, double period, double steps, const Measure& measure,
                                 const Each& each) {
  std::vector<double> times;
  double last = measure();
  while (times.size() < 3 && s.state().time < 2.0 * period) {
    s.step(period / steps);
    const double now = measure(), t = s.state().time;
    if (now * last < 0.0) times.push_back(t - period / steps * now / (now - last));
    last = now;
    each();
  }
  return times;
}

}  // namespace efsi::test
