"""What to write where a file is given in the wrong place: a USD file as mesh file, a mesh file as scene."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Tf, Usd, UsdGeom

from ..command import command_line

_SHOWN = 3  # meshes of a file


def is_usd_file(file: Path) -> bool:
    """Whether USD reads files of this suffix."""
    return Usd.Stage.IsSupportedFile(str(file))


def how_to_make_a_scene(file: Path) -> str:
    """One line for a file that is no USD: the command that makes a scene of a mesh file."""
    number, scene = 1, Path(f"{file.stem}.usda")
    while scene.exists():
        number, scene = number + 1, Path(f"{file.stem}{number + 1}.usda")
    return (
        f"{file}: is not a USD file (.usda, .usdc, .usd, .usdz); to make a scene from a mesh file: "
        f"{command_line('new', scene, '--solid', file)}"
    )


def how_to_reference(file: Path, stage: Usd.Stage, scene: Path) -> str:
    """Lines for a USD file given as mesh file: the prim that `scene` has to hold. Later lines are indented."""
    asset = Path(os.path.relpath(file.resolve(), scene.resolve().parent)).as_posix()
    asset = asset if asset.startswith("../") else f"./{asset}"
    name = Tf.MakeValidIdentifier(file.stem)
    root, meshes = _meshes(stage)
    arcs = f"prepend references = @{asset}@" + ("" if root is None or root[0] else f"<{root[1]}>")
    schema = 'prepend apiSchemas = ["EulerFsiSolidAPI"]'
    if "" in meshes:
        body = [f'def "{name}" (', f"    {arcs}", f"    {schema}", ")", "{", "}"]
    else:
        body = [f'def "{name}" (', f"    {arcs}", ")", "{"]
        shown = [mesh.split("/") for mesh in meshes[:_SHOWN] or ["path/of/the/mesh"]]
        body += [*(f"    {line}" for line in _overs(shown, schema)), "}"]
    more = f" ({len(meshes)} meshes, {_SHOWN} shown)" if len(meshes) > _SHOWN else ""
    first = f"{file}: is a USD file, not a mesh file: reference it in a scene and make its meshes solids{more}, as in"
    return "\n".join([first, *(f"    {line}" for line in body)])


def _overs(paths: list[list[str]], schema: str) -> list[str]:
    """Nested opinions down to prims that get a schema; every prim once."""
    lines = []
    for name in dict.fromkeys(path[0] for path in paths):
        below = [path[1:] for path in paths if path[0] == name]
        lines += [f'over "{name}" (', f"    {schema}", ")", "{"] if [] in below else [f'over "{name}"', "{"]
        lines += [*(f"    {line}" for line in _overs([path for path in below if path], schema)), "}"]
    return lines


def _meshes(stage: Usd.Stage) -> tuple[tuple[bool, str] | None, list[str]]:
    """((whether it is the default prim, path) of the prim to reference, meshes relative to it); "" is the prim."""
    root = stage.GetDefaultPrim() or next(iter(stage.GetPseudoRoot().GetChildren()), None)
    if not root:
        return None, []
    path = root.GetPath()
    found = [prim.GetPath() for prim in Usd.PrimRange(root) if prim.IsA(UsdGeom.Mesh)]
    relative = [str(mesh.MakeRelativePath(path)) if mesh != path else "" for mesh in found]
    return (stage.HasDefaultPrim(), str(path)), relative
