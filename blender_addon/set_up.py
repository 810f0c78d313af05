# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that set a scene up."""

from __future__ import annotations

import math

import bpy
import numpy as np
from bpy.props import EnumProperty, StringProperty
from mathutils import Vector

from . import presets, properties, scene_export

_CELLS_ACROSS = 12  # of the smallest solid, to begin with


def _box_of(objects: list[bpy.types.Object]) -> tuple[Vector, Vector]:
    """Corners of the box around objects, in the world."""
    corners = np.array([obj.matrix_world @ Vector(corner) for obj in objects for corner in obj.bound_box])
    return Vector(corners.min(axis=0)), Vector(corners.max(axis=0))


def add_domain(context: bpy.types.Context, around: list[bpy.types.Object]) -> bpy.types.Object:
    """An empty that is a box with room to fall and to bounce; its voxels suit the smallest of the objects."""
    low, high = _box_of(around) if around else (Vector((-1, -1, -1)), Vector((1, 1, 1)))
    size = high - low
    side = max(size)
    low -= Vector((0.6 * side, 0.6 * side, 0.4 * side))
    high += Vector((0.6 * side, 0.6 * side, 0.4 * side))
    domain = bpy.data.objects.new("Domain", None)
    domain.empty_display_type, domain.empty_display_size = "CUBE", 0.5
    domain.location, domain.scale = (low + high) / 2, high - low
    context.collection.objects.link(domain)
    domain.eulerfsi.role = "DOMAIN"
    smallest = min((min(obj.dimensions) for obj in around), default=min(size))
    unit = context.scene.unit_settings.scale_length
    settings = domain.eulerfsi.domain
    settings.voxel_size = float(f"{max(smallest, side / 20) * unit / _CELLS_ACROSS:.2g}")
    settings.vorticity_confinement = 0.5
    return domain


def add_smoke(context: bpy.types.Context, domain: bpy.types.Object) -> bpy.types.Object:
    """A layer of smoke on the floor of the domain."""
    edges, center = scene_export.domain_box(domain)
    context.view_layer.update()
    layer = 0.14
    points = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, -0.5 + layer)]
    corners = [[e * p + c for e, p, c in zip(edges, point, center, strict=True)] for point in points]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new("Smoke Layer")
    mesh.from_pydata(corners, [], faces)
    obj = bpy.data.objects.new("Smoke Layer", mesh)
    context.collection.objects.link(obj)
    obj.matrix_world = domain.matrix_world.copy()
    obj.display_type, obj.hide_render = "WIRE", True
    obj.eulerfsi.role = "EMITTER"
    obj.eulerfsi.emitter.mode = "initial"
    obj.eulerfsi.emitter.smoke_density = 0.8
    return obj


def longest_edge(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> float:
    """Of the evaluated mesh, in the world."""
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    ends = np.empty(len(mesh.edges) * 2, np.int32)
    mesh.edges.foreach_get("vertices", ends)
    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    evaluated.to_mesh_clear()
    world = points.reshape(-1, 3) @ np.array(obj.matrix_world.to_3x3()).T
    first, second = world[ends[::2]], world[ends[1::2]]
    return float(np.sqrt(((second - first) ** 2).sum(axis=1)).max()) if len(ends) else 0.0


def refine(context: bpy.types.Context, obj: bpy.types.Object, voxel: float) -> None:
    """Splits faces that are larger than two voxels: a solid bends only where it has vertices. voxel: Blender units."""
    longest = longest_edge(obj, context.evaluated_depsgraph_get())
    levels = min(6, math.ceil(math.log2(max(longest, 1e-9) / (2 * voxel))))
    if levels > 0 and obj.type == "MESH":
        modifier = obj.modifiers.new("Euler FSI Detail", "SUBSURF")
        modifier.subdivision_type = "SIMPLE"
        modifier.levels = modifier.render_levels = levels


class EULERFSI_OT_quick(bpy.types.Operator):
    """Make the selected meshes soft, in a box with smoke on its floor"""

    bl_idname = "eulerfsi.quick"
    bl_label = "Soft Solids in Smoke"
    bl_options = {"REGISTER", "UNDO"}

    material: EnumProperty(
        name="Material",
        items=[(name, preset.label, preset.behaves) for name, preset in presets.PRESETS.items()],
        default="JELLY",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.mode == "OBJECT" and any(o.type in scene_export.MESH_TYPES for o in context.selected_objects)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if scene_export.members(context.scene, "DOMAIN"):
            self.report({"ERROR"}, "the scene has a domain already: give objects their roles instead")
            return {"CANCELLED"}
        objects = [o for o in context.selected_objects if o.type in scene_export.MESH_TYPES]
        for obj in objects:
            obj.eulerfsi.role = "SOLID"
            obj.eulerfsi.material_preset = self.material
        domain = add_domain(context, objects)
        add_smoke(context, domain)
        voxel = domain.eulerfsi.domain.voxel_size / context.scene.unit_settings.scale_length
        for obj in objects:
            refine(context, obj, voxel)
        return {"FINISHED"}


class EULERFSI_OT_add_domain(bpy.types.Operator):
    """Add the box that is simulated, around the selected objects"""

    bl_idname = "eulerfsi.add_domain"
    bl_label = "Add Domain"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.mode == "OBJECT"

    def execute(self, context: bpy.types.Context) -> set[str]:
        add_domain(context, [o for o in context.selected_objects if o.type in scene_export.MESH_TYPES])
        return {"FINISHED"}


class EULERFSI_OT_add_smoke(bpy.types.Operator):
    """Add a layer of smoke on the floor of the domain"""

    bl_idname = "eulerfsi.add_smoke"
    bl_label = "Add Smoke Layer"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.mode == "OBJECT" and bool(scene_export.members(context.scene, "DOMAIN"))

    def execute(self, context: bpy.types.Context) -> set[str]:
        add_smoke(context, scene_export.members(context.scene, "DOMAIN")[0])
        return {"FINISHED"}


class EULERFSI_OT_set_role(bpy.types.Operator):
    """Give the selected objects a role in the simulation"""

    bl_idname = "eulerfsi.set_role"
    bl_label = "Set Role"
    bl_options = {"REGISTER", "UNDO"}

    role: EnumProperty(name="Role", items=properties.ROLES, default="SOLID")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.selected_objects)

    def execute(self, context: bpy.types.Context) -> set[str]:
        for obj in context.selected_objects:
            obj.eulerfsi.role = self.role
            if self.role in ("DOMAIN", "EMITTER", "FORCE", "PIN") and obj.type in scene_export.MESH_TYPES:
                obj.display_type, obj.hide_render = "WIRE", True
        return {"FINISHED"}


class EULERFSI_OT_select(bpy.types.Operator):
    """Select the object that a message is about"""

    bl_idname = "eulerfsi.select"
    bl_label = "Select Object"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Object")

    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = context.scene.objects.get(self.name)
        if obj is None:
            self.report({"ERROR"}, f"“{self.name}” is not in the scene any more")
            return {"CANCELLED"}
        for other in context.view_layer.objects:
            other.select_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj
        return {"FINISHED"}


CLASSES = (
    EULERFSI_OT_quick,
    EULERFSI_OT_add_domain,
    EULERFSI_OT_add_smoke,
    EULERFSI_OT_set_role,
    EULERFSI_OT_select,
)


def _in_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.operator("eulerfsi.quick", icon="MOD_SOFT")


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.VIEW3D_MT_object_quick_effects.append(_in_menu)


def unregister() -> None:
    bpy.types.VIEW3D_MT_object_quick_effects.remove(_in_menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
