"""Scenes of thin bodies in a simulation: what holds and meets them, and whether they pass through each other."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from eulerfsi.solver.simulation import Mesh, Simulation, Surface

from .company import Company
from .overlap import deepest_in
from .sides import Passed, Sides, Trace, thinnest
from .thin_shapes import Shape

LOOK = 1 / 240  # s: how often sides are looked at, at most


def mesh_of(shape: Shape) -> Mesh:
    return Mesh(shape.points, np.full(len(shape.triangles), 3), shape.triangles.ravel())


@dataclasses.dataclass(frozen=True)
class Given:
    """The region of a pin of solid `solid`, from 1, or with 0 a collider; it goes straight until a time [s], [m/s]."""

    shape: Shape
    solid: int = 0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    until: float = 0.0
    friction: float = 0.0

    def pose(self, time: float) -> np.ndarray:
        matrix = np.eye(4)
        matrix[:3, 3] = np.array(self.velocity) * min(time, self.until)
        return matrix


@dataclasses.dataclass(frozen=True)
class Thin:
    """Solids with their values, fields of EfsiSolidDef, and what is given."""

    parts: tuple[tuple[Shape, dict[str, Any]], ...]
    given: tuple[Given, ...] = ()

    def bodies(self) -> list[tuple[Mesh, dict[str, Any]]]:
        return [(mesh_of(shape), values) for shape, values in self.parts]


class Watch(Company):
    """Adds pins and colliders, moves them, and tells of every step:

    passed_lines, passed_vertices: that have changed sides since the start and are on the other side now, or were when
    it was looked last;
    passed_pairs: the bodies, from 1, colliders last; thinnest: least thickness of any body over that at rest;
    collider_overlap: deepest vertex of a solid in a collider, or of a collider in a solid [m];
    contact_rows, contact_overlap: of all pairs, the largest overlap of a row or a vertex by the solver's record, at
    the start of the step [cells]; coulomb: largest impulse between two bodies over the most that their friction allows;
    prescribed_work: of what holds pins and colliders [J]; held_impulse: of theirs on the solids [N s].
    """

    def __init__(self, simulation: Simulation, scene: Thin, spacing: float) -> None:
        self.simulation, self.scene = simulation, scene
        self.shapes = [shape for shape, _ in scene.parts]
        self.friction = [float(values.get("friction", 0.0)) for _, values in scene.parts]
        self.given: dict[int, Given] = {}
        for given in scene.given:
            if given.solid:
                number = simulation.add_pin(given.solid, Surface(mesh_of(given.shape), spacing))
            else:
                _, number = simulation.add_collider(mesh_of(given.shape), friction=given.friction)
                self.shapes.append(given.shape)
                self.friction.append(given.friction)
                self.colliders += 1
            self.given[number] = given
        self.traces: list[Trace] = [shape.trace for shape in self.shapes]
        self.rest = [shape.points for shape in self.shapes]
        self.sides = Sides(self.traces, self.surfaces())
        self.passed, self.looked = Passed(), 0.0

    def surfaces(self) -> list[tuple[np.ndarray, np.ndarray]]:
        points = (self.simulation.surface(k + 1)[0].astype(float) for k in range(len(self.shapes)))
        return [(place, shape.triangles) for place, shape in zip(points, self.shapes, strict=True)]

    def lead(self, begin: float, end: float) -> None:
        for number, given in self.given.items():
            if given.until > 0:
                self.simulation.set_motion(number, begin, end, (given.pose(begin), given.pose(end)))

    def observe(self) -> dict[str, Any]:
        surfaces = self.surfaces()
        if self.simulation.time > self.looked + LOOK - 1e-9:
            self.passed, self.looked = self.sides.follow(surfaces), self.simulation.time
        passed = self.passed
        reactions = [self.simulation.pin_reaction(number) for number in self.given]
        pairs = self.simulation.contacts()
        solids, colliders = surfaces[: len(self.scene.parts)], surfaces[len(self.scene.parts) :]
        depths = [deepest_in(one[0], *other) for s in solids for c in colliders for one, other in ((s, c), (c, s))]
        return {
            "passed_lines": passed.lines,
            "passed_vertices": passed.vertices,
            "passed_pairs": " ".join(f"{a}-{b}" for a, b in passed.pairs),
            "thinnest": thinnest(self.traces, [points for points, _ in surfaces], self.rest),
            "collider_overlap": max([0.0, *depths]),
            "contact_rows": sum(pair["rows"] for pair in pairs),
            "contact_overlap": max([0.0, *(max(pair["row_overlap"], pair["surface_overlap"]) for pair in pairs)]),
            "coulomb": max([0.0, *self.coulomb(pairs)]),
            "prescribed_work": sum(reaction["work"] for reaction in reactions),
            "held_impulse": list(np.sum([np.zeros(3), *(reaction["impulse"] for reaction in reactions)], axis=0)),
        }

    def coulomb(self, pairs: Sequence[dict[str, Any]]) -> list[float]:
        """Impulse over sqrt(1 + mu^2) of the sum of the normal ones, which no friction exceeds, for every pair."""
        shares = []
        for pair in pairs:
            a, b = pair["solid"]
            if a != b and pair["normal_impulse"] > 0:
                mu = (self.friction[a - 1] + self.friction[b - 1]) / 2
                most = np.hypot(1.0, mu) * pair["normal_impulse"]
                shares.append(float(np.linalg.norm(pair["impulse"]) / most))
        return shares
