"""The example scenes: committed text, validity, physical set-up."""

from __future__ import annotations

import json
import math
import os
import sys
from collections import Counter
from pathlib import Path

import eulerfsi_usd  # noqa: F401  (registers the schema before the first stage)
import numpy as np
import pytest
from eulerfsi_usd import checks
from eulerfsi_usd.pose import Pose
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade
from scene_run import SCENES, Run

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples"))

import make_scenes  # noqa: E402
import pieces  # noqa: E402

NAMES = sorted(make_scenes.MAKERS)


def missing_files(stage: Usd.Stage) -> list[str]:
    """Surface files of a scene that this machine does not have."""
    assets = [prim.GetAttribute("eulerfsi:surfaceFile") for prim in stage.Traverse()]
    paths = [attribute.Get().path for attribute in assets if attribute and attribute.Get().path]
    return [path for path in paths if not os.path.isfile(path)]


def mesh_volume(prim: Usd.Prim) -> float:
    """Enclosed volume [m^3]; also asserts that the mesh is closed and oriented."""
    points = np.asarray(UsdGeom.Mesh(prim).GetPointsAttr().Get(), dtype=float)
    quads = np.asarray(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get()).reshape(-1, 4)
    edges = Counter((int(a), int(b)) for a, b in np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2))
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
    a, b, c, d = (points[quads[:, i]] for i in range(4))
    return float((np.cross(a, b) * c).sum() + (np.cross(a, c) * d).sum()) / 6.0


def test_the_folder_holds_the_generated_scenes_only() -> None:
    assert sorted(path.name for path in SCENES.glob("*.usd*")) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_committed_scene_equals_the_generator(name: str) -> None:
    committed = Sdf.Layer.FindOrOpen(str(SCENES / name))
    stage = make_scenes.MAKERS[name]()
    assert committed.ExportToString() == stage.GetRootLayer().ExportToString()


@pytest.mark.parametrize("name", NAMES)
def test_scene_passes_check_stage(name: str) -> None:
    stage = Usd.Stage.Open(str(SCENES / name))
    missing = missing_files(stage)
    issues = checks.check_stage(stage)
    assert [issue.code for issue in issues] == ["MissingFile"] * len(missing), [issue.message for issue in issues]


@pytest.mark.parametrize("name", NAMES)
def test_scene_passes_all_validators_of_usd(name: str) -> None:
    validation = pytest.importorskip("pxr.UsdValidation")
    stage = Usd.Stage.Open(str(SCENES / name))
    expected = {"MissingFile", "UnresolvableDependency"} if missing_files(stage) else set()
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 30
    errors = validation.ValidationContext(validators).Validate(stage)
    assert {error.GetName() for error in errors} == expected, [error.GetMessage() for error in errors]


@pytest.mark.parametrize("name", NAMES)
def test_scene_has_units_range_and_gravity(name: str) -> None:
    stage = Usd.Stage.Open(str(SCENES / name))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0 and UsdGeom.GetStageUpAxis(stage) == "Y"
    assert stage.GetTimeCodesPerSecond() == 24 and stage.GetStartTimeCode() == 1
    scene = UsdPhysics.Scene(stage.GetPrimAtPath("/World/PhysicsScene"))
    assert scene.GetGravityDirectionAttr().Get() == Gf.Vec3f(0, -1, 0)
    weightless = name.startswith(("squash", "circles", "jets_circle"))
    assert scene.GetGravityMagnitudeAttr().Get() == pytest.approx(0.0 if weightless else 9.8, rel=1e-6)


