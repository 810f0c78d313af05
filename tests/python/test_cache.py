"""The cache: opens in USD over the scene, moves as a folder, holds what it says; volumes lie where the meshes are."""

from __future__ import annotations

import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import author, content_hashes, environment, make_scene, write_obj
from eulerfsi import __version__, files
from eulerfsi.errors import CacheIOError, Cancelled
from eulerfsi.log import Log
from eulerfsi.progress import Progress
from eulerfsi.run.simulate import Options, simulate
from eulerfsi.solver import binding
from pxr import Gf, Sdf, Usd, UsdGeom, UsdValidation, UsdVol, Vt

pytestmark = pytest.mark.usefixtures("library")


def run(scene: Path, **options) -> Path:
    """Simulates into <scene>_cache beside the scene."""
    folder = scene.with_name(f"{scene.stem}_cache")
    simulate(scene, Options(output=folder, progress="none", **options), Log())
    return folder


@pytest.fixture(scope="module")
def cache(tmp_path_factory, library) -> Path:
    """Three frames of the small scene."""
    folder = tmp_path_factory.mktemp("cache")
    make_scene(folder / "small.usda")
    return run(folder / "small.usda")


def test_layout_and_frame_numbers(cache):
    names = {p.relative_to(cache).as_posix() for p in cache.rglob("*") if p.is_file()}
    frames = {f"frames/small.{f:04d}.usdc" for f in (1, 2, 3)} | {f"vdb/small.{f:04d}.vdb" for f in (1, 2, 3)}
    fixed = {"small.usda", "scene/small.usda", "frames/small.manifest.usda", "manifest.json", "stats.jsonl", "log"}
    fixed |= {"manifest.backup.json"}
    checkpoints = {name for name in names if name.startswith("checkpoints/")}
    shown = {"preview.png"} | {f"preview/small.{f:04d}.png" for f in (1, 2, 3)}
    assert names == frames | fixed | shown | checkpoints
    assert len(checkpoints) == 2  # after the first frame and the last


def test_first_frame_is_the_initial_state_and_later_ones_fall(cache):
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    original = Usd.Stage.Open(str(cache / "scene/small.usda"))
    rest = np.array(UsdGeom.Mesh(original.GetPrimAtPath("/World/Ball")).GetPointsAttr().Get())
    points = {f: np.array(mesh.GetPointsAttr().Get(f)) for f in (1, 2, 3)}
    np.testing.assert_allclose(points[1], rest, atol=1e-6)
    for frame in (2, 3):
        time = (frame - 1) / 24
        fallen = (points[frame] - rest)[:, 1].mean()
        assert -2 * time - 9.8 * time**2 < fallen < -2 * time - 4.5 * time**2
    velocity = np.array(mesh.GetVelocitiesAttr().Get(2)).mean(axis=0)
    np.testing.assert_allclose(velocity, (0, -2 - 9.8 / 24, 0), rtol=0.03, atol=0.03)


def test_velocities_are_what_moves_the_points(cache):
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    moved = (np.array(mesh.GetPointsAttr().Get(3)) - np.array(mesh.GetPointsAttr().Get(2))) * 24
    velocities = [np.array(mesh.GetVelocitiesAttr().Get(f)) for f in (2, 3)]
    np.testing.assert_allclose(moved.mean(axis=0), (velocities[0] + velocities[1]).mean(axis=0) / 2, atol=0.25)


