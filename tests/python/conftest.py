"""What the tests share: small scenes, the command line, a reader of .vdb files."""

from __future__ import annotations

import fcntl
import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
for folder in ("batch", "usd_plugin"):
    if str(ROOT / folder) not in sys.path:
        sys.path.insert(0, str(ROOT / folder))

# Threads that wait in a loop slow each other down where tests share their processors with other work.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import eulerfsi_usd  # noqa: E402, F401 - registers the schema before the first stage is opened
from eulerfsi.solver import binding  # noqa: E402
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics  # noqa: E402

# Tests of SIGHUP hold under nohup, too, which leaves it ignored in every child.
signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(scope="session")
def library():
    """The shared library; a missing one fails the test with the places that were looked at."""
    return binding.library()


def sphere(radius: float = 1.0, rows: int = 10) -> tuple[np.ndarray, list[int], list[int]]:
    """A closed ball of quads and triangles, faces outwards: points (n, 3), counts, indices."""
    around = 2 * rows
    points = [(0.0, radius, 0.0)]
    for i in range(1, rows):
        polar = math.pi * i / rows
        for j in range(around):
            turn = 2 * math.pi * j / around
            ring = radius * math.sin(polar)
            points.append((ring * math.cos(turn), radius * math.cos(polar), -ring * math.sin(turn)))
    points.append((0.0, -radius, 0.0))
    at = lambda i, j: 1 + (i - 1) * around + j % around  # noqa: E731
    faces = [[0, at(1, j), at(1, j + 1)] for j in range(around)]
    faces += [
        [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)] for i in range(1, rows - 1) for j in range(around)
    ]
    faces += [[len(points) - 1, at(rows - 1, j + 1), at(rows - 1, j)] for j in range(around)]
    return np.array(points), [len(f) for f in faces], [i for f in faces for i in f]


def write_obj(path: Path, radius: float = 0.1) -> Path:
    """A ball as an obj file."""
    points, counts, indices = sphere(radius)
    lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in points]
    start = 0
    for count in counts:
        lines.append("f " + " ".join(str(i + 1) for i in indices[start : start + count]))
        start += count
    path.write_text("\n".join(lines) + "\n")
    return path


