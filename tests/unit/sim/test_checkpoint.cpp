// Purpose: checkpoints: round trip, damage, other scenes.
#include <filesystem>
#include <fstream>
#include <random>

#include "base/byte_count.hpp"
#include "base/error.hpp"
#include "sim/checkpoint.hpp"
#include "unit/sim/scene.hpp"

using namespace efsi;
using namespace efsi::test;
namespace fs = std::filesystem;

namespace {

// A file in a folder of its own, removed at the end.
struct TemporaryFile {
  fs::path folder, path;
  TemporaryFile() {
    folder = fs::temp_directory_path() / ("efsi_checkpoint_" + std::to_string(std::random_device{}()));
    fs::create_directories(folder);
    path = folder / "state.ckpt";
  }
  ~TemporaryFile() { fs::remove_all(folder); }
  std::string name() const { return path.string(); }
};

SimulationPtr scene(double density = 1000.0, int threads = 1) {
  sim::Params p = box_params({0.3, 0.3, 0.3}, 0.025);
  p.threads = threads;
  sim::SolidDesc d = ball_desc({0.15, 0.12, 0.15}, 0.08);
  d.density = density;
  d.velocity = {0.3, -2.0, 0.1};
  auto s = make_simulation(p, {d});
  fluid::Emitter e;
  e.mode = fluid::Emitter::Mode::kContinuous;
  e.end_time = 10.0;
  e.temperature = 2.0;
  e.from_world.topLeftCorner<3, 3>() *= 8.0;
  e.from_world.topRightCorner<3, 1>().setConstant(-2.0);
  s->add_emitter(e);
  return s;
}

int refused(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    return static_cast<int>(error.code());
  }
  return 0;
}

// Changes the last byte of one field of a state, the `target`-th of those that are not empty.
struct Touch {
  int target, at = 0;
  std::uint64_t bytes = 0;  // of all arrays
  template <class T>
  void value(T& v) {
    if (at++ == target) reinterpret_cast<unsigned char*>(&v)[sizeof(T) - 1] ^= 1;
  }
  template <class T>
  void array(std::vector<T>& v) {
    bytes += v.size() * sizeof(T);
    if (!v.empty() && at++ == target) reinterpret_cast<unsigned char*>(&v.back())[sizeof(T) - 1] ^= 1;
  }
};

}  // namespace

TEST_CASE("Every field in the list of a state changes its hash, and every array counts as memory") {
  auto s = scene();
  s->step(0.01);
  Touch none{-1};
  sim::State state = s->state();
  sim::visit_fields(state, none);
  // time .. speed, fluid; of the solid band, u, v and its change, other arrays, values
  CHECK(none.at == 3 + 7 + 6 + 10 + 3 + 6);
  for (int field = 0; field < none.at; ++field) {
    INFO("field " << field);
    Touch one{field};
    sim::State touched = s->state();
    sim::visit_fields(touched, one);
    CHECK(sim::state_hash(touched) != sim::state_hash(s->state()));
  }
  ByteCount count;
  sim::visit_fields(state, count);
  CHECK(count.bytes == none.bytes);
  CHECK(s->memory_bytes() > 2 * none.bytes);  // the last good state, too
}

TEST_CASE("Restoring and going on equals the uninterrupted run bit for bit", "[determinism]") {
  const TemporaryFile file;
  auto whole = scene(), first = scene();
  for (int n = 0; n < 5; ++n) whole->step(0.02);
  for (int n = 0; n < 2; ++n) first->step(0.02);
  sim::save_checkpoint(*first, file.name());
  CHECK_FALSE(fs::exists(file.name() + ".tmp"));
  auto second = scene(1000.0, 3);  // another thread count
  sim::restore_checkpoint(*second, file.name());
  CHECK(sim::state_hash(second->state()) == sim::state_hash(first->state()));
  CHECK(second->state().steps == 2);
  for (int n = 0; n < 3; ++n) second->step(0.02);
  CHECK(sim::state_hash(second->state()) == sim::state_hash(whole->state()));
  CHECK(second->diagnose_solid(0).rest_volume_cells == whole->diagnose_solid(0).rest_volume_cells);
  // A simulation that has moved on can go back, too.
  sim::restore_checkpoint(*second, file.name());
  for (int n = 0; n < 3; ++n) second->step(0.02);
  CHECK(sim::state_hash(second->state()) == sim::state_hash(whole->state()));
}

