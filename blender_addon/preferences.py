# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences of the extension, and its version."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

import bpy
from bpy.props import StringProperty


class EULERFSI_preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    root: StringProperty(
        name="Cache Root",
        description="Caches lie below this folder. Empty: beside the .blend file",
        subtype="DIR_PATH",
    )

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.prop(self, "root")
        self.layout.label(text=f"Version {version()}")


def cache_root() -> str:
    """ "" where none is set."""
    addon = bpy.context.preferences.addons.get(__package__)
    return addon.preferences.root if addon and addon.preferences else ""


@cache
def version() -> str:
    """That of the manifest, which the solver must have too."""
    text = Path(__file__).with_name("blender_manifest.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)["version"]


def register() -> None:
    bpy.utils.register_class(EULERFSI_preferences)


def unregister() -> None:
    bpy.utils.unregister_class(EULERFSI_preferences)
