"""Implicit MPM by Newton: `newton_mpm.py CASE ACROSS [--options '{"steps": 160}']`.

Eight points per cell on a lattice, quadratic B-splines ("B2") with a strain basis that follows a cell's bending
("P1d"), APIC, yield out of reach, on the processor. Its law is linear between stress and elastic strain. steps: of a
period, or of the bounce.
"""

from __future__ import annotations

import bodies
import common
import newton
import numpy as np
import warp as wp
from common import Case, Clock, Outcome
from newton.solvers import SolverImplicitMPM

STEPS, BOUNCE_STEPS = 40, 120
CLAMPED = 3  # cells of beam within the clamp
NEVER = 1e15  # Pa: yield


class Points:
    """Material points; held ones do not move."""

    def __init__(self, case: Case, points: np.ndarray, volume: float, dt: float, options: dict) -> None:
        self.case, self.dt, self.count = case, dt, len(points)
        self.mass = volume * case.density / self.count
        held = options.get("held", np.zeros(len(points), bool))
        builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -options.get("gravity", 0.0), 0.0))
        SolverImplicitMPM.register_custom_attributes(builder)
        if options.get("floor"):
            builder.add_ground_plane(cfg=newton.ModelBuilder.ShapeConfig(mu=0.0))
        builder.add_particles(
            pos=[wp.vec3(*p) for p in points],
            vel=[wp.vec3(*options.get("velocity", (0.0, 0.0, 0.0)))] * len(points),
            mass=np.where(held, 0.0, self.mass).tolist(),
            radius=[case.spacing / 4] * len(points),
        )
        self.model = builder.finalize(device="cpu")
        material = self.model.mpm
        material.young_modulus.fill_(case.material["youngs_modulus"])
        material.poisson_ratio.fill_(case.material["poissons_ratio"])
        material.yield_stress.fill_(NEVER)
        material.yield_pressure.fill_(NEVER)
        material.tensile_yield_ratio.fill_(1.0)
        material.friction.fill_(0.0)
        config = SolverImplicitMPM.Config()
        config.voxel_size, config.tolerance = case.spacing, 1e-6
        config.velocity_basis = case.options.get("velocity_basis", "B2")
        config.strain_basis = case.options.get("strain_basis", "P1d")
        self.solver = SolverImplicitMPM(self.model, config=config)
        self.now, self.next = self.model.state(), self.model.state()

    def points(self) -> np.ndarray:
        return self.now.particle_q.numpy().astype(float)

    def velocities(self) -> np.ndarray:
        return self.now.particle_qd.numpy().astype(float)

    def energy(self) -> float:
        """Kinetic, with that of the affine part as far as eight points a cell leave it, and elastic [J]."""
        f = self.now.mpm.particle_elastic_strain.numpy().astype(float)
        kinetic = 0.5 * self.mass * float((self.velocities() ** 2).sum())
        return kinetic + self.mass / self.case.density * float(common.elastic_density(self.case, f).sum())

    def step(self, drag: float = 0.0) -> None:
        if drag:
            self.now.particle_qd.assign((self.velocities() * (1 - drag * self.dt)).astype(np.float32))
        self.solver.step(self.now, self.next, None, None, self.dt)
        self.now, self.next = self.next, self.now


def warm(case: Case, make) -> tuple[Points, float]:
    """A body, and processor seconds of compiling: one step of another one."""
    clock = Clock()
    make().step()
    return make(), clock.seconds()["core"]


def oscillation(case: Case) -> Outcome:
    points = bodies.ball_points(case.radius, case.spacing)
    wanted = case.options.get("steps", STEPS)
    volume = 4 / 3 * np.pi * case.radius**3

    def make() -> Points:
        body = Points(case, points, volume, case.period / wanted, {})
        body.now.particle_q.assign((points + case.mode(points)).astype(np.float32))
        body.now.mpm.particle_elastic_strain.assign(case.mode_strain(points).astype(np.float32))
        return body

    body, setup = warm(case, make)
    masses = np.ones(body.count)
    times, ellipticity, energies = [0.0], [common.ellipticity(body.points(), masses)], [body.energy()]
    steps, used, every = round(case.periods * wanted), {"wall": 0.0, "core": 0.0}, max(1, wanted // common.SAMPLES)
    for step in range(1, steps + 1):
        clock = Clock()
        body.step()
        for name, value in clock.seconds().items():
            used[name] += value
        if step % every == 0:
            times.append(step * body.dt)
            ellipticity.append(common.ellipticity(body.points(), masses))
            energies.append(body.energy())
    kept = common.energy_kept(times, energies, case.period)
    found = {"times": times, "ellipticity": ellipticity, "energy_kept": kept}
    return found | {"steps": steps, "setup": setup, "seconds": used}


def bounce(case: Case) -> Outcome:
    points = bodies.ball_points(case.radius, case.spacing)
    points[:, 1] += case.radius + case.gap
    steps, volume = case.options.get("steps", BOUNCE_STEPS), 4 / 3 * np.pi * case.radius**3
    options = {"floor": True, "velocity": (0.0, -case.speed, 0.0)}
    body, setup = warm(case, lambda: Points(case, points, volume, case.duration / steps, options))
    clock = Clock()
    for _ in range(steps):
        body.step()
    seconds = clock.seconds()
    clear = bool(body.points()[:, 1].min() > case.spacing)
    speed = float(body.velocities()[:, 1].mean())
    return {"restitution": speed / case.speed, "clear": clear, "steps": steps, "setup": setup, "seconds": seconds}


def cantilever(case: Case) -> Outcome:
    half, wanted = case.height / 2, case.options.get("steps", STEPS)
    low, high = np.array([-CLAMPED * case.spacing, -half, -half]), np.array([case.length, half, half])
    points = bodies.lattice(low, high, case.spacing)
    options = {"gravity": case.gravity, "held": points[:, 0] < 0}
    body, setup = warm(
        case, lambda: Points(case, points, float(np.prod(high - low)), case.period / wanted, options)
    )
    clock, steps = Clock(), round(1.5 * wanted)
    for _ in range(steps):
        body.step(case.damping)
    seconds = clock.seconds()
    sag = common.extrapolated_end(points[:, 0], points[:, 1] - body.points()[:, 1], case.length, case.height)
    return {"sag": sag, "steps": steps, "setup": setup, "seconds": seconds}


SOLVE = {"oscillation": oscillation, "bounce": bounce, "cantilever": cantilever}


def solve(case: Case) -> Outcome:
    wp.config.quiet = True
    wp.init()
    return SOLVE[case.name](case)


if __name__ == "__main__":
    common.run_script(solve)
