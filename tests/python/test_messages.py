"""Messages as a user sees them: one line per fault, no path twice, no noise of USD or of mesh parsers."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import environment, make_scene, sphere, write_obj
from eulerfsi.cli import info
from eulerfsi.cli.main import main
from eulerfsi.command import command_line
from eulerfsi.errors import LibraryError, SceneError
from eulerfsi.reasons import mesh_reason
from eulerfsi.scene import memory
from eulerfsi.solver.simulation import Mesh, Simulation
from eulerfsi.usd_messages import usd_messages
from pxr import Tf, Usd, UsdGeom

NOISE = re.compile(
    r"pxr|\.cpp|Traceback|Warning: in|instantiating stage|<0x|_ReportErrors|aiScene|Error in '|Sdf_|\[Errno|"
    r"EfsiSolidDef"
)
RUBBISH = bytes((i * 37 + 11) % 256 for i in range(3000))


def text_of(folder: Path) -> str:
    """A sound scene as text."""
    make_scene(folder / "sound.usda")
    return (folder / "sound.usda").read_text()


def arc(folder: Path, kind: str, asset: str) -> Path:
    """A scene that refers to a file which its solid does not need."""
    stage = make_scene(folder / "bad.usda")
    prim = stage.DefinePrim("/World/Chair", "Xform")
    if kind == "sublayer":
        stage.GetRootLayer().subLayerPaths.append(asset)
    elif kind == "payload":
        prim.GetPayloads().AddPayload(asset)
    else:
        prim.GetReferences().AddReference(asset, *(["/Nothing"] if kind == "prim" else []))
    stage.GetRootLayer().Save()
    return folder / "bad.usda"


def surface(folder: Path, name: str, content: bytes | str | None) -> Path:
    """A scene whose solid takes its surface from a file with this content."""
    if content is not None:
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    stage = make_scene(folder / "bad.usda")
    stage.GetPrimAtPath("/World/Ball").GetAttribute("eulerfsi:surfaceFile").Set(f"./{name}")
    stage.GetRootLayer().Save()
    return folder / "bad.usda"


def written(folder: Path, name: str, content: bytes | str) -> Path:
    """A file with this content."""
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / name


def made_folder(folder: Path) -> Path:
    """A folder with the name of a scene."""
    (folder / "bad.usda").mkdir()
    return folder / "bad.usda"


# name -> (makes the file that the command is given, what the message says)
CASES = {
    "missing": (lambda d: d / "bad.usda", ["bad.usda: no such file"]),
    "folder": (made_folder, ["bad.usda: is a folder"]),
    "empty": (lambda d: written(d, "bad.usda", ""), ["bad.usda: cannot be opened as USD: it is not a USD layer"]),
    "rubbish usda": (lambda d: written(d, "bad.usda", RUBBISH), ["it is not a USD layer"]),
    "rubbish usdc": (lambda d: written(d, "bad.usdc", RUBBISH), ["bad.usdc: cannot be opened as USD"]),
    "rubbish usdz": (lambda d: written(d, "bad.usdz", RUBBISH), ["it is not a USD layer"]),
    "syntax": (
        lambda d: written(d, "bad.usda", text_of(d).replace("def Mesh", "def Mesh ???", 1)),
        ["bad.usda: cannot be opened as USD: line ", "Expected }"],
    ),
    "truncated": (lambda d: written(d, "bad.usda", text_of(d)[:3000]), ["line ", "a syntax error (ListValueClose)"]),
    "no text": (lambda d: written(d, "bad.usda", text_of(d).encode().replace(b"Ball", b"B\xff\xfe")), ["not text"]),
    "future version": (lambda d: written(d, "bad.usda", text_of(d).replace("usda 1.0", "usda 9.0")), ["'9.0'"]),
    "broken sublayer": (
        lambda d: (written(d, "broken.usda", "#usda 1.0\ndef ???"), arc(d, "sublayer", "./broken.usda"))[1],
        ["bad.usda: sublayer @", "broken.usda@: cannot be opened: line 2"],
    ),
    "broken reference": (
        lambda d: (written(d, "broken.usda", "#usda 1.0\ndef ???"), arc(d, "reference", "./broken.usda"))[1],
        ["bad.usda: /World/Chair: reference @", "broken.usda@: cannot be opened: line 2"],
    ),
    "no mesh file": (lambda d: surface(d, "none.obj", None), ["/World/Ball", "surfaceFile", "none.obj"]),
    "empty mesh file": (lambda d: surface(d, "m.obj", ""), ["/World/Ball: eulerfsi:surfaceFile = ./m.obj: not a read"]),
    "rubbish obj": (lambda d: surface(d, "m.obj", RUBBISH), ["./m.obj: not a readable .obj file: it contains no mesh"]),
    "rubbish stl": (
        lambda d: surface(d, "m.stl", RUBBISH),
        ["./m.stl: not a readable .stl file: it is not an STL file"],
    ),
    "broken gltf": (
        lambda d: surface(d, "m.gltf", '{"asset":'),
        ["./m.gltf: not a readable .gltf file: it is damaged"],
    ),
    "no faces": (lambda d: surface(d, "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), ["./m.obj", "it contains no faces"]),
    "nan in mesh file": (
        lambda d: surface(d, "m.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ["./m.obj: point 0", "not finite"],
    ),
    "flat mesh file": (
        lambda d: surface(d, "m.obj", "v 0.1 0.0 0.0\nv 0.0 0.0 0.1\nv 0.0 0.0 0.0\nf 1 2 3\n"),
        ["/World/Ball: ", "m.obj: it encloses no volume; give it a thickness"],
    ),
}


@pytest.fixture
def shown(tmp_path, library, monkeypatch, capfd):
    """Runs a command in this process; returns exit code and all that came out, C++ code's writing included."""

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        capfd.readouterr()
        code = main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return code, out, err

    return run


