# SPDX-License-Identifier: GPL-3.0-or-later
"""From the factory scene to rendered frames, by the operators behind the buttons."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
from pathlib import Path

import bpy
import numpy as np
from harness import MODULE, fresh, jelly, part, pick, refused, run, until

SAMPLES = 4


def points_of(name: str, frame: int) -> np.ndarray:
    """Vertices of an object in a frame, with its modifiers, in the world."""
    bpy.context.scene.frame_set(frame)
    obj = bpy.data.objects[name]
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    matrix = np.array(obj.matrix_world)
    return points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def velocities_of(name: str) -> np.ndarray:
    data = bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    values = np.empty(len(data.vertices) * 3, np.float32)
    data.attributes["velocity"].data.foreach_get("vector", values)
    return values.reshape(-1, 3)


def smoke_sum(volume: bpy.types.Volume, frame: int) -> tuple[str, set[str]]:
    bpy.context.scene.frame_set(frame)
    assert volume.grids.load(), volume.grids.error_message
    return volume.grids.frame_filepath, {grid.name for grid in volume.grids}


def render(path: Path, frame: int, width: int = 160) -> np.ndarray:
    """Pixels of a Cycles picture."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES
    scene.cycles.max_bounces, scene.render.threads_mode, scene.render.threads = 3, "FIXED", 1
    if hasattr(scene.cycles, "volume_biased"):
        scene.cycles.volume_biased = True  # an eighth of the time
    scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
    scene.render.resolution_percentage, scene.render.filepath = 100, str(path)
    scene.frame_set(frame)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def check_bouncing_jelly() -> None:
    """Set up, validate, bake, load: mesh and smoke move, and two frames are rendered."""
    scene, folder = jelly("jelly", frames=14, voxel=0.4)
    assert bpy.ops.eulerfsi.validate() == {"FINISHED"}
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    baked, volume = bpy.data.objects["Cube Bake"], bpy.data.objects["Smoke Bake"].data
    rest = points_of("Cube", 1)
    first, later = points_of("Cube Bake", 1), points_of("Cube Bake", 6)
    assert np.abs(first[:8] - rest[:8]).max() < 1e-5 and len(first) > 8, "the first frame is the object as it was"
    fallen = (later - first).mean(axis=0)
    expected = -0.5 * 9.81 * (5 / 24) ** 2
    assert abs(fallen[2] - expected) < 0.03 and abs(fallen[:2]).max() < 0.01, (fallen, expected)
    speed = velocities_of("Cube Bake")[:, 2].mean()  # of frame 6: metres per second
    assert abs(speed + 9.81 * 5 / 24) < 0.2, speed
    last = points_of("Cube Bake", 14)
    assert np.ptp(last[:, 2]) < 0.97 * np.ptp(first[:, 2]), "it is squeezed where it has landed"
    assert (volume.frame_start, volume.frame_duration) == (1, 14)
    assert smoke_sum(volume, 1) != smoke_sum(volume, 14) and smoke_sum(volume, 14)[1] == {"density", "vel"}
    assert (volume.velocity_grid, volume.velocity_unit, volume.velocity_scale) == ("vel", "SECOND", 1.0)
    assert baked.modifiers[0].cache_file.velocity_unit == "SECOND"
    cube = bpy.data.objects["Cube"]
    assert cube.hide_render and cube.hide_viewport and baked.data.materials[0] == cube.data.materials[0]
    pictures = [render(folder / f"{frame}.png", frame) for frame in (1, 14)]
    assert np.abs(pictures[0] - pictures[1]).max() > 0.1
    baked.hide_render = True
    smoke = [render(folder / f"smoke{frame}.png", frame) for frame in (1, 14)]
    bpy.data.objects["Smoke Bake"].hide_render = True
    empty = render(folder / "empty.png", 14)
    assert np.abs(smoke[1] - empty).max() > 0.05 and np.abs(smoke[1] - smoke[0]).max() > 0.02


