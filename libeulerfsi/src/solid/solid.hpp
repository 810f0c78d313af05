// Purpose: one elastic solid l: what it is (constant), its state on the grid, and the per-step workspace.
// Everything lives in a band, a box of the grid around the solid: five solids cost five bands, not five grids.
// Symbols: u displacement (x - X) [m]; v velocity [m/s]; X material position; phi signed distance at rest [m].
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geometry/mesh_sdf.hpp"
#include "geometry/nearest_triangle.hpp"
#include "geometry/signed_distance.hpp"
#include "geometry/triangle_mesh.hpp"
#include "grid/grid.hpp"
#include "material/plastic_flow.hpp"
#include "solid/surface_data.hpp"
#include "solid/thin_parts.hpp"

namespace efsi::solid {

using grid::Grid;
using grid::VectorField;

// A cell that did so in the last step does until `lag` less of it is solid, one that did not waits for as much more:
// else a solid at rest takes stiffness up and drops it again in turns, and never comes to rest.
struct Threshold {
  Real fraction = Real(0.6), lag = Real(0.1);
};

// What the choice of elements remembers of a cell (SolidState::stiff): whether it carried stiffness in the last step;
// that it has no lag; beside a collider, times kRoomUnit, the part of the cell that the solid can fill.
enum CellMemory : std::uint8_t { kCarried = 1, kNoLag = 2, kRoomUnit = 4 };

// What the caller says of a solid and the steps read as it is: a parameter becomes a member here and nowhere else.
struct Properties {
  double density = 1000.0;  // [kg/m^3]
  double rayleigh_alpha = 0.0, rayleigh_beta = 0.0;
  double friction = 0.0;               // Coulomb's coefficient; of two solids the mean
  double contact_stiffness = 10000.0;  // k of Eq. 14; of two solids the mean [N/m]
  bool compressible = false;           // it may change its volume
  material::Plastic plastic;
};

// Constant.
struct SolidRest : Properties {
  material::Elastic elastic;
  Grid lattice;                        // of what belongs to its material (solid/element/material_lattice.hpp)
  std::uint64_t definition = 0;        // hash of the parameters it was made of, for the scene hash
  double bulk = 0.0;                   // stiffness against that which the pressure has, not the elements [Pa]
  geometry::SignedDistance distance;   // material space
  geometry::TriangleMesh surface;      // as passed, material space; in a slab what lies beyond it is on its faces
  geometry::NearestTriangle nearest;   // of the surface at rest; empty: nothing asks
  std::vector<double> along;           // in a slab: where the surface's points were given along its axis [m]
  SurfaceClusters clusters;            // of its points; none: no vertex is mended
  std::vector<FoldPoint> fold_points;  // of it; empty: its folds do not see each other
  Threshold element;                   // parts of cells that carry its stiffness
  Real sliver = 1;                     // solid fraction above which all other cells carry it as slivers; 1: none
  ThinParts thin;                      // where they do from a lower one on; none: nowhere
  bool wet = false;                    // a fluid fills its cut cells
  bool stiff_by_part = false;          // an element is as stiff as it is solid
  double volume = 0.0;                 // of the closed rest shape [m^3]
  double mass_volume = 0.0;            // what it weighs, over its density; 0: as its cells count it [m^3]
  double area = 0.0;                   // of the surface at rest [m^2]
  double thinnest = 0.0;               // its thinnest feature [m]; 0: not known
  std::vector<std::shared_ptr<const geometry::SignedDistance>> held;  // regions of pins, material space; < 0 inside
};

// Whether a pressure acts in its cells.
inline bool has_pressure(const SolidRest& rest) { return !rest.compressible || rest.bulk > 0.0; }

// The part of the box's grid around a solid.
struct Band {
  Grid grid;
};

// What a node of the band holds: nothing; u and v as given, or that came from among the nodes that carried the solid;
// that came from between these and the extension; that the extension made up.
inline constexpr std::uint8_t kNoData = 0, kKnown = 1, kEdge = 2, kExtrapolated = 3;

// Impulses of a wall at a node with an active row in the last step.
struct WallImpulse {
  std::int32_t node[3], axis;  // of the box; the wall's normal
  Real force;                  // away from the wall [N]
  Real friction_force[3];      // of friction [N]
  std::int32_t slides;         // or would have
};

// What another solid did in a cell of the box in the last step, or another part of the same one: then in place of the
// cell both fold points, and 0.
struct ContactImpulse {
  std::int32_t cell[3], other;
  Real force;              // on the other, along the normal [N]
  Real friction_force[3];  // of friction on the other [N]
};

// A vertex of the surface that is deep in another solid: the normal of that one at rest where it went in.
struct DeepVertex {
  std::int32_t vertex, other;
  Real normal[3];
};

// Plastic strain at a node of the lattice: H = 1/2 log(F_p^T F_p), whose trace is 0.
struct PlasticNode {
  Real log[5];       // xx yy yz zx xy
  Real accumulated;  // equivalent plastic strain that has flown
};

// The surface of a collider whose points are given, where they are: material space.
struct PrescribedShape {
  std::shared_ptr<const geometry::Surface> surface;
  geometry::NearestTriangle nearest;  // of it
  std::size_t bytes() const;
};

// How long a step may be that keeps a solid's energy, since one has not; 0: that is not looked at [s].
struct LossLimit {
  double step = 0.0;
  bool holds() const { return step > 0.0; }
};

// State: survives a step.
struct SolidState {
  Band band;
  VectorField u;                         // displacement, band nodes [m]
  VectorField v;                         // velocity, band nodes [m/s]
  VectorField change;                    // of v in the last step, moved with it, band nodes; empty: not known [m/s]
  double change_time = 0.0;              // length of that step [s]
  std::vector<std::uint8_t> valid;       // band nodes: kNoData, or where u and v came from in the last step
  std::vector<std::uint8_t> stiff;       // band cells: CellMemory; empty: nothing is remembered
  std::vector<WallImpulse> presses;      // rows at walls in the last step
  std::vector<ContactImpulse> contacts;  // active contact rows with itself and later solids in the last step
  std::vector<DeepVertex> deep;          // of the surface in other solids, in the order of (other, vertex)
  std::vector<PlasticNode> plastic;      // nodes of rest.lattice; empty: it cannot yield
  std::vector<Real> dilatation;          // of it, the volume ratio that the pressure answers to, 0: not known; empty:
                                         // the pressure has no bulk stiffness (solid/element/dilatation.hpp)
  double flow_due = 0.0;                 // half of the last step, in which that has yet to flow; 0: no step yet [s]
  std::vector<Vec3d> surface;            // positions of the embedded surface [m]
  double rest_volume_cells = 0.0;        // by cell fractions, at the first step [m^3]
  std::uint8_t whole = 1;                // no part of it has left through an open face
  double speed = 0.0;                    // largest component of the velocity in the last step [m/s]
  double acceleration = -1.0;            // of its centre of mass in the last step; < 0: not known [m/s^2]
  double leak = 0.0;                     // volume that the last step lost by the mesh, over that at rest
  LossLimit by_loss;                     // of the next step
  // In place of that at rest, of a collider whose points are given. It follows from those: no part of a checkpoint.
  std::shared_ptr<const PrescribedShape> shape;
};

// Whether all of it has left the box through open faces: then its band is one cell, whose nodes hold its velocity only
// (transport/left_box.hpp).
inline bool has_left(const SolidState& state) {
  return !state.whole && state.band.grid.cells == Vec3i{1, 1, 1} &&
         std::all_of(state.valid.begin(), state.valid.end(), [](std::uint8_t mark) { return mark == kNoData; });
}

// The surface in material space that a solid's map leads to: signed distance, points, nearest triangle.
inline const geometry::SignedDistance& distance_of(const SolidRest& rest, const SolidState& state) {
  return state.shape ? state.shape->surface->distance : rest.distance;
}
inline const std::vector<Vec3d>& points_of(const SolidRest& rest, const SolidState& state) {
  return state.shape ? state.shape->surface->mesh.points : rest.surface.points;
}
inline const geometry::NearestTriangle& nearest_of(const SolidRest& rest, const SolidState& state) {
  return state.shape ? state.shape->nearest : rest.nearest;
}

// Calls fields.value(x) or fields.array(x) for all that a solid's state holds. One list serves checkpoint, hash and
// memory count.
template <class State, class Fields>
void visit_fields(State& s, Fields& fields) {
  fields.value(s.band.grid.cells);
  fields.value(s.band.grid.h);
  for (int a = 0; a < 3; ++a) fields.value(s.band.grid.origin[a]);
  fields.value(s.band.grid.lo);
  for (auto& c : s.u.c) fields.array(c);
  for (auto& c : s.v.c) fields.array(c);
  for (auto& c : s.change.c) fields.array(c);
  if (s.change.size() > 0) fields.value(s.change_time);
  fields.array(s.valid);
  fields.array(s.stiff);
  fields.array(s.presses);
  fields.array(s.contacts);
  fields.array(s.deep);
  fields.array(s.plastic);
  fields.array(s.dilatation);
  if (!s.plastic.empty()) fields.value(s.flow_due);
  fields.array(s.surface);
  fields.value(s.rest_volume_cells);
  fields.value(s.whole);
  fields.value(s.speed);
  fields.value(s.acceleration);
  fields.value(s.leak);
  fields.value(s.by_loss);
}

// One quadrature point of an element: the linearised material in the frame of the principal axes.
// With E = U^T (sum_a v_a grad N_a^T) U the change of Kirchhoff stress is U T U^T,
//   T_ii = sum_j normal_ij E_jj,  (T_ij, T_ji) = 2x2 pair matrix (E_ij, E_ji).
struct ElementPoint {
  Real axes[9];       // U, column-major
  Real normal[6];     // xx yy zz yz zx xy, weighted by the volume of the point [J]
  Real pair[9];       // for pairs (y,z), (z,x), (x,y): [ij ij], [ij ji], [ji ji] [J]
  Real stress[6];     // Kirchhoff stress times volume, world axes: xx yy zz yz zx xy [J]
  Real local[3];      // where it is in a one-point element; else 0 (solid/hexahedron.hpp)
  Real hourglass[4];  // stiffness k of the hourglass modes of a one-point element, and k / stretch^2 along the axes
                      // [N/m]
};

// The points of kBlock elements side by side, so that one instruction works on many of them.
inline constexpr std::size_t kBlock = 16;
struct PointBlock {
  Real axes[9][kBlock], normal[6][kBlock], pair[9][kBlock], stress[6][kBlock], local[3][kBlock], hourglass[4][kBlock];
};

// Motion of a solid in the cells whose nodes hold data of its own, which may be noisy where a part of it is crushed:
// volume [m^3], the integral of v^2/2 [m^5/s^2], and that of the root of 2 mu D:D + lambda (tr D)^2, D the rate of
// strain, in which noise in few cells counts little [J^(1/2) m^(3/2)/s].
struct CellMotion {
  double volume = 0.0, half_square = 0.0, root = 0.0;
};

// Workspace: rebuilt every step.
struct SolidWork {
  std::vector<Real> fraction;                // part of the cell inside the solid, band cells
  std::vector<Real> volume_ratio;            // det F, band cells with fraction > 0; 0.1 to 10, inverted ones 10
  std::vector<std::int32_t> element;         // band cell -> element, -1: none
  std::vector<std::int32_t> element_cell;    // element -> band cell
  std::vector<std::int32_t> element_corner;  // element -> band node of corner 0
  std::vector<std::uint8_t> sliver;    // per element: its cell is not the solid's: there is no pressure of its own
  std::vector<Real> dilatation;        // of their centres (solid/element/dilatation.hpp); empty: nothing answers to it
  std::vector<double> element_factor;  // stiffness over that of a full cell; empty: 1 everywhere
  std::vector<Vec3> element_middle;    // of what is solid of them, local coordinates; empty: their centres
  std::vector<std::array<Real, 12>>
      hourglass_force;            // per element: along x y z on each mode [N]; empty: it cannot yield
  std::vector<PointBlock> point;  // point q of block b at b points_per_element + q; free lanes are zero
  int points_per_element = 1;
  std::vector<std::uint8_t> carries;  // band nodes: corner of an element; here the solid owns u and v
  std::vector<Real> mass;             // of the solid per band node [kg]
  grid::VectorField force_velocity;   // velocity that forces of the scene add in the step, band nodes; empty: none
  std::vector<std::uint8_t> layer;    // band nodes: 0 data, k: k-th layer of the extension, 255: none
  FoldPlaces fold_places;             // of the fold points at the start of the step, where some are near each other
  std::vector<NearPair> near_folds;   // those
  double min_det_f = 1.0, max_det_f = 1.0;
  double max_stretch = 1.0;  // largest principal stretch of an element that is not degenerate, at least 1
  std::uint64_t degenerate = 0;
  std::uint64_t rejected = 0;   // cells whose map was rejected
  double volume = 0.0;          // by cell fractions [m^3]
  double next_volume = 0.0;     // that a step without loss ends with, by the mesh, over that at rest; 0: not known
  double total_mass = 0.0;      // [kg]
  double cell_mass = 0.0;       // the same as the cells count it, before it is scaled to what the solid weighs [kg]
  double element_weight = 1.0;  // mass of the solid over that of its elements, each as far as it is stiff
  double whole_weight = 1.0;    // over that of as many whole cells
  double elastic_energy = 0.0;  // [J]
  double max_speed = 0.0;
  bool keeps_energy = false;  // what a step may take of its energy limits the step
  bool touches = false;       // and it is near something in its way
  CellMotion straining;       // where it does: by what the step strains its map; without volume: not measured

