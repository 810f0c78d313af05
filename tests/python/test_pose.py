"""Solids that something else moves at the start: skinning, blend shapes, point caches, animated transforms."""

from __future__ import annotations

import math
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from eulerfsi.run.simulate import Options, simulate
from eulerfsi.scene.motion import fit_rigid_motion, volume_center
from eulerfsi.scene.read import read_scene
from eulerfsi.solver.simulation import Mesh
from eulerfsi_usd import checks
from eulerfsi_usd.pose import Pose
from figures import BODY, add_tube, make_figure, start_stage, tube
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, UsdValidation, Vt

pytestmark = pytest.mark.usefixtures("library")
TUBE = "/World/Tube"


def run(path: Path) -> Path:
    return simulate(path, Options(output=path.with_suffix(""), progress="none")).folder / path.name


def world_points(stage: Usd.Stage, path: str, frame: float) -> np.ndarray:
    prim = stage.GetPrimAtPath(path)
    matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(prim))
    return np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(frame), float) @ matrix[:3, :3] + matrix[3, :3]


def baked(path: Path, copy: Path) -> Usd.Stage:
    """The scene with its skinning worked into the points by UsdSkel's own baker."""
    shutil.copy(path, copy)
    stage = Usd.Stage.Open(str(copy))
    root = UsdSkel.Root.Find(stage.GetPrimAtPath(BODY))
    assert UsdSkel.BakeSkinning(root, Gf.Interval(1, 2))
    return stage


def animate(mesh: UsdGeom.Mesh, keys: dict[float, tuple[Gf.Vec3d, float]]) -> None:
    """Keys of the mesh's transform: {frame: (place, degrees about y)}."""
    move, turn = mesh.AddTranslateOp(), mesh.AddRotateYOp()
    for frame, (place, degrees) in keys.items():
        move.Set(place, frame)
        turn.Set(degrees, frame)


def start_motion(tmp_path: Path, keys: dict[float, tuple[Gf.Vec3d, float]], first: int = 10) -> tuple:
    stage = start_stage(tmp_path / "s.usda", (first, first + 2))
    animate(add_tube(stage, TUBE), keys)
    values = read_scene(stage, tmp_path / "s.usda").solids[0].values
    return np.array(values["velocity"]), np.array(values["angular_velocity"])


@pytest.mark.parametrize("method", ["classicLinear", "dualQuaternion"])
def test_pose_is_what_usdskel_bakes(tmp_path, method):
    stage = make_figure(tmp_path / "f.usda", method)
    reference = baked(tmp_path / "f.usda", tmp_path / "baked.usda")
    pose = Pose(stage.GetPrimAtPath(BODY), own_points=True)
    assert pose.skeleton == "/World/Figure/Skeleton" and pose.has_blend_shapes
    for frame in (1, 2):
        expected = np.array(UsdGeom.Mesh(reference.GetPrimAtPath(BODY)).GetPointsAttr().Get(frame))
        np.testing.assert_allclose(pose.points(frame), expected, atol=1e-6)
    assert not np.allclose(pose.points(1), pose.points(2), atol=1e-3)


def test_figure_starts_from_its_pose_and_no_client_skins_the_cache_again(tmp_path):
    make_figure(tmp_path / "f.usda")
    reference = baked(tmp_path / "f.usda", tmp_path / "baked.usda")
    cache = Usd.Stage.Open(str(run(tmp_path / "f.usda")))
    np.testing.assert_allclose(world_points(cache, BODY, 1), world_points(reference, BODY, 1), atol=1e-5)
    written = [world_points(cache, BODY, frame) for frame in (1, 2, 3)]
    assert written[2][:, 1].mean() < written[0][:, 1].mean() - 0.02  # it falls
    root = UsdSkel.Root.Find(cache.GetPrimAtPath(BODY))
    skel, predicate = UsdSkel.Cache(), Usd.TraverseInstanceProxies()
    skel.Populate(root, predicate)
    assert not [t for b in skel.ComputeSkelBindings(root, predicate) for t in b.GetSkinningTargets()]
    assert UsdSkel.BakeSkinning(root, Gf.Interval(1, 3))
    for frame, points in enumerate(written, 1):
        np.testing.assert_array_equal(world_points(cache, BODY, frame), points)