def test_only_what_moves_is_authored_and_the_rest_survives(cache):
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    prim = stage.GetPrimAtPath("/World/Ball")
    layer = Sdf.Layer.FindOrOpen(str(cache / "frames/small.0002.usdc"))
    spec = layer.GetPrimAtPath("/World/Ball")
    assert {p.name for p in spec.properties} == {"points", "velocities", "normals", "extent"}
    assert spec.specifier == Sdf.SpecifierOver and layer.ListAllTimeSamples() == [2.0]
    assert len(UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").Get()) == len(UsdGeom.Mesh(prim).GetPointsAttr().Get(2))
    assert prim.GetAttribute("eulerfsi:youngsModulus").Get() == 23333.0


def test_extent_and_normals_belong_to_the_points(cache):
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    for frame in (1, 2, 3):
        points, normals = np.array(mesh.GetPointsAttr().Get(frame)), np.array(mesh.GetNormalsAttr().Get(frame))
        np.testing.assert_array_equal(mesh.GetExtentAttr().Get(frame), [points.min(axis=0), points.max(axis=0)])
        outward = points - points.mean(axis=0)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        assert ((normals * outward).sum(axis=1) > 0.95).all()
    assert mesh.GetNormalsInterpolation() == UsdGeom.Tokens.vertex


def test_usd_validators_find_no_error(cache):
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    registry = UsdValidation.ValidationRegistry()
    errors = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage)
    kinds = [(e.GetName(), e.GetMessage()) for e in errors if e.GetType() == UsdValidation.ValidationErrorType.Error]
    assert kinds == []


def test_stage_metadata_and_provenance(cache):
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (1, 3, 24)
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    data = stage.GetRootLayer().customLayerData["eulerfsi"]
    manifest = json.loads((cache / "manifest.json").read_text())
    assert data["scene_hash"] == manifest["scene_hash"]
    assert data["program"]["eulerfsi"] == manifest["program"]["eulerfsi"] == __version__
    assert data["parameters"]["/World/Domain"]["voxel_size"] == 0.05
    assert manifest["parameters"]["/World/Ball"]["density"] == pytest.approx(1000)
    assert manifest["status"] == "complete"


def test_manifest_has_size_and_hash_of_every_file(cache):
    manifest = json.loads((cache / "manifest.json").read_text())
    assert list(manifest["frames"]) == ["1", "2", "3"]
    for number, frame in manifest["frames"].items():
        assert frame["time"] == pytest.approx((int(number) - 1) / 24, abs=1e-12)
        assert len(frame["files"]) == 2
        for name, facts in frame["files"].items():
            content = (cache / name).read_bytes()
            assert facts["bytes"] == len(content)
            assert facts["sha256"] == hashlib.sha256(content).hexdigest()


def test_content_hash_is_of_the_values(cache):
    manifest = json.loads((cache / "manifest.json").read_text())
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    digest = hashlib.sha256(b"/World/Ball")
    for attribute in (mesh.GetPointsAttr(), mesh.GetVelocitiesAttr()):
        digest.update(np.array(attribute.Get(2), np.float32).tobytes())
    assert manifest["frames"]["2"]["files"]["frames/small.0002.usdc"]["content"] == digest.hexdigest()


def test_a_second_run_in_another_process_writes_the_same_bytes(cache, tmp_path):
    again = tmp_path / "again"
    command = [sys.executable, "-m", "eulerfsi", "simulate", cache.parent / "small.usda", "-o", again]
    subprocess.run([*command, "--threads", "2", "--progress", "none"], check=True, env=environment())
    names = {p.relative_to(cache) for p in cache.rglob("*") if p.is_file()}
    assert names == {p.relative_to(again) for p in again.rglob("*") if p.is_file()}
    # What tells of the run and not of the scene: dates and times.
    timed = {Path("log"), Path("stats.jsonl")}
    assert timed < names
    assert not [name for name in names - timed if (cache / name).read_bytes() != (again / name).read_bytes()]
    timeless = lambda data: {key: value for key, value in data.items() if "seconds" not in key}  # noqa: E731
    first, second = (
        [json.loads(line, object_hook=timeless) for line in (folder / "stats.jsonl").read_text().splitlines()]
        for folder in (cache, again)
    )
    assert first == second


def test_statistics_have_every_step_and_frame(cache):
    lines = [json.loads(line) for line in (cache / "stats.jsonl").read_text().splitlines()]
    frames = [line for line in lines if line["event"] == "frame"]
    steps = [line for line in lines if line["event"] == "step"]
    assert [line["frame"] for line in frames] == [1, 2, 3]
    assert len(steps) == frames[-1]["steps"]
    times = [line["time"] for line in steps]
    assert times == sorted(set(times)) and times[-1] == pytest.approx(2 / 24)
    assert frames[-1]["solids"]["/World/Ball"]["mass"] > 0 and frames[-1]["profile"]["total_seconds"] > 0
    for line in steps:
        assert line["repairs"]["repaired_cells"] == 0 and 0.9 < line["repairs"]["min_det_f_before"] <= 1.001
        assert abs(line["transport_error"]["/World/Ball"]["volume_mesh"]) < 0.01 and "energy" not in line
        assert abs(line["transport_error"]["/World/Ball"]["mass"]) < 0.01


