"""`new`: a scene that is ready to simulate, written around mesh files or a USD file."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from ..errors import LibraryError, SceneError, UsageError
from ..files import export_layer, replacing
from ..log import Log
from ..run.build import build_simulation
from ..run.simulate import Options, load_scene
from ..scene.instancers import MOST_BODIES
from ..scene.read import open_stage
from ..scene.references import how_to_reference, is_usd_file
from ..scene.values import SOLID_API
from ..system import available_memory, available_threads
from .new_from_usd import unit_warnings, wrap
from .new_layout import Layout, lay_out
from .new_pieces import Object, read_objects
from .new_stage import NewStage, author, comment

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "in": 0.0254, "ft": 0.3048}
_COMMENT = "Comments say what each value does; ./eulerfsi validate says whether the scene runs, and for how long."


def new_scene(
    path: Path,
    solids: Sequence[Path],
    smoke: str,
    unit: str = "m",
    up: str = "y",
    asset: Path | None = None,
    joined: bool = False,
) -> tuple[Layout, list[str]]:
    """Writes `path` with one elastic solid per object of the files, side by side above the floor of a box of fluid.

    smoke: "carpet" (a layer on the floor) or "none". unit, up: of the files and of the stage. asset: a USD file instead
    of mesh files, around which the box is put, in its units. joined: one solid per file instead. The scene is examined
    as a run examines it, before it takes its place. Returns what was chosen and the warnings that a run will give.
    Raises UsageError for the path, SceneError for a mesh that cannot be simulated.
    """
    if path.suffix not in (".usda", ".usd", ".usdc"):
        raise UsageError(f"{path}: must end in .usda, .usd or .usdc")
    if path.exists():
        raise UsageError(f"{path}: exists already")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    if asset:
        layout, prims = wrap(layer, path, asset, smoke)
        told = unit_warnings(asset)
    else:
        read = [_read(file, path, joined) for file in solids]
        told = [line for _, lines in read for line in lines]
        count = sum(len(objects) for objects, _ in read)
        if count > MOST_BODIES:
            names = ", ".join(map(str, solids))
            raise SceneError(
                f"{names}: {count} objects: must be at most {MOST_BODIES}; --join makes one solid of a file"
            )
        layout, prims = _around_files(layer, path, solids, [objects for objects, _ in read], smoke, UNITS[unit], up)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    with replacing(path) as temporary:
        export_layer(layer, temporary)
        warnings = _examine(temporary, prims, layout)
    return layout, [*told, *warnings]


def _read(file: Path, scene: Path, joined: bool) -> tuple[list[Object], list[str]]:
    if is_usd_file(file):
        raise SceneError(how_to_reference(file, open_stage(file), scene))
    return read_objects(file, joined)


def _around_files(
    layer: Sdf.Layer,
    path: Path,
    files: Sequence[Path],
    objects: Sequence[list[Object]],
    smoke: str,
    unit: float,
    up: str,
) -> tuple[Layout, dict[str, str]]:
    """The layer's content; for each solid's prim its file, and object, for people."""
    new = NewStage(Usd.Stage.Open(layer), unit, up)
    ends = [[_ends(new, one) for one in parts] for parts in objects]
    blocks = [(np.min([low for low, _ in e], axis=0), np.max([high for _, high in e], axis=0)) for e in ends]
    solids = np.array([high - low for e in ends for low, high in e])
    layout = lay_out(np.array([high - low for low, high in blocks]), solids)
    new.set_up(layout, _COMMENT)
    new.add_domain(layout, (0, layout.size[1] / 2, 0))
    prims, moduli = {}, iter(layout.moduli)
    for file, parts, (low, high), center in zip(files, objects, blocks, layout.centers, strict=True):
        prim = UsdGeom.Xform.Define(new.stage, f"/World/{new.unique(file.stem)}")
        prim.AddTranslateOp().Set(new.world(center - (low + high) / 2))
        for solid, one in zip(_solids(new, prim.GetPrim(), file, path, parts), parts, strict=True):
            solid.AddAppliedSchema(SOLID_API)
            author(solid, "solid", youngsModulus=next(moduli))
            prims[str(solid.GetPath())] = f'{file}: object "{one.name}"' if one.name else str(file)
    if smoke == "carpet":
        new.add_carpet(layout, (0, 0, 0))
    return layout, prims


def _solids(new: NewStage, prim: Usd.Prim, file: Path, path: Path, parts: list[Object]) -> list[Usd.Prim]:
    """The prim of a whole file, that refers to it; else a Mesh below it for each object."""
    if parts[0].name:
        return [new.add_mesh(prim.GetPath(), one.name, one.mesh) for one in parts]
    relative = Path(os.path.relpath(file.resolve(), path.resolve().parent)).as_posix()
    attribute = prim.CreateAttribute("eulerfsi:surfaceFile", Sdf.ValueTypeNames.Asset, False)
    attribute.Set(f"./{relative}")
    comment(attribute, "The surface of the solid, in the units of this stage.")
    return [prim]


def _ends(new: NewStage, one: Object) -> tuple[np.ndarray, np.ndarray]:
    """Corners of its box [m], y up."""
    points = new.layout(one.mesh.points)
    return points.min(axis=0), points.max(axis=0)


def _examine(scene: Path, prims: dict[str, str], layout: Layout) -> list[str]:
    """The warnings of a run. Raises SceneError for what it would refuse, in terms of the mesh files.

    prims: {prim path: its file, and object}.
    """
    limit, told = available_memory(), io.StringIO()
    log = Log(told)
    try:
        read, _ = load_scene(scene, Options(), log, limit)
        build_simulation(read, available_threads(), limit, log).simulation.close()
    except (SceneError, LibraryError) as error:
        lines = [_explain(line, prims, layout) for line in str(error).splitlines()]
        raise SceneError("\n".join(lines)) from error
    return told.getvalue().splitlines()


def _explain(line: str, prims: dict[str, str], layout: Layout) -> str:
    """A line of what a run would refuse, about one prim or "A and B"."""
    where, _, reason = line.partition(": ")
    files = [prims.get(prim.partition(".")[0], "") for prim in where.split(" and ")]
    if not all(files):
        return f"the scene: {line}"
    if len(files) > 1:
        return f"{' and '.join(files)}: {reason}, or make one solid of a file with --join"
    reason = reason.removeprefix(f"{Path(files[0]).resolve()}: ")
    way_out = "; a finer grid would run for more than two minutes" if "too thin" in reason else ""
    return f"{files[0]}: cannot be simulated at voxel size {layout.voxel:g} m: {reason}{way_out}"
