#include "sim/checkpoint.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "base/error.hpp"
#include "sim/simulation.hpp"
#include "sim/state_fits.hpp"

namespace efsi::sim {
namespace {

constexpr char kMagic[8] = {'e', 'f', 's', 'i', 'c', 'h', 'k', 'I'};

struct HashArchive {
  Hash hash;
  template <class T>
  void value(const T& v) {
    hash.add_value(v);
  }
  template <class T>
  void array(const std::vector<T>& v) {
    hash.add_array(v);
  }
  // Where solids are apart, not deep in each other, cannot yield, or have kept their energy, the hash is that of the
  // other fields.
  void array(const std::vector<solid::ContactImpulse>& v) {
    if (!v.empty()) hash.add_array(v);
  }
  void array(const std::vector<solid::DeepVertex>& v) {
    if (!v.empty()) hash.add_array(v);
  }
  void array(const std::vector<solid::PlasticNode>& v) {
    if (!v.empty()) hash.add_array(v);
  }
  void value(const solid::LossLimit& v) {
    if (v.holds()) hash.add_value(v);
  }
};

struct WriteArchive {
  std::ofstream& out;
  template <class T>
  void value(const T& v) {
    out.write(reinterpret_cast<const char*>(&v), sizeof(T));
  }
  template <class T>
  void array(const std::vector<T>& v) {
    value(static_cast<std::uint64_t>(v.size()));
    out.write(reinterpret_cast<const char*>(v.data()), static_cast<std::streamsize>(v.size() * sizeof(T)));
  }
};

struct ReadArchive {
  std::ifstream& in;
  std::uint64_t limit;  // bytes of the file: a damaged length cannot ask for more
  template <class T>
  void value(T& v) {
    in.read(reinterpret_cast<char*>(&v), sizeof(T));
  }
  template <class T>
  void array(std::vector<T>& v) {
    std::uint64_t n = 0;
    value(n);
    if (!in || n > limit / sizeof(T)) {
      in.setstate(std::ios::failbit);
      return;
    }
    v.resize(n);
    in.read(reinterpret_cast<char*>(v.data()), static_cast<std::streamsize>(n * sizeof(T)));
  }
};

std::string system_reason() { return errno ? std::strerror(errno) : "unknown reason"; }

// What a checkpoint says of the simulation before its state.
struct Head {
  std::uint64_t scene = 0, state = 0;
  double box[7] = {};                // voxel size, lower corner, edges [m]
  std::vector<std::uint64_t> rests;  // per body, rest shape and lattices; odd: a solid, even: a collider
};

bool is_solid(std::uint64_t rest) { return rest % 2 == 1; }

std::uint64_t rest_hash(const solid::SolidRest& rest, bool collider) {
  Hash hash;
  hash.add_array(rest.distance.values);
  hash.add_array(rest.surface.points);
  hash.add_array(rest.surface.triangles);
  hash.add_value(static_cast<std::uint64_t>(rest.plastic.yields()));
  hash.add_value(static_cast<std::uint64_t>(rest.bulk > 0.0));
  return collider ? hash.value() & ~std::uint64_t{1} : hash.value() | 1;
}

Head head_of(const Simulation& simulation) {
  Head head{simulation.scene_hash(), state_hash(simulation.state()), {}, {}};
  const Params& params = simulation.params();
  for (int a = 0; a < 3; ++a) head.box[1 + a] = params.domain_min[a], head.box[4 + a] = params.domain_size[a];
  head.box[0] = params.voxel_size;
  for (std::size_t l = 0; l < simulation.solids().size(); ++l)
    head.rests.push_back(rest_hash(simulation.solids()[l], is_collider(simulation.pins(), l)));
  return head;
}

template <class AnyHead, class Archive>
void visit_head(AnyHead&& head, Archive& archive) {
  archive.value(head.scene);
  archive.value(head.state);
  archive.value(head.box);
  archive.array(head.rests);
}

std::uint64_t hash_of(const Head& head) {
  HashArchive archive;
  visit_head(head, archive);
  return archive.hash.value();
}

// The file up to its state; then the state, whole. Both throw.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), in_(path, std::ios::binary) {
    if (!in_) throw Error(ErrorCode::kIo, path + ": cannot be read: " + system_reason());
    std::error_code error;
    archive_.limit = std::filesystem::file_size(path, error);
    char magic[8] = {};
    in_.read(magic, sizeof(magic));
    if (!in_ || std::memcmp(magic, kMagic, sizeof(magic)) != 0)
      throw Error(ErrorCode::kCheckpoint, path + ": is not a checkpoint of this version");
    visit_head(head, archive_);
    std::uint64_t hash = 0;
    archive_.value(hash);
    if (!in_ || hash != hash_of(head)) throw Error(ErrorCode::kIo, path + ": is damaged");
  }
  State state() {
    State state;
    state.solids.resize(head.rests.size());
    visit_fields(state, archive_);
    if (!in_ || state_hash(state) != head.state) throw Error(ErrorCode::kIo, path_ + ": is damaged");
    return state;
  }

