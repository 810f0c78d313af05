// Purpose: the divergence that the pressure is asked for, so that solids keep their volume.
// Paper: b of Eq. 11.
#pragma once

#include "contact/hold.hpp"
#include "frame/scene.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

// Cells that are no solid's.
double count_fluid_cells(const grid::Grid& g, const SolidWorks& solids);
// Takes `share` off the source of each of them.
void take_from_fluid(const Parallel& parallel, const Matter& matter, Real share, std::vector<Real>& source);

// How fast what is solid of a cell is asked to come back to the volume that it should have: to det F of 1, or of a
// compressible solid to its dilatation [1/s].
double return_rate(double dt, const solid::SolidWork& work, std::size_t cell);

// Where det F has drifted from 1 the solid is asked to grow or shrink back, slowly, since det F is rough at the
// surface. What a solid has lost as a whole its inside gains in the same step. What solids gain the fluid of the box
// loses, so that the sum vanishes. Writes `source`, wanted divergence per padded cell [1/s], and the solids'
// next_volume.
void compute_volume_source(const Parallel& parallel, const Scene& scene, double dt, const SolidStates& states,
                           const Holds& holds, const Matter& matter, SolidWorks& solids, std::vector<Real>& source);

}  // namespace efsi::sim
