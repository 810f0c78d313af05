# SPDX-License-Identifier: GPL-3.0-or-later
"""The tab "Euler FSI" of the 3D view's sidebar."""

from __future__ import annotations

from typing import Any

import bpy

from . import bake, estimate, job, load, place, presets, properties, scene_export, table, thickness

_WALLS = "wall_"
_ICONS = {
    "NONE": "X",
    "DOMAIN": "CUBE",
    "SOLID": "MOD_SOFT",
    "COLLIDER": "MOD_PHYSICS",
    "EMITTER": "MOD_FLUIDSIM",
    "FORCE": "FORCE_WIND",
    "PIN": "PINNED",
    "PASSENGER": "LINKED",
}
_SIGNS = {"error": "ERROR", "warning": "INFO", "info": "CHECKMARK"}
_MOST = 12  # messages that are shown
_FEW_CELLS = 4  # of a part that bends
_MARGIN, _LETTER = 70, 6.0  # pixels of a line that no text has (frame, icon, tabs), of a letter in the mean; at scale 1
_NARROW, _UNSEEN = 16, 40  # characters of the shortest line, and of one without a window


class _Panel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Euler FSI"


def _width() -> int:
    """Characters of a line in the sidebar, which is as wide as the artist has made it."""
    region = bpy.context.region
    if region is None:
        return _UNSEEN
    return max(_NARROW, int((region.width / bpy.context.preferences.system.ui_scale - _MARGIN) / _LETTER))


def _lines(layout: bpy.types.UILayout, text: str, icon: str = "NONE") -> None:
    """A text over several lines: Blender cuts labels off."""
    words, line, lines, width = text.split(), "", [], _width()
    for word in words:
        if line and len(line) + 1 + len(word) > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    column = layout.column(align=True)
    for number, part in enumerate([*lines, line]):
        column.label(text=part, icon=icon if number == 0 else "BLANK1" if icon != "NONE" else "NONE")


def _domain(scene: bpy.types.Scene) -> bpy.types.Object | None:
    found = scene_export.members(scene, "DOMAIN")
    return found[0] if found else None


def _rebake(layout: bpy.types.UILayout, scene: bpy.types.Scene, now: bake.Status) -> None:
    """Names the first frame that is made anew; greyed out where there is none, with the reason below."""
    why, kept = bake.why_no_rebake(scene, now.cache), bake.rebake_frame(scene, now.cache)
    name = "Bake from Here" if why else f"Bake from Frame {kept + 1}"
    row = layout.row()
    row.enabled = not why
    row.operator("eulerfsi.bake", text=name, icon="RECOVER_LAST").mode = "REBAKE"
    if why:
        _lines(layout, why)
    elif kept < scene.frame_current:
        _lines(layout, f"Frames up to {kept} stay: the last checkpoint before frame {scene.frame_current}")


def _row(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, name: str, row: dict[str, Any]) -> None:
    """A row of the table; a number whose values have names below the menu of them."""
    if "names" in row:
        column = layout.column(align=True)
        column.prop(settings, table.named(name))
        column.prop(settings, name, text="Value")
    else:
        layout.prop(settings, name)


