// Purpose: all voxels of a grid of a .vdb file from voxel 0 on, for comparisons.
#pragma once

#include <string>
#include <vector>

#include "io/vdb_io.hpp"

namespace efsi::io {

inline std::vector<float> vdb_values(const std::string& path, const std::string& grid, const Vec3i& size) {
  const VdbFile file(path);
  std::vector<float> values(static_cast<std::size_t>(file.info(grid).components) * size[0] * size[1] * size[2]);
  file.read(grid, {0, 0, 0}, size, 1, values);
  return values;
}

}  // namespace efsi::io
