"""One command makes all pictures: those of the README are rows of readme.toml, and its commands exist."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from conftest import ROOT
from eulerfsi.cli.main import build_parser
from PIL import Image

sys.path.insert(0, str(ROOT / "examples" / "render"))

import make_page  # noqa: E402
import make_pictures  # noqa: E402
import make_readme  # noqa: E402
import make_window  # noqa: E402


def test_rows_are_pictures_of_the_readme_and_their_runs_can_be_made() -> None:
    shown = set(re.findall(r"docs/images/(\w+)\.png", (ROOT / "README.md").read_text(encoding="utf-8")))
    rows = make_readme.pictures()
    plots = {name for name in shown if name == "peers" or name.startswith("accuracy_")}
    assert {row["name"] for row in rows} == shown - plots
    voxels: dict[str, set[object]] = {}
    for run in (run for row in rows for run in row["runs"]):
        scene = ROOT / "examples" / "scenes" / f"{run['scene']}.usda"
        assert scene.is_file() and build_parser().parse_args(["simulate", str(scene), *make_readme.options(run)])
        voxels.setdefault(run["scene"], set()).add((run.get("voxel"), max(run["frames"])))
    assert all(len(found) == 1 for found in voxels.values()), "one cache per scene"


def test_frames_are_put_together_in_rows() -> None:
    colors = ("red", "green", "blue")
    images = [Image.new("RGB", size, color) for size, color in zip([(40, 20), (20, 20), (10, 10)], colors, strict=True)]
    sheet = make_readme.put_together(images, 20, 2).convert("RGB")
    assert sheet.size == (40 + make_readme.GAP + 20, 20 + make_readme.GAP + 20)
    seen = [sheet.getpixel(at) for at in ((5, 5), (55, 5), (5, 40), (55, 40))]
    assert seen == [(255, 0, 0), (0, 128, 0), (0, 0, 255), (255, 255, 255)]


def test_what_is_rendered_comes_after_the_environment_that_renders(monkeypatch, tmp_path, capsys) -> None:
    parts = list(make_pictures.PARTS)
    assert parts.index("blender") < min(parts.index("readme"), parts.index("gallery"))
    monkeypatch.setenv("EULERFSI_BPY", str(tmp_path))
    with pytest.raises(SystemExit):
        make_readme.main(["cheb"])
    assert "there is no Blender: ./eulerfsi test --blender makes it" in capsys.readouterr().err


def test_the_lower_part_of_a_frame() -> None:
    image = Image.new("RGB", (10, 50), "white")
    image.paste("red", (0, 30, 10, 50))
    part = make_readme.lower_part(image, 0.4)
    assert part.size == (10, 20) and part.getcolors() == [(200, (255, 0, 0))]


def test_every_picture_of_the_documents_has_a_command() -> None:
    words = [str(word) for commands in make_pictures.PARTS.values() for command in commands for word in command]
    scripts = [Path(word) for word in words if word.endswith(".py")]
    assert len(scripts) >= 5 and [script for script in scripts if not script.is_file()] == []
    images = {path.name for path in (ROOT / "docs" / "images").glob("*.png")}
    made = {f"{row['name']}.png" for row in make_readme.pictures()} | {"blender.png", "peers.png"}
    made |= {"party_step.png", "blender_window.png"}
    assert {name for name in images - made if not name.startswith("accuracy_")} == set()


def test_the_picture_of_the_window_is_made_of_what_the_simulated_hand_takes() -> None:
    clicks = (ROOT / "tests" / "blender" / "clicks.py").read_text(encoding="utf-8")
    assert set(make_window.STATES) <= set(re.findall(r'picture\("(\w+)"\)', clicks))
    assert "make_window.py" in (ROOT / "tests" / "blender" / "window.sh").read_text(encoding="utf-8")
    with Image.open(make_window.PICTURES / "blender_window.png") as shown:
        assert shown.height == make_window.BOX[3] - make_window.BOX[1]


def test_without_a_browser_the_page_is_refused_before_its_run(monkeypatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(SystemExit, match="needs a browser"):
        make_page.main()
