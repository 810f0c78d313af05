// Purpose: the velocity of the fluid one node behind the surfaces along which it slips, for its transport.
// Departs from the paper: there one velocity per node is transported, and nothing slips.
#pragma once

#include <vector>

#include "base/parallel.hpp"
#include "grid/grid.hpp"
#include "system/slip.hpp"

namespace efsi::sim {

// Nodes without fluid beside slip nodes, ascending; none on faces of the box. What arrives at a surface that advances
// comes from there: with the solid's velocity the fluid that slips would be dragged along.
class FluidBehind {
 public:
  // specific_volume: per node, of fluid fluid_volume, slip nodes among it.
  FluidBehind(const Parallel& parallel, const grid::Grid& g, const system::SlipNodes& slip,
              const std::vector<Real>& specific_volume, Real fluid_volume);
  const std::vector<std::size_t>& nodes() const { return nodes_; }
  // Their values.
  std::vector<Vec3> values(const Parallel& parallel, const grid::VectorField& field) const;
  // Gives them the mean of the fluid around them, weighed by the inverse fourth power of its distance.
  void extend(const Parallel& parallel, grid::VectorField& field) const;
  void set(const Parallel& parallel, const std::vector<Vec3>& values, grid::VectorField& field) const;

 private:
  template <class Body>
  void visit_fluid(std::size_t node, const Body& body) const;

  const grid::Grid& g_;
  const std::vector<Real>& specific_volume_;
  Real fluid_volume_;
  std::vector<std::size_t> nodes_;
};

}  // namespace efsi::sim