COARSE = 0.02  # m: voxels of the examples here; those of 2-D ones, whose box is a voxel thick, are their own
# What the conditions of docs/warnings.md then tell of an example: code and prim, each with its cause.
LOSES = "paper2016 has no volume source, which takes back what its splitting of velocity and pressure loses in contact"
WARNED = {"meeting_balls.usda": {("volume", "/World/Left"): LOSES, ("volume", "/World/Right"): LOSES}}


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_an_example_is_warned_of_for_a_cause_only(name: str, tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(SCENES / name))
    if missing_files(stage):
        pytest.skip("a surface file is not on this machine")
    domain = stage.GetPrimAtPath("/World/Domain")
    voxel, flat = domain.GetAttribute("eulerfsi:voxelSize").Get(), name.startswith(("circles", "jets_circle"))
    settings = () if flat or voxel >= COARSE else (f"/World/Domain.voxelSize={COARSE}",)
    frames = "1-6" if name == "party.usda" else "1-12"
    folder = Run(name, tmp_path / "cache", *settings, frames=frames).folder
    told = json.loads((folder / "manifest.json").read_text())["warnings"]
    assert {(one["code"], one["prim"]) for one in told} == set(WARNED.get(name, {})), told


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["ball", "falling_bunny", "jelly_drop_no_fluid", "meeting_balls", "tentacle"])
def test_written_meshes_are_whole(name: str, tmp_path: Path) -> None:
    """Twelve frames, with the impact, of the scenes with solids that no other test simulates as far; Run looks."""
    if missing_files(Usd.Stage.Open(str(SCENES / f"{name}.usda"))):
        pytest.skip("a surface file is not on this machine")
    assert Run(f"{name}.usda", tmp_path / "cache", frames="1-12").frames


