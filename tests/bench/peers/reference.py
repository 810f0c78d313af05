"""The references of cases.toml that have no closed form, computed again: `reference.py lamb|restitution|sag`.

Runs in the environment of scikit-fem. Prints the values of three resolutions and Richardson's limit of the last two
differences.
"""

from __future__ import annotations

import sys

import fem_skfem
import lamb
import numpy as np
import shared
from shared import Case

SAFETY = 0.5  # of the time that a wave of pressure takes through the thinnest element


# --- restitution -----------------------------------------------------------------------------------------------------


def half_disc(across: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (r, z) and quadrilaterals of half a section of a ball of radius 1, as bodies.ball_blocks in a plane."""
    inner, layers = across // 2, across // 4
    line = np.linspace(-1, 1, inner + 1)
    half = line[line > -1e-12]
    points, cells, count = [], [], 0

    def core(point: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(point, axis=-1, keepdims=True)
        round_ = np.abs(point).max(axis=-1, keepdims=True) / np.where(length == 0, 1, length)
        return 0.55 * point * (0.6 + 0.4 * round_ * np.sqrt(1.3))

    def add(block: np.ndarray) -> None:
        nonlocal count
        index = np.arange(block.shape[0] * block.shape[1]).reshape(block.shape[:2]) + count
        cells.append(np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], -1).reshape(-1, 4))
        points.append(block.reshape(-1, 2))
        count += len(points[-1])

    add(core(np.stack(np.meshgrid(half, line, indexing="ij"), -1)))
    part = np.linspace(0, 1, layers + 1)[:, None, None]
    for face in (
        np.stack([np.ones_like(line), line], -1),
        np.stack([half, np.ones_like(half)], -1),
        np.stack([half, -np.ones_like(half)], -1),
    ):
        out = np.where(np.abs(face) < 1, np.tan(np.pi / 4 * face), face)
        add((1 - part) * core(face) + part * out / np.linalg.norm(out, axis=-1, keepdims=True))
    everything = np.concatenate(points)
    _, first, index = np.unique(np.round(everything, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    cells, points = index.ravel()[np.concatenate(cells)], everything[first]
    a, b, c = (points[cells[:, k]] for k in (0, 1, 3))
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    cells[turned] = cells[turned][:, ::-1]
    return points, cells


class Ring:
    """An axisymmetric body of quadrilaterals with 2 x 2 points; forces per 2 pi."""

    def __init__(self, case: Case, across: int) -> None:
        self.case = case
        points, self.cells = half_disc(across)
        self.points = points * case.radius
        corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        at = np.array([(x, y) for x in (-1, 1) for y in (-1, 1)]) / np.sqrt(3)
        shape = 0.25 * (1 + at[:, None, 0] * corner[:, 0]) * (1 + at[:, None, 1] * corner[:, 1])  # (points, corners)
        local = 0.25 * np.stack(
            [
                corner[:, 0] * (1 + at[:, None, 1] * corner[:, 1]),
                corner[:, 1] * (1 + at[:, None, 0] * corner[:, 0]),
            ],
            -1,
        )
        nodes = self.points[self.cells]
        jacobian = np.einsum("qak,nai->nqik", local, nodes)
        self.slopes = np.einsum("qak,nqki->nqai", local, np.linalg.inv(jacobian))
        self.shape = shape
        self.radii = np.einsum("qa,na->nq", shape, nodes[..., 0])
        self.weights = np.linalg.det(jacobian) * self.radii
        self.masses = self.gathered(case.density * np.einsum("nq,qa->na", self.weights, shape)[..., None])[:, 0]
        self.thinnest = float(np.sqrt(np.linalg.det(jacobian).min()) * 2)

    def gathered(self, parts: np.ndarray) -> np.ndarray:
        return np.stack(
            [np.bincount(self.cells.ravel(), parts[..., k].ravel(), len(self.points)) for k in range(parts.shape[-1])],
            -1,
        )

    def force(self, x: np.ndarray) -> np.ndarray:
        nodes, mu, lam = x[self.cells], self.case.mu, self.case.lam
        f = np.swapaxes(nodes, 1, 2)[:, None] @ self.slopes  # (cells, points, 2, 2)
        hoop = (nodes[..., 0] @ self.shape.T) / self.radii
        strain = 0.5 * (np.swapaxes(f, 2, 3) @ f - np.eye(2))
        around = 0.5 * (hoop**2 - 1)
        trace = lam * (strain[..., 0, 0] + strain[..., 1, 1] + around)
        stress = 2 * mu * strain
        stress[..., 0, 0] += trace
        stress[..., 1, 1] += trace
        parts = self.slopes @ np.swapaxes((f @ stress) * self.weights[..., None, None], 2, 3)
        pull = hoop * (2 * mu * around + trace) / self.radii * self.weights
        total = parts.sum(axis=1)
        total[..., 0] += pull @ self.shape
        return -self.gathered(total)


def restitution(case: Case, across: int) -> float:
    """Of the bounce, a node that would pass the floor stops on it."""
    ring = Ring(case, across)
    dt = SAFETY * ring.thinnest / case.pressure_speed
    x, v = ring.points.copy(), np.zeros_like(ring.points)
    x[:, 1] += case.gap - x[:, 1].min()
    v[:, 1] = -case.speed
    axis = ring.points[:, 0] < 1e-9
    for _ in range(int(np.ceil(case.duration / dt))):
        v += dt * ring.force(x) / ring.masses[:, None]
        v[axis, 0] = 0
        v[:, 1] = np.maximum(v[:, 1], -x[:, 1] / dt)
        x += dt * v
    return float(ring.masses @ v[:, 1] / ring.masses.sum() / case.speed)


# --- command ---------------------------------------------------------------------------------------------------------


def richardson(across: list[int], values: list[float]) -> tuple[float, float]:
    """Limit and order from three resolutions: value = limit + c across^-order."""
    first, second = values[1] - values[0], values[2] - values[1]
    low, high = 0.1, 6.0
    ratio = lambda p: (across[0] ** -p - across[1] ** -p) / (across[1] ** -p - across[2] ** -p)  # noqa: E731
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if ratio(middle) < first / second else (low, middle)
    gain = second / (across[1] ** -low - across[2] ** -low)
    return values[2] + gain * across[2] ** -low, low


def main() -> None:
    what = sys.argv[1] if len(sys.argv) == 2 else ""
    if what == "lamb":
        case = shared.case_of("oscillation", 8)
        print(f"{lamb.root(case.material['poissons_ratio']):.6f}")
        return
    if what == "restitution":
        across = [32, 64, 96]
        values = [restitution(shared.case_of("bounce", 8), n) for n in across]
    elif what == "sag":
        across = [2, 3, 4]
        values = [fem_skfem.cantilever(shared.case_of("cantilever", n, {"order": 2}))["sag"] for n in across]
    else:
        sys.exit(f"reference.py {' '.join(sys.argv[1:])}: must be lamb, restitution or sag")
    limit, order = richardson(across, values)
    print(f"{across}: {values}; limit {limit:.6g}, order {order:.2f}")


if __name__ == "__main__":
    main()
