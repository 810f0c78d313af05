"""The gallery: its page is that of gallery.toml, its scenes exist, its pictures are small."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest
from conftest import ROOT
from eulerfsi.cli.main import build_parser

SCENES = ROOT / "examples" / "scenes"


@pytest.fixture(scope="module")
def gallery():
    sys.path.insert(0, str(ROOT / "examples" / "render"))
    return importlib.import_module("make_gallery")


def test_page_is_made_from_the_table(gallery) -> None:
    assert gallery.PAGE.read_text(encoding="utf-8") == gallery.page()


def test_rows_name_scenes_and_the_runs_before(gallery) -> None:
    seen: dict[str, list[int]] = {}
    for picture in gallery.pictures():
        assert (SCENES / f"{picture['scene']}.usda").is_file() and picture["scene"] not in seen
        assert picture["frames"] == sorted(set(picture["frames"])) and picture["frames"][0] >= 1
        words = ["simulate", str(SCENES / f"{picture['scene']}.usda"), *gallery.options(picture, "caches/")]
        assert build_parser().parse_args(words).frames
        if "start" in picture:
            scene, frame = picture["start"]
            assert max(seen[scene]) == frame  # the last frame has a checkpoint
        seen[picture["scene"]] = picture["frames"]
    paper = {"squash_half", "jets_circle", "jets_circle_free", "ball", "bunny_light", "bunny_heavy", "cheb", "party"}
    assert paper <= set(seen)


def test_every_row_has_a_small_picture(gallery) -> None:
    files = list(Path(gallery.PICTURES).iterdir())
    assert {file.name for file in files} == {f"{picture['scene']}.webp" for picture in gallery.pictures()}
    assert sum(file.stat().st_size for file in files) < 1_500_000


def test_blender_is_that_of_the_tests(gallery, monkeypatch, tmp_path, capsys) -> None:
    monkeypatch.setenv("EULERFSI_BPY", str(tmp_path / "none"))
    with pytest.raises(SystemExit):
        gallery.main(["ball"])
    assert f"{tmp_path / 'none' / 'bin' / 'python'}: there is no Blender" in capsys.readouterr().err
