// Purpose: what does not survive a step, in parts of one meaning each; a stage gets the parts that it names.
#pragma once

#include <array>
#include <vector>

#include "fluid/advect.hpp"
#include "fluid/viscosity.hpp"
#include "sim/hold.hpp"
#include "sim/scene.hpp"
#include "sim/state.hpp"
#include "solid/displacement.hpp"
#include "solid/momentum.hpp"
#include "solid/particles.hpp"
#include "system/contact_solve.hpp"
#include "system/pressure_solve.hpp"
#include "system/slip.hpp"
#include "system/velocity_system.hpp"

namespace efsi::sim {

// The common grid of the stages that join solids and fluid, and what matter is where on it. Made of the solids' places.
struct Matter {
  CommonGrid common;
  std::vector<std::uint8_t> fixed;    // per node: bit a: component a is fixed by a wall
  std::vector<Real> fluid_mass;       // per node, where solids leave room [kg]; empty without solids
  std::vector<Real> mass;             // of all matter per node [kg]; empty without solids
  std::vector<Real> specific_volume;  // 1/density per node [m^3/kg]
  std::vector<std::uint8_t> owned;    // padded cells: 1 + the solid whose stiffness they carry, 0; empty without solids
  std::vector<Real> cell_fraction;    // part of each cell that solids fill; empty without solids
};

// The velocity of Eq. 11.
struct NodeVelocity {
  grid::VectorField field;  // at the nodes of the common grid, at slip nodes the fluid's [m/s]
  system::SlipNodes slip;   // nodes where the fluid slips along a solid, with the solid's velocity there
};

// Friction at a row: none, sliding, or sticking.
enum class Rub : std::uint8_t { kNone, kSlides, kSticks };

// A node of a solid on a wall (sim/wall_contact.hpp).
struct WallRow {
  std::size_t solid = 0, node = 0, above = 0;  // nodes of the common grid
  Vec3i place{};                               // of the node, in the box
  bool on_wall = true;                         // or it is the first node above it that carries the solid
  int axis = 0;                                // normal of the wall
  Real out = 1;                                // +-1: along the axis, out of the wall
  double gap = 0.0;                            // to the solid's surface, < 0: beyond the wall [m]
  double vertex = 1e30;                        // the same of the lowest vertex that is nearest to the node [m]
  Real least = 0;                              // velocity along that [m/s]
  bool holds = false;                          // prescribes it
  Rub rub = Rub::kNone;
  std::uint8_t tangents = 0;  // bit a: friction acts along axis a
  Real limit = 0;             // impulse of friction at most [kg m/s]
  Vec3 way = Vec3::Zero();    // unit vector along which it slides
  Real push = 0;              // impulse of the wall along `out` in this step [kg m/s]
  Vec3 pull = Vec3::Zero();   // along the tangents, where it sticks [kg m/s]
};

// A node of a solid whose velocity is given (sim/prescribed.hpp).
struct GivenNode {
  std::size_t pin = 0, solid = 0, node = 0;  // node: of the common grid
  Vec3 velocity = Vec3::Zero();
  Vec3d impulse = Vec3d::Zero();  // reaction in this step [kg m/s]
};

// Where two solids may touch (sim/solid_contact.hpp): the rows of Eq. 8, and of each the solids and the cell of the
// box. Where a solid may touch itself (sim/fold_contact.hpp) in place of the cell the two fold points, and 0.
struct RowPlace {
  std::array<std::size_t, 2> solids{};
  Vec3i cell{};
  double gap = 0.0;    // less the skin, < 0: too deep [m]
  double skin = 0.0;   // what the row keeps between the surfaces [m]
  bool meets = false;  // active in the last step, or will be without the solids' own forces
  bool is_fold() const { return solids[0] == solids[1]; }
};
struct SolidContacts {
  std::vector<RowPlace> places;
  std::vector<system::ContactRow> rows;
  std::size_t looked = 0;  // nodes that the bands of two solids have in common, which were looked at for rows
};

// Eq. 8 on its unknowns.
struct VelocityEquation {
  system::VelocitySystem system;
  Holds holds;                   // constraints of the solids during and after the solve
  std::vector<WallRow> walls;    // what walls do
  SolidContacts contacts;        // what solids do to each other
  std::vector<GivenNode> given;  // what pins and colliders prescribe
  std::vector<Real> f_star;      // the right-hand side [kg m/s]
  std::vector<Real> v_star;      // start of the solve, then v* [m/s]
  std::vector<Real> v_old;       // at the start of the step, where there are contacts or pins [m/s]
  std::vector<Real> momentum;    // M v + dt f, which v* has to have [kg m/s]
};

// What emitters bring into the fluid in this step (sim/jets.hpp).
struct Jets {
  std::vector<fluid::SourceCell> cells;
  std::vector<double> flux;  // per emitter of the scene [m^3/s]
};

// Eqs. 11 to 13. The multiplier q of J has v = v* - M^-1 J^T q [Pa s]; J^T is minus the gradient, so q = -dt p.
struct PressureEquation {
  system::PressureSystem system;
  bool lasts = false;            // the system of a scene without solids is built
  std::vector<Real> source;      // wanted divergence per padded cell [1/s]; empty: none
  std::vector<Real> compliance;  // of cells under q, per padded cell [m^4/kg]; empty: all are rigid
  Jets jets;                     // the part of it that emitters bring
  std::vector<Real> q;           // the multiplier, padded cells; the state's pressure is put away in it meanwhile
  std::vector<Real> taken;       // the part of q that acts before the projection, padded cells
  bool takes = false;            // if this
  std::vector<Real> impulse;     // J^T q on the unknowns of Eq. 8 [kg m/s]
  double largest = 0.0;          // norm of those that Eq. 13 was solved for in the step [kg m/s]
  std::vector<Real> correction;  // G^-1 J^T q on them [m/s]
  std::vector<Vec3> answers;     // of contact to the correction, per penalty in G [kg m/s]
  Real coupled = 0;              // how much of it coupling steps have taken off; 0: there was none
  std::vector<Real> corrected;   // v* less a share of the correction on them [m/s]
  std::vector<Real> way;         // of q that the last coupling step went, padded cells
  std::vector<Real> left;        // the right-hand side of Eq. 12 before it [m^3/s]
  double slope = 0.0;            // that times the estimate from which the search direction was made
};

// What the transport has to keep.
struct TransportMomenta {
  std::vector<solid::Momenta> first;   // of the solids, at the start of the step
  std::vector<solid::Momenta> solids;  // the same before the transport
  Vec3d fluid = Vec3d::Zero();         // the fluid's before the transport [kg m/s]
};

struct Workspace {
  SolidWorks solids;
  Matter matter;
  NodeVelocity velocity;
  VelocityEquation elasticity;
  PressureEquation pressure;
  TransportMomenta momenta;
  fluid::AdvectWorkspace advect;
  solid::AdvectWorkspace solid_advect;
  fluid::ViscousWorkspace viscous;          // empty unless the fluid is viscous
  std::vector<solid::Particles> particles;  // per solid; empty where no preset asks for them
  State backup;                             // the last good state
  bool masses_ready = false;                // solids' masses and matter are those of the state

  // Another state: nothing derived from the last one is valid.
  void forget() { masses_ready = pressure.lasts = false; }
};

}  // namespace efsi::sim
