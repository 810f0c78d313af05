"""Meshes that something else moves: a skinned figure with a blend shape."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from conftest import author, box, metric_stage
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

BODY = "/World/Figure/Body"


def tube(radius: float = 0.1, height: float = 0.6, around: int = 16, rows: int = 24) -> tuple[np.ndarray, list, list]:
    """A closed cylinder along y: points (n, 3), counts, indices."""
    points = [(0.0, -height / 2, 0.0)]
    for i in range(rows + 1):
        for j in range(around):
            turn = 2 * math.pi * j / around
            points.append((radius * math.cos(turn), height * (i / rows - 0.5), radius * math.sin(turn)))
    points.append((0.0, height / 2, 0.0))
    at = lambda i, j: 1 + i * around + j % around  # noqa: E731
    faces = [[0, at(0, j), at(0, j + 1)] for j in range(around)]
    faces += [[at(i, j + 1), at(i, j), at(i + 1, j), at(i + 1, j + 1)] for i in range(rows) for j in range(around)]
    faces += [[len(points) - 1, at(rows, j + 1), at(rows, j)] for j in range(around)]
    return np.array(points), [len(f) for f in faces], [i for f in faces for i in f]


def start_stage(path: Path, frames: tuple[int, int] = (1, 3), voxel: float = 0.05) -> Usd.Stage:
    """A stage in metres with a box of 1.4 m around the origin."""
    stage = metric_stage(path, frames)
    author(box(stage, "/World/Domain", (0, 0, 0), (1.4, 1.4, 1.4), 1.0, "EulerFsiDomainAPI"), voxelSize=voxel)
    return stage


def add_tube(stage: Usd.Stage, path: str, **shape: float) -> UsdGeom.Mesh:
    """An elastic tube."""
    points, counts, indices = tube(**shape)
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr(counts)
    mesh.CreateFaceVertexIndicesAttr(indices)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.Mesh.ComputeExtent(mesh.GetPointsAttr().Get()))
    mesh.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    return mesh


def make_figure(path: Path, method: str = "classicLinear", bend: tuple[float, float] = (60.0, 64.0)) -> Usd.Stage:
    """A tube that bends from bend[0] to bend[1] degrees in frames 1 to 2, made fatter by a blend shape.

    Root, skeleton and mesh have transforms of their own; the skeleton is bound at the root and inherited.
    """
    stage = start_stage(path)
    root = UsdSkel.Root.Define(stage, "/World/Figure")
    root.AddTranslateOp().Set(Gf.Vec3d(0.1, 0, 0))
    skeleton = UsdSkel.Skeleton.Define(stage, "/World/Figure/Skeleton")
    skeleton.AddTranslateOp().Set(Gf.Vec3d(0, 0.05, 0))
    skeleton.CreateJointsAttr(["lower", "lower/upper"])
    lower, upper = Gf.Vec3d(0, -0.3, 0), Gf.Vec3d(0, 0.3, 0)
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d().SetTranslate(lower), Gf.Matrix4d(1.0)])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d().SetTranslate(v) for v in (lower, upper)])
    animation = UsdSkel.Animation.Define(stage, "/World/Figure/Animation")
    animation.CreateJointsAttr(["lower", "lower/upper"])
    for frame, degrees in zip((1, 2), bend, strict=True):
        half = math.radians(degrees) / 2
        animation.CreateTranslationsAttr().Set([Gf.Vec3f(lower), Gf.Vec3f(upper)], frame)
        turned = Gf.Quatf(math.cos(half), 0, 0, math.sin(half))
        animation.CreateRotationsAttr().Set([Gf.Quatf(1, 0, 0, 0), turned], frame)
        animation.CreateScalesAttr().Set([Gf.Vec3h(1), Gf.Vec3h(1)], frame)
        animation.CreateBlendShapeWeightsAttr().Set([0.5], frame)
    animation.CreateBlendShapesAttr(["fat"])
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    UsdSkel.BindingAPI.Apply(root.GetPrim()).CreateSkeletonRel().SetTargets([skeleton.GetPath()])

    mesh = add_tube(stage, BODY)
    mesh.AddTranslateOp().Set(Gf.Vec3d(0, 0, 0.02))
    points = np.array(mesh.GetPointsAttr().Get(), float)
    share = np.clip((points[:, 1] + 0.1) / 0.2, 0, 1)  # of the upper joint
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateJointIndicesPrimvar(False, 2).Set(Vt.IntArray([0, 1] * len(points)))
    binding.CreateJointWeightsPrimvar(False, 2).Set(Vt.FloatArray(np.stack([1 - share, share], 1).ravel().tolist()))
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    binding.CreateSkinningMethodAttr(method)
    shape = UsdSkel.BlendShape.Define(stage, f"{BODY}/fat")
    shape.CreateOffsetsAttr([Gf.Vec3f(0.4 * x, 0, 0.4 * z) for x, _, z in points.tolist()])
    binding.CreateBlendShapesAttr(["fat"])
    binding.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])
    stage.GetRootLayer().Save()
    return stage