class EULERFSI_PT_bake(_Panel, bpy.types.Panel):
    bl_idname = "EULERFSI_PT_bake"
    bl_label = "Bake"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        now = bake.status(scene)
        if now.kind == "no_domain":
            _lines(layout, "Select meshes, then make them soft in a box with smoke:")
            layout.operator("eulerfsi.quick", icon="MOD_SOFT")
            layout.operator("eulerfsi.add_domain", icon="CUBE")
            return
        signs = {"complete": "CHECKMARK", "failed": "ERROR", "foreign": "ERROR", "unsaved": "ERROR", "damaged": "ERROR"}
        if now.kind in job.RUNNING:
            layout.progress(factor=now.job.told.percent / 100, text=now.text)
            layout.operator("eulerfsi.cancel", icon="CANCEL")
        else:
            _lines(layout, now.text, signs.get(now.kind, "INFO"))
            self._buttons(layout, scene, now)
        if changes := bake.stale(scene, now):
            _lines(layout, "Changed since the bake: " + "; ".join(changes[:4]), "FILE_REFRESH")
        column = layout.column()
        column.enabled = now.kind not in job.RUNNING
        column.prop(scene.eulerfsi, "folder")
        if not scene.eulerfsi.folder and now.folder:
            _lines(column, str(now.folder), "FILE_FOLDER")
        row = column.row(align=True)
        row.prop(scene, "frame_start", text="Start")
        row.prop(scene, "frame_end", text="End")

    @staticmethod
    def _buttons(layout: bpy.types.UILayout, scene: bpy.types.Scene, now: bake.Status) -> None:
        frames = now.cache.frames
        row = layout.row(align=True)
        row.enabled = now.kind not in ("unsaved", "foreign")
        row.scale_y = 1.4
        row.operator("eulerfsi.bake", text="Bake Anew" if frames else "Bake", icon="RENDER_ANIMATION").mode = "NEW"
        if bake.can_resume(scene, now):
            row.operator("eulerfsi.bake", text="Resume", icon="PLAY").mode = "RESUME"
        if frames:
            _rebake(layout, scene, now)
        row = layout.row(align=True)
        row.operator("eulerfsi.validate", icon="CHECKMARK")
        if frames:
            row.operator("eulerfsi.load", icon="IMPORT")
        if frames or now.kind in ("damaged", "failed"):
            row.operator("eulerfsi.free", icon="TRASH")


class EULERFSI_PT_messages(_Panel, bpy.types.Panel):
    bl_idname = "EULERFSI_PT_messages"
    bl_label = "Messages"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(bake.findings(context.scene, bake.status(context.scene)))

    def draw(self, context: bpy.types.Context) -> None:
        found = bake.findings(context.scene, bake.status(context.scene))
        found.sort(key=lambda f: list(_SIGNS).index(f.level))
        for finding in found[:_MOST]:
            box = self.layout.box()
            _lines(box, finding.text, _SIGNS[finding.level])
            if finding.object in context.scene.objects:
                box.operator("eulerfsi.select", text=finding.object, icon="RESTRICT_SELECT_OFF").name = finding.object
        if len(found) > _MOST:
            self.layout.label(text=f"and {len(found) - _MOST} more")


