"""Closed surfaces of Gprims in their local space: of a Mesh as it is posed, of the implicit ones as polygons."""

from __future__ import annotations

import math

import numpy as np
from pxr import Usd, UsdGeom

from .deformables import surface_at
from .parameters import prim_types
from .pose import Pose

AROUND = 48  # sides of what is round
SHAPES = tuple(kind for kind in prim_types()["emitter"] if kind != "Mesh")  # of emitters and of pins
PLANE_DEPTH = 0.25  # of the shorter side of a Plane: thickness of the slab below it
_DIMENSIONS = {
    "Sphere": ("radius",),
    "Cube": ("size",),
    "Cylinder": ("radius", "height"),
    "Cone": ("radius", "height"),
    "Capsule": ("radius", "height"),
    "Plane": ("width", "length"),
}

Surface = tuple[np.ndarray, np.ndarray, np.ndarray]


def dimensions(prim: Usd.Prim) -> tuple[str, ...]:
    """Attributes that shape an implicit Gprim; none for other prims."""
    return _DIMENSIONS.get(str(prim.GetTypeName()), ())


def is_shape(prim: Usd.Prim) -> bool:
    """Whether it is an implicit Gprim that has a surface here."""
    return str(prim.GetTypeName()) in _DIMENSIONS


def surface_of(prim: Usd.Prim, time: Usd.TimeCode) -> Surface:
    """Points (n, 3), face vertex counts and indices, faces outwards. Raises PoseError, ValueError for other prims."""
    if prim.IsA(UsdGeom.Mesh):
        mesh = UsdGeom.Mesh(prim)
        counts, indices = mesh.GetFaceVertexCountsAttr().Get(time), mesh.GetFaceVertexIndicesAttr().Get(time)
        return Pose(prim, own_points=True).points(time), np.array(counts or (), int), np.array(indices or (), int)
    if prim.IsA(UsdGeom.TetMesh):
        return surface_at(prim, time)
    kind = str(prim.GetTypeName())
    if kind not in _DIMENSIONS:
        raise ValueError(f"a {kind or 'typeless prim'} has no volume")
    size = {name: float(prim.GetAttribute(name).Get(time)) for name in _DIMENSIONS[kind]}
    if kind == "Cube":
        return _box(np.full(3, -size["size"] / 2), np.full(3, size["size"] / 2))
    axis = "XYZ".index(str(prim.GetAttribute("axis").Get(time))) if kind != "Sphere" else 2
    if kind == "Plane":
        # Width and length lie along x and y for a normal along z, along z and y for x, along x and z for y.
        sides = {0: (0.0, size["length"], size["width"]), 1: (size["width"], 0.0, size["length"])}
        high = np.array(sides.get(axis, (size["width"], size["length"], 0.0))) / 2
        low = -high
        low[axis] = -PLANE_DEPTH * min(size.values())
        return _box(low, high)
    return _revolve(_profile(kind, size), axis)


def _profile(kind: str, size: dict[str, float]) -> list[tuple[float, float]]:
    """Radius and height from the lower end of the axis to the upper one."""
    radius, half = size["radius"], size.get("height", 0.0) / 2
    if kind == "Cylinder":
        return [(0.0, -half), (radius, -half), (radius, half), (0.0, half)]
    if kind == "Cone":
        return [(0.0, -half), (radius, -half), (0.0, half)]
    quarter = AROUND // 4
    arc = [(math.sin(math.pi / 2 * i / quarter), math.cos(math.pi / 2 * i / quarter)) for i in range(quarter + 1)]
    lower = [(radius * s, -half - radius * c) for s, c in arc]
    upper = [(radius * s, half + radius * c) for s, c in reversed(arc)]
    return lower + (upper if half > 0 else upper[1:])


def _revolve(profile: list[tuple[float, float]], axis: int) -> Surface:
    turns = [2 * math.pi * j / AROUND for j in range(AROUND)]
    circle = [(math.cos(turn), math.sin(turn)) for turn in turns]
    points = [(0.0, 0.0, profile[0][1])]
    for radius, height in profile[1:-1]:
        points += [(radius * c, radius * s, height) for c, s in circle]
    points.append((0.0, 0.0, profile[-1][1]))
    at = lambda ring, j: 1 + ring * AROUND + j % AROUND  # noqa: E731
    last = len(profile) - 3
    faces = [[0, at(0, j + 1), at(0, j)] for j in range(AROUND)]
    faces += [
        [at(ring, j), at(ring, j + 1), at(ring + 1, j + 1), at(ring + 1, j)]
        for ring in range(last)
        for j in range(AROUND)
    ]
    faces += [[len(points) - 1, at(last, j), at(last, j + 1)] for j in range(AROUND)]
    turned = np.roll(np.array(points), axis + 1, axis=1)  # a cyclic change of axes keeps faces outwards
    return turned, np.array([len(face) for face in faces]), np.array([i for face in faces for i in face])


def _box(low: np.ndarray, high: np.ndarray) -> Surface:
    corners = np.array([[(high if c >> a & 1 else low)[a] for a in range(3)] for c in range(8)])
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return corners, np.full(6, 4), np.array(quads).ravel()
