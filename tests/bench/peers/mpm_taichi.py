"""Explicit MLS-MPM by Taichi: `mpm_taichi.py CASE ACROSS [--options '{"single": true}']`.

Moving least squares material points (Hu et al. 2018, eq. 16 to 18) with APIC (Jiang et al. 2015), quadratic B-splines
and eight points per cell on a lattice, a dense grid, symplectic Euler. Double precision unless `single`.
"""

from __future__ import annotations

import bodies
import numpy as np
import shared
import taichi as ti
from shared import Case, Outcome, Stopwatch

CFL = 0.3  # cells that a wave of pressure runs in a step
MARGIN = 4  # cells around the body
CLAMPED = 3  # cells of beam within the clamp


@ti.data_oriented
class Points:
    """Material points on a grid whose node (0, 0, 0) lies at `low`."""

    def __init__(self, case: Case, points: np.ndarray, volume: float, low: np.ndarray, shape: tuple[int, ...]) -> None:
        real = ti.f32 if case.options.get("single") else ti.f64
        self.count, self.h, self.low = len(points), case.spacing, ti.Vector(list(low))
        self.dt = CFL * self.h / case.pressure_speed
        self.mu, self.lam = case.mu, case.lam
        self.volume = volume / self.count
        self.mass = self.volume * case.density
        self.x, self.v = (ti.Vector.field(3, real, self.count) for _ in range(2))
        self.affine, self.f = (ti.Matrix.field(3, 3, real, self.count) for _ in range(2))
        self.momentum, self.weight = ti.Vector.field(3, real, shape), ti.field(real, shape)
        self.floor, self.clamp = -1, -1  # nodes below them stand on the floor, within the clamp
        self.pull, self.drag = 0.0, 0.0  # gravity along -y [m/s^2], rate [1/s]
        self.x.from_numpy(points)
        self.f.from_numpy(np.broadcast_to(np.eye(3), (self.count, 3, 3)).copy())

    @ti.func
    def spline(self, position):
        """The lowest node of the 27 around a point, and the weights along each axis."""
        base = ti.cast(ti.floor(position - 0.5), ti.i32)
        d = position - ti.cast(base, self.x.dtype)
        return base, [0.5 * (1.5 - d) ** 2, 0.75 - (d - 1.0) ** 2, 0.5 * (d - 0.5) ** 2], d

    @ti.kernel
    def to_grid(self):
        for p in self.x:
            base, w, d = self.spline((self.x[p] - self.low) / self.h)
            f = self.f[p]
            strain = 0.5 * (f.transpose() @ f - ti.Matrix.identity(self.x.dtype, 3))
            second = 2.0 * self.mu * strain + self.lam * strain.trace() * ti.Matrix.identity(self.x.dtype, 3)
            pushed = -self.dt * self.volume * 4.0 / self.h**2 * (f @ second @ f.transpose())
            carried = pushed + self.mass * self.affine[p]
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                offset = ti.Vector([i, j, k])
                share = w[i][0] * w[j][1] * w[k][2]
                arm = (offset - d) * self.h
                self.momentum[base + offset] += share * (self.mass * self.v[p] + carried @ arm)
                self.weight[base + offset] += share * self.mass

    @ti.kernel
    def on_grid(self):
        for node in ti.grouped(self.weight):
            if self.weight[node] > 0:
                v = self.momentum[node] / self.weight[node]
                v[1] -= self.dt * self.pull
                v *= 1.0 - self.dt * self.drag
                if node[1] <= self.floor and v[1] < 0:
                    v[1] = 0.0
                if node[0] <= self.clamp:
                    v *= 0.0
                self.momentum[node] = v

    @ti.kernel
    def to_points(self):
        for p in self.x:
            base, w, d = self.spline((self.x[p] - self.low) / self.h)
            v, affine = self.v[p] * 0.0, self.affine[p] * 0.0
            for i, j, k in ti.static(ti.ndrange(3, 3, 3)):
                offset = ti.Vector([i, j, k])
                share = w[i][0] * w[j][1] * w[k][2]
                node = self.momentum[base + offset]
                v += share * node
                affine += 4.0 / self.h * share * node.outer_product(offset - d)
            self.v[p], self.affine[p] = v, affine
            self.x[p] += self.dt * v
            self.f[p] += self.dt * affine @ self.f[p]

    def step(self) -> None:
        self.momentum.fill(0)
        self.weight.fill(0)
        self.to_grid()
        self.on_grid()
        self.to_points()

    def energy(self, case: Case) -> float:
        """Of the points; kinetic with that of the affine part, whose points fill h^2 / 4 of inertia."""
        v, affine = self.v.to_numpy(), self.affine.to_numpy()
        kinetic = 0.5 * self.mass * (float((v**2).sum()) + self.h**2 / 4 * float((affine**2).sum()))
        return kinetic + self.volume * float(shared.elastic_density(case, self.f.to_numpy()).sum())