def sizes(obj: bpy.types.Object) -> list[object]:
    """What the panel counts, and the modulus of a preset, which follow the size of an object."""
    domain = bpy.data.objects["Domain"]
    return [obj.eulerfsi.solid.youngs_modulus, part("panels").counts(bpy.context.scene, domain)[0]]


def check_undo_save_load() -> None:
    """Settings survive; nothing of a bake's state is stored."""
    scene, folder = jelly("kept", frames=16)
    scene.frame_start = 11  # a shot begins where it likes
    cube = bpy.data.objects["Cube"]
    cube.location, cube.rotation_euler.x, cube.scale.x = (0.1, 0.2, 0.3), 0.4, 1.5
    cube.eulerfsi.material_preset = "JELLY"
    shown = sizes(cube)
    cube.eulerfsi.solid.youngs_modulus = 12345.0
    bpy.ops.ed.undo_push(message="set")
    cube.eulerfsi.solid.youngs_modulus = 999.0
    bpy.ops.ed.undo_push(message="changed")
    bpy.ops.ed.undo()
    assert bpy.data.objects["Cube"].eulerfsi.solid.youngs_modulus == 12345.0
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    assert part("bake").status(bpy.context.scene).cache.frames == list(range(11, 17))
    assert bpy.data.objects["Smoke Bake"].data.frame_start == 11
    bpy.ops.wm.save_mainfile()
    moved = folder.with_name("kept_moved")
    shutil.rmtree(moved, ignore_errors=True)
    folder.rename(moved)
    bpy.ops.wm.open_mainfile(filepath=str(moved / "shot.blend"))
    scene, cube = bpy.context.scene, bpy.data.objects["Cube"]
    assert (cube.eulerfsi.role, cube.eulerfsi.solid.youngs_modulus) == ("SOLID", 12345.0)
    now = part("bake").status(scene)
    assert now.kind == "complete" and not part("bake").stale(scene, now), part("bake").stale(scene, now)
    cube = bpy.data.objects["Cube"]
    cube.eulerfsi.material_preset = "JELLY"
    assert sizes(cube) == shown, (sizes(cube), shown)
    cube.eulerfsi.solid.youngs_modulus = 12345.0
    assert np.abs(points_of("Cube Bake", 11) - points_of("Cube Bake", 16)).max() > 0.1, "the cache moved with its file"
    bpy.ops.wm.save_as_mainfile(filepath=str(moved / "other.blend"))
    assert part("bake").status(bpy.context.scene).kind == "ready", "the new file has its own place"
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    assert (moved / "shot_eulerfsi").is_dir() and (moved / "other_eulerfsi").is_dir()


def check_cancel_resume_rebake_free() -> None:
    scene, folder = jelly("steps", frames=300)
    scene.eulerfsi.checkpoint_every = 2
    bake = part("bake")
    work = bake.begin(scene, "NEW")
    until(lambda: bake.look_at(scene) and len(bake.status(scene).cache.frames) > 4)
    assert "Cube Bake" in bpy.data.objects, "frames appear while it runs"
    refused(bpy.ops.eulerfsi.bake, "runs already")
    assert bpy.ops.eulerfsi.cancel() == {"FINISHED"}
    now = bake.wait(scene, work)
    assert now.kind == "interrupted" and "Resume" in now.text, now
    done = now.cache.frames[-1]
    scene.frame_end = done + 3
    assert bpy.ops.eulerfsi.bake(mode="RESUME") == {"FINISHED"}
    assert bake.status(scene).cache.frames == list(range(1, done + 4))
    assert bpy.data.objects["Smoke Bake"].data.frame_duration == done + 3
    early = (folder / "shot_eulerfsi/Scene/cache/frames/scene.0002.usdc").read_bytes()
    late = points_of("Cube Bake", done + 3)
    scene.frame_set(4)
    start = bake.rebake_frame(scene, bake.status(scene).cache)
    assert start in (3, 4), start
    bpy.data.objects["Cube"].eulerfsi.solid.youngs_modulus *= 0.25
    bpy.data.objects["Domain"].eulerfsi.domain.fluid_density = 400.0
    assert bpy.ops.eulerfsi.bake(mode="REBAKE") == {"FINISHED"}
    assert (folder / "shot_eulerfsi/Scene/cache/frames/scene.0002.usdc").read_bytes() == early
    assert np.abs(points_of("Cube Bake", done + 3) - late).max() > 1e-3, "later frames are others"
    assert not bake.stale(scene, bake.status(scene))
    bpy.data.objects["Cube"].eulerfsi.material_preset = "CLAY"  # yields, which cannot begin in the middle
    refused(bpy.ops.eulerfsi.bake, "“Cube”", "must be those of the checkpoint: Bake Anew", mode="REBAKE")
    assert bpy.ops.eulerfsi.free() == {"FINISHED"}
    assert not (folder / "shot_eulerfsi").exists() and bake.status(scene).kind == "ready"
    cube = bpy.data.objects["Cube"]
    assert "Cube Bake" not in bpy.data.objects and not cube.hide_viewport and not cube.hide_render
    assert not bpy.data.cache_files and not bpy.data.volumes