@pytest.mark.parametrize("command", ["simulate", "validate", "info"])
@pytest.mark.parametrize("case", CASES)
def test_bad_file_is_one_clean_line(shown, tmp_path, case, command):
    make, words = CASES[case]
    file = make(tmp_path)
    code, out, err = shown(command, file)
    assert code == 3, out + err
    if (case, command) == ("folder", "info"):
        words = ("is not a cache of eulerfsi: it has no manifest.json",)
    assert out == "" and len(err.splitlines()) == 1 and err.startswith("error: "), err
    for word in words:
        assert word in err, err
    assert not NOISE.search(err), err
    for path in re.findall(r"[\w./-]+\.\w{3,4}\b", err):
        assert err.count(Path(path).name) == 1, f"{path} twice: {err}"


def test_solid_that_refers_to_nothing_names_the_missing_file_first(shown, tmp_path):
    stage = make_scene(tmp_path / "bad.usda")
    stage.RemovePrim("/World/Ball")
    prim = stage.DefinePrim("/World/Ball")
    prim.GetReferences().AddReference("./none.usda")
    prim.ApplyAPI("EulerFsiSolidAPI")
    stage.GetRootLayer().Save()
    code, _, err = shown("simulate", "bad.usda")
    assert code == 3 and re.match(r"error: \S*bad.usda: /World/Ball: reference @\S+none.usda@: no such file\n", err)
    assert not NOISE.search(err)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("sublayer", "bad.usda: sublayer @{}/none.usda@: no such file"),
        ("payload", "bad.usda: /World/Chair: payload @{}/none.usda@: no such file"),
        ("reference", "bad.usda: /World/Chair: reference @{}/none.usda@: no such file"),
        ("prim", "bad.usda: /World/Chair: reference @{}/sound.usda@</Nothing>: the file has no such prim"),
    ],
)
def test_missing_file_that_no_solid_needs_is_a_warning_and_usd_speaks_to_the_log(shown, tmp_path, kind, words):
    make_scene(tmp_path / "sound.usda")
    arc(tmp_path, kind, "./sound.usda" if kind == "prim" else "./none.usda")
    code, out, err = shown("simulate", "bad.usda", "--frames", "1-2", "--progress", "none")
    assert code == 0, out + err
    assert err.startswith("warning: ") and err.endswith(f"{words.format(tmp_path)}\n") and err.count("\n") == 1
    assert "info: USD: " in (tmp_path / "bad_cache/log").read_text()


def test_usd_messages_are_told_and_not_printed(capfd):
    told = []
    with usd_messages(told.append):
        Tf.Warn("two\n  lines")
    assert told == ["USD: two lines"] and capfd.readouterr().err == ""
    Tf.Warn("heard again")
    assert "heard again" in capfd.readouterr().err