def test_the_energy_ledger_adds_columns_and_changes_nothing(cache, tmp_path):
    shutil.copy(cache.parent / "small.usda", tmp_path)
    folder = run(tmp_path / "small.usda", settings=("Domain.energyLedger=true",))
    assert content_hashes(folder) == content_hashes(cache)
    lines = [json.loads(line) for line in (folder / "stats.jsonl").read_text().splitlines()]
    steps = [line["energy"] for line in lines if line["event"] == "step"]
    assert [list(step["change"]) for step in steps] == [list(binding.ENERGY_STAGES)] * len(steps)
    for before, step in zip(steps[:-1], steps[1:], strict=True):  # a step begins with what the one before it left
        changes = sum(sum(column.values()) for column in step["change"].values())
        assert sum(step["at_end"].values()) - changes == pytest.approx(sum(before["at_end"].values()), rel=1e-6)


def two_balls(path: Path, frames: tuple[int, int]) -> Path:
    """The small scene without smoke, a second ball under the first one, which falls on it."""
    stage = make_scene(path, frames=frames, smoke=False)
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, "/World/Ball", layer, "/World/Under")
    under = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Under"))
    points = np.array(under.GetPointsAttr().Get())
    points[:, 1] = 0.5 * points[:, 1] - 0.4
    under.GetPointsAttr().Set(points)
    under.GetExtentAttr().Set(UsdGeom.Mesh.ComputeExtent(under.GetPointsAttr().Get()))
    author(under.GetPrim(), velocity=(0.0, 0.0, 0.0))
    layer.Save()
    return path


def frame_lines(folder: Path) -> list[dict]:
    lines = [json.loads(line) for line in (folder / "stats.jsonl").read_text().splitlines()]
    return [line for line in lines if line["event"] == "frame"]


def test_statistics_list_solids_that_push_each_other(tmp_path):
    lines = frame_lines(run(two_balls(tmp_path / "two.usda", (1, 6))))
    touched = [line for line in lines if "contacts" in line]
    assert touched and "contacts" not in lines[0]  # nothing where nothing touches
    for line in touched:
        (pair,) = line["contacts"]["pairs"]
        assert line["contacts"]["velocity_iterations"] > 0
        assert pair["solids"] == ["/World/Ball", "/World/Under"] and pair["active_rows"] <= pair["rows"]
        assert 0 <= pair["sticking_share"] <= 1 and max(pair["surface_overlap"], pair["row_overlap"]) < 1.2
    # The ball above is pushed up, the other one down, by about what the first one loses.
    down = sum(line["contacts"]["pairs"][0]["impulse"][1] for line in touched)
    first, last = (line["solids"]["/World/Ball"] for line in (lines[0], lines[-1]))
    lost = first["momentum"][1] - last["momentum"][1] - 9.8 * first["mass"] * lines[-1]["time"]
    assert down == pytest.approx(lost, rel=0.1) and down < 0


