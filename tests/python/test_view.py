"""`view`: what is in the page, what it says of what is not, and what a browser makes of it."""

from __future__ import annotations

import base64
import filecmp
import io
import json
import shutil
import subprocess
import zlib
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, find_browser
from conftest import ROOT, make_scene
from eulerfsi.cache.manifest import Manifest
from eulerfsi.cli.main import main
from eulerfsi.cli.view import view
from eulerfsi.errors import CacheIOError, SceneError, UsageError
from eulerfsi.solver.volume_file import VolumeFile
from eulerfsi.view.packing import LEVELS, Blobs
from eulerfsi.view.shapes import FrameLayer, Reader, split_creases
from PIL import Image
from pxr import Sdf, Usd, UsdGeom

HOSTILE = '"><img src=x onerror=alert(1)></script><script>alert(2)</script>'
# Thirteen curves in the first plot; how each is dashed.
MANY_CURVES = """(() => {
  const plot = document.querySelector('figure svg'), all = () => [...plot.querySelectorAll('path')];
  while (all().length < 13) plot.append(all()[0].cloneNode());
  return all().map((curve) => getComputedStyle(curve).strokeDasharray);
})()"""
browser_needed = pytest.mark.skipif(not find_browser(), reason="no Chromium")


@pytest.fixture(scope="module")
def original(library, tmp_path_factory):
    """A cache of a ball above a carpet of smoke: three frames."""
    folder = tmp_path_factory.mktemp("view")
    make_scene(folder / "small.usda")
    arguments = ["-o", str(folder / "cache"), "--checkpoint-every", "1", "--progress", "none"]
    assert main(["simulate", str(folder / "small.usda"), *arguments]) == 0
    return folder / "cache"


@pytest.fixture
def cache(original, tmp_path):
    """A copy that a test may change."""
    shutil.copytree(original, tmp_path / "cache")
    return tmp_path / "cache"


def manifest_of(cache):
    return json.loads((cache / "manifest.json").read_text())


def change(cache, edit):
    manifest = Manifest.load(cache)
    edit(manifest.data)
    manifest.save()


class Page(HTMLParser):
    """The tags of a page, the texts of its scripts by id, its title."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags, self.scripts, self.title, self._inside = [], {}, "", None
        self.feed(path.read_text())
        self.facts = json.loads(self.scripts["facts"])

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self._inside = (tag, dict(attributes).get("id"))

    def handle_endtag(self, tag):
        self._inside = None

    def handle_data(self, data):
        if self._inside and self._inside[0] == "script":
            self.scripts[self._inside[1]] = self.scripts.get(self._inside[1], "") + data
        elif self._inside and self._inside[0] == "title":
            self.title += data

    def blob(self, number):
        return np.frombuffer(zlib.decompress(base64.b64decode(self.scripts[f"b{number}"])), np.uint8)

    def points(self, item):
        """(frames, points, 3) in the page's space."""
        halves = self.blob(item["points"]).reshape(-1, 2, 3 * item["point_count"]).astype(np.uint16)
        whole = np.cumsum(halves[:, 0] + 256 * halves[:, 1], axis=0, dtype=np.uint16)
        return np.array(item["low"]) + whole.reshape(len(whole), -1, 3) / LEVELS * np.array(item["size"])


def page_of(cache, **options):
    made = view(cache, cache.parent / "page.html", options.get("every", 1), options.get("max_mb", 20.0))
    return Page(made.path), made


def test_points_are_those_of_the_frames(cache):
    page, _ = page_of(cache)
    [ball] = [item for item in page.facts["items"] if item["kind"] == "solid"]
    shown = page.points(ball)
    frames = sorted((cache / "frames").glob("*.usdc"))
    assert len(shown) == len(frames) == 3 and page.facts["frames"] == [1, 2, 3]
    box = np.array(page.facts["box"])
    assert np.allclose(np.ptp(box, axis=0), np.array([0.6, 0.7, 0.6]) / 0.7)
    for points, path in zip(shown, frames, strict=True):
        layer = Sdf.Layer.FindOrOpen(str(path))
        written = layer.QueryTimeSample(Sdf.Path(f"{ball['path']}.points"), int(path.name.split(".")[1]))
        offset = points - np.asarray(written, float) / 0.7  # the scene is in metres, with y up
        assert np.ptp(offset, axis=0).max() < 1.01 * max(ball["size"]) / LEVELS


