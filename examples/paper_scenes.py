"""Scenes of the paper: its figures, with its parameters (Table 1). examples/make_scenes.py writes them.

Their resolution suits a quick run; titles name the voxel size of the paper, for `--set Domain.voxelSize=...`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from pieces import (
    BUNNY_FILE,
    DIGITS,
    add_camera,
    add_cube,
    add_domain,
    add_mesh,
    apply_schema,
    bind_material,
    box_mesh,
    checker,
    new_stage,
    on_cylinder,
    set_density,
)
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


def add_character(stage: Usd.Stage, name: str, place: tuple, turn: tuple, scale: float, **values: object) -> Usd.Prim:
    """A character of examples/assets as a solid whose eyes ride along; returns its body."""
    root = UsdGeom.Xform.Define(stage, f"/World/{name}")
    root.AddTranslateOp().Set(Gf.Vec3d(*place))
    root.AddRotateXYZOp().Set(Gf.Vec3f(*turn))
    root.AddScaleOp().Set(Gf.Vec3f(scale))
    root.GetPrim().GetPayloads().AddPayload(f"../assets/{name.lower()}.usda")
    body = stage.OverridePrim(f"/World/{name}/Body")
    apply_schema(body, "solid", **values)
    body.CreateRelationship("eulerfsi:passengers", False).SetTargets([f"/World/{name}/Eyes"])
    return body


def note_table_1(prim: Usd.Prim, ratio: str, stiffness: float, friction: float) -> None:
    """The scene's row of the paper's Table 1. `production` has no use for the spring's stiffness k."""
    prim.SetCustomDataByKey("paper:densityRatio", ratio)
    prim.SetCustomDataByKey("paper:k", stiffness)
    prim.SetCustomDataByKey("paper:mu", friction)


def new_slab(title: str, frames: int, size: tuple, voxel: float, **values: object) -> Usd.Stage:
    """A 2-D scene around the origin, one voxel thick. No gravity."""
    stage = new_stage(f"{title} A slab of {voxel:g}, one voxel: change both together.", frames)
    UsdPhysics.Scene(stage.GetPrimAtPath("/World/PhysicsScene")).GetGravityMagnitudeAttr().Set(0.0)
    lower = tuple(-0.5 * edge for edge in size)
    add_domain(stage, (*lower, -0.5 * voxel), (*size, voxel), "slip", voxelSize=voxel, **values)
    add_camera(stage, (0.0, 0.0, 1.2 * size[0]), (0.0, 0.0, 0.0))
    return stage


def add_disc(stage: Usd.Stage, name: str, radius: float, place: tuple, color: tuple, **values: object) -> Usd.Prim:
    """A disc of a 2-D scene with squares on it, which ride along."""
    root = UsdGeom.Xform.Define(stage, f"/World/{name}")
    root.AddTranslateOp().Set(Gf.Vec3d(*place))
    surface = box_mesh(16, on_cylinder(radius, 0.01))
    disc = add_mesh(stage, f"/World/{name}/Disc", surface, color).GetPrim()
    apply_schema(disc, "solid", **values)
    squares = checker(radius, 0.2 * radius, 0.0101)
    add_mesh(stage, f"/World/{name}/Squares", squares, (0.95, 0.95, 0.92))
    disc.CreateRelationship("eulerfsi:passengers", False).SetTargets([f"/World/{name}/Squares"])
    return disc


def make_squeezed_disc(title: str, frames: int, **values: object) -> Usd.Stage:
    """Fig. 4: what its two parts have in common."""
    voxel = 0.005
    stage = new_slab(f"{title} The paper's Fig. 4.", frames, (0.6, 0.6), voxel, **values)
    soft = {"youngsModulus": 1500.0, "poissonsRatio": 0.3, "rayleighBeta": 0.08}
    disc = add_disc(stage, "Circle", 0.1, (0.0, 0.0, 0.0), (0.8, 0.15, 0.1), **soft)
    set_density(disc, 1000.0)
    return stage


def make_jets_circle() -> Usd.Stage:
    """(a) Two jets press on it from the left and the right; what they bring leaves through top and bottom."""
    around = {"fluidDensity": 1000.0, "fluidViscosity": 0.4, "wallYMin": "open", "wallYMax": "open"}
    stage = make_squeezed_disc("Two jets squeeze an elastic disc.", 21, **around)
    for name, side in (("Left", -1.0), ("Right", 1.0)):
        jet = add_cube(stage, f"/World/Jet{name}", (0.27 * side - 0.03, -0.07, -0.005), (0.06, 0.14, 0.01))
        inward = Gf.Vec3d(-1.0 * side, 0.0, 0.0)
        apply_schema(jet, "emitter", mode="continuous", smokeDensity=1.0, emitVelocity=True, velocity=inward)
    return stage


