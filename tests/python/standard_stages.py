"""Small stages of the proposed standard for deformable bodies, without a schema of ours but for the domain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from conftest import author, box, metric_stage
from eulerfsi.log import Log
from eulerfsi.run.build import Build, build_simulation
from eulerfsi.run.simulate import Options, load_scene
from eulerfsi.scene.parts import Scene
from eulerfsi_usd import checks, standard
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

KINDS = {
    "float": Sdf.ValueTypeNames.Float,
    "floats": Sdf.ValueTypeNames.FloatArray,
    "bool": Sdf.ValueTypeNames.Bool,
    "token": Sdf.ValueTypeNames.Token,
    "points": Sdf.ValueTypeNames.Point3fArray,
    "vectors": Sdf.ValueTypeNames.Vector3fArray,
    "ints": Sdf.ValueTypeNames.IntArray,
    "tets": Sdf.ValueTypeNames.Int4Array,
}


def tet_box(cells: tuple[int, int, int], size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """A box about the origin of six tetrahedra per cell: points (n, 3), corners (m, 4) of positive volume."""
    axes = [np.linspace(-edge / 2, edge / 2, count + 1) for count, edge in zip(cells, size, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    at = lambda i, j, k: (i * (cells[1] + 1) + j) * (cells[2] + 1) + k  # noqa: E731
    tets = []
    for i, j, k in np.ndindex(*cells):
        c = [at(i + a, j + b, k + d) for a in (0, 1) for b in (0, 1) for d in (0, 1)]
        around = ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1))
        tets += [(c[0], c[y], c[x], c[7]) for x, y in around]
    return points, np.array(tets)


def new_stage(
    path: Path, *, frames: tuple[int, int] = (1, 3), unit: float = 1.0, voxel: float = 0.025, fluid: bool = True
) -> Usd.Stage:
    """A box of 0.6 m about the origin; unit: metres per unit, lengths in the arguments are metres."""
    stage = metric_stage(path, frames)
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    domain = box(stage, "/World/Domain", (0, 0, 0), (0.6, 0.6, 0.6), 1 / unit, "EulerFsiDomainAPI")
    author(domain, voxelSize=voxel / unit, ambientFluid=fluid)
    return stage


def put(prim: Usd.Prim, kind: str, **values: object) -> None:
    """Attributes in the namespace physics; "masses_elementType" is masses:elementType."""
    for name, value in values.items():
        value = vec_array(value, kind) if kind in ("points", "vectors", "tets") else value
        prim.CreateAttribute(f"physics:{name.replace('_', ':')}", KINDS[kind]).Set(value)


def vec_array(values: np.ndarray, kind: str = "points") -> object:
    """As USD takes it."""
    if kind == "tets":
        return Vt.Vec4iArray.FromNumpy(np.ascontiguousarray(values, np.int32))
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def apply(prim: Usd.Prim, *apis: str) -> Usd.Prim:
    """Schemas that USD does not know."""
    for api in apis:
        prim.AddAppliedSchema(api)
    return prim


def add_body(
    stage: Usd.Stage,
    path: str = "/World/Jelly",
    points: np.ndarray | None = None,
    tets: np.ndarray | None = None,
    body: str = "",
) -> Usd.Prim:
    """A TetMesh that is a body, or the sim mesh of the prim `body`. By default a box of 0.2 x 0.15 x 0.15 units."""
    if points is None:
        points, tets = tet_box((4, 3, 3), (0.2, 0.15, 0.15))
    mesh = UsdGeom.TetMesh.Define(stage, path)
    mesh.CreatePointsAttr(vec_array(points))
    mesh.CreateTetVertexIndicesAttr(vec_array(tets, "tets"))
    apply(mesh.GetPrim(), standard.VOLUME_SIM, standard.COLLISION)
    apply(stage.GetPrimAtPath(body) if body else mesh.GetPrim(), standard.BODY)
    return mesh.GetPrim()


def add_material(stage: Usd.Stage, path: str, prim: Usd.Prim, **values: float) -> Usd.Prim:
    """A material with the volume schema alone, bound for physics."""
    material = UsdShade.Material.Define(stage, path)
    apply(material.GetPrim(), standard.VOLUME_MATERIAL)
    put(material.GetPrim(), "float", **values)
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")
    return material.GetPrim()


def add_attachment(
    stage: Usd.Stage, sim: str, target: str, kind: str, sites: np.ndarray, anchors: np.ndarray, coords: object = None
) -> Usd.Prim:
    """Holds sites of a sim mesh at places (n, 3) of the target."""
    prim = stage.DefinePrim("/World/Attachment", standard.ATTACHMENT)
    for name, end in zip(standard.SOURCES, (sim, target), strict=True):
        prim.CreateRelationship(f"physics:{name}").AddTarget(end)
    put(prim, "token", type0=kind, type1="xform")
    put(prim, "ints", indices0=[int(i) for i in sites])
    put(prim, "vectors", coords1=anchors)
    if coords is not None:
        put(prim, "vectors", coords0=coords)
    return prim


def read(path: Path) -> tuple[Scene, list[str]]:
    """The scene, and the codes of the warnings. Raises SceneError."""
    codes: list[str] = []

    class Codes(Log):
        def warning(self, text: str, code: str = "", *_: str) -> None:
            codes.append(code)

    scene, _ = load_scene(path, Options(), Codes(), 0)
    return scene, codes


def build(scene: Scene) -> Build:
    """A simulation of it."""
    return build_simulation(scene, 2, 0, Log())


def found(stage: Usd.Stage, severity: str = "error") -> dict[str, str]:
    """{code: message} of the issues of a stage."""
    return {issue.code: issue.message for issue in checks.check_stage(stage) if issue.severity == severity}


def turned(angle: float) -> np.ndarray:
    """(3, 3) for row vectors, about z."""
    return np.array(Gf.Matrix3d(Gf.Rotation(Gf.Vec3d(0, 0, 1), np.degrees(angle))))
