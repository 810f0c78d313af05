// Purpose: the smallest thickness of a solid, measured by rays from its surface to the opposite one.
#pragma once

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "geometry/triangle_mesh.hpp"
#include "geometry/triangle_tree.hpp"

namespace efsi::geometry {

// Of the rays, here and in the section of a slab.
constexpr int kRays = 4000;
constexpr double kPercentile = 0.01;      // a few rays that slip into a crease do not decide
constexpr double kFacingCosine = 0.7071;  // the wedge at a sharp edge is not a thickness

// Estimate of the thinnest feature [m]: rays start at points spread evenly over the surface, run against the normal and
// end where they leave the solid through a surface that faces them within 45 degrees; the first percentile of
// their lengths. A plate gives its thickness, a ball its diameter, a box its shortest edge. 0: no ray found one.
// mesh: oriented outwards, tree: over the same mesh.
double thinnest_feature(const TriangleMesh& mesh, const TriangleTree& tree, const Parallel& parallel = Parallel(),
                        const Progress& progress = Progress());

}  // namespace efsi::geometry
