// Purpose: polygon meshes from files (obj, ply, stl, off, gltf, glb, fbx, dae, 3ds) through assimp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace efsi::io {

// Faces that follow each other.
struct MeshObject {
  std::string name;  // as the file has it, often not unique; "" where it has none
  std::size_t first_face, face_count;
};

struct PolygonMesh {
  std::vector<std::array<float, 3>> points;       // in the file's own units and axes
  std::vector<std::int32_t> face_vertex_counts;   // corners per face, at least 3
  std::vector<std::int32_t> face_vertex_indices;  // corners of all faces, 0-based
  std::vector<MeshObject> objects;                // each face belongs to one
};

// All meshes of the file's scene as one, each placed by the transform of its node (a mesh that is used twice comes
// twice; a mirroring transform keeps the outside out). Equal points are one point; faces with fewer than three corners
// (points, lines) are left out. A node with faces is an object, in an .obj file what `o` begins, or `g` where there is
// no `o`. path: UTF-8; its suffix, in upper or lower case, decides how the file is read. Files that it names (arrays of
// a .gltf, materials of an .obj) are looked for beside it. Throws Error(kIo) for a file that is missing or cannot be
// read, Error(kMesh) for another suffix, for a file that assimp does not understand, that announces more than it holds
// or that has no faces, Error(kMemory) for one that needs more memory than there is; the message names the path and the
// reason. assimp was not made for hostile files: one can make it crash or go on for very long, so a file that is not
// trusted is best read in a process of its own.
PolygonMesh read_mesh(const std::string& path);

}  // namespace efsi::io