  Head head;

 private:
  std::string path_;
  std::ifstream in_;
  ReadArchive archive_{in_, 0};
};

// A part of the simulation that differs from the checkpoint's. `ours`, `theirs`: its values.
template <class Value>
std::string differs(const std::string& what, const Value& ours, const Value& theirs) {
  std::ostringstream text;
  text.precision(12);
  text << what << " = " << ours << ": must be " << theirs << " as in the checkpoint";
  return text.str();
}

// Why a simulation has no place for what a checkpoint holds; empty: it has.
std::string box_difference(const Head& theirs, const Head& ours) {
  static constexpr const char* kBox[7] = {"voxel_size",    "domain_min.x",  "domain_min.y", "domain_min.z",
                                          "domain_size.x", "domain_size.y", "domain_size.z"};
  for (int i = 0; i < 7; ++i)
    if (theirs.box[i] != ours.box[i]) return differs(kBox[i], ours.box[i], theirs.box[i]);
  return "";
}

// The same of the bodies that count, in their order.
template <class Counts>
std::string body_difference(const Head& theirs, const Head& ours, const std::string& what, const Counts& counts) {
  const auto count = [&](const Head& head) { return std::count_if(head.rests.begin(), head.rests.end(), counts); };
  if (count(theirs) != count(ours)) return differs("number of " + what, count(ours), count(theirs));
  for (std::size_t l = 0, k = 0; l < ours.rests.size(); ++l) {
    if (!counts(ours.rests[l])) continue;
    while (!counts(theirs.rests[k])) ++k;
    if (theirs.rests[k++] != ours.rests[l])
      return std::string(is_solid(ours.rests[l]) ? "solid " : "collider: body ") + std::to_string(l + 1) +
             ": its rest shape, where that lies, and whether it can yield must be those of the checkpoint";
  }
  return "";
}

// fault: of state_fits.hpp.
void demand_fit(const std::string& fault, const std::string& path) {
  if (!fault.empty()) throw Error(ErrorCode::kIo, path + ": is damaged: " + fault);
}

}  // namespace

void Hash::add(const void* data, std::size_t bytes) {
  const auto* p = static_cast<const unsigned char*>(data);
  const auto mix = [this](std::uint64_t word) {
    state_ ^= word;
    state_ *= 0xff51afd7ed558ccdull;
    state_ ^= state_ >> 32;
  };
  for (; bytes >= 8; bytes -= 8, p += 8) {
    std::uint64_t word;
    std::memcpy(&word, p, 8);
    mix(word);
  }
  std::uint64_t tail = bytes;
  for (; bytes > 0; --bytes, ++p) tail = (tail << 8) | *p;
  mix(tail);
}

std::uint64_t state_hash(const State& state) {
  HashArchive archive;
  visit_fields(state, archive);
  return archive.hash.value();
}

