// Purpose: the nodes of solids on grids that are ever coarser by a factor of two, each solid in a box of its own:
// bodies that touch share no node.
#pragma once

#include <cstdint>
#include <vector>

#include "base/math_types.hpp"
#include "base/parallel.hpp"

namespace efsi::system {

class VelocitySystem;

// Nodes are numbered solid by solid, x fastest. An even number of cells along an axis is halved: coarser node i lies on
// finer node 2i. Around an odd number the coarser cells reach half a cell beyond both ends: node i lies at 2i - 1/2. So
// what is its own mirror image stays that on all levels.
struct SolidLattice {
  struct Box {
    Vec3i nodes{0, 0, 0};
    std::size_t first = 0;  // place of its node (0, 0, 0) in `id`
  };
  struct Place {
    std::size_t box;
    Vec3i at;
  };

  double h = 1.0;  // [m]
  std::vector<Box> boxes;
  // Per node of the boxes.
  std::vector<std::int32_t> id;       // -1: no node of the solid
  std::vector<std::uint8_t> carries;  // the cell above it holds a part of an element
  std::vector<Real> lambda, mu;       // of the elements in that cell, in G, times their volume [kg m^2]
  // Per id.
  std::vector<Place> place;
  std::vector<double> mass;         // [kg]
  std::vector<std::uint8_t> moves;  // bit a: along axis a not all of its children are constrained

  std::size_t size() const { return place.size(); }
  std::size_t index(const Box& box, const Vec3i& at) const {
    return box.first + static_cast<std::size_t>(at[0]) +
           static_cast<std::size_t>(box.nodes[0]) *
               (static_cast<std::size_t>(at[1]) +
                static_cast<std::size_t>(box.nodes[1]) * static_cast<std::size_t>(at[2]));
  }
  static bool inside(const Box& box, const Vec3i& at) {
    for (std::size_t a = 0; a < 3; ++a)
      if (at[a] < 0 || at[a] >= box.nodes[a]) return false;
    return true;
  }
};

// How the nodes of one lattice follow from those of the next coarser one: trilinear interpolation P, and P^T by lists
// of its own, so that both gather.
struct Interpolation {
  std::vector<std::int32_t> parent_begin, parent;  // of the finer nodes
  std::vector<std::int32_t> child_begin, child;    // of the coarser nodes
  std::vector<Real> parent_weight, child_weight;
  std::size_t bytes() const {
    return (parent_begin.size() + parent.size() + child_begin.size() + child.size()) * sizeof(std::int32_t) +
           (parent_weight.size() + child_weight.size()) * sizeof(Real);
  }
};

// The unknowns of the solids for which `wanted` holds; the boxes of the others are empty.
SolidLattice finest_lattice(const Parallel& parallel, const VelocitySystem& system,
                            const std::vector<std::uint8_t>& wanted);
// The next coarser one.
SolidLattice coarsen(const Parallel& parallel, const SolidLattice& fine, Interpolation& from);

}  // namespace efsi::system
