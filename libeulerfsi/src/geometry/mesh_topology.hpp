// Purpose: how the triangles of a mesh hang together: coincident points, open and non-manifold edges, holes, parts,
// orientation.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"

namespace efsi::geometry {

// For each point the lowest index of the points that coincide with it within 1e-7 of the extents' diagonal.
std::vector<std::int32_t> weld_points(const TriangleMesh& mesh);

// The mesh with coincident points joined and triangles dropped that lost an edge by that. Point indices are those of
// the original mesh; points that are no longer used stay. kept: out, per triangle its number in the original mesh; may
// be null.
TriangleMesh weld(const TriangleMesh& mesh, std::vector<std::int32_t>* kept = nullptr);

struct Topology {
  std::uint64_t open_edges = 0;          // edges with one triangle
  std::uint64_t nonmanifold_edges = 0;   // edges with three triangles and more
  std::uint64_t inconsistent_edges = 0;  // edges with two triangles that run along it in the same direction
  std::uint64_t unbalanced_edges = 0;    // edges run along more often one way: the winding number is no integer there
  std::uint64_t holes = 0;               // closed loops of open edges
  double largest_hole = 0.0;             // length of the longest such loop [m]
  std::vector<std::int32_t> part;        // per triangle: number of its part, connected across edges, from 0
  std::int32_t parts = 0;
  std::vector<bool> part_closed;  // per part: every edge has two triangles, consistently oriented

  bool closed() const { return open_edges == 0; }
};

// Edges, holes and parts of a welded mesh.
Topology analyse_topology(const TriangleMesh& welded);

// Triangles that close a welded mesh: with them every edge is run along as often one way as the other, so that the
// winding number is whole everywhere. Each loop of unbalanced edges is filled by halving it again and again.
std::vector<Triangle> closing_triangles(const TriangleMesh& welded);

struct OrientationRepair {
  std::uint64_t reversed_triangles = 0;  // turned to agree with their neighbours
  std::int32_t turned_parts = 0;         // parts that were inside out
  bool turned_mesh = false;              // the mesh as a whole was inside out
  std::vector<std::size_t> changed;      // triangles that run the other way now than before, by all of these together
};

// Turns triangles of a welded mesh so that neighbours agree and the normals point out of the solid: the whole mesh when
// its volume is negative, then every closed part that is inside out and is not the wall of a cavity.
OrientationRepair orient_outwards(TriangleMesh& welded);

// Solids that a welded mesh consists of, which do not touch on the scale of the grid: a part inside another, or
// crossing it, is of the same one. phi: of the solid that the mesh bounds.
std::uint32_t count_separate_pieces(const TriangleMesh& welded, const Topology& topology, const SignedDistance& phi);

// A report of what the mesh is like as given; what only the solid shows is left to its builder.
MeshReport inspect(const TriangleMesh& mesh);

}  // namespace efsi::geometry