def test_binding_that_a_mesh_inherits_does_not_act_on_the_cache(tmp_path):
    """Skeleton, joints and weights on an Xform above the mesh; another mesh below it stays skinned."""
    stage = make_figure(tmp_path / "f.usda")
    group = UsdGeom.Xform.Define(stage, "/World/Figure/Group")
    binding = UsdSkel.BindingAPI.Apply(group.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/World/Figure/Skeleton"])
    binding.CreateJointIndicesPrimvar(True, 1).Set(Vt.IntArray([1]))
    binding.CreateJointWeightsPrimvar(True, 1).Set(Vt.FloatArray([1.0]))
    inside, hat = "/World/Figure/Group/Inside", "/World/Figure/Group/Hat"
    add_tube(stage, inside, radius=0.08, height=0.3).AddTranslateOp().Set(Gf.Vec3d(0.3, 0, 0))
    add_tube(stage, hat).GetPrim().RemoveAppliedSchema("EulerFsiSolidAPI")
    stage.GetPrimAtPath(BODY).RemoveAppliedSchema("EulerFsiSolidAPI")
    stage.GetRootLayer().Save()
    cache = Usd.Stage.Open(str(run(tmp_path / "f.usda")))
    root, skel, predicate = (
        UsdSkel.Root.Find(cache.GetPrimAtPath(inside)),
        UsdSkel.Cache(),
        Usd.TraverseInstanceProxies(),
    )
    skel.Populate(root, predicate)
    bindings = skel.ComputeSkelBindings(root, predicate)
    skinned = {str(t.GetPrim().GetPath()) for b in bindings for t in b.GetSkinningTargets()}
    assert skinned == {hat, BODY}
    registry = UsdValidation.ValidationRegistry()
    errors = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(cache)
    assert not [e.GetMessage() for e in errors if e.GetType() == UsdValidation.ValidationErrorType.Error]


def test_cache_of_a_skinned_mesh_has_no_bind_transform(tmp_path):
    """Some clients place a mesh by it, instead of by the mesh's own transform."""
    stage = make_figure(tmp_path / "f.usda")
    bind = UsdSkel.BindingAPI(stage.GetPrimAtPath(BODY)).GetGeomBindTransformAttr()
    bind.Set(Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0.1, 0)))
    stage.GetRootLayer().Save()
    cache = Usd.Stage.Open(str(run(tmp_path / "f.usda")))
    assert not UsdSkel.BindingAPI(cache.GetPrimAtPath(BODY)).GetGeomBindTransformAttr().HasValue()


@pytest.mark.parametrize("fault", ["fewer points", "no points", "other faces", "not finite", "zero scale"])
def test_a_frame_beside_the_first_with_another_mesh_or_none_does_not_count(tmp_path, fault):
    """The frame after the first moves it by 0.48 m/s; the frame before is faulty."""
    stage = start_stage(tmp_path / "s.usda")
    mesh = add_tube(stage, TUBE)
    points, indices = np.array(mesh.GetPointsAttr().Get()), list(mesh.GetFaceVertexIndicesAttr().Get())
    before = {"fewer points": points[:-1], "no points": points[:0], "not finite": points * np.nan}.get(fault, points)
    for frame, values in ((0, before), (1, points), (2, points + (0.02, 0, 0))):
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(values.astype(np.float32)), frame)
    if fault == "other faces":
        for frame, turned in ((0, indices[3:] + indices[:3]), (1, indices)):
            mesh.GetFaceVertexIndicesAttr().Set(turned, frame)
    if fault == "zero scale":
        scale = mesh.AddScaleOp()
        for frame, size in ((0, 0), (1, 1)):
            scale.Set(Gf.Vec3f(size), frame)
    values = read_scene(stage, tmp_path / "s.usda").solids[0].values
    np.testing.assert_allclose(values["velocity"], (0.48, 0, 0), atol=1e-5)
    np.testing.assert_allclose(values["angular_velocity"], 0, atol=1e-4)


def test_an_animation_that_ends_at_the_first_frame_is_not_warned_of(cli, tmp_path):
    stage = start_stage(tmp_path / "s.usda", (9, 10))
    animate(add_tube(stage, TUBE), {1: (Gf.Vec3d(0, 0, 0), 0.0), 9: (Gf.Vec3d(0.1, 0, 0), 0.0)})
    stage.GetRootLayer().Save()
    report = cli("validate", "s.usda").stdout
    assert "warning" not in report and "of the animation" in report