TEST_CASE("So it does in an impact whose steps are limited by what one has lost", "[determinism]") {
  const auto thrown = [] {
    sim::SolidDesc d = ball_desc({0.15, 0.1, 0.15}, 0.08);
    d.youngs_modulus = 1e7;
    d.velocity = {0.0, -2.0, 0.0};
    return make_simulation(still_vacuum({0.3, 0.3, 0.3}, kCell), {d});
  };
  const TemporaryFile file;
  auto whole = thrown(), second = thrown();
  for (int n = 0; n < 40 && !whole->state().solids[0].by_loss.holds(); ++n) whole->step(kFrame);
  REQUIRE(whole->state().solids[0].by_loss.holds());
  sim::save_checkpoint(*whole, file.name());
  sim::restore_checkpoint(*second, file.name());
  CHECK(sim::state_hash(second->state()) == sim::state_hash(whole->state()));
  for (int n = 0; n < 5; ++n) {
    whole->step(kFrame);
    second->step(kFrame);
  }
  CHECK(sim::state_hash(second->state()) == sim::state_hash(whole->state()));
}

TEST_CASE("A damaged checkpoint is refused and changes nothing") {
  const TemporaryFile file;
  auto s = scene();
  s->step(0.02);
  sim::save_checkpoint(*s, file.name());
  const auto size = fs::file_size(file.path);
  auto other = scene();
  other->step(0.01);
  const std::uint64_t before = sim::state_hash(other->state());
  const auto flip = [&](std::uintmax_t at) {
    std::fstream f(file.path, std::ios::in | std::ios::out | std::ios::binary);
    f.seekg(static_cast<std::streamoff>(at));
    const char c = static_cast<char>(f.get());
    f.seekp(static_cast<std::streamoff>(at));
    f.put(static_cast<char>(c ^ 0x40));
  };
  const int io = static_cast<int>(ErrorCode::kIo), checkpoint = static_cast<int>(ErrorCode::kCheckpoint);
  // Values, lengths of arrays, the box, the stored hash, the version.
  for (const std::uintmax_t at :
       {size / 2, size - 3, std::uintmax_t{104 + 24}, std::uintmax_t{80}, std::uintmax_t{64}, std::uintmax_t{20}}) {
    flip(at);
    INFO("byte " << at);
    CHECK(refused([&] { sim::restore_checkpoint(*other, file.name()); }) == io);
    CHECK(sim::state_hash(other->state()) == before);
    flip(at);
  }
  flip(2);
  CHECK(refused([&] { sim::restore_checkpoint(*other, file.name()); }) == checkpoint);
  flip(2);
  sim::restore_checkpoint(*other, file.name());
  CHECK(sim::state_hash(other->state()) == sim::state_hash(s->state()));
  fs::resize_file(file.path, size - 100);
  CHECK(refused([&] { sim::restore_checkpoint(*other, file.name()); }) == io);
  fs::resize_file(file.path, 10);
  CHECK(refused([&] { sim::restore_checkpoint(*other, file.name()); }) != 0);
  CHECK(sim::state_hash(other->state()) == sim::state_hash(s->state()));
}

TEST_CASE("A checkpoint of another scene, a missing file and a folder that is not there are refused") {
  const TemporaryFile file;
  auto s = scene();
  s->step(0.02);
  sim::save_checkpoint(*s, file.name());
  auto other = scene(900.0);
  CHECK(refused([&] { sim::restore_checkpoint(*other, file.name()); }) == static_cast<int>(ErrorCode::kCheckpoint));
  CHECK(refused([&] { sim::restore_checkpoint(*s, file.name() + "x"); }) == static_cast<int>(ErrorCode::kIo));
  CHECK(refused([&] { sim::save_checkpoint(*s, (file.folder / "no" / "x").string()); }) ==
        static_cast<int>(ErrorCode::kIo));
}

