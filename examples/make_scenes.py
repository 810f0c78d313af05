"""Writes the example scenes in examples/scenes/.

    python examples/make_scenes.py [FOLDER]

All lengths are metres, y is up, 24 frames per second. Needs usd-core. The scenes are CC0.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path

import paper_scenes
import small_scenes
import standard_scenes
from pieces import (
    BUNNY_FILE,
    DIGITS,
    ROOT,
    add_camera,
    add_carpet,
    add_cube,
    add_domain,
    add_joints,
    add_mesh,
    apply_schema,
    bind_material,
    box_mesh,
    eased,
    new_stage,
    on_ellipsoid,
    on_hairpin,
    on_rounded_box,
    on_sphere,
    set_density,
    skin,
)
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

SCENES = ROOT / "examples" / "scenes"


def make_ball() -> Usd.Stage:
    """A rubber ball (lambda = 5000 Pa, mu = 10000 Pa) thrown onto a carpet of smoke."""
    stage = new_stage("An elastic ball of radius 0.1 m is thrown down onto a carpet of smoke and bounces.", 48)
    lower, size = (-0.3, -0.5, -0.3), (0.6, 0.7, 0.6)
    domain = add_domain(stage, lower, size, "noSlip", voxelSize=0.01, fluidDensity=1.0, vorticityConfinement=1.5)
    stiffness, friction = 10000.0, 0.5
    paper_scenes.note_table_1(domain, "1000:1", stiffness, friction)
    lam, mu = 5000.0, 10000.0
    ball = add_mesh(stage, "/World/Ball", box_mesh(16, on_sphere(0.1)), (0.8, 0.15, 0.1)).GetPrim()
    youngs_modulus, poissons_ratio = mu * (3.0 * lam + 2.0 * mu) / (lam + mu), lam / (2.0 * (lam + mu))
    velocity = Gf.Vec3d(0.0, -2.03, 0.0)
    elastic = {"youngsModulus": youngs_modulus, "poissonsRatio": poissons_ratio}
    apply_schema(ball, "solid", velocity=velocity, contactStiffness=stiffness, friction=friction, **elastic)
    set_density(ball, 1000.0)
    add_carpet(stage, lower, size)
    add_camera(stage, (0.35, 0.05, 1.5), (0.0, -0.17, 0.0))
    return stage


def make_falling_bunny() -> Usd.Stage:
    """The Stanford bunny falls, tilted, onto a carpet of smoke."""
    stage = new_stage("The Stanford bunny (package glmark2-data) as a soft solid falls onto a carpet of smoke.", 48)
    lower, size = (-0.3, -0.4, -0.3), (0.6, 0.8, 0.6)
    add_domain(stage, lower, size, "noSlip", voxelSize=0.01, fluidDensity=1.0, vorticityConfinement=1.0)
    bunny = UsdGeom.Xform.Define(stage, "/World/Bunny")
    bunny.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.12, 0.0))
    bunny.AddRotateXYZOp().Set(Gf.Vec3f(0.0, 30.0, 15.0))
    bunny.AddScaleOp().Set(Gf.Vec3f(0.125))
    surface = Sdf.AssetPath(BUNNY_FILE)
    apply_schema(
        bunny.GetPrim(), "solid", surfaceFile=surface, youngsModulus=2e5, poissonsRatio=0.3, rayleighBeta=0.002
    )
    set_density(bunny.GetPrim(), 1000.0)
    bind_material(stage, bunny.GetPrim(), (0.75, 0.6, 0.45))
    add_carpet(stage, lower, size)
    add_camera(stage, (0.4, 0.15, 1.6), (0.0, -0.05, 0.0))
    return stage


def make_smoke_only() -> Usd.Stage:
    """A hot plume in a box with an open top; no solid."""
    stage = new_stage("A sphere gives off hot smoke, which rises and leaves through the open top.", 72)
    add_domain(
        stage,
        (-0.3, 0.0, -0.3),
        (0.6, 1.0, 0.6),
        "slip",
        wallYMax="open",
        voxelSize=0.02,
        fluidDensity=1.0,
        temperatureBuoyancy=0.01,
        vorticityConfinement=0.3,
    )
    source = UsdGeom.Sphere.Define(stage, "/World/Source")
    source.CreateRadiusAttr(0.08)
    source.CreateExtentAttr(Vt.Vec3fArray([(-0.08,) * 3, (0.08,) * 3]))
    source.CreatePurposeAttr(UsdGeom.Tokens.guide)
    source.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.15, 0.0))
    apply_schema(source.GetPrim(), "emitter", mode="continuous", smokeDensity=1.0, smokeTemperature=300.0)
    add_camera(stage, (0.3, 0.6, 2.0), (0.0, 0.5, 0.0))
    return stage


def make_puff() -> Usd.Stage:
    """A pipe in the floor puffs twice."""
    stage = new_stage("A pipe in the floor puffs twice: two rings of smoke, the second faster.", 48)
    add_domain(stage, (-0.3, 0.0, -0.3), (0.6, 0.9, 0.6), "slip", wallYMax="open", voxelSize=0.02, fluidDensity=1.0)
    pipe = UsdGeom.Cylinder.Define(stage, "/World/Pipe")
    pipe.CreateAxisAttr(UsdGeom.Tokens.y)
    pipe.CreateRadiusAttr(0.07)
    pipe.CreateHeightAttr(0.16)
    pipe.CreateExtentAttr(Vt.Vec3fArray([(-0.07, -0.08, -0.07), (0.07, 0.08, 0.07)]))
    pipe.CreatePurposeAttr(UsdGeom.Tokens.guide)
    pipe.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.02, 0.0))  # most of it below the floor
    up = Gf.Vec3d(0.0, 1.0, 0.0)
    apply_schema(
        pipe.GetPrim(),
        "emitter",
        mode="continuous",
        emitVelocity=True,
        enabled={1: True, 6: False, 25: True, 29: False},
        velocity={1: up * 0.0, 3: up * 1.5, 25: up * 1.5, 27: up * 3.0},
        smokeDensity={6: 1.0, 25: 0.6},
    )
    add_camera(stage, (0.3, 0.6, 2.0), (0.0, 0.42, 0.0))
    return stage


def make_jelly_drop_no_fluid() -> Usd.Stage:
    """A soft box drops onto the floor in vacuum."""
    stage = new_stage("A soft box with rounded edges drops, tilted, onto the floor. No fluid around it.", 48)
    lower, size = (-0.3, -0.3, -0.3), (0.6, 0.6, 0.6)
    add_domain(stage, lower, size, "noSlip", voxelSize=0.015, ambientFluid=False)
    surface = box_mesh(14, on_rounded_box(0.1, 0.02))
    jelly = add_mesh(stage, "/World/Jelly", surface, (0.2, 0.6, 0.25))
    jelly.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.05, 0.0))
    jelly.AddRotateXYZOp().Set(Gf.Vec3f(15.0, 0.0, 20.0))
    apply_schema(jelly.GetPrim(), "solid", youngsModulus=1.5e4, poissonsRatio=0.35, rayleighBeta=0.001)
    set_density(jelly.GetPrim(), 1000.0)
    add_camera(stage, (0.35, 0.1, 1.4), (0.0, -0.08, 0.0))
    return stage


def make_heap() -> Usd.Stage:
    """Twelve small solids of four shapes fall into a box with a carpet of smoke and come to lie on each other."""
    stage = new_stage("Twelve small solids of four shapes are poured into a box with a carpet of smoke.", 60)
    lower, size = (-0.2, 0.0, -0.2), (0.4, 0.7, 0.4)
    add_domain(stage, lower, size, "slip", voxelSize=0.01, fluidDensity=1.0, vorticityConfinement=0.5)
    shapes = {
        "Ball": (on_sphere(0.045), (0.8, 0.15, 0.1)),
        "Dice": (on_rounded_box(0.042, 0.012), (0.9, 0.75, 0.2)),
        "Egg": (on_ellipsoid(0.04, 0.056, 0.04), (0.25, 0.5, 0.8)),
        "Pebble": (on_ellipsoid(0.052, 0.034, 0.045), (0.3, 0.6, 0.3)),
    }
    for number in range(12):
        name, (place, color) = list(shapes.items())[number % 4]
        layer, corner = divmod(number, 4)
        angle = 0.5 * math.pi * corner + 0.45 * layer
        solid = add_mesh(stage, f"/World/{name}{layer + 1}", box_mesh(8, place), color)
        across = 0.085 + 0.01 * layer
        center = Gf.Vec3d(across * math.cos(angle), 0.14 + 0.19 * layer, across * math.sin(angle))
        solid.AddTranslateOp().Set(Gf.Vec3d(*(round(x, DIGITS) for x in center)))
        solid.AddRotateXYZOp().Set(Gf.Vec3f(20.0 * number, 35.0 * layer, 15.0 * corner))
        apply_schema(solid.GetPrim(), "solid", youngsModulus=4e4, poissonsRatio=0.3, rayleighBeta=0.001, friction=0.3)
        set_density(solid.GetPrim(), 1000.0)
    add_carpet(stage, lower, size)
    add_camera(stage, (0.35, 0.45, 1.3), (0.0, 0.2, 0.0))
    return stage


def make_struck() -> Usd.Stage:
    """A soft pillar, held at its foot, with eyes that ride along, is struck by a ball on a pendulum."""
    frames = 60
    stage = new_stage(
        "A soft pillar with eyes, held at its foot, is struck by a ball that swings as it is told.", frames
    )
    lower, size = (-0.4, 0.0, -0.2), (0.8, 0.55, 0.4)
    add_domain(stage, lower, size, "slip", voxelSize=0.0125, fluidDensity=1.0, vorticityConfinement=0.5)
    rounded = on_rounded_box(0.06, 0.025)
    pillar = add_mesh(
        stage, "/World/Pillar", box_mesh(12, lambda p: Gf.CompMult(rounded(p), Gf.Vec3d(1, 2.5, 1))), (0.85, 0.55, 0.2)
    )
    pillar.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.15, 0.0))
    apply_schema(pillar.GetPrim(), "solid", youngsModulus=6e4, poissonsRatio=0.35, rayleighBeta=0.002)
    set_density(pillar.GetPrim(), 1000.0)
    foot = add_cube(stage, "/World/Foot", (-0.1, 0.0, -0.1), (0.2, 0.05, 0.2))
    pillar.GetPrim().CreateRelationship("eulerfsi:pins", False).SetTargets([foot.GetPath()])
    for name, x in (("EyeLeft", -0.026), ("EyeRight", 0.026)):
        eye = add_mesh(stage, f"/World/Face/{name}", box_mesh(6, on_sphere(0.018)), (0.95, 0.95, 0.92))
        eye.AddTranslateOp().Set(Gf.Vec3d(x, 0.245, 0.06))
        pupil = add_mesh(stage, f"/World/Face/{name}Pupil", box_mesh(4, on_sphere(0.009)), (0.05, 0.05, 0.08))
        pupil.AddTranslateOp().Set(Gf.Vec3d(x, 0.245, 0.072))
    UsdGeom.Xform.Define(stage, "/World/Face")
    pillar.GetPrim().CreateRelationship("eulerfsi:passengers", False).SetTargets(["/World/Face"])

    pendulum = UsdGeom.Xform.Define(stage, "/World/Pendulum")
    pendulum.AddTranslateOp().Set(Gf.Vec3d(-0.08, 0.55, 0.0))
    swing = pendulum.AddRotateZOp()
    for frame in range(1, frames + 1):
        there = 0.5 - 0.5 * math.cos(math.pi * min(frame - 1, 28) / 14)
        swing.Set(round(-70.0 + 82.0 * there, 4), frame)
    ball = UsdGeom.Sphere.Define(stage, "/World/Pendulum/Ball")
    ball.CreateRadiusAttr(0.05)
    ball.CreateExtentAttr(Vt.Vec3fArray([(-0.05,) * 3, (0.05,) * 3]))
    ball.AddTranslateOp().Set(Gf.Vec3d(0.0, -0.3, 0.0))
    apply_schema(ball.GetPrim(), "collider", friction=0.2)
    bind_material(stage, ball.GetPrim(), (0.3, 0.32, 0.36))
    add_carpet(stage, lower, size)
    add_camera(stage, (0.35, 0.4, 1.5), (0.0, 0.22, 0.0))
    return stage


def make_clay_and_rubber() -> Usd.Stage:
    """A ball of clay and one of rubber, alike but for a yield stress, are thrown onto the floor in vacuum."""
    stage = new_stage(
        "A ball of clay, which keeps its dent, and one of rubber hit the floor. No fluid around them.", 36
    )
    lower, size = (-0.3, 0.0, -0.21), (0.6, 0.45, 0.42)
    add_domain(stage, lower, size, "slip", voxelSize=0.01, ambientFluid=False)
    for name, x, color, plastic in (
        ("Clay", -0.13, (0.55, 0.35, 0.2), {"plasticYieldStress": 5000.0, "plasticHardening": 2000.0}),
        ("Rubber", 0.13, (0.8, 0.15, 0.1), {}),
    ):
        ball = add_mesh(stage, f"/World/{name}", box_mesh(16, on_sphere(0.09)), color)
        ball.AddTranslateOp().Set(Gf.Vec3d(x, 0.25, 0.0))
        solid = ball.GetPrim()
        velocity = Gf.Vec3d(0.0, -2.5, 0.0)
        apply_schema(
            solid,
            "solid",
            youngsModulus=6e4,
            poissonsRatio=0.3,
            rayleighBeta=0.001,
            friction=0.5,
            velocity=velocity,
            **plastic,
        )
        set_density(solid, 1000.0)
    add_camera(stage, (0.25, 0.3, 1.25), (0.0, 0.14, 0.0))
    return stage


def make_meeting_balls() -> Usd.Stage:
    """Two soft balls are thrown at each other and part again, by the paper's own contact."""
    stage = new_stage("Two balls are thrown at each other. The paper's scheme: particles repel each other.", 36)
    lower, size = (-0.5, 0.0, -0.2), (1.0, 0.7, 0.4)
    add_domain(stage, lower, size, "slip", preset="paper2016", voxelSize=0.02, fluidDensity=1.0)
    for name, side, color in (("Left", -1.0, (0.8, 0.15, 0.1)), ("Right", 1.0, (0.2, 0.4, 0.8))):
        ball = add_mesh(stage, f"/World/{name}", box_mesh(12, on_sphere(0.1)), color)
        ball.AddTranslateOp().Set(Gf.Vec3d(0.14 * side, 0.55 + 0.01 * side, 0.0))
        apply_schema(
            ball.GetPrim(),
            "solid",
            youngsModulus=2.4e4,
            poissonsRatio=0.17,
            contactStiffness=1e4,
            friction=0.2,
            velocity=Gf.Vec3d(-side, 0.0, 0.0),
        )
        set_density(ball.GetPrim(), 1000.0)
    add_camera(stage, (0.3, 0.4, 1.7), (0.0, 0.3, 0.0))
    return stage


