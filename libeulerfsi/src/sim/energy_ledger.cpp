#include "sim/energy_ledger.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// Nodes along an axis; the last one of a periodic axis is the first one again.
int node_end(const Grid& g, std::size_t axis) { return g.cells[axis] + (g.periodic[axis] ? 0 : 1); }

// Of a fluid that fills the grid, per node [kg].
std::vector<Real> uniform_mass(const Grid& g, double density) {
  std::vector<Real> mass(g.node_count(), 0);
  const auto cells = [&](std::size_t axis, int i) {
    return g.periodic[axis] || (i > 0 && i < g.cells[axis]) ? 2.0 : 1.0;
  };
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        mass[g.node(i, j, k)] =
            static_cast<Real>(density * g.h * g.h * g.h / 8.0 * cells(0, i) * cells(1, j) * cells(2, k));
  return mass;
}

// What a push p adds to the kinetic energy of a mass M with the momentum P: p.P + M p^2 / 2.
double push_work(const Vec3& push, double mass, const Vec3d& momentum) {
  const Vec3d p = push.cast<double>();
  return p.dot(momentum) + 0.5 * mass * p.squaredNorm();
}

// 1/2 sum m w^2 of a solid, w the mean of its velocity and that of the nodes of `common`, and `back` added.
double mean_energy(const Parallel& parallel, const Grid& common, const solid::SolidState& state,
                   const std::vector<Real>& mass, const grid::VectorField& velocity, const solid::RigidMotion& back) {
  const Grid& g = state.band.grid;
  const Vec3i lo = grid::offset(g, common);
  return parallel.sum(g.cells[2] + 1, [&](std::int64_t kk) {
    const int k = static_cast<int>(kk);
    double sum = 0.0;
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i) {
        const std::size_t n = g.node(i, j, k);
        if (!(mass[n] > 0)) continue;
        const Vec3d now = velocity.at(common.node(i + lo[0], j + lo[1], k + lo[2])).cast<double>();
        const Vec3d w = 0.5 * (state.v.at(n).cast<double>() + now) + back.at(g.node_position(i, j, k));
        sum += 0.5 * static_cast<double>(mass[n]) * w.squaredNorm();
      }
    return sum;
  });
}

}  // namespace

Energy& Energy::operator+=(const Energy& other) {
  solid_kinetic += other.solid_kinetic;
  elastic += other.elastic;
  fluid_kinetic += other.fluid_kinetic;
  potential += other.potential;
  return *this;
}

Energy operator-(const Energy& a, const Energy& b) {
  return {a.solid_kinetic - b.solid_kinetic, a.elastic - b.elastic, a.fluid_kinetic - b.fluid_kinetic,
          a.potential - b.potential};
}

double kinetic_energy(const Parallel& parallel, const Grid& g, const std::vector<Real>& mass,
                      const grid::VectorField& velocity, const Vec3& push) {
  const Vec3d shift = push.cast<double>();
  return parallel.sum(node_end(g, 2), [&](std::int64_t k) {
    double sum = 0.0;
    for (int j = 0; j < node_end(g, 1); ++j)
      for (int i = 0; i < node_end(g, 0); ++i) {
        const std::size_t n = g.node(i, j, static_cast<int>(k));
        sum += 0.5 * static_cast<double>(mass[n]) * (velocity.at(n).cast<double>() + shift).squaredNorm();
      }
    return sum;
  });
}

double source_work(const Parallel& parallel, const Grid& g, const std::vector<Real>& pressure,
                   const std::vector<Real>& source, double dt) {
  if (source.empty() || pressure.empty()) return 0.0;
  return dt * g.h * g.h * g.h * parallel.sum(g.cells[2], [&](std::int64_t k) {
    double sum = 0.0;
    for (int j = 0; j < g.cells[1]; ++j)
      for (int i = 0; i < g.cells[0]; ++i) {
        const std::size_t c = g.padded(i, j, static_cast<int>(k));
        sum += static_cast<double>(pressure[c]) * static_cast<double>(source[c]);
      }
    return sum;
  });
}

void EnergyLedger::book(EnergyStage stage, const Energy& now) {
  record_.change[static_cast<std::size_t>(stage)] += now - record_.end;
  record_.end = now;
}

double EnergyLedger::fluid_energy(const std::vector<Real>& mass, const grid::VectorField& velocity) const {
  return around_.fluid ? kinetic_energy(parallel_, common_, mass, velocity) : 0.0;
}

double EnergyLedger::potential(std::size_t l, const Vec3d& center) const {
  const solid::SolidWork& work = solids_.work[l];
  const double volume = solids_.rest[l].compressible ? work.volume : work.total_mass / solids_.rest[l].density;
  const double displaced = around_.fluid ? around_.density * volume : 0.0;
  return -(work.total_mass - displaced) * around_.gravity.dot(center);
}

Energy EnergyLedger::of_states(const std::vector<Real>& fluid_mass, const grid::VectorField& fluid_velocity,
                               bool deformed) const {
  Energy now;
  if (!deformed) now.elastic = record_.end.elastic;
  for (std::size_t l = 0; l < solids_.state.size(); ++l) {
    const solid::SolidState& state = solids_.state[l];
    const solid::SolidWork& work = solids_.work[l];
    const solid::Momenta momenta = solid::measure_momenta(parallel_, state.band, work, state.band.grid, state.v);
    now.solid_kinetic += momenta.kinetic_energy;
    now.potential += potential(l, momenta.center);
    if (deformed)
      now.elastic += solid::elastic_energy(parallel_, solids_.rest[l], state, work, solids_.points_per_element);
  }
  now.fluid_kinetic = fluid_energy(solids_.state.empty() ? fluid_mass_ : fluid_mass, fluid_velocity);
  return now;
}