@pytest.mark.parametrize("command", ["simulate", "validate", "info"])
def test_mesh_file_in_place_of_a_scene_says_new_in_a_line_that_works(shown, tmp_path, monkeypatch, command):
    write_obj(tmp_path / "my ball.obj")
    monkeypatch.setenv("EULERFSI_COMMAND", "./eulerfsi")
    code, _, err = shown(command, "my ball.obj")
    assert code == 3 and "my ball.obj: is not a USD file" in err
    words = shlex.split(err.rstrip().rpartition(" to make a scene from a mesh file: ")[2])
    assert words == ["./eulerfsi", "new", "my ball.usda", "--solid", "my ball.obj"]
    assert shown(*words[1:])[0] == 0
    assert "'my ball2.usda'" in shown(command, "my ball.obj")[2]  # a name that is free


def test_command_line_is_what_the_user_called(monkeypatch):
    monkeypatch.delenv("EULERFSI_COMMAND", raising=False)
    monkeypatch.setattr(sys, "argv", ["/usr/bin/eulerfsi"])
    assert command_line("simulate", Path("a b.usda")) == "eulerfsi simulate 'a b.usda'"
    monkeypatch.setattr(sys, "argv", ["/x/eulerfsi/__main__.py"])
    assert command_line("info") == "python -m eulerfsi info"
    monkeypatch.setenv("EULERFSI_COMMAND", "../my tools/eulerfsi")
    assert command_line("simulate", Path("-x.usda")) == "'../my tools/eulerfsi' simulate ./-x.usda"


def test_next_line_of_new_runs_in_a_shell(tmp_path, library):
    name = "it's $HOME (1).usda"
    write_obj(tmp_path / "ball.obj")
    program = [sys.executable, "-m", "eulerfsi"]
    done = subprocess.run(
        [*program, "new", name, "--solid", "ball.obj"],
        cwd=tmp_path,
        env={**environment(), "EULERFSI_COMMAND": "eulerfsi"},
        text=True,
        capture_output=True,
        check=True,
    )
    line = next(text for text in done.stdout.splitlines() if text.startswith("next: "))
    pasted = line.removeprefix("next: ").replace("eulerfsi simulate", f"{shlex.join(program)} validate")
    told = subprocess.run(pasted, shell=True, cwd=tmp_path, env=environment(), text=True, capture_output=True)
    assert told.returncode == 0, told.stderr
    assert told.stdout.startswith(f"{name}: frames")


@pytest.mark.parametrize("root", ["mesh", "xform", "no default prim"])
def test_new_tells_how_to_reference_a_usd_file_and_that_works(shown, tmp_path, root):
    stage = Usd.Stage.CreateNew(str(tmp_path / "my prop.usda"))
    path = "/Prop" if root == "mesh" else "/Prop/Geom/Body"
    sound = make_scene(tmp_path / "sound.usda")
    ball = UsdGeom.Mesh(sound.GetPrimAtPath("/World/Ball"))
    mesh = UsdGeom.Mesh.Define(stage, path)
    for name in ("points", "faceVertexCounts", "faceVertexIndices"):
        mesh.GetPrim().GetAttribute(name).Set(ball.GetPrim().GetAttribute(name).Get())
    if root != "no default prim":
        stage.SetDefaultPrim(stage.GetPrimAtPath("/Prop"))
    stage.GetRootLayer().Save()
    code, _, err = shown("new", "shot.usda", "--solid", "my prop.usda")
    assert code == 3 and err.startswith("error: my prop.usda: is a USD file") and "EulerFsiSolidAPI" in err
    snippet = err.partition("\n")[2]
    sound.RemovePrim("/World/Ball")
    sound.GetRootLayer().Save()
    text = (tmp_path / "sound.usda").read_text()
    at = text.index('    def Cube "Carpet"')
    (tmp_path / "shot.usda").write_text(text[:at] + snippet + text[at:])
    code, out, err = shown("validate", "shot.usda")
    assert code == 0, err
    assert f"/World/my_prop{path.removeprefix('/Prop')}: solid" in out


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.usda", None, "none.usda: no such file"),
        ("bad.usda", "#usda 1.0\ndef ???", "bad.usda: cannot be opened as USD: line 2: "),
        ("none.obj", None, "none.obj: no such file"),
    ],
)
def test_new_with_a_file_that_cannot_be_read_is_one_clean_line(shown, tmp_path, name, content, words):
    if content:
        (tmp_path / name).write_text(content)
    code, _, err = shown("new", "shot.usda", "--solid", name)
    assert code == 3 and err.startswith(f"error: {words}") and err.count("\n") == 1 and not NOISE.search(err)


