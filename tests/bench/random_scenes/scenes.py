"""A random scene from a seed and a number: one solid thrown about in a box."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Mesh
from loop.experiment import Experiment

from .draw import Draw, constant, ranges
from .solids import Made, center_of_volume, folds_nowhere, make_solid

AXES = "xyz"
ADDED_MASS = 0.5  # of the displaced fluid, as of a ball
WAVE_CELLS = 0.7  # cells that a shear wave may pass in a step at a wall
CONTACT_CFL = 0.4
PATIENCE = 6  # times the steps that the fastest speed asks for


@dataclasses.dataclass(frozen=True)
class Scene(Experiment):
    """One solid in a box; an experiment whose every value is drawn. Vectors in m/s, m/s^2, rad/s."""

    seed: int = 0
    number: int | str = 0  # "c0", "c1", ...: with contact
    size: float = 1.0  # longest edge of the shape before it was turned [m]
    faces: tuple[str, ...] = ("slip",) * 6  # -x +x -y +y -z +z
    pull: tuple[float, float, float] = (0.0, 0.0, 0.0)  # gravity
    material: str = "corotational"
    impact_pressure: float = 0.0  # rho v^2 / 2 of the fastest impact over Young's modulus
    fastest: float = 1.0  # what throw, fall and spin can come to [m/s]
    reach: float = 1.0  # largest distance of the surface from its centre at rest [m]
    folds_nowhere: bool = True
    surface: Made = dataclasses.field(default=(np.zeros((0, 3)), np.zeros((0, 3), int)), compare=False, repr=False)

    @property
    def spacing(self) -> float:
        """Cell size h [m]."""
        return self.size / self.across

    @property
    def face_kinds(self) -> tuple[str, ...]:
        return self.faces

    @property
    def cells(self) -> tuple[int, ...]:
        """Of the box along x, y, z."""
        return tuple(round(edge / self.spacing) for edge in self.box)

    @property
    def fluid_density(self) -> float:
        """0 in vacuum [kg/m^3]."""
        return 0.0 if self.density_ratio is None else 1000.0 / max(1.0, self.density_ratio)

    @property
    def most_steps(self) -> int:
        shear = self.youngs_modulus / (2 * (1 + self.poissons_ratio))
        wave = WAVE_CELLS * self.spacing / math.sqrt(shear / self.solid()["density"])
        pace = min(CONTACT_CFL, self.cfl or 1.0) * self.spacing / self.fastest
        return 100 + int(PATIENCE * self.duration / min(self.dt, pace, wave))

    @property
    def words(self) -> str:
        """Everything that was drawn, in one line."""
        vector = lambda v: "(" + " ".join(f"{c + 0.0:.3g}" for c in v) + ")"  # noqa: E731
        density = "vacuum" if self.density_ratio is None else f"{self.density_ratio:.3g}:1"
        box = "x".join(map(str, self.cells))
        material = f"E {self.youngs_modulus:.3g} Pa, nu {self.poissons_ratio:.3f}"
        material += ", compressible" * self.compressible + ", neo-Hookean" * (self.material != "corotational")
        return (
            f"{self.shape}, {self.across:.1f} cells of {self.spacing:.3g} m, box {box}, faces {self.walls}, {density}, "
            f"{material}, rho v^2/2 / E {self.impact_pressure:.2g}, v {vector(self.velocity)}, "
            f"spin {vector(self.spin)}, g {vector(self.pull)}, {self.duration:.2f} s, dt <= {self.dt:.3g} s, "
            f"CFL {'default' if self.cfl is None else f'{self.cfl:.2f}'}"
        )

    def mesh(self) -> Mesh:
        points, triangles = self.surface
        return Mesh(points + self.middle, np.full(len(triangles), 3), triangles.ravel())

    def ends(self, observed: dict[str, Any]) -> bool:
        """The middle of a solid's surface has left through an open face."""
        for name in (name for name in observed if name.startswith("extent_min")):
            middle = (np.array(observed[name]) + observed[name.replace("min", "max")]) / 2
            gone = np.stack([middle < 0, middle > self.box], axis=1).ravel()
            if (gone & (np.array(self.faces) == "open")).any():
                return True
        return False

    def simulation(self) -> dict[str, Any]:
        return super().simulation() | {"gravity": self.pull}

    def solid(self) -> dict[str, Any]:
        return super().solid() | {"material": binding.MATERIALS[self.material]}