def check_cache_root_and_size() -> None:
    """The preferences' folder takes the bakes of all files, but not of two in one place; 16-bit floats are smaller."""
    scene, folder = jelly("rooted")
    root = folder.with_name("root")
    shutil.rmtree(root, ignore_errors=True)
    bpy.context.preferences.addons[MODULE].preferences.root = str(root)
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    frames = root / "shot_eulerfsi" / "Scene" / "cache"
    small = sum(file.stat().st_size for file in frames.rglob("*.vdb"))
    assert small and not (folder / "shot_eulerfsi").exists()
    scene.eulerfsi.half = False
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    large = sum(file.stat().st_size for file in frames.rglob("*.vdb"))
    assert small < large, (small, large)  # of 648 cells most is the header
    jelly("rooted_too")  # a file of the same name; preferences are those of the factory
    bpy.context.preferences.addons[MODULE].preferences.root = str(root)
    refused(bpy.ops.eulerfsi.bake, "the bake of scene “Scene”", "choose another")
    bpy.context.preferences.addons[MODULE].preferences.root = ""
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}


def check_roles() -> None:
    """All roles at once, in centimetres, with names that USD has not: the solver takes them, and pins hold."""
    scene, folder = jelly("roles", voxel=0.004)
    scene.unit_settings.scale_length = 0.01
    cube, domain = bpy.data.objects["Cube"], bpy.data.objects["Domain"]
    domain.eulerfsi.domain.voxel_size = 0.004
    cube.eulerfsi.material_preset = "JELLY"  # of 2 cm
    cube.name = "Ünder wäter.001 jelly"
    group = cube.vertex_groups.new(name="Top")
    group.add([v.index for v in cube.data.vertices if v.co.z > 0], 1.0, "REPLACE")
    cube.eulerfsi.pin_group = "Top"
    bpy.ops.object.empty_add(location=(0, 0, 1))
    hand = bpy.context.object
    hand.name = "Hand"
    cube.eulerfsi.pin_to = hand
    for frame, x in ((1, 0.0), (6, 0.5)):
        hand.location.x = x
        hand.keyframe_insert("location", frame=frame)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.2, location=(0, 0, -1.02), segments=12, ring_count=8)
    bpy.context.object.eulerfsi.role, bpy.context.object.eulerfsi.carrier = "PASSENGER", cube
    bpy.context.object.name = "Drop"
    bpy.ops.mesh.primitive_plane_add(size=4, location=(0, 0, -1.6))
    bpy.context.object.eulerfsi.role = "COLLIDER"
    bpy.ops.object.empty_add(type="SPHERE", radius=1.5)
    wind = bpy.context.object
    wind.eulerfsi.role, wind.eulerfsi.force.kind = "FORCE", "wind"
    wind.eulerfsi.force.wind_velocity = (0.05, 0.0, 0.0)
    smoke = bpy.data.objects["Smoke Layer"]
    smoke.eulerfsi.emitter.mode = "continuous"
    for frame, on in ((1, True), (4, False)):
        smoke.eulerfsi.emitter.enabled = on
        smoke.keyframe_insert("eulerfsi.emitter.enabled", frame=frame)
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    export = json.loads((part("bake").folder_of(scene) / "export" / "scene.json").read_text())
    values = {entry["object"]: entry["values"] for entry in export["prims"]}
    keys = {"1": True, "2": True, "3": True, "4": False}  # nothing after the last change
    assert values["Smoke Layer"]["emitter"]["enabled"] == keys, values["Smoke Layer"]
    assert values["Domain"]["domain"]["voxelSize"] == 0.004 and values[cube.name]["solid"]["youngsModulus"] == 2000.0
    name = f"{cube.name} Bake"
    top = np.abs(points_of(name, 1)[:, 2] - 1.0) < 1e-4
    moved = points_of(name, 6)[top] - points_of(name, 1)[top]
    assert top.sum() >= 4 and np.abs(moved - [0.5, 0, 0]).max() < 0.01, moved
    drop = points_of("Drop Bake", 6) - points_of("Drop Bake", 1)
    assert np.abs(drop).max() > 0.01, "a passenger follows"
    cube.name = "Renamed"
    assert part("bake").status(scene).kind == "complete" and not part("bake").stale(scene, part("bake").status(scene))
    scene.frame_end = 8
    assert bpy.ops.eulerfsi.bake(mode="RESUME") == {"FINISHED"}


