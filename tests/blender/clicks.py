# SPDX-License-Identifier: GPL-3.0-or-later
"""Presses the extension's buttons in a real window (window.sh): set up, Bake, Cancel, Resume; pictures of the screen.

The mouse goes down the sidebar until the button under it is the one that is wanted: places are not known beforehand.
"""

from __future__ import annotations

import os
import subprocess
import time
import traceback
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import addon_utils
import bpy

HERE = Path(__file__).resolve().parent
MODULE = "bl_ext.user_default.eulerfsi"
STEP = 6  # pixels
LONG = 250  # frames of a bake that is still running when the mouse has found Cancel, also on a busy machine
# Seconds: between looks; until the mouse is where it was sent, until a panel is drawn as it stays; the longest wait.
PAUSE, SETTLED, SHOWN, PATIENCE = 0.03, 0.5, 3.0, 240.0


def view() -> tuple[bpy.types.Window, bpy.types.Area, bpy.types.Region]:
    """The 3D view and its sidebar."""
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    return window, area, next(r for r in area.regions if r.type == "UI")


def picture(name: str) -> None:
    """The screen, by a program that is not Blender."""
    subprocess.run(["import", "-window", "root", "-colors", "200", str(HERE / f"{name}.png")], check=True)


def command_below_mouse() -> str:
    """What the button does over which the mouse is; "" where there is none."""
    window, area, region = view()
    window_manager = bpy.context.window_manager
    window_manager.clipboard = ""
    with bpy.context.temp_override(window=window, area=area, region=region):
        if bpy.ops.ui.copy_python_command_button.poll():
            bpy.ops.ui.copy_python_command_button()
    return window_manager.clipboard


def move(x: int, y: int) -> Iterator[None]:
    view()[0].event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
    yield


def press(command: str) -> Iterator[None]:
    """Clicks the button with that command. Raises AssertionError where the sidebar has none."""
    window, _, region = view()
    yield from move(region.x - 200, region.y + 200)
    yield from pause(SETTLED)
    rows = range(region.y + region.height - STEP, region.y, -STEP)
    for x, y in [(region.x + region.width * share // 3, y) for share in (1, 2) for y in rows]:  # two columns
        yield from move(x, y)
        if command not in command_below_mouse():
            continue
        yield from pause(SETTLED)  # moves are carried out later: it may have been the one before
        if command not in command_below_mouse():
            continue
        for value in ("PRESS", "RELEASE"):
            window.event_simulate(type="LEFTMOUSE", value=value, x=x, y=y)
            yield
        print(f"pressed {command} at {x}, {y}", flush=True)
        return
    raise AssertionError(f"no button in the sidebar does {command}")


def until(what: Callable[[], Any]) -> Iterator[None]:
    end = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < end, "waited in vain"
        yield


def pause(seconds: float) -> Iterator[None]:
    end = time.monotonic() + seconds
    yield from until(lambda: time.monotonic() > end)


def install() -> None:
    """The zip is for official versions of Blender with this Python; Debian's older one has it too."""
    zip_path = HERE / "extension.zip"
    own = HERE / "for_debian.zip"
    with zipfile.ZipFile(zip_path) as old, zipfile.ZipFile(own, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "blender_manifest.toml":
                data = data.replace(b'blender_version_min = "5.1.0"', b'blender_version_min = "4.2.0"')
            new.writestr(name, data)
    addon_utils.enable("bl_pkg")
    done = bpy.ops.extensions.package_install_files(
        filepath=str(own), repo="user_default", enable_on_install=True, overwrite=True
    )
    assert done == {"FINISHED"} and MODULE in bpy.context.preferences.addons, done


def artist() -> Iterator[None]:
    """What a hand does."""
    install()
    bpy.ops.wm.save_as_mainfile(filepath=str(HERE / "shot.blend"))
    _, area, region = view()
    area.spaces[0].show_region_ui = True
    yield from pause(1)
    region.active_panel_category = "Euler FSI"
    yield from pause(1)
    picture("1_factory")
    scene = bpy.context.scene
    status = status_of_bake()
    yield from press("eulerfsi.quick")
    yield from until(lambda: "Domain" in bpy.data.objects)
    scene.frame_end = LONG
    yield from pause(SHOWN)
    picture("2_ready")
    yield from press("eulerfsi.bake")
    yield from until(lambda: status().kind == "running" and len(status().cache.frames) > 6)
    yield from pause(SHOWN)
    picture("3_baking")
    yield from press("eulerfsi.cancel")
    yield from until(lambda: status().kind == "interrupted")
    done = status().cache.frames[-1]
    assert done < LONG, done
    yield from pause(SHOWN)
    picture("4_cancelled")
    scene.frame_end = done + 5
    yield from press("eulerfsi.bake(mode='RESUME')")
    yield from until(lambda: status().kind == "running")
    yield from until(lambda: status().kind == "complete")
    assert status().cache.frames == list(range(1, done + 6)), status().cache.frames
    yield from pause(SHOWN)
    picture("5_resumed")
    print(f"cancelled at frame {done}, resumed to {done + 5}", flush=True)


def status_of_bake() -> Callable[[], Any]:
    import importlib

    bake = importlib.import_module(f"{MODULE}.bake")
    return lambda: bake.status(bpy.context.window_manager.windows[0].scene)


def follow(hand: Iterator[None]) -> float | None:
    """A timer: the next step; ends Blender after the last one."""
    try:
        next(hand)
        return PAUSE
    except StopIteration:
        code = 0
    except Exception:
        traceback.print_exc()
        picture("failed")
        code = 1
    print("passed" if code == 0 else "FAILED", flush=True)
    os._exit(code)  # without a question whether to save


bpy.context.preferences.view.show_splash = False
hand = artist()
bpy.app.timers.register(lambda: follow(hand), first_interval=3.0)
