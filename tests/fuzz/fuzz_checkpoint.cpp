// Purpose: checkpoints (sim/checkpoint, sim/state_fits). Each input is read as it is, and once more with hashes that
// fit it, as a file has them that was made to lead astray: what is then found to fit must be safe to use.
#include "scratch.hpp"
#include "sim/checkpoint.cpp"  // what reads them is no part of its header

namespace {

using namespace efsi;
using namespace efsi::sim;

// A box of 4 x 4 x 4 cells with fluid, and bodies with a surface of 4 points.
grid::Grid box() {
  grid::Grid grid;
  grid.cells = {4, 4, 4};
  return grid;
}

// The same file with hashes of what it holds; empty where it ends too early.
std::string mended(const std::string& path, std::uint64_t size) {
  std::ifstream in(path, std::ios::binary);
  ReadArchive archive{in, size};
  char magic[8];
  in.read(magic, sizeof(magic));
  Head head;
  visit_head(head, archive);
  std::uint64_t hash = 0;
  archive.value(hash);
  if (!in || head.rests.size() > 4) return "";
  std::string rest(std::istreambuf_iterator<char>(in), {});
  std::ifstream again(fuzz::scratch("rest", rest.data(), rest.size()), std::ios::binary);
  ReadArchive state_archive{again, rest.size()};
  State state;
  state.solids.resize(head.rests.size());
  visit_fields(state, state_archive);
  if (!again) return "";
  head.state = state_hash(state);
  const std::string target = fuzz::scratch("mended", "", 0);
  {
    std::ofstream out(target, std::ios::binary);
    WriteArchive written{out};
    out.write(kMagic, sizeof(kMagic));
    visit_head(head, written);
    written.value(hash_of(head));
    out << rest;
  }
  return target;
}

volatile std::int32_t seen = 0;

// As a simulation uses what it was given: presses say on which face they are, bands move, and the pressure goes to the
// next window.
void use(State& state, const grid::Grid& grid) {
  for (const solid::SolidState& solid : state.solids)
    for (const solid::WallImpulse& press : solid.presses) seen = press.node[press.axis];
  for (solid::SolidState& solid : state.solids) solid::move_band(solid, solid::make_band(grid, {0, 1, 0}, {2, 3, 4}));
  if (state.fluid.velocity.size() == 0) move_cells(state.fluid.pressure, state.window, {{0, 0, 0}, grid.cells});
}

void read(const std::string& path, bool fluid) {
  Reader reader(path);
  if (reader.head.rests.size() > 4) return;
  State state = reader.state(), ours;
  const grid::Grid grid = box();
  if (fluid) ours.fluid.velocity.assign(grid.node_count());
  solid::SolidRest rest;
  rest.surface.points.resize(4);
  if (state_fault(state, ours, grid, std::vector<solid::SolidRest>(state.solids.size(), rest)).empty())
    use(state, grid);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input(data, size);
  const bool fluid = input.take<std::uint8_t>() % 2 == 0;
  // The magic number is no part of an input: it changes with the format.
  const std::string bytes =
      std::string(kMagic, sizeof(kMagic)) + std::string(input.data(), input.data() + input.size());
  const std::string path = fuzz::scratch("checkpoint", bytes.data(), bytes.size());
  try {
    read(path, fluid);
  } catch (const Error&) {
  }
  try {
    if (const std::string target = mended(path, bytes.size()); !target.empty()) read(target, fluid);
  } catch (const Error&) {
  }
  return 0;
}
