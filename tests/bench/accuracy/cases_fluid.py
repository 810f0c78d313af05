"""Fluid alone: vortices of Euler's equations, lid-driven cavity, viscous decay."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Simulation

from .meter import Measured, Meter
from .sweep import Run

DENSITY = 1.0
Flow = Callable[[np.ndarray, np.ndarray, np.ndarray], list[np.ndarray]]


def definition(run: Run, walls: str, deep: bool = False, **more: Any) -> dict[str, Any]:
    """Fields of EfsiSimulationDef of a unit box, or of a slab of it that is one cell thick."""
    edge, h = run.length, run.spacing
    kinds = [walls] * 6 if deep or walls == "periodic" else [walls] * 4 + ["slip"] * 2
    if not deep:
        kinds[4:] = ["slip", "slip"]
    values: dict[str, Any] = {
        "domain_size": (edge, edge, edge if deep else h),
        "voxel_size": h,
        "gravity": (0.0, 0.0, 0.0),
        "fluid_density": DENSITY,
        "threads": 1,
        **{f"wall[{face}]": binding.WALLS[kind] for face, kind in enumerate(kinds)},
    }
    return values | more | run.definition


def nodes(place: dict[str, Any], size: tuple[int, ...]) -> list[np.ndarray]:
    """x, y, z of the nodes of a field [m]."""
    axes = [place["origin"][a] + place["spacing"] * np.arange(size[a]) for a in range(3)]
    return list(np.meshgrid(*axes, indexing="ij"))


def give(simulation: Simulation, flow: Flow) -> np.ndarray:
    """Sets the fluid's velocity; returns it, (3, nx, ny, nz) [m/s]."""
    field, place = simulation.field("velocity")
    exact = np.stack(flow(*nodes(place, field.shape[1:])))
    simulation.set_field("velocity", exact)
    return exact


def solenoidal(velocity: np.ndarray) -> np.ndarray:
    """A plane field without its gradient part, (2, n, n); of nodes of a box across which it is periodic."""
    waves = np.fft.fftfreq(velocity.shape[1])
    along = np.stack(np.meshgrid(waves, waves, indexing="ij"))
    seen = np.fft.fft2(velocity)
    square = (along**2).sum(axis=0)
    square[0, 0] = 1.0
    return np.fft.ifft2(seen - along * (along * seen).sum(axis=0) / square).real


def off(simulation: Simulation, exact: np.ndarray) -> tuple[float, float]:
    """L2 of the velocity's error over that of the exact velocity, across which the box is periodic.

    Without its gradient part, which the next projection takes: a step ends with the transport, before half of its
    pressure has acted (docs/numerics/carried-pressure.md); and with it.
    """
    plane = np.s_[:2, :-1, :-1, 0]  # the last nodes are the first ones again
    found, wanted = simulation.field("velocity")[0][plane].astype(float), exact[plane]
    parts = [np.sqrt(((part - wanted) ** 2).sum() / (wanted**2).sum()) for part in (solenoidal(found), found)]
    return float(parts[0]), float(parts[1])


def vortices(run: Run, speed: float) -> Flow:
    """Taylor-Green's vortices in the plane, two a side of the box."""
    k = 2 * np.pi / run.length
    return lambda x, y, z: [
        speed * np.sin(k * x) * np.cos(k * y),
        -speed * np.cos(k * x) * np.sin(k * y),
        np.zeros_like(z),
    ]


def steady_vortices(run: Run, meter: Meter, walls: str) -> Measured:
    """Inviscid, so that they stay as they are."""
    end = run.of["turns"] * run.length / run.of["speed"]
    with Simulation(definition(run, walls)) as simulation:
        exact = give(simulation, vortices(run, run.of["speed"]))
        begun = simulation.fluid_diagnostics()["kinetic_energy"]
        meter.advance(simulation, end, run.largest_step)
        error, whole = off(simulation, exact)
        kept = simulation.fluid_diagnostics()["kinetic_energy"] / begun
    numbers = {"energy kept": kept, "with its gradient part": whole}
    return Measured(error, 0.0, "L2 of velocity", f"t = {end:.4g} s", error, numbers)


def taylor_green_box(run: Run, meter: Meter) -> Measured:
    return steady_vortices(run, meter, "slip")


def taylor_green_periodic(run: Run, meter: Meter) -> Measured:
    return steady_vortices(run, meter, "periodic")


def taylor_green_3d(run: Run, meter: Meter) -> Measured:
    """An eighth of the periodic flow, between its planes of symmetry; energy is kept where nothing is lost."""
    k, speed = np.pi / run.length, run.of["speed"]
    end = run.of["turns"] / k / speed
    with Simulation(definition(run, "slip", deep=True)) as simulation:
        give(
            simulation,
            lambda x, y, z: [
                speed * np.sin(k * x) * np.cos(k * y) * np.cos(k * z),
                -speed * np.cos(k * x) * np.sin(k * y) * np.cos(k * z),
                np.zeros_like(z),
            ],
        )
        begun = simulation.fluid_diagnostics()["kinetic_energy"]
        meter.advance(simulation, end, run.largest_step)
        kept = simulation.fluid_diagnostics()["kinetic_energy"] / begun
    return Measured(kept, 1.0, "energy lost", f"t k U = {run.of['turns']:g}")


