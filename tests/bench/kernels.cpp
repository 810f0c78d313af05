// Purpose: seconds of the kernels that move whole fields, beside a triad over one field: the roofline of `bench speed`.
//   efsi_bench_kernels NX NY NZ THREADS ROUNDS [NAME...]    prints JSON; without names all kernels
// A triad is a = b + s c over one float per cell, 12 bytes. The bytes of a kernel are those that must move: every field
// that it reads and every one that it writes, once. Rounds take turns between the kernels, so that a disturbance hits
// all; a kernel runs twice in its turn and the second time counts. Given are the median and the best of the rounds.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/parallel.hpp"
#include "fluid/advect.hpp"
#include "grid/boundary.hpp"
#include "linalg/reduce.hpp"
#include "system/pressure_multigrid.hpp"

using namespace efsi;

namespace {

constexpr int kMostCells = 1024, kMostThreads = 256, kMostRounds = 1000;
constexpr double kCellsPerStep = 1.5;  // how far the fastest flow carries
constexpr double kStep = 1.0 / 24.0;   // [s]

struct Kernel {
  std::string name;
  double bytes;  // per cell
  std::function<void()> run;
  std::vector<double> seconds;  // of the rounds
};

// What the kernels work on: a box of fluid between no-slip walls, in a smooth flow that moves everywhere.
struct Fields {
  grid::Grid g;
  grid::Walls walls;
  system::PressureMultigrid multigrid;
  std::vector<Real> x, y, b;     // padded cells
  std::vector<Real> ta, tb, tc;  // one float per cell
  grid::VectorField flow;
  std::vector<Real> specific_volume;
  fluid::FluidState fluid;
  fluid::AdvectWorkspace advect;
  double sum = 0.0;  // of inner products, so that they are needed

