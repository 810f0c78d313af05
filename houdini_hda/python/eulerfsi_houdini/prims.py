"""USD prims of pieces."""

from __future__ import annotations

import numpy as np
from pxr import Gf, UsdGeom, Vt

from .geometry import Motion, Piece


def author_mesh(mesh: UsdGeom.Mesh, piece: Piece, frame: int) -> None:
    """Points in world space at a frame, faces."""
    points = _points(piece.points(frame))
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr(piece.counts)
    mesh.CreateFaceVertexIndicesAttr(piece.indices)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))


def author_motion(mesh: UsdGeom.Mesh, motion: Motion) -> None:
    """Time samples of the transform of a rigid piece, of the points of another."""
    if motion.transforms:
        op = mesh.AddTransformOp()
        for frame, matrix in motion.transforms.items():
            op.Set(Gf.Matrix4d(matrix.tolist()), frame)
    for frame, points in motion.points.items():
        mesh.GetPointsAttr().Set(_points(points), frame)


def _points(points: np.ndarray) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))
