"""A scene written to the proposed standard for deformable bodies: only its domain and its smoke have schemas of ours.

examples/make_scenes.py writes it.
"""

from __future__ import annotations

import itertools

from pieces import DIGITS, add_camera, add_carpet, add_domain, add_mesh, bind_material, box_mesh, eased, new_stage
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

_AROUND = ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1))  # six tetrahedra about a diagonal of a cell


def add_tets(stage: Usd.Stage, path: str, cells: tuple, size: tuple) -> UsdGeom.TetMesh:
    """A box about the origin, six tetrahedra to a cell: the sim mesh of a volume body."""
    ends = [[-edge / 2 + edge * i / count for i in range(count + 1)] for count, edge in zip(cells, size, strict=True)]
    points = [Gf.Vec3f(*(round(x, DIGITS) for x in point)) for point in itertools.product(*ends)]
    tets = []
    for i, j, k in itertools.product(*map(range, cells)):
        c = [
            ((i + a) * (cells[1] + 1) + j + b) * (cells[2] + 1) + k + d
            for a, b, d in itertools.product((0, 1), repeat=3)
        ]
        tets += [Gf.Vec4i(c[0], c[y], c[x], c[7]) for x, y in _AROUND]
    mesh = UsdGeom.TetMesh.Define(stage, path)
    mesh.CreatePointsAttr(points)
    mesh.CreateTetVertexIndicesAttr(tets)
    mesh.CreateSurfaceFaceVertexIndicesAttr(UsdGeom.TetMesh.ComputeSurfaceFaces(mesh))
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    mesh.CreatePurposeAttr(UsdGeom.Tokens.proxy)  # its graphics mesh is drawn
    for schema in ("PhysicsVolumeDeformableSimAPI", "PhysicsCollisionAPI"):
        mesh.GetPrim().AddAppliedSchema(schema)
    return mesh


def add_rubber(stage: Usd.Stage, path: str, prim: Usd.Prim, values: dict[str, float]) -> None:
    """A material of the standard, bound for physics."""
    material = UsdShade.Material.Define(stage, path)
    for schema in ("PhysicsMaterialAPI", "PhysicsVolumeDeformableMaterialAPI"):
        material.GetPrim().AddAppliedSchema(schema)
    for name, value in values.items():
        material.GetPrim().CreateAttribute(f"physics:{name}", Sdf.ValueTypeNames.Float, False).Set(value)
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")


def hang(stage: Usd.Stage, sim: UsdGeom.TetMesh, place: Gf.Vec3d, hand: UsdGeom.Xform, at: Gf.Vec3d) -> None:
    """Attaches the top of a sim mesh at `place` to a hand at `at`."""
    points = sim.GetPointsAttr().Get()
    top = max(point[1] for point in points)
    held = [number for number, point in enumerate(points) if point[1] > top - 1e-6]
    prim = stage.DefinePrim("/World/Attachment", "PhysicsAttachment")
    for end, target in enumerate((sim, hand)):
        prim.CreateRelationship(f"physics:src{end}", False).SetTargets([target.GetPath()])
    for name, kind, value in (
        ("type0", Sdf.ValueTypeNames.Token, "point"),
        ("type1", Sdf.ValueTypeNames.Token, "xform"),
        ("indices0", Sdf.ValueTypeNames.IntArray, Vt.IntArray(held)),
        ("coords1", Sdf.ValueTypeNames.Vector3fArray, [Gf.Vec3f(Gf.Vec3d(points[i]) + place - at) for i in held]),
    ):
        prim.CreateAttribute(f"physics:{name}", kind, False).Set(value)


def make_hanging_jelly() -> Usd.Stage:
    """A jelly with a smooth skin hangs from a hand that swings it against a block, over a carpet of smoke."""
    frames = 36
    stage = new_stage("A jelly of tetrahedra, written to the proposed standard, swings against a block.", frames)
    lower, size = (-0.3, 0.0, -0.2), (0.6, 0.6, 0.4)
    add_domain(stage, lower, size, "slip", voxelSize=0.0125, fluidDensity=1.0)
    add_carpet(stage, lower, size)
    place = Gf.Vec3d(-0.1, 0.35, 0.0)
    body = UsdGeom.Xform.Define(stage, "/World/Jelly")
    body.AddTranslateOp().Set(place)
    body.GetPrim().AddAppliedSchema("PhysicsDeformableBodyAPI")
    sim = add_tets(stage, "/World/Jelly/Sim", (4, 8, 4), (0.12, 0.26, 0.12))
    add_rubber(stage, "/World/Rubber", sim.GetPrim(), {"youngsModulus": 2e4, "poissonsRatio": 0.4, "density": 1000.0})
    skin = box_mesh(12, lambda p: Gf.CompMult(p, Gf.Vec3d(0.06, 0.13, 0.06)))
    add_mesh(stage, "/World/Jelly/Skin", skin, (0.2, 0.65, 0.35))
    hand = UsdGeom.Xform.Define(stage, "/World/Hand")
    move = hand.AddTranslateOp()
    start = Gf.Vec3d(-0.1, 0.48, 0.0)
    for frame in range(1, frames + 1):
        swing = eased(frame, 1, 9) - eased(frame, 15, 24)
        move.Set(start + Gf.Vec3d(round(0.13 * swing, 5), 0.0, 0.0), frame)
    hang(stage, sim, place, hand, start)
    block = UsdGeom.Cube.Define(stage, "/World/Block")
    block.CreateSizeAttr(0.14)
    block.CreateExtentAttr([(-0.07,) * 3, (0.07,) * 3])
    block.AddTranslateOp().Set(Gf.Vec3d(0.16, 0.27, 0.0))
    UsdPhysics.CollisionAPI.Apply(block.GetPrim())
    bind_material(stage, block.GetPrim(), (0.3, 0.32, 0.36))
    add_camera(stage, (0.3, 0.45, 1.3), (0.0, 0.3, 0.0))
    return stage


MAKERS = {"hanging_jelly.usda": make_hanging_jelly}
