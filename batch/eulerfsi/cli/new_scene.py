"""`new`: a scene that is ready to simulate, written around mesh files."""

from __future__ import annotations

import dataclasses
import io
import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from ..errors import LibraryError, SceneError, UsageError
from ..files import export_layer, replacing
from ..log import Log
from ..parameters import table
from ..reasons import mesh_reason
from ..run import estimate
from ..run.build import build_simulation
from ..run.simulate import Options, load_scene
from ..scene.bodies import DEFAULT_DENSITY
from ..scene.read import EARTH_GRAVITY, open_stage
from ..scene.references import how_to_reference, is_usd_file
from ..scene.values import DOMAIN_API, EMITTER_API, SOLID_API
from ..solver import simulation as solver
from ..system import available_memory, available_threads

_CELLS_ACROSS = 24  # of the smallest solid
_CELLS_THROUGH = 3  # of the shortest edge of a solid's box
_MAX_CELLS = 2e6
_MAX_SECONDS = 60.0  # of the whole run on two cores, if it takes the most steps that it may
_FPS, _FRAMES, _MAX_FRAMES = 24, 48, 480
# A solid of length L moves in times of sqrt(L/g): a scene shows at most so many of them, and at least so many.
_MOST_TIMES, _LEAST_TIMES = 20.0, 2.5


@dataclasses.dataclass(frozen=True)
class Layout:
    """A scene around solids. size: of the box [m]; centers: (n, 3) of the solids, floor at y = 0; moduli [Pa]."""

    size: np.ndarray
    voxel: float
    fps: int
    frames: int
    centers: np.ndarray
    moduli: list[float]

    @property
    def cells(self) -> int:
        """Cells of the grid."""
        return int((self.size / self.voxel).round().prod())


def new_scene(path: Path, solids: Sequence[Path], smoke: str) -> tuple[Layout, list[str]]:
    """Writes `path` with one elastic solid per mesh file, side by side above the floor of a box of fluid.

    File units are taken as metres. smoke: "carpet" (a layer on the floor) or "none". The scene is examined as a run
    examines it, before it takes its place. Returns what was chosen and the warnings that a run will give. Raises
    UsageError for the path, SceneError for a mesh that cannot be simulated.
    """
    if path.suffix not in (".usda", ".usd", ".usdc"):
        raise UsageError(f"{path}: must end in .usda, .usd or .usdc")
    if path.exists():
        raise UsageError(f"{path}: exists already")
    for file in solids:
        if is_usd_file(file):
            raise SceneError(how_to_reference(file, open_stage(file), path))
    boxes = [_extents(file) for file in solids]
    layout = lay_out(np.array([high - low for low, high in boxes]))
    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = _stage(layer, layout)
    names: set[str] = set()
    prims = {}
    for file, (low, high), center, modulus in zip(solids, boxes, layout.centers, layout.moduli, strict=True):
        prim = UsdGeom.Xform.Define(stage, f"/World/{_unique(file, names)}")
        prims[str(prim.GetPath())] = file
        prim.AddTranslateOp().Set(Gf.Vec3d(*(center - (low + high) / 2).tolist()))
        prim.GetPrim().AddAppliedSchema(SOLID_API)
        relative = Path(os.path.relpath(file.resolve(), path.resolve().parent)).as_posix()
        prim.GetPrim().CreateAttribute("eulerfsi:surfaceFile", Sdf.ValueTypeNames.Asset, False).Set(f"./{relative}")
        _author(prim.GetPrim(), "solid", youngsModulus=modulus)
    if smoke == "carpet":
        height = max(3 * layout.voxel, 0.06 * layout.size[1])
        carpet = _box(stage, "/World/Carpet", (0, height / 2, 0), (layout.size[0], height, layout.size[2]), EMITTER_API)
        _author(carpet, "emitter", mode="initial", smokeDensity=0.8)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    with replacing(path) as temporary:
        export_layer(layer, temporary)
        warnings = _examine(temporary, prims, layout)
    return layout, warnings


def lay_out(edges: np.ndarray) -> Layout:
    """Box, voxel size, frames and stiffness for solids with bounding boxes of these edges, (n, 3) [m].

    The voxel size gives the smallest solid 24 cells across and every box 3 through, unless the run would take too long.
    E = 20 rho g L: weight alone presses a solid by a few percent. A small scene is slow motion, a large one is longer.
    """
    margin = 0.7 * float(edges.mean(axis=1).max())
    gap = 0.6 * margin
    width = float(edges[:, 0].sum()) + gap * (len(edges) - 1)
    size = np.array([width, float(edges[:, 1].max()), float(edges[:, 2].max())]) + 2 * margin
    left = -width / 2 + np.concatenate([[0.0], np.cumsum(edges[:-1, 0] + gap)])
    centers = np.stack([left + edges[:, 0] / 2, margin + edges[:, 1] / 2, np.zeros(len(edges))], axis=1)
    moduli = [_round(20 * DEFAULT_DENSITY * EARTH_GRAVITY * float(edge.max())) for edge in edges]
    time = math.sqrt(float(edges.max()) / EARTH_GRAVITY)
    fps = _FPS
    while _FRAMES / fps > _MOST_TIMES * time:
        fps *= 2
    frames = min(max(_FRAMES, math.ceil(_LEAST_TIMES * time * fps)), _MAX_FRAMES)
    wanted = min(float(edges.max(axis=1).min()) / _CELLS_ACROSS, float(edges.min()) / _CELLS_THROUGH)
    voxel = _round(max(wanted, float(size.prod() / _MAX_CELLS) ** (1 / 3)))
    while True:
        layout = Layout(np.ceil(size / voxel) * voxel, voxel, fps, frames, centers, moduli)
        if _seconds(layout, edges, margin) <= _MAX_SECONDS:
            return layout
        voxel = _round(1.06 * voxel)


