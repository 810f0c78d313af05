// Purpose: volume fractions and mass of a solid on the grid, and which cells carry its stiffness.
// Paper: Alg. 1 line 3.
//   fraction_c: exact cut of the cell by the plane that the rest distance field has there, carried to the world
//   mass_c = rho0 det(F^-1) fraction_c h^3
// Departs from the paper: mass of a cut cell goes to those of its corners that carry stiffness (docs/deviations.md).
#pragma once

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

// A cell carries stiffness when more than a part of it is solid: little, so that what enters is little and what is thin
// holds together.
inline constexpr Threshold kElementPart = {Real(0.3), Real(0.1)};
// The corners of the solid's cells are what a fluid sees of it; at 0.5 its added mass is that of a ball larger by a
// quarter of a cell (docs/lab/stiffness-support.md). So in a fluid the cells from
// kElementPart up to here are a solid's only where the fluid is thin beside it and its bulk stiffness is the
// pressure's; else, where the fluid is light, they are slivers: elements whose cell is not the solid's.
inline constexpr Threshold kElementPartInFluid = {Real(0.6), Real(0.1)};
inline constexpr double kLightFluid = 1.0 / 3.0;  // of the solid's density: its pressure misses little on slivers
// Of what is thin at rest so little makes a sliver, too. One that drops out would tie its neighbours no more, and
// return strained as they have come apart.
inline constexpr Real kSliverPart = Real(0.05);

// Beside a collider the rest of a cell is the contact's skin, which the solid never fills. Where it has more than
// kLeastRoom of the cell, kRoomPart of that suffices: what enters later is strained as its neighbours, which had to
// carry without it.
inline constexpr double kLeastRoom = 0.6, kRoomPart = 0.5;

// Reads state.u; writes fraction, volume_ratio, element, element_cell, element_corner, carries, mass, volume,
// total_mass. Counted in cells the mass of a ball wavers by some 0.2 % as it moves over the grid, that of a thin box by
// 10 %, of a fold by 3 %; a solid that is whole keeps what it weighs (rest.mass_volume, once that is known).
void compute_mass(const Parallel& parallel, const SolidRest& rest, const SolidState& state, SolidWork& work);

// Of the stiffness against change of volume that the pressure has in an element, over the material's. In vacuum the
// empty part of a cut cell offers no resistance; in a fluid it does, and all elements represent the body with one
// weight. 0 in slivers.
double bulk_weight(const SolidRest& rest, const SolidWork& work, std::size_t e);

// Keeps which cells carry stiffness for the next compute_mass, and whether its choice lags: state.stiff.
void remember_elements(const SolidWork& work, bool lag, SolidState& state);
// Likewise the room beside a collider in a cell of the box, 0 to 1; nothing outside the band.
void remember_room(const Vec3i& cell, double room, SolidState& state);

}  // namespace efsi::solid
