// Purpose: motion of a solid's reference map and of its own velocity.
// Paper: Alg. 1 lines 13 (velocity), 18 (extension), 19 (u += dt v), 20 (semi-Lagrangian advection of u); Sec. 4.3.
//   u^{n+1}(x) = u^n(x_d) + (x - x_d), x_d the point from which the solid's velocity leads to x
// Departs from the paper: the back-trace is third order, in a frame that moves with the solid, and the advection is
// corrected (MacCormack) and takes v along (docs/deviations.md). The paper's method (particles carry v,
// solid/particles/particles.hpp; u + dt v, then linear semi-Lagrangian) is AdvectionScheme::kPaper.
#pragma once

#include <array>

#include "base/parallel.hpp"
#include "grid/boundary.hpp"
#include "grid/packed_field.hpp"
#include "solid/momentum.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

enum class AdvectionScheme : std::int32_t { kMacCormack = 0, kPaper = 1 };

// Line 13: takes the solid's velocity from the global field at the nodes that carry it: state.v, work.max_speed;
// work.layer is 0 there and none elsewhere. dt: length of the step, of which state.change keeps what the velocity
// changed by; 0: nothing is kept.
void take_velocity(const Parallel& parallel, const Grid& global, double dt, const VectorField& velocity,
                   SolidState& state, SolidWork& work);
// Line 18: extends u, v and the change of v from these nodes outwards; work.layer: by which layer.
void extend(const Parallel& parallel, const SolidRest& rest, SolidState& state, SolidWork& work);

// Packed fields of the band, shared by the solids: u, and v seen from the frame, before the advection; x_d; u and v
// after its first sweep, and half the error of that. The fourth value of an error is 1 where it is known, 0 elsewhere.
struct AdvectWorkspace {
  grid::PackedField u, v, from, first_u, first_v, error_u, error_v;
  static constexpr std::array kFields = {
      &AdvectWorkspace::u,       &AdvectWorkspace::v,       &AdvectWorkspace::from,   &AdvectWorkspace::first_u,
      &AdvectWorkspace::first_v, &AdvectWorkspace::error_u, &AdvectWorkspace::error_v};
  grid::PackedField& change() { return error_u; }  // of v, until the errors are measured
  void reserve(std::size_t nodes) {
    for (const auto field : kFields) (this->*field).reserve(nodes);
  }
  // Five that may live in arrays of others from advect() to predict_surface().
  std::array<std::vector<Real>*, 5> storage() {
    return {&first_u.storage(), &first_v.storage(), &from.storage(), &u.storage(), &v.storage()};
  }
  std::size_t bytes() const {
    std::size_t sum = 0;
    for (const auto field : kFields) sum += (this->*field).bytes();
    return sum;
  }
};

// Lines 19, 20 for u, and, but for kPaper, the transport of v and of its change by the same trace. Marks the nodes that
// hold data afterwards. frame: the velocity field keeps its shape for the step in a frame with this motion, against
// which its velocity is seen; at rest: in that of the grid, as always in kPaper. Elastic waves ride on the solid: where
// the field stays on the grid while the solid moves, a wave's displacement gets out of step with its velocity by half
// of what the solid moves, and waves that run with it grow (docs/numerics/transport-frame.md).
void advect(const Parallel& parallel, AdvectionScheme scheme, double dt, const BodyStep& frame, const SolidWork& work,
            SolidState& state, AdvectWorkspace& packed);
// Where the same motion takes the vertices of the embedded surface; packed: as the advection leaves it.
void predict_surface(const Parallel& parallel, double dt, const BodyStep& frame, const AdvectWorkspace& packed,
                     SolidState& state);

// Material in the middle of a cell of the band, by the mean of u at its corners.
Vec3d material_in_cell(const SolidState& state, const Vec3i& cell);

// Largest difference of a velocity component between neighbouring band nodes, both of them marked, over h [1/s].
double largest_strain_rate(const Parallel& parallel, const SolidState& state, const std::vector<std::uint8_t>& marked);

// By its velocity.
CellMotion measure_motion(const Parallel& parallel, const SolidRest& rest, const SolidState& state);

// Re-centres the band around the nodes that hold data and are inside the solid.
void follow_solid(const Grid& global, const SolidRest& rest, SolidState& state);

}  // namespace efsi::solid
