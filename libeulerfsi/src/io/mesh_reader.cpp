// Purpose: polygon meshes from files through assimp.
#include "io/mesh_reader.hpp"

#include <assimp/BaseImporter.h>
#include <assimp/DefaultIOSystem.h>
#include <assimp/MemoryIOWrapper.h>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <new>
#include <numeric>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "base/error.hpp"
#include "io/plain_obj.hpp"
#include "io/plain_off.hpp"
#include "io/plain_ply.hpp"
#include "io/plain_stl.hpp"

namespace efsi::io {

namespace {

constexpr std::array<std::string_view, 9> kSuffixes = {"obj", "ply", "stl", "off", "gltf", "glb", "fbx", "dae", "3ds"};
constexpr std::uintmax_t kMostCorners = std::numeric_limits<std::int32_t>::max();

void check_readable(const std::string& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) throw Error(ErrorCode::kIo, path + ": is a folder, not a mesh file");
  errno = 0;
  if (std::filesystem::exists(path, code) && !std::filesystem::is_regular_file(path, code))
    throw Error(ErrorCode::kIo, path + ": is a device or a pipe, not a mesh file");
  const std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorCode::kIo, path + ": cannot be read: " + std::generic_category().message(errno));
}

// "obj" of "Ball.OBJ".
std::string suffix_of(const std::string& path) {
  std::string suffix = std::filesystem::path(path).extension().string();
  for (char& c : suffix) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return suffix.empty() ? suffix : suffix.substr(1);
}

void check_suffix(const std::string& path, const std::string& suffix) {
  if (std::find(kSuffixes.begin(), kSuffixes.end(), suffix) != kSuffixes.end()) return;
  std::string list;
  for (const std::string_view known : kSuffixes) list += (list.empty() ? "" : ", ") + std::string(known);
  throw Error(ErrorCode::kMesh, path + ": the name of a mesh file must end in one of: " + list);
}

bool reads(const aiImporterDesc& description, const std::string& suffix) {
  std::istringstream list(description.mFileExtensions);
  std::string known;
  while (list >> known)
    if (known == suffix) return true;
  return false;
}

// assimp guesses the format from the content where the suffix's own reader gives up. The suffix shall decide: all other
// readers go.
void keep_only(Assimp::Importer& importer, const std::string& suffix) {
  for (std::size_t i = importer.GetImporterCount(); i-- > 0;) {
    Assimp::BaseImporter* reader = importer.GetImporter(i);
    if (reads(*importer.GetImporterInfo(i), suffix) || importer.UnregisterLoader(reader) != aiReturn_SUCCESS) continue;
    delete reader;
  }
}

// "Ball 1.bin" of "Ball%201.bin".
std::string percent_decoded(const std::string& text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    int code = 0;
    const char* digits = text.data() + i + 1;
    if (text[i] == '%' && i + 2 < text.size() && std::from_chars(digits, digits + 2, code, 16).ptr == digits + 2) {
      decoded += static_cast<char>(code);
      i += 2;
    } else {
      decoded += text[i];
    }
  }
  return decoded;
}

// The names of files in a .gltf are URIs, which assimp takes as they are.
class UriFileSystem : public Assimp::DefaultIOSystem {
 public:
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    return DefaultIOSystem::Open(Exists(file) ? file : percent_decoded(file).c_str(), mode);
  }
};

// One file, of a given text.
class TextFileSystem : public Assimp::DefaultIOSystem {
 public:
  TextFileSystem(const std::string& path, const std::string& text) : path_(path), text_(text) {}
  Assimp::IOStream* Open(const char* file, const char*) override {
    if (file != path_) return nullptr;
    return new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(text_.data()), text_.size());
  }

 private:
  const std::string& path_;
  const std::string& text_;
};

// assimp catches what its readers throw. Want of memory is no fault of the file's form.
void rethrow_want_of_memory(const std::exception_ptr& error) {
  try {
    if (error) std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::length_error&) {
    throw;
  } catch (...) {
  }
}

struct Source {
  const aiScene& scene;
  const std::string& path;
  const std::vector<std::string>* names;  // of objects, by number; nullptr: nodes have their own
};

// assimp has names in angle brackets for what has none in the file.
std::string name_of(const aiNode& node, const std::vector<std::string>* names) {
  const std::string_view name(node.mName.C_Str());
  if (!names) return name.starts_with('<') ? "" : std::string(name);
  std::size_t number = names->size();
  std::from_chars(name.data(), name.data() + name.size(), number);
  return number < names->size() ? (*names)[number] : "";
}

void append_mesh(const aiMesh& source, const aiMatrix4x4& to_scene, const std::string& name, const std::string& path,
                 PolygonMesh& mesh) {
  if (mesh.points.size() + source.mNumVertices > kMostCorners)
    throw Error(ErrorCode::kMesh, path + ": has more than 2147483647 points");
  const std::int32_t first = static_cast<std::int32_t>(mesh.points.size());
  for (unsigned i = 0; i < source.mNumVertices; ++i) {
    const aiVector3D p = to_scene * source.mVertices[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw Error(ErrorCode::kMesh, path + ": point " + std::to_string(i) + " of mesh \"" + name + "\" is not finite");
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

void append_node(const Source& source, const aiNode& node, const aiMatrix4x4& parent, PolygonMesh& mesh) {
  const aiMatrix4x4 to_scene = parent * node.mTransformation;
  const std::string name = name_of(node, source.names);
  const std::size_t first = mesh.face_vertex_counts.size();
  for (unsigned i = 0; i < node.mNumMeshes; ++i)
    append_mesh(*source.scene.mMeshes[node.mMeshes[i]], to_scene, name, source.path, mesh);
  const std::size_t count = mesh.face_vertex_counts.size() - first;
  if (count > 0) mesh.objects.push_back({name, first, count});
  for (unsigned i = 0; i < node.mNumChildren; ++i) append_node(source, *node.mChildren[i], to_scene, mesh);
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

// The file in a plain form; none: assimp reads it itself. names: of the objects of an .obj file.
std::optional<std::string> plain_text(const std::string& path, const std::string& suffix,
                                      std::vector<std::string>& names) {
  if (suffix == "obj") return plain_obj(path, names);
  if (suffix == "ply") return plain_ply(path);
  if (suffix == "off") return plain_off(path);
  if (suffix == "stl") return plain_stl(path);
  return {};
}

}  // namespace

PolygonMesh read_mesh(const std::string& path) {
  check_readable(path);
  const std::string suffix = suffix_of(path);
  check_suffix(path, suffix);
  std::vector<std::string> names;
  const std::optional<std::string> plain = plain_text(path, suffix, names);
  Assimp::Importer importer;
  keep_only(importer, suffix);
  // The importer deletes it.
  importer.SetIOHandler(plain ? static_cast<Assimp::IOSystem*>(new TextFileSystem(path, *plain)) : new UriFileSystem);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  const aiScene* scene = importer.ReadFile(path, aiProcess_ValidateDataStructure);
  if (scene == nullptr) {
    rethrow_want_of_memory(importer.GetException());
    throw Error(ErrorCode::kMesh, path + ": not a readable ." + suffix + " file: " + importer.GetErrorString());
  }
  PolygonMesh mesh;
  if (scene->mRootNode != nullptr)
    append_node({*scene, path, suffix == "obj" ? &names : nullptr}, *scene->mRootNode, aiMatrix4x4(), mesh);
  if (mesh.face_vertex_counts.empty()) throw Error(ErrorCode::kMesh, path + ": has no faces");
  join_equal_points(mesh);
  return mesh;
}

}  // namespace efsi::io
