"""Scenes that run and of which something has no effect, or another than one sees: told once, with prim and remedy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import box, make_scene
from eulerfsi.scene.idle import _solid_angles
from eulerfsi.solver.simulation import Mesh
from eulerfsi_usd.gprims import surface_of
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdShade


def block(stage: Usd.Stage, size: float = 0.2) -> Usd.Prim:
    return box(stage, "/World/Block", (0.2, -0.3, 0.2), (size, size, size), 1.0, "EulerFsiColliderAPI")


def jet(stage: Usd.Stage, size: float = 0.1, x: float = 0.2) -> Usd.Prim:
    return box(stage, "/World/Jet", (x, -0.3, 0.2), (size, size, size), 1.0, "EulerFsiEmitterAPI")


def emitter_in_a_collider(stage: Usd.Stage) -> None:
    block(stage)
    jet(stage)


def emitter_as_large_as_a_collider(stage: Usd.Stage) -> None:
    block(stage)
    jet(stage, 0.2)


def emitter_half_outside_the_box(stage: Usd.Stage) -> None:
    """What of it lies in the box lies in the collider."""
    block(stage, 0.1999)
    jet(stage, 0.18, 0.28)


def mesh_emitter_in_a_collider(stage: Usd.Stage) -> None:
    block(stage)
    points, counts, indices = surface_of(UsdGeom.Sphere.Define(stage, "/World/Ball2").GetPrim(), Usd.TimeCode(1))
    stage.RemovePrim("/World/Ball2")
    ball = UsdGeom.Mesh.Define(stage, "/World/Jet")
    ball.CreatePointsAttr(0.08 * points + (0.2, -0.3, 0.2))
    ball.CreateFaceVertexCountsAttr(counts)
    ball.CreateFaceVertexIndicesAttr(indices)
    ball.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    ball.GetPrim().ApplyAPI("EulerFsiEmitterAPI")


def hand(stage: Usd.Stage, path: str, way: float) -> UsdGeom.Cube:
    held = UsdGeom.Cube.Define(stage, path)
    held.CreateSizeAttr(0.1)
    move = held.AddTranslateOp()
    for frame, x in ((1, 0.0), (3, way)):
        move.Set(Gf.Vec3d(x, 0.1, 0.0), frame)
    return held


def pin_out_of_the_box(stage: Usd.Stage) -> None:
    held = hand(stage, "/World/Hold", 0.5)
    stage.GetPrimAtPath("/World/Ball").GetRelationship("eulerfsi:pins").SetTargets([held.GetPath()])


def pinned_vertices_out_of_the_box(stage: Usd.Stage) -> None:
    ball = stage.GetPrimAtPath("/World/Ball")
    pin = UsdGeom.PrimvarsAPI(ball).CreatePrimvar("eulerfsi:pin", Sdf.ValueTypeNames.FloatArray, "vertex")
    pin.Set([float(y > 0.1) for _, y, _ in UsdGeom.Mesh(ball).GetPointsAttr().Get()])
    ball.GetRelationship("eulerfsi:pinTo").SetTargets([hand(stage, "/World/Hold", 0.5).GetPath()])


def physics_colliders(stage: Usd.Stage) -> None:
    for number in range(5):
        part = UsdGeom.Cube.Define(stage, f"/World/Part{number}")
        part.CreateSizeAttr(0.08)
        part.AddTranslateOp().Set((-0.2 + 0.1 * number, -0.4, 0.2))
        UsdPhysics.CollisionAPI.Apply(part.GetPrim())
        UsdPhysics.RigidBodyAPI.Apply(part.GetPrim())
    UsdPhysics.CollisionAPI(stage.GetPrimAtPath("/World/Part3")).CreateCollisionEnabledAttr(False)
    for prim in (block(stage), stage.GetPrimAtPath("/World/Ball")):
        UsdPhysics.CollisionAPI.Apply(prim)


def missing_textures(stage: Usd.Stage) -> None:
    folder = Path(stage.GetRootLayer().realPath).parent
    for name in ("there.png", "tile.1001.png"):
        (folder / name).touch()
    for name in ("there.png", "none.png", "tile.<UDIM>.png", "no.<UDIM>.png"):
        shader = UsdShade.Shader.Define(stage, f"/World/Skin/{Tf.MakeValidIdentifier(name)}")
        shader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{name}")


def material_x(stage: Usd.Stage) -> None:
    (Path(stage.GetRootLayer().realPath).parent / "skin.mtlx").write_text('<?xml version="1.0"?><materialx/>')
    prim = Sdf.CreatePrimInLayer(stage.GetRootLayer(), "/World/Skins")
    prim.referenceList.Prepend(Sdf.Reference("./skin.mtlx", "/MaterialX"))


def thin_colliders(stage: Usd.Stage) -> None:
    for number in range(2):
        box(
            stage,
            f"/World/Shelf{number}",
            (0.0, -0.3, -0.2 + 0.4 * number),
            (0.3, 0.06, 0.1),
            1.0,
            "EulerFsiColliderAPI",
        )


CASES = {
    thin_colliders: [
        "/World/Shelf0, /World/Shelf1: the thinnest feature is 0.0",
        "must be at least 1.5 voxels of 0.05, or solids may fall through",
    ],
    emitter_in_a_collider: ["/World/Jet: the whole region of the emitter lies inside /World/Block", "move it"],
    emitter_as_large_as_a_collider: ["/World/Jet: the whole region of the emitter lies inside /World/Block"],
    emitter_half_outside_the_box: ["/World/Jet: the whole region of the emitter lies inside /World/Block"],
    mesh_emitter_in_a_collider: ["/World/Jet: the whole region of the emitter lies inside /World/Block"],
    pin_out_of_the_box: ["/World/Ball: frame 3: the volume of its pin /World/Hold is moved out of the box", "larger"],
    pinned_vertices_out_of_the_box: [
        "/World/Ball: frame 3: its pinned vertices are moved out of the box by /World/Hold"
    ],
    physics_colliders: [
        "/World/Part0, /World/Part1, /World/Part2 and 1 more: a collider here, but nothing acts on it",
        "physics:kinematicEnabled",
    ],
    missing_textures: ["inputs:file: no such file: @./none.png@, @./no.<UDIM>.png@:"],
    material_x: ["/World/Skins: reference @", "skin.mtlx@: is left out: USD has no plug-in"],
}


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("change", CASES, ids=lambda change: change.__name__)
def test_it_is_told_once_and_the_scene_runs(cli, tmp_path, change: Callable[[Usd.Stage], None]) -> None:
    stage = make_scene(tmp_path / "odd.usda", smoke=False)
    change(stage)
    stage.GetRootLayer().Save()
    told = [line for line in cli("validate", "odd.usda").stdout.splitlines() if line.startswith("warning: ")]
    assert len(told) == 1 and all(word in told[0] for word in CASES[change]), told
    done = cli("simulate", "odd.usda")
    assert done.returncode == 0 and done.stderr.count(told[0]) == 1, done.stderr
    assert told[0].removeprefix("warning: ") in (tmp_path / "odd_cache/log").read_text()


def sound(stage: Usd.Stage) -> None:
    """An emitter that a collider leaves a part of, one in a collider that moves away, a pin that stays in the box."""
    jet(stage)
    block(stage, 0.09)
    box(stage, "/World/Puff", (-0.2, -0.3, -0.2), (0.06, 0.06, 0.06), 1.0, "EulerFsiEmitterAPI")
    lid = box(stage, "/World/Lid", (-0.2, -0.3, -0.2), (0.1, 0.1, 0.1), 1.0, "EulerFsiColliderAPI")
    lid.GetAttribute("xformOp:translate").Set(Gf.Vec3d(-0.2, -0.3, -0.2), 1)
    lid.GetAttribute("xformOp:translate").Set(Gf.Vec3d(-0.1, -0.3, -0.2), 3)
    held = hand(stage, "/World/Hold", 0.1)
    stage.GetPrimAtPath("/World/Ball").GetRelationship("eulerfsi:pins").SetTargets([held.GetPath()])


def test_what_acts_is_not_told_of(cli, tmp_path) -> None:
    stage = make_scene(tmp_path / "sound.usda", smoke=False)
    sound(stage)
    stage.GetRootLayer().Save()
    done = cli("validate", "sound.usda")
    assert done.returncode == 0 and "warning" not in done.stdout, done.stdout + done.stderr


def test_the_solid_angle_of_a_closed_surface_is_a_sphere_inside_and_nothing_outside() -> None:
    stage = Usd.Stage.CreateInMemory()
    mesh = Mesh(*surface_of(UsdGeom.Cone.Define(stage, "/Cone").GetPrim(), Usd.TimeCode(1)))
    corners = mesh.points[mesh.triangles()].astype(float)
    angles = _solid_angles(corners, np.array([(0.0, 0.0, 0.0), (0.9, 0.0, -0.99), (0.9, 0.0, 0.9), (0.0, 0.0, 3.0)]))
    assert np.allclose(angles / (4.0 * np.pi), [1.0, 1.0, 0.0, 0.0], atol=1e-6)
