"""libeulerfsi: `ours.py CASE ACROSS [--options '{"steps_per_period": 160}']`, without fluid, compressible, one thread.

Needs EULERFSI_LIBRARY or a build, and the package eulerfsi on PYTHONPATH.
"""

from __future__ import annotations

import bodies
import numpy as np
import shared
from eulerfsi.solver import binding
from eulerfsi.solver.simulation import Mesh, Simulation, Surface
from shared import Case, Outcome, Stopwatch

STEPS = 40  # of a period of the oscillation
REST_STEPS = 100  # of a period of the beam
ROOT = 0.04  # of the beam within its clamp [m]


def surface_of(points: np.ndarray, tets: np.ndarray) -> Mesh:
    """The outer triangles of tetrahedra."""
    faces = tets[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = faces[first[count == 1]]
    used, index = np.unique(outer, return_inverse=True)
    return Mesh(points[used], np.full(len(outer), 3), index.ravel())


def ball_mesh(case: Case, center: np.ndarray) -> Mesh:
    """Fine enough that its facets do not matter; exactly the ball's volume."""
    points, _, tets = bodies.ball(case.radius, 32)
    return surface_of(points + center, tets)


def definition(case: Case, low: np.ndarray, size: np.ndarray) -> dict:
    """Fields of EfsiSimulationDef; the box is a whole number of cells."""
    values = {"domain_min": low, "domain_size": np.ceil(size / case.spacing - 1e-9) * case.spacing}
    values |= {"voxel_size": case.spacing, "ambient_fluid": 0, "threads": 1}
    return values | case.options.get("simulation", {})


def solid(case: Case) -> dict:
    material = binding.MATERIALS["stVenantKirchhoff"]
    return {**case.material, "material": material, "compressible": 1, **case.options.get("solid", {})}


def oscillation(case: Case) -> Outcome:
    middle = np.full(3, 2 * case.radius)
    mesh = ball_mesh(case, middle)
    shares = vertex_areas(mesh)
    dt = case.period / case.options.get("steps_per_period", STEPS)
    with Simulation(definition(case, np.zeros(3), np.full(3, 4 * case.radius))) as simulation:
        ball, _ = simulation.add_solid(mesh, **solid(case))
        set_mode(simulation, ball, case, middle)

        def look() -> tuple[float, float]:
            facts = simulation.solid_diagnostics(ball)
            points = simulation.surface(ball)[0].astype(float)
            return shared.ellipticity(points, shares), facts["kinetic_energy"] + facts["elastic_energy"]

        seen, times = [look()], [0.0]
        used = Stopwatch()
        while case.end - simulation.time > 1e-9:
            with used:
                simulation.step(min(dt, case.end - simulation.time))
            seen.append(look())
            times.append(simulation.time)
        steps = simulation.steps
    ellipticity, energies = zip(*seen, strict=True)
    kept = shared.energy_kept(times, energies, case.period)
    found = {"times": times, "ellipticity": ellipticity, "energy_kept": kept}
    return found | {"steps": steps} | used.found()


def set_mode(simulation: Simulation, ball: int, case: Case, middle: np.ndarray) -> None:
    """Sets u(x) = x - X of the mode, X + mode(X) = x by repetition."""
    u, place = simulation.field("solid_displacement", ball)
    axes = [place["origin"][a] + place["spacing"] * np.arange(u.shape[a + 1]) - middle[a] for a in range(3)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    moved = np.zeros_like(x)
    for _ in range(8):
        moved = case.mode(x - moved)
    simulation.set_field("solid_displacement", moved.T.reshape(u.shape).astype(np.float32), ball)


def vertex_areas(mesh: Mesh) -> np.ndarray:
    corners = mesh.points.astype(float)[mesh.triangles()]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.bincount(mesh.triangles().ravel(), np.repeat(areas, 3), len(mesh.points))


def bounce(case: Case) -> Outcome:
    radius = case.radius
    mesh = ball_mesh(case, np.array([2 * radius, radius + case.gap, 2 * radius]))
    mesh.points[:, 1] += case.gap - mesh.points[:, 1].min()
    with Simulation(definition(case, np.zeros(3), np.array([4, 4, 4]) * radius)) as simulation:
        ball, _ = simulation.add_solid(mesh, velocity=(0.0, -case.speed, 0.0), **solid(case))
        used = Stopwatch()
        while case.duration - simulation.time > 1e-9:
            longest = case.options.get("max_step", case.duration)
            with used:
                simulation.step(min(longest, case.duration - simulation.time))
        facts, steps = simulation.solid_diagnostics(ball), simulation.steps
    found = {"restitution": facts["momentum"][1] / facts["mass"] / case.speed, "clear": facts["extent_min"][1] > 0}
    return found | {"steps": steps} | used.found()


def cantilever(case: Case) -> Outcome:
    h = case.spacing
    points, _, tets = bodies.beam(case.length + ROOT, case.height, 8)
    points[:, 0] -= ROOT
    mesh = surface_of(points, tets)
    low = -np.array([2 * ROOT, 2 * case.height, case.height])
    values = definition(case, low, np.array([case.length + 3 * ROOT, 3 * case.height, 2 * case.height]))
    with Simulation(values | {"gravity": (0.0, -case.gravity, 0.0)}) as simulation:
        beam, _ = simulation.add_solid(mesh, rayleigh_alpha=case.damping, **solid(case))
        clamp = bodies.beam(2 * ROOT, 2 * case.height, 2)
        simulation.add_pin(beam, Surface(surface_of(clamp[0] - [2 * ROOT, 0, 0], clamp[2]), h))
        used = Stopwatch()
        dt = case.period / case.options.get("steps_per_period", REST_STEPS)
        while case.end - simulation.time > 1e-9:
            with used:
                simulation.step(min(dt, case.end - simulation.time))
        steps = simulation.steps
        sags = mesh.points[:, 1] - simulation.surface(beam)[0][:, 1]
    end = mesh.points[:, 0] > case.length - 1e-5
    shares = vertex_areas(mesh)[end]
    sag = float(shares @ sags[end] / shares.sum())
    return {"sag": sag, "steps": steps} | used.found()


SOLVE = {"oscillation": oscillation, "bounce": bounce, "cantilever": cantilever}

if __name__ == "__main__":
    shared.run_script(lambda case: SOLVE[case.name](case))
