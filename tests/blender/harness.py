# SPDX-License-Identifier: GPL-3.0-or-later
"""What the checks that run inside Blender share: a fresh scene with the extension, and a list of what to run."""

from __future__ import annotations

import importlib
import shutil
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import addon_utils
import bpy

MODULE = "bl_ext.user_default.eulerfsi"
WORK = Path(sys.argv[1])  # of this run; made anew by run.py


def part(name: str) -> Any:
    """A module of the installed extension."""
    return importlib.import_module(f"{MODULE}.{name}")


def fresh(name: str) -> tuple[bpy.types.Scene, Path]:
    """Blender's factory scene, saved in a folder of its own, with the extension enabled."""
    bpy.ops.wm.read_factory_settings()
    addon_utils.enable(MODULE, default_set=True)
    assert MODULE in bpy.context.preferences.addons, "the extension is not enabled"
    folder = WORK / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    return bpy.context.scene, folder


def jelly(name: str, frames: int = 6, voxel: float = 0.5) -> tuple[bpy.types.Scene, Path]:
    """The factory cube as a jelly in smoke, coarse and quick."""
    scene, folder = fresh(name)
    pick("Cube")
    assert bpy.ops.eulerfsi.quick() == {"FINISHED"}
    bpy.data.objects["Domain"].eulerfsi.domain.voxel_size = voxel
    scene.frame_end = frames
    scene.eulerfsi.threads = 1  # on a busy machine threads wait for each other
    return scene, folder


def pick(*names: str) -> None:
    """Selects objects; the first is active."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[0]]


def refused(operator: Callable[..., Any], *words: str, **arguments: Any) -> str:
    """The message with which an operator refuses; it must contain the words."""
    try:
        operator(**arguments)
    except RuntimeError as error:
        text = str(error)
        missing = [word for word in words if word not in text]
        assert not missing, f"{text!r} does not say {missing}"
        return text
    raise AssertionError(f"{operator} was not refused")


def until(what: Callable[[], Any], seconds: float = 900.0) -> Any:
    """Waits for something; its value."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := what():
            return found
        time.sleep(0.05)
    raise AssertionError(f"waited {seconds} s in vain")


def leave_none_running() -> None:
    """A bake outlives Blender, but not its check."""
    for work in part("bake")._jobs.values():
        if work.process and work.process.poll() is None:
            work.process.kill()
            work.process.wait()


def run(checks: dict[str, Callable[[], None]]) -> int:
    """Runs checks by name, those that the command line names or all; the exit code."""
    failed = []
    for name, check in checks.items():
        if len(sys.argv) > 2 and not any(word in name for word in sys.argv[2:]):
            continue
        start = time.monotonic()
        try:
            check()
        except Exception:
            traceback.print_exc()
            failed.append(name)
        finally:
            leave_none_running()
        print(f"{'FAILED' if name in failed else 'passed'}: {name} ({time.monotonic() - start:.1f} s)", flush=True)
    return int(bool(failed))