def test_smoke_is_that_of_the_volumes(cache):
    page, _ = page_of(cache)
    smoke = page.facts["smoke"]
    for entry, path in zip(smoke["frames"], sorted((cache / "vdb").glob("*.vdb")), strict=True):
        rows = page.blob(entry["blob"]).reshape(*smoke["cells"][::-1])
        roots = np.cumsum(rows, axis=2, dtype=np.uint8).T / 255
        with VolumeFile(path) as volume:
            grid = volume.grid("density")
            values = volume.read("density", grid["min"], np.array(smoke["cells"]))
        assert values.max() > 0 and entry["scale"] == pytest.approx(values.max())
        if roots.shape == tuple(grid["size"]):  # else the box of all frames is larger than this one's
            assert np.abs(roots**2 * entry["scale"] - values).max() < 1.01 * entry["scale"] / 255


def test_whole_numbers_and_points_survive_packing():
    numbers, blobs = np.array([5, 0, 2**30, 7, 7, 2**31 - 1]), Blobs()
    blobs.integers(numbers)
    planes = np.frombuffer(zlib.decompress(base64.b64decode(blobs.texts[0])), np.uint8).reshape(4, -1)
    codes = sum(planes[k].astype(np.int64) << (8 * k) for k in range(4))
    assert (np.cumsum((codes >> 1) ^ -(codes & 1)) == numbers).all()
    flat = np.zeros((2, 4, 3))  # no extent at all: no division by zero
    assert blobs.points(flat, flat.min(axis=(0, 1)), np.zeros(3)) == 1


def test_edges_of_a_box_are_sharp_and_a_ball_is_smooth():
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    split, owners = split_creases(corners, triangles)
    assert len(owners) == 24 and (owners[split] == triangles).all()
    turn = 2 * np.pi * np.arange(32) / 32
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    points = np.concatenate([ring, ring + (0, 0, 1)])
    at = np.arange(32)
    side = np.stack([at, (at + 1) % 32, 32 + (at + 1) % 32], axis=1)
    assert split_creases(points, side)[1] is None


def test_a_plane_is_drawn_as_one_face(tmp_path):
    stage = Usd.Stage.CreateInMemory()
    plane = UsdGeom.Plane.Define(stage, "/Ground")
    plane.CreateAxisAttr("Y")
    Sdf.Layer.CreateNew(str(tmp_path / "frame.usdc")).Save()
    item = Reader(stage, [1], [FrameLayer(tmp_path / "frame.usdc", 1)], {}).item(plane.GetPrim(), None)
    shown = item.frames[0][item.triangles if item.corners is None else item.corners[item.triangles]]
    assert item.kind == "scenery" and shown.shape == (2, 3, 3) and (shown[..., 1] == 0).all()
    assert np.ptp(shown.reshape(-1, 3), axis=0).tolist() == [2, 0, 2]


def test_counts_curves_and_parameters_are_those_of_the_cache(cache):
    page, _ = page_of(cache)
    [ball] = [item for item in page.facts["items"] if item["kind"] == "solid"]
    lines = [json.loads(line) for line in (cache / "stats.jsonl").read_text().splitlines()]
    frames = [line for line in lines if line["event"] == "frame"]
    plots = {plot["title"]: plot for plot in page.facts["plots"]}
    [volume] = plots["Volume"]["series"]
    solids = [line["solids"][ball["path"]] for line in frames]
    assert np.allclose(volume["y"], [s["volume_mesh"] / s["rest_volume"] for s in solids], rtol=1e-5)
    assert len(plots["Step size"]["series"][0]["y"]) == sum(line["event"] == "step" for line in lines)
    assert sum(plots["Steps per frame"]["series"][0]["y"]) == frames[-1]["steps"]
    assert {prim["path"] for prim in page.facts["parameters"]} == set(manifest_of(cache)["parameters"])
    assert page.facts["notes"] == []


def test_an_unfinished_cache_is_shown_as_far_as_it_goes(cache):
    change(cache, lambda data: (data["frames"].pop("3"), data.update(status="running", last=9)))
    page, made = page_of(cache)
    assert page.facts["frames"] == [1, 2]
    assert made.notes == page.facts["notes"] == ["The simulation has not finished: 2 of 9 frames."]