def test_a_frame_that_was_stopped_inside_counts_all_of_its_contacts(tmp_path, monkeypatch):
    scene = two_balls(tmp_path / "two.usda", (1, 5))
    whole = frame_lines(run(scene))
    before = Progress.between_steps

    def stop(self: Progress, frame: int, fraction: float, seconds: float) -> None:
        before(self, frame, fraction, seconds)
        if frame == 4:
            os.kill(os.getpid(), signal.SIGTERM)

    with monkeypatch.context() as patch:
        patch.setattr(Progress, "between_steps", stop)
        with pytest.raises(Cancelled):
            simulate(scene, Options(output=tmp_path / "stopped", progress="none"), Log())
    manifest = json.loads((tmp_path / "stopped/manifest.json").read_text())
    assert manifest["checkpoints"][-1]["stopped"]["pairs"]
    simulate(scene, Options(output=tmp_path / "stopped", progress="none", resume=True), Log())
    lines = frame_lines(tmp_path / "stopped")
    assert whole[3]["contacts"]["pairs"][0]["steps"] > 1  # the frame that is stopped has contact in several steps
    for line, other in zip(lines, whole, strict=True):
        assert ("contacts" in line) == ("contacts" in other)
        if "contacts" not in line:
            continue
        (pair,), (expected,) = line["contacts"]["pairs"], other["contacts"]["pairs"]
        assert line["contacts"]["velocity_iterations"] == other["contacts"]["velocity_iterations"]
        assert pair.pop("impulse") == pytest.approx(expected.pop("impulse"))
        assert pair.pop("normal_impulse") == pytest.approx(expected.pop("normal_impulse"))
        assert pair == expected


def test_moved_folder_opens_without_its_scene(cache, tmp_path):
    shutil.copytree(cache, tmp_path / "elsewhere")
    stage = Usd.Stage.Open(str(tmp_path / "elsewhere" / "small.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball"))
    assert mesh.GetPointsAttr().Get(3) and mesh.GetFaceVertexCountsAttr().Get()
    asset = UsdVol.OpenVDBAsset(stage.GetPrimAtPath("/World/smoke/density"))
    assert Path(asset.GetFilePathAttr().Get(3).resolvedPath) == tmp_path / "elsewhere" / "vdb" / "small.0003.vdb"
    for text in ("manifest.json", "small.usda", "log"):
        assert str(cache) not in (tmp_path / "elsewhere" / text).read_text()


def test_volume_has_all_grids_of_each_frame_in_one_file(cache, read_vdb):
    stage = Usd.Stage.Open(str(cache / "small.usda"))
    volume = UsdVol.Volume(stage.GetPrimAtPath("/World/smoke"))
    assert set(volume.GetFieldPaths()) == {"density", "vel"}
    kinds = {"density": "float", "vel": "float3"}
    for name, path in volume.GetFieldPaths().items():
        asset = UsdVol.OpenVDBAsset(stage.GetPrimAtPath(path))
        assert asset.GetFieldNameAttr().Get() == name and asset.GetFieldDataTypeAttr().Get() == kinds[name]
        assert asset.GetFilePathAttr().GetTimeSamples() == [1, 2, 3]
    for frame in (1, 3):
        grids = read_vdb(cache / f"vdb/small.{frame:04d}.vdb")
        assert set(grids) == {"density", "vel"}
        assert grids["density"]["class"] == "fog volume"
        # The carpet: 0.6 x 0.2 x 0.6 m around y = -0.4, filled with 0.8.
        volume_of_smoke = grids["density"]["sum"] * grids["density"]["voxel_size"] ** 3
        assert volume_of_smoke == pytest.approx(0.8 * 0.6 * 0.2 * 0.6, rel=0.1)
        np.testing.assert_allclose(grids["density"]["centroid"], (0, -0.4, 0), atol=0.03)


def test_preview_is_a_picture_with_a_solid_and_smoke(cache):
    from matplotlib import image

    pixels = image.imread(cache / "preview.png")[..., :3]
    assert min(pixels.shape[:2]) > 400
    reddish = pixels[..., 0] > pixels[..., 2] + 0.2
    bluish = (pixels[..., 2] > pixels[..., 0] + 0.02) & (pixels.mean(axis=2) > 0.2)
    assert 0.05 < reddish.mean() < 0.5 and bluish.mean() > 0.05


def test_scene_without_smoke_writes_no_volume(tmp_path):
    make_scene(tmp_path / "dry.usda", smoke=False)
    folder = run(tmp_path / "dry.usda")
    assert not (folder / "vdb").exists()
    stage = Usd.Stage.Open(str(folder / "dry.usda"))
    assert not [p for p in stage.Traverse() if p.IsA(UsdVol.Volume)]


