"""`--confine`: each way out of a scene's folder is refused by a line that names it; what stays inside passes."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import pytest
from conftest import make_scene
from eulerfsi import child
from eulerfsi.errors import EXIT_SCENE, SceneError, UsageError
from eulerfsi.farm import openjd, slurm, submission
from eulerfsi.run.simulate import Options
from eulerfsi.scene import confine, confine_child
from eulerfsi.scene.path_map import parse_rules
from eulerfsi.scene.read import open_stage, stage_frames

HEAD = "#usda 1.0\n"


@pytest.fixture
def places(tmp_path: Path) -> tuple[Path, Path]:
    """(the scene's folder, a folder beside it that holds what it must not reach)."""
    inner, outer = tmp_path / "shot", tmp_path / "secret"
    inner.mkdir()
    outer.mkdir()
    (outer / "key.txt").write_text("key")
    (outer / "layer.usda").write_text(f'{HEAD}def "Key" {{}}\n')
    return inner, outer


def findings(scene: Path, *options: str) -> list[list[str]]:
    """What the child process would answer: [prim, field, value, limit, message] of each finding."""
    walk = confine_child.Walk(scene, parse_rules(options))
    walk.run()
    return walk.findings


def prim(body: str, metadata: str = "") -> str:
    return f'{HEAD}def "A" ({metadata}) {{\n{body}\n}}\n'


ESCAPES = {  # text of the layer, with {OUT} for the folder beside: the prim, the field and the value that are named
    "sublayer": (f"{HEAD}(subLayers = [@../secret/layer.usda@])\n", "/", "subLayers", "../secret/layer.usda"),
    "reference": (prim("", "prepend references = @../secret/layer.usda@</Key>"), "/A", "references", "../secret"),
    "deleted reference": (prim("", "delete references = @/etc/passwd@"), "/A", "references", "/etc/passwd"),
    "payload": (prim("", "payload = @{OUT}/layer.usda@"), "/A", "payload", "{OUT}/layer.usda"),
    "texture": (prim("asset inputs:file = @../secret/key.txt@"), "/A", "inputs:file", "../secret/key.txt"),
    "missing file": (prim("asset inputs:file = @../secret/none.txt@"), "/A", "inputs:file", "../secret/none.txt"),
    "tiles": (prim("asset inputs:file = @../secret/t.<UDIM>.png@"), "/A", "inputs:file", "t.<UDIM>.png"),
    "linked tile": (prim("asset inputs:file = @./tile.<UDIM>.png@"), "/A", "inputs:file", "tile.<UDIM>.png"),
    "array": (prim("asset[] files = [@./a.txt@, @/etc/passwd@]"), "/A", "files", "/etc/passwd"),
    "sample": (prim("asset file.timeSamples = {3: @/etc/passwd@}"), "/A", "file at 3", "/etc/passwd"),
    "mesh file": (prim("asset eulerfsi:surfaceFile = @/etc/passwd@"), "/A", "eulerfsi:surfaceFile", "/etc/passwd"),
    "custom data": (prim("", "customData = {asset a = @/etc/passwd@}"), "/A", "customData:a", "/etc/passwd"),
    "layer data": (f"{HEAD}(customLayerData = {{asset a = @/etc/x@}})\n", "/", "customLayerData:a", "/etc/x"),
    "property data": (prim("float a = 1 (customData = {asset b = @/etc/x@})"), "/A", "a: customData:b", "/etc/x"),
    "clips": (
        prim("", "clips = {dictionary default = {asset[] assetPaths = [@/etc/x.usda@]}}"),
        "/A",
        "clips:default:assetPaths",
        "/etc/x.usda",
    ),
    "clip template": (
        prim("", 'clips = {dictionary default = {string templateAssetPath = "../secret/f.###.usda"}}'),
        "/A",
        "clips:default:templateAssetPath",
        "../secret/f.###.usda",
    ),
    "variant": (
        f'{HEAD}def "A" (add variantSets = "v") {{\nvariantSet "v" = {{\n"one" {{\nasset a = @/etc/x@\n}}\n}}\n}}\n',
        "/A",
        "a",
        "/etc/x",
    ),
    "link": (prim("asset a = @./link.txt@"), "/A", "a", "link.txt"),
    "linked folder": (prim("asset a = @./folder/key.txt@"), "/A", "a", "folder/key.txt"),
    "address": (prim("asset a = @https://example.org/x.usd@"), "/A", "a", "https://example.org/x.usd"),
    "file address": (prim("asset a = @file:/etc/passwd@"), "/A", "a", "file:/etc/passwd"),
    "drive": (prim("asset a = @C:/x@"), "/A", "a", "C:/x"),
    "backslashes": (prim(r"asset a = @..\secret\key.txt@"), "/A", "a", r"..\secret\key.txt"),
    "expression": (prim("""asset a = @`"${X}/key.txt"`@"""), "/A", "a", "${X}"),
    "pipe": (prim("asset a = @./pipe@"), "/A", "a", "./pipe"),
}


@pytest.mark.parametrize("kind", ESCAPES)
@pytest.mark.parametrize("below", [False, True])
def test_every_way_out_is_refused_by_name(places, kind, below):
    """In the scene itself, and in a layer that it refers to."""
    inner, outer = places
    os.symlink(outer / "key.txt", inner / "link.txt")
    os.symlink(outer / "key.txt", inner / "tile.1001.png")
    os.symlink(outer, inner / "folder")
    os.mkfifo(inner / "pipe")
    text, named, field, value = ESCAPES[kind]
    file = inner / ("below.usda" if below else "scene.usda")
    file.write_text(text.replace("{OUT}", str(outer)))
    if below:
        (inner / "scene.usda").write_text(f"{HEAD}(subLayers = [@./below.usda@])\n")
    [(at, where, given, _, message)] = findings(inner / "scene.usda")
    value = value.replace("{OUT}", str(outer))
    assert (at, where) == (named, field) and value in given
    assert message.startswith(f"{file}: {named}: {field} = {given}: must ") and "\n" not in message


def test_the_scene_itself_may_be_no_link_to_elsewhere(places):
    inner, outer = places
    os.symlink(outer / "layer.usda", inner / "scene.usda")
    [(_, field, _, limit, _)] = findings(inner / "scene.usda")
    assert field == "scene" and str(outer / "layer.usda") in limit


def test_a_package_has_no_way_out(places):
    from pxr import Sdf, UsdUtils

    inner, _ = places
    (inner / "in.usda").write_text(prim("asset a = @./in.txt@"))
    (inner / "in.txt").write_text("x")
    assert UsdUtils.CreateNewUsdzPackage(str(inner / "in.usda"), str(inner / "good.usdz"))
    (inner / "scene.usda").write_text(prim("", "references = @./good.usdz@</A>"))
    assert not findings(inner / "scene.usda")
    (inner / "out.usda").write_text(prim("asset a = @./in.txt@"))
    layer = Sdf.Layer.FindOrOpen(str(inner / "out.usda"))
    with Sdf.ZipFileWriter.CreateNew(str(inner / "bad.usdz")) as package:
        layer.GetAttributeAtPath("/A.a").default = Sdf.AssetPath("/etc/passwd")
        layer.Export(str(inner / "changed.usda"))
        package.AddFile(str(inner / "changed.usda"), "changed.usda")
    (inner / "scene.usda").write_text(prim("", "references = @./bad.usdz@</A>"))
    [(at, where, value, _, _)] = findings(inner / "scene.usda")
    assert (at, where, value) == ("/A", "a", "@/etc/passwd@")


def glb(text: str) -> bytes:
    data = text.encode().ljust(-(-len(text) // 4) * 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(data), len(data), b"JSON") + data


@pytest.mark.parametrize(
    ("name", "content", "field", "value"),
    [
        ("m.gltf", b'{"buffers": [{"uri": "%2e%2e/secret/key.txt"}]}', "buffers[0].uri", "../secret/key.txt"),
        ("m.glb", glb('{"buffers": [{"uri": "/etc/passwd"}]}'), "buffers[0].uri", "/etc/passwd"),
        ("m.gltf", b'{"images": [{"uri": "data:x"}, {"uri": "/etc/x.png"}]}', "images[1].uri", "/etc/x.png"),
        ("m.obj", b"v 0 0 0\nmtllib ../secret/key.txt\n", "mtllib", "../secret/key.txt"),
        ("m.obj", b"  mtllib\t\\\n/etc/passwd\n", "mtllib", "/etc/passwd"),
        ("m.obj", b"mtllib a.mtl /etc/passwd\n", "mtllib", "/etc/passwd"),
    ],
)
def test_mesh_files_name_nothing_outside(places, name, content, field, value):
    inner, _ = places
    (inner / name).write_bytes(content)
    (inner / "scene.usda").write_text(prim(f"asset eulerfsi:surfaceFile = @./{name}@"))
    [(_, where, given, _, message)] = findings(inner / "scene.usda")
    assert (where, given) == (field, f"@{value}@") and message.startswith(str(inner / name))


def test_search_path_of_the_resolver_is_a_way_out(places, monkeypatch):
    """Another process: USD reads the variable once."""
    inner, outer = places
    monkeypatch.setenv("PXR_AR_DEFAULT_SEARCH_PATH", str(outer))
    (inner / "scene.usda").write_text(prim("", "references = @layer.usda@</Key>"))
    with pytest.raises(
        SceneError, match=r"/A: references = @layer.usda@: must lead to a file below .*secret/layer.usda"
    ):
        confine.demand_confined(inner / "scene.usda")


def test_a_scene_that_stays_inside_passes(places):
    """`..`, links and absolute paths that lead to a file of the folder; a folder that --path-map names."""
    inner, outer = places
    (inner / "layers").mkdir()
    (inner / "a.txt").write_text("x")
    os.symlink("a.txt", inner / "link.txt")
    (inner / "t.1001.png").write_text("x")
    body = f"asset a = @../a.txt@\nasset b = @../link.txt@\nasset c = @{inner}/a.txt@\nasset d = @../t.<UDIM>.png@"
    (inner / "layers" / "one.usda").write_text(prim(f"{body}\nasset e = @missing.txt@", "references = @../two.usda@"))
    (inner / "two.usda").write_text(f'{HEAD}(defaultPrim = "B"\nsubLayers = [@layers/one.usda@])\ndef "B" {{}}\n')
    (inner / "scene.usda").write_text(f"{HEAD}(subLayers = [@layers/one.usda@, @/show/layer.usda@])\n")
    assert not findings(inner / "scene.usda", f"/show={outer}")
    (inner / "scene.usda").write_text(f"{HEAD}(subLayers = [@/show/../shot/x.usda@, @/show/../../x.usda@])\n")
    assert [value for _, _, value, _, _ in findings(inner / "scene.usda", f"/show={outer}")] == ["@/show/../../x.usda@"]


def test_references_that_multiply_are_refused_before_they_fill_the_memory(places, monkeypatch):
    """Each prim refers to the next one ten times: a small file of 10^6 prims."""
    inner, _ = places
    levels = []
    for k in range(3):
        children = "\n".join(f'def "c{n}" (references = </L{k + 1}>) {{}}' for n in range(10))
        levels.append(f'def "L{k}" {{\n{children}\n}}')
    (inner / "scene.usda").write_text("\n".join([HEAD, *levels, 'def "L3" {}']))
    assert not confine_child._too_many_prims(inner / "scene.usda", [])
    monkeypatch.setattr(confine_child, "MOST_PRIMS", 1000)
    [finding] = confine_child._too_many_prims(inner / "scene.usda", [])
    assert "at most 1000 prims" in finding[-1]


def test_frames_are_counted_before_they_are_read(places):
    """A few bytes that say a billion frames."""
    inner, _ = places
    for last in ("1e9", "1e300"):
        (inner / "scene.usda").write_text(f"{HEAD}(startTimeCode = 1\nendTimeCode = {last})\n")
        with pytest.raises(UsageError, match="frames: must be at most 1000000"):
            stage_frames(open_stage(inner / "scene.usda"))


def test_a_layer_that_needs_too_much_memory_costs_one_line(places, monkeypatch):
    inner, _ = places
    values = ", ".join(["1"] * 3_000_000)
    (inner / "scene.usda").write_text(prim(f"int[] a = [{values}]"))
    monkeypatch.setattr(confine, "available_memory", lambda: 8 << 20)
    with pytest.raises(SceneError, match=r"scene.usda: --confine: (needs more than 8.0 MiB|the process reading it)"):
        confine.demand_confined(inner / "scene.usda")


def test_reading_ends(places, monkeypatch):
    """A pipe in place of the scene's folder's layer would hold a reader for ever: the child is given up."""
    inner, _ = places
    (inner / "scene.usda").write_text(HEAD)
    monkeypatch.setattr(confine, "_SECONDS", 0.0)
    with pytest.raises(SceneError, match="not read within 0 s"):
        confine.demand_confined(inner / "scene.usda")


def test_simulate_and_validate_refuse(cli, places):
    inner, _ = places
    make_scene(inner / "scene.usda", frames=(1, 2))
    scene, bad = inner / "scene.usda", inner / "bad.usda"
    bad.write_text(scene.read_text() + 'def "Out" (references = @/etc/x.usda@) {}\n')
    for command in (("validate", bad, "--json"), ("simulate", bad, "-o", inner / "cache", "--progress", "none")):
        done = cli(*command, "--confine")
        assert done.returncode == EXIT_SCENE
        assert "/Out: references = @/etc/x.usda@: must lead to a file below" in done.stderr
        if command[0] == "validate":
            [error] = json.loads(done.stdout)["errors"]
            assert (error["code"], error["prim"], error["field"]) == ("confined", "/Out", "references")
    assert not (inner / "cache").exists()
    assert cli("validate", scene, "--confine").returncode == 0


def test_jobs_hand_it_on(library, places, tmp_path):
    inner, _ = places
    make_scene(inner / "scene.usda", frames=(1, 2))
    job = submission.prepare(inner / "scene.usda", tmp_path / "cache", Options(confine=True), [], False)
    template = openjd.make_template(job, ["eulerfsi"], None)
    for step in template["steps"][:2]:
        assert "--confine" in step["script"]["actions"]["onRun"]["args"]
    assert " --confine " in slurm.write_script(tmp_path / "job.sh", job, ["eulerfsi"], None).read_text()


def test_a_busy_machine_gives_a_child_its_time(monkeypatch):
    """The limit is wall time only for a child that does not want to run."""
    states = iter([(True, 0.1), (True, 0.2), (False, 0.2)])
    monkeypatch.setattr(child, "_state", lambda _process: next(states))

    class Sleeper:
        pid, waits = 0, 0

        def wait(self, seconds: float) -> int:
            self.waits += 1
            raise child.subprocess.TimeoutExpired("sleep", seconds)

    sleeper = Sleeper()
    assert child._wait(sleeper, 1.0) is None and sleeper.waits == 3
