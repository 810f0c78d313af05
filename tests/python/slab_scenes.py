"""Two-dimensional scenes: discs in a slab, a box of the grid that is one cell thick, or more to compare with."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from conftest import author, box, metric_stage
from eulerfsi.run.simulate import Options, simulate
from pxr import Usd, UsdGeom, UsdPhysics


def disc(radius: float, height: float, around: int = 48) -> tuple[np.ndarray, list[int], list[int]]:
    """A closed cylinder along z, rows of quads at most a third of the radius high: points (n, 3), counts, indices."""
    rows = max(1, math.ceil(3 * height / radius))
    turn = 2 * np.pi * np.arange(around) / around
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    points = [(0.0, 0.0, -height / 2)]
    for row in range(rows + 1):
        points += [(x, y, height * (row / rows - 0.5)) for x, y in ring]
    points.append((0.0, 0.0, height / 2))
    at = lambda row, j: 1 + row * around + j % around  # noqa: E731
    faces = [[0, at(0, j + 1), at(0, j)] for j in range(around)]
    faces += [[at(r, j), at(r, j + 1), at(r + 1, j + 1), at(r + 1, j)] for r in range(rows) for j in range(around)]
    faces += [[len(points) - 1, at(rows, j), at(rows, j + 1)] for j in range(around)]
    return np.array(points), [len(face) for face in faces], [i for face in faces for i in face]


def slab_stage(
    path: Path,
    size: tuple[float, float],
    voxel: float,
    cells: int = 1,
    frames: int = 12,
    gravity: float = 0.0,
    **domain,
) -> Usd.Stage:
    """A stage in metres, y up, with a box of `size` around the origin, `cells` voxels thick along z, slip walls."""
    stage = metric_stage(path, (0, frames))
    UsdPhysics.Scene.Define(stage, "/World/PhysicsScene").CreateGravityMagnitudeAttr(gravity)
    prim = box(stage, "/World/Domain", (0, 0, 0), (*size, cells * voxel), 1.0, "EulerFsiDomainAPI")
    author(prim, voxelSize=voxel, **domain)
    return stage


def add_disc(
    stage: Usd.Stage,
    name: str,
    center: tuple[float, float],
    radius: float,
    height: float,
    shape: tuple[float, float] = (1.0, 1.0),
    density: float = 1000.0,
    **values,
) -> Usd.Prim:
    """An elastic cylinder along z; shape: factors along x and y."""
    points, counts, indices = disc(radius, height)
    mesh = UsdGeom.Mesh.Define(stage, f"/World/{name}")
    mesh.CreatePointsAttr(points * (*shape, 1.0) + (*center, 0.0))
    mesh.CreateFaceVertexCountsAttr(counts)
    mesh.CreateFaceVertexIndicesAttr(indices)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.Mesh.ComputeExtent(mesh.GetPointsAttr().Get()))
    mesh.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    UsdPhysics.MassAPI.Apply(mesh.GetPrim()).CreateDensityAttr(density)
    author(mesh.GetPrim(), **values)
    return mesh.GetPrim()


def run(path: Path, stage: Usd.Stage, **options) -> tuple[Path, list[dict]]:
    """Saves and simulates: the cache and the records of its frames."""
    stage.GetRootLayer().Save()
    folder = simulate(path, Options(output=path.with_suffix(".cache"), progress="none", **options)).folder
    events = [json.loads(line) for line in (folder / "stats.jsonl").read_text().splitlines()]
    return folder, [event for event in events if "frame" in event and "solids" in event]


def points_of(folder: Path, name: str, frame: int) -> np.ndarray:
    """Positions of a mesh in a cache's frame."""
    stage = Usd.Stage.Open(str(next(folder.glob("*.usd*"))))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{name}"))
    return np.array(mesh.GetPointsAttr().Get(frame), float)
