"""PointInstancers whose prototypes are marked: a body per instance."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import author, sphere
from eulerfsi.errors import SceneError
from eulerfsi_usd import standard
from pxr import Gf, Usd, UsdGeom
from scene_run import Run
from standard_stages import add_body, apply, new_stage, read, tet_box, vec_array

PLACES = [(-0.15, 0.1, 0.0), (0.15, 0.1, 0.0), (0.0, -0.1, 0.1), (0.0, -0.1, -0.15)]


def instancer(stage: Usd.Stage, kinds: list[int], places=PLACES) -> UsdGeom.PointInstancer:
    """Balls of 0.06 m by prototype 0, what the caller defines at Protos/Other by prototype 1."""
    result = UsdGeom.PointInstancer.Define(stage, "/World/Many")
    ball = UsdGeom.Mesh.Define(stage, "/World/Many/Protos/Ball")
    points, counts, indices = sphere(0.06)
    ball.CreatePointsAttr(vec_array(points))
    ball.CreateFaceVertexCountsAttr(counts)
    ball.CreateFaceVertexIndicesAttr(indices)
    ball.CreateSubdivisionSchemeAttr("none")
    result.CreatePrototypesRel().SetTargets(["/World/Many/Protos/Ball", "/World/Many/Protos/Other"])
    result.CreateProtoIndicesAttr(kinds)
    result.CreatePositionsAttr(places)
    return result


def test_each_instance_of_a_solid_falls_on_its_own_and_the_cache_draws_it(tmp_path):
    stage = new_stage(tmp_path / "many.usda", voxel=0.03)
    many = instancer(stage, [0, 0, 1, 0])
    UsdGeom.Xformable(many).AddTranslateOp().Set((0, 0.05, 0))
    UsdGeom.Cube.Define(stage, "/World/Many/Protos/Other").CreateSizeAttr(0.02)  # drawn only
    apply(stage.GetPrimAtPath("/World/Many/Protos/Ball"), "EulerFsiSolidAPI")
    author(stage.GetPrimAtPath("/World/Many/Protos/Ball"), velocity=Gf.Vec3d(0, -1, 0))
    many.CreateIdsAttr([7, 8, 9, 12])
    many.CreateInvisibleIdsAttr([8])
    stage.Save()
    scene, _ = read(tmp_path / "many.usda")
    paths = [f"/World/Many_instances/i{number}/Ball" for number in (7, 12)]
    assert [solid.path for solid in scene.solids] == paths
    run = Run(tmp_path / "many.usda", tmp_path / "cache")
    opened = UsdGeom.PointInstancer(run.stage.GetPrimAtPath("/World/Many"))
    assert sorted(opened.GetInvisibleIdsAttr().Get()) == [7, 8, 12]
    for path, place in zip(paths, (PLACES[0], PLACES[3]), strict=True):
        start = np.array(place) + [0, 0.05, 0]
        assert run.points(path, 1).mean(axis=0) == pytest.approx(start, abs=1e-3)
        assert run.points(path, 3).mean(axis=0)[1] < start[1] - 0.05
    assert not stage.GetPrimAtPath("/World/Many_instances")  # the scene's own layers stay as they were


def test_colliders_and_emitters_by_instance_move_with_the_instancer(tmp_path):
    stage = new_stage(tmp_path / "many.usda", voxel=0.03)
    many = instancer(stage, [0, 1])
    other = UsdGeom.Sphere.Define(stage, "/World/Many/Protos/Other")
    other.CreateRadiusAttr(0.05)
    apply(other.GetPrim(), "EulerFsiEmitterAPI")
    author(other.GetPrim(), mode="initial")
    apply(stage.GetPrimAtPath("/World/Many/Protos/Ball"), standard.COLLISION)
    many.GetPositionsAttr().Clear()
    for frame, shift in ((1, 0.0), (3, 0.1)):
        many.GetPositionsAttr().Set([(x + shift, y, z) for x, y, z in PLACES[:2]], frame)
    many.CreateOrientationsAttr([Gf.Quath(1, 0, 0, 0)] * 2)
    many.CreateScalesAttr([(1, 1, 1), (2, 2, 2)])
    stage.Save()
    scene, _ = read(tmp_path / "many.usda")
    (collider,), (emitter,) = scene.colliders, scene.emitters
    assert collider.path == "/World/Many_instances/i0/Ball" and emitter.path == "/World/Many_instances/i1/Other"
    for frame, shift in ((1, 0.0), (2, 0.05), (3, 0.1)):
        assert collider.points(frame).mean(axis=0) == pytest.approx(np.array(PLACES[0]) + [shift, 0, 0], abs=1e-3)
    low, high = emitter.extent()
    assert high - low == pytest.approx([0.2] * 3, abs=1e-6) and (low + high) / 2 == pytest.approx(PLACES[1], abs=1e-6)


def test_bodies_of_the_standard_by_instance(tmp_path):
    stage = new_stage(tmp_path / "many.usda", voxel=0.03)
    many = instancer(stage, [1, 1, 0])
    many.GetPositionsAttr().Set(PLACES[:3])
    UsdGeom.Xform.Define(stage, "/World/Many/Protos/Other")
    points, corners = tet_box((2, 2, 2), (0.1, 0.1, 0.1))
    add_body(stage, "/World/Many/Protos/Other/sim", points, corners, "/World/Many/Protos/Other")
    stage.Save()
    scene, _ = read(tmp_path / "many.usda")
    assert [solid.path for solid in scene.solids] == [f"/World/Many_instances/i{i}/Other" for i in (0, 1)]
    assert scene.solids[1].mesh.points.mean(axis=0) == pytest.approx(PLACES[1], abs=1e-6)
    run = Run(tmp_path / "many.usda", tmp_path / "cache")
    mesh = UsdGeom.TetMesh(run.stage.GetPrimAtPath("/World/Many_instances/i1/Other/sim"))
    assert (np.asarray(mesh.GetPointsAttr().Get(3)) - points)[:, 1].max() < -0.01


@pytest.mark.parametrize("visible", [True, False])
def test_a_prototype_elsewhere_is_a_body_itself_where_it_is_seen(tmp_path, visible):
    stage = new_stage(tmp_path / "many.usda", voxel=0.03)
    many = instancer(stage, [0, 0])
    many.GetPositionsAttr().Set(PLACES[:2])
    library = UsdGeom.Xform.Define(stage, "/World/Library")
    if not visible:
        library.CreateVisibilityAttr("invisible")
    points, corners = tet_box((2, 2, 2), (0.1, 0.1, 0.1))
    add_body(stage, "/World/Library/Cube", points - np.array([0.0, 0.2, 0.0]), corners)
    many.GetPrototypesRel().SetTargets(["/World/Library/Cube"])
    stage.Save()
    scene, _ = read(tmp_path / "many.usda")
    copies = [f"/World/Many_instances/i{i}/Cube" for i in (0, 1)]
    assert [solid.path for solid in scene.solids] == [*(["/World/Library/Cube"] if visible else []), *copies]


def test_a_setting_of_the_prototype_holds_for_all_and_of_an_instance_for_one(tmp_path):
    from eulerfsi.log import Log
    from eulerfsi.run.simulate import Options, load_scene

    stage = new_stage(tmp_path / "many.usda", voxel=0.03)
    instancer(stage, [0, 0])
    apply(stage.GetPrimAtPath("/World/Many/Protos/Ball"), "EulerFsiSolidAPI")
    stage.GetPrimAtPath("/World/Many").GetAttribute("positions").Set(PLACES[:2])
    stage.Save()
    settings = ("Ball.friction=0.5", "/World/Many_instances/i1/Ball.youngsModulus=70000")
    scene, _ = load_scene(tmp_path / "many.usda", Options(settings=settings), Log(), 0)
    assert [solid.values["friction"] for solid in scene.solids] == [0.5, 0.5]
    assert scene.solids[0].values["youngs_modulus"] < scene.solids[1].values["youngs_modulus"] == 70000


def many_solids(stage, many):
    many.GetProtoIndicesAttr().Set([0] * 256)
    many.GetPositionsAttr().Set([(0, 0, 0)] * 256)


def too_few_places(stage, many):
    many.GetPositionsAttr().Set([(0, 0, 0)])


def same_ids(stage, many):
    many.CreateIdsAttr([3, 3])


def changing(stage, many):
    many.GetPositionsAttr().Set(PLACES[:2], 1)
    many.GetPositionsAttr().Set(PLACES[:1], 2)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (many_solids, "protoIndices = 256 solids and colliders by instance: must be at most 255"),
        (too_few_places, "positions = 1 values: must be 2, one per instance"),
        (same_ids, "ids = some more than once: must be one of its own for each instance"),
        (changing, "positions = 1 values: must be as many in all frames"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tmp_path, spoil, words):
    stage = new_stage(tmp_path / "many.usda")
    many = instancer(stage, [0, 0], PLACES[:2])
    apply(stage.GetPrimAtPath("/World/Many/Protos/Ball"), "EulerFsiSolidAPI")
    spoil(stage, many)
    stage.Save()
    with pytest.raises(SceneError) as error:
        read(tmp_path / "many.usda")
    assert str(error.value).startswith("/World/Many.") and words in str(error.value)
