"""Volume bodies of the proposed standard: solids from tetrahedra, what they carry, what holds them."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from eulerfsi_usd import deformables, standard, tets
from eulerfsi_usd.attachments import Attachment
from eulerfsi_usd.deformable_checks import check_evenness
from eulerfsi_usd.deformables import Body
from eulerfsi_usd.issues import Issue
from pxr import Usd, UsdGeom

from ..errors import SceneError
from ..solver import simulation as solver
from .bodies import read_elastic, read_pins, read_values
from .follow import nearest_rotation
from .parts import Motion, Pin, Solid
from .space import SimulationSpace, determinant, transform_points, transform_vectors
from .values import Reader

_SINGLE = float(np.finfo(np.float32).eps)
_SAME = 1e-5  # entries of F - I, and of F beside a stretch, that count as none
_STRETCHES = (0.2, 5.0)  # of the box around the solid; the library refuses others


@dataclasses.dataclass
class TetState:
    """A body's tetrahedra where it starts and at rest, simulation space [m].

    corners: (m, 4) of positive volume; start, rest, bind: points (n, 3), rest without the rigid motion to the start;
    volumes: (m,) at rest [m^3]; masses: (m,) [kg]; deforms: the map at the start is none that a stretch along the axes
    gives; velocities: (n, 3) [m/s], None where all points have the solid's.
    """

    body: Body
    corners: np.ndarray
    start: np.ndarray
    rest: np.ndarray
    bind: np.ndarray
    volumes: np.ndarray
    masses: np.ndarray
    mass_source: str
    deforms: bool = False
    velocities: np.ndarray | None = None

    @property
    def mass(self) -> float:
        """[kg]"""
        return float(self.masses.sum())


def read_tet_solid(reader: Reader, space: SimulationSpace, body: Body) -> Solid:
    """The solid of a body; its mesh is not examined yet and the density is missing."""
    sim, path = body.sim, body.path
    to_sim = space.from_local(reader.local_to_world(sim))
    if determinant(to_sim) == 0:
        raise SceneError(f"{sim.GetPath()}: the transform of the body has a zero scale")
    place = lambda points: transform_points(points, to_sim)  # noqa: E731
    local, start = deformables.points_now(sim), place(deformables.points_now(sim))
    corners = tets.oriented(start, deformables.tet_indices(sim))
    rest = place(deformables.rest_of_points(sim)[0])
    volumes = np.abs(tets.volumes(rest, corners))
    units = (reader.units.meters_per_unit, reader.units.kilograms_per_unit)
    masses, source = deformables.element_masses(body, volumes, units)
    values = read_values(reader, body.ours, "solid", body.prim)
    origins = {"density": source, **read_elastic(reader, body.ours, sim, values, of_standard=True)}
    state = TetState(body, corners, start, rest, place(deformables.bind_points(sim)), volumes, masses, source)
    _set_map(state, values, reader.authored(body.ours, "eulerfsi:stretch") is not None)
    _set_velocities(state, values, reader, space, to_sim)
    faces, _ = tets.boundary(corners)
    own = solver.Mesh(local, np.full(len(faces), 3), faces.ravel())
    mesh = solver.Mesh(state.rest, own.counts, own.indices)
    return Solid(
        path, str(sim.GetPath()), mesh, own, values, None, "", "", pose=_describe(state), tets=state, origins=origins
    )


def _set_map(state: TetState, values: dict[str, Any], stretched: bool) -> None:
    """Takes the rigid motion out of the rest shape; what is left is none, a stretch along the axes, or a field."""
    field = f"{state.body.sim.GetPath()}: physics:{standard.REST_POINTS}"
    gradients = tets.gradients(state.rest, state.start, state.corners)
    volume = state.volumes[:, None, None]
    turn = nearest_rotation((volume * gradients).sum(axis=0)[None] / volume.sum())[0]
    gradients = tets.product(gradients, turn.T[None])
    edges = np.sqrt((tets.edges(state.start, state.corners) ** 2).sum(axis=1).min())
    same = _SAME + 4 * _SINGLE * float(np.abs(state.start).max()) / float(edges)
    if np.abs(gradients - np.eye(3)).max() <= same:
        state.rest = state.start
        return
    if stretched:
        message = f"{field}: the rest shape differs from where the body starts: must not, where eulerfsi:stretch is set"
        raise SceneError(message)
    rest = transform_vectors(state.rest - _center(state.rest, state), turn.T)
    mean = (volume * gradients).sum(axis=0) / volume.sum()
    factors = np.diag(mean)
    if np.abs(gradients - np.diag(factors)).max() <= same:
        state.rest = rest + _center(state.start, state)
        values["stretch"] = np.round(factors, -math.ceil(math.log10(same))).tolist()
        return
    # The solver's band is that of the stretched shape: the stretch and the place whose box is that of the start.
    used = np.unique(state.corners)
    low, high = state.start[used].min(axis=0), state.start[used].max(axis=0)
    size = np.ptp(rest[used], axis=0)
    factors = np.clip((high - low) / size, *_STRETCHES)
    state.rest = rest + high - factors * rest[used].max(axis=0)
    state.deforms = True
    values["stretch"] = factors.tolist()


def _center(points: np.ndarray, state: TetState) -> np.ndarray:
    """(3,) of the volume in which the points (n, 3) hold the body."""
    volumes = np.abs(tets.volumes(points, state.corners))
    middles = sum(points[state.corners[:, k]] for k in range(4)) / 4.0
    return (volumes[:, None] * middles).sum(axis=0) / volumes.sum()


def _set_velocities(
    state: TetState, values: dict[str, Any], reader: Reader, space: SimulationSpace, to_sim: np.ndarray
) -> None:
    """Of the points, unless attributes of ours say how the solid moves; else it starts at rest."""
    ours, points = state.body.ours, len(state.start)
    velocity, angular = (values[name] for name in ("velocity", "angular_velocity"))
    values["velocity"] = space.vector_to_sim(velocity).tolist()
    values["angular_velocity"] = space.vector_to_sim(angular).tolist()
    if any(reader.authored(ours, f"eulerfsi:{name}") is not None for name in ("velocity", "angularVelocity")):
        return
    got = UsdGeom.PointBased(state.body.sim).GetVelocitiesAttr().Get(reader.time)
    if got is None or len(got) != points:
        return
    velocities = transform_vectors(np.asarray(got, float), to_sim)
    shares = np.repeat(state.masses / 4.0, 4)
    weights = np.bincount(state.corners.ravel(), shares, points)
    values["velocity"] = ((weights[:, None] * velocities).sum(axis=0) / weights.sum()).tolist()
    used = weights > 0.0
    off = np.abs(velocities[used] - values["velocity"]).max(initial=0.0)
    if off <= 8 * _SINGLE * np.abs(velocities).max():
        values["velocity"] = velocities[used][0].tolist()
    else:
        state.velocities = velocities


def _describe(state: TetState) -> str:
    """What its start follows from, for people."""
    parts = [f"{len(state.corners):,} tetrahedra of {state.body.sim.GetPath()}"]
    if state.rest is not state.start:
        parts.append("starts deformed from its rest shape")
    if state.velocities is not None:
        parts.append("velocities of its points")
    return ", ".join(parts)


def body_density(solid: Solid) -> float:
    """[kg/m^3] with which the solid has the body's mass."""
    return solid.tets.mass / solid.report["solid_volume"]


