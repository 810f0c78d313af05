"""Solids in vacuum: elastica, Turek and Hron's beam, bars pulled and slabs sheared, yield, a tumbling box."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Mesh, Simulation, Surface
from loop import given_laws, probes
from loop.experiment import SHEAR_MODULUS, Experiment
from loop.shapes import SIZE, blocks

from .cases_coupled import disc_mesh, laboratory
from .meter import Measured, Meter
from .sweep import Run


def elastica(run: Run, meter: Meter) -> Measured:
    """The cantilever of `bench loop` under its weight, `cells` over its height: sag of the tip over the length."""
    base = given_laws.cantilever_runs("quick")[0]
    across = round(run.cells * SIZE / probes.BAR_HIGH)
    beam = dataclasses.replace(base, across=across, box=(*base.box[:2], probes.BAR_HIGH / run.cells))
    result = laboratory(run, meter, beam, probes.simulate)
    sag, angle = given_laws.elastica(probes.BAR_BETA)
    numbers = {"angle off": float(result["angle"][-1] / angle - 1)}
    return Measured(
        float(result["sag"][-1]), sag, "relative, sag of the tip", f"t = {beam.duration:g} s", None, numbers
    )


def vacuum(run: Run, size: tuple[float, float, float], gravity: float = 0.0) -> dict[str, Any]:
    """Fields of EfsiSimulationDef of an empty box."""
    walls = {f"wall[{face}]": binding.WALLS["slip"] for face in range(6)}
    values = {"domain_size": size, "voxel_size": run.spacing, "gravity": (0.0, -gravity, 0.0), "ambient_fluid": 0}
    return values | {"threads": 1} | walls | run.definition


CSM1 = (-7.18767e-3, -66.1023e-3)  # m, of the beam's tip (Turek & Hron 2006, finest grid)


def csm1(run: Run, meter: Meter) -> Measured:
    """The beam of Turek and Hron's benchmark behind its cylinder, under gravity alone; `cells` over its thickness."""
    h = run.spacing
    box = (0.7, 0.41, h)
    with Simulation(vacuum(run, box, gravity=2.0)) as simulation:
        beam = probes.bar((0.2, 0.19, 0.0), (0.6, 0.21, h), 200)
        solid, _ = simulation.add_solid(
            beam,
            density=1000.0,
            youngs_modulus=1.4e6,
            poissons_ratio=0.4,
            compressible=1,
            material=binding.MATERIALS["stVenantKirchhoff"],
            rayleigh_alpha=10.0,
        )
        simulation.add_pin(solid, Surface(disc_mesh((0.2, 0.2), 0.05, -h, 2 * h), h))
        end = np.abs(beam.points[:, 0] - 0.6) < 1e-6
        meter.advance(simulation, run.of["duration"], run.largest_step)
        tip = simulation.surface(solid)[0][end].astype(float).mean(axis=0)
    moved = tip[:2] - [0.6, 0.2]
    numbers, at = {"along the beam": float(moved[0] / CSM1[0] - 1)}, f"t = {run.of['duration']:g} s"
    return Measured(float(moved[1]), CSM1[1], "relative, tip across the beam", at, None, numbers)


def principal_stress(law: str, s: np.ndarray, mu: float, lam: float) -> np.ndarray:
    """d psi / d s of a law (docs/numerics/materials.md)."""
    if law == "corotational":
        return 2 * mu * (s - 1) + lam * (s - 1).sum()
    if law == "stVenantKirchhoff":
        e = (s**2 - 1) / 2
        return s * (2 * mu * e + lam * e.sum())
    m, k, volume = 4 / 3 * mu, lam + 5 / 6 * mu, s.prod()
    a = 1 + m / k - m / (4 * k)
    return m * s + k * (volume - a) * volume / s - m * s / ((s**2).sum() + 1)


def pulled_neo_hookean(stretch: float) -> float:
    """Over Young's modulus, with free sides and a Poisson's ratio of 0, by bisection."""
    low, high = 0.2, 2.0
    for _ in range(60):
        side = (low + high) / 2
        along, across, _ = principal_stress("stableNeoHookean", np.array([stretch, side, side]), 0.5, 0.0)
        low, high = (low, side) if across > 0 else (side, high)
    return float(along)