def bessel(order: int, x: np.ndarray) -> np.ndarray:
    """J_n(x) by its series, for the x < 4 of a dipole."""
    terms = range(24)
    return sum((-1) ** m / (math.factorial(m) * math.factorial(m + order)) * (x / 2) ** (2 * m + order) for m in terms)


ROOT = 3.8317059702  # of J_1


def dipole(radius: float, speed: float, center: tuple[float, float]) -> Callable:
    """Stream function of Lamb's dipole in fluid at rest, which it crosses along x (Lamb, Hydrodynamics, art. 165)."""
    k = ROOT / radius
    inner = 2 * speed / (k * bessel(0, np.array(ROOT)))

    def stream(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        dx, dy = x - center[0], y - center[1]
        r = np.maximum(np.hypot(dx, dy), 1e-12)
        inside = inner * bessel(1, np.minimum(k * r, ROOT)) * -1 + speed * r
        return dy / r * np.where(r < radius, inside, speed * radius**2 / r)

    return stream


def lamb_dipole(run: Run, meter: Meter) -> Measured:
    """How much energy it keeps over two diameters; the walls, three radii away, bend its path a little."""
    radius, speed, small = 0.1 * run.length, run.of["speed"], 1e-5 * run.length
    stream = dipole(radius, speed, (0.3 * run.length, 0.5 * run.length))
    end = 4 * radius / speed
    with Simulation(definition(run, "slip")) as simulation:
        give(
            simulation,
            lambda x, y, z: [
                (stream(x, y + small) - stream(x, y - small)) / (2 * small),
                -(stream(x + small, y) - stream(x - small, y)) / (2 * small),
                np.zeros_like(z),
            ],
        )
        meter.step(simulation, 1e-6 * end)  # the projection takes away what the walls do not let through
        begun, start = simulation.fluid_diagnostics()["kinetic_energy"], middle_of_vorticity(simulation)
        meter.advance(simulation, end, run.largest_step)
        kept = simulation.fluid_diagnostics()["kinetic_energy"] / begun
        pace = (middle_of_vorticity(simulation) - start) / simulation.time / speed
    return Measured(kept, 1.0, "energy lost", "two diameters", numbers={"speed over U": pace})


def middle_of_vorticity(simulation: Simulation) -> float:
    """Mean x, weighted with the squared vorticity [m]."""
    field, place = simulation.field("velocity")
    u, v, h = field[0, :, :, 0].astype(float), field[1, :, :, 0].astype(float), place["spacing"]
    curl = (np.diff(v, axis=0)[:, :-1] - np.diff(u, axis=1)[:-1]) / h
    x = place["origin"][0] + h * (np.arange(curl.shape[0]) + 0.5)
    weight = (curl**2).sum(axis=1)
    return float((weight * x).sum() / weight.sum())


# --- viscous ---------------------------------------------------------------------------------------------------------


def taylor_green_decay(run: Run, meter: Meter) -> Measured:
    """Velocity falls as exp(-2 nu k^2 t)."""
    k, end = 2 * np.pi / run.length, run.of["turns"] * run.length / run.of["speed"]
    nu = run.of["speed"] * run.length / run.of["reynolds"]
    with Simulation(definition(run, "periodic", fluid_viscosity=nu * DENSITY)) as simulation:
        exact = give(simulation, vortices(run, run.of["speed"])) * np.exp(-2 * nu * k**2 * end)
        meter.advance(simulation, end, run.largest_step)
        error, whole = off(simulation, exact)
    numbers = {"with its gradient part": whole}
    return Measured(error, 0.0, "L2 of velocity", f"t = {end:.4g} s, Re {run.of['reynolds']:g}", error, numbers)


def cavity(run: Run, meter: Meter) -> Measured:
    """Velocity along the middle of a lid-driven cavity, beside the table of Ghia et al. 1982."""
    speed, end = run.of["speed"], run.of["turns"] * run.length / run.of["speed"]
    viscosity = DENSITY * speed * run.length / run.of["reynolds"]
    lid = {"wall_velocity[3]": (speed, 0.0, 0.0), "fluid_viscosity": viscosity}
    heights, speeds = np.array(run.of["ghia"]).T
    with Simulation(definition(run, "noSlip", **lid)) as simulation:
        meter.advance(simulation, end, run.largest_step)
        field, _ = simulation.field("velocity")
    count = field.shape[1]
    middle = (field[0, count // 2] + field[0, (count - 1) // 2])[:, 0] / 2
    found = np.interp(heights * run.length, run.spacing * np.arange(field.shape[2]), middle) / speed
    error = float(np.sqrt(np.mean((found - speeds) ** 2)))
    return Measured(error, 0.0, "RMS of u at Ghia's points over U", f"t U / L = {run.of['turns']:g}", error)


CASES = {
    "taylor_green_box": taylor_green_box,
    "taylor_green_periodic": taylor_green_periodic,
    "taylor_green_3d": taylor_green_3d,
    "lamb_dipole": lamb_dipole,
    "taylor_green_decay": taylor_green_decay,
    "cavity_100": cavity,
    "cavity_1000": cavity,
}
