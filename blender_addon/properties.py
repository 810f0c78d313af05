# SPDX-License-Identifier: GPL-3.0-or-later
"""What the .blend file stores: settings of objects and of the scene, made from the parameter table."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import place, presets, table

ROLES = (
    ("NONE", "None", "Takes no part in the simulation"),
    ("DOMAIN", "Domain", "The box that is simulated: a mesh or an empty"),
    ("SOLID", "Solid", "Soft: deforms, bounces, pushes the smoke; a closed mesh"),
    ("COLLIDER", "Collider", "Solids and smoke run into it; its own motion may be animated"),
    ("EMITTER", "Smoke", "Emits smoke or blows; a closed mesh"),
    ("FORCE", "Force", "Wind, pull or push inside its box or sphere; a mesh or an empty"),
    ("PIN", "Pin", "What it encloses of a solid follows it; a closed mesh"),
    ("PASSENGER", "Passenger", "Is drawn with a solid or a collider, without weight"),
)
SCOPE_OF = {"DOMAIN": "domain", "SOLID": "solid", "COLLIDER": "collider", "EMITTER": "emitter", "FORCE": "force"}
MATERIALS = (
    ("CUSTOM", "Custom", "The values below as they are"),
    *((name, preset.label, preset.behaves) for name, preset in presets.PRESETS.items()),
)


def _property(row: dict[str, Any]) -> Any:
    """The Blender property of a row of the table."""
    words = {"name": table.label(row), "description": row["doc"].rstrip(".")}
    words["options"] = {"ANIMATABLE"} if row.get("animated") else set()
    kind, default = row["type"], row["default"]
    if kind == "bool":
        return BoolProperty(default=default, **words)
    if kind == "token":
        items = [(token, token[0].upper() + token[1:], token) for token in row["tokens"]]
        return EnumProperty(items=items, default=default, **words)
    words |= table.limits(row) | {"precision": 4}
    if kind == "vector":
        return FloatVectorProperty(size=3, default=default, **words)
    return FloatProperty(default=default, **words)


def _by_name(name: str, row: dict[str, Any]) -> Any:
    """An enum that shows and sets a number whose values have names; nothing but the number is stored."""
    choices = table.choices(row)

    def get(settings: bpy.types.PropertyGroup) -> int:
        return table.choice_of(row, getattr(settings, name))

    def choose(settings: bpy.types.PropertyGroup, number: int) -> None:
        value = choices[number][2]
        if value is not None:
            setattr(settings, name, value)

    told = ((key, label, "The number below" if value is None else f"{value:g}") for key, label, value in choices)
    return EnumProperty(
        name=row["label"],
        description=row["doc"].rstrip("."),
        items=[(*words, number) for number, words in enumerate(told)],
        get=get,
        set=choose,
        options=set(),
    )


def _group(scope: str) -> type:
    """The class of all rows of a scope."""
    annotations = {name: _property(row) for name, row in table.rows(scope).items()}
    for name, row in table.rows(scope).items():
        if "names" in row:
            annotations[table.named(name)] = _by_name(name, row)
    name = f"EULERFSI_PG_{scope}"
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotations, "__module__": __name__})


GROUPS = {scope: _group(scope) for scope in table.SCOPES}


def _take_preset(settings: EULERFSI_PG_object, _context: bpy.types.Context) -> None:
    """Sets what makes a material: the preset's values, the table's defaults for the rest."""
    preset = presets.PRESETS.get(settings.material_preset)
    if preset is None:
        return
    obj = settings.id_data
    size = max(place.edges(obj)) * bpy.context.scene.unit_settings.scale_length or presets.SIZE
    for name, row in table.rows("solid").items():
        if name not in presets.KEPT:
            value = preset.values.get(name, row["default"])
            factor = size / presets.SIZE if row.get("unit") == "Pa" else 1.0
            setattr(settings.solid, name, float(f"{value * factor:.3g}") if factor != 1.0 else value)


class EULERFSI_PG_object(bpy.types.PropertyGroup):
    """Of an object."""

    role: EnumProperty(name="Role", items=ROLES, default="NONE", options=set())
    prim: StringProperty(name="Name in the Scene", description="Set at the first bake; stays when renamed")
    material_preset: EnumProperty(
        name="Material",
        description="Sets the values of a material, stiffer for larger objects, so that it behaves alike in every size",
        items=MATERIALS,
        default="CUSTOM",
        update=_take_preset,
        options=set(),
    )
    pin_group: StringProperty(
        name="Pin Group", description="Vertex group of which vertices with a weight above 0.5 are held"
    )
    pin_to: PointerProperty(
        name="Pin To", description="Object that the pinned vertices follow; none: they stay", type=bpy.types.Object
    )
    carrier: PointerProperty(
        name="Belongs To", description="The solid that it pins, or that it rides on", type=bpy.types.Object
    )
    shape: EnumProperty(
        name="Shape",
        items=(("BOX", "Box", "Its bounding box"), ("SPHERE", "Sphere", "The ball in its bounding box")),
        default="BOX",
        options=set(),
    )
    domain: PointerProperty(type=GROUPS["domain"])
    solid: PointerProperty(type=GROUPS["solid"])
    emitter: PointerProperty(type=GROUPS["emitter"])
    force: PointerProperty(type=GROUPS["force"])
    collider: PointerProperty(type=GROUPS["collider"])


class EULERFSI_PG_scene(bpy.types.PropertyGroup):
    """Of a scene. Nothing here says whether a bake runs: that is in the cache (job.py)."""

    uid: StringProperty(name="Identity", description="Which caches belong to the scene")
    folder: StringProperty(
        name="Cache",
        description="Folder of the bake. Empty: beside the .blend file, or below the root of the preferences",
        subtype="DIR_PATH",
    )
    checkpoint_every: IntProperty(
        name="Checkpoint Every",
        description="Frames between checkpoints, from which a bake can be taken up again or baked anew",
        default=5,
        min=1,
        soft_max=50,
        options=set(),
    )
    keep_checkpoints: BoolProperty(
        name="Keep All Checkpoints",
        description="Bake anew from any of them. Off: the last two are kept",
        default=True,
        options=set(),
    )
    half: BoolProperty(name="Half Floats", description="Smoke as 16-bit floats", default=True, options=set())
    smoke_threshold: FloatProperty(
        name="Smoke Threshold",
        description="Smoke of at most this density is left out",
        default=0.001,
        min=0.0,
        soft_max=0.1,
        precision=4,
        options=set(),
    )
    threads: IntProperty(name="Threads", description="0: all", default=0, min=0, soft_max=64, options=set())


CLASSES = (*GROUPS.values(), EULERFSI_PG_object, EULERFSI_PG_scene)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.eulerfsi = PointerProperty(type=EULERFSI_PG_object)
    bpy.types.Scene.eulerfsi = PointerProperty(type=EULERFSI_PG_scene)


def unregister() -> None:
    del bpy.types.Scene.eulerfsi, bpy.types.Object.eulerfsi
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
