"""Mesh files: every format gives its mesh, a damaged or hostile file one message, and no child process stays behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mesh_samples
import numpy as np
import pytest
from conftest import ROOT, environment, write_obj
from eulerfsi import child
from eulerfsi.errors import EXIT_SCENE, LibraryError
from eulerfsi.solver import binding, mesh_file
from eulerfsi.solver import simulation as solver

pytestmark = pytest.mark.usefixtures("library")

KINDS = [(suffix, kind) for suffix, makers in mesh_samples.MAKERS.items() for kind in range(len(makers))]
MEBIBYTE = 1 << 20
# Names of the ball, as the samples have them; "nodes[1]" and "3DSMesh_0" are the reader's for what has none.
OBJECTS = {
    "obj": ["ball"],
    "ply": ["", ""],
    "stl": ["ball", ""],
    "off": [""],
    "gltf": ["nodes[1]"],
    "glb": ["nodes[1]"],
    "fbx": ["ball", "ball"],
    "dae": ["node"],
    "3ds": ["3DSMesh_0"],
}


def refusal(path: Path, status: int, memory: int | None = None) -> str:
    with pytest.raises(LibraryError) as caught:
        solver.load_mesh(path, memory)
    assert caught.value.status == status
    assert str(caught.value).startswith(f"{path}: ")
    return str(caught.value)


def children(path: Path) -> list[int]:
    """Processes that read this file."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue  # it has just ended
        if b"eulerfsi.solver.mesh_child" in words and os.fsencode(path) in words:
            found.append(int(folder.name))
    return found


def wait_for_children(path: Path, count: int) -> list[int]:
    """Waits, for a minute at most, until so many processes read this file."""
    end = time.monotonic() + 60
    while len(found := children(path)) != count and time.monotonic() < end:
        time.sleep(0.01)
    assert len(found) == count
    return found


@pytest.fixture
def endless(tmp_path) -> Path:
    """A mesh file that is never read to its end: it names a pipe that nobody writes to."""
    os.mkfifo(tmp_path / "pipe.bin")
    path = tmp_path / "endless.gltf"
    path.write_text(json.dumps(mesh_samples.gltf_parts("pipe.bin")[0]))
    return path


@pytest.mark.parametrize(("suffix", "kind"), KINDS)
def test_every_format_gives_the_closed_ball(tmp_path, suffix, kind):
    path = tmp_path / f"ball.{suffix}"
    path.write_bytes(mesh_samples.MAKERS[suffix][kind]())
    mesh = solver.load_mesh(path)
    points, faces = mesh_samples.ball()
    assert len(mesh.points) == len(points) and len(mesh.triangles()) == len(faces)
    report = solver.Surface(mesh, 0.1).report
    corners = points[faces].astype(float)
    volume = np.linalg.det(corners).sum() / 6
    assert report["closed"] == 1 and report["surface_volume"] == pytest.approx(volume, rel=1e-5)
    assert mesh.objects == [(OBJECTS[suffix][kind], len(faces))]


def test_list_of_formats_is_the_librarys(tmp_path, cli):
    (tmp_path / "ball.blend").write_bytes(mesh_samples.obj())
    text = ", ".join(mesh_file.FORMATS)
    assert refusal(tmp_path / "ball.blend", binding.ERROR_MESH).endswith(f"must end in one of: {text}")
    assert set(mesh_samples.MAKERS) == set(mesh_file.FORMATS)
    assert text in " ".join(cli("new", "--help").stdout.split())
    for document in ("README.md", "docs/c_api.md", "libeulerfsi/include/eulerfsi/mesh.h"):
        assert text in (ROOT / document).read_text(), document


@pytest.mark.parametrize("uri", ["Fläche 1.bin", "Fl%C3%A4che%201.bin"])
def test_files_that_a_mesh_file_names_are_found_beside_it(tmp_path, monkeypatch, uri):
    folder = tmp_path / "Möbel & 椅子"
    folder.mkdir()
    scene, buffer = mesh_samples.gltf_parts(uri)
    (folder / "Ball 1.gltf").write_text(json.dumps(scene))
    (folder / "Fläche 1.bin").write_bytes(buffer)
    (folder / "-Ball 2.OBJ").write_bytes(mesh_samples.obj())
    (folder / "none.mtl").write_text("newmtl skin\nKd 1 0 0\n")
    assert len(solver.load_mesh(folder / "Ball 1.gltf").points) == 26
    monkeypatch.chdir(folder)
    for name in ("Ball 1.gltf", "-Ball 2.OBJ"):
        assert len(solver.load_mesh(name).points) == 26
    (folder / "Fläche 1.bin").unlink()
    assert "could not open referenced file" in refusal(folder / "Ball 1.gltf", binding.ERROR_MESH)


def test_file_that_cannot_be_read_names_path_and_reason(tmp_path):
    assert "No such file" in refusal(tmp_path / "none.obj", binding.ERROR_IO)
    (tmp_path / "folder.obj").mkdir()
    assert "is a folder" in refusal(tmp_path / "folder.obj", binding.ERROR_IO)


def test_off_file_of_309_bytes_that_announces_billions_of_vertices(tmp_path, cli):
    path = tmp_path / "huge.off"
    text = "OFF\n4000000000 12 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n# "
    path.write_text(text.ljust(309, "-"))
    assert "ends before vertex 5 of 4000000000" in refusal(path, binding.ERROR_MESH)
    result = cli("new", "huge.usda", "--solid", path)
    assert result.returncode == EXIT_SCENE and "ends before vertex 5 of 4000000000" in result.stderr
    assert not (tmp_path / "huge.usda").exists()


