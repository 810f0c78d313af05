# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes wrong: a message that names object and field, the host lives, finished frames stay."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys

import bpy
from harness import MODULE, fresh, jelly, part, pick, refused, run, until


def findings() -> str:
    scene, bake = bpy.context.scene, part("bake")
    return "\n".join(f"{f.level} {f.object}|{f.field}|{f.text}" for f in bake.findings(scene, bake.status(scene)))


def check_unsaved_file() -> None:
    import addon_utils

    bpy.ops.wm.read_homefile(use_factory_startup=True)
    addon_utils.enable(MODULE, default_set=True)
    pick("Cube")
    bpy.ops.eulerfsi.quick()
    refused(bpy.ops.eulerfsi.bake, "save the .blend file first")
    refused(bpy.ops.eulerfsi.validate, "save the .blend file first")


def check_scene_faults() -> None:
    """What the host sees by itself."""
    scene, _ = fresh("faults")
    refused(bpy.ops.eulerfsi.bake, "there is no domain", "nothing moves")
    pick("Cube")
    bpy.ops.eulerfsi.quick()
    refused(bpy.ops.eulerfsi.quick, "has a domain already")
    bpy.data.objects["Light"].eulerfsi.role = "DOMAIN"
    refused(bpy.ops.eulerfsi.bake, "Light: two domains: “Domain”, “Light”", "must be a mesh or an empty, not a light")
    bpy.data.objects["Light"].eulerfsi.role = "NONE"
    bpy.data.objects["Camera"].eulerfsi.role = "SOLID"
    refused(bpy.ops.eulerfsi.bake, "Camera: a solid must be a mesh, not a camera")
    bpy.data.objects["Camera"].eulerfsi.role = "NONE"
    bpy.data.objects["Cube"].eulerfsi.pin_group = "Gone"
    refused(bpy.ops.eulerfsi.bake, "Cube: Pin Group “Gone”: there is no such vertex group")
    bpy.data.objects["Cube"].eulerfsi.pin_group = ""
    bpy.ops.mesh.primitive_cube_add(size=0.5)
    bpy.context.object.eulerfsi.role = "PIN"
    refused(bpy.ops.eulerfsi.bake, "Belongs To must name a solid")
    bpy.context.object.eulerfsi.role = "SOLID"
    bpy.context.object.name = "Empty mesh"
    bpy.context.object.data.clear_geometry()
    refused(bpy.ops.eulerfsi.bake, "Empty mesh: its mesh has no faces")
    bpy.context.object.eulerfsi.role = "NONE"
    scene.frame_start, scene.frame_end = 5, 5
    refused(bpy.ops.eulerfsi.bake, "the end frame 5 must be after the start frame 5")


def check_collider_of_changing_faces() -> None:
    jelly("changing")
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0, 0, -1.5))
    obj = bpy.context.object
    obj.name, obj.eulerfsi.role = "Wall 2", "COLLIDER"
    modifier = obj.modifiers.new("Build", "BUILD")
    modifier.frame_start, modifier.frame_duration = 3, 3
    refused(bpy.ops.eulerfsi.bake, "Wall 2: its mesh has", "faces")


def check_solver_names_objects() -> None:
    """An open mesh, two solids in each other, one outside: in Blender's names."""
    jelly("open")
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0.9, 0, 0.9), segments=16, ring_count=8)
    ball = bpy.context.object
    ball.name, ball.eulerfsi.role = "Bällchen 1.001", "SOLID"
    refused(bpy.ops.eulerfsi.validate, "“Bällchen 1.001”", "“Cube”", "overlap")
    ball.location = (1.6, 0, 0)
    for face in list(ball.data.polygons)[:1]:
        face.select = True
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    ball.data.polygons[20].select = True
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.delete(type="FACE")
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.eulerfsi.validate()
    assert "warning Bällchen 1.001|" in findings() and "open" in findings(), findings()
    assert "/World/" not in findings(), findings()
    assert bpy.ops.eulerfsi.select(name="Bällchen 1.001") == {"FINISHED"} and bpy.context.object == ball
    ball.location = (40, 0, 0)
    refused(bpy.ops.eulerfsi.bake, "Failed", "“Bällchen 1.001”")
    assert "error Bällchen 1.001|" in findings(), findings()


def check_foam_without_room() -> None:
    """The warning names settings as the panels do; with the wall open there is none."""
    jelly("foam")
    bpy.data.objects["Cube"].eulerfsi.material_preset = "FOAM"
    domain = bpy.data.objects["Domain"].eulerfsi.domain
    bpy.ops.eulerfsi.validate()
    names = [domain.bl_rna.properties[name].name for name in ("wall_z_max", "ambient_fluid")]
    assert all(name in findings() for name in names) and "Compressible should be off" in findings(), findings()
    assert "wallY" not in findings() and "ambientFluid" not in findings(), findings()
    domain.wall_z_max = "open"
    bpy.ops.eulerfsi.validate()
    assert "warning" not in findings(), findings()


