"""Solids in vacuum: elastica, Turek and Hron's beam, a pulled bar of each law, a ball that yields, a tumbling box."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Simulation, Surface
from loop import given_laws, probes
from loop.experiment import SHEAR_MODULUS, Experiment
from loop.shapes import SIZE

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


def pulled_neo_hookean(stretch: float) -> float:
    """Of the stable neo-Hookean law (docs/numerics/materials.md) with free sides, by bisection."""
    m, k = 2 / 3, 5 / 12  # 4/3 mu and 5/6 mu over Young's modulus 2 mu
    a = 1 + m / k - m / (4 * k)

    def stress(along: float, across: float, which: float) -> float:
        volume, total = along * across**2, along**2 + 2 * across**2
        return m * which + k * (volume - a) * volume / which - m * which / (total + 1)

    low, high = 0.2, 2.0
    for _ in range(60):
        side = (low + high) / 2
        low, high = (low, side) if stress(stretch, side, side) > 0 else (side, high)
    return stress(stretch, side, stretch)


# Stress over Young's modulus at a stretch, for a Poisson's ratio of 0, where the held ends hinder little or nothing.
PULLED = {
    "stableNeoHookean": pulled_neo_hookean,
    "corotational": lambda s: s - 1,
    "stVenantKirchhoff": lambda s: s * (s**2 - 1) / 2,
}


def uniaxial(run: Run, meter: Meter) -> Measured:
    """A square bar held at both ends and pulled: its force by the law at the stretch of its middle half.

    `cells` over its thickness. A pin holds all elements that its vertices touch, so that the ends stretch less.
    """
    long, thick, law = 4 * run.length, run.length, run.of["law"]
    modulus, stretch, pull = run.of["modulus"], run.of["stretch"], 0.2
    room = (long * stretch + 4 * run.spacing, thick + 4 * run.spacing, thick + 4 * run.spacing)
    low = np.array([1.0, 2.0, 2.0]) * run.spacing
    bar = probes.bar(tuple(low), tuple(low + [long, thick, thick]), 4 * run.cells)
    impulse: list[tuple[float, float]] = []
    with Simulation(vacuum(run, room)) as simulation:
        solid, _ = simulation.add_solid(
            bar,
            density=1000.0,
            youngs_modulus=modulus,
            poissons_ratio=0.0,
            compressible=1,
            material=binding.MATERIALS[law],
            rayleigh_alpha=20.0,
        )
        x = bar.points[:, 0]
        pins = [simulation.add_pin(solid, np.abs(x - end) < 1e-6) for end in (x.min(), x.max())]
        poses = [np.eye(4), np.eye(4)]
        poses[1][0, 3] = long * (stretch - 1)
        simulation.set_motion(pins[1], 0.0, pull, tuple(poses))
        meter.advance(simulation, pull, run.largest_step)
        simulation.set_motion(pins[1], pull, pull + 10.0, (poses[1], poses[1]))

        def look(info: dict[str, Any]) -> None:
            impulse.append((info["dt"], simulation.pin_reaction(pins[1])["impulse"][0]))

        meter.advance(simulation, run.of["duration"], run.largest_step, after=look)
        now = simulation.surface(solid)[0][:, 0].astype(float)
    dt, kick = np.array(impulse[-max(1, len(impulse) // 5) :]).T
    value = float(kick.sum() / dt.sum() / (modulus * thick**2))
    marks = [np.abs(x - x.min() - part * long) < 1e-6 for part in (0.25, 0.75)]
    middle = float((now[marks[1]].mean() - now[marks[0]].mean()) / (long / 2))
    numbers = {"stretch of the middle": middle, "of the whole": stretch}
    exact = float(PULLED[law](middle))
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
    """A box that turns about its middle axis and a little about another one: energy after ten turns."""
    spin = run.of["spin"]
    turning = Experiment(
        "tumbling",
        shape="box",
        across=run.cells,
        box=(0.4, 0.4, 0.4),
        density_ratio=None,
        spin=(0.05 * spin, spin, 0.0),
        youngs_modulus=run.of["modulus"],
        duration=10 * 2 * np.pi / spin,
    )
    result = laboratory(run, meter, turning)
    energy = result.with_start("kinetic_energy") + result.with_start("elastic_energy")
    turn = np.linalg.norm(result.with_start("angular_momentum"), axis=1)
    kept, late = float(energy[-1] / energy[0]), float(turn[-1] / turn[0])
    return Measured(kept, 1.0, "energy lost", "ten turns", numbers={"angular momentum kept": late})


CASES = {
    "elastica": elastica,
    "csm1": csm1,
    "uniaxial_corotational": uniaxial,
    "uniaxial_stvk": uniaxial,
    "uniaxial_neo_hookean": uniaxial,
    "plastic_ball": plastic_ball,
    "tumbling": tumbling,
}
