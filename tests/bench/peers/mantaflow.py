"""Smoke by Mantaflow, the fluid solver in Blender:
`blender --background --factory-startup --python mantaflow.py -- OPTIONS`.

Bakes a cube of cells with a sphere of smoke flowing in, and prints one line of JSON behind the word MANTAFLOW:
cells, frames, steps, wall and processor seconds of the bake, bytes of its cache, part of the height that smoke reached.
Run by `./eulerfsi bench speed --only peer`. Without --factory-startup a user's settings would be baked, too.
"""

import argparse
import gzip
import json
import math
import struct
import sys
import tempfile
import time
from pathlib import Path

import bpy


def make_scene(options: argparse.Namespace, folder: str) -> bpy.types.Object:
    """A cube of edge 1 with a hot sphere near its floor; the domain."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps = 24
    scene.frame_start, scene.frame_end = 1, options.frames
    scene.render.threads_mode, scene.render.threads = "FIXED", options.threads

    bpy.ops.mesh.primitive_uv_sphere_add(radius=options.radius, location=(0.5, 0.5, options.height))
    source = bpy.context.object
    source.modifiers.new("Fluid", "FLUID").fluid_type = "FLOW"
    flow = source.modifiers["Fluid"].flow_settings
    flow.flow_type, flow.flow_behavior = "SMOKE", "INFLOW"
    flow.density, flow.temperature = 1.0, 1.0

    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.5, 0.5, 0.5))
    box = bpy.context.object
    box.modifiers.new("Fluid", "FLUID").fluid_type = "DOMAIN"
    domain = box.modifiers["Fluid"].domain_settings
    domain.domain_type = "GAS"
    domain.resolution_max = options.cells
    domain.use_adaptive_domain = domain.use_noise = domain.use_dissolve_smoke = False
    domain.use_adaptive_timesteps = False  # else steps are taken that are counted nowhere
    domain.timesteps_min = domain.timesteps_max = 1
    domain.cache_type = "ALL"
    domain.cache_directory = folder
    domain.cache_frame_start, domain.cache_frame_end = 1, options.frames
    domain.cache_data_format = "OPENVDB"
    return box


def cells_and_steps(folder: Path, fps: float) -> tuple[int, int]:
    """Cells and steps of the bake. A frame's file of settings holds the cells along each axis, three integers from byte
    4 on, and the length of the frame's steps, a float at byte 20, in units in which a frame of 1/25 s takes 0.1."""
    cells = steps = 0
    for file in sorted(folder.glob("config/config_*.uni")):
        *along, _spacing, length = struct.unpack_from("<3iff", gzip.decompress(file.read_bytes()), 4)
        cells = math.prod(along)
        steps += round(0.1 * 25 / fps / length)
    return cells, steps


def top_of_smoke(box: bpy.types.Object, frame: int) -> float:
    """Part of the height that smoke of density 0.1 has reached."""
    bpy.context.scene.frame_set(frame)
    domain = box.evaluated_get(bpy.context.evaluated_depsgraph_get()).modifiers["Fluid"].domain_settings
    nx, ny, nz = domain.domain_resolution
    density = list(domain.density_grid)
    planes = [k for k in range(nz) if max(density[k * nx * ny : (k + 1) * nx * ny]) > 0.1]
    return (planes[-1] + 1) / nz if planes else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(prog="mantaflow.py")
    parser.add_argument("--cells", type=int, default=128, help="along an edge")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--radius", type=float, default=0.08, help="of the inflow, over the edge")
    parser.add_argument("--height", type=float, default=0.15, help="of the inflow's centre, over the edge")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])
    with tempfile.TemporaryDirectory() as folder:
        box = make_scene(options, folder)
        bpy.context.view_layer.objects.active = box
        begun, used = time.perf_counter(), time.process_time()
        bpy.ops.fluid.bake_all()
        wall, processor = time.perf_counter() - begun, time.process_time() - used
        cells, steps = cells_and_steps(Path(folder), bpy.context.scene.render.fps)
        result = {
            "cells": cells,
            "frames": options.frames,
            "steps": steps,
            "wall": wall,
            "processor": processor,
            "bytes": sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file()),
            "top": top_of_smoke(box, options.frames),
        }
    print("MANTAFLOW " + json.dumps(result), flush=True)


main()
