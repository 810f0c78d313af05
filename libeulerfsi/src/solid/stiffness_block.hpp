// Purpose: the stiffness of kBlock elements at once, one element per lane; element_stiffness is its slow twin.
// Paper: Sec. 4.2; Eq. 8.
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "solid/solid.hpp"

namespace efsi::solid {

inline constexpr int kBlock = 16;  // elements

// The linearised material at one quadrature point of each element, as in ElementPoint.
struct PointBlock {
  Real axes[9][kBlock];    // (i, j) at i + 3 j
  Real normal[6][kBlock];  // [J]
  Real pair[9][kBlock];    // pair p, entry e at 3 p + e [J]
};

struct StiffnessBlocks {
  int points = 1;  // per element
  std::vector<PointBlock> point;
  std::vector<Real> hourglass;  // per element [N/m]
  std::size_t count() const { return hourglass.size() / static_cast<std::size_t>(kBlock); }
  std::size_t bytes() const { return point.size() * sizeof(PointBlock) + hourglass.size() * sizeof(Real); }
};

// Packs a solid's elements; the lanes that the last block leaves free have no stiffness.
void pack_blocks(const Parallel& parallel, const SolidWork& work, StiffnessBlocks& blocks);
// out = factor K x for one block; x, out: corner a, component i of each element at row 3 a + i.
void block_stiffness(const StiffnessBlocks& blocks, std::size_t block, double h, Real factor,
                     const Real (&x)[24][kBlock], Real* out);

}  // namespace efsi::solid
