# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators around a bake. With buttons they return at once and a timer follows; in scripts they wait."""

from __future__ import annotations

from collections.abc import Callable

import bpy
from bpy.props import EnumProperty

from . import bake, job, load, scene_export

_MODES = (
    ("NEW", "Bake", "From the first frame; a bake that is there is replaced"),
    ("RESUME", "Resume", "Go on where it stopped, or with more frames at the end"),
    (
        "REBAKE",
        "Bake from Here",
        "Keep frames up to the last checkpoint that is not after this frame, make later ones anew",
    ),
)


class _Told:
    """Errors of a bake as reports; the panel shows them too."""

    def tell(self, action: Callable[[], None]) -> set[str]:
        try:
            action()
        except scene_export.ExportError as error:
            self.report({"ERROR"}, "\n".join(f.text for f in error.findings))
            return {"CANCELLED"}
        except job.JobError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except OSError as error:
            self.report({"ERROR"}, f"{error.filename or 'the cache'}: {error.strerror or error}")
            return {"CANCELLED"}
        return {"FINISHED"}


class EULERFSI_OT_bake(_Told, bpy.types.Operator):
    """Simulate in a process of its own; frames appear while it runs, and it goes on when Blender is closed"""

    bl_idname = "eulerfsi.bake"
    bl_label = "Bake"

    mode: EnumProperty(name="Mode", items=_MODES, default="NEW", options={"SKIP_SAVE"})

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return next(text for name, _, text in _MODES if name == properties.mode)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self.mode == "NEW" and bake.status(context.scene).cache.frames:
            return context.window_manager.invoke_confirm(self, event)
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene

        def run() -> None:
            work = bake.begin(scene, self.mode)
            if bpy.app.background:
                now = bake.wait(scene, work)
                if now.kind != "complete":
                    raise job.JobError(now.text)

        return self.tell(run)


class EULERFSI_OT_cancel(_Told, bpy.types.Operator):
    """Stop the bake; it writes a checkpoint first, so that Resume continues there"""

    bl_idname = "eulerfsi.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bake.status(context.scene).kind in job.RUNNING

    def execute(self, context: bpy.types.Context) -> set[str]:
        work = bake.status(context.scene).job
        return self.tell(work.stop) if work else {"CANCELLED"}


class EULERFSI_OT_free(_Told, bpy.types.Operator):
    """Delete the bake, its frames and what shows them"""

    bl_idname = "eulerfsi.free"
    bl_label = "Free"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return context.window_manager.invoke_confirm(self, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self.tell(lambda: bake.free(context.scene))


class EULERFSI_OT_load(_Told, bpy.types.Operator):
    """Show the bake: solids that follow it, and its smoke with a material"""

    bl_idname = "eulerfsi.load"
    bl_label = "Load"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene

        def run() -> None:
            now = bake.status(scene)
            if now.kind == "foreign" or now.folder is None:
                raise job.JobError(now.text)
            if not now.cache.frames:
                raise job.JobError(f"{now.folder}: there is no frame to show: bake first")
            load.show(scene, now.folder, now.cache)

        return self.tell(run)


class EULERFSI_OT_validate(_Told, bpy.types.Operator):
    """Ask the solver whether the scene can be simulated; takes some seconds"""

    bl_idname = "eulerfsi.validate"
    bl_label = "Validate"

    def execute(self, context: bpy.types.Context) -> set[str]:
        found: list[scene_export.Finding] = []
        done = self.tell(lambda: found.extend(bake.check(context.scene)))
        for finding in found:
            level = {"error": "ERROR", "warning": "WARNING"}.get(finding.level, "INFO")
            self.report({level}, finding.text)
        return {"CANCELLED"} if any(finding.level == "error" for finding in found) else done


CLASSES = (
    EULERFSI_OT_bake,
    EULERFSI_OT_cancel,
    EULERFSI_OT_free,
    EULERFSI_OT_load,
    EULERFSI_OT_validate,
)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
