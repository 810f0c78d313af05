// Purpose: the distance from every node of a grid to a triangle mesh, without a sign, and to another mesh that is made
// of parts of the first one and more.
#pragma once

#include <functional>
#include <vector>

#include "base/parallel.hpp"
#include "base/progress.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"

namespace efsi::geometry {

class DistanceToMesh {
 public:
  // The nodes of `grid` within three spacings of the mesh learn which triangle is nearest (OpenVDB). The bits of all
  // that follows depend on meshes and grid alone.
  DistanceToMesh(const TriangleMesh& mesh, const SignedDistance& grid, const Parallel& parallel = Parallel(),
                 const Progress& progress = Progress());

  // Fills grid.values with the distance [m]: to 0.01 spacings within 1.5 spacings, at most three spacings farther away.
  void measure_near(SignedDistance& grid, const Parallel& parallel = Parallel()) const;

  // Goes over to another mesh, which consists of `kept` triangles, parts of those of the old mesh, and new ones of at
  // most about one spacing. same_part(triangle, X): the triangle of the new mesh at the point X [m] of a triangle of
  // the old one, -1 where nothing of it is kept; called from many threads.
  using SamePart = std::function<std::int32_t(std::int32_t triangle, const Vec3d& X)>;
  void replace_mesh(const TriangleMesh& mesh, std::size_t kept, const SamePart& same_part, const Parallel& parallel);

  // Carries the nearest triangles through the grid and fills grid.values with the distance [m]: exactly within three
  // spacings of the mesh and to 2 % farther away, to 4 % from a mesh that replaced another.
  void measure(SignedDistance& grid, const Parallel& parallel = Parallel(), const Progress& progress = Progress());

 private:
  // A point of the mesh that is near a node, and its triangle; -1: none is known yet.
  struct Foot {
    float x, y, z;
    std::int32_t triangle;
  };
  struct Run {
    std::size_t begin, end;  // triangles
    Extents box;
  };
  class Sweep;

  std::size_t index(int i, int j, int k) const {
    return static_cast<std::size_t>(i) +
           static_cast<std::size_t>(size_[0]) * (j + static_cast<std::size_t>(size_[1]) * k);
  }
  Vec3d nearest_point(std::int32_t triangle, const Vec3d& node) const;
  void take(std::size_t at, const Vec3d& node, std::int32_t triangle);
  void find_runs(std::size_t kept);
  template <class Wants>
  void offer(double reach, const Wants& wants, const Parallel& parallel);
  template <class Visit>
  void for_each_node(const Parallel& parallel, const Visit& visit) const;

  TriangleMesh mesh_;  // in index space of the grid, as all coordinates below
  Vec3i size_;
  Vec3d origin_;    // [m]
  double spacing_;  // [m]
  std::vector<Foot> feet_;
  std::vector<float> squared_;  // distances to the feet
  std::vector<Run> runs_;       // of triangles that lie together
};

}  // namespace efsi::geometry
