"""`submit --openjd`: a bundle that openjd-cli runs; references, path maps, a run that is cut off."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import content_hashes, environment, make_scene
from eulerfsi.errors import UsageError
from eulerfsi.farm.openjd import _identifier
from eulerfsi.farm.submission import references
from eulerfsi.run.simulate import Options, simulate
from pxr import Sdf

OPENJD = Path(sys.executable).with_name("openjd")


def bundle(folder: Path) -> tuple[dict, dict, dict]:
    return tuple(
        json.loads((folder / f"{name}.json").read_text())
        for name in ("template", "parameter_values", "asset_references")
    )


def openjd(command: str, folder: Path, *arguments: str, code: int = 0) -> str:
    """Runs the job of a bundle with its own parameter values."""
    values = {entry["name"]: entry["value"] for entry in bundle(folder)[1]["parameterValues"]}
    words = [str(OPENJD), command, str(folder / "template.json"), *arguments]
    if command == "run":
        words += [word for name, value in values.items() for word in ("-p", f"{name}={value}")]
    done = subprocess.run(words, capture_output=True, text=True, env=environment(), timeout=1200)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """The command line of this checkout as one command, as a node has it."""
    path = tmp_path / "eulerfsi"
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m eulerfsi "$@"\n')
    path.chmod(0o755)
    return path


@pytest.mark.slow
def test_a_wedge_runs_with_the_bits_of_its_runs_alone(cli, scene, tmp_path, program):
    """Both tasks, each validated, simulated and verified; the scene is looked for where the session's rules say."""
    (tmp_path / "there").mkdir()
    make_scene(tmp_path / "there" / "ball.usda")
    root = Sdf.Layer.CreateNew(str(tmp_path / "scene.usda"))
    ball = Sdf.Layer.FindOrOpen(str(tmp_path / "there" / "ball.usda"))
    for name in ball.pseudoRoot.ListInfoKeys():
        if name not in ("subLayers", "subLayerOffsets"):
            root.pseudoRoot.SetInfo(name, ball.pseudoRoot.GetInfo(name))
    root.subLayerPaths.append("/studio/ball.usda")
    root.Save()
    there = tmp_path / "there"
    vary = ["--vary", "Ball.velocity=(0,-2,0),(0,-1,0)", "--frames", "1-2"]
    done = cli("submit", root.realPath, "--openjd", "job", *vary, "--path-map", f"/studio={there}", "-o", "out",
               "--program", program)  # fmt: skip
    assert done.returncode == 0, done.stderr
    template = bundle(tmp_path / "job")[0]
    for step in template["steps"]:  # the session's own rules have to do it
        arguments = step["script"]["actions"]["onRun"]["args"]
        arguments[:] = [word for word in arguments if not word.startswith("--path-map=/studio")]
    (tmp_path / "job" / "template.json").write_text(json.dumps(template))
    rules = {"source_path_format": "POSIX", "source_path": "/studio", "destination_path": str(there)}
    (tmp_path / "rules.json").write_text(json.dumps({"version": "pathmapping-1.0", "path_mapping_rules": [rules]}))
    said = openjd("run", tmp_path / "job", "--path-mapping-rules", f"file://{tmp_path / 'rules.json'}")
    assert "openjd_progress: 100" in said and "Chunks run: 6" in said
    for number in (1, 2):
        velocity = f"Ball.velocity=(0,-{number},0)"
        alone = Options(output=tmp_path / f"alone{number}", frames="1-2", settings=(velocity,), progress="none")
        simulate(there / "ball.usda", alone)
        cache = tmp_path / "out" / f"Ball.velocity_0_-{number}_0"
        assert content_hashes(cache) == content_hashes(tmp_path / f"alone{number}")


@pytest.mark.slow
def test_a_timeout_and_another_run_give_the_same_bits(cli, scene, tmp_path, program):
    """The timeout of the action cuts the run off; the same job, run again without one, goes on."""
    frames = ["--frames", "1-40"]
    assert cli("submit", scene, "--openjd", "short", *frames, "--timeout", "2", "--program", program).returncode == 0
    assert cli("submit", scene, "--openjd", "long", *frames, "--program", program).returncode == 0
    template = bundle(tmp_path / "short")[0]
    action = template["steps"][1]["script"]["actions"]["onRun"]
    assert action["timeout"] == 2
    action["args"] += ["--set", "Domain.voxelSize=0.02"]  # slow enough
    (tmp_path / "short" / "template.json").write_text(json.dumps(template))
    template = bundle(tmp_path / "long")[0]
    template["steps"][1]["script"]["actions"]["onRun"]["args"] += ["--set", "Domain.voxelSize=0.02"]
    (tmp_path / "long" / "template.json").write_text(json.dumps(template))
    said = openjd("run", tmp_path / "short", "--step", "Simulate", "--no-run-dependencies", code=1)
    assert "TIMEOUT" in said.upper()
    openjd("run", tmp_path / "long")
    whole = Options(output=tmp_path / "alone", frames="1-40", settings=("Domain.voxelSize=0.02",), progress="none")
    simulate(scene, whole)
    assert content_hashes(tmp_path / "small_cache") == content_hashes(tmp_path / "alone")


