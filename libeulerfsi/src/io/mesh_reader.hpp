// Purpose: polygon meshes from files (obj, ply, stl, gltf, glb, fbx, ...) through assimp.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace efsi::io {

struct PolygonMesh {
  std::vector<std::array<float, 3>> points;       // in the file's own units and axes
  std::vector<std::int32_t> face_vertex_counts;   // corners per face, at least 3
  std::vector<std::int32_t> face_vertex_indices;  // corners of all faces, 0-based
};

// All meshes of the file's scene as one, each placed by the transform of its node (a mesh that is used twice comes
// twice; a mirroring transform keeps the outside out). Equal points are one point; faces with fewer than three corners
// (points, lines) are left out. path: UTF-8.
// Throws Error(kIo) for a file that is missing or cannot be read, Error(kMesh) for one that assimp does not understand
// or that has no faces; the message names the path and the reason.
PolygonMesh read_mesh(const std::string& path);

}  // namespace efsi::io
