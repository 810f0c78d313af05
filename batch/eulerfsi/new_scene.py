"""`new`: a scene that is ready to simulate, written around mesh files."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from . import solver
from .errors import LibraryError, SceneError, UsageError
from .files import export_layer, replacing
from .parameters import table
from .scene import DOMAIN_API, EMITTER_API, SOLID_API

_CELLS_ACROSS = 24  # of the smallest solid
_MAX_CELLS = 2e6
_FPS, _FRAMES = 24, 48


def new_scene(path: Path, solids: Sequence[Path], smoke: str) -> dict[str, float]:
    """Writes `path` with one elastic solid per mesh file, side by side above the floor of a box of fluid.

    File units are taken as metres. smoke: "carpet" (a layer on the floor) or "none". The voxel size gives the smallest
    solid 24 cells across; the stiffness lets a solid keep its shape under its own weight. Returns what was chosen.
    Raises UsageError for the path, SceneError for a mesh.
    """
    if path.suffix not in (".usda", ".usd", ".usdc"):
        raise UsageError(f"{path}: must end in .usda, .usd or .usdc")
    if path.exists():
        raise UsageError(f"{path}: exists already")
    boxes = [_extents(file) for file in solids]
    edges = np.array([high - low for low, high in boxes])
    largest = float(edges.max())
    gap = 0.4 * largest
    width = float(edges[:, 0].sum() + gap * (len(solids) + 1))
    size = np.array([max(width, 2.4 * largest), 2.6 * largest, max(float(edges[:, 2].max()) + 2 * gap, 2.4 * largest)])
    voxel = _round(max(float(edges.max(axis=1).min()) / _CELLS_ACROSS, (size.prod() / _MAX_CELLS) ** (1 / 3)))
    size = np.ceil(size / voxel) * voxel

    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(_FPS)
    stage.SetFramesPerSecond(_FPS)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(_FRAMES)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    Usd.ModelAPI(world.GetPrim()).SetKind("component")
    gravity = UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    gravity.CreateGravityDirectionAttr(Gf.Vec3f(0, -1, 0))
    gravity.CreateGravityMagnitudeAttr(9.81)
    domain = _box(stage, "/World/Domain", (0, size[1] / 2, 0), size, DOMAIN_API)
    _author(domain, "domain", voxelSize=voxel)

    names: set[str] = set()
    left = -(edges[:, 0].sum() + gap * (len(solids) - 1)) / 2
    youngs = 0.0
    for file, (low, high), edge in zip(solids, boxes, edges, strict=True):
        name = _unique(file, names)
        prim = UsdGeom.Xform.Define(stage, f"/World/{name}")
        center = (low + high) / 2
        place = np.array([left + edge[0] / 2, 0.7 * largest + edge[1] / 2, 0]) - center
        prim.AddTranslateOp().Set(Gf.Vec3d(*place.tolist()))
        prim.GetPrim().AddAppliedSchema(SOLID_API)
        relative = Path(os.path.relpath(file.resolve(), path.resolve().parent)).as_posix()
        prim.GetPrim().CreateAttribute("eulerfsi:surfaceFile", Sdf.ValueTypeNames.Asset, False).Set(f"./{relative}")
        # E = 20 rho g L: weight alone presses a solid by a few percent; never softer than the table's default.
        modulus = max(table()["solid"]["youngsModulus"].default, 20 * 1000.0 * 9.81 * float(edge.max()))
        modulus = _round(modulus)
        youngs = max(youngs, modulus)
        _author(prim.GetPrim(), "solid", youngsModulus=modulus)
        left += edge[0] + gap
    if smoke == "carpet":
        height = max(3 * voxel, 0.15 * largest)
        carpet = _box(stage, "/World/Carpet", (0, height / 2, 0), (size[0], height, size[2]), EMITTER_API)
        _author(carpet, "emitter", mode="initial", smokeDensity=0.8)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    with replacing(path) as temporary:
        export_layer(layer, temporary)
    return {"voxel_size": voxel, "cells": float((size / voxel).round().prod()), "youngs_modulus": youngs}


def _extents(file: Path) -> tuple[np.ndarray, np.ndarray]:
    if not file.is_file():
        raise SceneError(f"{file}: no such file")
    try:
        points = solver.load_mesh(file).points.astype(float)
    except LibraryError as error:
        raise SceneError(f"{file}: {error}") from error
    low, high = points.min(axis=0), points.max(axis=0)
    if not (high - low).max() > 0:
        raise SceneError(f"{file}: the mesh has no size")
    return low, high


def _round(value: float) -> float:
    """Two significant digits."""
    digits = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{round(value / digits) * digits:.6g}")


def _unique(file: Path, names: set[str]) -> str:
    base = "".join(c if c.isalnum() else "_" for c in file.stem.title()) or "Solid"
    base = base if not base[0].isdigit() else f"Solid_{base}"
    number, name = 1, base
    while name in names | {"Domain", "Carpet", "PhysicsScene"}:
        number, name = number + 1, f"{base}{number + 1}"
    names.add(name)
    return name


def _box(stage: Usd.Stage, path: str, center: Sequence[float], size: Sequence[float], api: str) -> Usd.Prim:
    """A guide Cube of edge 1, scaled to a box."""
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(1.0)
    cube.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
    cube.CreatePurposeAttr(UsdGeom.Tokens.guide)
    cube.AddTranslateOp().Set(Gf.Vec3d(*map(float, center)))
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, size)))
    cube.GetPrim().AddAppliedSchema(api)
    return cube.GetPrim()


def _author(prim: Usd.Prim, scope: str, **values: float | str) -> None:
    kinds = {"double": Sdf.ValueTypeNames.Double, "token": Sdf.ValueTypeNames.Token}
    for name, value in values.items():
        row = table()[scope][name]
        attribute = prim.CreateAttribute(row.attribute, kinds[row.type], False, Sdf.VariabilityUniform)
        attribute.Set(value)