def make_tongs() -> Usd.Stage:
    """A rubber U, held at its bend, is squeezed between two rolls, which then let go."""
    frames = 48
    stage = new_stage("A rubber U is squeezed until its legs meet, and springs open when it is let go.", frames)
    lower, size = (-0.24, 0.0, -0.1), (0.48, 0.48, 0.2)
    add_domain(stage, lower, size, "slip", voxelSize=0.01, fluidDensity=1.0)
    rod = box_mesh(28, on_hairpin(0.03, 0.12, 0.2))
    tongs = add_mesh(stage, "/World/Tongs", rod, (0.8, 0.3, 0.15))
    tongs.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.14, 0.0))
    apply_schema(tongs.GetPrim(), "solid", youngsModulus=2e5, poissonsRatio=0.4, rayleighBeta=0.001)
    set_density(tongs.GetPrim(), 1000.0)
    foot = add_cube(stage, "/World/Foot", (-0.05, 0.0, -0.05), (0.1, 0.09, 0.1))
    tongs.GetPrim().CreateRelationship("eulerfsi:pins", False).SetTargets([foot.GetPath()])
    for name, side in (("Left", -1.0), ("Right", 1.0)):
        roll = UsdGeom.Cylinder.Define(stage, f"/World/{name}")
        roll.CreateAxisAttr(UsdGeom.Tokens.z)
        roll.CreateRadiusAttr(0.04)
        roll.CreateHeightAttr(0.12)
        roll.CreateExtentAttr(Vt.Vec3fArray([(-0.04, -0.04, -0.06), (0.04, 0.04, 0.06)]))
        place = roll.AddTranslateOp()
        for frame in range(1, frames + 1):
            inwards = eased(frame, 1, 21)
            outwards = min(1.0, max(0.0, (frame - 24) / 4))
            place.Set(Gf.Vec3d(side * round(0.175 - 0.062 * (inwards - outwards), 5), 0.3, 0.0), frame)
        apply_schema(roll.GetPrim(), "collider", friction=0.0)
        bind_material(stage, roll.GetPrim(), (0.3, 0.32, 0.36))
    add_camera(stage, (0.25, 0.4, 1.1), (0.0, 0.22, 0.0))
    return stage