  Fields(const Parallel& parallel, const Vec3i& cells) {
    g.cells = cells;
    g.h = 1.0 / cells[1];
    walls.face.fill(grid::Wall::kNoSlip);
    specific_volume.assign(g.node_count(), 1);
    multigrid.build(parallel, g, walls, grid::fixed_by_walls(g, walls), specific_volume, {});
    for (auto* field : {&x, &y, &b}) field->assign(g.padded_count(), 0);
    for (auto* field : {&ta, &tb, &tc}) field->assign(g.cell_count(), 1);
    fluid.smoke.resize(g.cell_count());
    flow.assign(g.node_count());
    fluid.velocity = flow;
    const double top = kCellsPerStep * g.h / kStep;
    for (int k = 0; k <= cells[2]; ++k)
      for (int j = 0; j <= cells[1]; ++j)
        for (int i = 0; i <= cells[0]; ++i) {
          const double p = 0.11 * i, q = 0.07 * j, r = 0.13 * k;
          const auto at = [&](double wave) { return static_cast<Real>(top * wave); };
          flow.set(g.node(i, j, k), {at(std::sin(q + r)), at(std::cos(p) * std::sin(r)), at(std::sin(p + q))});
          if (i == cells[0] || j == cells[1] || k == cells[2]) continue;
          fluid.smoke[g.cell(i, j, k)] = static_cast<Real>(1.0 + 0.5 * std::sin(p + q + r));
          b[g.padded(i, j, k)] = x[g.padded(i, j, k)] = static_cast<Real>(std::sin(p) * std::cos(q + r));
        }
  }
};

void triad(const Parallel& parallel, Fields& f) {
  parallel.for_ranges(static_cast<std::int64_t>(f.ta.size()), [&](std::int64_t begin, std::int64_t end) {
    Real* const a = f.ta.data();
    const Real *const b = f.tb.data(), *const c = f.tc.data();
#pragma omp simd
    for (std::int64_t i = begin; i < end; ++i) a[i] = b[i] + Real(0.5) * c[i];
  });
}

std::vector<Kernel> kernels_of(const Parallel& p, Fields& f) {
  const system::PressureLevel& level = f.multigrid.finest();
  return {
      {"triad", 12, [&] { triad(p, f); }, {}},
      // x, mobility; y
      {"pressure operator", 12, [&] { system::apply_pressure_operator(p, level, f.x, f.y); }, {}},
      // x, mobility, b, D^-1; x
      {"pressure smoother", 20, [&] { system::smooth_pressure(p, level, f.b, Real(0.5), f.x); }, {}},
      {"inner product", 8, [&] { f.sum += linalg::dot(p, f.b, f.x); }, {}},
      // flow, specific volume; velocity
      {"fluid transport",
       28,
       [&] { fluid::advect_velocity(p, f.g, true, kStep, f.flow, f.flow, f.specific_volume, 1, f.fluid, f.advect); },
       {}},
      // flow, smoke; smoke
      {"smoke transport", 20, [&] { fluid::advect_smoke(p, f.g, true, kStep, f.flow, {}, f.fluid, f.advect); }, {}},
  };
}

void measure(std::vector<Kernel>& kernels, int rounds) {
  using Clock = std::chrono::steady_clock;
  for (int round = 0; round < rounds; ++round)
    for (Kernel& kernel : kernels) {
      kernel.run();
      const auto begun = Clock::now();
      kernel.run();
      kernel.seconds.push_back(std::chrono::duration<double>(Clock::now() - begun).count());
    }
  for (Kernel& kernel : kernels) std::sort(kernel.seconds.begin(), kernel.seconds.end());
}

void print(const std::vector<Kernel>& kernels, const Vec3i& cells, int threads) {
  std::printf("{\"cells\": [%d, %d, %d], \"threads\": %d, \"kernels\": [", cells[0], cells[1], cells[2], threads);
  const char* separator = "";
  for (const Kernel& kernel : kernels) {
    std::printf("%s\n  {\"name\": \"%s\", \"bytes\": %g, \"median\": %.6g, \"best\": %.6g}", separator,
                kernel.name.c_str(), kernel.bytes, kernel.seconds[kernel.seconds.size() / 2], kernel.seconds.front());
    separator = ",";
  }
  std::printf("\n]}\n");
}

// A whole number in [low, high], or low - 1 after a message.
int number(const char* name, std::string_view text, int low, int high) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && value >= low && value <= high) return value;
  std::fprintf(stderr, "efsi_bench_kernels: %s = '%.*s': must be a whole number from %d to %d\n", name,
               static_cast<int>(text.size()), text.data(), low, high);
  return low - 1;
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 6) {
    std::fprintf(stderr, "usage: efsi_bench_kernels NX NY NZ THREADS ROUNDS [NAME...]\n");
    return 2;
  }
  const Vec3i cells = {number("NX", arguments[1], 8, kMostCells), number("NY", arguments[2], 8, kMostCells),
                       number("NZ", arguments[3], 8, kMostCells)};
  const int threads = number("THREADS", arguments[4], 1, kMostThreads);
  const int rounds = number("ROUNDS", arguments[5], 1, kMostRounds);
  if (*std::min_element(cells.begin(), cells.end()) < 8 || threads < 1 || rounds < 1) return 2;

  const Parallel parallel(threads);
  Fields fields(parallel, cells);
  std::vector<Kernel> kernels = kernels_of(parallel, fields);
  const std::vector<std::string> wanted(arguments + 6, arguments + count);
  for (const std::string& name : wanted)
    if (std::none_of(kernels.begin(), kernels.end(), [&](const Kernel& kernel) { return kernel.name == name; })) {
      std::fprintf(stderr, "efsi_bench_kernels: NAME = '%s': there is no such kernel\n", name.c_str());
      return 2;
    }
  if (!wanted.empty())
    std::erase_if(kernels,
                  [&](const Kernel& k) { return std::find(wanted.begin(), wanted.end(), k.name) == wanted.end(); });
  parallel.together([&] { measure(kernels, rounds); });
  print(kernels, cells, threads);
  return std::isfinite(fields.sum) ? 0 : 1;
}
