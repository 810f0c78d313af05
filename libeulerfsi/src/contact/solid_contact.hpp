// Purpose: where two solids may touch: a row in every cell that the surface halfway between them cuts
// (docs/numerics/solid-contact.md). What the rows do: Eq. 8 with
// contact, system/contact_solve.hpp.
#pragma once

#include <functional>

#include "contact/hold.hpp"
#include "contact/solid_contacts.hpp"
#include "frame/step_context.hpp"
#include "nodes/node_fields.hpp"

namespace efsi::sim {

inline constexpr double kContactSkin = 0.25;  // cells between solids at rest on each other

// All rows of the step, with the impulses of the last one; parts of rows name nodes of the common grid. velocity: of
// the nodes with all forces but the solids' own. Empty where no two bands overlap.
SolidContacts find_solid_contacts(const StepContext& step, const SolidStates& states, const SolidWorks& solids,
                                  const CommonGrid& common, const NodeVelocity& velocity);
// Per solid: whether a row was active in the last step or will be at the velocity of find_solid_contacts.
std::vector<std::uint8_t> pressed_solids(std::size_t solids, const SolidContacts& contacts);
// From nodes to the unknowns of an assembled system.
void number_rows(const system::VelocitySystem& system, SolidContacts& contacts);
// Pairs of solids with active rows, or before the solve those that are about to touch.
SolidPairs meeting_pairs(const SolidContacts& contacts);
SolidPairs active_pairs(const SolidContacts& contacts);
// What the next step wants to know.
void remember_contacts(double dt, const SolidContacts& contacts, SolidStates& states);

// A vertex of a solid, and the surface of another one near it as that one's map has it.
struct SeenVertex {
  const solid::SolidState& own;
  const solid::SolidRest& rest;  // the other
  const solid::SolidState& state;
  std::size_t vertex, node;  // corner 0 of the cell of the other's band that it is in
  Vec3d x, material;         // where it is; what of the other is there
  double rest_distance;      // from the surface of the other at rest [m]; < 0: inside
  Vec3d rest_normal() const;
  bool is_known() const;  // the other carries data all around: none of this is extrapolated
  struct Gap {
    double size, closing;  // between the surfaces, less what they keep [m]; how fast it closes [m/s]
  };
  Gap gap() const;
};
using VisitVertex = std::function<void(const SeenVertex& seen)>;
// Calls visit for the vertices of a solid that are within reach of another one's map, some cells, in their order.
void visit_vertices(const Scene& scene, const SolidStates& states, std::size_t l, std::size_t other,
                    const VisitVertex& visit);

// What is between two surfaces at a point of one of them, less what they keep [m], and how fast it closes [m/s].
using VisitGap = std::function<void(double gap, double closing)>;
// Calls visit for the vertices of either solid that are within reach of the other's map, some cells.
void visit_gaps(const Scene& scene, const SolidStates& states, std::size_t one, std::size_t other,
                const VisitGap& visit);
// The least of these gaps [m]; infinite where there are none.
double least_gap(const Scene& scene, const SolidStates& states, std::size_t one, std::size_t other);
// Bound of the speed at which any two vertices of two solids come towards each other [m/s].
double relative_speed(const SolidStates& states, std::size_t one, std::size_t other);

}  // namespace efsi::sim
