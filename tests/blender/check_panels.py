# SPDX-License-Identifier: GPL-3.0-or-later
"""Every panel is drawn in every state by a layout that knows what Blender takes."""

from __future__ import annotations

import sys
import types

import bpy
from harness import fresh, jelly, part, pick, refused, run, until
from layout import DrawError, Layout


def draw() -> Layout:
    """All panels as the current scene has them; what was drawn."""
    drawn = Layout()
    for cls in part("panels").CLASSES:
        parent = next((c for c in part("panels").CLASSES if c.bl_idname == getattr(cls, "bl_parent_id", "")), None)
        if all(c.poll(bpy.context) for c in (cls, parent) if c and hasattr(c, "poll")):
            own = types.SimpleNamespace(layout=Layout(drawn), _buttons=getattr(cls, "_buttons", None))
            own._solid = getattr(cls, "_solid", None)
            cls.draw(own, bpy.context)
    return drawn


def greyed(drawn: Layout) -> list[str]:
    """Texts of buttons that cannot be pressed."""
    return [arguments.get("text", "") for name, arguments in drawn.greyed if name == "operator"]


def check_layout_finds_faults() -> None:
    fresh("layout")
    scene = bpy.context.scene
    for wrong in (
        lambda layout: layout.label(text="x", icon="NO_SUCH_ICON"),
        lambda layout: layout.prop(scene, "no_such_property"),
        lambda layout: layout.operator("eulerfsi.no_such_operator"),
        lambda layout: layout.lable(text="x"),
        lambda layout: layout.label(txt="x"),
        lambda layout: setattr(layout.operator("eulerfsi.bake"), "mode", "OLD"),
        lambda layout: setattr(layout, "use_property_splits", True),
        lambda layout: layout.prop(scene),
    ):
        try:
            wrong(Layout())
        except DrawError:
            continue
        raise AssertionError("a wrong call was taken")


def check_no_domain() -> None:
    fresh("no_domain")
    drawn = draw()
    assert {"eulerfsi.quick", "eulerfsi.add_domain"} <= set(drawn.operators), drawn.operators
    assert "eulerfsi.bake" not in drawn.operators


def check_ready_and_roles() -> None:
    jelly("ready")
    drawn = draw()
    assert "Ready to bake" in drawn.texts and "cells" in drawn.texts and "memory" in drawn.texts, drawn.texts
    before = drawn.texts
    bpy.data.objects["Domain"].eulerfsi.domain.voxel_size = 0.25
    assert "4,860 cells" in draw().texts and "648 cells" in before, (before, draw().texts)
    shown: dict[str, set[str]] = {}
    for role in ("NONE", "SOLID", "COLLIDER", "EMITTER", "FORCE", "PIN", "PASSENGER"):
        pick("Cube")
        bpy.data.objects["Cube"].eulerfsi.role = role
        shown[role] = {str(a["property"]) for name, a in draw().calls if name == "prop"}
    table = part("table")
    for role, scope in part("properties").SCOPE_OF.items():
        rows = {name for name, row in table.rows(scope).items() if not table.is_advanced(row)}
        assert role == "DOMAIN" or rows <= shown[role], role
    assert set(table.rows("domain")) <= shown["NONE"]
    settings = bpy.data.objects["Domain"].eulerfsi.domain
    assert "step_tolerance_by_name" in shown["NONE"] and settings.step_tolerance_by_name == "DEFAULT"
    settings.step_tolerance_by_name = "FINE"
    assert table.plain(settings.step_tolerance) == 0.05 and settings.step_tolerance_by_name == "FINE"
    settings.step_tolerance = 0.2
    settings.step_tolerance_by_name = "CUSTOM"
    assert table.plain(settings.step_tolerance) == 0.2 and settings.step_tolerance_by_name == "CUSTOM"
    for mode in ("NEW", "RESUME", "REBAKE"):
        button = types.SimpleNamespace(mode=mode)
        assert part("operators").EULERFSI_OT_bake.description(bpy.context, button)
    bpy.data.objects["Cube"].eulerfsi.role = "SOLID"
    bpy.data.objects["Cube"].vertex_groups.new(name="Top")
    bpy.data.objects["Cube"].eulerfsi.pin_group = "Top"
    assert "pin_to" in {str(a["property"]) for name, a in draw().calls if name == "prop"}


def check_messages_name_what_is_shown() -> None:
    """Where messages of the solver advise options, the artist reads of settings that the panels draw."""
    jelly("words")
    drawn = draw()
    labels = {str(a["data"].bl_rna.properties[a["property"]].name) for name, a in drawn.calls if name == "prop"}
    assert {"Cache", "Half Floats", "Smoke Threshold", "Checkpoint Every", "Keep All Checkpoints"} <= labels, labels
    scene, event = bpy.context.scene, {"level": "error", "message": "no room: choose another folder with -o"}
    assert part("bake").to_finding(scene, event).message == "no room: choose another folder in Cache"


