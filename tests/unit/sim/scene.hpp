// Purpose: small scenes for the tests of whole steps.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <sstream>

#include "sim/checkpoint.hpp"
#include "sim/simulation.hpp"
#include "unit/law_lines.hpp"

namespace efsi::test {

// Of these scenes, where they say nothing else.
constexpr double kCell = 0.02;         // [m]
constexpr double kFrame = 1.0 / 24.0;  // [s]
constexpr double kGravity = 9.8;       // [m/s^2]
constexpr double kBallRadius = 0.1;    // [m]

// A sphere of bands of triangles, counter-clockwise seen from outside.
inline geometry::TriangleMesh ball_mesh(const Vec3d& center, double radius, int bands = 16) {
  constexpr double kPi = 3.14159265358979323846;
  const int around = 2 * bands;
  geometry::TriangleMesh mesh;
  mesh.points.push_back(center - Vec3d(0, 0, radius));
  for (int b = 1; b < bands; ++b)
    for (int a = 0; a < around; ++a) {
      const double t = kPi * b / bands, p = 2.0 * kPi * a / around;
      mesh.points.push_back(center +
                            radius * Vec3d(std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), -std::cos(t)));
    }
  mesh.points.push_back(center + Vec3d(0, 0, radius));
  const auto top = static_cast<std::int32_t>(mesh.points.size() - 1);
  const auto at = [&](int b, int a) { return static_cast<std::int32_t>(1 + (b - 1) * around + a % around); };
  for (int a = 0; a < around; ++a) {
    mesh.triangles.push_back({0, at(1, a + 1), at(1, a)});
    for (int b = 1; b + 1 < bands; ++b) {
      mesh.triangles.push_back({at(b, a), at(b, a + 1), at(b + 1, a + 1)});
      mesh.triangles.push_back({at(b, a), at(b + 1, a + 1), at(b + 1, a)});
    }
    mesh.triangles.push_back({top, at(bands - 1, a), at(bands - 1, a + 1)});
  }
  return mesh;
}

// A cylinder along an axis; along_x: factor of its half axis along the next one, the inverse along the third.
inline geometry::TriangleMesh cylinder_mesh(int axis, const Vec3d& center, double radius, double length,
                                            double along_x = 1.0) {
  constexpr int kAround = 48;
  constexpr double kTurn = 2.0 * 3.14159265358979323846;
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  geometry::TriangleMesh mesh;
  const auto point = [&](double r, double turn, double at) {
    Vec3d x = center;
    x[axis] += at;
    x[u] += along_x * r * std::cos(turn);
    x[v] += r * std::sin(turn) / along_x;
    mesh.points.push_back(x);
  };
  for (const double at : {-0.5 * length, 0.5 * length}) {
    point(0.0, 0.0, at);
    for (int i = 0; i < kAround; ++i) point(radius, kTurn * i / kAround, at);
  }
  for (int i = 0; i < kAround; ++i) {
    const int a = 1 + i, b = 1 + (i + 1) % kAround, top = kAround + 1;
    mesh.triangles.insert(mesh.triangles.end(),
                          {{0, b, a}, {top, top + a, top + b}, {a, b, top + b}, {a, top + b, top + a}});
  }
  return mesh;
}

// A box of air at rest, slip walls.
inline sim::Params box_params(const Vec3d& size, double h = kCell) {
  sim::Params p;
  p.domain_size = size;
  p.voxel_size = h;
  p.gravity = {0, -kGravity, 0};
  p.threads = 1;
  return p;
}

// The same box without fluid.
inline sim::Params vacuum(const Vec3d& size, double h = kCell) {
  sim::Params p = box_params(size, h);
  p.fluid.present = false;
  return p;
}

// The same box without weight, with fluid or without.
inline sim::Params still(const Vec3d& size, double h = kCell, bool fluid = true) {
  sim::Params p = box_params(size, h);
  p.gravity.setZero();
  p.fluid.present = fluid;
  return p;
}

inline sim::Params still_vacuum(const Vec3d& size, double h = kCell) { return still(size, h, false); }

// A solid of the material that solids have by themselves.
inline sim::SolidDesc desc_of(geometry::TriangleMesh mesh) {
  sim::SolidDesc d;
  d.surface = std::move(mesh);
  return d;
}

// The authors' ball: lambda 5000 Pa, mu 10000 Pa, 1000 kg/m^3.
inline sim::SolidDesc ball_desc(const Vec3d& center, double radius = kBallRadius) {
  sim::SolidDesc d = desc_of(ball_mesh(center, radius));
  d.density = 1000.0;
  d.youngs_modulus = 1e4 * (3 * 5000.0 + 2e4) / 1.5e4;
  d.poissons_ratio = 1.0 / 6.0;
  return d;
}

// A simulation that notes for a law test how it was run.
struct NoteConditions {
  void operator()(sim::Simulation* s) const {
    const sim::State& state = s->state();
    std::ostringstream text;
    text << "h " << s->params().voxel_size << " m";
    if (state.steps > 0) text << ", dt " << state.time / static_cast<double>(state.steps) << " s (mean)";
    text << ", " << (s->params().numerics.uses_particles() ? "paper2016" : "production");
    note_conditions(text.str());
    delete s;
  }
};
using SimulationPtr = std::unique_ptr<sim::Simulation, NoteConditions>;

inline SimulationPtr make_simulation(const sim::Params& p, const std::vector<sim::SolidDesc>& solids = {}) {
  SimulationPtr s(new sim::Simulation(p, Log{}));
  geometry::MeshReport report;
  for (const auto& d : solids) s->add_solid(d, report);
  return s;
}

inline void advance_to(sim::Simulation& s, double time) {
  while (s.state().time < time - 1e-9) s.step(time - s.state().time);
}

// In steps of at most `most`.
inline void advance_by(sim::Simulation& s, double time, double most) {
  const double end = s.state().time + time;
  while (end - s.state().time > 1e-9) s.step(std::min(most, end - s.state().time));
}

// The same values at every call, within range / 2 of 0.
inline std::vector<float> noise(std::size_t count, float range) {
  std::vector<float> values(count);
  std::uint32_t state = 12345;
  for (float& x : values) {
    state = state * 1664525u + 1013904223u;
    x = range * (static_cast<float>(state >> 8) / 16777216.0f - 0.5f);
  }
  return values;
}

inline bool all_finite(const sim::State& state) {
  const auto check = [](const std::vector<Real>& v) {
    for (Real x : v)
      if (!std::isfinite(x)) return false;
    return true;
  };
  bool good = check(state.fluid.pressure) && check(state.fluid.smoke);
  for (const auto& c : state.fluid.velocity.c) good = good && check(c);
  for (const auto& s : state.solids)
    for (std::size_t a = 0; a < 3; ++a) good = good && check(s.u.c[a]) && check(s.v.c[a]);
  return good;
}

inline geometry::TriangleMesh block(const Vec3d& center, const Vec3d& half) {
  geometry::TriangleMesh mesh;
  for (int c = 0; c < 8; ++c)
    mesh.points.push_back(center + half.cwiseProduct(Vec3d(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1)));
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

}  // namespace efsi::test