  // Whether the pressure of a band cell acts on this solid.
  bool owns(std::size_t c) const { return element[c] >= 0 && !sliver[static_cast<std::size_t>(element[c])]; }
  std::size_t owned_cells() const;
  double factor(std::size_t e) const { return element_factor.empty() ? 1.0 : element_factor[e]; }
  Vec3d middle(std::size_t e) const;
  // Quadrature point q of an element, local coordinates (solid/hexahedron.hpp).
  Vec3d local_point(std::size_t e, std::size_t q) const;
  std::size_t blocks() const { return (element_cell.size() + kBlock - 1) / kBlock; }
  void resize_elements(int points);  // for element_cell.size() elements
  ElementPoint element_point(std::size_t e, std::size_t q) const;
  void set_element_point(std::size_t e, std::size_t q, const ElementPoint& value);
  std::size_t bytes() const;
};

inline constexpr int kExtensionLayers = 5;
inline constexpr int kBandMargin = kExtensionLayers + 1;  // cells between the solid and the edge of its band

// Places a band around the nodes [lo, hi] of the global grid.
Band make_band(const Grid& global, Vec3i lo, Vec3i hi);
// Moves the state into another band; values outside the old one are invalid.
void move_band(SolidState& state, const Band& band);
std::size_t state_bytes(const SolidState& state);

}  // namespace efsi::solid
