// Purpose: polygon meshes from files through assimp.
#include "io/mesh_reader.hpp"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>
#include <system_error>

#include "base/error.hpp"

namespace efsi::io {

namespace {

constexpr std::uintmax_t kMostCorners = std::numeric_limits<std::int32_t>::max();

void check_readable(const std::string& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) throw Error(ErrorCode::kIo, path + ": is a folder, not a mesh file");
  errno = 0;
  const std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorCode::kIo, path + ": cannot be read: " + std::generic_category().message(errno));
}

void append_mesh(const aiMesh& source, const aiMatrix4x4& to_scene, const std::string& path, PolygonMesh& mesh) {
  if (mesh.points.size() + source.mNumVertices > kMostCorners)
    throw Error(ErrorCode::kMesh, path + ": has more than 2147483647 points");
  const std::int32_t first = static_cast<std::int32_t>(mesh.points.size());
  for (unsigned i = 0; i < source.mNumVertices; ++i) {
    const aiVector3D p = to_scene * source.mVertices[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw Error(ErrorCode::kMesh,
                  path + ": point " + std::to_string(i) + " of mesh \"" + source.mName.C_Str() + "\" is not finite");
    mesh.points.push_back({p.x, p.y, p.z});
  }
  const bool mirrored = aiMatrix3x3(to_scene).Determinant() < 0;
  for (unsigned f = 0; f < source.mNumFaces; ++f) {
    const aiFace& face = source.mFaces[f];
    if (face.mNumIndices < 3) continue;
    mesh.face_vertex_counts.push_back(static_cast<std::int32_t>(face.mNumIndices));
    for (unsigned i = 0; i < face.mNumIndices; ++i) {
      const unsigned corner = face.mIndices[mirrored ? face.mNumIndices - 1 - i : i];
      mesh.face_vertex_indices.push_back(first + static_cast<std::int32_t>(corner));
    }
  }
}

void append_node(const aiScene& scene, const aiNode& node, const aiMatrix4x4& parent, const std::string& path,
                 PolygonMesh& mesh) {
  const aiMatrix4x4 to_scene = parent * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) append_mesh(*scene.mMeshes[node.mMeshes[i]], to_scene, path, mesh);
  for (unsigned i = 0; i < node.mNumChildren; ++i) append_node(scene, *node.mChildren[i], to_scene, path, mesh);
}

// assimp gives most formats with points of their own for every face: equal ones become one, in order of appearance.
void join_equal_points(PolygonMesh& mesh) {
  std::vector<std::int32_t> order(mesh.points.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return mesh.points[a] != mesh.points[b] ? mesh.points[a] < mesh.points[b] : a < b;
  });
  std::vector<std::int32_t> same_as(order.size()), renumbered(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool again = i > 0 && mesh.points[order[i]] == mesh.points[order[i - 1]];
    same_as[order[i]] = again ? same_as[order[i - 1]] : order[i];
  }
  std::vector<bool> used(order.size(), false);
  for (const std::int32_t index : mesh.face_vertex_indices) used[same_as[index]] = true;
  std::vector<std::array<float, 3>> points;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (!used[i]) continue;
    renumbered[i] = static_cast<std::int32_t>(points.size());
    points.push_back(mesh.points[i]);
  }
  for (std::int32_t& index : mesh.face_vertex_indices) index = renumbered[same_as[index]];
  mesh.points = std::move(points);
}

}  // namespace

PolygonMesh read_mesh(const std::string& path) {
  check_readable(path);
  Assimp::Importer importer;
  importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  const aiScene* scene = importer.ReadFile(path, aiProcess_ValidateDataStructure);
  if (scene == nullptr) throw Error(ErrorCode::kMesh, path + ": not a readable mesh: " + importer.GetErrorString());
  PolygonMesh mesh;
  if (scene->mRootNode != nullptr) append_node(*scene, *scene->mRootNode, aiMatrix4x4(), path, mesh);
  if (mesh.face_vertex_counts.empty()) throw Error(ErrorCode::kMesh, path + ": has no faces");
  join_equal_points(mesh);
  return mesh;
}

}  // namespace efsi::io
