#include "io/vdb_io.hpp"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <unordered_set>

#include "base/error.hpp"
#include "io/file_writer.hpp"
#include "io/vdb_checksum.hpp"

namespace efsi::io {

namespace {

using openvdb::FloatGrid;
using openvdb::Vec3SGrid;

constexpr float kLargestHalf = 65504.0f;
constexpr const char* kCreatorKey = "creator";

// ---- values

// The nearest value that the file can hold.
float stored(float value, bool half) {
  if (!half) return value;
  return static_cast<float>(openvdb::math::half(std::clamp(value, -kLargestHalf, kLargestHalf)));
}

template <class Value>
Value value_at(const DenseGrid& grid, std::ptrdiff_t offset, bool half);
template <>
float value_at<float>(const DenseGrid& grid, std::ptrdiff_t offset, bool half) {
  return stored(grid.data[0][offset], half);
}
template <>
openvdb::Vec3s value_at<openvdb::Vec3s>(const DenseGrid& grid, std::ptrdiff_t offset, bool half) {
  return {stored(grid.data[0][offset], half), stored(grid.data[1][offset], half), stored(grid.data[2][offset], half)};
}

std::ptrdiff_t offset_of(const DenseGrid& grid, int i, int j, int k) {
  return i * grid.stride[0] + j * grid.stride[1] + k * grid.stride[2];
}

// Is the value itself above the threshold? Not a number is not.
bool above(const DenseGrid& grid, int i, int j, int k, double threshold) {
  const std::ptrdiff_t at = offset_of(grid, i, j, k);
  double square = 0.0;
  for (int c = 0; c < grid.components; ++c) square += static_cast<double>(grid.data[c][at]) * grid.data[c][at];
  return square > threshold * threshold;
}

bool in_box(const VdbOptions& options, int i, int j, int k) {
  const Vec3i &low = options.low, &high = options.high;
  return i >= low[0] && j >= low[1] && k >= low[2] && i < high[0] && j < high[1] && k < high[2];
}

// Fills the grid leaf by leaf with the voxels that are active in `mask`.
template <class Grid>
void fill(Grid& vdb, const DenseGrid& grid, const DenseGrid& mask, const VdbOptions& options) {
  using Leaf = typename Grid::TreeType::LeafNodeType;
  constexpr int kDim = static_cast<int>(Leaf::DIM);
  const auto& size = grid.size;
  for (int z = 0; z < size[2]; z += kDim) {
    for (int y = 0; y < size[1]; y += kDim) {
      for (int x = 0; x < size[0]; x += kDim) {
        Leaf* leaf = nullptr;
        for (int i = x; i < std::min(x + kDim, size[0]); ++i) {
          for (int j = y; j < std::min(y + kDim, size[1]); ++j) {
            for (int k = z; k < std::min(z + kDim, size[2]); ++k) {
              if (!in_box(options, i, j, k) || !above(mask, i, j, k, options.threshold)) continue;
              const openvdb::Coord at(i, j, k);
              if (leaf == nullptr) leaf = vdb.tree().touchLeaf(at);
              leaf->setValueOn(at,
                               value_at<typename Grid::ValueType>(grid, offset_of(grid, i, j, k), options.half_float));
            }
          }
        }
      }
    }
  }
  vdb.pruneGrid();
}

// ---- transforms: OpenVDB's matrices multiply row vectors

openvdb::math::Transform::Ptr to_transform(const std::array<double, 16>& m) {
  openvdb::Mat4d transposed;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) transposed(column, row) = m[4 * row + column];
  const double determinant = transposed.getMat3().det();
  if (!std::isfinite(determinant) || determinant == 0.0 || m[12] != 0.0 || m[13] != 0.0 || m[14] != 0.0 || m[15] != 1.0)
    throw Error(ErrorCode::kArgument,
                "VDB: index_to_world must be affine (last row 0 0 0 1) and invertible, determinant " +
                    std::to_string(determinant));
  // The simplest map that does it: readers know a uniform scale with translation best, and small voxels fit.
  const double scale = m[0];
  const bool uniform = scale > 0.0 && m[5] == scale && m[10] == scale && m[1] == 0.0 && m[2] == 0.0 && m[4] == 0.0 &&
                       m[6] == 0.0 && m[8] == 0.0 && m[9] == 0.0;
  if (uniform)
    return std::make_shared<openvdb::math::Transform>(openvdb::math::MapBase::Ptr(
        new openvdb::math::UniformScaleTranslateMap(scale, openvdb::Vec3d(m[3], m[7], m[11]))));
  try {
    return std::make_shared<openvdb::math::Transform>(
        openvdb::math::simplify(std::make_shared<openvdb::math::AffineMap>(transposed)));
  } catch (const openvdb::ArithmeticError&) {
    throw Error(ErrorCode::kArgument, "VDB: index_to_world has the determinant " + std::to_string(determinant) +
                                          ": too small for a grid that is turned");
  }
}

// Index space to world space, row-major for column vectors.
std::array<double, 16> from_transform(const openvdb::math::Transform& transform) {
  const openvdb::Mat4d transposed = transform.baseMap()->getAffineMap()->getMat4();
  std::array<double, 16> m;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) m[4 * row + column] = transposed(column, row);
  return m;
}