def _seconds(layout: Layout, edges: np.ndarray, drop: float) -> float:
    """What the run may take on two cores."""
    h, poisson = layout.voxel, table()["solid"]["poissonsRatio"].default
    limits = solver.step_limits({"voxel_size": h}, DEFAULT_DENSITY)
    meets = estimate.seconds_to_meet(drop - limits["contact_reach"] * h, 0.0, EARTH_GRAVITY)
    bodies = [
        estimate.Body(0.0, EARTH_GRAVITY, meets, math.sqrt(E / 2 / (1 + poisson) / DEFAULT_DENSITY), float(edge[1]))
        for E, edge in zip(layout.moduli, edges, strict=True)
    ]
    _, most = estimate.steps(estimate.Plan(h, 1 / layout.fps, layout.frames - 1, bodies, limits))
    return most * layout.cells * estimate.SECONDS_PER_CELL_STEP


def _examine(scene: Path, prims: dict[str, Path], layout: Layout) -> list[str]:
    """The warnings of a run. Raises SceneError for what it would refuse, in terms of the mesh files.

    prims: {prim path: its file}.
    """
    limit, told = available_memory(), io.StringIO()
    log = Log(told)
    try:
        read, _ = load_scene(scene, Options(), log, limit)
        build_simulation(read, available_threads(), limit, log).simulation.close()
    except (SceneError, LibraryError) as error:
        lines = []
        for line in str(error).splitlines():
            prim, _, reason = line.partition(": ")
            file = prims.get(prim.partition(".")[0])
            reason = reason.removeprefix(f"{file.resolve()}: ") if file else line
            where = f"{file}: cannot be simulated at voxel size {layout.voxel:g} m" if file else "the scene"
            way_out = "; a finer grid would run for more than two minutes" if "too thin" in reason else ""
            lines.append(f"{where}: {reason}{way_out}")
        raise SceneError("\n".join(lines)) from error
    return told.getvalue().splitlines()


def _stage(layer: Sdf.Layer, layout: Layout) -> Usd.Stage:
    """Units, frames, gravity and the box."""
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(layout.fps)
    stage.SetFramesPerSecond(layout.fps)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(layout.frames)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    Usd.ModelAPI(world.GetPrim()).SetKind("component")
    gravity = UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    gravity.CreateGravityDirectionAttr(Gf.Vec3f(0, -1, 0))
    gravity.CreateGravityMagnitudeAttr(EARTH_GRAVITY)
    domain = _box(stage, "/World/Domain", (0, layout.size[1] / 2, 0), layout.size, DOMAIN_API)
    _author(domain, "domain", voxelSize=layout.voxel)
    return stage


def _extents(file: Path) -> tuple[np.ndarray, np.ndarray]:
    if not file.is_file():
        raise SceneError(f"{file}: {'is a folder, not a mesh file' if file.is_dir() else 'no such file'}")
    try:
        points = solver.load_mesh(file).points.astype(float)
    except LibraryError as error:
        raise SceneError(f"{file}: {mesh_reason(file, error)}") from error
    low, high = points.min(axis=0), points.max(axis=0)
    flat = [axis for axis, edge in zip("xyz", high - low, strict=True) if not edge > 1e-6 * (high - low).max()]
    if flat:
        raise SceneError(f"{file}: the mesh is flat, without extent along {' and '.join(flat)}: a solid needs a volume")
    return low, high


def _round(value: float) -> float:
    """Two significant digits."""
    digits = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{round(value / digits) * digits:.6g}")


def _unique(file: Path, names: set[str]) -> str:
    base = "".join(c if c.isalnum() else "_" for c in file.stem.title()) or "Solid"
    base = base if not base[0].isdigit() else f"Solid_{base}"
    number, name = 1, base
    while name in names | {"Domain", "Carpet", "PhysicsScene"}:
        number, name = number + 1, f"{base}{number + 1}"
    names.add(name)
    return name


def _box(stage: Usd.Stage, path: str, center: Sequence[float], size: Sequence[float], api: str) -> Usd.Prim:
    """A guide Cube of edge 1, scaled to a box."""
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(1.0)
    cube.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
    cube.CreatePurposeAttr(UsdGeom.Tokens.guide)
    cube.AddTranslateOp().Set(Gf.Vec3d(*map(float, center)))
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, size)))
    cube.GetPrim().AddAppliedSchema(api)
    return cube.GetPrim()


def _author(prim: Usd.Prim, scope: str, **values: float | str) -> None:
    kinds = {"double": Sdf.ValueTypeNames.Double, "token": Sdf.ValueTypeNames.Token}
    for name, value in values.items():
        row = table()[scope][name]
        variability = Sdf.VariabilityVarying if row.animated else Sdf.VariabilityUniform
        attribute = prim.CreateAttribute(row.attribute, kinds[row.type], False, variability)
        attribute.Set(value)