def test_frames_beyond_what_the_root_layer_knows_are_shown(cache):
    root = cache / manifest_of(cache)["scene"]
    root.write_text(root.read_text().replace("templateEndTime = 3", "templateEndTime = 1"))
    page, _ = page_of(cache)
    [ball] = [item for item in page.facts["items"] if item["kind"] == "solid"]
    falls = page.points(ball)[:, :, 1].mean(axis=1)
    assert falls[0] > falls[1] > falls[2]


def test_over_the_limit_smoke_is_coarsened_then_frames_are_left_out(cache, monkeypatch):
    page, whole = page_of(cache)
    limit = 1e-6 * whole.bytes - 0.00015
    fewer, made = page_of(cache, max_mb=limit)  # its smoke is as coarse as it gets already
    assert made.bytes <= 1e6 * limit and len(fewer.facts["frames"]) < 3
    assert made.notes == fewer.facts["notes"] and made.notes[0].startswith("Every ")
    assert f"so that the page stays below {limit:g} MB" in made.notes[0]
    monkeypatch.setattr("eulerfsi.cli.view._LEAST_CELLS", 10)
    coarse, made = page_of(cache, max_mb=limit)
    assert made.bytes <= 1e6 * limit and coarse.facts["frames"] == [1, 2, 3]
    assert np.prod(coarse.facts["smoke"]["cells"]) < np.prod(page.facts["smoke"]["cells"])
    assert made.notes == ["The smoke is coarsened to cells of 0.1 m, 2 voxels."]
    with pytest.raises(UsageError, match=r"--max-mb 0\.1: the page of .*cache needs 0\.\d+ MB with one frame"):
        page_of(cache, max_mb=0.1)


def test_every_second_frame(cache):
    page, made = page_of(cache, every=2)
    assert page.facts["frames"] == [1, 3] and made.notes == ["Every 2nd frame is shown."]


def test_hostile_names_are_text(cache):
    def edit(data):
        data["parameters"][f"/World/{HOSTILE}"] = {"youngs_modulus": 1.0, "<b>": 2}
        warning = {"code": "volume", "prim": HOSTILE, "other": "<i>", "frame": 2, "value": 1.0, "limit": 0.03}
        data["warnings"] = [{**warning, "worst": 1.0, "worst_frame": 2}]
        data["scene"] = "<b>&'.usda"
        (cache / "small.usda").rename(cache / data["scene"])

    change(cache, edit)
    page, _ = page_of(cache)
    assert page.title == "<b>&'"
    assert not {"img", "b", "i"} & set(page.tags)
    assert (
        page.tags.count("script") == len(page.scripts) == 2 + sum(name.startswith("b") for name in page.scripts if name)
    )
    assert any(prim["path"] == f"/World/{HOSTILE}" for prim in page.facts["parameters"])
    assert HOSTILE in page.facts["warnings"][0]["text"]


@pytest.mark.parametrize(
    ("break_it", "error", "message"),
    [
        (lambda c: shutil.rmtree(c), SceneError, "cache: no such folder"),
        (lambda c: (c / "manifest.json").unlink(), CacheIOError, r"manifest\.json: is missing"),
        (lambda c: change(c, lambda d: d["frames"].clear()), CacheIOError, "cache: has no finished frame yet"),
        (lambda c: (c / "vdb/small.0002.vdb").write_bytes(b"VDB"), CacheIOError, r"small\.0002\.vdb: is damaged"),
        (lambda c: (c / "frames/small.0003.usdc").unlink(), CacheIOError, r"small\.0003\.usdc: is missing"),
        (lambda c: (c / "stats.jsonl").write_text(""), CacheIOError, r"stats\.jsonl: is truncated: 0 of \d+ lines"),
        (lambda c: (c / "stats.jsonl").unlink(), CacheIOError, r"stats\.jsonl: "),
        (lambda c: (c / "stats.jsonl").write_text("{\n"), CacheIOError, r"stats\.jsonl: line 1: is damaged"),
    ],
)
def test_what_cannot_be_shown_is_named(cache, break_it, error, message):
    break_it(cache)
    with pytest.raises(error, match=message):
        page_of(cache)


@pytest.mark.parametrize("name", ["vdb/small.0002.vdb", "frames/small.0002.usdc"])
def test_a_file_with_other_bytes_of_the_same_length_is_named(cache, name):
    (cache / name).write_bytes(b"\0" * (cache / name).stat().st_size)
    with pytest.raises(CacheIOError, match=name.replace(".", r"\.")):
        page_of(cache)


