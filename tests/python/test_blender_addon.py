"""The parts of the Blender extension that need no Blender; tests/blender has the rest."""

from __future__ import annotations

import ast
import fcntl
import importlib
import importlib.util
import json
import re
import shutil
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from eulerfsi.cli.main import main
from eulerfsi.scene import memory
from eulerfsi.scene.read import open_stage, read_scene
from pxr import UsdGeom

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "blender_addon"


@pytest.fixture
def addon(tmp_path, monkeypatch):
    """Imports a module of the extension as the zip has it: beside the tables."""
    place = tmp_path / "addon" / "extension"
    shutil.copytree(ADDON, place)
    for name in ("parameters.json", "presets.json"):
        shutil.copy(ROOT / "usd_plugin/eulerfsi_usd" / name, place)
    (place / "__init__.py").write_text("")  # the real one needs bpy
    monkeypatch.syspath_prepend(str(place.parent))
    for name in [name for name in sys.modules if name.split(".")[0] == "extension"]:
        monkeypatch.delitem(sys.modules, name)
    return lambda name: importlib.import_module(f"extension.{name}")


@pytest.fixture
def stage_module():
    spec = importlib.util.spec_from_file_location("blender_stage", ADDON / "runner" / "stage.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_manifest_has_the_version_of_the_package():
    manifest = tomllib.loads((ADDON / "blender_manifest.toml").read_text())
    package = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert manifest["version"] == package["version"] and manifest["platforms"] == ["linux-x64"]


def test_what_imports_bpy_is_gpl():
    files = [*ADDON.rglob("*.py"), *(ROOT / "tests" / "blender").glob("*.py")]
    users = [path for path in files if re.search(r"^import (bpy|addon_utils)", path.read_text(), re.M)]
    assert len(users) > 8
    assert [p.name for p in users if not p.read_text().startswith("# SPDX-License-Identifier: GPL-3.0-or-later")] == []
    assert "GNU GENERAL PUBLIC LICENSE" in (ADDON / "LICENSE").read_text()[:200]


def test_every_row_has_a_property_and_presets_are_rows(addon):
    table, presets = addon("table"), addon("presets")
    data = json.loads((ROOT / "usd_plugin/eulerfsi_usd/parameters.json").read_text())
    shown = {(scope, row["name"]) for scope in table.SCOPES for row in table.rows(scope).values()}
    assert shown == {(row["scope"], row["name"]) for row in data["parameters"]} - table.FROM_OBJECT
    rows = table.rows("solid")
    assert len(presets.PRESETS) >= 5 and presets.KEPT & set(rows) == presets.KEPT - {"enabled", "surface_file"}
    for preset in presets.PRESETS.values():
        assert preset.behaves and set(preset.values) <= set(rows) - presets.KEPT
        for name, value in preset.values.items():
            low, high = (rows[name].get("hard") or (None, None))[:2]
            assert (low is None or value >= low) and (high is None or value <= high), name
    assert table.plain(float(np.float32(0.3))) == 0.3
    assert [name for name, row in rows.items() if table.is_advanced(row)] == ["material", "contact_stiffness"]


def test_values_with_names_are_choices(addon):
    table = addon("table")
    named = {(scope, n): r for scope in table.SCOPES for n, r in table.rows(scope).items() if "names" in r}
    assert list(named) == [("domain", "step_tolerance")]
    (row,) = named.values()
    choices = {label: value for _, label, value in table.choices(row)}
    assert choices == {"Default": 0.0, "Loose": 0.5, "Normal": 0.15, "Fine": 0.05, "Custom": None}
    for value, label in ((0.0, "Default"), (0.15, "Normal"), (0.2, "Custom")):
        assert list(choices)[table.choice_of(row, float(np.float32(value)))] == label


# Options that no bake of Blender passes, so that no message of one is about them.
NOT_PASSED = {"--confine", "--flipbook", "--frames", "--path-map", "--region", "--set", "--start-frame", "--start-from"}
NOT_PASSED |= {"--strict", "--max-wall-seconds", "--from-usd", "--solid", "--wait"}


def advice() -> dict[str, str]:
    """{text: file} of every string in the run's code that names an option; of an f-string its parts, with 7 between."""
    found = {}
    for path in [p for folder in ("cache", "run", "scene") for p in (ROOT / "batch/eulerfsi" / folder).glob("*.py")]:
        tree = ast.parse(path.read_text())
        documented = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
        inside = {id(part) for n in ast.walk(tree) if isinstance(n, ast.JoinedStr) for part in n.values}
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                text = "".join(part.value if isinstance(part, ast.Constant) else "7" for part in node.values)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside | documented:
                text = node.value
            else:
                continue
            if re.search(r"(^|[\s(;])(--[a-z]|-o\b)", text) and not text.startswith("-"):
                found[text] = path.name
    return found


def test_no_message_names_an_option_of_the_command_line(addon):
    translate, told = addon("wording").in_blender, advice()
    assert any("make room" in text for text in told) and len(told) > 8
    left = {text: set(re.findall(r"(?<![\w-])(?:--[a-z][a-z-]*|-o\b)", translate(text))) - NOT_PASSED for text in told}
    assert {text: options for text, options in left.items() if options} == {}
    assert translate("c: --rebake-from 4: x") == "c: Bake from Frame 5: x"
    assert "Set the value back, or" in translate(
        "c: cannot resume, the scene has changed since the cache was started: E"
    )
    assert translate("whether it can yield must be those of the checkpoint").endswith("Bake Anew takes other ones")
    assert translate("a cache; continue it with --resume or replace it with --overwrite") == (
        "a cache; continue it with Resume or replace it with Bake Anew"
    )


def test_messages_name_parameters_as_the_panels_do(addon) -> None:
    translate, table = addon("wording").in_blender, addon("table")
    label = {row["name"]: row["label"] for scope in table.SCOPES for row in table.rows(scope).values()}
    told = "“Cube”: youngsModulus = 1 Pa: must be at least 10 Pa; voxel_size = 0.05: must be 0.06"
    assert translate(told) == (
        f"“Cube”: {label['youngsModulus']} = 1 Pa: must be at least 10 Pa; {label['voxelSize']} = 0.05: must be 0.06"
    )
    for same in ("wallYMax = open", "shots/youngsModulus/x.usda: cannot be read", "its density is 3", "readOnly"):
        assert translate(same) == same


def export(folder: Path, unit: float) -> Path:
    """What Blender writes of a cube of 0.2 m in a scene of that unit; its top is pinned, the emitter keyed."""
    folder.mkdir()
    side = 0.1 / unit
    points = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) * side
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    pin = (points[:, 2] > 0).astype(np.float32)
    arrays = {"points": points, "counts": np.full(6, 4, np.int32), "indices": np.array(faces, np.int32).ravel()}
    np.savez(folder / "Cube.npz", **arrays, pin=pin)
    np.savez(folder / "Smoke.npz", **arrays)

    def place(scale: float, z: float) -> list[float]:
        return [scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, z / unit, 0, 0, 0, 1]

    solid = {
        "density": 900.0,
        "youngsModulus": 5000.0,
        "velocity": [0.0, 0.0, 0.0],
        "angularVelocity": [0.0, 0.0, 90.0],
    }
    solid["angularVelocity"] = [0.0, 0.0, 0.0]
    smoke = {"smokeDensity": {"1": 0.5, "2": 1.0}, "mode": "continuous", "velocity": [0.0, 0.0, 0.3]}
    prims = [
        {"path": "/World/Domain", "shape": {"type": "Cube"}, "matrices": {"1": place(1.0 / unit, 0.0)}}
        | {"values": {"domain": {"voxelSize": 0.05, "fluidDensity": 1.2, "wallXMin": "open"}}},
        {"path": "/World/Cube", "shape": {"type": "Mesh", "file": "Cube.npz"}, "matrices": {"1": place(1.0, 0.1)}}
        | {"values": {"solid": solid}, "relationships": {"pinTo": ["/World/Hand"]}},
        {"path": "/World/Hand", "shape": {"type": "Xform"}, "values": {}}
        | {"matrices": {str(f): place(1.0, 0.01 * f) for f in (1, 2, 3)}},
        {"path": "/World/Smoke", "shape": {"type": "Mesh", "file": "Smoke.npz"}, "matrices": {"1": place(1.0, -0.3)}}
        | {"values": {"emitter": smoke}},
    ]
    scene = {"meters_per_unit": unit, "fps": 24.0, "first": 1, "last": 3, "gravity": [0.0, 0.0, -9.81]}
    entries = [{"object": entry["path"], **entry} for entry in prims]
    (folder / "scene.json").write_text(json.dumps({**scene, "prims": entries}))
    return folder


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_stage_of_an_export_is_the_same_in_every_unit(tmp_path, stage_module, unit):
    stage_module.write_stage(export(tmp_path / "export", unit), tmp_path / "scene.usdc")
    stage = open_stage(tmp_path / "scene.usdc")
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == unit
    scene = read_scene(stage, tmp_path / "scene.usdc")
    assert scene.domain["voxel_size"] == pytest.approx(0.05) and scene.domain["fluid_density"] == pytest.approx(1.2)
    assert scene.domain["domain_size"] == pytest.approx([1.0] * 3) and scene.domain["gravity"][2] == pytest.approx(
        -9.81
    )
    (solid,) = scene.solids
    assert solid.values["density"] == pytest.approx(900.0, rel=1e-6) and solid.values["youngs_modulus"] == 5000.0
    assert np.ptp(solid.mesh.points, axis=0) == pytest.approx([0.2] * 3, rel=1e-5)
    (pin,) = scene.pins
    assert pin.vertices.sum() == 4 and pin.motion.moves
    (emitter,) = scene.emitters
    assert emitter.over_time("density").max() == pytest.approx(1.0) and emitter.keys
    assert emitter.values["velocity"] == pytest.approx([0, 0, 0.3], rel=1e-6)


