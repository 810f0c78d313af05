# SPDX-License-Identifier: GPL-3.0-or-later
"""Shows a bake: copies of the solids that follow the cache, and the smoke as a volume. The originals stay, hidden."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from . import job, scene_export

_MARK = "eulerfsi_bake"  # on the collection: identity of the scene; on its objects: their prim
_HIDDEN = "eulerfsi_hidden"  # on originals: how they were before
_SMOKE = "Euler FSI Smoke"  # material, and its node of the density
_DENSITY = "eulerfsi_density"  # on that material: the density that was set last; another one is the artist's


def collection_of(scene: bpy.types.Scene) -> bpy.types.Collection | None:
    """The collection that shows the scene's bake."""
    return next((c for c in scene.collection.children if c.get(_MARK) == scene.eulerfsi.uid), None)


def original(scene: bpy.types.Scene, obj: bpy.types.Object | None) -> bpy.types.Object | None:
    """The object whose bake an object shows; the object itself where it shows none."""
    return (obj and scene_export.object_of(scene, obj.get(_MARK))) or obj


def refresh(scene: bpy.types.Scene, folder: Path, found: job.Cache, final: bool) -> None:
    """Shows the frames that are there. final: no more come."""
    if not found.frames or not (folder / "cache" / "scene.usda").exists():
        return
    shown = collection_of(scene)
    state = [found.frames[0], found.frames[-1], len(found.frames), found.bytes, int(final)]
    if shown and list(shown.get("eulerfsi_state", ())) == state:
        return
    if shown is None:
        show(scene, folder, found)
    else:
        _update(scene, shown, found)
    collection_of(scene)["eulerfsi_state"] = state


def show(scene: bpy.types.Scene, folder: Path, found: job.Cache) -> None:
    """Makes what shows the bake anew. Raises OSError, ValueError."""
    remove(scene)
    data = json.loads((folder / "export" / "scene.json").read_text(encoding="utf-8"))
    collection = bpy.data.collections.new(f"{scene.name} Bake")
    collection[_MARK] = scene.eulerfsi.uid
    scene.collection.children.link(collection)
    cache = _open_cache(folder / "cache" / "scene.usda")
    for entry in data["prims"]:
        if entry["role"] in ("SOLID", "PASSENGER"):
            _add_body(scene, collection, entry, folder, cache, data["first"])
    if found.smoke:
        _add_smoke(scene, collection, folder, found)


def remove(scene: bpy.types.Scene) -> None:
    """Takes away what shows the bake, and shows the originals again."""
    for obj in scene.objects:
        if _HIDDEN in obj:
            obj.hide_viewport, obj.hide_render = (bool(x) for x in obj[_HIDDEN])
            del obj[_HIDDEN]
    collection = collection_of(scene) if scene.eulerfsi.uid else None
    if collection is None:
        return
    gone: list[Any] = []
    for obj in list(collection.objects):
        gone += [m.cache_file for m in obj.modifiers if m.type == "MESH_SEQUENCE_CACHE" and m.cache_file]
        gone += [obj, obj.data]
    bpy.data.batch_remove(list(dict.fromkeys([*gone, collection])))


def _open_cache(path: Path) -> bpy.types.CacheFile:
    """The root layer as a data-block, by a path relative to the .blend file, which may move with its cache."""
    before = set(bpy.data.cache_files)
    bpy.ops.cachefile.open(filepath=str(path))
    cache = next(c for c in bpy.data.cache_files if c not in before)
    cache.name = "Euler FSI"
    cache.filepath = _relative(path)
    if hasattr(cache, "velocity_unit"):
        cache.velocity_unit = "SECOND"
    return cache


def _relative(path: Path) -> str:
    try:
        return bpy.path.relpath(str(path))
    except ValueError:  # another drive
        return str(path)


