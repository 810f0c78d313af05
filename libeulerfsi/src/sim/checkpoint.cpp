#include "sim/checkpoint.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/error.hpp"
#include "sim/simulation.hpp"

namespace efsi::sim {
namespace {

constexpr char kMagic[8] = {'e', 'f', 's', 'i', 'c', 'h', 'k', 'A'};

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
  // Where solids are apart, or cannot yield, the hash is that of the other fields.
  void array(const std::vector<solid::SolidPress>& v) {
    if (!v.empty()) hash.add_array(v);
  }
  void array(const std::vector<solid::PlasticNode>& v) {
    if (!v.empty()) hash.add_array(v);
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

std::uint64_t Simulation::scene_hash() const {
  Hash hash;
  const auto vector = [&](const Vec3d& v) { hash.add(v.data(), 3 * sizeof(double)); };
  vector(params_.domain_min);
  vector(params_.domain_size);
  vector(params_.gravity);
  hash.add_value(params_.voxel_size);
  hash.add_value(params_.walls.face);
  hash.add_value(static_cast<std::uint64_t>(params_.fluid.present));
  for (double v : {params_.fluid.density, params_.fluid.vorticity_confinement, params_.fluid.smoke_buoyancy,
                   params_.fluid.temperature_buoyancy, params_.cfl_solid, params_.cfl_fluid, params_.max_time_step,
                   params_.numerics.velocity_tolerance, params_.numerics.pressure_tolerance})
    hash.add_value(v);
  if (params_.fluid.viscosity > 0.0) hash.add_value(params_.fluid.viscosity);
  if (params_.walls.any_moves())
    for (const Vec3d& v : params_.walls.velocity) vector(v);
  const Numerics& n = params_.numerics;
  for (int v :
       {static_cast<int>(n.velocity_solver), static_cast<int>(n.pressure_solver), n.points_per_element,
        static_cast<int>(n.solid_advection), static_cast<int>(n.corrected_fluid_advection),
        static_cast<int>(n.stiff_correction), static_cast<int>(n.volume_source), static_cast<int>(n.conserve_momentum),
        static_cast<int>(n.stiffness_by_pace), static_cast<int>(n.resolve_impacts), static_cast<int>(n.repair_map),
        static_cast<int>(n.fluid_slips), static_cast<int>(n.coupling_step), static_cast<int>(n.volume_by_pressure),
        static_cast<int>(n.walls_push_only), static_cast<int>(sizeof(Real))})
    hash.add_value(static_cast<std::int64_t>(v));
  for (const auto& s : solids_) {
    for (double v : {s.density, s.rayleigh_alpha, s.rayleigh_beta, s.friction, s.elastic.mu, s.elastic.lambda})
      hash.add_value(v);
    if (s.plastic.yields())
      for (double v : {s.plastic.yield_stress, s.plastic.flow_rate, s.plastic.hardening}) hash.add_value(v);
    hash.add_value(static_cast<std::int64_t>(s.elastic.law));
    hash.add_value(static_cast<std::int64_t>(s.compressible));
    hash.add_array(s.distance.values);
    hash.add_array(s.surface.points);
    hash.add_array(s.surface.triangles);
    if (n.uses_particles()) hash.add_value(s.contact_stiffness);
  }
  if (n.uses_particles()) hash.add_value(n.contact_distance);
  for (const Pin& pin : pins_) {
    hash.add_value(static_cast<std::uint64_t>(pin.solid));
    hash.add_value(static_cast<std::uint64_t>(pin.whole));
    hash.add_array(pin.region.values);
    vector(pin.region.origin);
  }
  for (const auto& e : emitters_) {
    hash.add(e.from_world.data(), 16 * sizeof(double));
    for (double v : {e.density, e.temperature, e.start_time, e.end_time, e.velocity[0], e.velocity[1], e.velocity[2]})
      hash.add_value(v);
    for (int v : {static_cast<int>(e.shape), static_cast<int>(e.mode), static_cast<int>(e.has_velocity)})
      hash.add_value(static_cast<std::int64_t>(v));
    hash.add_array(e.cells);
    for (const Vec3d& face : e.faces) vector(face);
    for (const fluid::EmitterKey& key : e.keys) {
      for (double v : {key.time, key.density, key.temperature, key.on ? 1.0 : 0.0}) hash.add_value(v);
      vector(key.velocity);
    }
  }
  for (const ForceField& f : forces_) {
    hash.add(f.from_world.data(), 16 * sizeof(double));
    vector(f.acceleration);
    vector(f.wind_velocity);
    for (double v :
         {f.radial_acceleration, f.wind_drag, f.noise_speed, f.noise_size, f.noise_frequency, f.start_time, f.end_time})
      hash.add_value(v);
    for (int v : {static_cast<int>(f.shape), static_cast<int>(f.kind), static_cast<int>(f.acts_on)})
      hash.add_value(static_cast<std::int64_t>(v));
  }
  return hash.value();
}

void save_checkpoint(const Simulation& simulation, const std::string& path) {
  const std::string temporary = path + ".tmp";
  {
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    if (!out) throw Error(ErrorCode::kIo, temporary + ": cannot be written: " + system_reason());
    WriteArchive archive{out};
    out.write(kMagic, sizeof(kMagic));
    archive.value(simulation.scene_hash());
    archive.value(state_hash(simulation.state()));
    archive.value(static_cast<std::uint64_t>(simulation.state().solids.size()));
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
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error(ErrorCode::kIo, path + ": cannot be read: " + system_reason());
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  ReadArchive archive{in, size};
  char magic[8] = {};
  in.read(magic, sizeof(magic));
  if (!in || std::memcmp(magic, kMagic, sizeof(magic)) != 0)
    throw Error(ErrorCode::kCheckpoint, path + ": is not a checkpoint of this version");
  std::uint64_t scene = 0, hash = 0, solids = 0;
  archive.value(scene);
  archive.value(hash);
  archive.value(solids);
  simulation.prepare();
  if (!in || scene != simulation.scene_hash() || solids != simulation.state().solids.size())
    throw Error(ErrorCode::kCheckpoint, path + ": belongs to another scene or other parameters");
  State state;
  state.solids.resize(solids);
  visit_fields(state, archive);
  if (!in || state_hash(state) != hash) throw Error(ErrorCode::kIo, path + ": is damaged");
  simulation.set_state(std::move(state));
}

}  // namespace efsi::sim