def make_tentacle() -> Usd.Stage:
    """A skinned tentacle, a collider that its joints bend, draws back and bats a soft ball that is thrown up."""
    frames = 36
    stage = new_stage("A skinned tentacle draws back and bats a soft ball out of the air, through smoke.", frames)
    lower, size = (-0.4, 0.0, -0.16), (0.8, 0.6, 0.32)
    add_domain(stage, lower, size, "slip", voxelSize=0.0125, fluidDensity=1.0, vorticityConfinement=0.5)
    radius, height, joints = 0.045, 0.36, 4
    rounded = on_rounded_box(radius, 0.8 * radius)
    root = Gf.Vec3d(-0.16, 0.0, 0.0)
    shape = box_mesh(
        16, lambda p: root + Gf.CompMult(rounded(p), Gf.Vec3d(1, height / (2 * radius), 1)) + Gf.Vec3d(0, height / 2, 0)
    )
    figure = UsdSkel.Root.Define(stage, "/World/Tentacle")
    turns = {}
    for frame in range(1, frames + 1):
        back = eased(frame, 1, 6)
        there = eased(frame, 6, 11)
        rest = eased(frame, 14, 28)
        turns[frame] = [round((15.0 * back - 41.0 * there) * (1.0 - rest), 4)] * joints
    add_joints(figure, [root + Gf.Vec3d(0, height * (i + 0.25) / joints, 0) for i in range(joints)], turns)
    skinned = add_mesh(stage, "/World/Tentacle/Skin", shape, (0.45, 0.2, 0.5))
    skin(skinned, joints, lambda p: (p[1] / height) * joints - 0.25)
    apply_schema(skinned.GetPrim(), "collider", friction=0.3)
    cup = box_mesh(4, on_ellipsoid(0.014, 0.014, 0.006))
    cups = [root + Gf.Vec3d(0.0, 0.045 + 0.045 * i, radius) for i in range(7)]
    suckers = {
        "points": [place + point for place in cups for point in cup["points"]],
        "counts": cup["counts"] * len(cups),
        "indices": [i * len(cup["points"]) + index for i in range(len(cups)) for index in cup["indices"]],
        "st": cup["st"] * len(cups),
    }
    add_mesh(stage, "/World/Suckers", suckers, (0.85, 0.6, 0.75))
    skinned.GetPrim().CreateRelationship("eulerfsi:passengers", False).SetTargets(["/World/Suckers"])
    ball = add_mesh(stage, "/World/Ball", box_mesh(12, on_sphere(0.07)), (0.9, 0.75, 0.2))
    ball.AddTranslateOp().Set(Gf.Vec3d(0.02, 0.35, 0.0))
    apply_schema(
        ball.GetPrim(),
        "solid",
        youngsModulus=2e4,
        poissonsRatio=0.3,
        rayleighBeta=0.001,
        friction=0.3,
        velocity=Gf.Vec3d(0.0, 1.36, 0.0),
    )
    set_density(ball.GetPrim(), 1000.0)
    add_carpet(stage, lower, size)
    add_camera(stage, (0.3, 0.4, 1.5), (0.0, 0.24, 0.0))
    return stage


MAKERS: dict[str, Callable[[], Usd.Stage]] = {
    "ball.usda": make_ball,
    "falling_bunny.usda": make_falling_bunny,
    "smoke_only.usda": make_smoke_only,
    "puff.usda": make_puff,
    "jelly_drop_no_fluid.usda": make_jelly_drop_no_fluid,
    "heap.usda": make_heap,
    "struck.usda": make_struck,
    "clay_and_rubber.usda": make_clay_and_rubber,
    "meeting_balls.usda": make_meeting_balls,
    "tongs.usda": make_tongs,
    "tentacle.usda": make_tentacle,
    **small_scenes.MAKERS,
    **standard_scenes.MAKERS,
    **paper_scenes.MAKERS,
}


def main(folder: Path = SCENES) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in MAKERS.items():
        stage = make()
        stage.GetRootLayer().Export(str(folder / name))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SCENES)
