#include "record/energy_ledger.hpp"

#include "frame/grid_loops.hpp"
#include "solid/element/energy.hpp"
#include "solid/element/stiffness_block.hpp"

namespace efsi::sim {

using grid::Grid;

namespace {

// Nodes along an axis; the last one of a periodic axis is the first one again.
int node_end(const Grid& g, std::size_t axis) { return g.cells[axis] + (g.periodic[axis] ? 0 : 1); }

// Of a fluid that fills the grid, per node [kg].
std::vector<Real> uniform_mass(const Grid& g, double density) {
  std::vector<Real> mass(g.node_count(), 0);
  for (int k = 0; k <= g.cells[2]; ++k)
    for (int j = 0; j <= g.cells[1]; ++j)
      for (int i = 0; i <= g.cells[0]; ++i)
        mass[g.node(i, j, k)] = static_cast<Real>(density * g.h * g.h * g.h / 8.0 * adjacent_cells(g, i, j, k));
  return mass;
}

// What a velocity change p adds to the kinetic energy of a mass M with the momentum P: p.P + M p^2 / 2.
double work_of_change(const Vec3& velocity_change, double mass, const Vec3d& momentum) {
  const Vec3d p = velocity_change.cast<double>();
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

// Work of the solid's internal forces over the change of its velocity to that of the nodes of `common` [kg m^2/s^3].
double power_of_change(const Parallel& parallel, const Grid& common, const solid::SolidState& state,
                       const solid::SolidWork& work, const grid::VectorField& velocity) {
  const Grid& g = state.band.grid;
  const Vec3i lo = grid::offset(g, common);
  const auto corner = grid::corner_offsets(g);
  return parallel.sum(static_cast<std::int64_t>(work.blocks()), [&](std::int64_t b) {
    const auto first = static_cast<std::size_t>(b) * solid::kBlock;
    Real force[24 * solid::kBlock];
    solid::block_force(state, work, static_cast<std::size_t>(b), force);
    double sum = 0.0;
    for (std::size_t lane = 0; lane < solid::kBlock && first + lane < work.element_corner.size(); ++lane)
      for (std::size_t a = 0; a < 8; ++a) {
        const std::size_t n = static_cast<std::size_t>(work.element_corner[first + lane]) + corner[a];
        const Vec3i at = g.node_place(n);
        const Vec3 change = velocity.at(common.node(at[0] + lo[0], at[1] + lo[1], at[2] + lo[2])) - state.v.at(n);
        for (std::size_t c = 0; c < 3; ++c)
          sum += static_cast<double>(force[(3 * a + c) * solid::kBlock + lane]) *
                 static_cast<double>(change[static_cast<Eigen::Index>(c)]);
      }
    return sum;
  });
}

}  // namespace

double kinetic_energy(const Parallel& parallel, const Grid& g, const std::vector<Real>& mass,
                      const grid::VectorField& velocity, const Vec3& velocity_change) {
  const Vec3d shift = velocity_change.cast<double>();
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

EnergyLedger::EnergyLedger(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                           const Matter& matter, const grid::VectorField& fluid_velocity)
    : parallel_(step.parallel), scene_(step.scene), dt_(step.dt), states_(states), solids_(solids) {
  if (!scene_.params.energy_ledger) return;
  record_ = &step.info.energy.emplace();
  const fluid::FluidParams& fluid = scene_.params.fluid;
  common_ = matter.common.grid;
  if (fluid.present) {
    fluid_mass_ = states.empty() ? uniform_mass(common_, fluid.density) : matter.fluid_mass;
    fluid_velocity_ = fluid_velocity;
  }
  for (std::size_t l = 0; l < states.size(); ++l)
    first_.push_back(solid::measure_momenta(parallel_, states[l].band, solids[l], states[l].band.grid, states[l].v));
  Energy start = with_solids({});
  start.fluid_kinetic = fluid_energy(fluid_mass_, fluid_velocity);
  record_->at_end = record_->at_start = start;
}

void EnergyLedger::book(EnergyStage stage, const Energy& now) {
  record_->change[static_cast<std::size_t>(stage)] += now - record_->at_end;
  record_->at_end = now;
}

double EnergyLedger::fluid_energy(const std::vector<Real>& mass, const grid::VectorField& velocity) const {
  return scene_.params.fluid.present ? kinetic_energy(parallel_, common_, mass, velocity) : 0.0;
}

double EnergyLedger::potential(std::size_t l, const Vec3d& center) const {
  const fluid::FluidParams& fluid = scene_.params.fluid;
  const double mass = solids_[l].total_mass, volume_at_rest = mass / scene_.solids[l].density;
  const double displaced = fluid.present ? fluid.density * volume_at_rest : 0.0;
  return -(mass - displaced) * scene_.params.gravity.dot(center);
}

bool EnergyLedger::counts(std::size_t l) const { return !is_collider(scene_.pins, l); }

Energy EnergyLedger::shape_of(std::size_t l) const {
  const solid::ShapeEnergies shape = solid::measure_shape(parallel_, scene_.solids[l], states_[l], solids_[l],
                                                          scene_.params.numerics.points_per_element);
  return {shape.kinetic, shape.elastic, 0.0, potential(l, shape.center)};
}

Energy EnergyLedger::with_solids(Energy now) const {
  now.solid_kinetic = now.elastic = now.potential = 0.0;
  for (std::size_t l = 0; l < states_.size(); ++l) {
    if (!counts(l)) continue;
    const solid::SolidState& state = states_[l];
    const solid::Momenta momenta = solid::measure_momenta(parallel_, state.band, solids_[l], state.band.grid, state.v);
    now.solid_kinetic += momenta.kinetic_energy;
    now.potential += potential(l, momenta.center);
    now.elastic += solid::elastic_energy(parallel_, scene_.solids[l], state, solids_[l],
                                         scene_.params.numerics.points_per_element);
  }
  return now;
}

void EnergyLedger::book_forces(const Matter& matter, const grid::VectorField& fluid_velocity) {
  if (!on()) return;
  book_solids(EnergyStage::kExternal);
  if (scene_.params.fluid.present) book_fluid(EnergyStage::kExternal, matter, fluid_velocity);
  for (std::size_t l = 0; l < states_.size(); ++l)
    first_[l] = solid::measure_momenta(parallel_, states_[l].band, solids_[l], states_[l].band.grid, states_[l].v);
}

void EnergyLedger::book_weight(const StepWeight& weight, const grid::VectorField& fluid_velocity) {
  if (!on()) return;
  Energy now = record_->at_end;
  for (std::size_t l = 0; l < weight.solids.size(); ++l)
    if (counts(l)) now.solid_kinetic += work_of_change(weight.solids[l], first_[l].mass, first_[l].linear);
  if (!weight.fluid.isZero(0))
    now.fluid_kinetic = kinetic_energy(parallel_, common_, fluid_mass_, fluid_velocity, weight.fluid);
  book(EnergyStage::kWeight, now);
}

void EnergyLedger::book_nodes(EnergyStage stage, NodeVelocity& velocity) {
  if (!on()) return;
  Energy now = record_->at_end;
  now.fluid_kinetic = fluid_energy(fluid_mass_, velocity.field);
  now.solid_kinetic = 0.0;
  for (std::size_t l = 0; l < states_.size(); ++l) {
    if (!counts(l)) continue;
    const system::SolidView view(parallel_, velocity.slip, l, velocity.field);
    now.solid_kinetic +=
        solid::measure_momenta(parallel_, states_[l].band, solids_[l], common_, velocity.field).kinetic_energy;
  }
  book(stage, now);
}

void EnergyLedger::book_source(const std::vector<Real>& pressure, const std::vector<Real>& source) {
  if (on()) record_->source_work += source_work(parallel_, common_, pressure, source, dt_);
}

void EnergyLedger::meet(NodeVelocity& velocity, std::span<const solid::BodyStep> frames) {
  if (!on()) return;
  if (scene_.params.fluid.present) {
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t n = 0; n < velocity.field.size(); ++n)
        fluid_velocity_.c[a][n] = Real(0.5) * (fluid_velocity_.c[a][n] + velocity.field.c[a][n]);
    record_->at_start.fluid_kinetic = fluid_energy(fluid_mass_, fluid_velocity_);
  }
  record_->at_start.solid_kinetic = 0.0;
  for (std::size_t l = 0; l < states_.size(); ++l) {
    if (!counts(l)) continue;
    const system::SolidView view(parallel_, velocity.slip, l, velocity.field);
    const solid::BodyStep& f = frames[l];
    const solid::RigidMotion back{f.velocity.center, f.shift / dt_ - f.velocity.linear,
                                  f.turn / dt_ - f.velocity.angular};
    record_->at_start.solid_kinetic +=
        mean_energy(parallel_, common_, states_[l], solids_[l].mass, velocity.field, back);
    record_->at_start.elastic -=
        0.25 * dt_ * power_of_change(parallel_, common_, states_[l], solids_[l], velocity.field);
  }
}

void EnergyLedger::leave(std::size_t l) {
  if (on() && counts(l)) left_ += shape_of(l);
}

void EnergyLedger::book_fluid(const grid::VectorField& fluid_velocity) {
  if (!on()) return;
  Energy now = record_->at_end;
  now.fluid_kinetic = fluid_energy(fluid_mass_, fluid_velocity);
  book(EnergyStage::kFluidTransport, now);
}

void EnergyLedger::book_inflow(const Jets& jets, const grid::VectorField& flow) {
  if (!on()) return;
  const double mass_of_cell = scene_.params.fluid.density * common_.h * common_.h * common_.h;
  const auto corner = grid::corner_offsets(common_);
  double brought = 0.0;
  for (const fluid::SourceCell& source : jets) {
    const std::size_t n = common_.node(source.place[0], source.place[1], source.place[2]);
    double square = 0.0;
    for (const std::size_t o : corner) square += flow.at(n + o).cast<double>().squaredNorm() / 8.0;
    brought += 0.5 * mass_of_cell * dt_ * static_cast<double>(source.rate) * square;
  }
  record_->change[static_cast<std::size_t>(EnergyStage::kExternal)].fluid_kinetic += brought;
  record_->change[static_cast<std::size_t>(EnergyStage::kFluidTransport)].fluid_kinetic -= brought;
}

void EnergyLedger::arrive() {
  if (!on()) return;
  Energy transported = record_->at_end;
  for (std::size_t l = 0; l < states_.size(); ++l)
    if (counts(l)) transported += shape_of(l);
  book(EnergyStage::kSolidTransport, transported - left_);
  book_solids(EnergyStage::kRemap);
}

void EnergyLedger::book_solids(EnergyStage stage) {
  if (on()) book(stage, with_solids(record_->at_end));
}

void EnergyLedger::book_fluid(EnergyStage stage, const Matter& matter, const grid::VectorField& fluid_velocity) {
  if (!on()) return;
  Energy now = record_->at_end;
  now.fluid_kinetic = fluid_energy(states_.empty() ? fluid_mass_ : matter.fluid_mass, fluid_velocity);
  book(stage, now);
}

}  // namespace efsi::sim
