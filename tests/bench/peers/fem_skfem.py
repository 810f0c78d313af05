"""Finite elements without fluid, by scikit-fem: `fem_skfem.py CASE ACROSS [--options '{"order": 2}']`.

Hexahedra of order 1 or 2 (beam only). The ball moves by central differences with lumped masses at 0.8 of the largest
stable step; a node that would pass the floor stops on it. The beam's rest is found by Newton's method. Meshes,
quadrature and the stiffness are scikit-fem's; law, steps and contact are ours.
"""

from __future__ import annotations

import bodies
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import shared
from shared import Case, Outcome, Stopwatch
from skfem import Basis, BilinearForm, ElementHex1, ElementHex2, ElementVector, LinearForm, MeshHex, MeshHex2, asm
from skfem.helpers import ddot, grad, transpose

SAFETY = 0.8  # of the largest stable step
CORNERS = (7, 6, 5, 3, 4, 2, 1, 0)  # of bodies.Cells in scikit-fem's order of a hexahedron's nodes


def mesh_of(points: np.ndarray, cells: bodies.Cells, order: int = 1) -> MeshHex:
    """Cells as scikit-fem takes them: corner (1, 1, 1) first."""
    mesh = MeshHex(np.ascontiguousarray(points.T), np.ascontiguousarray(cells[:, CORNERS].T))
    return MeshHex2.from_mesh(mesh) if order == 2 else mesh


class Body:
    """An elastic body of hexahedra of order 1: gradients at the quadrature points as a sparse matrix, lumped masses."""

    def __init__(self, case: Case, points: np.ndarray, cells: bodies.Cells) -> None:
        basis = Basis(mesh_of(points, cells), ElementHex1(), intorder=2)
        slopes = np.stack([field[0].grad for field in basis.basis])  # (8, 3, cells, quadrature points)
        dofs = basis.element_dofs  # (8, cells)
        rows = np.arange(slopes[0].size).reshape(3, *basis.dx.shape)
        rows = np.broadcast_to(np.moveaxis(rows, 0, 0), slopes.shape)
        columns = np.broadcast_to(dofs[:, None, :, None], slopes.shape)
        shape = (slopes[0].size, basis.N)
        self.gradient = sp.csr_matrix((slopes.ravel(), (rows.ravel(), columns.ravel())), shape)
        self.transposed = self.gradient.T.tocsr()
        self.weights = basis.dx.ravel()
        self.case, self.points = case, basis.doflocs.T.copy()
        mass = asm(LinearForm(lambda v, _: case.density * v), basis)
        self.masses = mass * (case.density * bodies_volume(case, points) / mass.sum())

    def strained(self, x: np.ndarray) -> np.ndarray:
        """F at the quadrature points, (points, 3, 3); x: (nodes, 3)."""
        return np.moveaxis((self.gradient @ x).reshape(3, -1, 3), 0, 2)

    def force(self, x: np.ndarray) -> np.ndarray:
        """Elastic forces at the nodes [N]."""
        f, mu, lam = self.strained(x), self.case.mu, self.case.lam
        strain = 0.5 * (np.swapaxes(f, 1, 2) @ f - np.eye(3))
        stress = 2 * mu * strain
        trace = lam * (strain[:, 0, 0] + strain[:, 1, 1] + strain[:, 2, 2])
        for axis in range(3):
            stress[:, axis, axis] += trace
        first = (f @ stress) * self.weights[:, None, None]
        return -(self.transposed @ np.moveaxis(first, 2, 0).reshape(-1, 3))

    def energy(self, x: np.ndarray) -> float:
        return float(self.weights @ shared.elastic_density(self.case, self.strained(x)))

    def stable_step(self) -> float:
        """Largest step of central differences, by power iteration on the stiffness at rest."""
        draw, eps = np.random.default_rng(1), 1e-6 * self.case.spacing
        v = draw.standard_normal(self.points.shape)
        square = 1.0
        for _ in range(40):
            v /= np.linalg.norm(v)
            v = -self.force(self.points + eps * v) / eps / self.masses[:, None]
            square = np.linalg.norm(v)
        return float(2 / np.sqrt(square))


def bodies_volume(case: Case, points: np.ndarray) -> float:
    """Exact volume of the body [m^3]."""
    if case.name == "cantilever":
        return case.length * case.height**2
    return 4 / 3 * np.pi * case.radius**3


