# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene in metres and in centimetres is the same picture: by examples/render/smoke.py, and by the extension."""

from __future__ import annotations

import math
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from harness import fresh, part, pick, run

SMOKE = Path(__file__).resolve().parents[2] / "examples" / "render" / "smoke.py"
ALIKE, SEEN = 0.003, 0.01  # mean difference of pixels, of white: of pictures that are the same, of others at least
FRAME, SAMPLES = 8, 16

_SCENE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = {unit}
    kilogramsPerUnit = 1
    startTimeCode = 1
    endTimeCode = 8
    upAxis = "Y"
)

def Xform "World"
{{
    def PhysicsScene "Gravity"
    {{
        vector3f physics:gravityDirection = (0, -1, 0)
        float physics:gravityMagnitude = {gravity}
    }}

    def Cube "Domain" (prepend apiSchemas = ["EulerFsiDomainAPI"])
    {{
        uniform double eulerfsi:voxelSize = {voxel}
        uniform double eulerfsi:fluidDensity = {fluid}
        uniform token purpose = "guide"
        double size = {box}
    }}

    def Cube "Block" (prepend apiSchemas = ["EulerFsiColliderAPI"])
    {{
        double size = {block}
        double3 xformOp:translate.timeSamples = {{ 1: (0, {high}, 0), 8: (0, {low}, 0) }}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}

    def Cube "Layer" (prepend apiSchemas = ["EulerFsiEmitterAPI"])
    {{
        uniform token eulerfsi:mode = "initial"
        double eulerfsi:smokeDensity = 0.4
        uniform token purpose = "guide"
        double size = 1
        double3 xformOp:scale = ({wide}, {thick}, {wide})
        double3 xformOp:translate = (0, {floor}, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    }}
}}
"""


def cache_of(folder: Path, name: str, unit: float) -> str:
    """The scene in a unit [m], simulated by the extension's solver; the layer that opens the cache."""
    lengths = {"gravity": 9.8, "voxel": 0.05, "box": 0.8, "block": 0.2, "high": 0.2, "low": -0.25}
    lengths |= {"wide": 0.8, "thick": 0.3, "floor": -0.25}
    values = {key: f"{value / unit:.9g}" for key, value in lengths.items()}
    (folder / f"{name}.usda").write_text(_SCENE.format(unit=unit, fluid=f"{unit**3:.9g}", **values))
    words = [sys.executable, "-s", "-m", "eulerfsi", "simulate", str(folder / f"{name}.usda"), "--threads", "1"]
    environment = {**os.environ, "PYTHONPATH": str(part("job").SOLVER)}
    subprocess.run([*words, "-o", str(folder / name), "--progress", "none"], env=environment, check=True)
    return str(folder / name / f"{name}.usda")


def opened(layer: str, script: dict[str, Any]) -> None:
    """The cache in an empty scene with a camera and a lamp, by the script's own command line."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    script["main"]([layer])
    scene = bpy.context.scene
    bpy.ops.object.camera_add(location=(0.0, -2.2, 0.3), rotation=(math.radians(83), 0.0, 0.0))
    scene.camera = bpy.context.object
    bpy.ops.object.light_add(type="SUN", rotation=(math.radians(40), math.radians(20), 0.0))
    bpy.context.object.data.energy = 4.0
    scene.world = bpy.data.worlds.new("Sky")
    scene.world.color = (0.1, 0.2, 0.4)


def picture(path: Path) -> np.ndarray:
    """Red, green and blue of every pixel, from 0 to 1."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES
    scene.cycles.max_bounces, scene.render.threads_mode, scene.render.threads = 3, "FIXED", 1
    if hasattr(scene.cycles, "volume_biased"):
        scene.cycles.volume_biased = True  # an eighth of the time
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 160, 120, 100
    scene.render.filepath = str(path)
    scene.frame_set(FRAME)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)[..., :3]
    bpy.data.images.remove(image)
    return pixels


def differences(pictures: dict[str, np.ndarray]) -> dict[str, float]:
    """Mean difference of pixels from those of "metres"."""
    found = {name: float(np.abs(other - pictures["metres"]).mean()) for name, other in pictures.items()}
    print(f"mean difference of pixels from metres: { ({name: round(value, 4) for name, value in found.items()}) }")
    return found


def check_smoke_in_any_unit() -> None:
    """The same picture in metres and centimetres; without the script's factor a block of smoke."""
    try:
        script = runpy.run_path(str(SMOKE))
    except SystemExit as told:
        assert bpy.app.version < (4, 5), told
        print(f"skipped: {told}")
        return
    _, folder = fresh("units")
    layers = {name: cache_of(folder, name, unit) for name, unit in (("metres", 1.0), ("centimetres", 0.01))}
    pictures = {}
    for name, layer in layers.items():
        opened(layer, script)
        pictures[name] = picture(folder / f"{name}.png")
    opened(layers["centimetres"], script)
    script["set_smoke"](layers["centimetres"], factor=100.0)  # as if a unit were a metre
    pictures["block"] = picture(folder / "block.png")
    for volume in bpy.context.scene.objects:
        volume.hide_render |= volume.type == "VOLUME"
    pictures["none"] = picture(folder / "none.png")
    difference = differences(pictures)
    assert difference["centimetres"] <= ALIKE, difference
    assert min(difference["block"], difference["none"]) > SEEN, "smoke that is seen, but is not a block"


def bake_in(unit: float, name: str) -> bpy.types.Scene:
    """The factory cube as a jelly in smoke, baked in a scene of that unit [m]; a sun lights it from its camera."""
    scene, _ = fresh(name)
    scene.unit_settings.scale_length = unit
    for obj in (bpy.data.objects["Cube"], scene.camera):
        obj.location, obj.scale = obj.location / unit, obj.scale / unit
    scene.camera.data.clip_end /= unit
    light = bpy.data.objects["Light"]
    light.data.type, light.data.energy = "SUN", 4.0
    bpy.context.view_layer.update()
    pick("Cube")
    assert bpy.ops.eulerfsi.quick() == {"FINISHED"}
    bpy.data.objects["Domain"].eulerfsi.domain.voxel_size = 0.4
    scene.frame_end, scene.eulerfsi.threads = FRAME, 1
    assert bpy.ops.eulerfsi.bake() == {"FINISHED"}
    bpy.data.objects["Cube Bake"].hide_render = True  # smoke alone
    return scene


def check_bake_in_any_unit() -> None:
    """The extension's material has the density that the Volume prim tells; one that the artist has set stays."""
    pictures, densities = {}, {}
    for name, unit in (("metres", 1.0), ("centimetres", 0.01)):
        scene = bake_in(unit, f"bake_{name}")
        folder = part("bake").folder_of(scene)
        pictures[name] = picture(folder / f"{name}.png")
        densities[name] = smoke_node().inputs["Density"].default_value / unit
    assert abs(densities["centimetres"] / densities["metres"] - 1) < 1e-5, densities
    layer = folder / "cache" / "scene.usda"
    told = part("job").density_scale(folder)
    assert abs(densities["centimetres"] / told - 1) < 1e-5, (densities, told)
    layer.write_text(re.sub(r"(eulerfsi:densityScale = )\S+", rf"\g<1>{100 * told}", layer.read_text()))
    assert bpy.ops.eulerfsi.load() == {"FINISHED"}
    assert abs(smoke_node().inputs["Density"].default_value / told - 1) < 1e-5, "as if a unit were a metre"
    bpy.data.objects["Cube Bake"].hide_render = True
    pictures["block"] = picture(folder / "block.png")
    smoke_node().inputs["Density"].default_value = 0.125
    assert bpy.ops.eulerfsi.load() == {"FINISHED"} and smoke_node().inputs["Density"].default_value == 0.125
    bpy.data.objects["Smoke Bake"].hide_render = bpy.data.objects["Cube Bake"].hide_render = True
    pictures["none"] = picture(folder / "none.png")
    difference = differences(pictures)
    assert difference["centimetres"] <= ALIKE, difference
    assert min(difference["block"], difference["none"]) > SEEN, "smoke that is seen, but is not a block"


def smoke_node() -> bpy.types.Node:
    """Principled Volume of the bake that is shown."""
    return bpy.data.objects["Smoke Bake"].data.materials[0].node_tree.nodes["Euler FSI Smoke"]


if __name__ == "__main__":
    sys.exit(run({name: check for name, check in globals().items() if name.startswith("check_")}))