def test_no_advice_leads_to_more_than_a_thousand_million_cells(tmp_path, library):
    domain = {"domain_size": [1.0, 1.0, 1.0], "voxel_size": 1e-5}
    assert memory.cells(domain, 0.1) == pytest.approx(1000)
    with pytest.raises(SceneError) as caught:
        memory.demand("/World/Domain", domain, [], 2**45, 1.0)  # a machine with room for more
    fitting = float(str(caught.value).split("voxelSize = ")[-1].split(" fits")[0])
    assert memory.cells(domain, fitting) <= memory.MOST_CELLS
    with pytest.raises(SceneError) as small:
        memory.demand("/World/Domain", domain, [], 2**30, 1.0)
    assert float(str(small.value).split("voxelSize = ")[-1].split(" fits")[0]) > fitting


def test_thin_feature_beyond_any_grid_is_called_too_thin(shown, tmp_path):
    stage = make_scene(tmp_path / "thin.usda", smoke=False)
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetPointsAttr()
    counts = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetFaceVertexCountsAttr()
    indices = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ball")).GetFaceVertexIndicesAttr()
    n, wall = len(points.Get()), 0.0002  # a bubble: the same ball, turned inside out, a little smaller
    faces, at = [], 0
    for count in counts.Get():
        faces += [n + i for i in reversed(indices.Get()[at : at + count])]
        at += count
    points.Set([*points.Get(), *(p * (1 - wall / 0.15) for p in points.Get())])
    counts.Set([*counts.Get(), *counts.Get()])
    indices.Set([*indices.Get(), *faces])
    stage.GetRootLayer().Save()
    _, out, err = shown("validate", "thin.usda")
    assert "too thin for" in out + err and "resolves it" not in out + err, out + err


def test_info_names_values_and_units(shown, tmp_path):
    make_scene(tmp_path / "small.usda")
    assert shown("simulate", "small.usda", "--frames", "1-2", "--progress", "none")[0] == 0
    code, out, _ = shown("info", "small_cache")
    assert code == 0 and "{" not in out and "_" not in out.partition("scene hash")[2]
    lines = [" ".join(line.split()) for line in out.splitlines()]
    for line in (
        "/World/Domain: domain",
        "preset production",
        "wallYMin noSlip",
        "voxelSize 0.05 m",
        "ambientFluid on",
        "/World/Ball: solid",
        "material corotational",
        "youngsModulus 23333 Pa",
        "density 1000 kg/m^3",
        "velocity (0, -2, 0) m/s",
        "/World/Carpet: emitter",
        "shape box",
        "edges (0.6, 0.2, 0.6) m",
        "mode initial",
    ):
        assert line in lines, out


def test_parameters_without_a_row_are_named_by_their_field():
    lines = info.describe_parameters("/A", {"voxel_size": 0.1, "wall[3]": 3, "new_field": 2})
    assert [" ".join(line.split()) for line in lines] == [
        "/A: domain",
        "voxelSize 0.1 m",
        "wallYMax periodic",
        "new field 2",
    ]


def test_errors_and_log_of_the_library_name_what_it_numbers(library):
    ball = Mesh(*sphere(0.1))
    domain = {"domain_min": [-0.5] * 3, "domain_size": [1.0] * 3, "voxel_size": 0.05}
    logged = []
    with Simulation({**domain, "threads": 1}, lambda _level, text: logged.append(text)) as simulation:
        simulation.names |= {"solid 1": "/World/A", "solid 11": "/World/K", "pin 1": "/World/P"}
        simulation.add_solid(ball)
        with pytest.raises(LibraryError, match=r"as in the mesh of solid 1 \(/World/A\)$"):
            simulation.add_pin(1, np.ones(5))
        with pytest.raises(LibraryError, match=r"solid 2 overlaps solid 1 \(/World/A\) by"):
            simulation.add_solid(ball)
        thin = Mesh(ball.points * (1, 0.4, 1) + (0, 0.3, 0), ball.counts, ball.indices)
        simulation.names["solid 2"] = "/World/B"
        simulation.add_solid(thin)
    assert any("solid 2 (/World/B): its thinnest feature" in text for text in logged), logged


def test_reasons_of_the_library_are_reworded():
    error = LibraryError(
        3, "EfsiSolidDef.mesh: no cell of size 0.1 m lies inside the solid; its thinnest feature is 0.1 m"
    )
    assert mesh_reason("", error).startswith("it is too thin for this voxel size: no cell lies inside the solid")
    assert mesh_reason("/a/b.obj", LibraryError(5, "/a/b.obj: is a folder")) == "is a folder"
