"""Drops an elastic ball into smoke: python examples/python/drop_ball.py [FILE.vdb]"""

import sys

import numpy as np
from eulerfsi import Mesh, Simulation


def icosphere(center: tuple[float, float, float], radius: float, levels: int) -> Mesh:
    """A ball of 20 * 4^levels triangles."""
    golden = (1 + 5**0.5) / 2
    corners = np.array([[x, y, 0] for x in (-1, 1) for y in (-golden, golden)])
    corners = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    near = np.linalg.norm(corners[:, None] - corners, axis=2) < 2.1  # the twelve corners' edges have length 2
    faces = [(i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] & near[j, k] & near[k, i]]
    a, b, c = corners[faces].swapaxes(0, 1)
    inward = np.einsum("ij,ij->i", np.cross(a, b), c) < 0
    b[inward], c[inward] = c[inward], b[inward]
    for _ in range(levels):
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
        a, b, c = (np.concatenate(corner) for corner in ((a, d, f, d), (d, b, e, e), (f, e, c, f)))
    points = np.stack([a, b, c], axis=1).reshape(-1, 3)
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    points, indices = np.unique(points.round(9), axis=0, return_inverse=True)  # each point once
    return Mesh(points + center, [3] * len(a), indices.ravel())


with Simulation({"voxel_size": 0.05, "gravity": (0, -9.8, 0)}) as simulation:  # a box of 1 m, filled with air
    ball, report = simulation.add_solid(icosphere((0.5, 0.7, 0.5), 0.15, 2), density=1000, youngs_modulus=2e4)
    carpet = [[0.9, 0, 0, 0.5], [0, 0.4, 0, 0.25], [0, 0, 0.9, 0.5], [0, 0, 0, 1]]
    simulation.add_emitter(transform=carpet, density=1)  # smoke above the floor
    for _frame in range(6):
        simulation.advance(1 / 24)
        height = simulation.solid_diagnostics(ball)["center"][1]
        (smoke,), place = simulation.field_view("smoke_density")  # the library's memory, until the next step
        print(f"{simulation.time:.4f} s: height {height:.4f} m, smoke {smoke.sum() * place['spacing'] ** 3:.4f} m^3")
    simulation.write_vdb(sys.argv[1] if len(sys.argv) > 1 else "drop_ball.vdb")
