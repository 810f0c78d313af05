// Purpose: a scene of a solid from a closed form, and a second one that is a single vertex.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "contact/solid_contact.hpp"
#include "unit/sim/scene.hpp"
#include "unit/solid/ball.hpp"

namespace efsi::test {

struct TwoSolids {
  TestSolid body;  // its state counts, not what is made of it
  sim::Params params;
  std::vector<solid::SolidRest> rests;
  sim::SolidStates states;
  std::vector<fluid::Emitter> emitters;
  std::vector<sim::ForceField> forces;
  std::vector<sim::Pin> pins;
  sim::Scene scene{params, body.global, rests, emitters, forces, pins};

  explicit TwoSolids(TestSolid solid) : body(std::move(solid)) {
    rests = {body.rest, body.rest};
    states = {body.state, body.state};
  }
  TwoSolids(const TwoSolids&) = delete;
  TwoSolids& operator=(const TwoSolids&) = delete;

  // Solid 1 is a vertex at x that moves by v; solid 0 is what `body` is now.
  void place_vertex(const Vec3d& x, const Vec3d& v) {
    states[0].u = body.state.u;
    states[0].valid = body.state.valid;
    states[1].surface = {x};
    for (std::size_t a = 0; a < 3; ++a)
      std::fill(states[1].v.c[a].begin(), states[1].v.c[a].end(), static_cast<Real>(v[static_cast<Eigen::Index>(a)]));
  }
  void look(const sim::VisitVertex& visit) const { sim::visit_vertices(scene, states, 1, 0, visit); }
};

}  // namespace efsi::test