def oscillation(case: Case) -> Outcome:
    body = Body(case, *bodies.ball(case.radius, case.across)[:2])
    dt = SAFETY * body.stable_step()
    steps = int(np.ceil(case.end / dt))
    dt = case.end / steps
    x, inverse = body.points + case.mode(body.points), 1 / body.masses[:, None]
    v = 0.5 * dt * body.force(x) * inverse  # at half steps
    times, ellipticity, energies = [0.0], [shared.ellipticity(x, body.masses)], [body.energy(x)]
    every = max(1, int(case.period / dt / shared.SAMPLES))
    used = Stopwatch()
    for step in range(1, steps + 1):
        with used:
            x = x + dt * v
            kick = dt * body.force(x) * inverse
        if step % every == 0:
            times.append(step * dt)
            ellipticity.append(shared.ellipticity(x, body.masses))
            energies.append(body.energy(x) + 0.25 * float(body.masses @ (v**2 + (v + kick) ** 2).sum(axis=1)))
        with used:
            v = v + kick
    kept = shared.energy_kept(times, energies, case.period)
    found = {"times": times, "ellipticity": ellipticity, "energy_kept": kept}
    return found | {"steps": steps} | used.found()


def bounce(case: Case) -> Outcome:
    body = Body(case, *bodies.ball(case.radius, case.across)[:2])
    dt = SAFETY * body.stable_step()
    x, inverse = body.points.copy(), 1 / body.masses[:, None]
    x[:, 1] += case.gap - x[:, 1].min()
    v = np.zeros_like(x)
    v[:, 1] = -case.speed
    steps = int(np.ceil(case.duration / dt))
    used = Stopwatch()
    for _ in range(steps):
        with used:
            v += dt * body.force(x) * inverse
            v[:, 1] = np.maximum(v[:, 1], -x[:, 1] / dt)
            x += dt * v
    speed = float(body.masses @ v[:, 1]) / body.masses.sum()
    found = {"restitution": speed / case.speed, "clear": bool(x[:, 1].min() > 0)}
    return found | {"steps": steps} | used.found()


def cantilever(case: Case) -> Outcome:
    order, used = case.options.get("order", 1), Stopwatch()
    points, cells, _ = bodies.beam(case.length, case.height, case.across)
    mesh = mesh_of(points, cells, order)
    basis = Basis(mesh, ElementVector(ElementHex2() if order == 2 else ElementHex1()), intorder=2 * order)
    held = basis.get_dofs(lambda x: np.isclose(x[0], 0)).all()
    free = np.setdiff1d(np.arange(basis.N), held)

    @BilinearForm
    def stiffness(u, v, w):
        f, strain = deformation(w["u"])
        du, dv = grad(u), grad(v)
        left, right = symmetric(f, du), symmetric(f, dv)
        stress = second_piola(case, strain)
        return ddot(second_piola(case, left), right) + ddot(stress, product(transpose(du), dv))

    @LinearForm
    def residual(v, w):
        f, strain = deformation(w["u"])
        return ddot(second_piola(case, strain), symmetric(f, grad(v))) + case.density * case.gravity * v[1]

    u, steps = np.zeros(basis.N), 0
    for _ in range(20):
        with used:
            state = basis.interpolate(u)
            right = -asm(residual, basis, u=state)[free]
            matrix = asm(stiffness, basis, u=state).tocsc()[free][:, free]
            change = spl.spsolve(matrix, right, permc_spec="MMD_AT_PLUS_A")
            u[free] += change
        steps += 1
        if np.abs(change).max() < 1e-9 * case.length:
            break
    end = basis.mesh.facets_satisfying(lambda x: np.isclose(x[0], case.length))
    face = basis.boundary(end)
    sag = -asm(LinearForm(lambda v, w: w["u"][1] * v), face.with_element(ElementHex1()), u=face.interpolate(u)).sum()
    return {"sag": sag / case.height**2, "steps": steps} | used.found()


def deformation(u) -> tuple[np.ndarray, np.ndarray]:
    """F and Green's strain, (3, 3, ...)."""
    f = grad(u) + np.eye(3)[:, :, None, None]
    return f, 0.5 * (product(transpose(f), f) - np.eye(3)[:, :, None, None])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ij...,jk...->ik...", a, b)


def symmetric(f: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Change of Green's strain with a change of F."""
    part = product(transpose(f), slope)
    return 0.5 * (part + transpose(part))


def second_piola(case: Case, strain: np.ndarray) -> np.ndarray:
    return 2 * case.mu * strain + case.lam * np.einsum("ii...", strain) * np.eye(3)[:, :, None, None]


SOLVE = {"oscillation": oscillation, "bounce": bounce, "cantilever": cantilever}

if __name__ == "__main__":
    shared.run_script(lambda case: SOLVE[case.name](case))
