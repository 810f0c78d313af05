"""MuJoCo's flex: `flex_mujoco.py CASE ACROSS`: linear tetrahedra of St. Venant-Kirchhoff, contact by MuJoCo's solver.

Masses are lumped by us: flexcomp gives every vertex the same. Semi-implicit Euler at 0.5 of the largest stable step.
"""

from __future__ import annotations

import bodies
import mujoco
import numpy as np
import shared
from shared import Case, Outcome, Stopwatch

SAFETY = 0.5  # of 2 over the highest frequency that a tetrahedron can have
SOFTEST = 2.0  # steps in the time constant of a contact: the least that MuJoCo takes


def numbers(values: np.ndarray) -> str:
    return " ".join(f"{v:.9g}" for v in np.asarray(values).ravel())


class Flex:
    """A body of tetrahedra as a flex, vertex by vertex."""

    def __init__(self, case: Case, points: np.ndarray, tets: np.ndarray, floor: bool, pinned: np.ndarray) -> None:
        self.case, self.rest, self.tets = case, points, tets
        edges = points[tets[:, 1:]] - points[tets[:, :1]]
        self.inverse, self.volumes = np.linalg.inv(np.swapaxes(edges, 1, 2)), np.linalg.det(edges) / 6
        self.masses = np.bincount(tets.ravel(), np.repeat(case.density * self.volumes / 4, 4), len(points))
        self.dt = SAFETY * stable_step(case, self)
        self.model = mujoco.MjModel.from_xml_string(self.xml(floor, pinned))
        self.move_masses(pinned)
        self.data = mujoco.MjData(self.model)

    def xml(self, floor: bool, pinned: np.ndarray) -> str:
        material, contact = self.case.material, f'solref="{SOFTEST * self.dt:.9g} 1"'
        plane = f'<geom type="plane" size="1 1 1" zaxis="0 1 0" condim="1" {contact}/>' if floor else ""
        pins = f'<pin id="{" ".join(map(str, pinned))}"/>' if len(pinned) else ""
        affinity = 1 if floor else 0
        return f"""<mujoco>
          <option timestep="{self.dt:.9g}" gravity="0 0 0" integrator="Euler"/>
          <size memory="2G"/>
          <worldbody>{plane}
            <flexcomp name="body" type="direct" dim="3" mass="{self.masses.sum():.9g}" radius="1e-6" rgba="1 1 1 1"
                point="{numbers(self.rest)}" element="{" ".join(map(str, self.tets.ravel()))}">
              <elasticity young="{material["youngs_modulus"]}" poisson="{material["poissons_ratio"]}"/>
              <contact selfcollide="none" conaffinity="{affinity}" contype="{affinity}" condim="1"
                {contact}/>{pins}
            </flexcomp>
          </worldbody></mujoco>"""

    def move_masses(self, pinned: np.ndarray) -> None:
        """Gives every vertex the mass of the tetrahedra around it."""
        owner = self.model.flex_vertbodyid
        free = np.setdiff1d(np.arange(len(self.rest)), pinned)
        self.free, self.owner = free, owner[free]
        factor = self.masses[free] / self.model.body_mass[self.owner]
        self.model.body_mass[self.owner] *= factor
        self.model.body_inertia[self.owner] *= factor[:, None]
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))
        self.dofs = self.model.body_dofadr[self.owner][:, None] + np.arange(3)

    def place(self, points: np.ndarray) -> None:
        self.data.qpos[self.dofs] = (points - self.rest)[self.free]

    def throw(self, velocity: tuple[float, float, float]) -> None:
        self.data.qvel[self.dofs] = velocity

    def points(self) -> np.ndarray:
        x = self.rest.copy()
        x[self.free] += self.data.qpos[self.dofs]
        return x

    def momentum(self) -> np.ndarray:
        return self.masses[self.free] @ self.data.qvel[self.dofs]

    def energy(self) -> float:
        """Kinetic and elastic, of the tetrahedra [J]."""
        x = self.points()
        f = np.swapaxes(x[self.tets[:, 1:]] - x[self.tets[:, :1]], 1, 2) @ self.inverse
        kinetic = 0.5 * float(self.masses[self.free] @ (self.data.qvel[self.dofs] ** 2).sum(axis=1))
        return kinetic + float(self.volumes @ shared.elastic_density(self.case, f))

    def step(self) -> None:
        mujoco.mj_step(self.model, self.data)


def stable_step(case: Case, flex: Flex) -> float:
    """Time that a wave of pressure takes through the thinnest tetrahedron [s]."""
    slopes = np.concatenate([flex.inverse, -flex.inverse.sum(axis=1, keepdims=True)], axis=1)
    return float(1 / np.linalg.norm(slopes, axis=2).max()) / case.pressure_speed


def oscillation(case: Case) -> Outcome:
    points, _, tets = bodies.ball(case.radius, case.across)
    flex = Flex(case, points, tets, False, np.zeros(0, int))
    flex.place(points + case.mode(points))
    steps = int(np.ceil(case.end / flex.dt))
    flex.dt = flex.model.opt.timestep = case.end / steps
    every = max(1, int(case.period / flex.dt / shared.SAMPLES))
    look = lambda: (shared.ellipticity(flex.points(), flex.masses), flex.energy())  # noqa: E731
    return shared.sampled_swing(case, flex.dt, steps, every, flex.step, look)


def bounce(case: Case) -> Outcome:
    points, _, tets = bodies.ball(case.radius, case.across)
    points[:, 1] += case.gap - points[:, 1].min()
    flex = Flex(case, points, tets, True, np.zeros(0, int))
    flex.throw((0.0, -case.speed, 0.0))
    steps = int(np.ceil(case.duration / flex.dt))
    used = Stopwatch()
    with used:
        for _ in range(steps):
            flex.step()
    speed = flex.momentum()[1] / flex.masses.sum()
    found = {"restitution": speed / case.speed, "clear": bool(flex.points()[:, 1].min() > 0)}
    return found | {"steps": steps} | used.found()


def cantilever(case: Case) -> Outcome:
    points, _, tets = bodies.beam(case.length, case.height, case.across)
    flex = Flex(case, points, tets, False, np.flatnonzero(points[:, 0] < 1e-9))
    flex.model.opt.gravity[:] = (0.0, -case.gravity, 0.0)
    flex.model.dof_damping[flex.dofs] = (case.damping * flex.masses[flex.free])[:, None]
    steps = int(np.ceil(case.end / flex.dt))
    used = Stopwatch()
    with used:
        for _ in range(steps):
            flex.step()
    sags = points[:, 1] - flex.points()[:, 1]
    sag = shared.end_face(points, sags, case)
    return {"sag": sag, "steps": steps} | used.found()


SOLVE = {"oscillation": oscillation, "bounce": bounce, "cantilever": cantilever}

if __name__ == "__main__":
    shared.run_script(lambda case: SOLVE[case.name](case))