def test_estimates_are_those_of_the_library(addon):
    estimate = addon("estimate")
    box = np.array([(0, 0, 0), (0.4, 0.3, 0.2)])
    for fluid in (True, False):
        domain = {
            "domain_size": [2.0, 1.5, 1.0],
            "domain_min": [0, 0, 0],
            "voxel_size": 0.04,
            "ambient_fluid": int(fluid),
        }
        mesh = type("Box", (), {"points": box})
        told, _ = memory.estimate(domain, [mesh], 0)
        assert estimate.memory([2.0, 1.5, 1.0], 0.04, [(0.4, 0.3, 0.2)], fluid) == pytest.approx(told, rel=0.01)
    assert estimate.cells((1.0, 0.5, 0.26), 0.25) == 4 * 2 * 2
    assert estimate.text(1_234_567) == "1.23 MB" and estimate.text(12) == "12 B"


def test_state_comes_from_manifest_and_lock(addon, tmp_path):
    job = addon("job")
    cache = tmp_path / "bake" / "cache"
    cache.mkdir(parents=True)
    folder = cache.parent
    assert job.look(folder).status == "none"
    frames = {"1": {"files": {"vdb/s.0001.vdb": {"bytes": 10}, "frames/s.0001.usdc": {"bytes": 5}}}}
    checkpoints = [{"frame": 1, "time": 0.0}, {"frame": 1, "time": 0.02}]  # the second is of a run that was stopped
    facts = {"first": 1, "last": 9, "fps": 24.0, "grids": ["density"], "frames": frames, "checkpoints": checkpoints}
    (cache / "manifest.json").write_text(json.dumps({"status": "running", **facts}))
    found = job.look(folder)
    assert (found.status, found.frames, found.smoke, found.bytes) == ("stopped", [1], [1], 15)
    assert found.checkpoints == [1]
    with open(cache / ".lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert job.look(folder).status == "running"
        with pytest.raises(job.JobError, match="cancel it first"):
            job.free(folder)
    (folder / "events.jsonl").write_text('{"event": "error", "code": "scene"')  # a line that is not whole yet
    work = job.Job(folder)
    assert not work.read() and not work.told.findings
    with open(folder / "events.jsonl", "a") as events:
        events.write(', "prim": "/World/A", "field": null, "message": "bad"}\n')
    assert work.read() and work.told.findings[0]["message"] == "bad"
    job.free(folder)
    assert not folder.exists()


def test_density_scale_is_that_of_the_volume_prim(addon, stage_module, tmp_path):
    job, folder = addon("job"), tmp_path / "bake"
    stage_module.write_stage(export(tmp_path / "export", 0.01), tmp_path / "scene.usdc")
    words = ["simulate", str(tmp_path / "scene.usdc"), "-o", str(folder / "cache"), "--frames", "1-2"]
    assert main([*words, "--progress", "none"]) == 0
    layer = folder / "cache" / "scene.usda"
    stage = open_stage(layer)
    scale = stage.GetPrimAtPath("/World/smoke").GetAttribute("eulerfsi:densityScale").Get()
    assert job.density_scale(folder) == pytest.approx(scale, rel=1e-6) and scale == pytest.approx(10.0)
    layer.write_text(layer.read_text().replace("eulerfsi:densityScale", "other"))
    with pytest.raises(ValueError, match=r"scene.usda: no Volume has eulerfsi:densityScale"):
        job.density_scale(folder)


_BAKES = """import sys, time
from pathlib import Path
print('{"event": "start", "first": 1, "last": 9}', flush=True)
while not Path(sys.argv[1]).with_name("end").exists():
    time.sleep(0.02)
"""


def test_second_bake_is_refused_while_the_first_runs(addon, tmp_path, monkeypatch):
    job = addon("job")
    (tmp_path / "solver" / "eulerfsi").mkdir(parents=True)
    (tmp_path / "runner.py").write_text(_BAKES)
    monkeypatch.setattr(job, "SOLVER", tmp_path / "solver")
    monkeypatch.setattr(job, "_RUNNER", tmp_path / "runner.py")
    folder = tmp_path / "bake"
    folder.mkdir()
    (folder / "events.jsonl").write_text('{"event": "end", "status": "failed"}\n' * 9)
    other = job.Job(folder)  # as another Blender sees it
    assert other.read() and other.told.end and not other.alive
    first = job.start(folder, "1", ["simulate"], "a.usdc")
    try:
        while not first.read():
            assert first.alive
        assert other.read() and other.told.start and other.told.end is None and other.alive
        with pytest.raises(job.JobError, match="another Blender bakes here"):
            job.start(folder, "1", ["other"], "b.usdc")
        assert json.loads((folder / "task.json").read_text())["stage"] == "a.usdc"
        with pytest.raises(job.JobError, match="still reads the scene"):
            other.stop()
        with pytest.raises(job.JobError, match="cancel it first"):
            job.free(folder)
    finally:
        (folder / "end").touch()
        first.wait()
    assert not other.alive and not job.baking(folder)


def test_package_names_a_missing_wheel(tmp_path, capsys):
    assert main(["package", "blender", "-o", str(tmp_path), "--wheel", str(tmp_path / "none.whl")]) == 2
    assert "none.whl: no such file" in capsys.readouterr().err
    assert main(["package", "wheel", "-o", str(tmp_path), "--wheel", "some.whl"]) == 2
    assert "--wheel: belongs to `package blender`" in capsys.readouterr().err
