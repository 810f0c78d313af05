#include "solve/viscosity.hpp"

#include <algorithm>
#include <optional>

#include "frame/grid_loops.hpp"
#include "linalg/reduce.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// Solids respond where what viscosity could give a node at their surface is more than this part of the node's mass.
constexpr double kRespondsAbove = 0.02;

// Whether Eq. 8 matters for what viscosity does in the step: dt mu h against the lightest mass of a node, rho h^3 / 2.
bool responds(const StepContext& step) {
  const auto lighter = [](const solid::SolidRest& a, const solid::SolidRest& b) { return a.density < b.density; };
  const auto& solids = step.scene.solids;
  if (solids.empty()) return false;
  const double density = std::min_element(solids.begin(), solids.end(), lighter)->density, h = step.scene.grid.h;
  return step.dt * step.scene.params.fluid.viscosity > kRespondsAbove * 0.5 * density * h * h;
}

// The unknowns of Eq. 8 among the entries of the viscous solve: those of shared nodes stand behind the field's.
class ElasticEntries {
 public:
  // before: v at the unknowns before the forces of the step; v_star: with them.
  ElasticEntries(const Parallel& parallel, const Grid& g, const std::vector<Real>& before, VelocityEquation& elasticity)
      : parallel_(parallel), system_(elasticity.system), entry_(elasticity.f_star.size()) {
    const std::size_t field = 3 * g.node_count();
    std::size_t entries = field;
    for (std::size_t i = 0; i < entry_.size(); ++i)
      entry_[i] = system_.is_shared(i / 3) ? entries++ : i % 3 * g.node_count() + system_.nodes()[i / 3];
    response_.mass.resize(entries - field);
    response_.diagonal.assign(entries, 0);
    response_.internal.assign(entries, 0);
    // f* - G v, on the field less M (v* - v)
    std::vector<Real> forces = elasticity.v_star;
    linalg::add_scaled(parallel, forces, -1.0, before);
    system_.multiply_mass(parallel, forces, in_);
    system_.multiply(parallel, before, out_);
    for (std::size_t i = 0; i < entry_.size(); ++i) {
      const double inertia = system_.inertia(i / 3), all = 1.0 / system_.mobility(i / 3);
      if (entry_[i] >= field) response_.mass[entry_[i] - field] = static_cast<Real>(inertia);
      if (!(system_.free()[i] > 0)) continue;
      response_.diagonal[entry_[i]] = static_cast<Real>(std::max(all - inertia, 0.0));
      const Real unbalanced = elasticity.f_star[i] - out_[i];
      response_.internal[entry_[i]] = entry_[i] < field ? unbalanced - in_[i] : unbalanced;
    }
    response_.add = [this](const std::vector<Real>& x, std::vector<Real>& y) {
      gather(x, in_);
      system_.apply_stiffness(parallel_, in_, out_);
      add_to(y);
    };
    response_.correct = [this](const std::vector<Real>& r, std::vector<Real>& z) {
      gather(r, in_);
      out_.assign(in_.size(), 0);
      system_.add_coarse_levels(parallel_, in_, out_);
      add_to(z);
    };
  }
  ElasticEntries(const ElasticEntries&) = delete;
  ElasticEntries& operator=(const ElasticEntries&) = delete;
  const fluid::SolidResponse& response() const { return response_; }

  // x at the unknowns, 0 where something prescribes it.
  void gather(const std::vector<Real>& x, std::vector<Real>& unknowns) const {
    unknowns.resize(entry_.size());
    parallel_.for_each(static_cast<std::int64_t>(entry_.size()), [&](std::int64_t n) {
      const auto i = static_cast<std::size_t>(n);
      unknowns[i] = x[entry_[i]] * system_.free()[i];
    });
  }

 private:
  void add_to(std::vector<Real>& y) const {
    parallel_.for_each(static_cast<std::int64_t>(entry_.size()), [&](std::int64_t i) {
      y[entry_[static_cast<std::size_t>(i)]] += out_[static_cast<std::size_t>(i)];
    });
  }

  const Parallel& parallel_;
  system::VelocitySystem& system_;
  std::vector<std::size_t> entry_;  // of each component of an unknown
  std::vector<Real> in_, out_;      // unknowns
  fluid::SolidResponse response_;
};

// Masses of the nodes for the solve; 0 where the velocity is given.
void set_masses(const StepContext& step, const Matter& matter, const NodeVelocity& velocity, std::vector<Real>& mass) {
  const Grid& g = matter.common.grid;
  const double eighth = g.h * g.h * g.h / 8.0;
  mass.resize(g.node_count());
  step.parallel.for_each(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        const double volume = static_cast<double>(matter.specific_volume[n]);  // 0: given
        mass[n] = static_cast<Real>(volume > 0.0 ? eighth * adjacent_cells(g, i, j, k) / volume : 0.0);
      }
  });
  // Where solids share a node the field holds the film between them.
  for (const system::SlipNode& n : velocity.slip.nodes())
    if (n.shared() && mass[n.node] > 0) mass[n.node] = n.fluid_mass;
}

}  // namespace

void diffuse_velocity(const StepContext& step, const Matter& matter, NodeVelocity& before, VelocityEquation& elasticity,
                      NodeVelocity& velocity, fluid::ViscousWorkspace& work) {
  ScopedTimer timer(step.profile, Stage::kFluidForces);
  const Grid& g = matter.common.grid;
  system::VelocitySystem& system = elasticity.system;
  set_masses(step, matter, velocity, work.mass);
  std::optional<ElasticEntries> solids;
  std::vector<Real> first;  // at the unknowns
  if (responds(step)) {
    system.gather(step.parallel, before.field, before.slip, first);
    for (std::size_t i = 0; i < first.size(); ++i)
      if (!(system.free()[i] > 0)) first[i] = elasticity.v_star[i];
    solids.emplace(step.parallel, g, first, elasticity);
  }
  const double viscosity = step.scene.params.fluid.viscosity;
  const bool reactions = !elasticity.given.empty();
  const linalg::SolveStats stats = fluid::diffuse(
      step.parallel, g,
      {matter.fixed, matter.owned, viscosity, step.dt, before.field, solids ? &solids->response() : nullptr, reactions},
      velocity.field, work);
  step.info.unconverged += !stats.converged;
  timer.visited(g.node_count(), static_cast<std::uint64_t>(stats.iterations + 1) * 12 * sizeof(Real));
  if (step.scene.solids.empty()) return;
  for (const PrescribedNode& n : elasticity.given)
    for (std::size_t a = 0; a < 3; ++a)
      elasticity.f_star[3 * system.unknown_of(n.solid, n.node) + a] += work.right[a * g.node_count() + n.node];
  // The impulse on the unknowns; their solve starts at the response.
  std::vector<Real> after, impulse;
  system.gather(step.parallel, velocity.field, velocity.slip, after);
  std::vector<Real> change = after;
  linalg::add_scaled(step.parallel, change, -1.0, elasticity.v_star);
  system.multiply_mass(step.parallel, change, impulse);
  linalg::add_scaled(step.parallel, elasticity.f_star, 1.0, impulse);
  linalg::multiply(step.parallel, impulse, system.moves(), impulse);
  linalg::add_scaled(step.parallel, elasticity.momentum, 1.0, impulse);
  if (solids) {
    solids->gather(work.x, after);
    linalg::add_scaled(step.parallel, after, 1.0, first);
  }
  for (std::size_t i = 0; i < after.size(); ++i)
    if (system.free()[i] > 0) elasticity.v_star[i] = after[i];
}

}  // namespace efsi::sim
