"""`--path-map A=B`: files of a scene that lie elsewhere on this machine."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import content_hashes, make_scene
from eulerfsi.errors import UsageError
from eulerfsi.run.simulate import Options, simulate
from eulerfsi.scene.path_map import Rule, mapped, parse_rules
from pxr import Sdf, Usd


def test_whole_folders_the_longest_first():
    rules = parse_rules(["/show=/mnt/a", "/show/assets/=/mnt/b/", "C:\\Show=/mnt/c"])
    assert mapped("/show/x.usda", rules) == "/mnt/a/x.usda"
    assert mapped("/show/assets/x.usda", rules) == "/mnt/b/x.usda"
    assert mapped("/show", rules) == "/mnt/a"
    assert mapped("c:/SHOW/Sub\\X.usd", rules) == "/mnt/c/Sub/X.usd"
    for other in ("/shows/x.usda", "x.usda", "../show/x.usda", ""):
        assert mapped(other, rules) == other


def test_rules_of_open_job_description(tmp_path):
    path = tmp_path / "rules.json"
    path.write_text("{}")
    assert parse_rules([str(path)]) == []
    entry = {"source_path_format": "POSIX", "source_path": "/a", "destination_path": "/b"}
    path.write_text(json.dumps({"version": "pathmapping-1.0", "path_mapping_rules": [entry]}))
    assert parse_rules([str(path)]) == [Rule("/a", "/b")]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("/a=", "must read A=B"),
        ("a=/b", "a: must be absolute"),
        ("/a=b", "b: must be absolute"),
        ("none.json", "No such file"),
    ],
)
def test_refused(option, message):
    with pytest.raises(UsageError) as error:
        parse_rules([option])
    assert message in str(error.value) and f"--path-map {option}" in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is damaged: "),
        ("[]", "pathmapping-1.0"),
        ('{"version": "pathmapping-1.0", "path_mapping_rules": [1]}', "rule 1"),
    ],
)
def test_refused_files(tmp_path, text, message):
    (tmp_path / "rules.json").write_text(text)
    with pytest.raises(UsageError) as error:
        parse_rules([str(tmp_path / "rules.json")])
    assert message in str(error.value)


def test_a_scene_of_another_machine(cli, tmp_path):
    """The ball lies two layers down, each named by an absolute path that is not here; the cache holds a copy of all."""
    make_scene(tmp_path / "plain.usda", frames=(1, 2))
    here = tmp_path / "here"
    here.mkdir()
    stage = Usd.Stage.Open(str(tmp_path / "plain.usda"))
    stage.GetRootLayer().Export(str(here / "all.usda"))
    middle = Sdf.Layer.CreateNew(str(here / "middle.usda"))
    middle.subLayerPaths.append("/elsewhere/all.usda")
    middle.Save()
    root = Sdf.Layer.CreateNew(str(tmp_path / "scene.usda"))
    root.TransferContent(Sdf.Layer.CreateAnonymous())
    for name in ("metersPerUnit", "upAxis", "timeCodesPerSecond", "framesPerSecond", "startTimeCode", "endTimeCode"):
        if stage.GetRootLayer().pseudoRoot.HasInfo(name):
            root.pseudoRoot.SetInfo(name, stage.GetRootLayer().pseudoRoot.GetInfo(name))
    root.defaultPrim = "World"
    root.subLayerPaths.append("/elsewhere/middle.usda")
    root.Save()
    del stage, middle, root
    assert cli("simulate", "scene.usda", "-o", "none").returncode == 3
    options = {"frames": "1-2", "progress": "none"}
    mapped_run = Options(output=tmp_path / "cache", path_map=(f"/elsewhere={here}",), **options)
    simulate(tmp_path / "scene.usda", mapped_run)
    simulate(tmp_path / "plain.usda", Options(output=tmp_path / "same", **options))
    assert content_hashes(tmp_path / "cache") == content_hashes(tmp_path / "same")
    assert "/elsewhere" in Path(tmp_path / "scene.usda").read_text()
    copies = [path.name for path in (tmp_path / "cache" / "scene").rglob("*.usda")]
    assert sorted(copies) == ["all.usda", "middle.usda", "scene.usda"]
    copied = Usd.Stage.Open(str(tmp_path / "cache" / "scene" / "scene.usda"))
    assert copied.GetPrimAtPath("/World/Ball")