def make_jets_circle_free() -> Usd.Stage:
    """(b) By itself."""
    title = "A disc by itself, to be started from a run of jets_circle.usda: it takes its shape at rest again."
    return make_squeezed_disc(title, 48, ambientFluid=False)


def make_circles() -> Usd.Stage:
    """Sec. 5.2: two discs are thrown at each other."""
    title = "Two discs are thrown at each other and part again. The paper's Section 5.2."
    stage = new_slab(title, 24, (1.0, 0.5), 0.01, fluidDensity=1.0, vorticityConfinement=0.1)
    for name, side, color in (("Left", -1.0, (0.8, 0.15, 0.1)), ("Right", 1.0, (0.2, 0.4, 0.8))):
        values = {"youngsModulus": 2e4, "poissonsRatio": 0.3, "contactStiffness": 1e4}
        values["velocity"] = Gf.Vec3d(-side, 0.0, 0.0)
        set_density(add_disc(stage, name, 0.1, (0.16 * side, 0.0, 0.0), color, **values), 1000.0)
    return stage


def make_buoyancy(title: str, frames: int, density: float, youngs_modulus: float, row: tuple) -> Usd.Stage:
    """Fig. 6: a bunny over a jet of hot smoke that comes out of the floor and leaves through the sides."""
    stage = new_stage(f"{title} The paper's Fig. 6, there with voxels of 0.005.", frames)
    lower, size = (-0.36, 0.0, -0.36), (0.72, 1.0, 0.72)
    hot = {"temperatureBuoyancy": 0.01, "vorticityConfinement": 0.5}
    floor_and_ceiling = {"wallYMin": "slip", "wallYMax": "slip"}
    domain = add_domain(stage, lower, size, "open", voxelSize=0.015, fluidDensity=1.0, **floor_and_ceiling, **hot)
    note_table_1(domain, *row)
    bunny = UsdGeom.Xform.Define(stage, "/World/Bunny")
    bunny.AddTranslateOp().Set(Gf.Vec3d(-0.004, 0.5, -0.021))
    bunny.AddRotateXYZOp().Set(Gf.Vec3f(0.0, 30.0, 0.0))
    bunny.AddScaleOp().Set(Gf.Vec3f(0.125))
    surface, _, stiffness, friction = Sdf.AssetPath(BUNNY_FILE), *row
    values = {"surfaceFile": surface, "youngsModulus": youngs_modulus, "poissonsRatio": 0.3}
    values |= {"contactStiffness": stiffness, "friction": friction}
    apply_schema(bunny.GetPrim(), "solid", rayleighBeta=0.002, **values)
    set_density(bunny.GetPrim(), density)
    bind_material(stage, bunny.GetPrim(), (0.75, 0.6, 0.45))
    jet = add_cube(stage, "/World/Jet", (-0.15, 0.0, -0.15), (0.3, 0.06, 0.3))
    up = {"emitVelocity": True, "velocity": Gf.Vec3d(0.0, 2.5, 0.0)}
    apply_schema(jet, "emitter", mode="continuous", smokeDensity=1.0, smokeTemperature=300.0, **up)
    add_camera(stage, (0.5, 0.6, 1.8), (0.0, 0.5, 0.0))
    return stage


def make_bunny_light() -> Usd.Stage:
    """1.3 times as dense as the fluid. Later it would leave with the jet, through a side."""
    return make_buoyancy("A hot jet lifts a light bunny to the ceiling.", 26, 1.3, 260.0, ("1.3:1", 2000.0, 0.2))


def make_bunny_heavy() -> Usd.Stage:
    """A thousand times as dense as the fluid."""
    return make_buoyancy("A heavy bunny falls through a hot jet.", 48, 1000.0, 2e5, ("1000:1", 2000.0, 0.5))