def check_table() -> None:
    """Every row of the table is a property with the table's default and limits; presets name rows."""
    scene, _ = fresh("table")
    table, presets = part("table"), part("presets")
    count = 0
    for scope in table.SCOPES:
        group = getattr(bpy.data.objects["Cube"].eulerfsi, scope)
        for name, row in table.rows(scope).items():
            value, rna = table.plain(part("scene_export")._get(group, name)), group.bl_rna.properties[name]
            assert value == row["default"], (scope, name, value)
            if row["type"] == "double" and row["hard"][1] is not None:
                assert abs(rna.hard_max - row["hard"][1]) < 1e-6 * abs(row["hard"][1]) + 1e-9, name
            if row["type"] == "token":
                assert [item.identifier for item in rna.enum_items] == row["tokens"]
            assert rna.is_animatable == bool(row.get("animated")), name
            count += 1
    assert count > 60, count
    pick("Cube")
    cube = bpy.data.objects["Cube"]
    for name, preset in presets.PRESETS.items():
        assert set(preset.values) <= set(table.rows("solid")), name
        cube.eulerfsi.material_preset = name
        assert abs(cube.eulerfsi.solid.density - preset.values["density"]) < 1e-3
        wanted = preset.values["youngs_modulus"] * 2.0 / presets.SIZE
        assert abs(cube.eulerfsi.solid.youngs_modulus / wanted - 1) < 0.01


def check_host_keeps_its_pxr() -> None:
    fresh("pxr")
    solver = str(part("job").SOLVER)
    assert not any(place.startswith(solver) for place in sys.path)
    assert "pxr" not in sys.modules and "eulerfsi" not in sys.modules


def picture() -> None:
    """That of docs/blender.md, by its own steps: `run.py picture` writes it to EULERFSI_PICTURE."""
    scene, folder = fresh("picture")
    cube = bpy.data.objects["Cube"]
    cube.location.z = 1.5
    bpy.data.objects["Light"].data.energy = 4000.0
    cube.rotation_euler = (math.radians(35), math.radians(20), 0.0)
    colors = cube.data.materials[0].node_tree.nodes["Principled BSDF"].inputs
    colors["Base Color"].default_value, colors["Roughness"].default_value = (0.8, 0.06, 0.04, 1.0), 0.25
    bpy.context.view_layer.update()
    pick("Cube")
    bpy.ops.eulerfsi.quick()
    scene.frame_end, scene.eulerfsi.threads = 21, 1
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    scene.cycles.use_denoising = True
    render(Path(os.environ.get("EULERFSI_PICTURE", folder / "picture.png")), 20, width=480)


if __name__ == "__main__":
    found = {name: check for name, check in globals().items() if name.startswith("check_")}
    sys.exit(run(found | ({"picture": picture} if "picture" in sys.argv[2:] else {})))