def check_refused_bake_leaves_the_settings_of_the_last() -> None:
    """The frames that are there are still those of the values that made them; the panel says which have changed."""
    scene, _ = jelly("kept")
    bake, cube = part("bake"), bpy.data.objects["Cube"]
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    assert not bake.stale(scene, bake.status(scene))
    cube.location.x += 40  # leaves the domain
    changed = bake.stale(scene, bake.status(scene))
    refused(bpy.ops.eulerfsi.bake, "“Cube”", mode="NEW")
    now = bake.status(scene)
    assert now.kind == "failed" and len(now.cache.frames) == 6, now
    assert changed and bake.stale(scene, now) == changed, (changed, bake.stale(scene, now))
    cube.location.x -= 40
    assert not bake.stale(scene, bake.status(scene))


def check_missing_or_other_solver() -> None:
    scene, _ = jelly("solver")
    place = part("job").SOLVER
    hidden = place.with_name("solver_away")
    place.rename(hidden)
    try:
        refused(bpy.ops.eulerfsi.bake, "the solver is missing", str(place))
    finally:
        hidden.rename(place)
    work = part("job").start(part("bake").folder_of(scene), "9.9.9", ["info"], "unused.usdc")
    assert work.wait() == 2
    assert "the extension 9.9.9" in work.told.findings[0]["message"], work.told.findings


def check_read_only_disk() -> None:
    scene, folder = jelly("read_only")
    scene.eulerfsi.folder = "/proc/eulerfsi"
    refused(bpy.ops.eulerfsi.bake, "/proc/eulerfsi")
    (folder / "in the way").write_text("a file")
    scene.eulerfsi.folder = str(folder / "in the way" / "cache")
    refused(bpy.ops.eulerfsi.bake, "in the way")


def check_full_disk() -> None:
    scene, folder = jelly("full", frames=400)
    small = folder / "small disk"
    small.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", small], capture_output=True).returncode:
        print("not run: no right to mount a file system")
        return
    try:
        scene.eulerfsi.folder = str(small)
        told = refused(bpy.ops.eulerfsi.bake, "are free: make room")
        assert "Half Floats" in told and "--" not in told + findings(), (told, findings())
        now = part("bake").status(scene)
        assert now.kind == "failed" and not now.cache.frames, now
    finally:
        subprocess.run(["umount", "--lazy", small], check=True)  # Blender may have a file open


def check_killed_solver() -> None:
    scene, _ = jelly("killed", frames=300)
    bake = part("bake")
    work = bake.begin(scene, "NEW")
    until(lambda: len(bake.status(scene).cache.frames) > 2)
    os.kill(work.process.pid, signal.SIGKILL)
    now = bake.wait(scene, work)
    assert now.kind == "stopped" and "killed" in now.text and len(now.cache.frames) > 2, now
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    scene = bpy.context.scene
    now = bake.status(scene)
    assert now.kind == "stopped" and "Resume" in now.text, "nothing says running"
    kept = now.cache.frames[-1]
    scene.frame_end = kept + 1
    assert bpy.ops.eulerfsi.bake(mode="RESUME") == {"FINISHED"}
    assert bake.status(scene).cache.frames == list(range(1, kept + 2))


def check_bake_outlives_blender() -> None:
    """A bake that another Blender has started is followed and stopped by what is on disk."""
    scene, _ = jelly("outlives", frames=300)
    bake = part("bake")
    work = bake.begin(scene, "NEW")
    until(lambda: len(bake.status(scene).cache.frames) > 1)
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)  # forgets the process
    scene = bpy.context.scene
    now = bake.status(scene)
    assert now.kind == "running" and now.job.process is None and "left" in now.text, now
    assert bpy.ops.eulerfsi.cancel() == {"FINISHED"}
    work.process.wait(60)
    assert bake.status(scene).kind == "interrupted"