def metric_stage(path: Path, frames: tuple[int, int]) -> Usd.Stage:
    """A stage in metres, y up, 24 frames per second, with an empty /World."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(24)
    stage.SetFramesPerSecond(24)
    stage.SetStartTimeCode(frames[0])
    stage.SetEndTimeCode(frames[1])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    return stage


def make_scene(
    path: Path,
    *,
    meters_per_unit: float = 1.0,
    kilograms_per_unit: float = 1.0,
    up: str = "Y",
    parent: Gf.Matrix4d | None = None,
    frames: tuple[int, int] = (1, 3),
    smoke: bool = True,
    voxel: float = 0.05,
    velocity: tuple[float, float, float] = (0.0, -2.0, 0.0),
) -> Usd.Stage:
    """A small ball above a carpet of smoke in a box of 0.6 x 0.7 x 0.6 m; lengths are metres, in any stage units.

    The stage holds the same scene for every choice: `up` turns all below /World, `parent` (applied in world space)
    moves it, and values are written in stage units. Returns the stage, saved to `path`.
    """
    u = 1.0 / meters_per_unit
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, meters_per_unit)
    UsdPhysics.SetStageKilogramsPerUnit(stage, kilograms_per_unit)
    stage.SetTimeCodesPerSecond(24)
    stage.SetFramesPerSecond(24)
    stage.SetStartTimeCode(frames[0])
    stage.SetEndTimeCode(frames[1])
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    Usd.ModelAPI(world.GetPrim()).SetKind(Kind.Tokens.component)
    turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90 if up == "Z" else 0))
    place = turn * (parent or Gf.Matrix4d(1.0))
    world.AddTransformOp().Set(place)
    gravity = UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    down = place.TransformDir(Gf.Vec3d(0, -1, 0)).GetNormalized()
    gravity.CreateGravityDirectionAttr(Gf.Vec3f(down))
    gravity.CreateGravityMagnitudeAttr(9.8 * u)

    local = u / place.TransformDir(Gf.Vec3d(1, 0, 0)).GetLength()  # metres to the units below /World
    domain = box(stage, "/World/Domain", (0, -0.15, 0), (0.6, 0.7, 0.6), local, "EulerFsiDomainAPI")
    author(domain, voxelSize=voxel * u, fluidDensity=1.0 / kilograms_per_unit / u**3)
    for wall in ("XMin", "XMax", "YMin", "YMax", "ZMin", "ZMax"):
        author(domain, **{f"wall{wall}": "noSlip"})

    points, counts, indices = sphere(0.15)
    ball = UsdGeom.Mesh.Define(stage, "/World/Ball")
    ball.CreatePointsAttr(points * local)
    ball.CreateFaceVertexCountsAttr(counts)
    ball.CreateFaceVertexIndicesAttr(indices)
    ball.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    ball.CreateExtentAttr(UsdGeom.Mesh.ComputeExtent(ball.GetPointsAttr().Get()))
    uv = UsdGeom.PrimvarsAPI(ball).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    uv.Set([(p[0], p[1]) for p in points.tolist()])
    ball.GetPrim().ApplyAPI("EulerFsiSolidAPI")
    UsdPhysics.MassAPI.Apply(ball.GetPrim()).CreateDensityAttr(1000.0 / kilograms_per_unit / u**3)
    direction = place.TransformDir(Gf.Vec3d(*velocity))
    scale = place.TransformDir(Gf.Vec3d(1, 0, 0)).GetLength()
    author(ball.GetPrim(), youngsModulus=23333.0, poissonsRatio=1 / 6, velocity=tuple(direction * (u / scale)))
    if smoke:
        carpet = box(stage, "/World/Carpet", (0, -0.4, 0), (0.6, 0.2, 0.6), local, "EulerFsiEmitterAPI")
        author(carpet, mode="initial", smokeDensity=0.8)
    stage.GetRootLayer().Save()
    return stage


def box(stage: Usd.Stage, path: str, center: tuple, size: tuple, unit: float, api: str) -> Usd.Prim:
    """A guide Cube with an eulerfsi schema; center and size are multiplied with `unit`."""
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(1.0)
    cube.CreatePurposeAttr(UsdGeom.Tokens.guide)
    cube.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
    cube.AddTranslateOp().Set(Gf.Vec3d(*center) * unit)
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*size) * unit)
    cube.GetPrim().ApplyAPI(api)
    return cube.GetPrim()


def author(prim: Usd.Prim, **values: object) -> None:
    """Sets eulerfsi: attributes."""
    for name, value in values.items():
        attribute = prim.GetAttribute(f"eulerfsi:{name}")
        assert attribute, f"{prim.GetPath()} has no eulerfsi:{name}"
        attribute.Set(value)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """The small scene in metres, frames 1-3."""
    make_scene(tmp_path / "small.usda")
    return tmp_path / "small.usda"


def environment() -> dict[str, str]:
    """Environment in which `python -m eulerfsi` finds the packages of this checkout."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "batch"), str(ROOT / "usd_plugin")])}


@pytest.fixture
def cli(tmp_path: Path, library, monkeypatch, capsys) -> Callable[..., subprocess.CompletedProcess]:
    """Runs `eulerfsi ARGUMENTS` in tmp_path, inside this process; returns exit code and output as a process would."""
    from eulerfsi.cli.main import main

    def run(*arguments: object) -> subprocess.CompletedProcess:
        monkeypatch.chdir(tmp_path)
        capsys.readouterr()
        try:
            code = main([str(a) for a in arguments])
        except SystemExit as leave:  # argparse
            code = leave.code
        out, err = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, code, out, err)

    return run


def without_progress(stderr: str) -> str:
    """Without the lines that a machine of too many tasks writes about work of more than a second."""
    return "".join(line for line in stderr.splitlines(keepends=True) if ": examining the surface, " not in line)