void EnergyLedger::open(const Grid& common, const std::vector<Real>& fluid_mass,
                        const grid::VectorField& fluid_velocity) {
  if (!on_) return;
  common_ = common;
  fluid_mass_ = solids_.state.empty() ? uniform_mass(common, around_.density) : fluid_mass;
  for (std::size_t l = 0; l < solids_.state.size(); ++l) {
    const solid::SolidState& state = solids_.state[l];
    first_.push_back(solid::measure_momenta(parallel_, state.band, solids_.work[l], state.band.grid, state.v));
  }
  record_.end = record_.at_start = of_states(fluid_mass_, fluid_velocity, true);
  if (around_.fluid) fluid_velocity_ = fluid_velocity;
}

void EnergyLedger::weigh(const grid::VectorField& fluid_velocity, const Vec3& fluid, std::span<const Vec3> solids) {
  if (!on_) return;
  Energy now = record_.end;
  for (std::size_t l = 0; l < solids.size(); ++l)
    now.solid_kinetic += push_work(solids[l], first_[l].mass, first_[l].linear);
  if (!fluid.isZero(0)) now.fluid_kinetic = kinetic_energy(parallel_, common_, fluid_mass_, fluid_velocity, fluid);
  book(EnergyStage::kWeight, now);
}

void EnergyLedger::book_nodes(EnergyStage stage, system::SlipNodes& slip, grid::VectorField& velocity) {
  if (!on_) return;
  Energy now = record_.end;
  now.fluid_kinetic = fluid_energy(fluid_mass_, velocity);
  now.solid_kinetic = 0.0;
  const system::SolidView view(parallel_, slip, velocity);
  for (std::size_t l = 0; l < solids_.state.size(); ++l)
    now.solid_kinetic +=
        solid::measure_momenta(parallel_, solids_.state[l].band, solids_.work[l], common_, velocity).kinetic_energy;
  book(stage, now);
}

void EnergyLedger::meet(system::SlipNodes& slip, grid::VectorField& velocity, std::span<const solid::RigidStep> frames,
                        double dt) {
  if (!on_) return;
  if (around_.fluid) {
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t n = 0; n < velocity.size(); ++n)
        fluid_velocity_.c[a][n] = Real(0.5) * (fluid_velocity_.c[a][n] + velocity.c[a][n]);
    record_.at_start.fluid_kinetic = fluid_energy(fluid_mass_, fluid_velocity_);
  }
  record_.at_start.solid_kinetic = 0.0;
  const system::SolidView view(parallel_, slip, velocity);
  for (std::size_t l = 0; l < solids_.state.size(); ++l) {
    const solid::RigidStep& f = frames[l];
    const solid::RigidMotion back{f.velocity.center, f.shift / dt - f.velocity.linear,
                                  f.turn / dt - f.velocity.angular};
    record_.at_start.solid_kinetic +=
        mean_energy(parallel_, common_, solids_.state[l], solids_.work[l].mass, velocity, back);
  }
}

void EnergyLedger::book_source(const std::vector<Real>& pressure, const std::vector<Real>& source, double dt) {
  if (on_) record_.source_work += source_work(parallel_, common_, pressure, source, dt);
}

void EnergyLedger::leave(std::size_t l) {
  if (!on_) return;
  const solid::ShapeEnergies shape =
      solid::measure_shape(parallel_, solids_.rest[l], solids_.state[l], solids_.work[l], solids_.points_per_element);
  shape_ += {shape.kinetic, shape.elastic, 0.0, potential(l, shape.center)};
}

void EnergyLedger::book_fluid(const grid::VectorField& fluid_velocity) {
  if (!on_) return;
  Energy now = record_.end;
  now.fluid_kinetic = fluid_energy(fluid_mass_, fluid_velocity);
  book(EnergyStage::kFluidTransport, now);
}

void EnergyLedger::arrive(const std::vector<Real>& fluid_mass, const grid::VectorField& fluid_velocity) {
  if (!on_) return;
  Energy moved;
  for (std::size_t l = 0; l < solids_.state.size(); ++l) {
    const solid::ShapeEnergies shape =
        solid::measure_shape(parallel_, solids_.rest[l], solids_.state[l], solids_.work[l], solids_.points_per_element);
    moved += {shape.kinetic, shape.elastic, 0.0, potential(l, shape.center)};
  }
  Energy transported = record_.end;
  transported += moved - shape_;
  book(EnergyStage::kSolidTransport, transported);
  book(EnergyStage::kRemap, of_states(fluid_mass, fluid_velocity, true));
}

void EnergyLedger::book_state(EnergyStage stage, const std::vector<Real>& fluid_mass,
                              const grid::VectorField& fluid_velocity, bool deformed) {
  if (on_) book(stage, of_states(fluid_mass, fluid_velocity, deformed));
}

}  // namespace efsi::sim