# Stress over Young's modulus at a stretch, for a Poisson's ratio of 0, where the held ends hinder little or nothing.
PULLED = {
    "stableNeoHookean": pulled_neo_hookean,
    "corotational": lambda s: s - 1,
    "stVenantKirchhoff": lambda s: s * (s**2 - 1) / 2,
}


PULL = 0.2  # s: in which an end is moved


def held_force(run: Run, meter: Meter, simulation: Simulation, mesh: Mesh, axis: int, way: np.ndarray) -> np.ndarray:
    """Force on the end of solid 1 that is moved by `way` along the axis and held, the other end fixed, at rest [N]."""
    along = mesh.points[:, axis]
    _fixed, end = (simulation.add_pin(1, np.abs(along - at) < 1e-6) for at in (along.min(), along.max()))
    moved, steps = np.eye(4), []
    moved[:3, 3] = way
    simulation.set_motion(end, 0.0, PULL, (np.eye(4), moved))
    meter.advance(simulation, PULL, run.largest_step)
    simulation.set_motion(end, PULL, PULL + 10.0, (moved, moved))

    def look(info: dict[str, Any]) -> None:
        steps.append([info["dt"], *simulation.pin_reaction(end)["impulse"]])

    meter.advance(simulation, run.of["duration"], run.largest_step, after=look)
    late = np.array(steps[-max(1, len(steps) // 5) :])
    return late[:, 1:].sum(axis=0) / late[:, 0].sum()


def add_bar(run: Run, simulation: Simulation, mesh: Mesh, poisson: float) -> None:
    """As solid 1, of the law and modulus of the run, with much damping."""
    values = {"density": 1000.0, "youngs_modulus": run.of["modulus"], "poissons_ratio": poisson, "compressible": 1}
    simulation.add_solid(mesh, material=binding.MATERIALS[run.of["law"]], rayleigh_alpha=20.0, **values)


def uniaxial(run: Run, meter: Meter) -> Measured:
    """A square bar held at both ends and pulled: its force by the law at the stretch of its middle half.

    `cells` over its thickness. A pin holds all elements that its vertices touch, so that the ends stretch less.
    """
    long, thick, stretch = 4 * run.length, run.length, run.of["stretch"]
    room = (long * stretch + 4 * run.spacing, thick + 4 * run.spacing, thick + 4 * run.spacing)
    low = np.array([1.0, 2.0, 2.0]) * run.spacing
    bar = probes.bar(tuple(low), tuple(low + [long, thick, thick]), 4 * run.cells)
    with Simulation(vacuum(run, room)) as simulation:
        add_bar(run, simulation, bar, 0.0)
        force = held_force(run, meter, simulation, bar, 0, np.array([long * (stretch - 1), 0.0, 0.0]))
        now = simulation.surface(1)[0][:, 0].astype(float)
    x = bar.points[:, 0]
    marks = [np.abs(x - x.min() - part * long) < 1e-6 for part in (0.25, 0.75)]
    middle = float((now[marks[1]].mean() - now[marks[0]].mean()) / (long / 2))
    numbers = {"stretch of the middle": middle, "of the whole": stretch}
    value, exact = float(force[0] / (run.of["modulus"] * thick**2)), float(PULLED[run.of["law"]](middle))
    return Measured(value, exact, "relative, force at the held end", "at rest", numbers=numbers)


SHEARED = 0.25  # Poisson ratio; above it the pressure has a part of the law (docs/numerics/bulk-by-pressure.md)
LONG = (4, 8)  # heights


def shear_stress(law: str, shear: float) -> float:
    """Over Young's modulus, of simple shear, whose stretches are (sqrt(4 + shear^2) +- shear) / 2 and 1."""
    root = np.sqrt(4 + shear**2)
    stretches = np.array([(root + shear) / 2, (root - shear) / 2, 1.0])
    slopes = np.array([shear / root + 1, shear / root - 1, 0.0]) / 2
    mu, lam = 0.5 / (1 + SHEARED), SHEARED / ((1 + SHEARED) * (1 - 2 * SHEARED))
    return float(principal_stress(law, stretches, mu, lam) @ slopes)


def shear(run: Run, meter: Meter) -> Measured:
    """A slab held below and moved sideways above: its force by the law at the shear of its middle.

    `cells` over its height. Of two lengths: the difference of their forces is without what their ends lack.
    """
    high, h, forces = run.length, run.spacing, []
    way = np.array([run.of["shear"] * high, 0.0, 0.0])
    for long in LONG:
        count = np.array([long * round(run.cells), 2 * round(run.cells), 1])
        points, triangles = blocks(np.ones(count, bool), (long * high / count[0], high / count[1], h))
        slab = Mesh(points + [h, 2 * h, 0.0], np.full(len(triangles), 3), triangles.ravel())
        with Simulation(vacuum(run, (long * high + way[0] + 2 * h, high + 4 * h, h))) as simulation:
            add_bar(run, simulation, slab, SHEARED)
            forces.append(held_force(run, meter, simulation, slab, 1, way)[0])
            now = simulation.surface(1)[0][:, 0].astype(float) - slab.points[:, 0]
    x, y = (slab.points[:, axis].astype(float) for axis in (0, 1))
    amid = np.abs(x - x.mean()) < 0.1 * long * high
    marks = [amid & (np.abs(y - y.min() - part * high) < 1e-6) for part in (0.25, 0.75)]
    middle = float((now[marks[1]].mean() - now[marks[0]].mean()) / (high / 2))
    value = float((forces[1] - forces[0]) / (run.of["modulus"] * (LONG[1] - LONG[0]) * high * h))
    numbers = {"shear of the middle": middle, "of the whole": run.of["shear"]}
    exact = shear_stress(run.of["law"], middle)
    return Measured(value, exact, "relative, force at the held end", "at rest", numbers=numbers)


def yield_stretch(stress: float) -> float:
    """Elastic stretch of a bar of constant volume at which the corotational law has a Kirchhoff stress over mu."""
    low, high = 1.0, 1.5
    for _ in range(60):
        s = (low + high) / 2
        low, high = (low, s) if 2 * (s * s - s - 1 / s + s**-0.5) > stress else (s, high)
    return low


def plastic_ball(run: Run, meter: Meter) -> Measured:
    """A ball stretched beyond its yield stress and let go keeps what is not elastic."""
    stretch, stress = run.of["stretch"], run.of["yield_stress"]
    pulled = Experiment(
        "ball that yields",
        across=run.cells,
        box=(0.5, 0.4, 0.4),
        density_ratio=None,
        stretch=(stretch, stretch**-0.5, stretch**-0.5),
        duration=run.of["duration"],
        damping=0.003,
        settings=(("plastic_yield_stress", stress), ("plastic_flow_rate", 1e6)),
    )
    result = laboratory(run, meter, pulled)
    low, high = result["extent_min"][-1][0], result["extent_max"][-1][0]
    value, exact = float((high - low) / SIZE - 1), stretch / yield_stretch(stress / SHEAR_MODULUS) - 1
    return Measured(value, exact, "relative, strain that stays", f"t = {pulled.duration:g} s")


def tumbling(run: Run, meter: Meter) -> Measured:
    """A box that turns about its middle axis and a little about another one: energy after ten turns, or `turns`."""
    spin, turns = run.of["spin"], run.of.get("turns", 10)
    turning = Experiment(
        "tumbling",
        shape="box",
        across=run.cells,
        box=(0.4, 0.4, 0.4),
        density_ratio=None,
        spin=(0.05 * spin, spin, 0.0),
        youngs_modulus=run.of["modulus"],
        duration=turns * 2 * np.pi / spin,
    )
    result = laboratory(run, meter, turning)
    energy = result.with_start("kinetic_energy") + result.with_start("elastic_energy")
    turn = np.linalg.norm(result.with_start("angular_momentum"), axis=1)
    numbers = {"angular momentum kept": float(turn[-1] / turn[0]), "misfit over the edge": result["misfit"][-1] / SIZE}
    return Measured(float(energy[-1] / energy[0]), 1.0, "energy lost", f"{turns:g} turns", numbers=numbers)


CASES = {
    "elastica": elastica,
    "csm1": csm1,
    "uniaxial_corotational": uniaxial,
    "uniaxial_stvk": uniaxial,
    "uniaxial_neo_hookean": uniaxial,
    "shear_corotational": shear,
    "shear_stvk": shear,
    "shear_neo_hookean": shear,
    "plastic_ball": plastic_ball,
    "tumbling": tumbling,
}
