"""`verify` names every file that is damaged, and a run that is resumed mends it (docs/recovery.md); `doctor`."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import make_scene
from crashes import agree
from eulerfsi import files
from eulerfsi.cache.manifest import COPY, FILE_NAME, Manifest
from eulerfsi.cache.verify import verify
from eulerfsi.cli import doctor as doctor_module
from eulerfsi.errors import CacheIOError, LibraryError
from eulerfsi.log import Log
from eulerfsi.run.build import build_simulation
from eulerfsi.run.simulate import Options, load_scene, simulate
from pxr import Sdf

pytestmark = pytest.mark.usefixtures("library")


def run(scene: Path, folder: Path, **options: object) -> None:
    simulate(scene, Options(output=folder, progress="none", checkpoint_every="2", **options), Log())


@pytest.fixture(scope="module")
def place(tmp_path_factory, library) -> Path:
    """A folder with the scene, a cache of its six frames and, `part`, of the first four."""
    folder = tmp_path_factory.mktemp("damage")
    make_scene(folder / "small.usda", frames=(1, 6), voxel=0.06)
    run(folder / "small.usda", folder / "whole")
    run(folder / "small.usda", folder / "part", frames="1-4")
    return folder


def delete(path: Path) -> None:
    path.unlink()


def truncate(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x01
    path.write_bytes(content)


FAULTS = {delete: "is missing", truncate: "is truncated", flip: "has changed"}
NAMES = [
    "frames/small.0003.usdc",
    "vdb/small.0003.vdb",
    "checkpoints/0003.*.efsi",
    "checkpoints/0004.*.efsi",
    "scene/small.usda",
    "frames/small.manifest.usda",
    "stats.jsonl",
    "small.usda",
]


def mend(place: Path, folder: Path) -> None:
    run(place / "small.usda", folder, resume=True, allow_restart=True)
    assert not verify(folder, deep=True).damaged
    agree(folder, place / "whole")


@pytest.mark.parametrize(
    ("damage", "name"),
    [
        (delete, "frames/small.0003.usdc"),
        (truncate, "checkpoints/0004.*.efsi"),
        (flip, "scene/small.usda"),
        *(pytest.param(how, name, marks=pytest.mark.nightly) for how in FAULTS for name in NAMES),
    ],
)
def test_a_damaged_file_is_named_and_made_anew(place, tmp_path, damage: Callable[[Path], None], name):
    shutil.copytree(place / "part", tmp_path / "cache")
    [path] = (tmp_path / "cache").glob(name)
    damage(path)
    [(named, fault)] = verify(tmp_path / "cache").damaged
    assert named == path.relative_to(tmp_path / "cache").as_posix()
    assert fault.startswith(FAULTS[damage]) or name == "stats.jsonl"
    mend(place, tmp_path / "cache")


@pytest.mark.parametrize("damage", [delete, pytest.param(truncate, marks=pytest.mark.nightly), flip])
def test_a_damaged_manifest_is_named_and_its_copy_takes_its_place(place, tmp_path, damage):
    shutil.copytree(place / "part", tmp_path / "cache")
    damage(tmp_path / "cache" / FILE_NAME)
    with pytest.raises(CacheIOError, match=r"manifest\.json: is (missing|damaged)"):
        verify(tmp_path / "cache")
    with pytest.raises(CacheIOError, match="--resume --allow-restart goes on at the last checkpoint"):
        run(place / "small.usda", tmp_path / "cache", resume=True)
    mend(place, tmp_path / "cache")
    (tmp_path / "cache" / FILE_NAME).write_text("{")
    (tmp_path / "cache" / COPY).write_text("{")
    with pytest.raises(CacheIOError, match=r"manifest\.backup\.json: is damaged"):
        run(place / "small.usda", tmp_path / "cache", resume=True, allow_restart=True)


def test_every_section_of_a_checkpoint(place, tmp_path):
    """A flipped byte anywhere: the manifest sees it, and so does the library, which has no manifest."""
    scene, _ = load_scene(place / "small.usda", Options(), Log(), 0)
    entry = Manifest.load(place / "whole").data["checkpoints"][-1]
    content = (place / "whole" / entry["file"]).read_bytes()
    shutil.copytree(place / "whole", tmp_path / "cache")
    path = tmp_path / "cache" / entry["file"]
    moments = random.Random(1)
    sections = [*range(0, 96, 8), *range(96, len(content), max(1, len(content) // 60)), len(content) - 1]
    with build_simulation(scene, 1, 0, Log()).simulation as simulation:
        for section in sections:
            flipped = bytearray(content)
            at = min(section + moments.randrange(8), len(content) - 1)
            flipped[at] ^= 1 << moments.randrange(8)
            path.write_bytes(flipped)
            assert Manifest.load(tmp_path / "cache").fault(entry["file"], entry).startswith("has changed")
            with pytest.raises(LibraryError, match=r"efsi"):
                simulation.restore_checkpoint(path)
    mend(place, tmp_path / "cache")


def test_deep_finds_what_the_hashes_do_not(place, tmp_path):
    """A frame whose points are no numbers, hashed as it is: only reading it tells."""
    shutil.copytree(place / "part", tmp_path / "cache")
    name = "frames/small.0002.usdc"
    layer = Sdf.Layer.OpenAsAnonymous(str(tmp_path / "cache" / name))
    points = list(layer.QueryTimeSample("/World/Ball.points", 2))
    points[5] = (float("nan"), 0, 0)
    layer.SetTimeSample("/World/Ball.points", 2, type(layer.QueryTimeSample("/World/Ball.points", 2))(points))
    layer.Export(str(tmp_path / "cache" / name))
    (tmp_path / "cache/vdb/small.0003.vdb").write_bytes(b"no volume")
    manifest = Manifest.load(tmp_path / "cache")
    for frame, file in (("2", name), ("3", "vdb/small.0003.vdb")):
        manifest.frames[frame]["files"][file] |= files.record(tmp_path / "cache" / file)
    manifest.save()
    assert not verify(tmp_path / "cache").damaged
    found = verify(tmp_path / "cache", deep=True).damaged
    assert [file for file, _ in found] == [name, "vdb/small.0003.vdb"] and "no numbers" in found[0][1]


def test_lines_and_files_that_no_run_has_written(place, tmp_path):
    """Of a cache whose run has ended; one that was killed may have lines after its last checkpoint."""
    for name in ("whole", "part"):
        found = verify(place / name)
        assert not found.damaged and not found.unknown
    folder = tmp_path / "cache"
    shutil.copytree(place / "part", folder)
    for name in ("frames/other.usdc", "note.txt"):
        (folder / name).write_text("x")
    assert verify(folder).unknown == ["frames/other.usdc", "note.txt"] and not verify(folder).damaged
    with open(folder / "stats.jsonl", "a", encoding="utf-8") as file:
        file.write('{"event": "step"}\n')
    [(name, fault)] = verify(folder).damaged
    assert name == "stats.jsonl" and "more than the" in fault
    manifest = Manifest.load(folder)
    del manifest.data["stats"]
    manifest.save()
    assert not verify(folder).damaged


def test_verify_on_the_command_line(place, tmp_path, cli):
    assert cli("verify", place / "whole", "--deep").returncode == 0
    assert cli("verify", tmp_path).returncode == 3
    shutil.copytree(place / "part", tmp_path / "cache")
    (tmp_path / "cache/vdb/small.0002.vdb").unlink()
    (tmp_path / "cache/frames/.writing-7-small.0005.usdc").touch()
    done = cli("verify", "cache", "--json")
    assert done.returncode == 5 and "1 of 13 files are missing or damaged" in done.stderr
    facts = json.loads(done.stdout)
    assert facts["damaged"] == [{"file": "vdb/small.0002.vdb", "fault": "is missing"}]
    assert facts["left_over"] == ["frames/.writing-7-small.0005.usdc"]


def test_doctor_knows_the_answers(cli, monkeypatch):
    monkeypatch.setattr(doctor_module, "_SECONDS", 0.0)
    done = cli("doctor", "--json")
    facts = json.loads(done.stdout)
    assert done.returncode == 0 and facts["threads"] >= 1 and facts["disk"]
    assert [test["passed"] for test in facts["tests"]] == [True] * 4
    monkeypatch.setattr(doctor_module, "_FALL", 1e-9)  # no step is that fine
    done = cli("doctor")
    assert done.returncode == 1 and "FAILED: a cube falls as Galileo says" in done.stdout
    assert "wrong results: a cube falls" in done.stderr
