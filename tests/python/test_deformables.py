"""Scenes written to the proposed standard: bodies, mass, material, start, what they carry and what holds them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import author, make_scene
from eulerfsi.errors import SceneError
from eulerfsi_usd import standard, tets
from eulerfsi_usd.attachments import find_attachments
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from scene_run import Run
from standard_stages import (
    add_attachment,
    add_body,
    add_material,
    apply,
    build,
    found,
    new_stage,
    put,
    read,
    tet_box,
    turned,
    vec_array,
)

VOLUME = 0.2 * 0.15 * 0.15


def test_a_tet_mesh_alone_falls_at_rest_with_its_mass(tmp_path):
    path = tmp_path / "alone.usda"
    stage = new_stage(path)
    sim = add_body(stage)
    put(sim, "float", density=1200.0)
    stage.Save()
    run = Run(path, tmp_path / "cache")
    first, last = (run.frames[frame]["solids"]["/World/Jelly"] for frame in (1, 3))
    assert first["elastic_energy"] == 0.0 and first["max_stretch"] == 1.0
    assert first["mass"] == pytest.approx(1200.0 * VOLUME, rel=1e-6)
    authored = np.asarray(UsdGeom.TetMesh(sim).GetPointsAttr().Get())
    mesh = UsdGeom.TetMesh(run.stage.GetPrimAtPath("/World/Jelly"))
    assert np.abs(np.asarray(mesh.GetPointsAttr().Get(1)) - authored).max() < 1e-7
    fall = (np.asarray(mesh.GetPointsAttr().Get(3)) - authored)[:, 1]
    assert fall.max() < -0.02 and np.ptp(fall) < 0.002  # inner points as those of the surface
    assert last["center"][1] == pytest.approx(fall.mean(), rel=0.02)
    assert np.array_equal(mesh.GetPointsAttr().Get(), authored)  # the bind pose survives
    low, high = np.asarray(mesh.GetExtentAttr().Get(3))
    assert (low <= np.asarray(mesh.GetPointsAttr().Get(3)).min(axis=0) + 1e-6).all() and (high > low).all()
    assert not mesh.GetNormalsAttr().HasAuthoredValue()


def test_tetrahedra_of_either_orientation_and_a_mirror_make_the_same_solid(tmp_path):
    points, corners = tet_box((3, 3, 3), (0.15, 0.15, 0.15))
    mixed = corners.copy()
    mixed[::2, :2] = mixed[::2, 1::-1]
    meshes = []
    for name, tetrahedra, scale in (("a", corners, 1.0), ("b", mixed, 1.0), ("c", corners, -1.0)):
        stage = new_stage(tmp_path / f"{name}.usda")
        sim = add_body(stage, points=points * [scale, 1, 1], tets=tetrahedra)
        UsdGeom.Xformable(sim).AddScaleOp().Set((scale, 1, 1))
        stage.Save()
        scene, _ = read(tmp_path / f"{name}.usda")
        solid = scene.solids[0]
        assert solid.report["surface_volume"] == pytest.approx(0.15**3, rel=1e-6) and not solid.report["repaired"]
        meshes.append({tuple(sorted(face)) for face in solid.mesh.triangles().tolist()})
    assert meshes[0] == meshes[1] == meshes[2]


def test_graphics_follow_the_sim_mesh_from_their_bind_pose(tmp_path):
    path = tmp_path / "embedded.usda"
    stage = new_stage(path)
    body = UsdGeom.Xform.Define(stage, "/World/Body")
    body.AddTranslateOp().Set((0, 0.05, 0))
    add_body(stage, "/World/Body/sim", body="/World/Body")
    UsdGeom.Xform.Define(stage, "/World/Body/Deep").AddTranslateOp().Set((0.02, 0, 0))
    graphics = UsdGeom.Mesh.Define(stage, "/World/Body/Deep/Skin")
    bind = np.array([(0.05, 0, 0), (-0.05, 0.03, 0.02), (0.0, 0.02, -0.05), (0.12, 0.0, 0.0)])  # the last one outside
    graphics.CreatePointsAttr(vec_array(bind + 7.0))  # stale
    graphics.CreateFaceVertexCountsAttr([4])
    graphics.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    prim = apply(graphics.GetPrim(), f"{standard.POSE}:rest")
    prim.CreateAttribute("deformablePose:rest:purposes", Sdf.ValueTypeNames.TokenArray).Set(["bindPose"])
    prim.CreateAttribute("deformablePose:rest:points", Sdf.ValueTypeNames.Point3fArray).Set(vec_array(bind))
    stage.Save()
    run = Run(path, tmp_path / "cache", fluid_off(stage))
    skin = UsdGeom.Mesh(run.stage.GetPrimAtPath("/World/Body/Deep/Skin")).GetPointsAttr()
    sim = UsdGeom.TetMesh(run.stage.GetPrimAtPath("/World/Body/sim")).GetPointsAttr()
    assert np.abs(np.asarray(skin.Get(1)) - bind).max() < 1e-6
    fall = (np.asarray(sim.Get(3)) - np.asarray(sim.Get(1))).mean(axis=0)
    assert fall[1] < -0.02
    assert np.abs(np.asarray(skin.Get(3)) - bind - fall).max() < 1e-4
    assert "/World/Body" in run.frames[1]["solids"]


def fluid_off(stage: Usd.Stage) -> str:
    """As --set has it."""
    return f"{stage.GetPrimAtPath('/World/Domain').GetPath()}.ambientFluid=false"


# ---------------------------------------------------------------------------------------------------------------- mass


MASSES = {
    "constant": (lambda s, b, m: masses(s, [9.0], "constant"), 9.0, "physics:masses (constant)"),
    "tetrahedra": (lambda s, b, m: masses(s, [0.02] * 216, "tetrahedron"), 4.32, "physics:masses (tetrahedron)"),
    "points": (lambda s, b, m: masses(s, [0.05] * 80, "point"), 4.0, "physics:masses (point)"),
    "points of June": (lambda s, b, m: masses(s, [0.05] * 80, ""), 4.0, "physics:masses (point)"),
    "masses first": (lambda s, b, m: (masses(s, [9.0], "constant"), put(b, "float", mass=1.0)), 9.0, "physics:masses"),
    "mass": (lambda s, b, m: put(b, "float", mass=7.0, density=500.0), 7.0, "physics:mass of /World/Body"),
    "density": (
        lambda s, b, m: put(b, "float", mass=0.0, density=500.0),
        500.0 * VOLUME,
        "physics:density of /World/B",
    ),
    "material": (lambda s, b, m: put(m, "float", density=800.0), 800.0 * VOLUME, "physics:density of /World/Soft"),
    "fallback": (lambda s, b, m: None, 1000.0 * VOLUME, "the standard's fallback"),
    "not MassAPI": (lambda s, b, m: put(s, "float", mass=3.0), 1000.0 * VOLUME, "the standard's fallback"),
}


def masses(sim, values, kind):
    put(sim, "floats", masses=values)
    if kind:
        put(sim, "token", masses_elementType=kind)


@pytest.mark.parametrize("case", MASSES)
def test_mass_has_the_precedence_of_the_standard_over_the_rest_volume(tmp_path, case):
    author_mass, expected, source = MASSES[case]
    stage = new_stage(tmp_path / "mass.usda")
    body = UsdGeom.Xform.Define(stage, "/World/Body").GetPrim()
    points, corners = tet_box((4, 3, 3), (0.2, 0.15, 0.15))
    sim = add_body(stage, "/World/Body/sim", points * 1.1, corners, "/World/Body")  # swollen by a third
    put(sim, "points", restShapePoints=points)
    author_mass(sim, body, add_material(stage, "/World/Soft", sim, youngsModulus=5e4))
    stage.Save()
    scene, _ = read(tmp_path / "mass.usda")
    solid = scene.solids[0]
    assert solid.values["density"] * solid.report["solid_volume"] == pytest.approx(expected, rel=1e-6)
    assert solid.origins["density"].startswith(source)


def test_densities_of_subsets_add_to_the_mass_and_are_named_uneven(tmp_path):
    stage = new_stage(tmp_path / "subsets.usda")
    sim = add_body(stage)
    heavy = UsdGeom.Subset.Define(stage, "/World/Jelly/heavy")
    heavy.CreateElementTypeAttr("tetrahedron")
    heavy.CreateFamilyNameAttr("materialBind")
    heavy.CreateIndicesAttr(list(range(54)))  # a quarter
    add_material(stage, "/World/Lead", heavy.GetPrim(), density=5000.0, youngsModulus=9e5)
    add_material(stage, "/World/Soft", sim, density=500.0, youngsModulus=5e4)
    stage.Save()
    scene, codes = read(tmp_path / "subsets.usda")
    solid = scene.solids[0]
    assert solid.tets.mass == pytest.approx((5000.0 + 3 * 500.0) / 4 * VOLUME, rel=1e-6)
    assert solid.values["youngs_modulus"] == 5e4  # of most tetrahedra
    assert {"UnevenMass", "SubsetMaterials"} <= set(codes)


# -------------------------------------------------------------------------------------------------- units and materials


def test_centimetres_and_metres_are_the_same_scene(tmp_path):
    scenes = {}
    for unit in (1.0, 0.01):
        stage = new_stage(tmp_path / f"{unit}.usda", unit=unit)
        points, corners = tet_box((4, 3, 3), (0.2, 0.15, 0.15))
        sim = add_body(stage, points=points / unit, tets=corners)
        add_material(stage, "/World/Soft", sim, youngsModulus=5e4 * unit, poissonsRatio=0.4, density=1200 * unit**3)
        UsdGeom.TetMesh(sim).CreateVelocitiesAttr(vec_array(np.full_like(points, 0.5 / unit)))
        stage.Save()
        scenes[unit], _ = read(tmp_path / f"{unit}.usda")
    for scene in scenes.values():
        values = scene.solids[0].values
        assert values["youngs_modulus"] == pytest.approx(5e4, rel=1e-6) and values["poissons_ratio"] == pytest.approx(
            0.4
        )
        assert values["velocity"] == pytest.approx([0.5] * 3, rel=1e-6)
        assert values["density"] * VOLUME == pytest.approx(1200 * VOLUME, rel=1e-6)
    a, b = (scene.solids[0].mesh.points for scene in scenes.values())
    assert np.abs(a - b).max() < 1e-7


def test_attributes_of_ours_win_and_validate_says_which_counted(tmp_path):
    from eulerfsi.cli.report import describe_scene

    stage = new_stage(tmp_path / "both.usda")
    sim = add_body(stage)
    add_material(stage, "/World/Soft", sim, youngsModulus=5e4, poissonsRatio=0.2, dynamicFriction=0.3)
    apply(sim, "EulerFsiSolidAPI")
    author(sim, youngsModulus=3e4, friction=0.7, rayleighAlpha=2.0, velocity=Gf.Vec3d(0, 1, 0))
    UsdGeom.TetMesh(sim).CreateVelocitiesAttr(vec_array(np.full((80, 3), 9.0)))
    stage.Save()
    scene, _ = read(tmp_path / "both.usda")
    values = scene.solids[0].values
    assert (values["youngs_modulus"], values["friction"], values["rayleigh_alpha"]) == (3e4, 0.7, 2.0)
    assert values["poissons_ratio"] == pytest.approx(0.2) and values["velocity"] == [0, 1, 0]
    text = "\n".join(describe_scene(scene))
    assert "E from eulerfsi:youngsModulus of /World/Jelly" in text
    assert "nu from physics:poissonsRatio of /World/Soft" in text
    assert len(scene.solids) == 1


def test_a_mesh_with_our_schema_takes_elastic_values_of_its_material(tmp_path):
    stage = make_scene(tmp_path / "ours.usda", meters_per_unit=0.01, smoke=False)
    ball = stage.GetPrimAtPath("/World/Ball")
    for name in ("physics:density", "eulerfsi:youngsModulus", "eulerfsi:poissonsRatio"):
        ball.RemoveProperty(name)
    add_material(
        stage, "/World/Soft", ball, youngsModulus=500.0, poissonsRatio=0.2, density=0.0012, dynamicFriction=0.4
    )
    stage.Save()
    values = read(tmp_path / "ours.usda")[0].solids[0].values
    assert values["youngs_modulus"] == pytest.approx(5e4) and values["poissons_ratio"] == pytest.approx(0.2)
    assert values["density"] == pytest.approx(1200.0) and values["friction"] == pytest.approx(0.4)
    author(ball, youngsModulus=7e4)
    stage.Save()
    solid = read(tmp_path / "ours.usda")[0].solids[0]
    assert solid.values["youngs_modulus"] == 7e4
    assert solid.origins["E"] == "eulerfsi:youngsModulus of /World/Ball"
    assert solid.origins["nu"] == "physics:poissonsRatio of /World/Soft"


def test_a_scene_without_a_domain_is_refused_with_the_line_that_adds_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stage = new_stage(tmp_path / "asset.usda")
    add_body(stage)
    stage.RemovePrim("/World/Domain")
    stage.Save()
    with pytest.raises(SceneError, match="to add one: .* new asset_fsi.usda --from-usd asset.usda"):
        read(tmp_path / "asset.usda")


def test_settings_reach_a_body_without_our_schema(tmp_path):
    from eulerfsi.log import Log
    from eulerfsi.run.simulate import Options, load_scene

    stage = new_stage(tmp_path / "set.usda")
    sim = add_body(stage)
    masses(sim, [9.0], "constant")
    stage.Save()
    settings = ("Jelly.youngsModulus=30000", "/World/Jelly.density=700")
    scene, overrides = load_scene(tmp_path / "set.usda", Options(settings=settings), Log(), 0)
    assert scene.solids[0].values["youngs_modulus"] == 30000 and len(overrides) == 2
    assert scene.solids[0].values["density"] == pytest.approx(700, rel=1e-6)


def test_without_anything_the_standards_fallbacks_count_and_large_ratios_are_cut(tmp_path):
    stage = new_stage(tmp_path / "plain.usda")
    sim = add_body(stage)
    stage.Save()
    values = read(tmp_path / "plain.usda")[0].solids[0].values
    assert (values["youngs_modulus"], values["poissons_ratio"], values["friction"]) == (1e6, 0.3, 0.0)
    add_material(stage, "/World/Soft", sim, poissonsRatio=0.5, youngsModulus=-math.inf, staticFriction=0.25)
    stage.Save()
    scene, codes = read(tmp_path / "plain.usda")
    values = scene.solids[0].values
    assert (values["youngs_modulus"], values["poissons_ratio"], values["friction"]) == (1e6, 0.499, 0.25)
    assert "LargePoisson" in codes


# ------------------------------------------------------------------------------------------------------ rest and start


def stretched_scene(path, of_standard: bool, turn: float = 0.0, offset: float = 0.0):
    """A box that is stretched by 1.15 along x, in vacuum, without gravity."""
    stage = new_stage(path, fluid=False, voxel=0.6 / 22)
    UsdPhysics.Scene(stage.GetPrimAtPath("/World/PhysicsScene")).CreateGravityMagnitudeAttr(0.0)
    points, corners = tet_box((4, 3, 3), (0.2, 0.15, 0.15))
    if of_standard:
        sim = add_body(stage, points=points * [1.15, 1, 1], tets=corners)
        put(sim, "points", restShapePoints=points @ turned(turn) + offset)
        add_material(stage, "/World/Soft", sim, youngsModulus=2e4, poissonsRatio=0.4)
    else:
        mesh = UsdGeom.Mesh.Define(stage, "/World/Jelly")
        mesh.CreatePointsAttr(vec_array(points))
        faces, _ = tets.boundary(tets.oriented(points, corners))
        mesh.CreateFaceVertexCountsAttr([3] * len(faces))
        mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
        mesh.CreateSubdivisionSchemeAttr("none")
        mesh.GetPrim().ApplyAPI("EulerFsiSolidAPI")
        author(mesh.GetPrim(), youngsModulus=2e4, poissonsRatio=0.4, stretch=Gf.Vec3d(1.15, 1, 1))
    stage.Save()
    return path


def test_a_stretched_rest_shape_runs_as_our_stretch_does(tmp_path):
    runs = [Run(stretched_scene(tmp_path / f"{i}.usda", bool(i)), tmp_path / f"{i}") for i in (0, 1)]
    energies = [[run.frames[f]["solids"]["/World/Jelly"]["elastic_energy"] for f in (1, 2, 3)] for run in runs]
    assert energies[0][0] > 0.5
    assert energies[1] == pytest.approx(energies[0], rel=1e-4)
    ours, standards = (
        np.asarray(UsdGeom.PointBased(run.stage.GetPrimAtPath("/World/Jelly")).GetPointsAttr().Get(3)) for run in runs
    )
    assert np.abs(ours - standards).max() < 1e-5


def test_a_rest_shape_lies_anywhere_and_is_turned(tmp_path):
    (ours, _), (standards, _) = (
        read(stretched_scene(tmp_path / f"{turn}.usda", turn > 0, turn, 5.0)) for turn in (0.0, 0.7)
    )
    a, b = ours.solids[0], standards.solids[0]
    assert a.values["stretch"] == b.values["stretch"] == [1.15, 1.0, 1.0]
    assert np.abs(a.mesh.points - b.mesh.points).max() < 1e-6


def test_a_field_that_is_a_stretch_is_that_stretch(tmp_path, monkeypatch):
    from eulerfsi.scene import tet_bodies

    scene, _ = read(stretched_scene(tmp_path / "a.usda", True))
    assert not scene.solids[0].tets.deforms and scene.solids[0].values["stretch"] == [1.15, 1.0, 1.0]
    plain = build(scene)
    monkeypatch.setattr(tet_bodies, "_SAME", -1.0)  # nothing counts as a stretch: all is a field
    scene, _ = read(tmp_path / "a.usda")
    assert scene.solids[0].tets.deforms
    field = build(scene)
    fields = [made.simulation.field("solid_displacement", 1)[0] for made in (plain, field)]
    shape = [min(sizes) for sizes in zip(*(f.shape[1:] for f in fields), strict=True)]
    assert fields[0].shape == fields[1].shape, shape
    assert np.abs(fields[0] - fields[1]).max() < 2e-6
    for made in (plain, field):
        made.simulation.advance(2 / 24)
    points = [made.simulation.surface(1)[0] for made in (plain, field)]
    assert np.abs(points[0] - points[1]).max() < 1e-4


def bent(points: np.ndarray, curvature: float) -> np.ndarray:
    """Along x, about an axis above it."""
    radius, angle = 1 / curvature - points[:, 1], points[:, 0] * curvature
    return np.stack([radius * np.sin(angle), 1 / curvature - radius * np.cos(angle), points[:, 2]], axis=1)


def test_a_body_saved_while_bent_starts_bent_with_the_energy_of_a_beam(tmp_path):
    stage = new_stage(tmp_path / "bent.usda", voxel=0.02, fluid=False)
    points, corners = tet_box((10, 4, 4), (0.3, 0.1, 0.1))
    sim = add_body(stage, points=bent(points, 3.0), tets=corners)
    put(sim, "points", restShapePoints=points)
    add_material(stage, "/World/Soft", sim, youngsModulus=1e5, poissonsRatio=0.0)
    stage.Save()
    scene, _ = read(tmp_path / "bent.usda")
    made = build(scene)
    now, _ = made.simulation.surface(1)
    assert np.abs(now - scene.solids[0].tets.start).max() < 0.15 * 0.02
    energy = made.simulation.solid_diagnostics(1)["elastic_energy"]
    assert energy == pytest.approx(0.5 * 1e5 * 0.1**4 / 12 * 3.0**2 * 0.3, rel=0.15)


def test_a_bent_start_by_a_time_sample_bends_what_is_embedded_in_the_straight_default(tmp_path):
    path = tmp_path / "sampled.usda"
    stage = new_stage(path, voxel=0.02, fluid=False)
    points, corners = tet_box((10, 4, 4), (0.3, 0.1, 0.1))
    sim = add_body(stage, "/World/Body/sim", points, corners, "/World/Body")
    UsdGeom.TetMesh(sim).GetPointsAttr().Set(vec_array(bent(points, 3.0)), 1)
    curve = UsdGeom.Points.Define(stage, "/World/Body/Dots")
    dots = np.array([(x, y, 0.01) for x in (-0.14, -0.05, 0.08, 0.14) for y in (-0.04, 0.0, 0.045)])
    curve.CreatePointsAttr(vec_array(dots))
    stage.Save()
    run = Run(path, tmp_path / "cache", frames="1-2")
    got = np.asarray(UsdGeom.Points(run.stage.GetPrimAtPath("/World/Body/Dots")).GetPointsAttr().Get(1))
    assert np.abs(got - bent(dots, 3.0)).max() < 0.15 * 0.02
    mesh = UsdGeom.TetMesh(run.stage.GetPrimAtPath("/World/Body/sim"))
    assert np.abs(np.asarray(mesh.GetPointsAttr().Get(1)) - bent(points, 3.0)).max() < 0.15 * 0.02
    assert np.abs(np.asarray(mesh.GetPointsAttr().Get()) - points).max() < 1e-6  # the rest shape survives
    assert run.solid("/World/Body", 1)["elastic_energy"] > 1.0


def test_another_run_goes_on_from_a_cache_as_from_any_stage(tmp_path):
    """Points, velocities and rest shape of a frame of a cache are those of a body that is saved while bent."""
    from eulerfsi.run.simulate import Options, simulate

    stage = new_stage(tmp_path / "bent.usda", frames=(1, 5), voxel=0.03, fluid=False)
    points, corners = tet_box((6, 3, 3), (0.3, 0.12, 0.12))
    sim = add_body(stage, points=bent(points, 3.0), tets=corners)
    put(sim, "points", restShapePoints=points)
    add_material(stage, "/World/Soft", sim, youngsModulus=3e3)
    stage.Save()
    run = Run(tmp_path / "bent.usda", tmp_path / "one")
    again = simulate(tmp_path / "one/bent.usda", Options(output=tmp_path / "two", progress="none", start=4))
    first, second = (
        [np.asarray(UsdGeom.TetMesh(opened.GetPrimAtPath("/World/Jelly")).GetPointsAttr().Get(f)) for f in (4, 5)]
        for opened in (run.stage, Usd.Stage.Open(str(again.root)))
    )
    assert np.abs(first[1] - first[0]).max() > 0.05
    assert max(np.abs(a - b).max() for a, b in zip(first, second, strict=True)) < 0.06 * 0.03


def test_velocities_of_the_points_are_a_field(tmp_path):
    stage = new_stage(tmp_path / "spin.usda", voxel=0.02, fluid=False)
    sim = add_body(stage)
    points = np.asarray(UsdGeom.TetMesh(sim).GetPointsAttr().Get(), float)
    UsdGeom.TetMesh(sim).CreateVelocitiesAttr(vec_array(np.cross([0, 0, 3.0], points) + [0.2, 0, 0]))
    stage.Save()
    scene, _ = read(tmp_path / "spin.usda")
    assert scene.solids[0].values["velocity"] == pytest.approx([0.2, 0, 0], abs=1e-6)
    _, velocities = build(scene).simulation.surface(1)
    assert np.abs(velocities - np.cross([0, 0, 3.0], points) - [0.2, 0, 0]).max() < 1e-5


def test_rest_tetrahedra_joined_otherwise_are_merged_or_refused(tmp_path):
    stage = new_stage(tmp_path / "soup.usda")
    sim = add_body(stage)
    points, corners = (np.asarray(a) for a in tet_box((4, 3, 3), (0.2, 0.15, 0.15)))
    soup = points[corners].reshape(-1, 3)
    put(sim, "points", restShapePoints=soup)
    put(sim, "tets", restTetVertexIndices=np.arange(len(soup)).reshape(-1, 4))
    stage.Save()
    scene, _ = read(tmp_path / "soup.usda")
    assert scene.solids[0].values["stretch"] == [1.0] * 3 and not scene.solids[0].tets.deforms
    soup[5] += 0.01
    put(sim, "points", restShapePoints=soup)
    assert (
        "/World/Jelly.physics:restTetVertexIndices = several places at rest of point" in found(stage)["TornRestShape"]
    )


# ------------------------------------------------------------------------------------------- attachments and colliders


@pytest.mark.parametrize("kind", ["point", "face", "tetrahedron"])
def test_an_attachment_holds_its_sites_on_what_moves(tmp_path, kind):
    path = tmp_path / "held.usda"
    stage = new_stage(path, frames=(1, 4))
    sim = add_body(stage)
    points, corners = tet_box((4, 3, 3), (0.2, 0.15, 0.15))
    hand = UsdGeom.Xform.Define(stage, "/World/Hand")
    for frame in (1, 4):
        hand.AddTranslateOp().Set((0.0, 0.2, 0.0), 1) if frame == 1 else hand.GetOrderedXformOps()[0].Set(
            (0.06, 0.2, 0), 4
        )
    top = np.flatnonzero(points[:, 1] > 0.07)
    if kind == "point":
        sites, coords, places = top, None, points[top]
    elif kind == "face":
        faces, _ = tets.boundary(tets.oriented(points, corners))
        UsdGeom.TetMesh(sim).CreateSurfaceFaceVertexIndicesAttr([Gf.Vec3i(*map(int, face)) for face in faces])
        sites = np.flatnonzero(np.isin(faces, top).all(axis=1))
        coords, places = np.tile([1 / 3, 1 / 3, 0.0], (len(sites), 1)), points[faces[sites]].mean(axis=1)
    else:
        sites = np.flatnonzero(np.isin(corners, top).sum(axis=1) == 3)
        coords, places = np.tile([0.25] * 3, (len(sites), 1)), points[corners[sites]].mean(axis=1)
    add_attachment(stage, "/World/Jelly", "/World/Hand", kind, sites, places - [0, 0.2, 0], coords)
    stage.Save()
    run = Run(path, tmp_path / "cache")
    got = np.asarray(UsdGeom.TetMesh(run.stage.GetPrimAtPath("/World/Jelly")).GetPointsAttr().Get(4))
    assert np.abs(got[top] - points[top] - [0.06, 0, 0]).max() < 0.002
    assert "/World/Attachment" in run.steps[-1]["pin_impulses"]


def test_attachments_that_cannot_be_are_refused_or_named(tmp_path):
    stage = new_stage(tmp_path / "held.usda")
    add_body(stage)
    UsdGeom.Xform.Define(stage, "/World/Hand")
    prim = add_attachment(stage, "/World/Jelly", "/World/Hand", "point", [0], [(-0.1, -0.075, -0.055)])
    assert "physics:coords1[0] = 0.02 from its site: must be at most half a voxel" in found(stage)["FarAnchor"]
    put(prim, "vectors", coords1=[(-0.1, -0.075, -0.075)])
    put(prim, "float", stiffness=100.0, damping=1.0)
    assert not found(stage) and "must be inf; soft attachments" in found(stage, "warning")["SoftAttachment"]
    assert len(find_attachments(stage)) == 1
    put(prim, "float", stiffness=0.0)
    assert "stiffness = 0: must be above 0, since it holds nothing" in found(stage, "warning")["IgnoredAttachment"]
    assert not found(stage) and not find_attachments(stage)
    put(prim, "float", stiffness=-1.0)
    assert "stiffness = -1: must be a number >= 0, or inf" in found(stage)["BadAttachment"]
    put(prim, "float", stiffness=100.0)
    put(prim, "ints", indices0=[80])
    assert "physics:indices0 = 80: must be between 0 and 79" in found(stage)["BadAttachment"]
    put(prim, "token", type1="point")
    assert not found(stage) and "IgnoredAttachment" in found(stage, "warning")
    prim.GetRelationship("physics:src1").SetTargets(["/World/Nothing"])
    assert "/World/Attachment.physics:src1" in found(stage)["MissingTarget"]


def test_colliders_of_usd_physics_and_kinematic_bodies_act(tmp_path):
    path = tmp_path / "colliders.usda"
    stage = new_stage(path, frames=(1, 6), voxel=0.03)
    points, corners = tet_box((3, 3, 3), (0.15, 0.15, 0.15))
    add_body(stage, points=points, tets=corners)
    floor = UsdGeom.Cube.Define(stage, "/World/Floor")  # static
    floor.AddTranslateOp().Set((0, -0.2, 0))
    floor.AddScaleOp().Set((0.25, 0.05, 0.25))
    apply(floor.GetPrim(), standard.COLLISION)
    ram = add_body(stage, "/World/Ram", points + [-0.2, 0, 0], corners)  # pushes from the left
    put(ram, "bool", kinematicEnabled=True)
    attribute = UsdGeom.TetMesh(ram).GetPointsAttr()
    for frame, x in ((1, -0.2), (6, -0.05)):
        attribute.Set(vec_array(points + [x, 0, 0]), frame)
    body = UsdGeom.Xform.Define(stage, "/World/Loose")
    UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    ball = UsdGeom.Sphere.Define(stage, "/World/Loose/Ball")
    ball.CreateRadiusAttr(0.03)
    ball.AddTranslateOp().Set((0.22, 0.2, 0))
    UsdPhysics.CollisionAPI.Apply(ball.GetPrim())
    stage.Save()
    scene, codes = read(path)
    assert sorted(c.path for c in scene.colliders) == ["/World/Floor", "/World/Loose/Ball", "/World/Ram"]
    assert "ForeignCollider" in codes and [s.path for s in scene.solids] == ["/World/Jelly"]
    run = Run(path, tmp_path / "cache")
    center = run.solid("/World/Jelly", 6)["center"]
    assert center[0] > 0.02  # pushed
    assert run.solid("/World/Jelly", 6)["extent_min"][1] > -0.16  # on the floor, not in it
    assert sum(step["pin_impulses"]["/World/Ram"][0] for step in run.steps) > 0


def test_a_kinematic_rigid_body_takes_its_colliders_along(tmp_path):
    stage = new_stage(tmp_path / "kinematic.usda", voxel=0.03)
    body = UsdGeom.Xform.Define(stage, "/World/Arm")
    UsdPhysics.RigidBodyAPI.Apply(body.GetPrim()).CreateKinematicEnabledAttr(True)
    move = body.AddTranslateOp()
    for frame in (1, 3):
        move.Set((0.05 * frame, 0, 0), frame)
    UsdPhysics.CollisionAPI.Apply(UsdGeom.Capsule.Define(stage, "/World/Arm/Hand").GetPrim())
    hand = UsdGeom.Capsule(stage.GetPrimAtPath("/World/Arm/Hand"))
    hand.CreateRadiusAttr(0.04)
    hand.CreateHeightAttr(0.1)
    off = UsdGeom.Sphere.Define(stage, "/World/Off")
    UsdPhysics.CollisionAPI.Apply(off.GetPrim()).CreateCollisionEnabledAttr(False)
    apply(UsdGeom.Xform.Define(stage, "/World/Group").GetPrim(), standard.COLLISION)
    stage.Save()
    scene, codes = read(tmp_path / "kinematic.usda")
    assert [collider.path for collider in scene.colliders] == ["/World/Arm/Hand"]
    ways = [scene.colliders[0].points(frame).mean(axis=0)[0] for frame in (1, 3)]
    assert ways[1] - ways[0] == pytest.approx(0.1, abs=1e-6)
    assert codes.count("ForeignCollider") == 1  # of the Xform alone


# ----------------------------------------------------------------------------------------------------- ignored, refused


def test_cloth_cables_and_filters_are_named_and_the_volume_runs(tmp_path):
    path = tmp_path / "mixed.usda"
    stage = new_stage(path)
    add_body(stage)
    cloth = UsdGeom.Mesh.Define(stage, "/World/Cloth")
    cloth.CreatePointsAttr([(0, 0.2, 0), (0.1, 0.2, 0), (0, 0.2, 0.1)])
    cloth.CreateFaceVertexCountsAttr([3])
    cloth.CreateFaceVertexIndicesAttr([0, 1, 2])
    apply(cloth.GetPrim(), standard.BODY, standard.SURFACE_SIM, standard.COLLISION)
    cable = UsdGeom.BasisCurves.Define(stage, "/World/Cable")
    apply(cable.GetPrim(), standard.BODY, standard.CURVES_SIM)
    stage.DefinePrim("/World/Filter", standard.COLLISION_FILTER)
    lone = UsdGeom.TetMesh.Define(stage, "/World/Lone")
    apply(lone.GetPrim(), standard.VOLUME_SIM)
    off = add_body(stage, "/World/Off")
    put(off, "bool", bodyEnabled=False)
    stage.Save()
    scene, codes = read(path)
    assert [solid.path for solid in scene.solids] == ["/World/Jelly"] and not scene.colliders
    assert codes.count("NotSimulated") == 3 and "IdleSimMesh" in codes
    texts = [issue.message for issue in checks_of(stage)]
    for words in ("/World/Cloth: ignored: cloth", "/World/Cable: ignored: cables", "/World/Filter: ignored: filters"):
        assert any(text.startswith(words) for text in texts)
    assert Run(path, tmp_path / "cache").frames[3]["solids"].keys() == {"/World/Jelly"}


def checks_of(stage):
    from eulerfsi_usd import checks

    return checks.check_stage(stage)


def flat(stage, sim):
    points = list(UsdGeom.TetMesh(sim).GetPointsAttr().Get())
    a, b, c, d = UsdGeom.TetMesh(sim).GetTetVertexIndicesAttr().Get()[3]
    points[d] = (points[a] + points[b] + points[c]) / 3
    UsdGeom.TetMesh(sim).GetPointsAttr().Set(points)


def inverted(stage, sim):
    points = np.asarray(UsdGeom.TetMesh(sim).GetPointsAttr().Get())
    put(sim, "points", restShapePoints=points)
    moved = points.copy()
    moved[0] += [0.15, 0.12, 0.12]
    UsdGeom.TetMesh(sim).GetPointsAttr().Set(vec_array(moved))


def out_of_range(stage, sim):
    corners = np.array(UsdGeom.TetMesh(sim).GetTetVertexIndicesAttr().Get())
    corners[7, 2] = 99
    UsdGeom.TetMesh(sim).GetTetVertexIndicesAttr().Set(vec_array(corners, "tets"))


def two_poses(stage, sim):
    for name in "ab":
        apply(sim, f"{standard.POSE}:{name}")
        sim.CreateAttribute(f"deformablePose:{name}:purposes", Sdf.ValueTypeNames.TokenArray).Set(["bindPose"])
        sim.CreateAttribute(f"deformablePose:{name}:points", Sdf.ValueTypeNames.Point3fArray).Set(
            UsdGeom.TetMesh(sim).GetPointsAttr().Get()
        )


def stretch_too(stage, sim):
    points = np.asarray(UsdGeom.TetMesh(sim).GetPointsAttr().Get())
    put(sim, "points", restShapePoints=points * [0.9, 1, 1])
    apply(sim, "EulerFsiSolidAPI")
    author(sim, stretch=Gf.Vec3d(1.1, 1, 1))


BAD = {
    "flat": (flat, "/World/Jelly.tetVertexIndices[", "must be a tetrahedron with a volume"),
    "inverted": (inverted, "/World/Jelly.tetVertexIndices[", "must be with the sign of the volume that it has at rest"),
    "index": (out_of_range, "/World/Jelly.tetVertexIndices[7]", "must be between 0 and 79"),
    "poses": (two_poses, "poses a, b", 'must be one pose with the purpose "bindPose"'),
    "rest": (lambda t, s: put(s, "points", restShapePoints=np.zeros((3, 3))), "3 points", "must be 80 points"),
    "masses": (lambda t, s: masses(s, [1.0, 2.0], "constant"), "physics:masses = 2 values", "must be 1 (constant)"),
    "no kind": (lambda t, s: masses(s, [1.0, 2.0], ""), "masses:elementType = empty", "must be one of constant"),
    "negative": (lambda t, s: put(s, "float", mass=-1.0), "physics:mass = -1", "must be finite and >= 0"),
    "mass is a word": (
        lambda t, s: s.CreateAttribute("physics:mass", Sdf.ValueTypeNames.String).Set("heavy"),
        "/World/Jelly.physics:mass = a value of type string",
        "must be of type float",
    ),
    "rest is flat": (
        lambda t, s: put(s, "floats", restShapePoints=[1.0, 2.0]),
        "/World/Jelly.physics:restShapePoints = a value of type float[]",
        "must be of type point3f[]",
    ),
    "nu": (
        lambda t, s: add_material(t, "/World/M", s, poissonsRatio=-0.95),
        "/World/M.physics:poissonsRatio = -0.95",
        "must be -0.9 to 0.5",
    ),
    "E": (lambda t, s: add_material(t, "/World/M", s, youngsModulus=0.0), "youngsModulus = 0", "must be > 0"),
    "stretch": (stretch_too, "/World/Jelly: physics:restShapePoints", "must not, where eulerfsi:stretch is set"),
    "velocities": (
        lambda t, s: UsdGeom.TetMesh(s).CreateVelocitiesAttr([(0, 0, 0)]),
        "/World/Jelly.velocities = 1 values",
        "must be 80, one per point",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_body_that_cannot_be_simulated_is_refused_by_name(tmp_path, case):
    spoil, where, limit = BAD[case]
    path = tmp_path / "bad.usda"
    stage = new_stage(path)
    spoil(stage, add_body(stage))
    stage.Save()
    with pytest.raises(SceneError) as error:
        read(path)
    assert where in str(error.value) and limit in str(error.value), str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_sim_schema_on_another_type_of_prim_is_named(tmp_path):
    stage = new_stage(tmp_path / "mesh.usda")
    add_body(stage)
    apply(UsdGeom.Mesh.Define(stage, "/World/Skin").GetPrim(), standard.VOLUME_SIM, standard.BODY)
    assert "/World/Skin.typeName = Mesh: must be TetMesh" in found(stage, "warning")["IdleSimMesh"]
    assert not found(stage)


def test_two_schemas_of_ours_in_one_body_are_refused(tmp_path):
    stage = new_stage(tmp_path / "two.usda")
    body = UsdGeom.Xform.Define(stage, "/World/Body").GetPrim()
    sim = add_body(stage, "/World/Body/sim", body="/World/Body")
    for prim in (body, sim):
        apply(prim, "EulerFsiSolidAPI")
    assert (
        "/World/Body/sim.apiSchemas = EulerFsiSolidAPI: must be on one prim of the body" in found(stage)["ManySchemas"]
    )


def test_a_body_of_another_scene_is_not_simulated(tmp_path):
    stage = new_stage(tmp_path / "other.usda")
    sim = add_body(stage)
    UsdPhysics.Scene.Define(stage, "/World/ZOther")
    sim.CreateRelationship("physics:simulationOwner").AddTarget("/World/ZOther")
    assert {"OtherScene", "EmptyScene"} <= set(found(stage, "warning"))
    sim.GetRelationship("physics:simulationOwner").SetTargets(["/World/PhysicsScene"])
    assert "OtherScene" not in found(stage, "warning")