TEST_CASE("Solids of a checkpoint start another scene of the same box") {
  const TemporaryFile file;
  auto first = scene();
  for (int n = 0; n < 3; ++n) first->step(0.02);
  sim::State deep = first->state();
  deep.solids[0].deep = {{0, 1, {0, 1, 0}}};  // in a solid that the other scene has not
  first->set_state(std::move(deep));
  sim::save_checkpoint(*first, file.name());
  const auto alone = [](double density, double voxel, Vec3d center) {
    sim::Params p = vacuum({0.3, 0.3, 0.3}, voxel);
    p.gravity = Vec3d::Zero();
    sim::SolidDesc d = ball_desc(center, 0.08);
    d.density = density;
    return make_simulation(p, {d});
  };
  const Vec3d center(0.15, 0.12, 0.15);
  auto second = alone(500.0, 0.025, center);
  sim::restore_solids(*second, file.name());
  const auto before = first->diagnose_solid(0), after = second->diagnose_solid(0);
  // In vacuum cells carry it, and its mass, from another part on.
  CHECK((after.center - before.center).norm() < 0.02 * 0.025);
  CHECK(after.center[1] < 0.12 - 0.02);
  CHECK(std::abs(after.momentum[1] - 0.5 * before.momentum[1]) < 1e-5 * std::abs(before.momentum[1]));
  CHECK(after.rest_volume_cells == before.rest_volume_cells);
  CHECK(second->surface_points(0) == first->surface_points(0));
  CHECK((second->state().steps == 0 && second->state().time == 0.0));
  CHECK(second->state().solids[0].deep.empty());
  second->step(0.02);
  CHECK_FALSE(second->diagnose_solid(0).center == before.center);
  CHECK(refused([&] { sim::restore_solids(*second, file.name()); }) == static_cast<int>(ErrorCode::kArgument));

  const auto reason = [&](sim::Simulation& other) -> std::string {
    try {
      sim::restore_solids(other, file.name());
    } catch (const Error& error) {
      CHECK(error.code() == ErrorCode::kCheckpoint);
      return error.what();
    }
    return "";
  };
  CHECK(reason(*alone(1000.0, 0.03, center)).find("voxel_size = 0.03: must be 0.025") != std::string::npos);
  CHECK(reason(*alone(1000.0, 0.025, center + Vec3d(0.01, 0, 0))).find("solid 1: its rest shape") != std::string::npos);
  sim::Params p = box_params({0.3, 0.3, 0.3}, 0.025);
  CHECK(reason(*make_simulation(p, {})).find("number of solids = 0: must be 1") != std::string::npos);
}

TEST_CASE("A state goes on with other parameters, emitters and forces, and without a change to the same bits") {
  const TemporaryFile file;
  auto first = scene();
  for (int n = 0; n < 3; ++n) first->step(0.02);
  sim::save_checkpoint(*first, file.name());
  auto same = scene(1000.0, 2);
  sim::restore_state(*same, file.name());
  CHECK(sim::state_hash(same->state()) == sim::state_hash(first->state()));
  const double time = first->state().time;
  first->step(0.02);
  same->step(0.02);
  CHECK(sim::state_hash(same->state()) == sim::state_hash(first->state()));

  // Another density: at first the same state, then other motion. A simulation that has moved on takes it over, too.
  auto denser = scene(1500.0);
  denser->step(0.01);
  sim::restore_state(*denser, file.name());
  CHECK(denser->state().time == time);
  CHECK(denser->state().steps == 3);
  denser->step(0.02);
  CHECK_FALSE(denser->diagnose_solid(0).center == first->diagnose_solid(0).center);
  // Without the emitter smoke stays; with the first emitter of a run there is room for it.
  sim::Params p = box_params({0.3, 0.3, 0.3}, 0.025);
  sim::SolidDesc d = ball_desc({0.15, 0.12, 0.15}, 0.08);
  auto none = make_simulation(p, {d});
  sim::restore_state(*none, file.name());
  none->step(0.02);
  CHECK(none->diagnose_fluid().smoke > 0.0);
  auto clear = make_simulation(p, {d});
  clear->step(0.02);
  sim::save_checkpoint(*clear, file.name());
  auto smoky = scene();
  sim::restore_state(*smoky, file.name());
  CHECK(smoky->diagnose_fluid().smoke == 0.0);
  smoky->step(0.02);
  CHECK(smoky->diagnose_fluid().smoke > 0.0);
}

