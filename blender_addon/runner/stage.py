# SPDX-License-Identifier: Apache-2.0
"""The USD stage of what Blender has exported (scene.json and one .npz per mesh): axes and lengths are Blender's own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import eulerfsi_usd  # noqa: F401 - registers the schemas, which must come before the first stage
import numpy as np
from eulerfsi.parameters import Parameter, StageUnits, table
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

_TYPES = {
    "double": Sdf.ValueTypeNames.Double,
    "bool": Sdf.ValueTypeNames.Bool,
    "token": Sdf.ValueTypeNames.Token,
    "vector": Sdf.ValueTypeNames.Vector3d,
}
_ROOT = "/World"


def write_stage(export: Path, path: Path) -> None:
    """Writes the stage. Raises OSError."""
    scene = json.loads((export / "scene.json").read_text(encoding="utf-8"))
    stage = Usd.Stage.CreateInMemory()
    units = StageUnits(scene["meters_per_unit"], 1.0)
    _set_up(stage, scene, units)
    for entry in scene["prims"]:
        _add(stage, entry, export, units)
    for entry in scene["prims"]:
        for name, targets in entry.get("relationships", {}).items():
            prim = stage.GetPrimAtPath(entry["path"])
            prim.CreateRelationship(f"eulerfsi:{name}", custom=False).SetTargets(
                [Sdf.Path(target) for target in targets]
            )
    temporary = path.with_name(f"new-{path.name}")
    if not stage.GetRootLayer().Export(str(temporary)):
        raise OSError(28, "could not be written", str(path))
    temporary.replace(path)


def _set_up(stage: Usd.Stage, scene: dict[str, Any], units: StageUnits) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, units.meters_per_unit)
    UsdPhysics.SetStageKilogramsPerUnit(stage, units.kilograms_per_unit)
    stage.SetTimeCodesPerSecond(scene["fps"])
    stage.SetFramesPerSecond(scene["fps"])
    stage.SetStartTimeCode(scene["first"])
    stage.SetEndTimeCode(scene["last"])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, _ROOT).GetPrim())
    gravity = np.array(scene["gravity"], float)
    size = float(np.linalg.norm(gravity))
    physics = UsdPhysics.Scene.Define(stage, f"{_ROOT}/PhysicsScene")
    direction = gravity / size if size > 0 else np.array([0.0, 0.0, -1.0])
    physics.CreateGravityDirectionAttr(Gf.Vec3f(*direction.tolist()))
    physics.CreateGravityMagnitudeAttr(size / units.meters_per_unit)


def _add(stage: Usd.Stage, entry: dict[str, Any], export: Path, units: StageUnits) -> None:
    """One prim: its shape, place and values."""
    path, shape = entry["path"], entry["shape"]
    prim = getattr(UsdGeom, shape["type"]).Define(stage, path)
    if shape["type"] == "Mesh":
        _add_mesh(prim, export / shape["file"])
    elif shape["type"] == "Sphere":
        prim.CreateRadiusAttr(shape["radius"])
    elif shape["type"] == "Cube":
        prim.CreateSizeAttr(1.0)
    elif shape["type"] == "Plane":
        prim.CreateAxisAttr(UsdGeom.Tokens.z)
        prim.CreateWidthAttr(shape["width"])
        prim.CreateLengthAttr(shape["length"])
    _place(prim, entry["matrices"])
    prim.GetPrim().SetCustomDataByKey("blender:object", entry["object"])
    for scope, values in entry["values"].items():
        prim.GetPrim().AddAppliedSchema(f"EulerFsi{scope.title()}API")
        if scope == "solid":
            UsdPhysics.MassAPI.Apply(prim.GetPrim())
        for name, value in values.items():
            _author(prim.GetPrim(), table()[scope][name], value, units)


def _add_mesh(prim: UsdGeom.Mesh, file: Path) -> None:
    with np.load(file) as arrays:
        data = {name: arrays[name] for name in arrays.files}
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(data["counts"]))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(data["indices"]))
    points = prim.CreatePointsAttr()
    if data["points"].ndim == 2:
        points.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(data["points"])))
    else:
        for frame, at in zip(data["frames"].tolist(), data["points"], strict=True):
            points.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(at)), frame)
    if "pin" in data:
        primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            "eulerfsi:pin", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex
        )
        primvar.Set(Vt.FloatArray.FromNumpy(data["pin"]))


def _place(prim: UsdGeom.Xformable, matrices: dict[str, list[float]]) -> None:
    """Blender's matrices are for column vectors, USD's for row vectors."""
    op = prim.AddTransformOp()
    for frame, values in matrices.items():
        matrix = Gf.Matrix4d(np.reshape(values, (4, 4)).T.tolist())
        op.Set(matrix, Usd.TimeCode.Default() if len(matrices) == 1 else float(frame))


def _author(prim: Usd.Prim, row: Parameter, value: Any, units: StageUnits) -> None:
    """A value in SI (angles in degrees), or {frame: value}, in the units of the stage."""
    if row.usd_physics:
        attribute = prim.CreateAttribute(row.attribute, Sdf.ValueTypeNames.Float, custom=False)
    else:
        kind = Sdf.VariabilityVarying if row.animated else Sdf.VariabilityUniform
        attribute = prim.CreateAttribute(row.attribute, _TYPES[row.type], custom=False, variability=kind)
    factor = 1.0 if row.stage_unit == "degrees" else units.factor(row.stage_unit)

    def on_stage(x: Any) -> Any:
        if row.type == "vector":
            return Gf.Vec3d(*(component / factor for component in x))
        return x / factor if row.type == "double" else x

    if isinstance(value, dict):
        for frame, x in value.items():
            attribute.Set(on_stage(x), float(frame))
    else:
        attribute.Set(on_stage(value))
