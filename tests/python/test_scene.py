"""Reading scenes: units, spaces, precedence, transforms, overrides, the copied scene."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import author, box, make_scene, sphere, write_obj
from eulerfsi.cache.localize import localize_scene
from eulerfsi.errors import SceneError, UsageError
from eulerfsi.frames import FrameRange, parse_frames
from eulerfsi.parameters import StageUnits, table
from eulerfsi.scene.overrides import apply_overrides
from eulerfsi.scene.read import read_scene
from eulerfsi.scene.space import domain_space, orthonormal_rows
from eulerfsi.solver import binding
from eulerfsi_usd import checks
from eulerfsi_usd.transforms import frames_of
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdUtils

pytestmark = pytest.mark.usefixtures("library")


def read(stage: Usd.Stage, path: Path, **kwargs):
    return read_scene(stage, path, **kwargs)


@pytest.mark.parametrize(
    ("unit", "expected"),
    [("", 1.0), ("m^1", 0.01), ("kg^1 m^-3", 1000 / 0.01**3), ("degrees", math.pi / 180), ("local", 1.0)],
)
def test_stage_unit_becomes_a_factor(unit, expected):
    assert StageUnits(0.01, 1000.0).factor(unit) == pytest.approx(expected)


def test_every_stage_unit_of_the_table_is_understood():
    for scope in table().values():
        for row in scope.values():
            assert StageUnits(1.0, 1.0).factor(row.stage_unit) > 0


@pytest.mark.parametrize(
    "stage_facts",
    [
        {},
        {"meters_per_unit": 0.01},
        {"meters_per_unit": 0.01, "kilograms_per_unit": 0.001, "up": "Z"},
        {"parent": Gf.Matrix4d().SetScale(3.0) * Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 2, 3), 40.0))},
        {"parent": Gf.Matrix4d().SetTranslate(Gf.Vec3d(1000, 5, -7))},
    ],
)
def test_the_same_scene_in_other_units_and_axes_is_the_same_simulation(tmp_path, stage_facts):
    first = read(make_scene(tmp_path / "a.usda"), tmp_path / "a.usda")
    other = read(make_scene(tmp_path / "b.usda", **stage_facts), tmp_path / "b.usda")
    for key, value in first.domain.items():
        np.testing.assert_allclose(other.domain[key], value, rtol=1e-5, atol=2e-6, err_msg=key)
    for key, value in first.solids[0].values.items():
        np.testing.assert_allclose(other.solids[0].values[key], value, rtol=1e-5, atol=2e-6, err_msg=key)
    for key, value in first.emitters[0].values.items():
        np.testing.assert_allclose(other.emitters[0].values[key], value, rtol=1e-5, atol=2e-6, err_msg=key)
    np.testing.assert_allclose(other.solids[0].mesh.points, first.solids[0].mesh.points, atol=1e-6)


def test_simulation_space_and_world_are_inverse(tmp_path):
    parent = Gf.Matrix4d().SetScale(2.0) * Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 1, 0), 70.0))
    stage = make_scene(tmp_path / "a.usda", meters_per_unit=0.01, parent=parent)
    scene = read(stage, tmp_path / "a.usda")
    prim = stage.GetPrimAtPath("/World/Ball")
    to_world = UsdGeom.XformCache(1).GetLocalToWorldTransform(prim)
    expected = np.array([to_world.Transform(Gf.Vec3d(p)) for p in UsdGeom.Mesh(prim).GetPointsAttr().Get()])
    np.testing.assert_allclose(scene.space.point_to_world(scene.solids[0].mesh.points), expected, atol=1e-4)
    matrix = scene.space.to_world_matrix()
    homogeneous = np.c_[scene.solids[0].mesh.points, np.ones(len(expected))]
    np.testing.assert_allclose((homogeneous @ matrix.T)[:, :3], expected, atol=1e-4)


def test_domain_size_is_the_cubes_with_its_scale_and_whole_voxels(tmp_path):
    scene = read(make_scene(tmp_path / "a.usda", meters_per_unit=0.01, voxel=0.005), tmp_path / "a.usda")
    count = np.array(scene.domain["domain_size"]) / scene.domain["voxel_size"]
    np.testing.assert_array_equal(np.ceil(count - 1e-6), (120, 140, 120))


def test_xform_domain_uses_its_size_attribute(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    stage.RemovePrim("/World/Domain")
    xform = UsdGeom.Xform.Define(stage, "/World/Domain")
    xform.GetPrim().ApplyAPI("EulerFsiDomainAPI")
    author(xform.GetPrim(), voxelSize=0.05, size=Gf.Vec3d(1.0, 2.0, 1.5))
    scene = read(stage, tmp_path / "a.usda")
    np.testing.assert_allclose(scene.domain["domain_size"], (1.0, 2.0, 1.5))
    np.testing.assert_allclose(scene.domain["domain_min"], (-0.5, -1.0, -0.75))


def test_sheared_domain_is_an_error_with_its_prim():
    with pytest.raises(SceneError, match="/World/Box.*sheared"):
        domain_space("/World/Box", np.array([[1, 0, 0, 0], [0.5, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), 1.0)


def test_mirrored_domain_is_the_same_box_with_the_x_walls_swapped(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    domain = stage.GetPrimAtPath("/World/Domain")
    domain.GetAttribute("xformOp:scale").Set(Gf.Vec3d(-0.6, 0.7, 0.6))
    author(domain, wallXMin="open", wallXMax="slip")
    scene = read(stage, tmp_path / "a.usda")
    assert np.linalg.det(scene.space.axes) == pytest.approx(1.0)
    np.testing.assert_allclose(scene.space.axes, np.eye(3))
    # The prim's own -x face lies at the world's largest x.
    assert scene.domain["wall[0]"] == binding.WALLS["slip"] and scene.domain["wall[1]"] == binding.WALLS["open"]


def test_orthonormal_rows_keep_rotations_and_handedness():
    turn = np.array(Gf.Matrix3d(Gf.Rotation(Gf.Vec3d(1, 2, 3), 33)))
    np.testing.assert_allclose(orthonormal_rows(turn), turn, atol=1e-12)
    np.testing.assert_allclose(orthonormal_rows(-turn * 5), -turn, atol=1e-12)


def test_gravity_is_981_down_without_a_physics_scene_or_value(tmp_path):
    stage = make_scene(tmp_path / "a.usda", meters_per_unit=0.01)
    prim = stage.GetPrimAtPath("/World/PhysicsScene")
    np.testing.assert_allclose(read(stage, tmp_path / "a.usda").domain["gravity"], (0, -9.8, 0), rtol=1e-6)
    for name in ("physics:gravityDirection", "physics:gravityMagnitude"):
        prim.GetAttribute(name).Clear()  # (0,0,0) and -inf
    np.testing.assert_allclose(read(stage, tmp_path / "a.usda").domain["gravity"], (0, -9.81, 0))
    stage.RemovePrim(prim.GetPath())
    np.testing.assert_allclose(read(stage, tmp_path / "a.usda").domain["gravity"], (0, -9.81, 0))


def test_unauthored_values_are_the_tables_in_si(tmp_path):
    stage = make_scene(tmp_path / "a.usda", meters_per_unit=0.01)
    domain = stage.GetPrimAtPath("/World/Domain")
    for name in ("voxelSize", "fluidDensity"):
        domain.GetAttribute(f"eulerfsi:{name}").Clear()
    scene = read(stage, tmp_path / "a.usda")
    assert scene.domain["voxel_size"] == table()["domain"]["voxelSize"].default
    assert scene.domain["fluid_density"] == 1.0


def test_gravity_is_that_of_the_first_frame_and_its_animation_a_warning(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    magnitude = stage.GetPrimAtPath("/World/PhysicsScene").GetAttribute("physics:gravityMagnitude")
    magnitude.Clear()
    magnitude.Set(3.0, 1.0)
    magnitude.Set(5.0, 3.0)
    scene = read(stage, tmp_path / "a.usda")
    assert scene.domain["gravity"] == pytest.approx([0.0, -3.0, 0.0])
    told = [issue.message for issue in scene.warnings if issue.code == "Animated"]
    assert len(told) == 1 and "/World/PhysicsScene.physics:gravityMagnitude = animated" in told[0]


def test_density_precedence_is_mass_then_density_then_material_then_1000(tmp_path):
    stage = make_scene(tmp_path / "a.usda", meters_per_unit=0.01)
    prim = stage.GetPrimAtPath("/World/Ball")

    def density() -> float:
        return read(stage, tmp_path / "a.usda").solids[0].values["density"]

    prim.GetAttribute("physics:density").Clear()
    assert density() == 1000.0
    material = UsdShade.Material.Define(stage, "/World/Rubber")
    UsdPhysics.MaterialAPI.Apply(material.GetPrim()).CreateDensityAttr(700e-6)
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, materialPurpose="physics")
    assert density() == pytest.approx(700.0, rel=1e-6)
    prim.GetAttribute("physics:density").Set(500e-6)
    assert density() == pytest.approx(500.0, rel=1e-6)
    volume = read(stage, tmp_path / "a.usda").solids[0].report["solid_volume"]
    UsdPhysics.MassAPI(prim).CreateMassAttr(3.0)
    assert density() == pytest.approx(3.0 / volume, rel=1e-6)
    UsdPhysics.MassAPI(prim).GetMassAttr().Set(0.0)  # UsdPhysics: not given
    assert density() == pytest.approx(500.0, rel=1e-6)
    prim.GetAttribute("physics:density").Clear()
    prim.GetAttribute("physics:density").Set(400e-6, 1.0)  # time samples alone: that of the first frame
    assert not [issue for issue in checks.check_stage(stage) if issue.severity == "error"]
    assert density() == pytest.approx(400.0, rel=1e-6)


def test_friction_precedence_is_own_then_dynamic_then_static_of_the_material_then_0(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    ball, floor = stage.GetPrimAtPath("/World/Ball"), UsdGeom.Cube.Define(stage, "/World/Floor").GetPrim()
    floor.ApplyAPI("EulerFsiColliderAPI")
    UsdGeom.Xformable(floor).AddTranslateOp().Set((0.0, -2.0, 0.0))

    def friction() -> tuple[float, float]:
        scene = read(stage, tmp_path / "a.usda")
        return scene.solids[0].values["friction"], scene.colliders[0].values["friction"]

    assert friction() == (0.0, 0.0)
    for prim, name in ((ball, "Rubber"), (floor, "Wood")):
        material = UsdShade.Material.Define(stage, f"/World/{name}")
        UsdPhysics.MaterialAPI.Apply(material.GetPrim())
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, materialPurpose="physics")
    assert friction() == (0.0, 0.0)  # nothing is authored: the fallback of the schema is 0, too
    rubber, wood = (UsdPhysics.MaterialAPI.Get(stage, f"/World/{name}") for name in ("Rubber", "Wood"))
    rubber.CreateStaticFrictionAttr(0.75)
    wood.CreateStaticFrictionAttr(0.5)
    assert friction() == (0.75, 0.5)
    rubber.CreateDynamicFrictionAttr(0.625)
    assert friction() == (0.625, 0.5)
    ball.GetAttribute("eulerfsi:friction").Set(0.25)
    assert friction() == (0.25, 0.5)
    ball.GetAttribute("eulerfsi:friction").Set(0.0)
    assert friction() == (0.0, 0.5)


def test_rigid_body_velocity_is_local_and_gives_way_to_the_own_attribute(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    prim = stage.GetPrimAtPath("/World/Ball")
    UsdGeom.Xformable(prim).AddRotateZOp().Set(90.0)  # local x is world y
    body = UsdPhysics.RigidBodyAPI.Apply(prim)
    body.CreateVelocityAttr(Gf.Vec3f(3, 0, 0))
    body.CreateAngularVelocityAttr(Gf.Vec3f(180, 0, 0))
    np.testing.assert_allclose(read(stage, tmp_path / "a.usda").solids[0].values["velocity"], (0, -2, 0), atol=1e-6)
    prim.GetAttribute("eulerfsi:velocity").Clear()
    values = read(stage, tmp_path / "a.usda").solids[0].values
    np.testing.assert_allclose(values["velocity"], (0, 3, 0), atol=1e-6)
    np.testing.assert_allclose(values["angular_velocity"], (0, math.pi, 0), atol=1e-6)


def test_mirrored_and_left_handed_meshes_keep_their_inside(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    volume = read(stage, tmp_path / "a.usda").solids[0].report["surface_volume"]
    assert volume > 0
    mesh.AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))
    assert read(stage, tmp_path / "a.usda").solids[0].report["surface_volume"] == pytest.approx(volume, rel=1e-5)
    mesh.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)  # now the faces say the opposite
    assert read(stage, tmp_path / "a.usda").solids[0].report["surface_volume"] == pytest.approx(-volume, rel=1e-5)


def test_surface_file_is_the_surface_in_local_space(tmp_path):
    stage = make_scene(tmp_path / "a.usda", meters_per_unit=0.01)
    write_obj(tmp_path / "ball.obj", 15.0)
    stage.RemovePrim("/World/Ball")
    xform = UsdGeom.Xform.Define(stage, "/World/Part")
    xform.AddTranslateOp().Set(Gf.Vec3d(5, 0, 0))
    xform.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    xform.GetPrim().GetAttribute("eulerfsi:surfaceFile").Set("./ball.obj")
    solid = read(stage, tmp_path / "a.usda").solids[0]
    assert solid.output_path == "/World/Part/surface" and solid.subdivision == "none"
    center = (solid.mesh.points.min(axis=0) + solid.mesh.points.max(axis=0)) / 2
    np.testing.assert_allclose(center, (0.05, 0.15, 0), atol=1e-6)  # the domain's centre is the origin
    assert np.ptp(solid.mesh.points[:, 0]) == pytest.approx(0.3, rel=1e-4)


def test_emitter_regions_are_the_image_of_unit_box_and_ball(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    ball = UsdGeom.Sphere.Define(stage, "/World/Source")
    ball.CreateRadiusAttr(0.1)
    ball.AddTranslateOp().Set(Gf.Vec3d(0.1, -0.15, 0))
    ball.GetPrim().ApplyAPI("EulerFsiEmitterAPI")
    author(ball.GetPrim(), velocity=Gf.Vec3d(0, 1, 0), emitVelocity=True)
    scene = read(stage, tmp_path / "a.usda")
    carpet, source = (np.reshape(e.values["transform"], (4, 4)) for e in scene.emitters)
    np.testing.assert_allclose(carpet @ (0.5, 0.5, 0.5, 1), (0.3, -0.15, 0.3, 1), atol=1e-12)
    np.testing.assert_allclose(source @ (0.5, 0, 0, 1), (0.2, 0, 0, 1), atol=1e-12)
    assert scene.emitters[1].values["shape"] == binding.REGION_SHAPES["sphere"]
    assert scene.emitters[1].values["has_velocity"] == 1


def test_a_force_is_on_while_its_samples_are_and_in_world_axes(tmp_path):
    stage = make_scene(tmp_path / "a.usda", meters_per_unit=0.01, up="Z")
    region = UsdGeom.Sphere.Define(stage, "/World/Gust")
    region.CreateRadiusAttr(20.0)
    region.GetPrim().ApplyAPI("EulerFsiForceAPI")
    author(region.GetPrim(), kind="wind", actsOn="solids", windVelocity=Gf.Vec3d(0, 0, 150), noiseSize=5.0, endTime=0.3)
    enabled = region.GetPrim().GetAttribute("eulerfsi:enabled")
    for time, on in ((0, True), (3, False), (6, True), (7, True), (20, False)):
        enabled.Set(on, time)
    scene = read(stage, tmp_path / "a.usda")
    first, second = scene.forces
    assert (first.path, second.path) == ("/World/Gust", "/World/Gust (2)")
    times = [(f.values["start_time"], f.values["end_time"]) for f in scene.forces]
    assert times == [(0.0, pytest.approx(2 / 24)), (pytest.approx(5 / 24), pytest.approx(0.3))]
    assert first.values["kind"] == binding.FORCE_KINDS["wind"]
    assert first.values["acts_on"] == binding.ACTS_ON["solids"]
    np.testing.assert_allclose(np.linalg.norm(first.values["wind_velocity"]), 1.5)
    np.testing.assert_allclose(first.values["wind_velocity"], scene.space.vector_to_sim((0, 0, 1.5)))
    assert first.values["noise_size"] == pytest.approx(0.05)
    matrix = np.reshape(first.values["transform"], (4, 4))
    assert np.linalg.norm(matrix[:3, 0]) == pytest.approx(0.4)
    assert scene.parameters().keys() >= {"/World/Gust", "/World/Gust (2)"}
    enabled.Set(False, 0)
    assert len(read(stage, tmp_path / "a.usda").forces) == 1


def test_disabled_prims_take_no_part(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    for path in ("/World/Ball", "/World/Carpet"):
        author(stage.GetPrimAtPath(path), enabled=False)
    scene = read(stage, tmp_path / "a.usda")
    assert scene.solids == [] and scene.emitters == [] and not scene.has_smoke


def test_solid_inside_an_instance_is_an_error(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    UsdGeom.Xform.Define(stage, "/Library")
    Sdf.CopySpec(stage.GetRootLayer(), "/World/Ball", stage.GetRootLayer(), "/Library/Ball")
    stage.GetPrimAtPath("/World/Ball").SetActive(False)
    stage.GetPrimAtPath("/Library").SetSpecifier(Sdf.SpecifierClass)
    copy = UsdGeom.Xform.Define(stage, "/World/Copy").GetPrim()
    copy.GetReferences().AddInternalReference("/Library")
    copy.SetInstanceable(True)
    with pytest.raises(SceneError, match=r"/World/Copy/Ball.*instance"):
        read(stage, tmp_path / "a.usda")


def test_hash_changes_with_what_the_simulation_sees_only(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    before = read(stage, tmp_path / "a.usda").hash()
    UsdShade.Material.Define(stage, "/World/Red")
    assert read(stage, tmp_path / "a.usda").hash() == before
    author(stage.GetPrimAtPath("/World/Ball"), youngsModulus=1e5)
    assert read(stage, tmp_path / "a.usda").hash() != before


@pytest.mark.parametrize(
    ("setting", "attribute", "value"),
    [
        ("Domain.voxelSize=0.1", "/World/Domain.eulerfsi:voxelSize", 0.1),
        ("/World/Domain.eulerfsi:voxelSize=0.1", "/World/Domain.eulerfsi:voxelSize", 0.1),
        ("Domain.wallXMin=open", "/World/Domain.eulerfsi:wallXMin", "open"),
        ("Domain.ambientFluid=off", "/World/Domain.eulerfsi:ambientFluid", False),
        ("Ball.velocity=0,-3,1", "/World/Ball.eulerfsi:velocity", Gf.Vec3d(0, -3, 1)),
        ("Ball.density=500", "/World/Ball.physics:density", 500.0),
    ],
)
def test_set_changes_one_attribute_for_the_run(tmp_path, setting, attribute, value):
    stage = make_scene(tmp_path / "a.usda")
    before = stage.GetRootLayer().ExportToString()
    applied = apply_overrides(stage, [setting])
    assert list(applied) == [attribute]
    assert stage.GetAttributeAtPath(attribute).Get() == value
    assert stage.GetRootLayer().ExportToString() == before


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("Domain.voxelsize=0.1", "did you mean voxelSize"),
        ("Domian.voxelSize=0.1", "did you mean Domain"),
        ("Ball.voxelSize=0.1", "/World/Ball has no parameter voxelSize"),
        ("Domain.voxelSize", "PRIM.ATTR=VALUE"),
        ("Domain.voxelSize=small", "'small' is not a value of type double (a number)"),
        ("Ball.velocity=1,2,x", "(a number)"),
        ("Domain.wallXMin=sticky", "not one of slip, noSlip, open, periodic"),
        ("Ball.velocity=1,2", "three numbers"),
        ("Domain.ambientFluid=maybe", "true or false"),
    ],
)
def test_set_that_cannot_be_names_the_nearest(tmp_path, setting, message):
    with pytest.raises(UsageError, match=re.escape(message)):
        apply_overrides(make_scene(tmp_path / "a.usda"), [setting])


def test_set_with_an_ambiguous_name_lists_the_paths(tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    UsdGeom.Xform.Define(stage, "/World/More")
    box(stage, "/World/More/Carpet", (0, 0, 0), (0.1, 0.1, 0.1), 1.0, "EulerFsiEmitterAPI")
    with pytest.raises(UsageError, match="/World/Carpet, /World/More/Carpet"):
        apply_overrides(stage, ["Carpet.smokeDensity=1"])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1-48", (1, 48)),
        ("0-1", (0, 1)),
        ("1-5,6-10", (1, 10)),
        ("-24-48", (-24, 48)),
        ("-24--1", (-24, -1)),
        ("-3--1,0-4", (-3, 4)),
    ],
)
def test_contiguous_frame_ranges(text, expected):
    frames = parse_frames(text)
    assert (frames.first, frames.last) == expected
    assert len(list(frames)) == len(frames) == expected[1] - expected[0] + 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1-10x2", "step"),
        ("1-20:5", "stagger"),
        ("1-5,8-10", "frame 6 is missing"),
        ("10-1", "backwards"),
        ("5", "at least 2"),
        ("-5", "at least 2"),
        ("-1--3", "backwards"),
        ("-3..4", "not a frame range"),
        ("1.5-3", "whole numbers"),
        ("one", "not a frame range"),
        ("", "not a frame range"),
    ],
)
def test_other_frame_ranges_say_what_is_wrong(text, message):
    with pytest.raises(UsageError, match=message):
        parse_frames(text)


def test_frames_count_from_the_first(tmp_path):
    stage = make_scene(tmp_path / "a.usda", frames=(1001, 1010))
    assert read(stage, tmp_path / "a.usda").frames == FrameRange(1001, 1010)


def test_a_schema_on_a_prim_that_nothing_defines_is_warned_of(cli, tmp_path):
    stage = make_scene(tmp_path / "a.usda")
    over = stage.OverridePrim("/World/Bal")
    over.ApplyAPI("EulerFsiSolidAPI")
    stage.CreateClassPrim("/_solid").ApplyAPI("EulerFsiSolidAPI")
    stage.OverridePrim("/World/Off").ApplyAPI("EulerFsiSolidAPI")
    stage.GetPrimAtPath("/World/Off").SetActive(False)
    stage.GetRootLayer().Save()
    told = cli("validate", "a.usda")
    assert told.returncode == 0
    warnings = [line for line in told.stdout.splitlines() if line.startswith("warning")]
    assert len(warnings) == 1
    assert "/World/Bal.specifier = an over with EulerFsiSolidAPI: must be defined; it is ignored" in warnings[0]


def test_a_schema_below_an_instance_is_warned_of(cli, tmp_path):
    """USD ignores what is authored there: the collider would be missed only on the screen."""
    stage = make_scene(tmp_path / "a.usda")
    points, counts, indices = sphere(0.05)
    rock = UsdGeom.Mesh.Define(stage, "/Rocks/Small")
    rock.CreatePointsAttr(points)
    rock.CreateFaceVertexCountsAttr(counts)
    rock.CreateFaceVertexIndicesAttr(indices)
    pile = UsdGeom.Xform.Define(stage, "/World/Pile").GetPrim()
    pile.GetReferences().AddInternalReference("/Rocks")
    stage.OverridePrim("/World/Pile/Small").ApplyAPI("EulerFsiColliderAPI")
    pile.SetInstanceable(True)
    stage.GetRootLayer().Save()
    told = cli("validate", "a.usda").stdout
    assert (
        "/World/Pile.instanceable = true: must be false: USD ignores EulerFsiColliderAPI on /World/Pile/Small" in told
    )
    pile.SetInstanceable(False)
    stage.GetRootLayer().Save()
    assert "instance" not in cli("validate", "a.usda").stdout


def test_a_range_of_parts_of_frames_says_how_to_start(cli, tmp_path):
    stage = make_scene(tmp_path / "a.usda", frames=(1, 5))
    stage.SetStartTimeCode(0.5)
    stage.SetEndTimeCode(3.25)
    stage.GetRootLayer().Save()
    refused = cli("validate", "a.usda")
    assert refused.returncode == 3
    assert "startTimeCode 0.5 and endTimeCode 3.25: must be whole numbers; --start-frame 1 simulates" in refused.stderr
    assert "frames 1-3 at 24 per second" in cli("validate", "a.usda", "--start-frame", "1").stdout
    stage.SetEndTimeCode(float("inf"))
    stage.GetRootLayer().Save()
    assert "endTimeCode inf: must be whole numbers" in cli("validate", "a.usda").stderr
    stage.SetStartTimeCode(-5.5)
    stage.SetEndTimeCode(-2.5)
    stage.GetRootLayer().Save()
    assert "must be whole numbers; --start-frame -5 simulates" in cli("validate", "a.usda").stderr
    assert "frames -5--3 at 24 per second" in cli("validate", "a.usda", "--start-frame", "-5").stdout
    assert frames_of(stage) == [-5.0, -4.0, -3.0]


def test_no_two_files_of_a_scene_have_one_copy(tmp_path):
    """Also where the scene has a folder of the name under which files from elsewhere are kept."""
    home = tmp_path / "shot"
    maps = {
        "./red.png": home / "red.png",
        "./external/0/red.png": home / "external/0/red.png",
        "../a/red.png": tmp_path / "a/red.png",
        "../b/red.png": tmp_path / "b/red.png",
    }
    for text, file in maps.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    stage = make_scene(home / "shot.usda")
    for number, text in enumerate(maps):
        ball = stage.GetPrimAtPath("/World/Ball")
        ball.CreateAttribute(f"map{number}", Sdf.ValueTypeNames.Asset).Set(text)
    stage.GetRootLayer().Save()
    opened = Usd.Stage.Open(str(localize_scene(home / "shot.usda", tmp_path / "cache" / "scene")))
    copies = [opened.GetPrimAtPath("/World/Ball").GetAttribute(f"map{number}").Get() for number in range(len(maps))]
    assert [Path(copy.resolvedPath).read_text() for copy in copies] == list(maps)
    assert all((tmp_path / "cache") in Path(copy.resolvedPath).parents for copy in copies)


def test_copied_scene_is_whole_and_relative(tmp_path):
    outside, home = tmp_path / "assets", tmp_path / "shot"
    (outside / "maps").mkdir(parents=True)
    home.mkdir()
    (outside / "maps" / "red.png").write_bytes(b"png")
    write_obj(outside / "ball.obj")
    part = Usd.Stage.CreateNew(str(outside / "part.usda"))
    prim = UsdGeom.Xform.Define(part, "/Part").GetPrim()
    prim.CreateAttribute("map", Sdf.ValueTypeNames.Asset).Set("./maps/red.png")
    part.SetDefaultPrim(prim)
    part.GetRootLayer().Save()
    stage = make_scene(home / "shot.usda")
    ball = stage.GetPrimAtPath("/World/Ball")
    ball.GetReferences().AddReference("../assets/part.usda")
    ball.GetAttribute("eulerfsi:surfaceFile").Set("../assets/ball.obj")
    assert UsdUtils.CreateNewUsdzPackage(str(outside / "part.usda"), str(outside / "packed.usdz"))
    UsdGeom.Xform.Define(stage, "/World/Packed").GetPrim().GetReferences().AddReference("../assets/packed.usdz")
    ball.CreateAttribute("gone", Sdf.ValueTypeNames.Asset).Set("./nowhere.png")
    stage.GetRootLayer().Save()

    copy = localize_scene(home / "shot.usda", tmp_path / "cache" / "scene")
    assert copy == tmp_path / "cache" / "scene" / "shot.usda"
    (tmp_path / "cache").rename(tmp_path / "moved")
    for folder in (outside, home):
        folder.rename(folder.with_name(f"hidden_{folder.name}"))
    opened = Usd.Stage.Open(str(tmp_path / "moved" / "scene" / "shot.usda"))
    copied = opened.GetPrimAtPath("/World/Ball")
    assert Path(copied.GetAttribute("eulerfsi:surfaceFile").Get().resolvedPath).is_file()
    assert Path(copied.GetAttribute("map").Get().resolvedPath).read_bytes() == b"png"
    assert copied.GetAttribute("gone").Get().path == "./nowhere.png"
    packed = opened.GetPrimAtPath("/World/Packed").GetAttribute("map").Get().resolvedPath
    assert packed.startswith(str(tmp_path / "moved")) and packed.endswith("red.png]")
    assert (tmp_path / "moved") in Path(copied.GetAttribute("map").Get().resolvedPath).parents