def make_cheb(title: str, pinned: bool, **values: object) -> Usd.Stage:
    """Fig. 7: a puff of air at the head of a soft fellow."""
    stage = new_stage(f"{title} The paper's Fig. 7, there with voxels of 0.005.", 48)
    lower, size = (-0.25, 0.0, -0.25), (0.5, 0.5, 0.6)
    domain = add_domain(stage, lower, size, "slip", voxelSize=0.0125, fluidDensity=1.0, wallYMax="open")
    stiffness, friction = 2000.0, 0.5
    note_table_1(domain, "1.3:1", stiffness, friction)
    values |= {"poissonsRatio": 0.3, "rayleighBeta": 0.006, "contactStiffness": stiffness, "friction": friction}
    body = add_character(stage, "Cheb", (0.0, 0.0, -0.03), (0, 0, 0), 0.4, youngsModulus=400.0, **values)
    set_density(body, 1.3)
    if pinned:
        foot = add_cube(stage, "/World/Feet", (-0.15, 0.0, -0.15), (0.3, 0.05, 0.3))
        body.CreateRelationship("eulerfsi:pins", False).SetTargets([foot.GetPath()])
    puff = add_cube(stage, "/World/Puff", (-0.05, 0.23, 0.15), (0.1, 0.1, 0.1))
    velocity = Gf.Vec3d(0.0, 0.0, -6.0)
    blow = {"mode": "continuous", "smokeDensity": 1.0, "emitVelocity": True, "velocity": velocity}
    apply_schema(puff, "emitter", startTime=0.1, endTime=0.35, **blow)
    add_camera(stage, (0.64, 0.38, 0.76), (0.0, 0.19, -0.03))
    return stage


CLAY = {"plasticYieldStress": 25.0, "plasticFlowRate": 300.0}


def make_cheb_elastic() -> Usd.Stage:
    """Held by his feet."""
    return make_cheb("A puff of air at the head of Cheb, who is held by his feet.", True)


def make_cheb_plastic() -> Usd.Stage:
    """Held by his feet, of clay."""
    return make_cheb("A puff of air at the head of Cheb, of clay and held by his feet, leaves a dent.", True, **CLAY)


def make_cheb_free() -> Usd.Stage:
    """Free to go."""
    return make_cheb("A puff of air at the head of Cheb, who stands free, blows him over.", False)


def make_party() -> Usd.Stage:
    """Figs. 1, 8, 9: three elastic and two plastic characters are thrown at each other and fall in a heap."""
    title = "Five characters, two of them of clay, are thrown at each other, pile up and come to rest."
    stage = new_stage(f"{title} The paper's Fig. 1, there with voxels of 0.005.", 120)
    lower, size = (-0.5, 0.0, -0.5), (1.0, 0.9, 1.0)
    domain = add_domain(stage, lower, size, "slip", voxelSize=0.02, fluidDensity=1.0, vorticityConfinement=0.5)
    stiffness, friction = 10000.0, 0.2
    note_table_1(domain, "1000:1, 500:1", stiffness, friction)
    rub = {"contactStiffness": stiffness, "friction": friction}
    clay = {"plasticYieldStress": 3000.0, "plasticHardening": 3000.0}
    guests = {
        "Cheb": (1000.0, 2e5, {}),
        "Duck": (500.0, 4e4, clay),
        "Whale": (1000.0, 2e5, {}),
        "Penguin": (500.0, 4e4, clay),
        "Octopus": (1000.0, 2e5, {}),
    }
    for number, (name, (density, modulus, values)) in enumerate(guests.items()):
        angle = math.tau * number / len(guests)
        out = Gf.Vec3d(math.sin(angle), 0.0, math.cos(angle))
        place = tuple(round(x, DIGITS) for x in out * 0.3 + Gf.Vec3d(0.0, 0.32, 0.0))
        velocity = Gf.Vec3d(*(round(x, DIGITS) for x in out * -2.2 + Gf.Vec3d(0.0, 1.2, 0.0)))
        turn = (0.0, round(180.0 + math.degrees(angle), 3), 0.0)
        values = values | {"youngsModulus": modulus, "poissonsRatio": 0.3, "rayleighBeta": 0.002} | rub
        body = add_character(stage, name, place, turn, 0.36, velocity=velocity, **values)
        set_density(body, density)
    add_camera(stage, (0.9, 0.9, 2.1), (0.0, 0.3, 0.0))
    return stage


MAKERS: dict[str, Callable[[], Usd.Stage]] = {
    "squash_half.usda": make_squash_half,
    "squash_height.usda": make_squash_height,
    "squash_flat.usda": make_squash_flat,
    "jets_circle.usda": make_jets_circle,
    "jets_circle_free.usda": make_jets_circle_free,
    "circles.usda": make_circles,
    "bunny_light.usda": make_bunny_light,
    "bunny_heavy.usda": make_bunny_heavy,
    "cheb.usda": make_cheb_elastic,
    "cheb_plastic.usda": make_cheb_plastic,
    "cheb_free.usda": make_cheb_free,
    "party.usda": make_party,
}
