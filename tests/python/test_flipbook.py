"""Pictures of a run: a flip-book with every frame, and the preview with several."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from conftest import make_scene
from eulerfsi.cache.pictures import FILM, FOLDER, SHEET, spread
from eulerfsi.cli.main import main
from PIL import Image


@pytest.fixture
def scene(library, tmp_path, monkeypatch):
    make_scene(tmp_path / "small.usda")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "small.usda"


def pixels(path):
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB"), float)


def height_of_ball(path):
    """Row of the middle of what is red, from the top."""
    colors = pixels(path)
    rows, _ = np.nonzero(colors[..., 0] > colors[..., 2] + 50)
    assert len(rows) > 1000
    return rows.mean()


def film_frames(path):
    with Image.open(path) as film:
        assert film.format == "WEBP"
        return film.n_frames


def test_every_frame_gets_a_picture_also_of_a_run_that_goes_on(scene, tmp_path, capsys):
    cache, quick = tmp_path / "small_cache", ["--progress", "none", "--keep-checkpoints", "all"]
    every = ["--checkpoint-every", "1"]
    assert main(["simulate", str(scene), "--flipbook", "--frames", "1-3", *quick, *every]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"film:    {cache / FILM}"
    names = [f"small.{frame:04d}.png" for frame in (1, 2, 3)]
    assert sorted(p.name for p in (cache / FOLDER).iterdir()) == sorted([*names, "contact_sheet.png", "film.webp"])
    heights = [height_of_ball(cache / FOLDER / name) for name in names]
    assert heights[0] < heights[1] < heights[2], "the ball does not fall"
    assert film_frames(cache / FILM) == 3
    assert pixels(cache / SHEET).shape[1] == 2 * 200
    tall, wide = pixels(cache / FOLDER / names[-1]).shape[:2]
    preview = pixels(cache / "preview.png")
    assert np.array_equal(preview[:tall], pixels(cache / FOLDER / names[-1]))
    assert preview.shape[1] == wide and preview.shape[0] > 1.2 * tall, "no earlier frame below the last one"
    strip = preview[tall:, : wide // 2]
    first, second = strip[:, : wide // 4], strip[:, wide // 4 : 2 * (wide // 4)]
    assert np.abs(first - second).max() > 50

    assert main(["simulate", str(scene), "--flipbook", "--frames", "1-4", "--resume", *quick, *every]) == 0
    assert film_frames(cache / FILM) == 4
    first = (cache / FOLDER / names[0]).read_bytes()
    again = ["--rebake-from", "2", "--set", "Ball.youngsModulus=5000", "--frames", "1-3", *quick]
    assert main(["simulate", str(scene), *again]) == 0
    there = sorted(p.name for p in (cache / FOLDER).iterdir())
    assert there == sorted([*names, "contact_sheet.png", "film.webp"]), "a flip-book that was begun goes on without it"
    assert film_frames(cache / FILM) == 3
    assert (cache / FOLDER / names[0]).read_bytes() == first
    assert main(["simulate", str(scene), "--overwrite", "--frames", "1-2", *quick]) == 0
    assert not (cache / FOLDER).exists()


def test_without_matplotlib_there_is_a_note_and_no_picture(scene, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["simulate", str(scene), "--flipbook", "--frames", "1-2", "--progress", "none"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2:] == [f"{name} none; drawing it needs matplotlib" for name in ("preview:", "film:   ")]
    assert not (tmp_path / "small_cache" / FOLDER).exists()
    assert "no picture: drawing needs matplotlib" in (tmp_path / "small_cache/log").read_text()


def test_a_folder_that_cannot_be_written_is_named(scene, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("eulerfsi.cache.pictures.FOLDER", "log")  # a file of the cache
    assert main(["simulate", str(scene), "--flipbook", "--frames", "1-2", "--progress", "none"]) == 5
    [line] = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert line == f"error: {tmp_path / 'small_cache/log'}: cannot be created: File exists"


def test_spread_takes_the_first_and_the_last():
    assert spread(range(1, 49), 5) == [1, 13, 25, 36, 48]
    assert spread([3, 1, 2], 5) == [1, 2, 3] and spread([1, 2, 3], 1) == [3] and spread([], 4) == []