class EULERFSI_PT_object(_Panel, bpy.types.Panel):
    bl_idname = "EULERFSI_PT_object"
    bl_label = "Object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, load.original(context.scene, context.object)
        layout.use_property_split = True
        settings = obj.eulerfsi
        layout.label(text=obj.name, icon=_ICONS[settings.role])
        layout.prop(settings, "role")
        for finding in bake.findings(context.scene, bake.status(context.scene)):
            if finding.object == obj.name and finding.level == "error":
                _lines(layout, finding.message, "ERROR")
        if settings.role == "SOLID":
            self._solid(layout, obj)
        elif settings.role in ("PIN", "PASSENGER"):
            layout.prop(settings, "carrier")
        elif settings.role == "FORCE" and obj.type != "EMPTY":
            layout.prop(settings, "shape")
        scope = properties.SCOPE_OF.get(settings.role)
        if scope and scope != "domain":
            group = getattr(settings, scope)
            column = layout.column()
            for name, row in table.rows(scope).items():
                if not table.is_advanced(row):
                    _row(column, group, name, row)

    @staticmethod
    def _solid(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
        settings = obj.eulerfsi
        layout.prop(settings, "material_preset")
        if settings.material_preset in presets.PRESETS:
            _lines(layout, presets.PRESETS[settings.material_preset].behaves, "INFO")
        if obj.type == "MESH":
            layout.prop_search(settings, "pin_group", obj, "vertex_groups")
            if settings.pin_group:
                layout.prop(settings, "pin_to")


class EULERFSI_PT_domain(_Panel, bpy.types.Panel):
    bl_idname = "EULERFSI_PT_domain"
    bl_label = "Domain"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _domain(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, domain = self.layout, _domain(context.scene)
        layout.use_property_split = True
        settings = domain.eulerfsi.domain
        layout.prop(settings, "voxel_size")
        for line in counts(context.scene, domain):
            _lines(layout, line)
        for name, row in table.rows("domain").items():
            if not name.startswith(_WALLS) and name != "voxel_size" and not table.is_advanced(row):
                _row(layout, settings, name, row)
        layout.operator("eulerfsi.add_smoke", icon="MOD_FLUIDSIM")


def counts(scene: bpy.types.Scene, domain: bpy.types.Object) -> list[str]:
    """Cells, memory, disk, thinnest feature: they follow the voxel size while it is dragged."""
    settings, size = domain.eulerfsi.domain, scene_export.world_size(scene, domain)
    voxel = settings.voxel_size
    unit = scene.unit_settings.scale_length
    bodies = [o for o in scene_export.members(scene, "SOLID", "COLLIDER") if o.type in scene_export.MESH_TYPES]
    boxes = [[edge * unit for edge in place.edges(obj)] for obj in bodies]
    number = estimate.cells(size, voxel)
    memory = estimate.memory(size, voxel, boxes, settings.ambient_fluid)
    vertices = sum(len(o.data.vertices) for o in scene_export.members(scene, "SOLID", "PASSENGER") if o.type == "MESH")
    smoke = bool(scene_export.members(scene, "EMITTER")) and settings.ambient_fluid
    frames = scene.frame_end - scene.frame_start + 1
    disk = estimate.disk(frames, number, vertices, smoke, scene.eulerfsi.half)
    lines = [f"{number:,} cells, {estimate.text(memory)} memory, at most {estimate.text(disk)} on disk"]
    depsgraph = bpy.context.view_layer.depsgraph  # as it is: no evaluation while a panel is drawn
    solids = [o for o in scene_export.members(scene, "SOLID") if o.type in scene_export.MESH_TYPES]
    if solids:
        thin, name = min((thickness.thinnest(obj, depsgraph) * unit / voxel, obj.name) for obj in solids)
        few = ": too few, take smaller voxels" if thin < _FEW_CELLS else ""
        lines.append(f"thinnest part: {thin:.1f} cells ({name}){few}")
    return lines


class EULERFSI_PT_walls(_Panel, bpy.types.Panel):
    bl_idname = "EULERFSI_PT_walls"
    bl_label = "Walls"
    bl_parent_id = "EULERFSI_PT_domain"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        settings = _domain(context.scene).eulerfsi.domain
        for name in table.rows("domain"):
            if name.startswith(_WALLS):
                self.layout.prop(settings, name)


class EULERFSI_PT_advanced(_Panel, bpy.types.Panel):
    bl_idname = "EULERFSI_PT_advanced"
    bl_label = "Advanced"
    bl_parent_id = "EULERFSI_PT_domain"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        layout.use_property_split = True
        settings = _domain(scene).eulerfsi.domain
        for name, row in table.rows("domain").items():
            if table.is_advanced(row):
                _row(layout, settings, name, row)
        for name in ("checkpoint_every", "keep_checkpoints", "half", "smoke_threshold", "threads"):
            layout.prop(scene.eulerfsi, name)
        obj = load.original(context.scene, context.object)
        if obj and obj.eulerfsi.role == "SOLID":
            for name, row in table.rows("solid").items():
                if table.is_advanced(row):
                    _row(layout, obj.eulerfsi.solid, name, row)


CLASSES = (
    EULERFSI_PT_bake,
    EULERFSI_PT_messages,
    EULERFSI_PT_object,
    EULERFSI_PT_domain,
    EULERFSI_PT_walls,
    EULERFSI_PT_advanced,
)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