def floating(case: Case, height: float) -> tuple[Points, np.ndarray]:
    """A ball whose lowest point is at the height; the floor is at y = 0."""
    points = bodies.ball_points(case.radius, case.spacing)
    points[:, 1] += case.radius + height
    volume = 4 / 3 * np.pi * case.radius**3
    low = np.array([-case.radius, 0.0, -case.radius]) - MARGIN * case.spacing
    cells = case.across + 2 * MARGIN + 1
    high = cells + round(3 * max(height, 0) / case.spacing)
    return Points(case, points, volume, low, (cells, high, cells)), points


def warm(body: Points) -> None:
    """Compiles: one step, undone."""
    kept = {name: getattr(body, name).to_numpy() for name in ("x", "v", "affine", "f")}
    body.step()
    for name, values in kept.items():
        getattr(body, name).from_numpy(values)


def take(body: Points, steps: int) -> Stopwatch:
    """Warms up, then takes the steps."""
    warm(body)
    used = Stopwatch()
    with used:
        for _ in range(steps):
            body.step()
        ti.sync()
    return used


def oscillation(case: Case) -> Outcome:
    body, points = floating(case, 0.0)
    center = np.array([0.0, case.radius, 0.0])
    body.x.from_numpy(points + case.mode(points - center))
    body.f.from_numpy(case.mode_strain(points - center))
    steps = int(np.ceil(case.end / body.dt))
    body.dt = case.end / steps
    warm(body)
    masses = np.ones(body.count)
    every = max(1, int(case.period / body.dt / shared.SAMPLES))
    look = lambda: (shared.ellipticity(body.x.to_numpy(), masses), body.energy(case))  # noqa: E731
    return shared.sampled_swing(case, body.dt, steps, every, body.step, look)


def bounce(case: Case) -> Outcome:
    body, _ = floating(case, case.gap)
    body.floor = MARGIN
    body.v.from_numpy(np.broadcast_to([0.0, -case.speed, 0.0], (body.count, 3)).copy())
    steps = int(np.ceil(case.duration / body.dt))
    used = take(body, steps)
    speed = float(body.v.to_numpy()[:, 1].mean())
    clear = float(body.x.to_numpy()[:, 1].min()) > 1.5 * body.h
    return {"restitution": speed / case.speed, "clear": clear, "steps": steps} | used.found()


def cantilever(case: Case) -> Outcome:
    h, half = case.spacing, case.height / 2
    low, high = np.array([-CLAMPED * h, -half, -half]), np.array([case.length, half, half])
    points = bodies.lattice(low, high, h)
    volume = float(np.prod(high - low))
    corner = low - MARGIN * h - np.array([0.0, 2 * MARGIN * h, 0.0])
    shape = [round(n / h) + 2 * MARGIN + 1 for n in high - low]
    shape[1] += 2 * MARGIN
    body = Points(case, points, volume, corner, tuple(shape))
    body.clamp, body.pull, body.drag = MARGIN + CLAMPED, case.gravity, case.damping
    steps = int(np.ceil(case.end / body.dt))
    used = take(body, steps)
    sags = points[:, 1] - body.x.to_numpy()[:, 1]
    sag = shared.extrapolated_end(points[:, 0], sags, case.length, case.height)
    return {"sag": sag, "steps": steps} | used.found()


SOLVE = {"oscillation": oscillation, "bounce": bounce, "cantilever": cantilever}


def solve(case: Case) -> Outcome:
    real = ti.f32 if case.options.get("single") else ti.f64
    ti.init(arch=ti.cpu, cpu_max_num_threads=1, default_fp=real, log_level=ti.WARN, offline_cache=False)
    return SOLVE[case.name](case)


if __name__ == "__main__":
    shared.run_script(solve)