def test_figure_has_the_motion_of_its_animation(tmp_path):
    """All weights on one joint: the body turns rigidly about the joint's place, 4 degrees a frame."""
    stage = make_figure(tmp_path / "f.usda")
    weights = UsdSkel.BindingAPI(stage.GetPrimAtPath(BODY)).GetJointWeightsPrimvar()
    weights.Set(Vt.FloatArray([0.0, 1.0] * (len(weights.Get()) // 2)))
    solid = read_scene(stage, tmp_path / "f.usda").solids[0]
    turn = np.array([0, 0, math.radians(4.0) * 24])
    np.testing.assert_allclose(solid.values["angular_velocity"], turn, atol=2e-4)
    joint = np.array([0.1, 0.05, 0.0])
    arm = volume_center(solid.mesh.points, solid.mesh.triangles()) - joint
    np.testing.assert_allclose(solid.values["velocity"], np.cross(turn, arm), atol=2e-4)
    assert "skinned by /World/Figure/Skeleton, blend shapes" in solid.pose and "of the animation" in solid.pose


def test_steady_screw_motion_is_found_exactly():
    points, counts, indices = tube()
    triangles = Mesh(points, counts, indices).triangles()
    angular, velocity, seconds = np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.2, -1.0]), 0.5
    rate = np.linalg.norm(angular)
    k = np.cross(angular / rate, np.eye(3)).T  # k @ x = axis x x

    def moved(x: np.ndarray, t: float) -> np.ndarray:
        """The screw motion with twist (velocity at the origin, angular) after t seconds."""
        s, c = math.sin(rate * t), math.cos(rate * t)
        path = t * np.eye(3) + (1 - c) / rate * k + (t - s / rate) * k @ k
        return x @ (np.eye(3) + s * k + (1 - c) * k @ k).T + path @ velocity

    start, about = points + (3.0, 1.0, 2.0), np.array([0.1, -0.4, 0.2])
    found = fit_rigid_motion(moved(start, -seconds / 2), moved(start, seconds / 2), triangles, seconds, about)
    np.testing.assert_allclose(found[0], velocity + np.cross(angular, about), atol=1e-7)
    np.testing.assert_allclose(found[1], angular, atol=1e-7)
    for still in fit_rigid_motion(start, start, triangles, seconds, about):
        np.testing.assert_array_equal(still, np.zeros(3))


def test_centre_of_volume_is_the_bodys():
    points, counts, indices = tube()
    triangles = Mesh(points, counts, indices).triangles()
    np.testing.assert_allclose(volume_center(points + (1, 2, 3), triangles), (1, 2, 3), atol=1e-9)
    np.testing.assert_allclose(volume_center(np.eye(3), np.array([[0, 1, 2]])), (1 / 3,) * 3)  # encloses nothing


@pytest.mark.parametrize(
    ("keys", "speed"),
    [
        ((1, 20), 0.24),  # in the middle of the animation
        ((10, 20), 0.24),  # at its first key
        ((1, 10), 0.24),  # at its last key: handed over in flight
        ((1, 9), 0.0),  # has come to rest
        ((11, 20), 0.0),  # has not begun
    ],
)
def test_animated_transform_gives_the_velocity_at_the_first_frame(tmp_path, keys, speed):
    place = {frame: (Gf.Vec3d(0.01 * (frame - keys[0]), 0, 0), 0.0) for frame in keys}
    velocity, angular = start_motion(tmp_path, place)
    np.testing.assert_allclose(velocity, (speed, 0, 0), atol=1e-6)
    np.testing.assert_allclose(angular, 0, atol=1e-6)


def test_animated_rotation_gives_the_angular_velocity(tmp_path):
    keys = {frame: (Gf.Vec3d(0, 0, 0), 5.0 * frame) for frame in (0, 20)}
    velocity, angular = start_motion(tmp_path, keys)
    np.testing.assert_allclose(angular, (0, math.radians(5 * 24), 0), rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(velocity, 0, atol=1e-5)


def test_authored_velocity_wins_over_the_animation(tmp_path):
    stage = start_stage(tmp_path / "s.usda")
    mesh = add_tube(stage, TUBE)
    animate(mesh, {1: (Gf.Vec3d(0, 0, 0), 0.0), 3: (Gf.Vec3d(0.1, 0, 0), 30.0)})
    mesh.GetPrim().GetAttribute("eulerfsi:velocity").Set(Gf.Vec3d(0, 0, 2))
    solid = read_scene(stage, tmp_path / "s.usda").solids[0]
    assert solid.values["velocity"] == [0, 0, 2]
    np.testing.assert_allclose(solid.values["angular_velocity"], (0, math.radians(15 * 24), 0), rtol=1e-5, atol=1e-5)
    assert "velocity (0, 0, 2) m/s as authored" in solid.pose


def test_point_cache_in_clips_of_its_own_starts_there_and_does_not_shine_through(tmp_path):
    points, _, _ = tube()
    cached = Usd.Stage.CreateNew(str(tmp_path / "cached.usda"))
    attribute = UsdGeom.Mesh.Define(cached, "/Tube").CreatePointsAttr()
    for frame in (1, 5):
        attribute.Set(points + (0.01 * (frame - 1), 0, 0), frame)
    cached.GetRootLayer().Save()
    stage = start_stage(tmp_path / "s.usda")
    mesh = add_tube(stage, TUBE)
    mesh.GetPrim().RemoveProperty("points")
    mesh.CreateAccelerationsAttr([Gf.Vec3f(0, 50, 0)] * len(points))
    clips = Usd.ClipsAPI(mesh.GetPrim())
    clips.SetClipAssetPaths([Sdf.AssetPath("./cached.usda")])
    clips.SetClipManifestAssetPath(Sdf.AssetPath("./cached.usda"))
    clips.SetClipPrimPath("/Tube")
    clips.SetClipActive([(0, 0)])
    clips.SetClipTimes([(1, 1), (5, 5)])
    stage.GetRootLayer().Save()
    velocity = read_scene(stage, tmp_path / "s.usda").solids[0].values["velocity"]
    np.testing.assert_allclose(velocity, (0.24, 0, 0), atol=1e-5)
    opened = Usd.Stage.Open(str(run(tmp_path / "s.usda")))
    for frame in (1, 2, 3):
        mean = world_points(opened, TUBE, frame).mean(axis=0)
        np.testing.assert_allclose(mean[0], 0.01 * (frame - 1), atol=0.001)
        assert mean[1] <= -0.5 * 9.81 * ((frame - 1) / 24) ** 2 + 1e-4  # it falls, the old points do not show
    assert UsdGeom.Mesh(opened.GetPrimAtPath(TUBE)).GetAccelerationsAttr().Get(2) is None


def test_faces_that_change_over_time_stay_those_of_the_first_frame(tmp_path):
    stage = start_stage(tmp_path / "s.usda")
    mesh = add_tube(stage, TUBE)
    counts, indices = mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()
    whole = (list(counts.Get()), list(indices.Get()))
    for frame, part in ((1, whole), (2, ([3], [0, 1, 2]))):
        counts.Set(part[0], frame)
        indices.Set(part[1], frame)
    stage.GetRootLayer().Save()
    written = Usd.Stage.Open(str(run(tmp_path / "s.usda")))
    opened = UsdGeom.Mesh(written.GetPrimAtPath(TUBE))
    for frame in (1, 2, 3):
        assert list(opened.GetFaceVertexCountsAttr().Get(frame)) == whole[0]
        assert list(opened.GetFaceVertexIndicesAttr().Get(frame)) == whole[1]


def test_animation_is_warned_of_once_by_validate_and_simulate(cli, tmp_path):
    stage = start_stage(tmp_path / "s.usda")
    animate(add_tube(stage, TUBE), {1: (Gf.Vec3d(0, 0, 0), 0.0), 9: (Gf.Vec3d(0.1, 0, 0), 0.0)})
    move = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Domain")).GetOrderedXformOps()[0]
    move.Set(Gf.Vec3d(0, 0, 0), 1)
    move.Set(Gf.Vec3d(0, 1, 0), 9)
    stage.GetRootLayer().Save()
    solid = "/World/Tube: is animated by the transform of /World/Tube: it starts from that pose and motion at frame 1"
    report = cli("validate", "s.usda")
    assert report.returncode == 0 and report.stdout.count(solid) == 1
    assert "/World/Domain: is animated by the transform of /World/Domain: it stays where it is at frame 1" in (
        report.stdout
    )
    assert "velocity (0.3, 0, 0) m/s of the animation" in report.stdout
    assert cli("simulate", "s.usda", "--progress", "none").stderr.count(solid) == 1


def idle(stage: Usd.Stage) -> list[str]:
    return [issue.message for issue in checks.check_stage(stage) if issue.code == "IdleSkinning"]


@pytest.mark.parametrize("api", ("EulerFsiSolidAPI", "EulerFsiColliderAPI"))
def test_joint_weights_that_do_nothing_are_warned_of(api, tmp_path):
    """USD skins only what a SkelRoot and a skeleton reach, by prims that can be drawn."""
    stage = make_figure(tmp_path / "f.usda")
    stage.GetPrimAtPath(BODY).RemoveAPI("EulerFsiSolidAPI")
    stage.GetPrimAtPath(BODY).ApplyAPI(api)
    assert idle(stage) == []
    figure = stage.GetPrimAtPath("/World/Figure")
    figure.SetTypeName("Xform")
    [message] = idle(stage)
    assert message.startswith(f"{BODY}: is not skinned") and message.endswith("there is no SkelRoot above it")
    figure.SetTypeName("SkelRoot")
    targets = figure.GetRelationship("skel:skeleton").GetTargets()
    figure.GetRelationship("skel:skeleton").SetTargets([])
    assert idle(stage)[0].endswith("no skel:skeleton is bound to it or above it")
    figure.GetRelationship("skel:skeleton").SetTargets(targets)
    layer = stage.GetRootLayer()
    stage.DefinePrim("/World/Figure/Geo")
    Sdf.CopySpec(layer, BODY, layer, "/World/Figure/Geo/Body")
    stage.RemovePrim(BODY)
    assert "/World/Figure/Geo, between it and its SkelRoot, is a prim without a type; make it" in idle(stage)[0]
    stage.GetPrimAtPath("/World/Figure/Geo").SetTypeName("Scope")
    assert idle(stage) == []


def test_skinning_that_cannot_be_computed_is_an_error_with_its_prim(cli, tmp_path):
    stage = make_figure(tmp_path / "f.usda")
    offsets = UsdSkel.BlendShape(stage.GetPrimAtPath(f"{BODY}/fat"))
    offsets.CreatePointIndicesAttr(list(range(1000, 1000 + len(offsets.GetOffsetsAttr().Get()))))
    stage.GetRootLayer().Save()
    refused = cli("simulate", "f.usda")
    assert refused.returncode == 3
    assert f"{BODY}.skel:skeleton = /World/Figure/Skeleton: must be a skinning that UsdSkel can compute" in (
        refused.stderr
    )
    assert not (tmp_path / "f_cache").exists()


@pytest.mark.parametrize("name", ["normals", "primvars:normals"])
@pytest.mark.parametrize("kind", ["Normal3fArray", "Vector3fArray", "Float3Array", "Normal3dArray"])
def test_validators_find_no_error_that_the_source_does_not_have(tmp_path, name, kind):
    stage = start_stage(tmp_path / "s.usda")
    mesh = add_tube(stage, TUBE)
    spec = Sdf.AttributeSpec(stage.GetRootLayer().GetPrimAtPath(TUBE), name, getattr(Sdf.ValueTypeNames, kind))
    array = Vt.Vec3dArray if kind.endswith("dArray") else Vt.Vec3fArray
    spec.default = array([(0, 1, 0)] * len(mesh.GetPointsAttr().Get()))
    spec.SetInfo("interpolation", UsdGeom.Tokens.vertex)
    stage.GetRootLayer().Save()
    registry = UsdValidation.ValidationRegistry()

    def errors(file: Path) -> Counter:
        opened = Usd.Stage.Open(str(file))
        found = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(opened)
        return Counter(e.GetName() for e in found if e.GetType() == UsdValidation.ValidationErrorType.Error)

    root = run(tmp_path / "s.usda")
    assert not errors(root) - errors(tmp_path / "s.usda")
    written = Usd.Stage.Open(str(root))
    opened = UsdGeom.Mesh(written.GetPrimAtPath(TUBE))
    assert opened.GetNormalsAttr().GetTypeName() == Sdf.ValueTypeNames.Normal3fArray
    assert isinstance(opened.GetNormalsAttr().Get(2), Vt.Vec3fArray)
    assert (
        not UsdGeom.PrimvarsAPI(opened).HasPrimvar("normals")
        or not opened.GetPrim().GetAttribute("primvars:normals").HasValue()
    )