// ---- content hash

// One step of a 64-bit hash (the finalizer of SplitMix64).
std::uint64_t mix(std::uint64_t state, std::uint64_t word) {
  std::uint64_t z = (state ^ word) + 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

std::uint64_t mix(std::uint64_t state, const std::string& text) {
  state = mix(state, text.size());
  for (const char c : text) state = mix(state, static_cast<unsigned char>(c));
  return state;
}

std::array<float, 3> components_of(float value) { return {value, 0.0f, 0.0f}; }
std::array<float, 3> components_of(const openvdb::Vec3s& value) { return {value[0], value[1], value[2]}; }

// What a grid holds: bounds, number and hash of its active voxels. The hash is a sum over voxels, so that it does not
// depend on how the tree groups them.
template <class Grid>
void summarize(const Grid& grid, VdbGridSummary& summary, std::uint64_t& hash) {
  const double infinity = std::numeric_limits<double>::infinity();
  std::array<double, 3> low = {infinity, infinity, infinity}, high = {-infinity, -infinity, -infinity};
  std::uint64_t sum = 0;
  const int components = std::is_same_v<Grid, FloatGrid> ? 1 : 3;
  for (auto value = grid.cbeginValueOn(); value; ++value) {
    const std::array<float, 3> c = components_of(*value);
    std::uint64_t bits = 0;
    for (int n = 0; n < components; ++n) {
      low[n] = std::min(low[n], static_cast<double>(c[n]));
      high[n] = std::max(high[n], static_cast<double>(c[n]));
      bits = mix(bits, std::bit_cast<std::uint32_t>(c[n]));
    }
    openvdb::CoordBBox box;
    value.getBoundingBox(box);
    for (auto at = box.begin(); at; ++at) {
      const std::uint64_t x = static_cast<std::uint32_t>((*at).x()), y = static_cast<std::uint32_t>((*at).y());
      sum += mix(mix(bits, x << 32 | y), static_cast<std::uint32_t>((*at).z()));
      ++summary.active_voxels;
    }
  }
  if (summary.active_voxels > 0) {
    std::copy_n(low.begin(), components, summary.min.begin());
    std::copy_n(high.begin(), components, summary.max.begin());
  }
  hash = mix(mix(hash, sum), summary.active_voxels);
}

VdbGridSummary summarize(const openvdb::GridBase& grid, std::uint64_t& content_hash) {
  VdbGridSummary summary;
  summary.name = grid.getName();
  summary.type = grid.valueType();
  summary.grid_class = openvdb::GridBase::gridClassToMenuName(grid.getGridClass());
  summary.vector_type = openvdb::GridBase::vecTypeToString(grid.getVectorType());
  summary.half_float = grid.saveFloatAsHalf();
  summary.index_to_world = from_transform(grid.transform());
  std::uint64_t hash = mix(mix(0, summary.name), summary.type);
  // Adding 0 makes -0 and 0 the same.
  for (const double entry : summary.index_to_world) hash = mix(hash, std::bit_cast<std::uint64_t>(entry + 0.0));
  if (const auto* scalar = dynamic_cast<const FloatGrid*>(&grid)) summarize(*scalar, summary, hash);
  if (const auto* vector = dynamic_cast<const Vec3SGrid*>(&grid)) summarize(*vector, summary, hash);
  content_hash += hash;
  return summary;
}

// ---- files

// A UUID of version 8 (RFC 9562: its bits mean what the program says) made from a content hash.
std::string to_uuid(std::uint64_t content_hash) {
  constexpr int kTextSize = 36;
  const std::uint64_t high = mix(0, content_hash), low = mix(high, content_hash);
  char text[kTextSize + 1];
  std::snprintf(text, sizeof(text), "%08x-%04x-8%03x-%04x-%012llx", static_cast<unsigned>(high >> 32),
                static_cast<unsigned>(high >> 16 & 0xffff), static_cast<unsigned>(high & 0xfff),
                static_cast<unsigned>(0x8000 | (low >> 48 & 0x3fff)),
                static_cast<unsigned long long>(low & 0xffffffffffff));
  return text;
}

// OpenVDB's own File does not notice a full disk; this archive writes to memory and the bytes go to disk with checks.
class MemoryArchive : public openvdb::io::Archive {
 public:
  // The bytes of the file. OpenVDB puts a random id into its header; `id`, as long as that one, takes its place.
  std::string bytes(const openvdb::GridCPtrVec& grids, const openvdb::MetaMap& metadata, const std::string& id) const {
    std::ostringstream stream(std::ios::binary);
    openvdb::io::Archive::write(stream, grids, /*seekable=*/true, metadata);
    std::string bytes = std::move(stream).str();
    const std::string header = header_before_id(), random_id = getUniqueTag();
    if (random_id.size() != id.size() || !bytes.starts_with(header + random_id))
      throw Error(ErrorCode::kInternal, std::string("VDB: OpenVDB ") + openvdb::getLibraryVersionString() +
                                            " wrote a header of an unknown form");
    return bytes.replace(header.size(), id.size(), id);
  }

 private:
  using openvdb::io::Archive::write;

  // Magic number, version of the format, version of the library, and that the offsets of grids follow.
  static std::string header_before_id() {
    std::string header;
    const auto append = [&](auto value) { header.append(reinterpret_cast<const char*>(&value), sizeof(value)); };
    append(std::int64_t{openvdb::OPENVDB_MAGIC});
    append(std::uint32_t{openvdb::OPENVDB_FILE_VERSION});
    append(std::uint32_t{openvdb::OPENVDB_LIBRARY_MAJOR_VERSION});
    append(std::uint32_t{openvdb::OPENVDB_LIBRARY_MINOR_VERSION});
    append(char{1});
    return header;
  }
};

const DenseGrid& mask_of(const DenseGrid& grid, std::span<const DenseGrid> grids) {
  if (grid.mask.empty()) return grid;
  const auto mask = std::find_if(grids.begin(), grids.end(), [&](const DenseGrid& g) { return g.name == grid.mask; });
  if (mask == grids.end())
    throw Error(ErrorCode::kArgument, "VDB: grid '" + grid.name + "': no grid '" + grid.mask + "' to be its mask");
  if (mask->size != grid.size)
    throw Error(ErrorCode::kArgument, "VDB: grid '" + grid.name + "': its mask '" + grid.mask + "' has another size");
  return *mask;
}

void check(const DenseGrid& grid, std::unordered_set<std::string>& names) {
  const std::string who = "VDB: grid '" + grid.name + "': ";
  if (grid.name.empty()) throw Error(ErrorCode::kArgument, "VDB: a grid has no name");
  if (!names.insert(grid.name).second) throw Error(ErrorCode::kArgument, who + "the name is used twice");
  if (grid.components != 1 && grid.components != 3)
    throw Error(ErrorCode::kArgument, who + "components = " + std::to_string(grid.components) + ": must be 1 or 3");
  for (int c = 0; c < grid.components; ++c)
    if (grid.data[c] == nullptr) throw Error(ErrorCode::kArgument, who + "data[" + std::to_string(c) + "] is null");
  for (int axis = 0; axis < 3; ++axis)
    if (grid.size[axis] < 1)
      throw Error(ErrorCode::kArgument, who + "size[" + std::to_string(axis) +
                                            "] = " + std::to_string(grid.size[axis]) + ": must be at least 1");
}

template <class Grid>
openvdb::GridBase::Ptr make_grid(const DenseGrid& grid, const DenseGrid& mask, const VdbOptions& options) {
  auto vdb = Grid::create();
  fill(*vdb, grid, mask, options);
  vdb->setName(grid.name);
  vdb->setTransform(to_transform(options.index_to_world));
  vdb->setSaveFloatAsHalf(options.half_float);
  vdb->setCreator(options.creator);
  if (grid.components == 1) {
    vdb->setGridClass(openvdb::GRID_FOG_VOLUME);
  } else {
    vdb->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
  }
  return vdb;
}

// ---- files read back

using openvdb::Coord;
using openvdb::CoordBBox;

constexpr int kFarthest = 1 << 30;  // index of a voxel, and size of a box in voxels

[[noreturn]] void fail(const std::string& path, const std::string& reason) {
  throw Error(ErrorCode::kIo, path + ": cannot be read: " + reason);
}

std::string read_file(const std::string& path) {
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  std::ostringstream bytes(std::ios::binary);
  if (!in || !(bytes << in.rdbuf())) fail(path, errno ? std::strerror(errno) : "it is empty");
  return std::move(bytes).str();
}

// The grids and metadata of a file that is whole.
struct Content {
  openvdb::GridPtrVecPtr grids;
  openvdb::MetaMap::Ptr metadata;
};
Content decode(const std::string& path) {
  std::string bytes = read_file(path);
  if (const std::string fault = checksum_fault(bytes); !fault.empty()) fail(path, fault);
  openvdb::initialize();
  try {
    std::istringstream in(std::move(bytes), std::ios::binary);
    openvdb::io::Stream stream(in, /*delayLoad=*/false);
    return {stream.getGrids(), stream.getMetadata()};
  } catch (const openvdb::Exception& error) {
    fail(path, error.what());
  }
}

// Sums of voxels in the cells of a box.
template <class Grid>
void add_up(const Grid& grid, const CoordBBox& box, const Vec3i& min, const Vec3i& size, int coarsen,
            std::span<float> values) {
  constexpr bool kScalar = std::is_same_v<Grid, openvdb::FloatGrid>;
  const auto accessor = grid.getConstAccessor();
  const auto cell = [&](int axis, int at) { return (at - min[axis]) / coarsen; };
  std::vector<float> active(kScalar ? 0 : values.size() / 3);
  for (int z = box.min().z(); z <= box.max().z(); ++z)
    for (int y = box.min().y(); y <= box.max().y(); ++y)
      for (int x = box.min().x(); x <= box.max().x(); ++x) {
        typename Grid::ValueType value;
        if (!accessor.probeValue(Coord(x, y, z), value)) continue;
        const std::size_t at = static_cast<std::size_t>(cell(0, x)) +
                               static_cast<std::size_t>(size[0]) *
                                   (static_cast<std::size_t>(cell(1, y)) +
                                    static_cast<std::size_t>(size[1]) * static_cast<std::size_t>(cell(2, z)));
        if constexpr (kScalar) {
          values[at] += value;
        } else {
          for (int c = 0; c < 3; ++c) values[3 * at + static_cast<std::size_t>(c)] += value[c];
          active[at] += 1.0f;
        }
      }
  if constexpr (kScalar) {
    const float voxels = std::pow(static_cast<float>(coarsen), 3.0f);
    for (float& value : values) value /= voxels;
  } else {
    for (std::size_t n = 0; n < values.size(); ++n) values[n] /= std::max(1.0f, active[n / 3]);
  }
}

}  // namespace