def _add_body(
    scene: bpy.types.Scene,
    collection: bpy.types.Collection,
    entry: dict[str, Any],
    folder: Path,
    cache: bpy.types.CacheFile,
    first: int,
) -> None:
    """A copy of an object as it was exported, with its materials and UVs, that follows the cache."""
    source = scene_export.object_of(scene, entry["path"])
    with np.load(folder / "export" / entry["shape"]["file"]) as arrays:
        points, counts, indices = arrays["points"], arrays["counts"], arrays["indices"]
    points = points if points.ndim == 2 else points[0]
    mesh = _evaluated_copy(scene, source, first) if source else None
    if mesh is None or len(mesh.vertices) != len(points):  # changed since: its shape of then
        mesh = mesh or bpy.data.meshes.new(entry["object"])
        mesh.clear_geometry()
        ends = np.cumsum(counts)
        mesh.from_pydata(points.tolist(), [], [f.tolist() for f in np.split(indices, ends[:-1])])
    mesh.name = f"{entry['object']} Bake"
    obj = bpy.data.objects.new(f"{entry['object']} Bake", mesh)
    obj[_MARK] = entry["path"]
    collection.objects.link(obj)
    obj.matrix_world = Matrix(
        np.reshape(entry["matrices"].get(str(first)) or list(entry["matrices"].values())[-1], (4, 4)).tolist()
    )
    modifier = obj.modifiers.new("Euler FSI", "MESH_SEQUENCE_CACHE")
    modifier.cache_file, modifier.object_path = cache, entry["path"]
    modifier.read_data = {"VERT", "ATTRIBUTES"} if "ATTRIBUTES" in modifier.read_data else {"VERT"}
    if source and _HIDDEN not in source:
        source[_HIDDEN] = [int(source.hide_viewport), int(source.hide_render)]
        source.hide_viewport = source.hide_render = True


def _evaluated_copy(scene: bpy.types.Scene, source: bpy.types.Object, first: int) -> bpy.types.Mesh:
    """The mesh with its modifiers, in the first frame."""
    now, sub = scene.frame_current, scene.frame_subframe
    hidden, source.hide_viewport = source.hide_viewport, False
    try:
        if now != first:
            scene.frame_set(first)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        evaluated = source.evaluated_get(depsgraph)
        return bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    finally:
        source.hide_viewport = hidden
        if now != first:
            scene.frame_set(now, subframe=sub)


def _add_smoke(scene: bpy.types.Scene, collection: bpy.types.Collection, folder: Path, found: job.Cache) -> None:
    """A volume sequence with a material; velocities are per second. Blender finds their grid by itself."""
    volume = bpy.data.volumes.new("Smoke Bake")
    number = f"{found.smoke[0]:04d}"
    volume.filepath = _relative(folder / "cache" / "vdb" / f"scene.{number}.vdb")
    volume.is_sequence = True
    _set_range(volume, found)
    volume.velocity_unit, volume.velocity_scale = "SECOND", 1.0
    export = json.loads((folder / "export" / "scene.json").read_text(encoding="utf-8"))
    density = job.density_scale(folder) * export["meters_per_unit"]  # a volume counts in units of the scene
    volume.materials.append(_smoke_material(scene, density))
    obj = bpy.data.objects.new("Smoke Bake", volume)
    obj[_MARK] = "smoke"
    collection.objects.link(obj)


def _set_range(volume: bpy.types.Volume, found: job.Cache) -> None:
    volume.frame_start, volume.frame_duration, volume.frame_offset = found.smoke[0], len(found.smoke), 0
    volume.sequence_mode = "CLIP"


def _smoke_material(scene: bpy.types.Scene, density: float) -> bpy.types.Material:
    """That of the scene's smoke. density: per unit of length of the scene; one that the artist has set stays."""
    material = next((m for m in bpy.data.materials if m.get(_MARK) == scene.eulerfsi.uid), None)
    if material is None:
        material = _new_smoke_material()
        material[_MARK] = scene.eulerfsi.uid
    node = material.node_tree.nodes.get(_SMOKE)
    if node and (_DENSITY not in material or node.inputs["Density"].default_value == material[_DENSITY]):
        node.inputs["Density"].default_value = density
        material[_DENSITY] = node.inputs["Density"].default_value
    return material


def _new_smoke_material() -> bpy.types.Material:
    """White smoke, as dense as the grid "density" says."""
    material = bpy.data.materials.new(_SMOKE)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    principled = tree.nodes.new("ShaderNodeVolumePrincipled")
    output.location, principled.location = (300, 0), (0, 0)
    principled.name = _SMOKE
    principled.inputs["Density Attribute"].default_value = "density"
    principled.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(principled.outputs["Volume"], output.inputs["Volume"])
    return material


def _update(scene: bpy.types.Scene, shown: bpy.types.Collection, found: job.Cache) -> None:
    """More frames are there, or others."""
    files = {m.cache_file for o in shown.objects for m in o.modifiers if m.type == "MESH_SEQUENCE_CACHE"}
    for cache in filter(None, files):
        with bpy.context.temp_override(edit_cachefile=cache):
            bpy.ops.cachefile.reload()
    for obj in shown.objects:
        if obj.type == "VOLUME" and found.smoke:
            _set_range(obj.data, found)
            obj.data.filepath = obj.data.filepath  # what was read of the old files is dropped
    if found.smoke and not any(obj.type == "VOLUME" for obj in shown.objects):
        from .bake import folder_of

        _add_smoke(scene, shown, folder_of(scene), found)
