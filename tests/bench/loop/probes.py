"""Runs of the laws of what is given and of what flows: a bar that hangs, a cantilever, a jet, a channel, a plate.

Each gives, after every step, the columns that its law judges. Lengths [m], times [s].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from eulerfsi.errors import LibraryError
from eulerfsi.solver import binding, c_api
from eulerfsi.solver.simulation import Mesh, Simulation, Surface

from .experiment import Experiment, step_ends, timed_step
from .shapes import blocks

Probe = Callable[[Simulation], dict[str, Any]]  # the columns of the last step

HANGING = {"low": (0.15, 0.25, 0.15), "high": (0.25, 0.55, 0.25)}
HELD_ABOVE = 0.5

BAR_HIGH, BAR_LONG = 0.1, 2.0
BAR_ROOT, BAR_LOWEST = 0.2, 0.7  # where the clamp ends; lower face
BAR_BETA = 2.0  # w L^3 / (E' I), E' = E / (1 - nu^2)

JET_MIDDLE, JET_SIZE, JET_SPEED = (0.15, 0.21, 0.2), (0.1, 0.13, 0.11), 2.0

CHANNEL_DENSITY, CHANNEL_VISCOSITY, CHANNEL_PUSH = 1.3, 0.06, 0.8  # kg/m^3, Pa s, m/s^2

# A plate in the middle of a slab, thin along y, that starts to move along itself between two open faces.
PLATE_DENSITY, PLATE_VISCOSITY, PLATE_SPEED, PLATE_CELLS = 1.0, 0.7, 0.05, 4  # of the fluid kg/m^3, Pa s; m/s


def bar(low: tuple[float, ...], high: tuple[float, ...], parts: int) -> Mesh:
    """A box with vertices all along x."""
    size = np.subtract(high, low)
    points, triangles = blocks(np.ones((parts, 1, 1), bool), (size[0] / parts, size[1], size[2]))
    return Mesh(points + np.array(low), np.full(len(triangles), 3), triangles.ravel())


def region(middle: tuple[float, ...], size: tuple[float, ...]) -> np.ndarray:
    """Transform of a region: the unit box, of this size and place."""
    matrix = np.diag([*size, 1.0])
    matrix[:3, 3] = middle
    return matrix


def hanging_bar(run: Experiment, simulation: Simulation) -> Probe:
    mesh = bar(**HANGING, parts=1)
    solid, _ = simulation.add_solid(mesh, **run.solid() | {"youngs_modulus": 2e5, "rayleigh_alpha": 3.0})
    pin = simulation.add_pin(solid, mesh.points[:, 1] > HELD_ABOVE)
    return lambda s: {"impulse": s.pin_reaction(pin)["impulse"], "mass": s.solid_diagnostics(solid)["mass"]}


def cantilever(run: Experiment, simulation: Simulation) -> Probe:
    h, nu = run.spacing, 0.3 if run.compressible else 0.5
    mesh = bar((0.05, BAR_LOWEST, 0.0), (BAR_ROOT + BAR_LONG, BAR_LOWEST + BAR_HIGH, h), 80)
    plane = 12 * 1000.0 * run.gravity * BAR_LONG**3 / (BAR_BETA * BAR_HIGH**2)
    # Where the pressure keeps the volume the shear modulus counts.
    values = {"youngs_modulus": plane * (1 - nu) * 1.3, "poissons_ratio": 0.3, "rayleigh_alpha": 10.0}
    solid, _ = simulation.add_solid(mesh, **run.solid() | values)
    clamp = bar((0.0, BAR_LOWEST - 0.1, -h), (BAR_ROOT, BAR_LOWEST + BAR_HIGH + 0.1, 2 * h), 1)
    simulation.add_pin(solid, Surface(clamp, h))
    end = mesh.points[:, 0] > mesh.points[:, 0].max() - 1e-6
    upper = mesh.points[:, 1] > BAR_LOWEST + 0.5 * BAR_HIGH

    def tip(s: Simulation) -> dict[str, Any]:
        points = s.surface(solid)[0].astype(float)
        low, high = points[end & ~upper].mean(axis=0), points[end & upper].mean(axis=0)
        sag = BAR_LOWEST + 0.5 * BAR_HIGH - 0.5 * (low + high)[1]
        return {"sag": sag / BAR_LONG, "angle": float(np.arctan2(*(high - low)[:2]))}

    return tip


def jet(run: Experiment, simulation: Simulation) -> Probe:
    emitter = simulation.add_emitter(
        shape=binding.REGION_SHAPES["box"],
        mode=binding.EMITTER_MODES["continuous"],
        transform=region(JET_MIDDLE, JET_SIZE),
        velocity=(JET_SPEED, 0.0, 0.0),
        has_velocity=1,
        end_time=1e6,
    )

    def fluxes(s: Simulation) -> dict[str, Any]:
        nodes = s.field("velocity")[0][0][-1].astype(float)  # of the open face
        faces = 0.25 * (nodes[1:, 1:] + nodes[1:, :-1] + nodes[:-1, 1:] + nodes[:-1, :-1])
        return {"brought": s.emitter_flux(emitter), "left": float(faces.sum()) * run.spacing**2}

    return fluxes


def channel(run: Experiment, simulation: Simulation) -> Probe:
    simulation.add_force(
        kind=binding.FORCE_KINDS["constant"],
        acts_on=binding.ACTS_ON["fluid"],
        transform=region((0.0, 0.0, 0.0), (100.0,) * 3),
        acceleration=(CHANNEL_PUSH, 0.0, 0.0),
        end_time=1e6,
    )
    return lambda s: {"profile": s.field("velocity")[0][0][4, :, 0].astype(float).tolist()}


def plate(run: Experiment, beyond: float) -> Mesh:
    """beyond: how far it reaches through the open faces [m]."""
    half = PLATE_CELLS / 2 * run.spacing
    low, high = (0.0 - beyond, run.box[1] / 2 - half, 0.0), (run.box[0] + beyond, run.box[1] / 2 + half, run.box[2])
    return bar(low, high, 8)


def given_plate(run: Experiment, simulation: Simulation) -> Probe:
    """A collider that moves at one speed: momentum of the fluid, and its reported reaction so far [N s]."""
    _, pin = simulation.add_collider(plate(run, 0.1))
    after, so_far = np.eye(4), [0.0]
    after[0, 3] = PLATE_SPEED * run.duration
    simulation.set_motion(pin, 0.0, run.duration, (np.eye(4), after))

    def drag(s: Simulation) -> dict[str, Any]:
        so_far[0] += s.pin_reaction(pin)["impulse"][0]
        return {"drag": s.fluid_diagnostics()["momentum"][0], "reaction": so_far[0]}

    return drag


def thrown_plate(run: Experiment, simulation: Simulation) -> Probe:
    """A solid, as dense as the fluid times the load of the run: momentum that it has lost so far [N s]."""
    values = {"density": PLATE_DENSITY * run.load, "velocity": (PLATE_SPEED, 0.0, 0.0)}
    solid, _ = simulation.add_solid(plate(run, 0.0), **run.solid() | values)
    first = simulation.solid_diagnostics(solid)["momentum"][0]
    return lambda s: {"drag": first - s.solid_diagnostics(solid)["momentum"][0]}


PLATE_FLUID = {"fluid_density": PLATE_DENSITY, "fluid_viscosity": PLATE_VISCOSITY}

# Name -> how it is set up, and what differs from EfsiSimulationDef of an experiment.
PROBES: dict[str, tuple[Callable[[Experiment, Simulation], Probe], dict[str, Any]]] = {
    "bar that hangs": (hanging_bar, {}),
    "cantilever": (cantilever, {}),
    "jet": (jet, {}),
    "given plate": (given_plate, PLATE_FLUID),
    "thrown plate": (thrown_plate, PLATE_FLUID),
    "channel": (channel, {"fluid_density": CHANNEL_DENSITY, "fluid_viscosity": CHANNEL_VISCOSITY}),
}


def simulate(run: Experiment) -> dict[str, Any]:
    """Runs a probe: an answer as that of experiment.simulate. Volumes are not looked at."""
    set_up, values = PROBES[run.probe]
    columns, failure, volumes = [], "", {"volume_mesh": np.nan, "volume_cells": np.nan}
    with Simulation(run.simulation() | values | run.set_in(c_api.SimulationDef)) as simulation:
        probe = set_up(run, simulation)
        try:
            for end in step_ends(run):
                while end - simulation.time > 1e-9:
                    columns.append(timed_step(simulation, end - simulation.time) | volumes | probe(simulation))
        except LibraryError as error:
            failure = str(error)
    names = columns[0].keys() if columns else ()
    return {"failure": failure, "start": volumes, "columns": {n: [row[n] for row in columns] for n in names}}
