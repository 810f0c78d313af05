"""Elastic solids in fluid and alone: added mass, free swing, rising, the soft disc in a cavity; flow in a channel.

Scenes and laws of `bench loop` are called. Lengths [m].
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Mesh, Simulation
from loop import elastic_laws, given_laws, laws, probes, reference
from loop.experiment import GRAVITY, YOUNGS_MODULUS, Experiment, simulate
from loop.measure import Result, from_child
from loop.shapes import SIZE

from .cases_fluid import definition, give, nodes, vortices
from .meter import Failed, Measured, Meter
from .sweep import Run

PATIENCE = 4.0  # wall-clock seconds of an experiment per processor second of its limit
DISC = Path(__file__).with_name("soft_disc.json")


def laboratory(
    run: Run, meter: Meter, experiment: Experiment, how: Callable[[Experiment], dict[str, Any]] = simulate
) -> Result:
    """An experiment of `bench loop` with the choices of a run."""
    chosen = dataclasses.replace(
        experiment,
        dt=run.largest_step,
        settings=(*experiment.settings, *run.settings.items()),
        limit=PATIENCE * run.limit,
    )
    result = from_child(chosen, how(chosen))
    meter.add(result)
    return result


def scaled_modulus(run: Run) -> float:
    """Young's modulus of the laboratory's solid, times the run's `stiffness` [Pa]."""
    return YOUNGS_MODULUS * run.of.get("stiffness", 1.0)


def added_mass(run: Run, meter: Meter) -> Measured:
    """The first acceleration of a ball in the middle of a cube of half-width 3 R."""
    ratio = run.of["ratio"]
    first = next(r for r in laws.release_runs("quick") if r.density_ratio == laws.RATIOS[0])
    release = dataclasses.replace(first, across=run.cells, density_ratio=ratio, duration=run.largest_step)
    result = laboratory(run, meter, release)
    speed = -result.velocity[:, 1] / GRAVITY
    exact = reference.release_acceleration(ratio, reference.ADDED_MASS_CUBE_3R)
    value = float(speed[1] / result.times[1])
    numbers = {"C_m": (ratio - 1) / value - ratio}
    return Measured(value, exact, "relative, acceleration over g", "first step", numbers=numbers)


def swing(run: Run, meter: Meter, wet: bool) -> Measured:
    """A stretched ball let go: frequency, and the energy that it keeps over ten periods."""
    free = elastic_laws.oscillation_runs("quick")[wet]
    root = reference.MODE_2_EQUAL_DENSITY if wet else reference.MODE_2_VACUUM
    fast = float(np.sqrt(run.of["stiffness"]))
    period, e = elastic_laws.period(root) / fast, run.of["strain"]
    free = dataclasses.replace(
        free,
        across=run.cells,
        duration=10 * period,
        youngs_modulus=scaled_modulus(run),
        stretch=(1 + e, (1 + e) ** -0.5, (1 + e) ** -0.5),
    )
    result = laboratory(run, meter, free)
    found = elastic_laws.frequency_root(result) / fast
    energy = result["kinetic_energy"] + result["elastic_energy"] + (result["fluid_energy"] if wet else 0.0)
    kept = float(energy[result.times[1:] > free.duration - period].mean() / result.start["elastic_energy"])
    if np.isnan(found):
        raise Failed(f"the swing dies within a period; energy kept after ten: {kept:.3g}")
    name = "swing_fluid" if wet else "swing_vacuum"
    lost = Measured(kept, 1.0, "energy lost", "mean of the tenth period", numbers={"frequency error": found / root - 1})
    return Measured(
        found, root, "relative, frequency", "ten periods", numbers={"energy kept": kept}, others={name: lost}
    )


def rising(run: Run, meter: Meter) -> Measured:
    """A light ball let go: kinetic energy of ball and fluid over the work of buoyancy, after one diameter."""
    rise = Experiment(
        "rising",
        across=run.cells,
        box=(0.6, 0.8, 0.6),
        center=(0.3, 0.25, 0.3),
        density_ratio=run.of["ratio"],
        gravity=GRAVITY,
        duration=run.of["duration"],
        youngs_modulus=scaled_modulus(run),
    )
    result = laboratory(run, meter, rise)
    center, mass = result.with_start("center")[:, 1], result.start["mass"]
    way = center - center[0]
    if way.max() < SIZE:
        raise Failed(f"the ball has risen by {way.max():.3g} m in {rise.duration:g} s, not by its diameter")
    # Mass of displaced fluid less that of the ball: the fluid is the denser one, of 1000 kg/m^3.
    work = (mass / rise.density_ratio - mass) * GRAVITY * way
    kinetic = result.with_start("kinetic_energy") + result.with_start("fluid_energy")
    first = int(np.argmax(way >= SIZE))
    share = lambda e: float(np.interp(SIZE, way[: first + 1], (e / np.maximum(work, 1e-12))[: first + 1]))  # noqa: E731
    numbers = {"of the ball alone": share(result.with_start("kinetic_energy"))}
    return Measured(share(kinetic), 1.0, "kinetic energy over work of buoyancy", "one diameter", numbers=numbers)


