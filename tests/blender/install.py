# SPDX-License-Identifier: GPL-3.0-or-later
"""Installs and enables the zip that the command line names, as Blender's "Install from Disk" does."""

import sys

import bpy

import addon_utils  # isort: skip - Blender makes it importable

bpy.ops.wm.read_factory_settings()
addon_utils.enable("bl_pkg")
if bpy.app.version >= (4, 2):
    bpy.context.preferences.system.use_online_access = False
found = bpy.ops.extensions.package_install_files(
    filepath=sys.argv[1], repo="user_default", enable_on_install=True, overwrite=True
)
assert found == {"FINISHED"}, found
module = "bl_ext.user_default.eulerfsi"
assert module in bpy.context.preferences.addons, "the extension is not enabled"
addon_utils.disable(module, default_set=True)
assert not hasattr(bpy.types.Object, "eulerfsi"), "what was registered stays after disabling"
addon_utils.enable(module, default_set=True)
assert hasattr(bpy.types.Object, "eulerfsi")
