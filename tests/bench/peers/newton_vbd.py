"""Vertex block descent by Newton: `newton_vbd.py CASE ACROSS [--options '{"steps": 160, "iterations": 20}']`.

Linear tetrahedra of stable neo-Hookean material (Smith et al. 2018; the only law it has, equal to St. Venant-Kirchhoff
at small strain), implicit Euler, contact as a penalty, on the processor. steps: of a period, or of the bounce.
"""

from __future__ import annotations

import bodies
import newton
import numpy as np
import shared
import warp as wp
from shared import Case, Outcome, Stopwatch

STEPS, ITERATIONS = 40, 20
BOUNCE_STEPS = 120
SKIN = 1e-4  # radius of a vertex in contact [m]


class Body:
    """A body of tetrahedra; pinned vertices have no mass."""

    def __init__(self, case: Case, points: np.ndarray, tets: np.ndarray, dt: float, options: dict) -> None:
        self.case, self.tets, self.dt = case, tets, dt
        edges = points[tets[:, 1:]] - points[tets[:, :1]]
        self.inverse, self.volumes = np.linalg.inv(np.swapaxes(edges, 1, 2)), np.linalg.det(edges) / 6
        self.masses = np.bincount(tets.ravel(), np.repeat(case.density * self.volumes / 4, 4), len(points))
        held = options.get("pinned", np.zeros(len(points), bool))
        builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -options.get("gravity", 0.0), 0.0))
        if options.get("floor"):
            builder.add_ground_plane()
        masses = np.where(held, 0.0, self.masses)
        builder.add_particles(
            pos=[wp.vec3(*p) for p in points],
            vel=[wp.vec3(*options.get("velocity", (0.0, 0.0, 0.0)))] * len(points),
            mass=masses.tolist(),
            radius=[SKIN] * len(points),
        )
        for tet in tets:
            builder.add_tetrahedron(*map(int, tet), k_mu=case.mu, k_lambda=case.lam, k_damp=0.0)
        builder.color()
        self.model = builder.finalize(device="cpu")
        self.model.soft_contact_ke = case.material["youngs_modulus"] * case.spacing
        self.model.soft_contact_kd = self.model.soft_contact_mu = 0.0
        iterations = case.options.get("iterations", ITERATIONS)
        self.solver = newton.solvers.SolverVBD(self.model, iterations=iterations, particle_enable_tile_solve=False)
        self.now, self.next = self.model.state(), self.model.state()
        self.control = self.model.control()
        self.pipeline = newton.CollisionPipeline(self.model) if options.get("floor") else None
        self.contacts = self.pipeline.contacts() if self.pipeline else None

    def place(self, points: np.ndarray) -> None:
        self.now.particle_q.assign(points.astype(np.float32))

    def points(self) -> np.ndarray:
        return self.now.particle_q.numpy().astype(float)

    def velocities(self) -> np.ndarray:
        return self.now.particle_qd.numpy().astype(float)

    def energy(self) -> float:
        """Kinetic and elastic [J]."""
        x, mu = self.points(), self.case.mu
        f = np.swapaxes(x[self.tets[:, 1:]] - x[self.tets[:, :1]], 1, 2) @ self.inverse
        lam = self.case.lam + mu
        rest = mu**2 / (2 * lam)
        density = mu / 2 * ((f**2).sum(axis=(1, 2)) - 3) + lam / 2 * (np.linalg.det(f) - 1 - mu / lam) ** 2 - rest
        return 0.5 * float(self.masses @ (self.velocities() ** 2).sum(axis=1)) + float(self.volumes @ density)

    def step(self, drag: float = 0.0) -> None:
        self.now.clear_forces()
        if drag:
            self.now.particle_f.assign((-drag * self.masses[:, None] * self.velocities()).astype(np.float32))
        if self.pipeline:
            self.pipeline.collide(self.now, self.contacts)
        self.solver.step(self.now, self.next, self.control, self.contacts, self.dt)
        self.now, self.next = self.next, self.now


def warm(body: Body) -> None:
    """Compiles: one step, undone."""
    kept = (body.now.particle_q.numpy(), body.now.particle_qd.numpy())
    body.step()
    body.now.particle_q.assign(kept[0])
    body.now.particle_qd.assign(kept[1])


def oscillation(case: Case) -> Outcome:
    points, _, tets = bodies.ball(case.radius, case.across)
    wanted = case.options.get("steps", STEPS)
    body = Body(case, points, tets, case.period / wanted, {})
    body.place(points + case.mode(points))
    warm(body)
    steps, every = round(case.periods * wanted), max(1, wanted // shared.SAMPLES)
    look = lambda: (shared.ellipticity(body.points(), body.masses), body.energy())  # noqa: E731
    return shared.sampled_swing(case, body.dt, steps, every, body.step, look)


def bounce(case: Case) -> Outcome:
    points, _, tets = bodies.ball(case.radius, case.across)
    points[:, 1] += case.gap - points[:, 1].min()
    steps = case.options.get("steps", BOUNCE_STEPS)
    body = Body(case, points, tets, case.duration / steps, {"floor": True, "velocity": (0.0, -case.speed, 0.0)})
    warm(body)
    used = Stopwatch()
    with used:
        for _ in range(steps):
            body.step()
    speed = float(body.masses @ body.velocities()[:, 1]) / body.masses.sum()
    found = {"restitution": speed / case.speed, "clear": bool(body.points()[:, 1].min() > SKIN)}
    return found | {"steps": steps} | used.found()


def cantilever(case: Case) -> Outcome:
    points, _, tets = bodies.beam(case.length, case.height, case.across)
    wanted = case.options.get("steps", STEPS)
    options = {"gravity": case.gravity, "pinned": points[:, 0] < 1e-9}
    body = Body(case, points, tets, case.period / wanted, options)
    warm(body)
    steps = round(1.5 * wanted)
    used = Stopwatch()
    with used:
        for _ in range(steps):
            body.step(case.damping)
    sag = shared.end_face(points, points[:, 1] - body.points()[:, 1], case)
    return {"sag": sag, "steps": steps} | used.found()


SOLVE = {"oscillation": oscillation, "bounce": bounce, "cantilever": cantilever}


def solve(case: Case) -> Outcome:
    wp.config.quiet = True
    wp.init()
    return SOLVE[case.name](case)


if __name__ == "__main__":
    shared.run_script(solve)