std::uint64_t write_vdb(const std::string& path, std::span<const DenseGrid> grids, const VdbOptions& options) {
  openvdb::initialize();
  std::unordered_set<std::string> names;
  for (const DenseGrid& grid : grids) check(grid, names);
  openvdb::GridCPtrVec vdbs;
  std::uint64_t content_hash = 0;
  for (const DenseGrid& grid : grids) {
    const DenseGrid& mask = mask_of(grid, grids);
    vdbs.push_back(grid.components == 1 ? make_grid<FloatGrid>(grid, mask, options)
                                        : make_grid<Vec3SGrid>(grid, mask, options));
    summarize(*vdbs.back(), content_hash);
  }
  openvdb::MetaMap metadata;
  metadata.insertMeta(kCreatorKey, openvdb::StringMetadata(options.creator));
  metadata.insertMeta(kChecksumKey, openvdb::StringMetadata(kNoChecksum));
  MemoryArchive archive;
  archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
  std::string bytes;
  try {
    bytes = archive.bytes(vdbs, metadata, to_uuid(content_hash));
  } catch (const openvdb::Exception& error) {
    throw Error(ErrorCode::kInternal, path + ": cannot be encoded: " + error.what());
  }
  put_checksum(bytes);
  replace_file(path, bytes);
  return content_hash;
}