def test_the_command_line_refuses_in_one_line(cache, tmp_path, capsys):
    assert main(["view", str(cache), "-o", str(tmp_path / "no/page.html")]) == 5
    assert "no/page.html: cannot be written: No such file" in capsys.readouterr().err
    assert main(["view", str(cache), "-o", str(tmp_path / "page.txt")]) == 2
    assert "must end with .html" in capsys.readouterr().err
    for option in (["--every", "0"], ["--max-mb", "nan"], ["--max-mb", "-1"]):
        with pytest.raises(SystemExit, match="2"):
            main(["view", str(cache), *option])
    assert f"{option[1]}: must be a number > 0" in capsys.readouterr().err
    assert main(["view", str(cache), "-o", str(tmp_path / "page.html")]) == 0
    assert capsys.readouterr().out.startswith(f"{tmp_path / 'page.html'} (")


def pixels(page):
    return np.asarray(Image.open(io.BytesIO(page.picture())).convert("RGB"), float)


@browser_needed
def test_a_browser_shows_it(cache):
    change(cache, lambda data: data["parameters"].update({f"/World/{HOSTILE}": {"youngs_modulus": 1.0}}))
    facts = page_of(cache)[0].facts
    with Browser((340, 300)) as page:
        page.open(cache.parent / "page.html")
        told = page.value("({...document.documentElement.dataset})")
        assert told["state"] == "ready" and told["frames"] == "3"
        assert int(told["triangles"]) == sum(item["triangle_count"] for item in facts["items"]) > 0
        assert page.value("document.querySelectorAll('img').length") == 0
        assert HOSTILE in page.value("document.getElementById('panel').textContent")

        page.value("document.querySelectorAll('.object input').forEach((box) => box.click())")  # smoke alone
        page.press("p")
        first = pixels(page)
        page.press("End")
        page.wait_for("document.getElementById('frame').textContent === '3'")
        page.wait_for("new Promise((done) => setTimeout(() => done(true), 300))")
        moved = np.abs(pixels(page) - first)[60:220].max(axis=2)
        assert (moved > 8).sum() > 50, "the smoke is the same in the first frame and the last"

        page.press(" ")
        assert page.value("document.getElementById('play').getAttribute('aria-pressed')") == "true"
        page.press("ArrowLeft")
        assert page.value("document.getElementById('play').getAttribute('aria-pressed')") == "false"
        before = pixels(page)
        touch = [{"x": 100, "y": 130}, {"x": 160, "y": 140}, {"x": 220, "y": 150}]
        for kind, at in (
            ("touchStart", touch[:1]),
            ("touchMove", touch[1:2]),
            ("touchMove", touch[2:]),
            ("touchEnd", []),
        ):
            page.call("Input.dispatchTouchEvent", type=kind, touchPoints=at)
        page.wait_for("new Promise((done) => setTimeout(() => done(true), 300))")
        assert np.abs(pixels(page) - before).max() > 20, "a finger does not turn the scene"
        assert page.errors == []
        assert [address for address in page.requests if not address.startswith(("file:", "data:", "blob:"))] == []


@browser_needed
def test_without_webgl_it_says_so_and_shows_the_rest(cache):
    page_of(cache)
    with Browser(webgl=False) as page:
        page.open(cache.parent / "page.html")
        assert page.value("document.documentElement.dataset.state") == "failed"
        assert "needs WebGL 2" in page.value("document.getElementById('message').innerText")
        assert page.value("document.querySelectorAll('figure').length") == 4
        dashes = page.value(MANY_CURVES)
        assert [len(set(dashes[i : i + 6])) for i in (0, 6)] == [1, 1] and len({dashes[i] for i in (0, 6, 12)}) == 3


@pytest.mark.nightly
@pytest.mark.skipif(not shutil.which("npm"), reason="no node")
def test_the_page_script_is_what_its_sources_give(tmp_path):
    shutil.copytree(ROOT / "packaging/view", tmp_path / "view", ignore=shutil.ignore_patterns("node_modules"))
    for command in (["npm", "ci", "--no-audit", "--no-fund"], ["node", "build.mjs", str(tmp_path)]):
        subprocess.run(command, cwd=tmp_path / "view", check=True, capture_output=True)
    for name in ("page.js", "three-LICENSE.txt"):
        assert filecmp.cmp(tmp_path / name, ROOT / "batch/eulerfsi/view" / name, shallow=False), name