TEST_CASE("A state of another box, other bodies or without fluid is refused by name and changes nothing") {
  const TemporaryFile file;
  auto first = scene();
  first->step(0.02);
  sim::save_checkpoint(*first, file.name());
  const auto reason = [&](sim::Simulation& other) -> std::string {
    const std::uint64_t before = sim::state_hash(other.state());
    try {
      sim::restore_state(other, file.name());
    } catch (const Error& error) {
      CHECK(error.code() == ErrorCode::kCheckpoint);
      if (other.state().steps > 0) CHECK(sim::state_hash(other.state()) == before);
      return error.what();
    }
    return "";
  };
  const auto with = [&](const sim::Params& p, double radius, int balls = 1) {
    std::vector<sim::SolidDesc> solids = {ball_desc({0.15, 0.12, 0.15}, radius)};
    if (balls == 2) solids.push_back(ball_desc({0.25, 0.25, 0.25}, 0.03));
    auto s = make_simulation(p, solids);
    s->step(0.01);
    return s;
  };
  const sim::Params p = box_params({0.3, 0.3, 0.3}, 0.025);
  CHECK(reason(*with(p, 0.08)).empty());
  CHECK(reason(*with(box_params({0.3, 0.3, 0.3}, 0.03), 0.08)).find("voxel_size = 0.03: must be 0.025") !=
        std::string::npos);
  CHECK(reason(*with(p, 0.07)).find("solid 1: its rest shape") != std::string::npos);
  CHECK(reason(*with(p, 0.08, 2)).find("number of solids and colliders = 2: must be 1") != std::string::npos);
  sim::Params empty = p;
  empty.fluid.present = false;
  CHECK(reason(*with(empty, 0.08)).find("ambient_fluid = 0: must be 1") != std::string::npos);
  auto collider = make_simulation(p, {});
  geometry::MeshReport report;
  collider->add_collider(ball_desc({0.15, 0.12, 0.15}, 0.08), report);
  CHECK(reason(*collider).find("body 1") != std::string::npos);
}

TEST_CASE("Solids of a checkpoint leave the colliders of a scene where they are") {
  const TemporaryFile file;
  const auto with_floor = [](double height) {
    sim::Params p = vacuum({0.3, 0.3, 0.3}, 0.025);
    auto s = make_simulation(p, {ball_desc({0.15, 0.15, 0.15}, 0.08)});
    geometry::MeshReport report;
    s->add_collider(ball_desc({0.15, height, 0.15}, 0.05), report);
    return s;
  };
  auto first = with_floor(0.0), second = with_floor(0.31);
  first->step(0.02);
  sim::save_checkpoint(*first, file.name());
  const auto collider = second->surface_points(1);
  sim::restore_solids(*second, file.name());
  CHECK(second->surface_points(0) == first->surface_points(0));
  CHECK(second->surface_points(1) == collider);
}

TEST_CASE("The scene hash covers parameters, solids and emitters, not the number of threads") {
  const std::uint64_t hash = scene()->scene_hash();
  CHECK(scene(1000.0, 3)->scene_hash() == hash);
  CHECK(scene(1001.0)->scene_hash() != hash);
  auto emitter = scene();
  emitter->add_emitter({});
  const std::uint64_t with_emitter = emitter->scene_hash();
  CHECK(with_emitter != hash);
  emitter->set_keys(1, {{0.0, 1.0, 0.0, {0, 0, 0}, true}});
  CHECK(emitter->scene_hash() != with_emitter);
  auto s = scene();
  s->step(0.01);
  CHECK(s->scene_hash() == hash);
}