def check_thinnest_part() -> None:
    """Of a cube with a fin the fin, of a tilted cube its edge; it follows the voxel size, the scale and the mesh."""
    jelly("thin", voxel=0.1)
    cube = bpy.data.objects["Cube"]
    cube.rotation_euler.x = 0.6
    cube.modifiers.clear()
    bpy.context.view_layer.update()
    assert "thinnest part: 20.0 cells (Cube)" in draw().texts, draw().texts
    bpy.data.objects["Domain"].eulerfsi.domain.voxel_size = 0.2
    assert "thinnest part: 10.0 cells (Cube)" in draw().texts, draw().texts
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 0.0, 2.0), scale=(0.15, 1.0, 0.5))
    pick("Cube", bpy.context.object.name)
    bpy.ops.object.join()
    bpy.context.view_layer.update()
    assert "thinnest part: 1.5 cells (Cube): too few" in draw().texts, draw().texts


def check_unsaved() -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    import addon_utils

    addon_utils.enable("bl_ext.user_default.eulerfsi", default_set=True)
    pick("Cube")
    bpy.ops.eulerfsi.quick()
    assert "Save the file first" in draw().texts


def check_baking_done_failed() -> None:
    scene, _ = jelly("baking", frames=200)
    scene.eulerfsi.checkpoint_every = 2
    bake = part("bake")
    work = bake.begin(scene, "NEW")
    assert "eulerfsi.cancel" in draw().operators  # preparing
    until(lambda: bake.status(scene).kind == "running" and len(bake.status(scene).cache.frames) > 3)
    drawn = draw()
    assert "left" in drawn.texts and "%" in drawn.texts, drawn.texts
    assert "eulerfsi.cancel" in drawn.operators and "eulerfsi.free" not in drawn.operators
    assert bpy.ops.eulerfsi.cancel() == {"FINISHED"}
    now = bake.wait(scene, work)
    assert not bake.findings(scene, now), "what the artist has asked for is no message"
    scene.frame_set(9)
    drawn = draw()
    assert "Resume" in drawn.texts and "Bake from Frame" in drawn.texts and not greyed(drawn), drawn.texts
    found = bake.status(scene).cache
    gap = next(frame for frame in range(4, 99) if frame not in found.checkpoints)
    scene.frame_set(gap)
    kept, shown = max(frame for frame in found.checkpoints if frame < gap), draw().texts
    assert f"Bake from Frame {kept + 1}" in shown and f"Frames up to {kept} stay" in shown, (shown, found.checkpoints)
    scene.frame_set(kept)
    assert f"Bake from Frame {kept + 1}" in draw().texts and "stay: " not in draw().texts, draw().texts
    scene.frame_set(1)  # nothing before it could stay
    drawn = draw()
    assert greyed(drawn) == ["Bake from Here"] and "go to one after 1" in drawn.texts, drawn.texts
    refused(bpy.ops.eulerfsi.bake, "go to one after 1", mode="REBAKE")
    scene.frame_end = bake.status(scene).cache.frames[-1] + 2
    assert bpy.ops.eulerfsi.bake(mode="RESUME") == {"FINISHED"}
    drawn = draw()
    assert "Done" in drawn.texts and "eulerfsi.load" in drawn.operators, drawn.texts
    pick("Cube Bake")
    drawn = draw()
    assert "material_preset" in {str(a["property"]) for name, a in drawn.calls if name == "prop"}, "those of the Cube"
    bpy.data.objects["Cube"].eulerfsi.solid.youngs_modulus = 7000.0
    assert "Changed since the bake: Cube: Youngs Modulus" in draw().texts, draw().texts
    assert "Resume" not in draw().texts, "all frames are there"
    told = refused(bpy.ops.eulerfsi.bake, "Set the value back", "Bake from Frame", "Bake Anew", mode="RESUME")
    drawn = draw()
    assert "Changed since the bake: Cube: Youngs Modulus" in drawn.texts, (told, drawn.texts)
    assert not [a for name, a in drawn.calls if name == "operator" and a.get("text") == "Resume"], drawn.texts
    scene.frame_end += 1
    assert [a for name, a in draw().calls if name == "operator" and a.get("text") == "Resume"], draw().texts
    bpy.data.objects["Cube"].location.z = 40.0
    bpy.context.view_layer.update()
    refused(bpy.ops.eulerfsi.bake, "Failed", "“Cube”")
    drawn = draw()
    assert "Failed" in drawn.texts and "eulerfsi.free" in drawn.operators, drawn.texts


if __name__ == "__main__":
    sys.exit(run({name: check for name, check in globals().items() if name.startswith("check_")}))
