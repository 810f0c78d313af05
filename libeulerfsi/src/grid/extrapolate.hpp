// Purpose: linear extension of node fields outwards, layer by layer, by weighted least squares.
// Reference: Rycroft et al. 2020 (reference map technique); weights 1/r^4, times what the data weigh, over a box of 7^3
// nodes (docs/numerics/extension.md). Layer k reads only layers below k, so the nodes of a layer are independent of
// each other.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"

namespace efsi::grid {

inline constexpr std::uint8_t kNoLayer = 255;

// How much the data of nodes count: node[n] / whole, 0.01 at least and 1 at most; without nodes 1.
struct DataWeights {
  std::span<const Real> node;
  Real whole = 1;
};

// layer: in 0 at nodes that hold data and kNoLayer elsewhere; out k at the nodes of layer k = 1..layers (reached
// through the 26 neighbours). fields: node arrays, extended in place; finite everywhere. What has been extended
// weighs 1.
void extend_linear(const Parallel& parallel, const Grid& g, int layers, std::vector<std::uint8_t>& layer,
                   std::span<Real* const> fields, const DataWeights& data = {});

}  // namespace efsi::grid