VdbSummary read_vdb_summary(const std::string& path) {
  VdbSummary summary;
  const Content content = decode(path);
  const auto creator = content.metadata->getMetadata<openvdb::StringMetadata>(kCreatorKey);
  if (!creator) fail(path, std::string("it lacks the metadata '") + kCreatorKey + "'");
  summary.creator = creator->value();
  for (const auto& grid : *content.grids) summary.grids.push_back(summarize(*grid, summary.content_hash));
  return summary;
}

struct VdbFile::Grids {
  std::map<std::string, openvdb::GridBase::ConstPtr> by_name;

  const openvdb::GridBase& at(const std::string& path, const std::string& name) const {
    if (const auto found = by_name.find(name); found != by_name.end()) return *found->second;
    std::string there;
    for (const auto& entry : by_name) there += (there.empty() ? "" : ", ") + entry.first;
    throw Error(ErrorCode::kArgument, path + ": has no grid '" + name + "'; its grids: " + there);
  }
};

VdbFile::VdbFile(const std::string& path) : path_(path), grids_(std::make_unique<Grids>()) {
  const Content content = decode(path);
  for (const auto& grid : *content.grids) grids_->by_name[grid->getName()] = grid;
}

VdbFile::~VdbFile() = default;

VdbGridInfo VdbFile::info(const std::string& name) const {
  const openvdb::GridBase& grid = grids_->at(path_, name);
  VdbGridInfo info;
  info.components = grid.isType<openvdb::FloatGrid>() ? 1 : 3;
  info.index_to_world = from_transform(grid.transform());
  info.active_voxels = grid.activeVoxelCount();
  const CoordBBox box = grid.evalActiveVoxelBoundingBox();
  if (info.active_voxels == 0) return info;
  for (int a = 0; a < 3; ++a) info.min[a] = box.min()[a], info.size[a] = box.dim()[a];
  return info;
}