@pytest.mark.nightly
def test_solids_of_the_heap_meet_and_stay_apart(tmp_path: Path) -> None:
    """Twenty-four frames of coarse voxels: they touch, none enters another or the floor, what fell has come to lie."""
    voxel, frames = 0.0125, 24
    run = Run("heap.usda", tmp_path / "cache", f"/World/Domain.voxelSize={voxel}", frames=f"1-{frames}")
    meshes = [str(prim.GetPath()) for prim in run.stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    written = [[run.points(path, frame) for path in meshes] for frame in range(2, frames + 1)]
    lowest = [min(cloud[:, 1].min() for cloud in clouds) / voxel for clouds in written]
    assert len(written[-1]) == 12
    assert min(lowest) > -0.5, "a solid is in the floor"
    contacts = [event["contacts"]["pairs"] for event in run.events if "contacts" in event]
    assert max(len(pairs) for pairs in contacts) > 5, "nothing has touched"
    deepest = [max(pair["surface_overlap"] for pair in pairs) for pairs in contacts]
    assert max(deepest) < 1.0, "solids have entered each other"
    assert deepest[-1] < 0.25, "a solid lies in another one"
    assert run.steps and all(step["degenerate_cells"] == 0 for step in run.steps)


@pytest.mark.nightly
def test_legs_of_the_tongs_push_each_other_and_spring_open(tmp_path: Path) -> None:
    """Coarse voxels: they stay voxels apart, no cell breaks, and the statistics tell of a solid that pushes itself."""
    voxel, frames = 0.0125, 36
    run = Run("tongs.usda", tmp_path / "cache", f"/World/Domain.voxelSize={voxel}", frames=f"1-{frames}")
    itself = [
        (event["frame"], pair)
        for event in run.events
        for pair in event.get("contacts", {}).get("pairs", [])
        if pair["solids"] == ["/World/Tongs", "/World/Tongs"]
    ]
    assert {frame for frame, _ in itself} & set(range(15, 25)), "the legs have not met"
    assert all(pair["surface_overlap"] < -0.5 and pair["sticking_share"] == 0 for _, pair in itself)
    assert sum(step["degenerate_cells"] for step in run.steps) < 5
    tips = run.points("/World/Tongs", 1)[:, 1] > 0.33
    between = {frame: 2 * np.abs(run.points("/World/Tongs", frame)[tips, 0]).min() for frame in (1, 20, frames)}
    assert between[20] < 0.5 * between[1]
    assert between[frames] > 0.9 * between[1]


@pytest.mark.slow
def test_the_tentacle_bats_the_ball(tmp_path: Path) -> None:
    """Coarse voxels: a skinned collider, which would not touch the ball if its points rested; suckers ride on it."""
    run = Run("tentacle.usda", tmp_path / "cache", "/World/Domain.voxelSize=0.02", frames="1-10")
    before, after = run.solid("/World/Ball", 7), run.solid("/World/Ball", 10)
    assert abs(before["momentum"][0]) < 1e-3 * before["mass"]
    assert after["momentum"][0] > 1.5 * after["mass"]  # m/s
    given = sum(np.array(step["pin_impulses"]["/World/Tentacle/Skin"]) for step in run.steps)
    assert given[0] == pytest.approx(after["momentum"][0], rel=0.05), "something else has moved it"
    assert sum(step["prescribed_work"]["/World/Tentacle/Skin"] for step in run.steps) > 0.0
    skin = Pose(run.stage.GetPrimAtPath("/World/Tentacle/Skin"), own_points=True)
    away = []
    for frame in (1, 10):
        surface, middles = (
            skin.points(Usd.TimeCode(frame)),
            run.points("/World/Suckers", frame).reshape(7, -1, 3).mean(1),
        )
        away.append(np.sort(np.linalg.norm(middles[:, None] - surface, axis=2), axis=1)[:, :4].mean(axis=1))
    assert np.abs(away[1] - away[0]).max() < 0.001, "a sucker has left its place"


@pytest.mark.slow
def test_struck_pillar_holds_its_foot_gives_way_and_returns(tmp_path: Path) -> None:
    """Coarse voxels: a pin, a collider that swings, eyes that ride along."""
    voxel, frames = 0.02, 60
    run = Run("struck.usda", tmp_path / "cache", f"/World/Domain.voxelSize={voxel}")
    rest = run.points("/World/Pillar", 1)
    foot, top = rest[:, 1] <= 0.05, rest[:, 1] > 0.29
    moved, deepest = [], []
    for frame in range(1, frames + 1):
        now = run.points("/World/Pillar", frame)
        assert np.abs(now[foot] - rest[foot]).max() < 1e-6, f"frame {frame}: the foot is not held"
        moved.append(float((now[top] - rest[top])[:, 0].mean()))
        ball = run.stage.GetPrimAtPath("/World/Pendulum/Ball")
        center = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(ball))[3, :3]
        deepest.append((float(np.linalg.norm(now - center, axis=1).min()) - 0.05) / voxel)
        # An eye sits on the pillar: the vertices nearest to it stay as near.
        eye = [run.points("/World/Face/EyeLeft", at).mean(axis=0) for at in (1, frame)]
        near = np.argsort(np.linalg.norm(rest - eye[0], axis=1))[:4]
        apart = [np.linalg.norm(shape[near] - center, axis=1) for shape, center in zip((rest, now), eye, strict=True)]
        assert np.abs(apart[1] - apart[0]).max() < 0.5 * voxel, f"frame {frame}: the eye has left its place"
    assert max(moved) > 0.05, "the ball has not struck"
    assert abs(moved[-1]) < 0.2 * max(moved), "the pillar has not come back"
    assert min(deepest) < 1.0, "nothing has touched"
    assert min(deepest) > -0.5, "the ball has gone into the pillar"
    given = sum(np.array(step["pin_impulses"]["/World/Pendulum/Ball"]) for step in run.steps)
    assert given[0] > 0.1  # kg m/s


@pytest.mark.slow
def test_clay_keeps_its_dent_and_rubber_does_not(tmp_path: Path) -> None:
    """Sixteen frames of coarse voxels: heights over the diameter, volumes, and what the clay has yielded."""
    run = Run("clay_and_rubber.usda", tmp_path / "cache", "/World/Domain.voxelSize=0.015", frames="1-16")

    def height(name: str, frame: int) -> float:
        solid = run.solid(f"/World/{name}", frame)
        return (solid["extent_max"][1] - solid["extent_min"][1]) / 0.18

    assert height("Rubber", 3) < 0.8, "it has not been pressed"
    assert height("Rubber", 9) == pytest.approx(1.0, abs=0.03)
    assert height("Clay", 9) < 0.75
    assert height("Clay", 16) == pytest.approx(height("Clay", 9), abs=0.01), "something pulls it back"
    assert run.solid("/World/Rubber", 16)["max_plastic_strain"] == 0.0
    assert run.solid("/World/Clay", 16)["max_plastic_strain"] > 0.3
    for frame in run.frames.values():
        for solid in frame["solids"].values():
            assert solid["volume_mesh"] == pytest.approx(solid["rest_volume"], rel=0.01)


