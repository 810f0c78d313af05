"""A random scene as a USD file, as users have them."""

from __future__ import annotations

from pathlib import Path

import eulerfsi_usd  # noqa: F401 - the schema
import numpy as np
from eulerfsi.solver import binding
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from .scenes import Scene

_AXES = ("X", "Y", "Z")
_SCHEMA_NAMES = {
    "youngs_modulus": "youngsModulus",
    "poissons_ratio": "poissonsRatio",
    "friction": "friction",
    "plastic_yield_stress": "plasticYieldStress",
    "plastic_flow_rate": "plasticFlowRate",
    "plastic_hardening": "plasticHardening",
}


def write_scene(scene: Scene, path: Path, frames: int, fineness: float, smoke: bool) -> None:
    """Writes the scene in metres, frames 1 to `frames`. fineness: cells for each of the scene's own, along an edge.

    smoke: a layer of it on the lower fifth of the box, where there is fluid.
    """
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(24)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(frames)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    size, pull = np.array(scene.box), np.array(scene.pull, float)
    gravity = UsdPhysics.Scene.Define(stage, "/World/Gravity")
    gravity.CreateGravityMagnitudeAttr(float(np.linalg.norm(pull)))
    gravity.CreateGravityDirectionAttr(Gf.Vec3f(*map(float, pull if pull.any() else (0, -1, 0))))
    domain = _box(stage, "Domain", size / 2, size, "EulerFsiDomainAPI")
    _set(domain, "voxelSize", scene.spacing / fineness)
    _set(domain, "ambientFluid", scene.density_ratio is not None)
    if scene.density_ratio is not None:
        _set(domain, "fluidDensity", scene.fluid_density)
    for face, kind in enumerate(scene.faces):
        _set(domain, f"wall{_AXES[face // 2]}{'Max' if face % 2 else 'Min'}", kind)
    materials = {number: name for name, number in binding.MATERIALS.items()}
    for number, (mesh, values) in enumerate(scene.bodies(), 1):
        prim = UsdGeom.Mesh.Define(stage, f"/World/Solid{number}")
        prim.CreatePointsAttr(np.asarray(mesh.points, np.float32))
        prim.CreateFaceVertexCountsAttr(list(map(int, mesh.counts)))
        prim.CreateFaceVertexIndicesAttr(list(map(int, mesh.indices)))
        prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        solid = prim.GetPrim()
        solid.ApplyAPI("EulerFsiSolidAPI")
        UsdPhysics.MassAPI.Apply(solid).CreateDensityAttr(float(values["density"]))
        _set(solid, "velocity", Gf.Vec3f(*map(float, values["velocity"])))
        _set(solid, "angularVelocity", Gf.Vec3f(*map(float, np.degrees(values["angular_velocity"]))))
        _set(solid, "compressible", bool(values["compressible"]))
        _set(solid, "material", materials[values["material"]])
        for field, name in _SCHEMA_NAMES.items():
            if field in values:
                _set(solid, name, float(values[field]))
    if smoke and scene.density_ratio is not None:
        carpet = _box(stage, "Smoke", size * (0.5, 0.1, 0.5), size * (1.0, 0.2, 1.0), "EulerFsiEmitterAPI")
        _set(carpet, "mode", "initial")
    stage.GetRootLayer().Save()


def _box(stage: Usd.Stage, name: str, center: np.ndarray, size: np.ndarray, api: str) -> Usd.Prim:
    cube = UsdGeom.Cube.Define(stage, f"/World/{name}")
    cube.CreateSizeAttr(1.0)
    cube.AddTranslateOp().Set(Gf.Vec3d(*map(float, center)))
    cube.AddScaleOp().Set(Gf.Vec3f(*map(float, size)))
    cube.CreatePurposeAttr(UsdGeom.Tokens.guide)
    cube.GetPrim().ApplyAPI(api)
    return cube.GetPrim()


def _set(prim: Usd.Prim, name: str, value: object) -> None:
    attribute = prim.GetAttribute(f"eulerfsi:{name}")
    if not attribute:
        raise ValueError(f"{prim.GetPath()}: the schema has no eulerfsi:{name}")
    attribute.Set(value)