def check_run_outside_blender() -> None:
    """Exit codes 5 (another run holds the cache) and 75 (its time is up), as a farm gives them."""
    scene, _ = jelly("outside", frames=40)
    bake, job = part("bake"), part("job")
    folder = bake.folder_of(scene)
    work = bake.begin(scene, "NEW")
    until(lambda: len(bake.status(scene).cache.frames) > 2)
    work.stop()
    assert bake.wait(scene, work).kind == "interrupted"
    solver = ["simulate", str(folder / "scene.usdc"), "-o", str(folder / "cache"), "--progress", "json", "--resume"]
    with open(folder / "cache" / ".lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        lock.write("process 1 on elsewhere\n")
        lock.flush()
        now = bake.status(scene)
        assert now.kind == "running" and "outside Blender (process 1 on elsewhere)" in now.text, now
        refused(bpy.ops.eulerfsi.bake, "process 1 on elsewhere", mode="RESUME")
        refused(bpy.ops.eulerfsi.free, "a bake writes to it")
        refused(bpy.ops.eulerfsi.cancel, "another machine")
        work = job.start(folder, part("preferences").version(), solver, str(folder / "scene.usdc"))
        assert work.wait() == 5, work.told.end
        assert "process 1 on elsewhere is writing to this cache" in work.told.findings[0]["message"]
    kept = len(bake.status(scene).cache.frames)
    assert kept > 2
    work = job.start(
        folder, part("preferences").version(), [*solver, "--max-wall-seconds", "0.2"], str(folder / "scene.usdc")
    )
    assert work.wait() == 75, work.told.end
    bake._jobs[str(folder)] = work
    now = bake.status(scene)
    assert now.kind == "interrupted" and "Resume continues" in now.text and len(now.cache.frames) >= kept, now
    scene.frame_end = now.cache.frames[-1] + 1
    assert bpy.ops.eulerfsi.bake(mode="RESUME") == {"FINISHED"}


def check_other_scenes_cache() -> None:
    scene, folder = jelly("mine")
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    cache = part("bake").folder_of(scene)
    jelly("other")
    scene = bpy.context.scene
    scene.eulerfsi.folder = str(cache)
    for operator in (bpy.ops.eulerfsi.bake, bpy.ops.eulerfsi.load, bpy.ops.eulerfsi.free):
        refused(operator, "the bake of scene “Scene”", "shot.blend")
    part("bake").look_at(scene)
    assert "Cube Bake" not in bpy.data.objects and (cache / "cache" / "manifest.json").exists()
    scene.eulerfsi.folder = str(folder)  # a folder of other things
    (folder / "cache").mkdir()
    (folder / "cache" / "precious.txt").write_text("keep me")
    refused(bpy.ops.eulerfsi.bake, "holds other files (precious.txt)")
    refused(bpy.ops.eulerfsi.free, "holds other files (precious.txt)")
    assert (folder / "cache" / "precious.txt").read_text() == "keep me"


def check_damaged_cache() -> None:
    scene, _ = jelly("damaged")
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    manifest = part("bake").folder_of(scene) / "cache" / "manifest.json"
    manifest.write_text("{")
    now = part("bake").status(scene)
    assert now.kind == "damaged" and "manifest.json" in now.text
    refused(bpy.ops.eulerfsi.load, "there is no frame to show")
    assert "Resume goes on" in now.text
    assert bpy.ops.eulerfsi.bake(mode="RESUME") == {"FINISHED"} and part("bake").status(scene).kind == "complete"
    manifest.write_text("{")
    manifest.with_name("manifest.backup.json").unlink()
    assert "Free it" in part("bake").status(scene).text
    assert bpy.ops.eulerfsi.free() == {"FINISHED"} and not manifest.exists()


def check_memory_is_that_of_the_library() -> None:
    """The estimate in the panel against what the solver tells at its start."""
    for name, fluid in (("fluid", True), ("vacuum", False)):
        scene, _ = jelly(f"memory_{name}", voxel=0.2)
        domain = bpy.data.objects["Domain"]
        domain.eulerfsi.domain.ambient_fluid = fluid
        if not fluid:
            bpy.data.objects["Smoke Layer"].eulerfsi.role = "NONE"
        bpy.ops.eulerfsi.validate()
        text = next(f.message for f in part("bake").findings(scene, part("bake").status(scene)) if f.level == "info")
        size = part("scene_export").world_size(scene, domain)
        boxes = [list(bpy.data.objects["Cube"].dimensions)]
        estimate = part("estimate")
        assert f"{estimate.cells(size, 0.2):,} cells" in text, text
        told, ours = float(text.split(", ")[1].split()[0]), estimate.memory(size, 0.2, boxes, fluid) / 1e6
        assert abs(told / ours - 1) < 0.02, (told, ours)


def check_owner_without_identity() -> None:
    """A file that is closed unsaved after its first bake finds it again."""
    scene, _ = jelly("unsaved_bake")
    bpy.ops.wm.save_mainfile()
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    scene = bpy.context.scene
    assert not scene.eulerfsi.uid and part("bake").status(scene).kind == "complete"
    assert bpy.ops.eulerfsi.bake(mode="NEW") == {"FINISHED"}
    owner = json.loads((part("bake").folder_of(scene) / "owner.json").read_text())
    assert owner["uid"] == scene.eulerfsi.uid


if __name__ == "__main__":
    sys.exit(run({name: check for name, check in globals().items() if name.startswith("check_")}))
