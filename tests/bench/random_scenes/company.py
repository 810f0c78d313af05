"""What a scene has beside its solids, in the simulation: a pin, a collider, a jet; and what is seen of them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Simulation, Surface
from loop import experiment
from loop.experiment import of

from .regions import Path, Region, place, taken_back

WITHIN = 0.25  # cells inside a pin's region: vertices that are looked at; its distances round edges off by less
NEAR = 2.0  # cells from a jet's region at which a solid covers it


@dataclasses.dataclass(frozen=True)
class Held:
    """Something that moves as given: the region of a pin, or a collider."""

    region: Region
    path: Path
    friction: float = 0.0

    @property
    def words(self) -> str:
        edges = "x".join(f"{edge:.3g}" for edge in self.region.edges[: 1 if self.region.kind == "sphere" else 3])
        speed, rate = float(np.linalg.norm(self.path.velocity)), float(np.linalg.norm(self.path.rate))
        way = f"{speed:.3g} m/s" + f", {rate:.3g} rad/s" * (rate > 0) + f" for {self.path.until:.3g} s"
        return f"{self.region.kind} {edges} m, " + (way if self.path.moves else "fixed")


@dataclasses.dataclass(frozen=True)
class Jet:
    """Blows from time 0 until `until` [s]."""

    region: Region
    velocity: tuple[float, float, float]
    until: float

    @property
    def flux(self) -> float:
        """What it brings where nothing covers it [m^3/s]."""
        return float(np.linalg.norm(self.velocity)) * self.region.across(np.array(self.velocity))

    @property
    def words(self) -> str:
        speed = np.linalg.norm(self.velocity)
        return f"{self.region.kind} {max(self.region.edges):.3g} m, {speed:.3g} m/s for {self.until:.3g} s"


class Company(experiment.Company):
    """Adds them after the solids, moves them, and tells of every step:

    pin_gap: farthest that a vertex in the pin's region is from where the pose puts it, at times for which a pose was
    given, 0 between them [m];
    collider_gap (`of` every solid): nearest that a vertex is to the collider, negative inside [m];
    prescribed_work: of what holds a pin or a collider, in the step [J];
    jet_flux [m^3/s], jet_on: part of the step; jet_covered: a solid is near its region.
    """

    def __init__(self, simulation: Simulation, scene: Any) -> None:
        self.simulation, self.scene = simulation, scene
        self.rest = [mesh.points.astype(float) for mesh, _ in scene.bodies()]
        self.given: dict[int, Held] = {}  # by pin
        self.begin = self.ends = self.time = 0.0
        self.collider = self.jet = 0
        if scene.pin:
            number = simulation.add_pin(1, Surface(scene.pin.region.mesh(), scene.spacing))
            self.given[number] = scene.pin
            self.pinned = scene.pin.region.distance(self.rest[0]) < -WITHIN * scene.spacing
        if scene.collider:
            mesh = scene.collider.region.mesh()
            self.collider, number = simulation.add_collider(mesh, friction=scene.collider.friction)
            self.given[number] = scene.collider
            self.colliders = 1
        if scene.jet:
            region = scene.jet.region
            self.jet = simulation.add_emitter(
                shape=binding.REGION_SHAPES[region.kind],
                mode=binding.EMITTER_MODES["continuous"],
                transform=region.placed(),
                density=1.0,
                has_velocity=1,
                velocity=scene.jet.velocity,
                end_time=scene.jet.until,
            )

    def lead(self, begin: float, end: float) -> None:
        for number, held in self.given.items():
            if held.path.moves:
                self.simulation.set_motion(number, begin, end, (held.path.pose(begin), held.path.pose(end)))
        self.begin, self.ends = begin, end

    def pose(self, held: Held, time: float) -> np.ndarray:
        """Where the solver has it: on its way between the poses that `lead` gave last."""
        return held.path.between(self.begin, self.ends, time, np.array(held.region.middle))

    def observe(self) -> dict[str, Any]:
        time = self.simulation.time
        surfaces = [self.simulation.surface(k + 1)[0].astype(float) for k in range(len(self.rest))]
        seen: dict[str, Any] = {"prescribed_work": self.work()}
        if self.scene.pin:
            seen["pin_gap"] = self.pin_gap(surfaces[0], time)
        if self.scene.collider:
            held = self.scene.collider
            for k, points in enumerate(surfaces, 1):
                gaps = held.region.distance(taken_back(self.pose(held, time), points))
                seen[of("collider_gap", k)] = float(gaps.min())
        if self.scene.jet:
            on = min(time, self.scene.jet.until) - min(self.time, self.scene.jet.until)
            seen["jet_on"] = on / (time - self.time) if time > self.time else 0.0
            seen["jet_flux"] = self.simulation.emitter_flux(self.jet)
            seen["jet_covered"] = int(self.covered(surfaces, time))
        self.time = time
        return seen

    def work(self) -> float:
        return sum(self.simulation.pin_reaction(number)["work"] for number in self.given)

    def pin_gap(self, points: np.ndarray, time: float) -> float:
        if abs(time - self.ends) > 1e-9 and self.scene.pin.path.moves or not self.pinned.any():
            return 0.0
        wanted = place(self.scene.pin.path.pose(time), self.rest[0][self.pinned])
        return float(np.linalg.norm(points[self.pinned] - wanted, axis=1).max())

    def covered(self, surfaces: list[np.ndarray], time: float) -> bool:
        region, near = self.scene.jet.region, NEAR * self.scene.spacing
        around = [*surfaces]
        if self.scene.collider:
            held = self.scene.collider
            pose = self.pose(held, time)
            around.append(place(pose, held.region.surface[0]))
            if held.region.distance(taken_back(pose, region.surface[0])).min() < near:
                return True
        return any(region.distance(points).min() < near for points in around)