def test_want_of_memory_names_the_limit(tmp_path):
    # An honest file that is larger than the limit. A small one with a face that says it has 2e9 corners needs none.
    points = np.random.default_rng(1).random((100000, 3))
    (tmp_path / "large.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in points) + "f 1 2 3\n" * 1000)
    text = "needs more than 4.0 MiB of memory to be read, the limit of this run"
    assert text in refusal(tmp_path / "large.obj", binding.ERROR_MEMORY, 4 * MEBIBYTE)
    assert len(solver.load_mesh(tmp_path / "large.obj", 512 * MEBIBYTE).points) == 3
    row = b"3 0 1 2\n"
    assert row in mesh_samples.ply_text()
    (tmp_path / "huge.ply").write_bytes(mesh_samples.ply_text().replace(row, b"2000000000 0 1 2\n"))
    text = "its line has fewer entries than the 2000000000 it announces"
    assert text in refusal(tmp_path / "huge.ply", binding.ERROR_MESH, 256 * MEBIBYTE)


def test_crash_of_a_reader_is_an_error_that_names_it(tmp_path):
    # Nodes so deep that the reader's stack ends.
    data = mesh_samples.dae()
    deep = data.replace(b'<node id="node">', b"<node>" * 1000000 + b"<node>").replace(b"</node>", b"</node>" * 1000001)
    (tmp_path / "deep.dae").write_bytes(deep)
    assert "the process reading it crashed (Segmentation fault)" in refusal(tmp_path / "deep.dae", binding.ERROR_MESH)


@pytest.mark.parametrize(
    ("number", "status", "text"),
    [
        (signal.SIGKILL, binding.ERROR_MEMORY, "the process reading it was killed; the machine may be out of memory"),
        (signal.SIGABRT, binding.ERROR_MESH, "the process reading it crashed (Aborted)"),
    ],
)
def test_reader_that_is_killed_is_an_error(endless, number, status, text):
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(refusal, endless, status)
        os.kill(wait_for_children(endless, 1)[0], number)
        assert text in answer.result()


def test_reader_that_does_not_end_is_ended(endless, monkeypatch):
    monkeypatch.setattr(child, "SECONDS", 1.0)
    assert "not read within 1 s" in refusal(endless, binding.ERROR_MESH)
    assert not children(endless)


def test_time_that_reading_may_take_grows_with_the_files(tmp_path):
    for name, size in {"small.obj": 1000, "large.ply": 50_000_000, "parts.gltf": 1000, "parts.bin": 30_000_000}.items():
        with open(tmp_path / name, "wb") as file:
            file.truncate(size)
    expected = {"small.obj": 10, "large.ply": 50, "parts.gltf": 30.001, "none.obj": 10}
    assert {name: mesh_file.time_limit(tmp_path / name) for name in expected} == expected


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_child_outlives_the_program(endless, number):
    command = [sys.executable, "-m", "eulerfsi", "new", "new.usda", "--solid", endless]
    parent = subprocess.Popen(
        command,
        env=environment(),
        cwd=endless.parent,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background job ignores it
    )
    wait_for_children(endless, 1)
    parent.send_signal(number)
    _, noise = parent.communicate(timeout=60)
    killed = number == signal.SIGKILL
    assert parent.returncode == (-number if killed else 128 + number)
    assert noise == ("" if killed else f"stopped by signal {number}\n")
    wait_for_children(endless, 0)


def test_child_needs_neither_environment_nor_folder(tmp_path):
    write_obj(tmp_path / "ball.obj")
    # Modules of the current folder and of the caller's PYTHONPATH must not come in the way of the child's own.
    for name in ("json.py", "resource.py", "eulerfsi.py"):
        (tmp_path / name).write_text("raise SystemExit('the wrong module')\n")
    code = f"import sys; sys.path.insert(0, {str(ROOT / 'batch')!r}); from eulerfsi import solver; import os; "
    code += f"os.environ['PYTHONPATH'] = {str(tmp_path)!r}; print(len(solver.load_mesh('ball.obj').points))"
    bare = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    result = subprocess.run(
        [sys.executable, "-P", "-c", code], cwd=tmp_path, env=bare, check=True, capture_output=True, text=True
    )
    assert int(result.stdout) > 100


def test_missing_library_is_told_by_the_child_too(tmp_path, monkeypatch):
    monkeypatch.setenv("EULERFSI_LIBRARY", str(tmp_path / "none.so"))
    with pytest.raises(LibraryError, match=r"(?s)the shared library was not found.*none\.so"):
        solver.load_mesh(write_obj(tmp_path / "ball.obj"))


@pytest.mark.parametrize(
    "suffix",
    [suffix if suffix == "obj" else pytest.param(suffix, marks=pytest.mark.nightly) for suffix in mesh_file.FORMATS],
)
def test_damaged_files_end_with_a_mesh_or_a_clear_error(tmp_path, suffix):
    files = mesh_samples.write_mutations(tmp_path, suffix)
    limit = 256
    command = [sys.executable, Path(__file__).with_name("mesh_trial.py"), str(limit), tmp_path]
    result = subprocess.run(command, check=True, capture_output=True, text=True)  # check: the parent does not crash
    *lines, total = map(json.loads, result.stdout.splitlines())
    assert [line["file"] for line in lines] == [str(file) for file in files] and len(files) == 30
    for line in lines:
        if "error" in line:
            assert line["status"] in (binding.ERROR_MESH, binding.ERROR_MEMORY), line
            assert line["error"].startswith(f"{line['file']}: "), line
            assert "not read within" not in line["error"], line
        else:
            assert line["points"] >= 1 and line["faces"] >= 1
    outcomes = {"error" in line for line in lines}
    assert outcomes == {True, False}, "mutations that are all refused, or all harmless, test little"
    # What interpreter and library hold themselves is far below 128 MiB.
    assert total["peak"] < (limit + 128) * MEBIBYTE