def poiseuille(run: Run, meter: Meter) -> Measured:
    """Flow through a channel is a parabola; `cells` over its height."""
    h = given_laws.CHANNEL_HIGH / run.cells
    channel = given_laws.channel_runs("quick")[0]
    # across is a whole number of cells over SIZE: with 3 cells of the height come 2 of it.
    channel = dataclasses.replace(channel, across=round(SIZE / h), box=(8 * h, given_laws.CHANNEL_HIGH, h))
    result = laboratory(run, meter, channel, probes.simulate)
    if result.failure:
        raise Failed(result.failure)
    profile = result["profile"][-1]
    nu = probes.CHANNEL_VISCOSITY / probes.CHANNEL_DENSITY
    exact = 4 * np.linspace(0, 1, len(profile)) * (1 - np.linspace(0, 1, len(profile)))
    exact *= probes.CHANNEL_PUSH * given_laws.CHANNEL_HIGH**2 / (8 * nu)
    error = float(np.sqrt(((profile - exact) ** 2).mean() / (exact**2).mean()))
    return Measured(error, 0.0, "L2 of velocity", f"t = {channel.duration:g} s", error)


# --- the soft disc ---------------------------------------------------------------------------------------------------


def disc_mesh(center: tuple[float, float], radius: float, low: float, high: float, parts: int = 256) -> Mesh:
    """A cylinder along z."""
    turn = 2 * np.pi * np.arange(parts) / parts
    ring = np.stack([center[0] + radius * np.cos(turn), center[1] + radius * np.sin(turn)], axis=1)
    points = np.concatenate([np.c_[ring, np.full(parts, z)] for z in (low, high)])
    i, j = np.arange(parts), (np.arange(parts) + 1) % parts
    quads = np.stack([i, j, j + parts, i + parts], axis=1)
    counts = [parts, parts] + [4] * parts
    return Mesh(points, counts, np.concatenate([i[::-1], i + parts, quads.ravel()]))


def add_disc(simulation: Simulation, run: Run, center: tuple[float, float], shear: float, **more: float) -> int:
    """The disc of Zhao, Freund & Moser (2008), of density 1 and radius 0.2; shear: its modulus. Returns its id."""
    solid, _ = simulation.add_solid(
        disc_mesh(center, 0.2, 0.0, run.spacing),
        density=1.0,
        youngs_modulus=3 * shear,
        poissons_ratio=0.499,
        material=binding.MATERIALS["stableNeoHookean"],
        **more,
    )
    return solid


def soft_disc(run: Run, meter: Meter) -> Measured:
    """Path of a soft disc in a lid-driven cavity (Zhao, Freund & Moser 2008) beside that of the table."""
    table = np.array(json.loads(DISC.read_text())["path"])
    viscosity, shear, end = 0.01, 0.1, run.of["duration"]
    lid = {"wall_velocity[3]": (1.0, 0.0, 0.0), "fluid_viscosity": viscosity, "fluid_density": 1.0}
    path: list[list[float]] = []
    with Simulation(definition(run, "noSlip", **lid)) as simulation:
        # beta of K: at small strain a viscosity of the solid
        solid = add_disc(simulation, run, (0.6, 0.5), shear, rayleigh_beta=viscosity / shear)
        start = simulation.solid_diagnostics(solid)

        def look(_info: dict[str, Any]) -> None:
            seen = simulation.solid_diagnostics(solid)
            path.append([simulation.time, *seen["center"][:2], seen["volume_mesh"] / start["volume_mesh"]])

        meter.advance(simulation, end, run.largest_step, after=look)
    seen = np.array(path)
    times = table[table[:, 0] <= end + 1e-9]
    at = np.stack([np.interp(times[:, 0], seen[:, 0], seen[:, k]) for k in (1, 2)], axis=1)
    away = np.linalg.norm(at - times[:, 1:], axis=1)
    numbers = {"largest distance": float(away.max()), "area off": float(np.abs(seen[:, 3] - 1).max())}
    error = float(away.mean())
    return Measured(error, 0.0, "mean distance of the centre from the table", f"t to {end:g}", error, numbers)


def oscillating_disc(run: Run, meter: Meter) -> Measured:
    """A disc in a vortex of a periodic box (Zhao, Freund & Moser 2008) without viscosity: energy that is kept."""
    shear, end = 1.0, run.of["duration"]
    ranges: list[tuple[float, float, float]] = []
    with Simulation(definition(run, "periodic", fluid_density=1.0)) as simulation:
        solid = add_disc(simulation, run, (0.5, 0.5), shear)
        flow = vortices(run, 0.1 * np.pi)
        give(simulation, flow)
        field, place = simulation.field("solid_velocity", solid)
        simulation.set_field("solid_velocity", np.stack(flow(*nodes(place, field.shape[1:]))), solid)

        def energy() -> float:
            seen = simulation.solid_diagnostics(solid)
            ranges.append((seen["min_det_f"], seen["max_det_f"], seen["volume_mesh"]))
            fluid = simulation.fluid_diagnostics()["kinetic_energy"]
            return float(seen["kinetic_energy"] + seen["elastic_energy"] + fluid)

        energies = [energy()]
        meter.advance(simulation, end, run.largest_step, after=lambda _info: energies.append(energy()))
    low, high, area = np.array(ranges).T
    kept = np.array(energies) / energies[0]
    numbers = {
        "energy kept": float(kept[-1]),
        "lowest det F": float(low.min()),
        "highest det F": float(high.max()),
        "area off": float(np.abs(area / area[0] - 1).max()),
        "largest energy": float(kept.max()),
    }
    return Measured(float(kept[-1]), 1.0, "energy lost", f"t = {end:g} s", numbers=numbers)


def lamb_vacuum(run: Run, meter: Meter) -> Measured:
    return swing(run, meter, False)


def lamb_fluid(run: Run, meter: Meter) -> Measured:
    return swing(run, meter, True)


CASES = {
    "poiseuille": poiseuille,
    "added_mass": added_mass,
    "lamb_vacuum": lamb_vacuum,
    "lamb_fluid": lamb_fluid,
    "rising": rising,
    "soft_disc": soft_disc,
    "oscillating_disc": oscillating_disc,
}