void VdbFile::read(const std::string& name, const Vec3i& min, const Vec3i& size, int coarsen,
                   std::span<float> values) const {
  const openvdb::GridBase& grid = grids_->at(path_, name);
  const VdbGridInfo of = info(name);
  const auto refuse = [&](const std::string& what, double value, const std::string& limit) {
    std::ostringstream text;
    text.precision(12);
    text << path_ << ": grid '" << name << "': " << what << " = " << value << ": must be " << limit;
    throw Error(ErrorCode::kArgument, text.str());
  };
  if (coarsen < 1 || coarsen > 1024) refuse("coarsen", coarsen, "from 1 to 1024");
  double count = of.components;
  for (int a = 0; a < 3; ++a) {
    const std::string axis(1, "xyz"[a]);
    if (min[a] < -kFarthest || min[a] > kFarthest) refuse("min." + axis, min[a], "from -2^30 to 2^30");
    if (size[a] < 1 || size[a] > kFarthest / coarsen)
      refuse("size." + axis, size[a], "at least 1, in voxels at most 2^30");
    count *= size[a];
  }
  if (count > static_cast<double>(values.size()))
    refuse("number of values", count, "at most the capacity of " + std::to_string(values.size()));
  values = values.first(static_cast<std::size_t>(count));
  std::fill(values.begin(), values.end(), 0.0f);
  if (of.active_voxels == 0) return;
  CoordBBox box = grid.evalActiveVoxelBoundingBox();
  box.intersect(
      CoordBBox(Coord(min[0], min[1], min[2]),
                Coord(min[0] + size[0] * coarsen - 1, min[1] + size[1] * coarsen - 1, min[2] + size[2] * coarsen - 1)));
  if (box.empty()) return;
  if (of.components == 1) {
    add_up(static_cast<const openvdb::FloatGrid&>(grid), box, min, size, coarsen, values);
  } else {
    add_up(static_cast<const openvdb::Vec3SGrid&>(grid), box, min, size, coarsen, values);
  }
}

}  // namespace efsi::io
