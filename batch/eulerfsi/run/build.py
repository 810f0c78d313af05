"""A simulation from a scene: all that the library holds of it, each part with its id."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import numpy as np

from ..errors import LibraryError
from ..log import Log
from ..reasons import mesh_reason
from ..scene.follow import Binding
from ..scene.parts import Collider, Emitter, Passenger, Pin, Scene, Solid
from ..scene.start_fields import start_fields
from ..solver import binding
from ..solver.simulation import Simulation, Surface

Part = TypeVar("Part")

_INSTANT = 1e-5  # s, over which velocities of what is bound to a surface are taken


@dataclasses.dataclass(frozen=True)
class Placed(Generic[Part]):
    """A part of the scene with its id in the library."""

    part: Part
    id: int


@dataclasses.dataclass(frozen=True)
class Bound:
    """A passenger with points that the library cannot carry, bound to the surface of its solid."""

    part: Passenger
    binding: Binding


@dataclasses.dataclass
class Build:
    """A simulation and what it holds of a scene, in the scene's order.

    definition: fields of EfsiSimulationDef; given: pins, then colliders, with the ids of their pins; names: of all that
    the library sees as solids, by id.
    """

    simulation: Simulation
    definition: dict[str, Any]
    solids: list[Placed[Solid]] = dataclasses.field(default_factory=list)
    passengers: list[Placed[Passenger] | Bound] = dataclasses.field(default_factory=list)
    given: list[Placed[Pin | Collider]] = dataclasses.field(default_factory=list)
    emitters: list[Placed[Emitter]] = dataclasses.field(default_factory=list)
    names: dict[int, str] = dataclasses.field(default_factory=dict)

    def surfaces(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """(points, velocities) of scene.simulated now."""
        solids = {solid.part.path: self.simulation.surface(solid.id) for solid in self.solids}
        carried = [
            passenger.binding.carried(*solids[passenger.part.solid], _INSTANT)
            if isinstance(passenger, Bound)
            else self.simulation.passenger(passenger.id)
            for passenger in self.passengers
        ]
        return [*solids.values(), *carried]


def build_simulation(scene: Scene, threads: int, memory_limit: int, log: Log) -> Build:
    """A simulation at time 0 with all that the scene holds."""
    place = [""]  # prim that the library is working on, for its messages

    def forward(level: int, text: str) -> None:
        # A repaired mesh was reported by the checks already, with its prim.
        (log.warning if level >= binding.LOG_WARNING and not place[0] else log.info)(place[0] + text)

    definition = {**scene.domain, "threads": threads, "memory_limit": memory_limit}
    simulation = Simulation(definition, forward)
    simulation.point_to_world = scene.space.point_to_world
    made = Build(simulation, definition)
    try:
        kinds = {"solid": [*scene.solids, *scene.colliders], "pin": [*scene.pins, *scene.colliders]}
        kinds["collider"] = kinds["solid"]  # numbers are those of solids
        for kind, bodies in kinds.items():  # in the order in which they are added
            simulation.names |= {f"{kind} {number}": body.path for number, body in enumerate(bodies, 1)}
        for solid in scene.solids:
            place[0] = f"{solid.path}: "
            made.solids.append(Placed(solid, simulation.add_solid(solid.surface, **solid.values)[0]))
            made.names[made.solids[-1].id] = solid.path
        carriers = {solid.part.path: solid for solid in made.solids}
        for passenger in scene.passengers:
            place[0] = f"{passenger.path}: carried by {passenger.solid}: "
            made.passengers.append(_add_passenger(simulation, carriers[passenger.solid], passenger, forward))
        for pin in scene.pins:
            place[0] = f"{pin.solid}: pinned by {pin.path}: " if pin.path != pin.solid else f"{pin.solid}: "
            where = pin.surface if pin.surface else pin.vertices
            made.given.append(Placed(pin, simulation.add_pin(carriers[pin.solid].id, where)))
        for collider in scene.colliders:
            place[0] = f"{collider.path}: "
            solid_id, pin_id = simulation.add_collider(collider.surface, **collider.values)
            made.given.append(Placed(collider, pin_id))
            made.names[solid_id] = collider.path
        for emitter in scene.emitters:
            place[0] = f"{emitter.path}: "
            made.emitters += _add_emitter(simulation, emitter, definition)
        for force in scene.forces:
            place[0] = f"{force.path}: "
            simulation.add_force(**force.values)
        for solid in made.solids:
            place[0] = f"{solid.part.path}: "
            _set_start(simulation, solid)
    except LibraryError as error:
        simulation.close()
        raise LibraryError(error.status, place[0] + mesh_reason("", error)) from error
    place[0] = ""
    return made


def _add_emitter(simulation: Simulation, emitter: Emitter, definition: dict[str, Any]) -> list[Placed[Emitter]]:
    """An emitter, or one for each of the places where it stays; what is outside the box then is none."""
    if not emitter.stays:
        return [Placed(emitter, simulation.add_emitter(emitter.surface, emitter.keys, **emitter.values))]
    placed, refused = [], None
    for stay in emitter.stays:
        volume = None
        if emitter.mesh:
            volume = Surface(stay.hull, definition["voxel_size"], definition["threads"])
        values = emitter.values | stay.values
        values["velocity"] = (np.array(values["velocity"]) + stay.velocity).tolist()
        keys = [key | {"velocity": (np.array(key["velocity"]) + stay.velocity).tolist()} for key in emitter.keys]
        try:
            placed.append(Placed(emitter, simulation.add_emitter(volume, keys, **values)))
        except LibraryError as error:
            if error.status != binding.ERROR_ARGUMENT or "holds 0" not in str(error):
                raise
            refused = error
    if not placed:
        raise refused
    return placed


def _set_start(simulation: Simulation, solid: Placed[Solid]) -> None:
    """The map and the velocities of a body that starts deformed, or whose points have velocities of their own."""
    state = solid.part.tets
    if state is None or not (state.deforms or state.velocities is not None):
        return
    views, place = simulation.field_view("solid_displacement", solid.id)
    displacement, velocity = start_fields(state, views[0].shape, place)
    if state.deforms:
        simulation.set_field("solid_displacement", displacement, solid.id)
    if velocity is not None:
        simulation.set_field("solid_velocity", velocity, solid.id)


def _add_passenger(
    simulation: Simulation, solid: Placed[Solid], passenger: Passenger, log: Callable[[int, str], None]
) -> Placed[Passenger] | Bound:
    """Carried by the material, or by the surface where points are out of the material's reach."""
    try:
        return Placed(passenger, simulation.add_passenger(solid.id, passenger.mesh.points))
    except LibraryError as error:
        if error.status != binding.ERROR_ARGUMENT:
            raise
        log(binding.LOG_INFO, f"follows the surface of the solid: {error}")
    mesh = solid.part.mesh
    return Bound(passenger, Binding(mesh.points.astype(float), mesh.triangles(), passenger.mesh.points.astype(float)))
