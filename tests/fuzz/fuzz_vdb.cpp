// Purpose: .vdb files read back (io/vdb_io, io/vdb_checksum). The first byte chooses: a file of any bytes, which must
// not get past the checksum, or a box of any numbers in a file that is whole.
#include "base/error.hpp"
#include "io/vdb_io.hpp"
#include "scratch.hpp"

namespace {

using efsi::io::VdbFile;

// 4 x 3 x 2 voxels of smoke and of velocity.
const VdbFile& whole_file() {
  static const VdbFile file = [] {
    std::vector<float> values(24);
    for (std::size_t n = 0; n < values.size(); ++n) values[n] = static_cast<float>(n % 5);
    efsi::io::DenseGrid density;
    density.name = "density";
    density.size = {4, 3, 2};
    density.stride = {1, 4, 12};
    density.data[0] = values.data();
    efsi::io::DenseGrid velocity = density;
    velocity.name = "vel";
    velocity.components = 3;
    velocity.data = {values.data(), values.data(), values.data()};
    velocity.mask = "density";
    const std::string path = efsi::fuzz::scratch("whole.vdb", "", 0);
    efsi::io::write_vdb(path, std::array{density, velocity}, {});
    return VdbFile(path);
  }();
  return file;
}

void read_box(efsi::fuzz::Input& input) {
  const std::uint8_t which = input.take<std::uint8_t>();
  const auto numbers = input.take<std::array<std::int32_t, 7>>();
  std::vector<float> values(input.take<std::uint16_t>());
  const VdbFile& file = whole_file();
  const char* name = which % 4 == 0 ? "none" : which % 2 ? "density" : "vel";
  file.info(name);
  file.read(name, {numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5]}, numbers[6], values);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  efsi::fuzz::Input input(data, size);
  const bool box = input.take<std::uint8_t>() % 2 == 0;
  try {
    if (box) {
      read_box(input);
    } else {
      efsi::io::read_vdb_summary(efsi::fuzz::scratch("file.vdb", input.data(), input.size()));
    }
  } catch (const efsi::Error&) {
  }
  return 0;
}
