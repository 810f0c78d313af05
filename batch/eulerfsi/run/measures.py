"""What the lines of stats.jsonl tell of the conditions of docs/warnings.md: a value per condition, prim and frame."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..scene.parts import Scene, beyond_faces, face_name, open_faces
from ..scene.space import SimulationSpace
from ..solver import binding
from ..solver.simulation import slab_axis
from .conditions import CONDITIONS

_STILL = 1e-3  # cells: the centre of a solid that does not move
_ROUNDING = 1e-12  # of Young's modulus times the volume: energies below it are noise
_TOLERANCES = {number: 1e-3 if name == "paper2016" else 0.01 for name, number in binding.PRESETS.items()}  # of Eq. 8


@dataclasses.dataclass(frozen=True)
class Finding:
    """A value of one frame. other: the second solid, a collider or a wall; limit: where the scene has it; place: world
    position, where one is known."""

    code: str
    prim: str
    value: float
    other: str = ""
    limit: float | None = None
    place: tuple[float, ...] = ()


@dataclasses.dataclass
class Watched:
    """What the conditions need of a scene. SI, simulation space.

    fill: by path of every incompressible solid, its volume at the start over that at rest; pinned: paths of the pinned
    solids on which something acts; drive: largest speed of jets, wind, walls and sqrt(2 a H); slow: what is slower
    crosses no voxel in a frame; moving_walls: they do work; noise: energies below it are rounding; fall: mass of the
    solids times gravity squared [kg m²/s⁴]; space: the stage's, for places.
    """

    domain_path: str
    domain: dict[str, Any]
    fill: dict[str, float]
    pinned: set[str]
    drive: float
    slow: float
    moving_walls: bool
    noise: float
    fall: float
    space: SimulationSpace

    @classmethod
    def of(cls, scene: Scene) -> Watched:
        """That of a scene."""
        domain = scene.domain
        fill = {s.path: float(np.prod(s.values["stretch"])) for s in scene.solids if not s.values["compressible"]}
        acts = any(domain["gravity"]) or scene.forces or any(pin.motion.moves for pin in scene.pins)
        pinned = {pin.solid for pin in scene.pins} if acts else set()
        stiffness = sum(s.values["youngs_modulus"] * s.report["solid_volume"] for s in scene.solids)
        walls = any(any(domain[f"wall_velocity[{face}]"]) for face in range(6))
        mass = sum(s.values["density"] * s.report["solid_volume"] for s in scene.solids)
        fall = mass * float(np.dot(domain["gravity"], domain["gravity"]))
        return cls(
            scene.domain_path,
            domain,
            fill,
            pinned,
            drive(scene),
            domain["voxel_size"] * scene.fps,
            walls,
            _ROUNDING * stiffness,
            fall,
            scene.space,
        )


def drive(scene: Scene) -> float:
    """Largest speed that jets, wind and moving walls give the fluid, or buoyancy and forces along the box [m/s]."""
    domain = scene.domain
    norms = lambda rows: float(np.linalg.norm(np.atleast_2d(rows), axis=1).max())  # noqa: E731
    speeds = [norms(domain[f"wall_velocity[{face}]"]) for face in range(6)]
    speeds += [norms(emitter.over_time("velocity")) for emitter in scene.emitters if emitter.values["has_velocity"]]
    lifts = {"smoke_buoyancy": "density", "temperature_buoyancy": "temperature"}
    accelerations = [
        abs(domain[factor]) * float(np.abs(emitter.over_time(field)).max())
        for emitter in scene.emitters
        for factor, field in lifts.items()
    ]
    for force in scene.forces:
        values = force.values
        if values["acts_on"] == binding.ACTS_ON["solids"]:
            continue
        if values["kind"] == binding.FORCE_KINDS["wind"]:
            speeds.append(norms(values["wind_velocity"]) + values["noise_speed"])
        elif values["kind"] == binding.FORCE_KINDS["radial"]:
            accelerations.append(abs(values["radial_acceleration"]))
        else:
            accelerations.append(norms(values["acceleration"]))
    down = np.abs(domain["gravity"])
    height = domain["domain_size"][int(down.argmax())] if down.any() else max(domain["domain_size"])
    return max(*speeds, math.sqrt(2 * max(accelerations, default=0.0) * height))


class Measures:
    """The values of a run, frame by frame; `step` and `frame` get the lines in their order."""

    def __init__(self, watched: Watched) -> None:
        self._scene, self._slab = watched, slab_axis(watched.domain)
        self._steps: list[dict[str, Any]] = []  # of this frame
        self._elements = 0  # of all solids, after the frame before
        self._start: dict[str, np.ndarray] = {}  # centres in the first frame
        self._filled = {path for path, fill in watched.fill.items() if abs(fill - 1) < 1e-6}
        self._speed = watched.drive  # of what drives the fluid, so far
        self._energy = _Energy(watched)

    def step(self, line: dict[str, Any]) -> None:
        """A step of the next frame."""
        self._steps.append(line)
        self._energy.step(line)

    def frame(self, line: dict[str, Any]) -> Iterator[Finding]:
        """What the frame has. The iterator is to be exhausted before the next step."""
        for measure in (
            self._overlaps,
            self._depths_in_walls,
            self._repairs,
            self._volumes,
            self._convergence,
            self._held,
            self._edges,
            self._fluid,
        ):
            yield from measure(line)
        yield from self._energy.frame()
        self._elements = sum(facts["elements"] for facts in line["solids"].values())
        self._steps.clear()

    def _overlaps(self, line: dict[str, Any]) -> Iterator[Finding]:
        for pair in line.get("contacts", {}).get("pairs", ()):
            first, second = pair["solids"]
            depth, exchanged = number(pair["surface_overlap"]), pair.get("exchanged_vertices", 0)
            yield Finding("folds", first, depth) if first == second else Finding("overlap", first, depth, second)
            known = exchanged and "exchanged_place" in pair
            place = self._scene.space.point_to_world(np.array(pair["exchanged_place"])) if known else ()
            yield Finding("exchanged_sides", first, float(exchanged), second, place=tuple(map(float, place)))

    def _depths_in_walls(self, line: dict[str, Any]) -> Iterator[Finding]:
        walls = (binding.WALLS["slip"], binding.WALLS["noSlip"])
        closed = [k for k in range(6) if self._scene.domain[f"wall[{k}]"] in walls and k // 2 != self._slab]
        for path, facts in line["solids"].items():
            beyond = self._beyond(facts)
            if facts["elements"] and not self._leaves(facts):
                for face in closed:
                    yield Finding("overlap", path, beyond[face], f"wall{face_name(face)}")

    def _beyond(self, facts: dict[str, Any]) -> list[float]:
        """Beyond every face, how far the mesh reaches [cells]."""
        domain = self._scene.domain
        ends = np.array(facts["extent_min"]), np.array(facts["extent_max"])
        return (beyond_faces(domain, *ends) / domain["voxel_size"]).tolist()

    def _leaves(self, facts: dict[str, Any]) -> bool:
        """Whether it reaches out of an open face."""
        beyond = self._beyond(facts)
        return any(beyond[face] > 0 for face in open_faces(self._scene.domain))

    def _repairs(self, _line: dict[str, Any]) -> Iterator[Finding]:
        if self._elements and self._steps:
            worst = max(step["repairs"]["repaired_cells"] for step in self._steps)
            yield Finding("repaired_cells", self._scene.domain_path, worst / self._elements)

    def _volumes(self, line: dict[str, Any]) -> Iterator[Finding]:
        for path, facts in line["solids"].items():
            if path in self._scene.fill and facts["elements"] and not self._leaves(facts):
                off = abs(number(facts["volume_mesh"]) / facts["rest_volume"] - 1)
                if off < CONDITIONS["volume"].limit:
                    self._filled.add(path)  # where it was stretched to another volume, it has its own again
                if path in self._filled:
                    yield Finding("volume", path, off)

    def _convergence(self, _line: dict[str, Any]) -> Iterator[Finding]:
        failed = sum(step["unconverged"] > 0 for step in self._steps)
        if failed >= 2:
            yield Finding("not_converged", self._scene.domain_path, failed / len(self._steps))

    def _held(self, line: dict[str, Any]) -> Iterator[Finding]:
        domain = self._scene.domain
        tolerance = domain["velocity_tolerance"] or _TOLERANCES[domain["preset"]]
        least = min((number(s["velocity_residual"]) if s["unconverged"] else 0.0 for s in self._steps), default=0.0)
        for path in sorted(self._scene.pinned & set(line["solids"])):
            center = np.array([number(value) for value in line["solids"][path]["center"]])
            start = self._start.setdefault(path, center)
            if np.abs(center - start).max() < _STILL * domain["voxel_size"] and least > tolerance:
                yield Finding("held_solid", path, least, limit=tolerance)

    def _edges(self, line: dict[str, Any]) -> Iterator[Finding]:
        for path, facts in line["solids"].items():
            yield Finding("false_edges", path, float(facts["false_edges"]))

    def _fluid(self, line: dict[str, Any]) -> Iterator[Finding]:
        self._speed = max([self._speed, *(number(step["max_speed_solid"]) for step in self._steps)])
        fluid = number(line["fluid"]["max_speed"])
        if self._speed > 0 and not fluid < self._scene.slow:
            yield Finding("fast_fluid", self._scene.domain_path, fluid / self._speed)


class _Energy:
    """How far the energy of a closed box rises, as docs/warnings.md has it, from the ledger of every step."""

    def __init__(self, watched: Watched) -> None:
        domain = watched.domain
        inflow = any(domain[f"wall_velocity[{face}]"][face // 2] for face in range(6))
        self._on = bool(domain["energy_ledger"]) and not open_faces(domain) and not inflow
        self._scene = watched
        self._work = self._put_in = self._open = 0.0
        self._rises: list[float] = []  # of the steps of this frame
        self._lowest = math.inf  # of the energy less the work, so far
        self._top = self._bottom = math.nan  # potential energy: in the first step, lowest so far

    def step(self, line: dict[str, Any]) -> None:
        """The next step; one of a frame that was made before the ledger was switched on has none."""
        if not self._on or "energy" not in line:
            return
        forms = {form: number(value) for form, value in line["energy"]["at_start"].items()}
        if math.isnan(self._top):
            self._top = self._bottom = forms["potential"]
            self._put_in = sum(forms.values()) - self._top
        work = self._outside(line)
        energy = sum(forms.values()) - (self._work + work / 2)  # velocities at its start are means of two steps
        self._work += work
        self._put_in += max(work, 0.0)
        self._bottom = min(self._bottom, forms["potential"])
        self._lowest = min(self._lowest, energy)
        self._rises.append(energy - self._lowest)
        self._open = max(self._open, self._scene.fall * line["dt"] ** 2 / 8)

    def _outside(self, line: dict[str, Any]) -> float:
        """What comes from outside in a step [J]."""
        change = line["energy"]["change"]
        stages = ["external", *(("walls", "viscosity") if self._scene.moving_walls else ())]
        work = sum(number(value) for stage in stages for value in change[stage].values())
        work += sum(number(value) for value in line.get("prescribed_work", {}).values())
        return work + (number(line["energy"]["source_work"]) if "emitter_flux" in line else 0.0)

    def frame(self) -> Iterator[Finding]:
        """The smallest rise in the steps of a frame: where something hits, that of one step is not that of a time.

        Less what half a step of free fall leaves open, in which the ledger's u and v of one time are not exact.
        """
        put_in = self._put_in + self._top - self._bottom
        if self._rises and put_in > self._scene.noise:
            yield Finding("energy_rises", self._scene.domain_path, (min(self._rises) - self._open) / put_in)
        self._rises.clear()


def number(value: float | None) -> float:
    """As a line of stats.jsonl that was written and read again has it: NaN for what is not finite."""
    return value if value is not None and math.isfinite(value) else math.nan
