"""`new --from-usd`: a domain around what a USD file holds, whose meshes become solids where it has none."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
from eulerfsi_usd.deformables import find_bodies, simulated_bodies
from eulerfsi_usd.foreign import physics_colliders
from eulerfsi_usd.issues import all_prims, first_time, instance_above, is_enabled, scopes_of
from eulerfsi_usd.pose import Pose
from pxr import Sdf, Usd, UsdGeom, UsdPhysics

from ..errors import SceneError
from ..scene.instancers import expand_instancers
from ..scene.read import open_stage
from ..scene.references import is_usd_file
from ..scene.values import SOLID_API
from .new_layout import Layout, lay_out, margin_of, moduli_of, refine
from .new_stage import NewStage, author


def wrap(layer: Sdf.Layer, path: Path, asset: Path, smoke: str) -> tuple[Layout, dict[str, str]]:
    """Fills the layer of the scene `path`, with the asset as its sublayer.

    Returns what was chosen, and {}: no prim is of a mesh file.

    The box is put around the solids of the asset: bodies of the standard and prims with our schema; where there is
    neither every Mesh becomes a solid. Raises SceneError.
    """
    if asset.is_file() and not is_usd_file(asset):
        raise SceneError(f"{asset}: is not a USD file: give a mesh file by --solid")
    stage = open_stage(asset)
    expand_instancers(stage)
    _copy_metadata(stage, layer)
    domains = [prim for prim in all_prims(stage) if "domain" in scopes_of(prim)]
    if domains:
        raise SceneError(f"{asset}: has a domain, {domains[0].GetPath()}: it is a scene already; simulate it as it is")
    marked, meshes = _marked(stage), []
    if not marked:
        meshes = _meshes(stage)
    if not marked and not meshes:
        nothing = f"{asset}: has no Mesh with a volume, no solid and no volume body: there is nothing to simulate"
        raise SceneError(nothing + _in_instances(stage))
    boxes = [_world_box(prim) for prim in marked or meshes]
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    up = "z" if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else "y"
    layout = _author(Usd.Stage.Open(layer), stage, boxes, meshes, (unit, up, smoke))
    relative = Path(os.path.relpath(asset.resolve(), path.resolve().parent)).as_posix()
    layer.subLayerPaths.append(relative if relative.startswith("../") else f"./{relative}")  # now: it has no folder yet
    return layout, {}


def unit_warnings(asset: Path) -> list[str]:
    """A line where the asset does not say how long a unit is."""
    if UsdGeom.StageHasAuthoredMetersPerUnit(open_stage(asset)):
        return []
    unit = UsdGeom.LinearUnits.centimeters
    return [f"warning: {asset}: metersPerUnit is not authored: a unit counts as {unit:g} m, which is USD's default"]


def _copy_metadata(own: Usd.Stage, layer: Sdf.Layer) -> None:
    """A layer has the units, axis, clock and default prim of its strongest layer only."""
    source, root = own.GetRootLayer().pseudoRoot, layer.pseudoRoot
    for key in ("defaultPrim", "kilogramsPerUnit", "timeCodesPerSecond", "framesPerSecond"):
        if source.HasInfo(key):
            root.SetInfo(key, source.GetInfo(key))
    root.SetInfo("metersPerUnit", UsdGeom.GetStageMetersPerUnit(own))
    root.SetInfo("upAxis", UsdGeom.GetStageUpAxis(own))


def _marked(stage: Usd.Stage) -> list[Usd.Prim]:
    """What becomes a solid as it is: prims that have its points, or its file."""
    bodies = find_bodies(stage)
    parts = {prim for body in bodies for prim in (body.prim, body.sim)}
    ours = [p for p in all_prims(stage) if "solid" in scopes_of(p) and is_enabled(p) and p not in parts]
    return [*ours, *(body.sim for body in simulated_bodies(stage))]


def _meshes(stage: Usd.Stage) -> list[Usd.Prim]:
    """Meshes with a volume that are drawn and collide with nothing else."""
    colliders = set(physics_colliders(stage))
    found = []
    for prim in stage.Traverse():
        drawn = prim.IsA(UsdGeom.Mesh) and UsdGeom.Imageable(prim).ComputePurpose() != UsdGeom.Tokens.guide
        if not drawn or prim in colliders or scopes_of(prim):
            continue
        if UsdGeom.Imageable(prim).ComputeVisibility(first_time(stage)) == UsdGeom.Tokens.invisible:
            continue
        points = Pose(prim, True).points(first_time(stage))
        if len(points) > 3 and (np.ptp(points, axis=0) > 1e-6 * np.ptp(points, axis=0).max()).all():
            found.append(prim)
    return found


def _in_instances(stage: Usd.Stage) -> str:
    """Says of a Mesh that it lies in an instance; "" where there is none."""
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if prim.IsInstanceProxy() and prim.IsA(UsdGeom.Mesh):
            instance = instance_above(prim).GetPath()
            return f"; {prim.GetPath()} lies in an instance: {instance} needs instanceable = false"
    return ""


def _world_box(prim: Usd.Prim) -> tuple[np.ndarray, np.ndarray]:
    """Corners in world space where the scene starts."""
    time = first_time(prim.GetStage())
    purposes = [UsdGeom.Tokens.default_, UsdGeom.Tokens.render, UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide]
    if prim.IsA(UsdGeom.PointBased):
        points = Pose(prim, True).points(time)
        matrix = np.array(UsdGeom.XformCache(time).GetLocalToWorldTransform(prim))
        points = points @ matrix[:3, :3] + matrix[3, :3]
        return points.min(axis=0), points.max(axis=0)
    box = UsdGeom.BBoxCache(time, purposes).ComputeWorldBound(prim).ComputeAlignedRange()
    if box.IsEmpty():
        raise SceneError(f"{prim.GetPath()}: no extent is known: a solid with eulerfsi:surfaceFile needs one authored")
    return np.array(box.GetMin()), np.array(box.GetMax())


def _author(
    target: Usd.Stage, source: Usd.Stage, boxes: list, meshes: list[Usd.Prim], choice: tuple[float, str, str]
) -> Layout:
    unit, up, smoke = choice
    new = NewStage(target, unit, up, "/EulerFsi")
    corners = [new.layout(np.stack(box)) for box in boxes]
    low, high = (np.array([f(c, axis=0) for c in corners]) for f in (np.min, np.max))
    edges = high - low
    margin = margin_of(edges)
    middle, size = (high.max(axis=0) + low.min(axis=0)) / 2, np.ptp([low.min(axis=0), high.max(axis=0)], axis=0)
    clock = lay_out(edges)  # frames for things of this size
    if source.HasAuthoredTimeCodeRange():
        first, last = math.ceil(source.GetStartTimeCode()), math.floor(source.GetEndTimeCode())
        fps, frames = source.GetTimeCodesPerSecond(), last - first + 1
    else:
        first, fps, frames = 1, clock.fps, clock.frames
    layout = Layout(size + 2 * margin, 0.0, fps, frames, middle[None], moduli_of(edges), first)
    layout = refine(layout, edges, margin)
    target.GetRootLayer().comment = (
        "A domain around the sublayer. Comments say what each value does; ./eulerfsi validate says which counted."
    )
    new.set_frames(layout)
    UsdGeom.Scope.Define(target, "/EulerFsi")
    if not target.GetRootLayer().HasDefaultPrim():
        target.SetDefaultPrim(target.GetPrimAtPath("/EulerFsi"))
    if not any(prim.IsA(UsdPhysics.Scene) for prim in all_prims(source)):
        new.add_gravity()
    new.add_domain(layout, middle)
    for mesh, modulus in zip(meshes, layout.moduli, strict=bool(meshes)):
        _make_solid(target, mesh, modulus)
    if smoke == "carpet":
        new.add_carpet(layout, middle - [0, layout.size[1] / 2, 0])
    return layout


def _make_solid(target: Usd.Stage, mesh: Usd.Prim, modulus: float) -> None:
    """Schema and stiffness on a mesh of the sublayer; instances above it are none any more."""
    above = mesh.GetParent()
    while above and not above.IsPseudoRoot():
        if above.IsInstance():
            target.OverridePrim(above.GetPath()).SetInstanceable(False)
        above = above.GetParent()
    solid = target.OverridePrim(mesh.GetPath())
    solid.AddAppliedSchema(SOLID_API)
    author(solid, "solid", youngsModulus=modulus)
