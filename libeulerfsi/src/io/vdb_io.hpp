// Purpose: OpenVDB files from dense arrays, and read back for clients that show smoke, without OpenVDB in the
// interface.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/math_types.hpp"

namespace efsi::io {

// A cell-centred field on a regular grid of cells, as the caller holds it. Component c of cell (i, j, k) is
// data[c][i * stride[0] + j * stride[1] + k * stride[2]] (strides in floats); it becomes voxel (i, j, k).
struct DenseGrid {
  std::string name;    // "density", "temperature": fog volumes; "vel": velocity
  int components = 1;  // 1: float grid; 3: vec3s grid
  Vec3i size = {0, 0, 0};
  std::array<const float*, 3> data = {nullptr, nullptr, nullptr};
  std::array<std::ptrdiff_t, 3> stride = {0, 0, 0};
  // Name of a one-component grid of the same size in the same file: this grid is active where that one is. Empty:
  // active where the value itself is above the threshold.
  std::string mask;
};

struct VdbOptions {
  // Row-major 4x4 for column vectors: index space (voxel centres at integers) to world space.
  std::array<double, 16> index_to_world = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  bool half_float = false;           // store 16-bit floats
  std::string creator = "eulerfsi";  // program and version, stored with the file and every grid
  double threshold = 0.0;            // a voxel is active where |value| (of a vector: its length) is above it
  Vec3i low = {0, 0, 0};             // and in this box of voxels, without `high`
  Vec3i high = {std::numeric_limits<int>::max(), std::numeric_limits<int>::max(), std::numeric_limits<int>::max()};
};

// Writes one .vdb with all grids, under a temporary name in the same folder, flushed to disk and renamed: `path` holds
// either what it held before or the whole new file. Inactive voxels are the background 0; a grid without active voxels
// is written as well. Returns a 64-bit hash of grid names, types, transforms, active voxels and their values as stored;
// it does not depend on the order of grids. The id in the file's header is a UUID made from that hash, where OpenVDB
// puts a random one: the same grids and options give the same bytes. Throws Error(kArgument) for grids that cannot be
// written (empty name, size, unknown mask, singular transform), Error(kIo) naming path and reason, Error(kInternal)
// where OpenVDB cannot encode them or writes an unknown header; then no file is left behind.
std::uint64_t write_vdb(const std::string& path, std::span<const DenseGrid> grids, const VdbOptions& options);

struct VdbGridSummary {
  std::string name;
  std::string type;         // "float", "vec3s"
  std::string grid_class;   // "Fog Volume", "Other"
  std::string vector_type;  // "contravariant relative", ...
  bool half_float = false;
  std::uint64_t active_voxels = 0;
  std::array<double, 3> min = {0, 0, 0}, max = {0, 0, 0};  // over active voxels, per component
  std::array<double, 16> index_to_world = {};              // as in VdbOptions
};

struct VdbSummary {
  std::string creator;
  std::vector<VdbGridSummary> grids;  // in the order of the file
  std::uint64_t content_hash = 0;     // as write_vdb returned it
};

// Throws Error(kIo), naming path and reason, for a file that cannot be read, has no checksum or another one.
VdbSummary read_vdb_summary(const std::string& path);

struct VdbGridInfo {
  Vec3i min = {0, 0, 0}, size = {0, 0, 0};  // box of the active voxels
  int components = 1;                       // 1 or 3
  std::array<double, 16> index_to_world{};  // row-major, voxel centres at integers
  std::uint64_t active_voxels = 0;
};

// A file that write_vdb has written, whole in memory. OpenVDB's reader trusts what it reads; here the checksum in the
// file is compared first, so that it never meets a file that is damaged or cut short.
class VdbFile {
 public:
  // Throws as read_vdb_summary.
  explicit VdbFile(const std::string& path);
  ~VdbFile();

  // Both throw Error(kArgument) for a grid that is not there, with the names of those that are.
  VdbGridInfo info(const std::string& grid) const;
  // Cell (i, j, k) of a box of `size` cells of coarsen^3 voxels each, the first one at voxel `min`: the mean over its
  // voxels, of a vector over its active ones. Component c is values[c + components * (i + size[0] * (j + size[1] *
  // k))]. Throws Error(kArgument) too where `values` is too short or the box too large.
  void read(const std::string& grid, const Vec3i& min, const Vec3i& size, int coarsen, std::span<float> values) const;

 private:
  struct Grids;
  const std::string path_;
  std::unique_ptr<Grids> grids_;
};

}  // namespace efsi::io
