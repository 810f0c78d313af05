// Purpose: how much of an element's stiffness is implicit (Eq. 8), and how viscous it is.
// Departs from the paper: all of it is (docs/deviations.md).
#pragma once

namespace efsi::system {

// What stands for K v* in Eq. 8: ahead K v* - behind K v^n + memory K (v^n - v^(n-1)). {1, 0} is backward Euler, {1/4,
// 1/4} the trapezoidal rule. Without memory a linear material is stable from ahead + behind = 1/2 on, and a mode of
// frequency omega loses (ahead - behind) (omega dt)^2 of its energy in a step (docs/numerics/stiffness-shares.md).
struct StiffnessShares {
  double ahead = 1.0, behind = 0.0, memory = 0.0;
};
// Nearly undamped; but ahead grows to 0.6 and behind vanishes where elastic waves pass more than a cell or so in the
// step, where it strains the solid much, and where a cell has grown or shrunk much; where waves pass many cells ahead
// is 1. pace: cells that waves pass in the step; growth: largest factor of a cell's volume, or its inverse.
StiffnessShares stiffness_shares(double pace, double strain, double growth);
// While nothing but walls holds the solid: less of both, and more damped the more it is strained. load: its elastic
// energy over mu times its volume.
StiffnessShares stiffness_shares_on_walls(double pace, double growth, double load);

// Of an element of a solid that keeps its volume, over dt times its stiffness: none while it is off it by less than
// two fifths, as in any impact; beyond a half it is crushed, and what repairs it shall not set it in motion. Clay,
// which does not rebound, is so from a tenth and a fifth on. volume: over that at rest (docs/numerics/repair.md).
double crushed_viscosity(double volume, bool yields);

}  // namespace efsi::system