def test_a_bundle_passes_the_check_and_says_what_it_needs(cli, scene, tmp_path):
    points = tmp_path / "jobs.csv"
    points.write_text("Ball.youngsModulus,Ball.poissonsRatio\n1e4,0.1\n2e4,0.2\n")
    options = ["--table", points, "--vary", "Ball.velocity=(0,-1,0),(0,-2,0)", "--threads", "3", "--timeout", "3600"]
    done = cli("submit", scene, "--openjd", "job", *options, "--parameter", "Threads=2", "--parameter",
               "deadline:priority=70")  # fmt: skip
    assert done.returncode == 0 and "4 task(s)" in done.stdout, done.stderr
    template, values, assets = bundle(tmp_path / "job")
    assert "passes validation" in openjd("check", tmp_path / "job")
    given = {entry["name"]: entry["value"] for entry in values["parameterValues"]}
    output = str(tmp_path / "small_wedge")
    assert given == {"Scene": str(scene), "OutputFolder": output, "Threads": 2, "deadline:priority": 70}
    assert assets["assetReferences"]["inputs"]["filenames"] == [str(scene)]
    assert assets["assetReferences"]["outputs"]["directories"] == [output]
    validate, run, verify = template["steps"]
    assert [step["name"] for step in (validate, run, verify)] == ["Validate", "Simulate", "Verify"]
    space = run["parameterSpace"]
    both = "(Folder1, Ball_youngsModulus, Ball_poissonsRatio) * (Folder2, Ball_velocity)"
    assert space["combination"] == both and validate["parameterSpace"] == space
    assert verify["parameterSpace"]["combination"] == "Folder1 * Folder2"
    assert run["script"]["actions"]["onRun"]["timeout"] == 3600
    memory = next(one["min"] for one in run["hostRequirements"]["amounts"] if one["name"] == "amount.worker.memory")
    assert 300 < memory < 400  # MiB, of which the small scene takes 3
    for definition in template["parameterDefinitions"]:
        assert not (definition["type"] == "PATH" and "default" in definition)


def test_a_program_of_several_words(cli, scene, tmp_path):
    """The engine starts one file: the other words are arguments."""
    python = tmp_path / "my python"
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    done = cli("submit", scene, "--openjd", "job", "--program", f"'{python}' -m eulerfsi")
    assert done.returncode == 0, done.stderr
    openjd("run", tmp_path / "job", "--step", "Validate")
    template = bundle(tmp_path / "job")[0]
    assert [step["script"]["actions"]["onRun"]["args"][:3] for step in template["steps"]] == [
        ["-m", "eulerfsi", command] for command in ("validate", "simulate", "verify")
    ]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--parameter", "Thread=2", "--threads", "1"], "the job has no parameter Thread; did you mean Threads?"),
        (["--parameter", "Threads=2"], "the job has no parameter Threads"),
        (["--parameter", "deadline:prio=2"], "the job has no parameter deadline:prio"),
        (["--parameter", "Threads"], "must read NAME=VALUE"),
        (["--parameter", "Threads=0", "--threads", "1"], "must be a whole number >= 1"),
        (["--parameter", "Scene=a/b.usda"], "must be an absolute path"),
        (["--parameter", "Scene=/a/b.usda"], "whose files and memory the bundle names"),
        (["--parameter", "Frames="], "is empty"),
        (["--parameter", "Frames=1-9x2"], "--frames '1-9x2': a step leaves frames out"),
        (["--parameter", "deadline:priority=high"], "must be a whole number >= 0"),
        (["--parameter", "deadline:targetTaskRunStatus=ready"], "must be READY or SUSPENDED"),
        (["--program", "python 'x"], "--program python 'x: is no command: no closing quotation"),
        (["--program", " "], "--program ' ': must name a command"),
        (["--timeout", "1.5"], "--timeout 1.5: must be a whole number of seconds >= 1"),
        (["--set", "Ball.material={{x}}"], "is not one of"),
        (["--vary", "Ball.youngsModuls=1"], "did you mean youngsModulus"),
        (["--vary", "Ball.youngsModulus=" + ",".join(map(str, range(1, 1026)))], "1025 values: must be at most 1024"),
        (["--slurm", "x.sh"], "not allowed with"),
    ],
)
def test_refused(cli, scene, tmp_path, options, message):
    done = cli("submit", scene, "--openjd", "job", *options)
    assert done.returncode == 2 and message in done.stderr, done.stderr
    assert not (tmp_path / "job").exists()


def test_a_scene_that_cannot_run_is_not_submitted(cli, scene, tmp_path):
    done = cli("submit", scene, "--openjd", "job", "--set", "Domain.voxelSize=-1")
    assert done.returncode == 3 and "must be > 0" in done.stderr and not (tmp_path / "job").exists()


def test_what_a_scene_refers_to(tmp_path):
    make_scene(tmp_path / "a.usda")
    root = Sdf.Layer.CreateNew(str(tmp_path / "b.usda"))
    root.subLayerPaths[:] = ["./a.usda", "./none.usda"]
    root.Save()
    found, missing = references(tmp_path / "b.usda")
    assert found == [tmp_path / "b.usda", tmp_path / "a.usda"]
    assert [os.path.basename(name) for name in missing] == ["none.usda"]


def test_names_of_task_parameters():
    assert _identifier("/World/Ball.eulerfsi:youngsModulus", []) == "Ball_youngsModulus"
    assert _identifier("/Other/Ball.youngsModulus", ["Ball_youngsModulus"]) == "VBall_youngsModulus_2"
    assert _identifier("Folder1.a", []).isidentifier() and not _identifier("Folder1.a", []).startswith("Folder")
    assert len(_identifier(f"{'x' * 100}.y", [])) <= 64


def test_a_value_with_braces_is_refused():
    from eulerfsi.farm.openjd import _plain

    with pytest.raises(UsageError):
        _plain("a{{Param.Scene}}")
