"""Bad input: a message that names prim, field, value and limit, the right exit code, nothing left behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import author, box, make_scene, without_progress
from eulerfsi.cli import report
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade


def no_mesh(stage: Usd.Stage) -> None:
    UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetPointsAttr().Clear()


def no_file(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Ball").GetAttribute("eulerfsi:surfaceFile").Set("./none.obj")


def not_a_mesh_file(stage: Usd.Stage) -> None:
    Path(stage.GetRootLayer().realPath).with_name("text.obj").write_text("this is no mesh\n")
    stage.GetPrimAtPath("/World/Ball").GetAttribute("eulerfsi:surfaceFile").Set("./text.obj")


def nan_point(stage: Usd.Stage) -> None:
    attribute = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetPointsAttr()
    points = list(attribute.Get())
    points[7] = Gf.Vec3f(float("nan"), 0, 0)
    attribute.Set(points)


def bad_index(stage: Usd.Stage) -> None:
    attribute = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetFaceVertexIndicesAttr()
    attribute.Set([*attribute.Get()[:-1], 9999])


def zero_density(stage: Usd.Stage) -> None:
    UsdPhysics.MassAPI(stage.GetPrimAtPath("/World/Ball")).GetDensityAttr().Set(0.0)


def negative_material_friction(stage: Usd.Stage) -> None:
    material = UsdShade.Material.Define(stage, "/World/Ice")
    UsdPhysics.MaterialAPI.Apply(material.GetPrim()).CreateDynamicFrictionAttr(-0.5)
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/World/Ball")).Bind(material, materialPurpose="physics")


def negative_modulus(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Ball").GetAttribute("eulerfsi:youngsModulus").Set(-5.0)


def small_domain(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Domain").GetAttribute("xformOp:scale").Set(Gf.Vec3d(0.2, 0.7, 0.6))


def outside(stage: Usd.Stage) -> None:
    UsdGeom.Xformable(stage.GetPrimAtPath("/World/Ball")).AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))


def stretch(x: float, y: float, z: float) -> Callable[[Usd.Stage], None]:
    def change(stage: Usd.Stage) -> None:
        attribute = stage.GetPrimAtPath("/World/Ball").CreateAttribute("eulerfsi:stretch", Sdf.ValueTypeNames.Double3)
        attribute.Set(Gf.Vec3d(x, y, z))

    return change


def small_product(stage: Usd.Stage) -> None:
    stretch(0.4, 0.4, 0.4)(stage)


def too_stretched(stage: Usd.Stage) -> None:
    stretch(1.0, 6.0, 1.0)(stage)


def stretched_outside(stage: Usd.Stage) -> None:
    stretch(3.0, 0.5, 1.0)(stage)


def stretched_and_pinned(stage: Usd.Stage) -> None:
    stretch(1.2, 1.0, 1.0)(stage)
    held = UsdGeom.Cube.Define(stage, "/World/Held").GetPrim()
    stage.GetPrimAtPath("/World/Ball").CreateRelationship("eulerfsi:pins", False).SetTargets([held.GetPath()])


def huge_grid(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:voxelSize").Set(0.0001)


def coarse_grid(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:voxelSize").Set(0.5)


def zero_voxel(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:voxelSize").Set(0.0)


def unknown_attribute(stage: Usd.Stage) -> None:
    from pxr import Sdf

    stage.GetPrimAtPath("/World/Ball").CreateAttribute("eulerfsi:youngModulus", Sdf.ValueTypeNames.Double).Set(1.0)


def no_domain(stage: Usd.Stage) -> None:
    stage.RemovePrim("/World/Domain")


def sheared_domain(stage: Usd.Stage) -> None:
    shear = Gf.Matrix4d(1.0)
    shear[1, 0] = 0.5
    UsdGeom.Xformable(stage.GetPrimAtPath("/World/Domain")).AddTransformOp().Set(shear)


def bad_token(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:wallXMin").Set("sticky")


def half_periodic(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:wallXMin").Set("periodic")


def periodic_x(stage: Usd.Stage) -> None:
    for end in ("Min", "Max"):
        stage.GetPrimAtPath("/World/Domain").GetAttribute(f"eulerfsi:wallX{end}").Set("periodic")


def solid_at_a_periodic_face(stage: Usd.Stage) -> None:
    periodic_x(stage)
    UsdGeom.Xformable(stage.GetPrimAtPath("/World/Ball")).AddTranslateOp().Set(Gf.Vec3d(0.11, 0, 0))


def collider_at_a_periodic_face(stage: Usd.Stage) -> None:
    periodic_x(stage)
    box(stage, "/World/Step", (-0.19, -0.4, 0), (0.2, 0.2, 0.2), 1.0, "EulerFsiColliderAPI")


def backward_range(stage: Usd.Stage) -> None:
    stage.SetStartTimeCode(10)


def collider_mesh(stage: Usd.Stage, points: list, counts: list[int], indices: list[int]) -> None:
    floor = UsdGeom.Mesh.Define(stage, "/World/Floor")
    floor.CreatePointsAttr(points)
    floor.CreateFaceVertexCountsAttr(counts)
    floor.CreateFaceVertexIndicesAttr(indices)
    floor.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    floor.GetPrim().ApplyAPI("EulerFsiColliderAPI")


def single_face(stage: Usd.Stage) -> None:
    corners = [(-0.3, -0.4, -0.3), (-0.3, -0.4, 0.3), (0.3, -0.4, 0.3), (0.3, -0.4, -0.3)]
    collider_mesh(stage, corners, [4], [0, 1, 2, 3])


def face_of_a_box(stage: Usd.Stage) -> None:
    """The top, whose other corners are still among the points."""
    corners = [(x, y, z) for x in (-0.3, 0.3) for y in (-0.45, -0.35) for z in (-0.3, 0.3)]
    collider_mesh(stage, corners, [4], [2, 3, 7, 6])


def bent_face(stage: Usd.Stage) -> None:
    """Of four corners that lie in no plane, both sides."""
    corners = [(-0.3, -0.4, -0.3), (-0.3, -0.4, 0.3), (0.3, -0.4, 0.3), (0.3, -0.3, -0.3)]
    collider_mesh(stage, corners, [3] * 4, [0, 1, 2, 0, 2, 3, 2, 1, 0, 3, 2, 0])


def flat_solid(stage: Usd.Stage) -> None:
    ball = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    points = np.array(ball.GetPointsAttr().Get())
    points[:, 1] = 0.0
    ball.GetPointsAttr().Set(points)


def flat_and_closed(stage: Usd.Stage) -> None:
    """Two sides of a sheet that is askew to the axes."""
    sides = [(x, y) for x in (-0.3, 0.0, 0.3) for y in (-0.2, 0.0, 0.2)]
    quads = [(3 * i + j, 3 * i + j + 1, 3 * i + j + 4, 3 * i + j + 3) for i in (0, 1) for j in (0, 1)]
    quads += [quad[::-1] for quad in quads]
    collider_mesh(stage, [(x, y, 0.3 * x + 0.2 * y) for x, y in sides], [4] * 8, [i for quad in quads for i in quad])


def open_terrain(stage: Usd.Stage) -> None:
    sides = np.linspace(-0.3, 0.3, 9)
    hills = [(x, -0.4 + 0.05 * np.sin(9 * x) * np.cos(7 * z), z) for x in sides for z in sides]
    quads = [(9 * i + j, 9 * i + j + 1, 9 * i + j + 10, 9 * i + j + 9) for i in range(8) for j in range(8)]
    collider_mesh(stage, hills, [4] * len(quads), [i for quad in quads for i in quad])


def turning(degrees: float) -> Callable[[Usd.Stage], None]:
    def change(stage: Usd.Stage) -> None:
        """A paddle that turns by this in a frame, the second; before and after that it does not."""
        paddle = UsdGeom.Xformable(
            box(stage, "/World/Paddle", (0.2, -0.4, 0.2), (0.12, 0.1, 0.1), 1.0, "EulerFsiColliderAPI")
        )
        move, scale = paddle.GetOrderedXformOps()
        turn = paddle.AddRotateYOp()
        paddle.SetXformOpOrder([move, turn, scale])
        for frame, angle in ((2, 0.0), (3, degrees)):
            turn.Set(angle, frame)

    return change


def half_turn(stage: Usd.Stage) -> None:
    turning(180.0)(stage)


def full_turn(stage: Usd.Stage) -> None:
    turning(-360.0)(stage)


def many_turns(stage: Usd.Stage) -> None:
    turning(3600.0)(stage)


def half_turn_by_matrices(stage: Usd.Stage) -> None:
    """USD mixes the matrices: halfway between them there is no rotation."""
    paddle = UsdGeom.Xformable(box(stage, "/World/Paddle", (0, 0, 0), (0.12, 0.1, 0.1), 1.0, "EulerFsiColliderAPI"))
    own = paddle.GetLocalTransformation()
    paddle.SetXformOpOrder([])
    place = paddle.AddTransformOp()
    for frame, angle in ((1, 0.0), (2, 180.0)):
        turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), angle))
        place.Set(own * turn * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0.2, -0.4, 0.2)), frame)


def turning_pin(stage: Usd.Stage) -> None:
    held = UsdGeom.Cube.Define(stage, "/World/Held")
    held.CreateSizeAttr(0.1)
    turn = held.AddRotateZOp()
    turn.Set(0.0, 1)
    turn.Set(200.0, 2)
    stage.GetPrimAtPath("/World/Ball").GetRelationship("eulerfsi:pins").SetTargets([held.GetPath()])


CASES = {
    backward_range: ["stage startTimeCode = 10: must be at most endTimeCode = 3", "exchange them"],
    single_face: ["/World/Floor.points = 4 points in one plane (1 face)", "a volume", "use a Plane"],
    face_of_a_box: ["/World/Floor.points = 4 points in one plane (1 face)", "use a Plane", "give the mesh a thickness"],
    bent_face: ["/World/Floor: it encloses no volume; use a Plane for a floor or a wall, or give the mesh a thickness"],
    flat_solid: ["/World/Ball: it encloses no volume; give it a thickness"],
    flat_and_closed: ["/World/Floor.points = 9 points in one plane (8 faces)", "use a Plane"],
    open_terrain: ["/World/Floor: the mesh has 32 open edges: must be 0", "use a Plane"],
    half_turn: ["/World/Paddle.xformOpOrder = a turn by 180 degrees from frame 2 to 3", "time samples further apart"],
    full_turn: ["/World/Paddle.xformOpOrder = a turn by 360 degrees from frame 2 to 3", "less than half a turn"],
    many_turns: ["/World/Paddle.xformOpOrder = a turn by 3600 degrees from frame 2 to 3"],
    half_turn_by_matrices: ["/World/Paddle.xformOpOrder = a turn by 180 degrees from frame 1 to 2"],
    turning_pin: ["/World/Held.xformOpOrder = a turn by 200 degrees from frame 1 to 2"],
    no_mesh: ["/World/Ball", "points"],
    no_file: ["/World/Ball", "surfaceFile", "none.obj"],
    not_a_mesh_file: ["/World/Ball", "text.obj"],
    nan_point: ["/World/Ball", "points[7]", "nan", "finite"],
    bad_index: ["/World/Ball", "faceVertexIndices", "9999"],
    zero_density: ["/World/Ball", "physics:density", "0", "> 0"],
    negative_material_friction: ["/World/Ice.physics:dynamicFriction", "-0.5", ">= 0"],
    negative_modulus: ["/World/Ball", "youngsModulus", "-5", "> 0"],
    small_domain: ["/World/Ball", "/World/Domain", "0.2"],
    small_product: ["/World/Ball: eulerfsi:stretch = (0.4, 0.4, 0.4)", "0.064", "a product from 0.1 to 10"],
    too_stretched: ["/World/Ball", "eulerfsi:stretch", "6", "5"],
    stretched_outside: ["/World/Ball", "inside the domain /World/Domain"],
    stretched_and_pinned: ["/World/Ball: eulerfsi:stretch = (1.2, 1, 1)", "for a solid that is pinned"],
    outside: ["/World/Ball", "inside the domain /World/Domain"],
    huge_grid: ["/World/Domain", "voxelSize = 0.0001", "needs", "iB of memory", "fits"],
    coarse_grid: ["/World/Domain", "voxelSize", "0.5"],
    zero_voxel: ["/World/Domain", "voxelSize", "= 0", "> 0"],
    unknown_attribute: ["/World/Ball", "youngModulus", "did you mean", "youngsModulus"],
    no_domain: ["EulerFsiDomainAPI"],
    sheared_domain: ["/World/Domain", "shear"],
    bad_token: ["/World/Domain", "wallXMin", "sticky", "slip, noSlip, open, periodic"],
    solid_at_a_periodic_face: ["/World/Ball: the solid", "0.26 to 0.56", "wallXMax of /World/Domain", "0.05 to 0.55"],
    collider_at_a_periodic_face: ["/World/Step: the collider", "0.01 to 0.21", "wallXMin of /World/Domain"],
    half_periodic: ["/World/Domain", "wallXM", "periodic"],
}


@pytest.mark.parametrize("command", ["simulate", "validate"])
@pytest.mark.parametrize("change", CASES, ids=lambda change: change.__name__)
def test_bad_scene_exits_with_3_names_the_fault_and_leaves_nothing(cli, tmp_path, change, command):
    stage = make_scene(tmp_path / "bad.usda")
    change(stage)
    stage.GetRootLayer().Save()
    before = {p.name for p in tmp_path.iterdir()}
    done = cli(command, "bad.usda")
    assert done.returncode == 3, done.stdout + done.stderr
    for word in CASES[change]:
        assert word in done.stderr, done.stderr
    assert without_progress(done.stderr).startswith("error: ") and "Traceback" not in done.stderr
    assert {p.name for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize("degrees", [170.0, -170.0])
def test_less_than_half_a_turn_in_a_frame_is_sound(cli, tmp_path, degrees):
    stage = make_scene(tmp_path / "turn.usda", smoke=False)
    turning(degrees)(stage)
    stage.GetRootLayer().Save()
    done = cli("validate", "turn.usda")
    assert done.returncode == 0 and "warning" not in done.stdout, done.stderr


def test_several_faults_are_told_together(cli, tmp_path):
    stage = make_scene(tmp_path / "bad.usda")
    zero_density(stage)
    bad_token(stage)
    stage.GetRootLayer().Save()
    done = cli("simulate", "bad.usda")
    assert done.returncode == 3 and "physics:density" in done.stderr and "wallXMin" in done.stderr


def test_suggested_voxel_size_does_fit(cli, tmp_path, monkeypatch):
    make_scene(tmp_path / "bad.usda")
    monkeypatch.setattr(report, "available_memory", lambda: 100 * 2**20)
    done = cli("validate", "bad.usda", "--set", "Domain.voxelSize=0.001")
    assert done.returncode == 3 and "100.0 MiB" in done.stderr
    fitting = float(done.stderr.split("eulerfsi:voxelSize = ")[-1].split(" fits")[0])
    assert 0.002 < fitting < 0.02
    assert cli("validate", "bad.usda", "--set", f"Domain.voxelSize={fitting}").returncode == 0
    assert cli("validate", "bad.usda", "--set", f"Domain.voxelSize={0.9 * fitting}").returncode == 3


def test_thin_feature_is_a_warning_with_the_voxel_size_that_resolves_it(cli, tmp_path):
    make_scene(tmp_path / "thin.usda", smoke=False)
    done = cli("validate", "thin.usda", "--set", "Domain.voxelSize=0.2")
    assert done.returncode == 0, done.stderr
    warning = next(line for line in done.stdout.splitlines() if line.startswith("warning: /World/Ball"))
    assert "two voxels" in warning
    resolving = float(warning.split("eulerfsi:voxelSize = ")[1].split()[0])
    again = cli("validate", "thin.usda", "--set", f"Domain.voxelSize={0.9 * resolving}")
    assert again.returncode == 0 and "thinnest feature is" not in again.stdout


def test_pieces_that_do_not_touch_are_told_of_once(cli, tmp_path):
    stage = make_scene(tmp_path / "two.usda", smoke=False)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    points, counts, indices = (
        np.array(attribute.Get())
        for attribute in (mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
    )
    apart = [points * 0.5 + (x, 0.0, 0.0) for x in (-0.1, 0.1)]
    mesh.GetPointsAttr().Set(np.concatenate(apart))
    mesh.GetFaceVertexCountsAttr().Set(np.tile(counts, 2))
    mesh.GetFaceVertexIndicesAttr().Set(np.concatenate([indices, indices + len(points)]))
    UsdGeom.PrimvarsAPI(mesh).RemovePrimvar("st")
    stage.GetRootLayer().Save()
    warning = "warning: /World/Ball: the mesh has 2 pieces that do not touch: must be one: give each piece a prim"
    assert cli("validate", "two.usda").stdout.count(warning) == 1
    assert cli("simulate", "two.usda", "--frames", "1-2").stderr.count(warning) == 1
    mesh.GetPointsAttr().Set(np.concatenate([points, points * 0.5]))  # one inside the other
    stage.GetRootLayer().Save()
    assert "pieces" not in cli("validate", "two.usda").stdout


def test_a_compressible_solid_without_room_is_told_of(cli, tmp_path):
    stage = make_scene(tmp_path / "foam.usda", smoke=False)
    author(stage.GetPrimAtPath("/World/Ball"), compressible=True)
    stage.GetRootLayer().Save()
    warning = (
        "warning: /World/Ball: eulerfsi:compressible = true: should be false in a box of fluid without an open face"
    )
    assert cli("validate", "foam.usda").stdout.count(warning) == 1
    for way_out in ("Domain.wallYMax=open", "Domain.ambientFluid=false", "Ball.compressible=false"):
        done = cli("validate", "foam.usda", "--set", way_out)
        assert done.returncode == 0 and "compressible" not in done.stdout, done.stdout


def test_open_mesh_is_closed_with_a_warning_that_names_the_hole(cli, tmp_path):
    stage = make_scene(tmp_path / "open.usda", smoke=False)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    counts, indices = mesh.GetFaceVertexCountsAttr().Get(), mesh.GetFaceVertexIndicesAttr().Get()
    mesh.GetFaceVertexCountsAttr().Set(counts[3:])
    mesh.GetFaceVertexIndicesAttr().Set(indices[sum(counts[:3]) :])
    stage.GetRootLayer().Save()
    done = cli("simulate", "open.usda", "--frames", "1-2")
    assert done.returncode == 0, done.stderr
    assert "warning: /World/Ball" in done.stderr and "1 hole, the largest" in done.stderr
    assert done.stderr.count("1 hole") == 1  # told once
    volume = float(done.stderr.split("taken as a solid of volume ")[1].split()[0])
    assert 0.9 * 0.01357 < volume < 0.01357
    assert "hole" in (tmp_path / "open_cache/log").read_text()


@pytest.mark.parametrize("inside", ["", "deep/er"])
def test_output_to_a_link_to_nothing_exits_with_5_and_makes_nothing(cli, tmp_path, inside):
    make_scene(tmp_path / "small.usda")
    (tmp_path / "link").symlink_to(tmp_path / "disk/that/is/not/there")
    done = cli("simulate", "small.usda", "-o", tmp_path / "link" / inside)
    assert done.returncode == 5 and f"link is a link to {tmp_path / 'disk/that/is/not/there'}" in done.stderr
    assert "choose another with -o" in done.stderr and not (tmp_path / "disk").exists()


@pytest.mark.parametrize("kind", ["file in the way", "read-only file system"])
def test_output_that_cannot_be_written_exits_with_5(cli, tmp_path, kind):
    make_scene(tmp_path / "small.usda")
    if kind == "file in the way":
        (tmp_path / "file").write_text("a file")
        target = tmp_path / "file" / "cache"
    else:
        target = Path("/proc/eulerfsi/cache")
    done = cli("simulate", "small.usda", "-o", target)
    assert done.returncode == 5
    assert "output folder" in done.stderr and str(target) in done.stderr


def test_scene_that_is_missing_or_no_usd_exits_with_3(cli, tmp_path):
    missing = cli("simulate", "none.usda")
    assert missing.returncode == 3 and "none.usda: no such file" in missing.stderr
    (tmp_path / "text.usda").write_text("not USD")
    text = cli("simulate", "text.usda")
    assert text.returncode == 3 and "text.usda" in text.stderr and "Traceback" not in text.stderr


def test_stage_without_a_range_asks_for_frames(cli, tmp_path):
    stage = make_scene(tmp_path / "range.usda")
    stage.GetRootLayer().pseudoRoot.ClearInfo("startTimeCode")
    stage.GetRootLayer().pseudoRoot.ClearInfo("endTimeCode")
    stage.GetRootLayer().Save()
    done = cli("simulate", "range.usda")
    assert done.returncode == 3 and "--frames" in done.stderr


def test_voxels_that_no_continuum_has_are_refused(cli, scene):
    refused = cli("validate", scene, "--set", "Domain.voxelSize=1e-8")
    assert refused.returncode == 3
    assert "/World/Domain: eulerfsi:voxelSize = 1e-08: must be between 1e-06 and 1e+06" in refused.stderr
