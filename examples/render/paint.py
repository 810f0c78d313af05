# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders frames of a cache side by side with Cycles, into one WebP; make_gallery.py calls it in a Python with bpy.

paint.py LAYER PICTURE --frames 1 8 24 [--smoke PER_METRE] [--floor Y] [--samples N] [--height PIXELS] [--threads N]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
import smoke

BACKGROUND, FLOOR = (0.55, 0.65, 0.8), (0.5, 0.5, 0.52)
SUN, SKY = 4.0, 0.45  # strengths
ZOOM = 1.5  # the scenes' cameras are for wide pictures, these are square


def load(layer: str) -> None:
    """The cache in an empty scene, seen by its own camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=layer, import_volumes=True, set_frame_range=True, import_guide=False)
    scene = bpy.context.scene
    cameras = [obj for obj in scene.objects if obj.type == "CAMERA"]
    if not cameras:
        raise SystemExit(f"{layer}: has no camera")
    scene.camera = cameras[0]
    scene.camera.data.lens *= ZOOM
    for light in [obj for obj in scene.objects if obj.type == "LIGHT"]:
        light.data.normalize = True  # else its strength depends on its angle
        light.data.energy = SUN  # watts per square metre: the files' own are for other renderers
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    shade = world.node_tree.nodes["Background"].inputs
    shade["Color"].default_value, shade["Strength"].default_value = (*BACKGROUND, 1.0), SKY
    scene.world = world


def add_floor(height: float) -> None:
    """A plane at a height of the scene, which is y up in the file and z up here."""
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, height))
    material = bpy.data.materials.new("Floor")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*FLOOR, 1.0)
    bpy.context.object.data.materials.append(material)


def add_smoke(layer: str, per_metre: float | None) -> None:
    """A material on every volume, of this extinction [1/m], None: that of the cache; 0 hides them."""
    smoke.set_smoke(layer, per_metre)
    for obj in [obj for obj in bpy.context.scene.objects if obj.type == "VOLUME"]:
        obj.hide_render = per_metre == 0.0


def set_up(height: int, samples: int, threads: int | None) -> None:
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", samples
    scene.cycles.use_denoising, scene.cycles.volume_biased = True, True
    scene.cycles.max_bounces, scene.cycles.volume_bounces = 4, 1
    scene.render.resolution_x = scene.render.resolution_y = height
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    if threads:
        scene.render.threads_mode, scene.render.threads = "FIXED", threads


def render(frame: int, folder: Path) -> np.ndarray:
    """Rows of pixels, from below."""
    scene = bpy.context.scene
    scene.frame_set(frame)
    scene.render.filepath = str(folder / f"{frame}.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    return np.array(image.pixels[:], np.float32).reshape(image.size[1], image.size[0], 4)


def save(pixels: np.ndarray, path: Path) -> None:
    height, width, _ = pixels.shape
    image = bpy.data.images.new("Strip", width, height)
    image.pixels.foreach_set(np.ascontiguousarray(pixels).ravel())
    image.file_format = "WEBP"
    image.save(filepath=str(path), quality=82)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("layer")
    parser.add_argument("picture", type=Path)
    parser.add_argument("--frames", type=int, nargs="+", required=True)
    parser.add_argument(
        "--smoke", type=float, help="extinction of smoke of density 1 [1/m]; default: what the cache says"
    )
    parser.add_argument("--floor", type=float, help="height of a floor; default: none")
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument("--height", type=int, default=300)
    parser.add_argument("--threads", type=int)
    given = parser.parse_args()
    load(given.layer)
    add_smoke(given.layer, given.smoke)
    if given.floor is not None:
        add_floor(given.floor)
    set_up(given.height, given.samples, given.threads)
    with tempfile.TemporaryDirectory() as folder:
        strips = [render(frame, Path(folder)) for frame in given.frames]
    gap = np.ones((given.height, 4, 4), np.float32)
    save(np.concatenate([part for strip in strips for part in (strip, gap)][:-1], axis=1), given.picture.resolve())
    return 0


if __name__ == "__main__":
    sys.exit(main())
