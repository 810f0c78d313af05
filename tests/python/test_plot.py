"""`plot`: what the curves of a cache show, and what is refused."""

from __future__ import annotations

import json

import matplotlib
import numpy as np
import pytest
from conftest import make_scene
from eulerfsi.cli.main import main
from eulerfsi.cli.plot import KINDS, Statistics, draw_bodies, limiting_bodies, plot
from eulerfsi.errors import CacheIOError, SceneError, UsageError
from PIL import Image

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def cache(library, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plot")
    make_scene(folder / "small.usda")
    arguments = [
        "simulate",
        str(folder / "small.usda"),
        "-o",
        str(folder / "cache"),
        "--set",
        "Domain.energyLedger=true",
    ]
    assert main([*arguments, "--set", "Domain.maxTimeStep=0.01"]) == 0
    return folder / "cache"


def draw(kind, cache):
    from matplotlib import pyplot

    figure, axes = pyplot.subplots()
    KINDS[kind](Statistics(cache), axes)
    pyplot.close(figure)
    return axes


def rows(cache, event):
    lines = [json.loads(line) for line in (cache / "stats.jsonl").read_text().splitlines()]
    return [line for line in lines if line["event"] == event]


def test_step_shows_every_step_and_the_mean(cache):
    axes = draw("step", cache)
    steps = [1e3 * row["dt"] for row in rows(cache, "step")]
    assert len(steps) >= 4
    sizes, *rules, mean, frame = axes.get_lines()
    assert np.allclose(sizes.get_ydata(), steps)
    assert np.allclose(mean.get_ydata(), np.mean(steps))
    assert np.allclose(frame.get_ydata(), 1e3 / json.loads((cache / "manifest.json").read_text())["fps"])
    assert sum(len(line.get_ydata()) for line in rules) == len(steps)
    limits = [row["limit"] for row in rows(cache, "step")]
    assert {"rule": "maximum", "bodies": []} in limits
    assert any(line.get_label().startswith("maximum: ") for line in rules)


def limited(cache, folder, limits):
    """A cache whose steps are so limited: [(frame, rule, bodies)]."""
    (folder / "manifest.json").write_text((cache / "manifest.json").read_text())
    last = rows(cache, "frame")[-1]
    steps = [
        {"event": "step", "frame": frame, "time": 0.01 * (n + 1), "dt": 0.01, "limit": {"rule": rule, "bodies": bodies}}
        for n, (frame, rule, bodies) in enumerate(limits)
    ]
    (folder / "stats.jsonl").write_text("".join(json.dumps(line) + "\n" for line in [*steps, last]))
    return folder


def test_step_shows_which_bodies_limited_the_steps(cache, tmp_path):
    limits = [(2, "wall_wave", ["/W/A"]), (2, "solid", ["/W/A", "/W/B"]), (2, "end", []), (3, "end", [])]
    folder = limited(cache, tmp_path, limits)
    assert limiting_bodies(Statistics(folder)) == {"A": [0, 1], "B": [1]}
    labels = [line.get_label() for line in draw("step", folder).get_lines()]
    expected = {"wall wave: 25%", "solid: 25%", "the last step of a frame: 25%", "a whole frame: 25%"}
    assert expected <= set(labels)

    from matplotlib import pyplot

    figure, axes = pyplot.subplots()
    draw_bodies(Statistics(folder), axes)
    pyplot.close(figure)
    assert [text.get_text() for text in axes.get_yticklabels()] == ["A: 50%", "B: 25%"]
    wave, solid = axes.get_lines()
    assert wave.get_xydata().tolist() == [[0.01, 0]] and solid.get_xydata().tolist() == [[0.02, 0], [0.02, 1]]
    assert wave.get_color() == draw("step", folder).get_lines()[1].get_color()
    with (
        Image.open(plot("step", folder, tmp_path / "a.png")) as picture,
        Image.open(plot("step", limited(cache, tmp_path, [(2, "end", [])]), tmp_path / "b.png")) as without,
    ):
        assert picture.size[1] > without.size[1] + 60


def test_bodies_of_one_name_have_their_paths_and_many_are_together(cache, tmp_path):
    same = limited(cache, tmp_path, [(2, "solid", ["/W/A/Mesh", "/W/B/Mesh"])])
    assert list(limiting_bodies(Statistics(same))) == ["/W/A/Mesh", "/W/B/Mesh"]
    many = limited(cache, tmp_path, [(2, "wall", [f"/W/B{n}"]) for n in range(20)] + [(2, "wall", ["/W/B0"])])
    found = limiting_bodies(Statistics(many))
    assert len(found) == 13 and found["B0"] == [0, 20] and found["others"] == [12, 13, 14, 15, 16, 17, 18, 19]


def test_volume_has_a_curve_by_mesh_and_by_cells_for_every_solid(cache):
    frames = rows(cache, "frame")
    solids = list(frames[-1]["solids"])
    *curves, one = draw("volume", cache).get_lines()
    assert len(curves) == 2 * len(solids)
    last = frames[-1]["solids"][solids[0]]
    assert curves[0].get_ydata()[-1] == pytest.approx(last["volume_mesh"] / last["rest_volume"])
    assert curves[1].get_ydata()[-1] == pytest.approx(last["volume_cells"] / last["rest_volume_cells"])


def test_energy_adds_up(cache):
    *parts, total = draw("energy", cache).get_lines()
    assert len(parts) == 4
    assert np.allclose(total.get_ydata(), sum(part.get_ydata() for part in parts))
    last = rows(cache, "frame")[-1]["solids"].values()
    assert parts[0].get_ydata()[-1] == pytest.approx(sum(solid["kinetic_energy"] for solid in last), rel=1e-3)


def test_time_has_a_bar_per_frame(cache):
    bars = draw("time", cache).patches
    assert [bar.get_height() for bar in bars] == [row["seconds"] for row in rows(cache, "frame")]


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_command_writes_a_picture_beside_the_cache(cache, kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["plot", kind, str(cache)]) == 0
    path = tmp_path / f"cache_{kind}.png"
    assert capsys.readouterr().out.strip() == path.name
    with Image.open(path) as picture:
        assert picture.size[0] > 800
        assert len(set(picture.convert("L").get_flattened_data())) > 2
    before = sorted(cache.iterdir())
    assert sorted(cache.iterdir()) == before


def test_a_line_that_a_run_is_writing_is_left_out(cache, tmp_path):
    for name in ("manifest.json", "stats.jsonl"):
        (tmp_path / name).write_text((cache / name).read_text())
    with open(tmp_path / "stats.jsonl", "a", encoding="utf-8") as file:
        file.write('{"event": "step", "frame": 4, "time": 0.1')
    assert Statistics(tmp_path).steps == Statistics(cache).steps


def test_svg_and_pdf(cache, tmp_path):
    assert plot("step", cache, tmp_path / "a.svg").read_text().startswith("<?xml")
    assert plot("step", cache, tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


def test_what_is_refused(cache, tmp_path):
    with pytest.raises(UsageError, match=r"a\.gif: must end with one of \.png, \.svg, \.pdf"):
        plot("step", cache, tmp_path / "a.gif")
    with pytest.raises(SceneError, match=r"is not a cache of eulerfsi: it has no manifest\.json"):
        plot("step", tmp_path, None)
    with pytest.raises(SceneError, match=r"none: no such folder"):
        plot("step", tmp_path / "none", None)
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "manifest.json").write_text((cache / "manifest.json").read_text())
    (broken / "stats.jsonl").write_text('{"event": "step"\n')
    with pytest.raises(CacheIOError, match=r"stats\.jsonl: line 1: is damaged"):
        plot("step", broken, tmp_path / "a.png")
    (broken / "stats.jsonl").write_text("")
    with pytest.raises(CacheIOError, match=r"stats\.jsonl: contains no step"):
        plot("step", broken, tmp_path / "a.png")
    assert not (tmp_path / "a.png").exists()