def make_scene(seed: int, number: int) -> Scene:
    """The scene; the same for the same seed, number and ranges. Raises solids.Absent."""
    draw = Draw(seed, number)
    shape, (points, triangles) = make_solid(draw)
    size, across = draw.number("size"), draw.number("across")
    points = size * points @ draw.rotation("turn").T
    points -= (points.min(axis=0) + points.max(axis=0)) / 2
    h, duration, ratio = size / across, draw.number("duration"), draw_ratio(draw)
    extent, middle = np.ptp(points, axis=0), center_of_volume(points, triangles)
    reach = float(np.linalg.norm(points - middle, axis=1).max())
    turning = reach + float(np.linalg.norm(middle)) + constant("drift_gap") * h  # room it needs at periodic faces
    faces = draw_faces(draw)
    free = [faces[2 * axis] == "periodic" for axis in range(3)]

    needed = np.where(free, 2 * turning / h, extent / h + 2 * constant("gap"))
    cells = box_cells(draw, extent / h, needed, constant("most_cells"))
    pull = draw_gravity(draw, free)
    released = draw.happens("released") and bool(pull.any())
    velocity = 0.0 if released else draw.number("speed") * size
    velocity = velocity * draw.direction("heading")
    most = constant("drift_share") * np.maximum(0, cells * h - 2 * turning) / duration
    velocity = np.where(free, np.clip(velocity, -most, most), velocity)
    center = place(draw, cells * h, extent / 2 + constant("gap") * h, turning, free, velocity)
    spin = 0.0 if draw.happens("still") else draw.number("spin")

    fall = weight_ratio(ratio) * pull
    gaps = np.where(fall > 0, cells * h - center, center) - extent / 2
    fastest = math.sqrt(velocity @ velocity + 2 * np.abs(fall) @ gaps + (spin * reach) ** 2)
    fastest = max(fastest, constant("slowest") * size)
    density, fluid = 1000.0 * min(1.0, ratio or 1.0), 0.0 if ratio is None else 1000.0 / max(1.0, ratio)
    energy = (density + ADDED_MASS * fluid) * fastest**2 / 2
    modulus = energy / draw.number("impact_pressure")
    modulus = max(modulus, abs(density - fluid) * float(np.linalg.norm(pull)) * size / constant("sag"))
    return Scene(
        scene=f"{seed}/{number}",
        shape=shape,
        across=across,
        box=tuple(map(float, cells * h)),
        center=tuple(map(float, center)),
        duration=duration,
        dt=draw.number("step"),
        density_ratio=ratio,
        walls=" ".join(faces),
        cfl=None if draw.happens("default_cfl") else draw.number("cfl"),
        velocity=tuple(map(float, velocity)),
        spin=tuple(map(float, spin * draw.direction("axis"))),
        compressible=draw.happens("compressible"),
        seed=seed,
        number=number,
        size=size,
        faces=faces,
        pull=tuple(map(float, pull)),
        youngs_modulus=modulus,
        poissons_ratio=draw_poisson(draw),
        material="stableNeoHookean" if draw.happens("neo_hookean") else "corotational",
        impact_pressure=energy / modulus,
        fastest=fastest,
        reach=reach,
        folds_nowhere=folds_nowhere(shape),
        surface=(points, triangles),
    )


def draw_poisson(draw: Draw) -> float:
    """Poisson's ratio."""
    if draw.happens("nearly_incompressible"):
        table = ranges()["nearly_incompressible"]
        return table["low"] + table["width"] * draw.evenly("nearly_incompressible", "by")
    return draw.number("poissons_ratio")


def draw_ratio(draw: Draw) -> float | None:
    """Density of the solid over that of the fluid, None for vacuum."""
    return None if draw.happens("vacuum") else draw.number("density_ratio")


def weight_ratio(ratio: float | None) -> float:
    """Acceleration of a ball let go in the fluid over gravity; negative where it rises."""
    return 1.0 if ratio is None else (ratio - 1) / (ratio + ADDED_MASS)


def draw_faces(draw: Draw) -> tuple[str, ...]:
    """Kinds of the faces -x +x -y +y -z +z."""
    if draw.happens("closed_periodic"):
        return ("periodic",) * 6
    faces: list[str] = []
    for axis in AXES:
        faces += (
            ["periodic"] * 2 if draw.happens("periodic", axis) else [draw.one_of("wall", axis + side) for side in "-+"]
        )
    return tuple(faces)


def draw_gravity(draw: Draw, free: list[bool]) -> np.ndarray:
    """Gravity, none of it along periodic axes [m/s^2]."""
    kind = draw.one_of("gravity")
    if kind == "none":
        return np.zeros(3)
    direction = np.array([0.0, -1.0, 0.0]) if kind == "down" else draw.direction("gravity")
    return np.where(free, 0.0, draw.number("gravity_size") * direction)


def box_cells(draw: Draw, extent: np.ndarray, least: np.ndarray, most: float) -> np.ndarray:
    """Cells of the box. extent: of the solid; least: what it needs, both in cells. With over `most` it is drawn in."""
    least = np.ceil(least)
    wanted = least + np.array([(draw.number("room", axis) - 1) for axis in AXES]) * extent
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        fits = np.prod(np.ceil(least + middle * (wanted - least))) <= most
        low, high = (middle, high) if fits else (low, middle)
    share = 1.0 if np.prod(np.ceil(wanted)) <= most else low
    return np.ceil(least + share * (wanted - least))


def place(
    draw: Draw, box: np.ndarray, half: np.ndarray, drift: float, free: list[bool], velocity: np.ndarray
) -> np.ndarray:
    """Centre of the solid's bounding box: anywhere between walls; between periodic faces with the way before it."""
    center = np.empty(3)
    for axis, name in enumerate(AXES):
        margin = drift if free[axis] else half[axis]
        room, t = box[axis] - 2 * margin, draw.evenly("place", name)
        if free[axis]:
            t *= 1 - constant("drift_share")
            t = t if velocity[axis] >= 0 else 1 - t
        center[axis] = margin + room * t
    return center
