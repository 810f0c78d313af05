"""`view` of a wedge: its jobs side by side on one page, which play together."""

from __future__ import annotations

import json

import pytest
from browser import Browser, find_browser
from conftest import make_scene
from eulerfsi.cli import view_wedge as module
from eulerfsi.cli.view_wedge import view_wedge
from eulerfsi.errors import SceneError, UsageError
from eulerfsi.log import Log
from eulerfsi.run.simulate import Options, simulate

HOSTILE = '</script><img src=x onerror="alert(1)">'


@pytest.fixture(scope="module")
def place(tmp_path_factory, library):
    """A wedge of three jobs: three frames, two, and none, whose value is a name to beware of."""
    folder = tmp_path_factory.mktemp("view") / "shot_wedge"
    scene = folder.parent / "shot.usda"
    make_scene(scene, frames=(1, 3), voxel=0.1)
    for name, frames in (("a", "1-3"), ("b", "1-2")):
        simulate(scene, Options(output=folder / name, frames=frames, progress="none"), Log())
    values = [("a", "1"), ("b", "2"), ("c", HOSTILE)]
    jobs = [{"folder": name, "values": {"Ball.youngsModulus": value}} for name, value in values]
    (folder / "wedge.json").write_text(json.dumps({"format": "eulerfsi-wedge", "version": 1, "jobs": jobs}))
    return folder


def test_jobs_stand_side_by_side_with_their_values(place, tmp_path):
    made = view_wedge(place, tmp_path / "page.html", 1, 20.0)
    text = made.path.read_text()
    assert text.count("<iframe ") == 2 and text.count("<figure>") == 3
    assert "Ball.youngsModulus = 1" in text and "no such folder" in text
    assert HOSTILE not in text and made.bytes == len(text.encode()) < 20e6


def test_what_is_too_much_is_said_or_refused(place, tmp_path, monkeypatch):
    with pytest.raises(UsageError, match="--max-mb"):
        view_wedge(place, tmp_path / "page.html", 1, 1.0)
    monkeypatch.setattr(module, "MOST_PAGES", 1)
    assert view_wedge(place, tmp_path / "page.html", 1, 20.0).notes[0].startswith("The first 1 of 3 jobs")
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / "wedge.json").write_text((place / "wedge.json").read_text())
    with pytest.raises(SceneError, match="no job of the wedge has a finished frame"):
        view_wedge(empty, tmp_path / "page.html", 1, 20.0)


def test_the_command_knows_a_wedge(place, tmp_path, cli):
    assert cli("view", place, "-o", tmp_path / "page.html").returncode == 0
    assert "<iframe " in (tmp_path / "page.html").read_text()
    assert cli("view", place, "-o", tmp_path / "page.txt").returncode == 2


@pytest.mark.skipif(not find_browser(), reason="no Chromium")
def test_a_browser_plays_them_together(place, tmp_path):
    made = view_wedge(place, tmp_path / "page.html", 1, 20.0)
    inner = "document.querySelectorAll('iframe')[{}].contentDocument.getElementById('frame').textContent"
    with Browser((900, 500)) as page:
        page.open(made.path)
        page.wait_for(f"{inner.format(0)} === '1' && {inner.format(1)} === '1'")
        move = "time.value = {}; time.dispatchEvent(new Event('input'))"
        page.value(f"void (() => {{ const time = document.getElementById('time'); {move.format(1)} }})()")
        page.wait_for(f"{inner.format(0)} === '3' && {inner.format(1)} === '2'")
        page.value(f"void (() => {{ const time = document.getElementById('time'); {move.format(0.5)} }})()")
        page.wait_for(f"{inner.format(0)} === '2' && {inner.format(1)} === '2'")
        assert page.value("document.querySelectorAll('img').length") == 0
        assert page.errors == []
        assert [
            address for address in page.requests if not address.startswith(("file:", "data:", "blob:", "about:"))
        ] == []