def test_scene_without_solids_writes_volumes_only(tmp_path):
    stage = make_scene(tmp_path / "wet.usda")
    stage.RemovePrim("/World/Ball")
    stage.GetRootLayer().Save()
    folder = run(tmp_path / "wet.usda")
    manifest = json.loads((folder / "manifest.json").read_text())
    assert [list(f["files"]) for f in manifest["frames"].values()] == [[f"vdb/wet.{n:04d}.vdb"] for n in (1, 2, 3)]


def test_surface_file_becomes_a_mesh_below_its_prim(tmp_path):
    stage = make_scene(tmp_path / "file.usda", smoke=False)
    write_obj(tmp_path / "ball.obj", 0.15)
    stage.RemovePrim("/World/Ball")
    xform = UsdGeom.Xform.Define(stage, "/World/Part")
    xform.AddTranslateOp().Set(Gf.Vec3d(0.1, 0, 0))
    xform.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    xform.GetPrim().GetAttribute("eulerfsi:surfaceFile").Set("./ball.obj")
    stage.GetRootLayer().Save()
    opened = Usd.Stage.Open(str(run(tmp_path / "file.usda") / "file.usda"))
    mesh = UsdGeom.Mesh(opened.GetPrimAtPath("/World/Part/surface"))
    points = np.array(mesh.GetPointsAttr().Get(1))
    assert sum(mesh.GetFaceVertexCountsAttr().Get()) == len(mesh.GetFaceVertexIndicesAttr().Get())
    np.testing.assert_allclose((points.min(axis=0) + points.max(axis=0)) / 2, 0, atol=1e-5)  # local space
    assert points.max() == pytest.approx(0.15, abs=1e-5)
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none" and mesh.GetNormalsAttr().Get(2)


def test_old_normals_do_not_stay_on_a_deformed_mesh(tmp_path):
    stage = make_scene(tmp_path / "n.usda", smoke=False)
    prim = stage.GetPrimAtPath("/World/Ball")
    count = len(UsdGeom.Mesh(prim).GetPointsAttr().Get())
    normals = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
        "normals", Sdf.ValueTypeNames.Normal3fArray, UsdGeom.Tokens.vertex
    )
    normals.Set([(0, 0, 1)] * count)
    stage.GetRootLayer().Save()
    opened = Usd.Stage.Open(str(run(tmp_path / "n.usda") / "n.usda"))
    copy = opened.GetPrimAtPath("/World/Ball")
    assert not UsdGeom.PrimvarsAPI(copy).GetPrimvar("normals").HasValue()
    assert len(UsdGeom.Mesh(copy).GetNormalsAttr().Get(2)) == count


def test_subdivided_mesh_gets_no_normals(tmp_path):
    stage = make_scene(tmp_path / "s.usda", smoke=False)
    UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetSubdivisionSchemeAttr().Set("catmullClark")
    stage.GetRootLayer().Save()
    opened = Usd.Stage.Open(str(run(tmp_path / "s.usda") / "s.usda"))
    mesh = UsdGeom.Mesh(opened.GetPrimAtPath("/World/Ball"))
    assert not mesh.GetNormalsAttr().HasValue() and mesh.GetPointsAttr().Get(3)


def test_animated_points_of_the_scene_do_not_shine_through(tmp_path):
    stage = make_scene(tmp_path / "a.usda", smoke=False)
    attribute = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetPointsAttr()
    rest = np.array(attribute.Get())
    for frame in (1, 3):
        attribute.Set(rest + (frame - 1, 0, 0), frame)
    stage.GetRootLayer().Save()
    opened = Usd.Stage.Open(str(run(tmp_path / "a.usda") / "a.usda"))
    points = np.array(UsdGeom.Mesh(opened.GetPrimAtPath("/World/Ball")).GetPointsAttr().Get(3))
    assert abs(points[:, 0].mean()) < 0.01