@pytest.mark.nightly
def test_meeting_balls_part_by_repulsion_and_stick_without_it(cli, tmp_path: Path) -> None:
    """Through the command line: the distance of the centres over the diameter in frame 7, 0.25 s after the start."""

    def distance(*options: str) -> tuple[float, list[dict]]:
        folder = tmp_path / f"cache{len(options)}"
        done = cli("simulate", SCENES / "meeting_balls.usda", "--frames", "1-7", "-o", folder, *options)
        assert done.returncode == 0, done.stderr
        events = [json.loads(line) for line in (folder / "stats.jsonl").read_text().splitlines()]
        solids = [event["solids"] for event in events if "solids" in event][-1]
        centers = [np.array(solids[f"/World/{name}"]["center"]) for name in ("Left", "Right")]
        pairs = [pair for event in events if "contacts" in event for pair in event["contacts"]["pairs"]]
        return float(np.linalg.norm(centers[0] - centers[1])) / 0.2, pairs

    apart, pairs = distance()
    assert apart > 1.2
    assert sum(pair["active_rows"] for pair in pairs) > 100
    none = [word for name in ("Left", "Right") for word in ("--set", f"/World/{name}.contactStiffness=0")]
    stuck, pairs = distance(*none)
    assert stuck < 1.05
    assert not pairs


def test_ball_has_the_published_set_up() -> None:
    stage = Usd.Stage.Open(str(SCENES / "ball.usda"))
    domain, ball, carpet = (stage.GetPrimAtPath(f"/World/{name}") for name in ("Domain", "Ball", "Carpet"))
    box = UsdGeom.Xformable(domain).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    assert domain.GetAttribute("size").Get() == 1.0
    assert np.allclose(box.Transform(Gf.Vec3d(-0.5)), (-0.3, -0.5, -0.3), atol=1e-12)
    assert np.allclose(box.Transform(Gf.Vec3d(0.5)), (0.3, 0.2, 0.3), atol=1e-12)
    voxel = domain.GetAttribute("eulerfsi:voxelSize").Get()
    cells = [box.GetRow3(i).GetLength() / voxel for i in range(3)]
    assert np.allclose(cells, (60, 70, 60), atol=1e-9)
    assert {domain.GetAttribute(f"eulerfsi:{wall}").Get() for wall in pieces.WALLS} == {"noSlip"}
    assert domain.GetAttribute("eulerfsi:vorticityConfinement").Get() == 1.5
    assert domain.GetAttribute("eulerfsi:fluidDensity").Get() == 1.0
    assert stage.GetEndTimeCode() == 48

    young, poisson = (ball.GetAttribute(f"eulerfsi:{name}").Get() for name in ("youngsModulus", "poissonsRatio"))
    assert young / (2.0 * (1.0 + poisson)) == pytest.approx(10000.0, rel=1e-12)
    assert young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)) == pytest.approx(5000.0, rel=1e-12)
    assert ball.GetAttribute("eulerfsi:velocity").Get() == Gf.Vec3d(0, -2.03, 0)
    assert ball.HasAPI(UsdPhysics.MassAPI) and ball.GetAttribute("physics:density").Get() == 1000.0
    points = np.asarray(UsdGeom.Mesh(ball).GetPointsAttr().Get())
    assert 1000 <= len(points) <= 2000
    assert np.allclose(np.linalg.norm(points, axis=1), 0.1, atol=2e-6)
    assert mesh_volume(ball) == pytest.approx(4.0 / 3.0 * math.pi * 0.1**3, rel=0.01)
    assert UsdShade.MaterialBindingAPI(ball).ComputeBoundMaterial()[0]
    st = UsdGeom.PrimvarsAPI(ball).GetPrimvar("st")
    assert len(st.ComputeFlattened()) == len(UsdGeom.Mesh(ball).GetFaceVertexIndicesAttr().Get())

    region = UsdGeom.Xformable(carpet).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    assert np.allclose(region.Transform(Gf.Vec3d(-0.5)), (-0.3, -0.5, -0.3), atol=1e-12)
    assert np.allclose(region.Transform(Gf.Vec3d(0.5)), (0.3, -0.44, 0.3), atol=1e-12)
    assert carpet.GetAttribute("eulerfsi:mode").Get() == "initial"
    assert carpet.GetAttribute("eulerfsi:smokeDensity").Get() == 0.8