def content_hashes(folder: Path) -> dict[str, list[str]]:
    """{frame: content hashes of its files and the state hash} of a cache."""
    manifest = json.loads((folder / "manifest.json").read_text())
    return {
        frame: [entry["state"], *(facts["content"] for facts in entry["files"].values())]
        for frame, entry in manifest["frames"].items()
    }


_DUMP_VDB = r"""
#include <openvdb/openvdb.h>
#include <cstdio>
// Prints one line a grid: name, class, voxels, sum of values (x component), centroid weighted with them, voxel size.
template <class Grid, class Weight>
void print(const Grid& grid, Weight weight) {
  double sum = 0, c[3] = {0, 0, 0}, v[3] = {0, 0, 0};
  for (auto it = grid.cbeginValueOn(); it; ++it) {
    const openvdb::Vec3d x = grid.transform().indexToWorld(it.getCoord().asVec3d());
    const double w = weight(*it, v);
    sum += w;
    for (int i = 0; i < 3; ++i) c[i] += w * x[i];
  }
  std::printf("%s %s %llu %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", grid.getName().c_str(),
              openvdb::GridBase::gridClassToString(grid.getGridClass()).c_str(),
              static_cast<unsigned long long>(grid.activeVoxelCount()), sum, c[0] / sum, c[1] / sum, c[2] / sum,
              grid.voxelSize()[0], v[0], v[1], v[2]);
}
int main(int, char** argv) {
  openvdb::initialize();
  openvdb::io::File file(argv[1]);
  file.open();
  const openvdb::GridPtrVecPtr grids = file.getGrids();
  for (auto& base : *grids) {
    if (auto s = openvdb::gridPtrCast<openvdb::FloatGrid>(base)) print(*s, [](float x, double*) { return double(x); });
    if (auto s = openvdb::gridPtrCast<openvdb::Vec3SGrid>(base))
      print(*s, [](const openvdb::Vec3s& x, double* v) {
        for (int i = 0; i < 3; ++i) v[i] += x[i];
        return double(x.length());
      });
  }
}
"""


@pytest.fixture(scope="session")
def read_vdb(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], dict[str, dict]]:
    """Reads a .vdb with OpenVDB itself: {grid: {"class", "voxels", "sum", "centroid", "voxel_size", "total"}}."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # of all workers: one of them compiles
    program = folder / "dump_vdb"
    with open(folder / "dump_vdb.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not program.exists():
            (folder / "dump_vdb.cpp").write_text(_DUMP_VDB)
            command = ["c++", "-std=c++17", "-O0", "dump_vdb.cpp", "-o", "dump_vdb.new"]
            command += ["-Wl,--copy-dt-needed-entries", "-lopenvdb", "-ltbb"]
            subprocess.run(command, cwd=folder, check=True)
            (folder / "dump_vdb.new").rename(program)

    def read(path: Path) -> dict[str, dict]:
        text = subprocess.run([program, path], check=True, text=True, capture_output=True).stdout
        grids = {}
        for line in text.splitlines():
            words = line.split(" ")
            number = [float(w) for w in words[-9:]]
            grids[words[0]] = {
                "class": " ".join(words[1:-9]),
                "voxels": int(number[0]),
                "sum": number[1],
                "centroid": np.array(number[2:5]),
                "voxel_size": number[5],
                "total": np.array(number[6:9]),
            }
        return grids

    return read


def world_points(stage: Usd.Stage, path: str, frame: int) -> np.ndarray:
    """Where a mesh, curves or points are in a frame, (n, 3), stage units."""
    prim = UsdGeom.PointBased(stage.GetPrimAtPath(path))
    matrix = np.array(UsdGeom.XformCache(frame).GetLocalToWorldTransform(prim.GetPrim()))
    return np.asarray(prim.GetPointsAttr().Get(frame), float) @ matrix[:3, :3] + matrix[3, :3]