void save_checkpoint(const Simulation& simulation, const std::string& path) {
  const std::string temporary = path + ".tmp";
  {
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    if (!out) throw Error(ErrorCode::kIo, temporary + ": cannot be written: " + system_reason());
    WriteArchive archive{out};
    out.write(kMagic, sizeof(kMagic));
    const Head head = head_of(simulation);
    visit_head(head, archive);
    archive.value(hash_of(head));
    visit_fields(simulation.state(), archive);
    out.flush();
    if (!out) {
      const std::string reason = system_reason();
      out.close();
      std::remove(temporary.c_str());
      throw Error(ErrorCode::kIo, path + ": cannot be written: " + reason);
    }
  }
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  if (error) {
    std::remove(temporary.c_str());
    throw Error(ErrorCode::kIo, path + ": cannot be renamed into place: " + error.message());
  }
}

void restore_checkpoint(Simulation& simulation, const std::string& path) {
  Reader reader(path);
  simulation.prepare();
  if (reader.head.scene != simulation.scene_hash() || reader.head.rests.size() != simulation.state().solids.size())
    throw Error(ErrorCode::kCheckpoint, path + ": belongs to another scene or other parameters");
  State state = reader.state();
  demand_fit(state_fault(state, simulation.state(), simulation.grid(), simulation.solids()), path);
  simulation.set_state(std::move(state));
}

void restore_state(Simulation& simulation, const std::string& path) {
  Reader reader(path);
  const Head ours = head_of(simulation);
  std::string reason = box_difference(reader.head, ours);
  if (reason.empty())
    reason = body_difference(reader.head, ours, "solids and colliders", [](std::uint64_t) { return true; });
  const auto demand_none = [&] {
    if (!reason.empty()) throw Error(ErrorCode::kCheckpoint, path + ": " + reason);
  };
  demand_none();
  State state = reader.state();
  simulation.prepare();
  const fluid::FluidState &fluid = simulation.state().fluid, &other = state.fluid;
  const auto has_fluid = [](const fluid::FluidState& of) { return of.velocity.size() > 0; };
  if (reason.empty() && has_fluid(fluid) != has_fluid(other))
    reason = differs("ambient_fluid", has_fluid(fluid), has_fluid(other));
  if (reason.empty() && fluid.velocity.size() != other.velocity.size())
    reason = "walls: periodic axes must be those of the checkpoint";
  demand_none();
  // What emitters give from now on had no place before.
  if (state.fluid.smoke.empty()) state.fluid.smoke.assign(fluid.smoke.size(), 0);
  if (state.fluid.temperature.empty()) state.fluid.temperature.assign(fluid.temperature.size(), 0);
  demand_fit(state_fault(state, simulation.state(), simulation.grid(), simulation.solids()), path);
  simulation.set_state(std::move(state));
}

void restore_solids(Simulation& simulation, const std::string& path) {
  Reader reader(path);
  const Head ours = head_of(simulation);
  std::string reason = box_difference(reader.head, ours);
  if (reason.empty()) reason = body_difference(reader.head, ours, "solids", is_solid);
  if (!reason.empty()) throw Error(ErrorCode::kCheckpoint, path + ": " + reason);
  const State theirs = reader.state();
  std::vector<solid::SolidState> solids = simulation.state().solids;
  for (std::size_t l = 0, k = 0; l < solids.size(); ++l) {
    if (!is_solid(ours.rests[l])) continue;
    while (!is_solid(reader.head.rests[k])) ++k;
    solids[l] = theirs.solids[k++];
    demand_fit(body_fault(solids[l], simulation.grid(), simulation.solids()[l]), path);
    solids[l].presses.clear();
    solids[l].contacts.clear();
    solids[l].deep.clear();
    solids[l].acceleration = -1.0;  // what acts on it may be other than it was
  }
  simulation.set_solids(std::move(solids));
}

}  // namespace efsi::sim