def evenness(solids: list[Solid]) -> list[Issue]:
    """Warnings of bodies whose density varies."""
    states = [solid.tets for solid in solids if solid.tets]
    return [issue for state in states for issue in check_evenness(state.body, state.masses, state.volumes)]


def read_body_pins(
    reader: Reader, space: SimulationSpace, solid: Solid, first: int, attachments: list[Attachment]
) -> list[Pin]:
    """What attributes of ours hold, and those of the stage's attachments that are the solid's."""
    body, stage = solid.tets.body, solid.tets.body.prim.GetStage()
    pins = read_pins(reader, space, body.ours, first, solid.path)
    for attachment in attachments:
        if attachment.body == body:
            motion = Motion(str(attachment.target.GetPath()), stage, space, first)
            pins.append(Pin(str(attachment.prim.GetPath()), solid.path, motion, vertices=attachment.held))
    return pins


def place_at_rest(state: TetState, points: np.ndarray, bind: bool) -> np.ndarray:
    """(n, 3) where points, in the bind pose or where the body starts, are while it is at rest."""
    shape = state.bind if bind else state.start
    if shape is state.rest:
        return points
    corners = tets.oriented(shape, state.corners)
    owner, weights = tets.locate(shape, corners, points)
    outside = np.flatnonzero(owner < 0)
    if len(outside):
        faces, owners = tets.boundary(corners)
        nearest, _ = solver.nearest_on_triangles(shape[faces], points[outside])
        owner[outside] = owners[nearest]
        weights[outside] = tets.weights(shape[corners[owner[outside]]], points[outside])
    return sum(weights[:, k : k + 1] * state.rest[corners[owner, k]] for k in range(4))


def bind_pose_of(prim: Usd.Prim, body: Body) -> np.ndarray | None:
    """(n, 3) in its own space, of what belongs to a body; None of what only rides along."""
    return deformables.bind_points(prim) if prim in deformables.members(body) else None