def test_animated_parent_carries_no_motion_into_the_points(tmp_path):
    """A solid whose prim moves: points and velocities are relative to it, in world space nothing changes."""
    stage = make_scene(tmp_path / "p.usda", smoke=False)
    still = content_hashes(run(tmp_path / "p.usda"))
    move = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Ball")).AddTranslateOp()
    for frame in (1, 4):
        move.Set(Gf.Vec3d(0.03 * (frame - 1), 0, 0), frame)
    stage.GetRootLayer().Save()
    folder = run(tmp_path / "p.usda", overwrite=True)
    states = content_hashes(folder)
    assert [states[f][0] for f in states] == [still[f][0] for f in still]  # the same simulation
    opened = Usd.Stage.Open(str(folder / "p.usda"))
    prim = opened.GetPrimAtPath("/World/Ball")
    local = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(3))
    assert local[:, 0].mean() == pytest.approx(-0.06, abs=0.01)
    assert np.array(UsdGeom.Mesh(prim).GetVelocitiesAttr().Get(3))[:, 0].mean() == pytest.approx(-0.03 * 24, abs=0.05)


def test_several_root_prims_and_a_bare_domain(tmp_path):
    """A scene without an Xform around it: the Volume gets a root prim of its own, bindings across roots survive."""
    stage = make_scene(tmp_path / "flat.usda")
    layer = stage.GetRootLayer()
    for name in ("Domain", "Ball", "Carpet"):
        Sdf.CopySpec(layer, f"/World/{name}", layer, f"/{name}")
    stage.RemovePrim("/World")
    layer.ClearDefaultPrim()
    stage.GetPrimAtPath("/Ball").CreateRelationship("look").AddTarget("/Carpet")
    layer.Save()
    opened = Usd.Stage.Open(str(run(tmp_path / "flat.usda") / "flat.usda"))
    assert opened.GetPrimAtPath("/EulerFsiCache/smoke").IsA(UsdVol.Volume)
    assert opened.GetDefaultPrim()
    assert opened.GetPrimAtPath("/Ball").GetRelationship("look").GetTargets() == ["/Carpet"]
    assert UsdGeom.Mesh(opened.GetPrimAtPath("/Ball")).GetPointsAttr().Get(2)


def test_half_of_the_domain_moves_nothing_else(tmp_path):
    """An override reaches the solver and is written down; the copied scene stays as it was."""
    make_scene(tmp_path / "o.usda", smoke=False)
    folder = run(tmp_path / "o.usda", settings=("Ball.velocity=0,0,0", "Domain.voxelSize=0.06"))
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["overrides"]["/World/Ball.eulerfsi:velocity"] == "0,0,0"
    assert manifest["parameters"]["/World/Domain"]["voxel_size"] == 0.06
    stage = Usd.Stage.Open(str(folder / "o.usda"))
    assert stage.GetPrimAtPath("/World/Domain").GetAttribute("eulerfsi:voxelSize").Get() == 0.05
    fallen = np.array(UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetPointsAttr().Get(2))[:, 1].mean()
    assert -9.8 / 24**2 * 1.05 < fallen < -4.5 / 24**2


def test_temperature_grid_where_something_is_hot(tmp_path, read_vdb):
    stage = make_scene(tmp_path / "hot.usda", frames=(1, 2))
    author(stage.GetPrimAtPath("/World/Carpet"), smokeTemperature=300.0)
    stage.GetRootLayer().Save()
    folder = run(tmp_path / "hot.usda")
    assert set(read_vdb(folder / "vdb/hot.0002.vdb")) == {"density", "vel", "temperature"}
    opened = Usd.Stage.Open(str(folder / "hot.usda"))
    assert set(UsdVol.Volume(opened.GetPrimAtPath("/World/smoke")).GetFieldPaths()) == {"density", "vel", "temperature"}


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_a_layer_that_does_not_fit_on_the_disk_is_an_input_output_error(tmp_path, suffix):
    layer = Sdf.Layer.CreateAnonymous(suffix)
    values = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, "/A"), "values", Sdf.ValueTypeNames.FloatArray)
    values.default = Vt.FloatArray.FromNumpy(np.random.default_rng(1).random(50_000, dtype=np.float32))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        with pytest.raises(CacheIOError, match="layer"), files.replacing(tmp_path / f"layer{suffix}") as temporary:
            files.export_layer(layer, temporary)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []
