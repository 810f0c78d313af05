// Purpose: structs that callers of the C API pass (capi/definition, capi/sized, capi/mesh_view): of any size and any
// content, in memory that is exactly as large as they say.
#include <memory>

#include "capi/convert.hpp"
#include "capi/definition.hpp"
#include "capi/mesh_view.hpp"
#include "capi/sized.hpp"
#include "scratch.hpp"

using namespace efsi::capi;
using efsi::fuzz::Input;

namespace {

constexpr std::size_t kHeader = 8;  // struct_size, magic

// A definition as an init function leaves it, over which the input is laid, from some byte on.
template <class Def>
void definition(Input& input, const auto& convert) {
  const std::size_t size = input.take<std::uint16_t>(), from = input.take<std::uint16_t>();
  const std::size_t held = std::max(size, kHeader);
  const std::unique_ptr<unsigned char[]> bytes(new unsigned char[held]());
  Def* def = reinterpret_cast<Def*>(bytes.get());
  if (initialise(def, size) == EFSI_OK && from < size)
    std::memcpy(bytes.get() + from, input.data(), std::min(size - from, input.size()));
  std::uint32_t said = 0;
  std::memcpy(&said, bytes.get(), sizeof(said));
  if (said > held) {  // a caller's lie about its memory, unless it is refused before that is read
    if (said <= sizeof(Def)) return;
  }
  convert(receive(def, "def"));
}

void mesh(Input& input) {
  EfsiMeshView view{};
  const std::uint8_t has = input.take<std::uint8_t>();
  view.point_count = input.take<std::uint64_t>();
  view.point_stride = input.take<std::uint64_t>();
  view.face_count = input.take<std::uint64_t>();
  view.index_count = input.take<std::uint64_t>();
  // Arrays as large as the counts say, where that is little; larger ones must be refused by their counts alone.
  const auto some = [](std::uint64_t count, std::uint64_t bytes) {
    return count < 1024 && bytes < 1024 ? count * bytes : 0;
  };
  std::vector<unsigned char> points(some(view.point_count, view.point_stride ? view.point_stride : 12));
  std::vector<std::int32_t> counts(some(view.face_count, 1)), indices(some(view.index_count, 1));
  const bool larger = (view.point_count && points.empty()) || (view.face_count && counts.empty()) ||
                      (view.index_count && indices.empty());
  if (larger && view.point_count <= 0x7fffffff && view.index_count <= 0x7fffffff) return;
  for (unsigned char& byte : points) byte = input.take<std::uint8_t>();
  for (std::int32_t& count : counts) count = input.take<std::int32_t>();
  for (std::int32_t& index : indices) index = input.take<std::int32_t>();
  if (has & 1) view.points = reinterpret_cast<const float*>(points.data());
  if (has & 2) view.face_vertex_counts = counts.data();
  if (has & 4) view.face_vertex_indices = indices.data();
  read_view(view, "mesh");
}

// Results and arrays of structs of another version's size.
void sized(Input& input) {
  const std::size_t size = input.take<std::uint16_t>(), count = input.take<std::uint8_t>() % 8;
  std::vector<unsigned char> out(size), keys(size * count);
  for (unsigned char& byte : keys) byte = input.take<std::uint8_t>();
  if (size <= sizeof(EfsiEmitterKey))
    for (std::size_t i = 0; i < count; ++i) take(reinterpret_cast<const EfsiEmitterKey*>(keys.data()), size, i);
  give(EfsiMeshReport{}, reinterpret_cast<EfsiMeshReport*>(out.data()), size, "give");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  try {
    switch (input.take<std::uint8_t>() % 7) {
      case 0:
        definition<EfsiSimulationDef>(input, to_params);
        break;
      case 1:
        definition<EfsiSolidDef>(input, to_solid);
        break;
      case 2:
        definition<EfsiEmitterDef>(input, to_emitter);
        break;
      case 3:
        definition<EfsiForceDef>(input, to_force);
        break;
      case 4:
        definition<EfsiVdbDef>(input, [](const EfsiVdbDef&) {});
        break;
      case 5:
        mesh(input);
        break;
      default:
        sized(input);
    }
  } catch (const efsi::Error&) {
  }
  return 0;
}
