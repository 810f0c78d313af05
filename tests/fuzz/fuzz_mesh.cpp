// Purpose: mesh files (io/mesh_reader and the plain forms). The first byte chooses the suffix; what is refused says so
// by Error, what is read has indices of its points, and objects that cover its faces.
#include <array>
#include <cstdlib>

#include "base/error.hpp"
#include "io/mesh_reader.hpp"
#include "scratch.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static constexpr std::array<const char*, 5> kSuffixes = {"obj", "ply", "stl", "off", "gltf"};
  efsi::fuzz::Input input(data, size);
  const std::string suffix = kSuffixes[input.take<std::uint8_t>() % kSuffixes.size()];
  const std::string path = efsi::fuzz::scratch("mesh." + suffix, input.data(), input.size());
  try {
    const efsi::io::PolygonMesh mesh = efsi::io::read_mesh(path);
    for (const std::int32_t index : mesh.face_vertex_indices)
      if (index < 0 || static_cast<std::size_t>(index) >= mesh.points.size()) std::abort();
    std::size_t faces = 0;
    for (const efsi::io::MeshObject& object : mesh.objects) {
      if (object.first_face != faces || object.face_count == 0) std::abort();
      faces += object.face_count;
    }
    if (faces != mesh.face_vertex_counts.size()) std::abort();
  } catch (const efsi::Error&) {
  } catch (const std::bad_alloc&) {
  } catch (const std::length_error&) {
  }
  return 0;
}