def test_puff_blows_two_rings_of_its_volume(tmp_path: Path) -> None:
    """The pipe's area across the flow is that of its round, the speeds are those of its samples."""
    run = Run("puff.usda", tmp_path / "cache", "/World/Domain.voxelSize=0.03")
    brought: Counter = Counter()
    for step in run.steps:
        brought[step["frame"]] += step["dt"] * step["emitter_flux"]["/World/Pipe"]
    puffs = [sum(brought[frame] for frame in frames) for frames in (range(2, 7), range(7, 26), range(26, 30))]
    area = math.pi * 0.07**2
    assert puffs[0] == pytest.approx(area * (2 * 0.75 + 3 * 1.5) / 24, rel=0.01)
    assert puffs[1] == 0.0
    assert puffs[2] == pytest.approx(area * (2 * 2.25 + 2 * 3.0) / 24, rel=0.01)
    smoke = {number: frame["fluid"]["smoke"] for number, frame in run.frames.items()}
    assert smoke[7] - smoke[2] == pytest.approx(puffs[0] - brought[2], rel=0.15)
    # Its first step fills the pipe, too.
    assert smoke[30] - smoke[26] == pytest.approx(0.6 * (puffs[2] - brought[26]), rel=0.15)


def test_other_scenes_are_what_their_names_say() -> None:
    jelly = Usd.Stage.Open(str(SCENES / "jelly_drop_no_fluid.usda"))
    assert jelly.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:ambientFluid").Get() is False
    volume = mesh_volume(jelly.GetPrimAtPath("/World/Jelly"))
    assert 0.95 * 0.2**3 < volume < 0.2**3  # a cube of edge 0.2 m less its rounded edges
    smoke = Usd.Stage.Open(str(SCENES / "smoke_only.usda"))
    assert not [prim for prim in smoke.Traverse() if "EulerFsiSolidAPI" in prim.GetAppliedSchemas()]
    assert smoke.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:wallYMax").Get() == "open"
    bunny = Usd.Stage.Open(str(SCENES / "falling_bunny.usda"))
    assert (
        bunny.GetPrimAtPath("/World/Bunny").GetAttribute("eulerfsi:surfaceFile").Get().path
        == "/usr/share/glmark2/models/bunny.obj"
    )


def test_prims_of_the_same_name_have_looks_of_their_own() -> None:
    stage = Usd.Stage.CreateInMemory()
    surface = pieces.box_mesh(1, pieces.on_sphere(1.0))
    colors = {
        "/World/A/Ball": (1, 0, 0),
        "/World/B/Ball": (0, 1, 0),
        "/World/Ball": (0, 0, 1),
        "/World/A/B/Ball": (1, 1, 0),
    }
    meshes = {path: pieces.add_mesh(stage, path, surface, color) for path, color in colors.items()}
    for path, mesh in meshes.items():
        material, _ = UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()
        shader = UsdShade.Shader(stage.GetPrimAtPath(material.GetPath().AppendChild("Surface")))
        assert tuple(shader.GetInput("diffuseColor").Get()) == colors[path], path


@pytest.mark.parametrize("name", NAMES)
def test_no_two_prims_of_a_scene_share_a_look(name: str) -> None:
    stage = Usd.Stage.Open(str(SCENES / name))
    bound = Counter(
        str(UsdShade.MaterialBindingAPI(prim).GetDirectBinding().GetMaterialPath())
        for prim in stage.Traverse()
        if UsdShade.MaterialBindingAPI(prim).GetDirectBinding().GetMaterialPath()  # a look, not a material of physics
    )
    shared = [path for path, count in bound.items() if count > 1]
    assert not shared and all(stage.GetPrimAtPath(path).IsA(UsdShade.Material) for path in bound)
