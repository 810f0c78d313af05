"""Scenes of the paper: its figures, with its parameters (Table 1). examples/make_scenes.py writes them.

Their resolution suits a quick run; titles name the voxel size of the paper, for `--set Domain.voxelSize=...`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from pieces import BUNNY_FILE, add_camera, add_domain, apply_schema, bind_material, new_stage, set_density
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics


def make_squash(title: str, stretch: tuple, fluid: bool, **values: object) -> Usd.Stage:
    """Fig. 3: a bunny is let go, squashed, and takes its shape again in steps of a frame. No gravity."""
    stage = new_stage(f"{title} Steps of a frame, whatever a solid moves in them (the paper's Fig. 3).", 48)
    UsdPhysics.Scene(stage.GetPrimAtPath("/World/PhysicsScene")).GetGravityMagnitudeAttr().Set(0.0)
    lower, size = (-0.2, -0.2, -0.2), (0.4, 0.4, 0.4)
    around = {"wallYMax": "open", "fluidDensity": 1.0} if fluid else {"ambientFluid": False}
    add_domain(stage, lower, size, "slip", voxelSize=0.01, cflSolid=1000.0, cflFluid=8.0, **around)
    bunny = UsdGeom.Xform.Define(stage, "/World/Bunny")
    bunny.AddScaleOp().Set(Gf.Vec3f(0.125))
    surface = Sdf.AssetPath(BUNNY_FILE)
    values |= {"surfaceFile": surface, "youngsModulus": 2e4, "poissonsRatio": 0.3, "stretch": Gf.Vec3d(*stretch)}
    apply_schema(bunny.GetPrim(), "solid", rayleighAlpha=2.0, rayleighBeta=0.01, **values)
    set_density(bunny.GetPrim(), 1000.0)
    bind_material(stage, bunny.GetPrim(), (0.75, 0.6, 0.45))
    add_camera(stage, (0.25, 0.15, 0.9), (0.0, 0.0, 0.0))
    return stage


def make_squash_half() -> Usd.Stage:
    """(a) Half size, compressible, in vacuum."""
    return make_squash(
        "A foam bunny pressed to half its size expands in vacuum.", (0.5, 0.5, 0.5), False, compressible=True
    )


def make_squash_height() -> Usd.Stage:
    """(b) Half height: the volume comes back through the volume source, and fluid leaves through the top."""
    return make_squash("A bunny pressed to half its height, and volume, grows back in a fluid.", (1.0, 0.5, 1.0), True)


def make_squash_flat() -> Usd.Stage:
    """(c) Half height with its volume."""
    wide = round(math.sqrt(2.0), 9)
    return make_squash("A bunny pressed flat, with its volume, springs back in vacuum.", (wide, 0.5, wide), False)


MAKERS: dict[str, Callable[[], Usd.Stage]] = {
    "squash_half.usda": make_squash_half,
    "squash_height.usda": make_squash_height,
    "squash_flat.usda": make_squash_flat,
}
