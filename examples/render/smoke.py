# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens a cache in Blender, with smoke that looks the same whatever the unit of the scene.

    blender --python examples/render/smoke.py -- CACHE/SCENE.usda [--factor 2]

The Volume prim of a cache has `eulerfsi:densityScale`: extinction per metre of smoke of density 1. Blender's volumes
keep the units of the stage, so that the density of a Principled Volume is that times the metres of a unit.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
from pathlib import Path

import bpy

if importlib.util.find_spec("pxr") is None:  # Blender as a Python module: its own packages are not on the path
    _version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    _blender = Path(bpy.utils.system_resource("SCRIPTS")).parent
    sys.path.append(str(_blender / "python" / "lib" / _version / "site-packages"))

try:
    from pxr import Usd, UsdGeom
except ImportError as error:
    raise SystemExit("smoke.py: this Blender has no pxr; 4.2 has none, 4.5 has") from error

SCALE = "eulerfsi:densityScale"
_COLOR = (0.9, 0.9, 0.9, 1.0)


def set_smoke(layer: str, per_metre: float | None = None, factor: float = 1.0) -> None:
    """Gives every imported volume a material of its own, and what is imported velocities per second.

    layer: the file that was imported; per_metre: extinction [1/m], None: what the cache says.
    """
    unit = UsdGeom.GetStageMetersPerUnit(Usd.Stage.Open(layer, Usd.Stage.LoadNone))
    for cache in bpy.data.cache_files:
        cache.velocity_unit = "SECOND"
    for volume in bpy.data.volumes:
        if per_metre is None and SCALE not in volume:
            raise SystemExit(f"{layer}: {volume.name}: has no {SCALE}: the cache is of an earlier version")
        volume.velocity_unit = "SECOND"
        volume.render.space = "OBJECT"  # the density is per unit of the stage, however its objects are scaled
        scale = volume[SCALE] if per_metre is None else per_metre
        volume.materials.clear()
        volume.materials.append(_material(scale * factor * unit))


def _material(density: float) -> bpy.types.Material:
    """A Principled Volume. density: per unit of the volume."""
    material = bpy.data.materials.new("Smoke")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    volume, output = nodes.new("ShaderNodeVolumePrincipled"), nodes.new("ShaderNodeOutputMaterial")
    volume.inputs["Density"].default_value = density
    volume.inputs["Color"].default_value = _COLOR
    material.node_tree.links.new(volume.outputs["Volume"], output.inputs["Volume"])
    return material


def main(words: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="smoke.py", description=__doc__.splitlines()[0])
    parser.add_argument("layer")
    parser.add_argument("--factor", type=float, default=1.0, help="thicker than the cache says; default: 1")
    given = parser.parse_args(words)
    bpy.ops.wm.usd_import(filepath=given.layer, import_volumes=True, set_frame_range=True, import_guide=False)
    set_smoke(given.layer, factor=given.factor)


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
