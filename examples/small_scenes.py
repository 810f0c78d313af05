"""Two small scenes that between them use what no other one does: forces, inflow, materials, pins by vertices, planes.

examples/make_scenes.py writes them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pieces import (
    DIGITS,
    add_camera,
    add_carpet,
    add_cube,
    add_domain,
    add_mesh,
    apply_schema,
    bind_material,
    box_mesh,
    new_stage,
    on_ellipsoid,
    on_sphere,
    set_density,
)
from pxr import Gf, Sdf, Usd, UsdGeom, Vt


def on_dandelion(height: float, stalk: float, head: float) -> Callable[[Gf.Vec3d], Gf.Vec3d]:
    """Maps the cube to a stalk with a round head, upright on the origin. stalk, head: radii."""
    sphere = on_sphere(1.0)

    def place(p: Gf.Vec3d) -> Gf.Vec3d:
        q = sphere(p)
        y = 0.5 * height * (1.0 + q[1])
        foot = math.sqrt(max(0.0, stalk**2 - max(0.0, stalk - y) ** 2))
        ball = math.sqrt(max(0.0, head**2 - (y - height + head) ** 2))
        radius = math.hypot(foot, ball) if y < height - head else ball
        across = math.hypot(q[0], q[2])
        return Gf.Vec3d(q[0] * radius / across, y, q[2] * radius / across) if across > 1e-9 else Gf.Vec3d(0.0, y, 0.0)

    return place


def on_cloud(radius: float) -> Callable[[Gf.Vec3d], Gf.Vec3d]:
    """Maps the cube to a ball with bumps, flat and broad."""
    sphere = on_sphere(1.0)

    def place(p: Gf.Vec3d) -> Gf.Vec3d:
        q = sphere(p)
        bumps = 1.0 + 0.2 * math.cos(5.0 * math.atan2(q[1], q[0])) * (1.0 - q[2] ** 2)
        return Gf.CompMult(q, Gf.Vec3d(1.0, 0.55, 0.8)) * (radius * bumps)

    return place


def around(count: int) -> list[Gf.Vec3d]:
    """Directions spread evenly over the sphere."""
    golden = math.pi * (3.0 - math.sqrt(5.0))
    heights = [1.0 - (2.0 * i + 1.0) / count for i in range(count)]
    return [
        Gf.Vec3d(math.sqrt(1.0 - y * y) * math.cos(golden * i), y, math.sqrt(1.0 - y * y) * math.sin(golden * i))
        for i, y in enumerate(heights)
    ]


def rounded(points: Sequence[Gf.Vec3d]) -> Vt.Vec3fArray:
    return Vt.Vec3fArray([Gf.Vec3f(*(round(x, DIGITS) for x in p)) for p in points])


def add_curves(stage: Usd.Stage, path: str, curves: Sequence[Sequence[Gf.Vec3d]], width: float, color: tuple) -> None:
    """Polylines of one width."""
    lines = UsdGeom.BasisCurves.Define(stage, path)
    lines.CreateTypeAttr(UsdGeom.Tokens.linear)
    lines.CreateCurveVertexCountsAttr([len(curve) for curve in curves])
    points = rounded([point for curve in curves for point in curve])
    lines.CreatePointsAttr(points)
    lines.CreateWidthsAttr([width])
    lines.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    lines.CreateExtentAttr(UsdGeom.Curves.ComputeExtent(points, [width]))
    bind_material(stage, lines.GetPrim(), color)


def add_points(stage: Usd.Stage, path: str, places: Sequence[Gf.Vec3d], width: float, color: tuple) -> None:
    """Points of one width."""
    cloud = UsdGeom.Points.Define(stage, path)
    points, widths = rounded(places), [width] * len(places)
    cloud.CreatePointsAttr(points)
    cloud.CreateWidthsAttr(widths)
    cloud.CreateExtentAttr(UsdGeom.Points.ComputeExtent(points, widths))
    bind_material(stage, cloud.GetPrim(), color)


def pin_vertices(mesh: UsdGeom.Mesh, held: Callable[[Gf.Vec3f], bool]) -> None:
    """Holds the vertices of a solid at which held(point) is true."""
    marks = [float(held(point)) for point in mesh.GetPointsAttr().Get()]
    kind = Sdf.ValueTypeNames.FloatArray
    UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("eulerfsi:pin", kind, UsdGeom.Tokens.vertex).Set(marks)


def make_dandelion() -> Usd.Stage:
    """A dandelion in a gusty wind, with a cloud and a ladybird that is blown along a ledge, a plane, to a twig."""
    title = "A dandelion sways in a gusty wind, which comes in through a side, and a ladybird is blown along a ledge."
    stage = new_stage(title, 48)
    lower, size, ground = (-0.3, 0.0, -0.16), (0.8, 0.54, 0.32), 0.04
    inflow = {"wallVelocityXMin": Gf.Vec3d(1.0, 0.0, 0.0), "wallXMax": "open"}
    add_domain(stage, lower, size, "slip", voxelSize=0.0125, fluidDensity=1.0, vorticityConfinement=0.3, **inflow)

    plane = UsdGeom.Plane.Define(stage, "/World/Ground")
    plane.CreateAxisAttr(UsdGeom.Tokens.y)
    plane.CreateWidthAttr(0.6)
    plane.CreateLengthAttr(0.6)
    plane.CreateExtentAttr(Vt.Vec3fArray([(-0.3, 0.0, -0.3), (0.3, 0.0, 0.3)]))
    plane.AddTranslateOp().Set(Gf.Vec3d(0.32, ground, 0.0))
    apply_schema(plane.GetPrim(), "collider", friction=0.6)
    bind_material(stage, plane.GetPrim(), (0.3, 0.45, 0.2))

    twig = UsdGeom.Capsule.Define(stage, "/World/Twig")
    twig.CreateAxisAttr(UsdGeom.Tokens.z)
    twig.CreateRadiusAttr(0.03)
    twig.CreateHeightAttr(0.2)
    twig.CreateExtentAttr(Vt.Vec3fArray([(-0.03, -0.03, -0.13), (0.03, 0.03, 0.13)]))
    twig.AddTranslateOp().Set(Gf.Vec3d(0.42, ground + 0.065, 0.0))
    apply_schema(twig.GetPrim(), "collider", friction=0.6)
    bind_material(stage, twig.GetPrim(), (0.35, 0.25, 0.15))

    height, stalk, head = 0.34, 0.032, 0.075
    surface = box_mesh(20, on_dandelion(height, stalk, head))
    root = UsdGeom.Xform.Define(stage, "/World/Dandelion")
    root.AddTranslateOp().Set(Gf.Vec3d(-0.1, 0.0, 0.0))
    flower = add_mesh(stage, "/World/Dandelion/Flower", surface, (0.4, 0.6, 0.25))
    elastic = {"youngsModulus": 2.5e5, "poissonsRatio": 0.3, "rayleighBeta": 0.002}
    apply_schema(flower.GetPrim(), "solid", **elastic)
    set_density(flower.GetPrim(), 150.0)
    pin_vertices(flower, lambda point: point[1] < 0.03)
    middle = Gf.Vec3d(0.0, height - head, 0.0)
    ways = [way for way in around(160) if way[1] > -0.6]
    stems = [[middle + way * (0.95 * head), middle + way * (head + 0.028)] for way in ways]
    add_curves(stage, "/World/Dandelion/Down/Stems", stems, 0.0015, (0.9, 0.9, 0.85))
    add_points(stage, "/World/Dandelion/Down/Seeds", [stem[1] for stem in stems], 0.012, (0.97, 0.97, 0.95))
    UsdGeom.Scope.Define(stage, "/World/Dandelion/Down")
    flower.GetPrim().CreateRelationship("eulerfsi:passengers", False).SetTargets(["/World/Dandelion/Down"])

    bird = add_mesh(stage, "/World/Ladybird/Body", box_mesh(10, on_sphere(0.045)), (0.8, 0.1, 0.08))
    UsdGeom.Xform.Define(stage, "/World/Ladybird").AddTranslateOp().Set(Gf.Vec3d(0.09, ground + 0.046, 0.05))
    soft = {"material": "stableNeoHookean", "youngsModulus": 4e3, "poissonsRatio": 0.3, "rayleighBeta": 0.002}
    apply_schema(bird.GetPrim(), "solid", friction=0.6, **soft)
    set_density(bird.GetPrim(), 300.0)
    spots = [way * 0.045 for way in around(14)]
    add_points(stage, "/World/Ladybird/Spots", spots, 0.02, (0.05, 0.05, 0.06))
    bird.GetPrim().CreateRelationship("eulerfsi:passengers", False).SetTargets(["/World/Ladybird/Spots"])

    wind = add_cube(stage, "/World/Wind", lower, size)
    blow = {"windVelocity": Gf.Vec3d(1.6, 0.0, 0.0), "windDrag": 3.0}
    noise = {"noiseSpeed": 0.8, "noiseSize": 0.15, "noiseFrequency": 3.0}
    apply_schema(wind, "force", kind="wind", enabled={1: True, 15: False, 25: True, 38: False}, **blow, **noise)
    cloud = add_mesh(stage, "/World/Cloud", box_mesh(12, on_cloud(0.08)), (0.9, 0.9, 0.95))
    cloud.CreatePurposeAttr(UsdGeom.Tokens.guide)
    cloud.AddTranslateOp().Set(Gf.Vec3d(-0.19, 0.4, 0.0))
    apply_schema(cloud.GetPrim(), "emitter", mode="continuous", smokeDensity=1.0)
    add_camera(stage, (0.4, 0.4, 1.6), (0.1, 0.24, 0.0))
    return stage


def make_jellyfish() -> Usd.Stage:
    """A jellyfish that a hand bobs up and down in water, over three beads that meet and a pebble on a spring."""
    frames = 48
    title = "A jellyfish bobs in water as a hand leads it; a force draws beads together, a spring lifts a pebble."
    stage = new_stage(title, frames)
    lower, size = (-0.22, 0.0, -0.18), (0.44, 0.5, 0.36)
    add_domain(stage, lower, size, "slip", voxelSize=0.0125, fluidDensity=1000.0, vorticityConfinement=0.3)

    surface = on_ellipsoid(0.1, 0.075, 0.1)
    bell = box_mesh(14, lambda p: Gf.CompMult(surface(p), Gf.Vec3d(1.0, 1.0 if p[1] > 0 else 0.35, 1.0)))
    root = UsdGeom.Xform.Define(stage, "/World/Jellyfish")
    root.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.34, 0.0))
    body = add_mesh(stage, "/World/Jellyfish/Bell", bell, (0.85, 0.55, 0.7))
    soft = {"material": "stVenantKirchhoff", "youngsModulus": 1000.0, "poissonsRatio": 0.3, "rayleighBeta": 0.005}
    apply_schema(body.GetPrim(), "solid", **soft)
    set_density(body.GetPrim(), 1000.0)
    pin_vertices(body, lambda point: point[1] > 0.055)
    tentacles = []
    for number in range(12):
        angle = math.tau * number / 12
        rim = Gf.Vec3d(0.08 * math.cos(angle), -0.014, 0.08 * math.sin(angle))
        way = Gf.Vec3d(0.12 * math.cos(angle), -1.0, 0.12 * math.sin(angle))
        tentacles.append([rim + way * (0.015 * i) for i in range(5)])
    add_curves(stage, "/World/Jellyfish/Rider/Tentacles", tentacles, 0.006, (0.9, 0.7, 0.8))
    for name, x in (("EyeLeft", -0.03), ("EyeRight", 0.03)):
        eye = add_mesh(stage, f"/World/Jellyfish/Rider/{name}", box_mesh(6, on_sphere(0.014)), (0.95, 0.95, 0.92))
        eye.AddTranslateOp().Set(Gf.Vec3d(x, 0.03, 0.085))
    UsdGeom.Xform.Define(stage, "/World/Jellyfish/Rider")
    body.GetPrim().CreateRelationship("eulerfsi:passengers", False).SetTargets(["/World/Jellyfish/Rider"])
    hand = UsdGeom.Xform.Define(stage, "/World/Hand")
    bob = hand.AddTranslateOp()
    for frame in range(1, frames + 1):
        bob.Set(Gf.Vec3d(0.0, round(0.34 - 0.03 * math.sin(math.tau * (frame - 1) / 16), 5), 0.0), frame)
    body.GetPrim().CreateRelationship("eulerfsi:pinTo", False).SetTargets([hand.GetPath()])

    for number, color in enumerate(((0.9, 0.75, 0.2), (0.3, 0.6, 0.8), (0.4, 0.7, 0.35))):
        angle = math.tau * number / 3
        bead = add_mesh(stage, f"/World/Bead{number + 1}", box_mesh(8, on_sphere(0.045)), color)
        center = Gf.Vec3d(-0.06 + 0.08 * math.cos(angle), 0.14, 0.08 * math.sin(angle))
        bead.AddTranslateOp().Set(Gf.Vec3d(*(round(x, DIGITS) for x in center)))
        apply_schema(bead.GetPrim(), "solid", youngsModulus=5e3, poissonsRatio=0.3)
        set_density(bead.GetPrim(), 1000.0)
    whirl = UsdGeom.Sphere.Define(stage, "/World/Pull")
    whirl.CreateRadiusAttr(0.16)
    whirl.CreateExtentAttr(Vt.Vec3fArray([(-0.16,) * 3, (0.16,) * 3]))
    whirl.CreatePurposeAttr(UsdGeom.Tokens.guide)
    whirl.AddTranslateOp().Set(Gf.Vec3d(-0.06, 0.14, 0.0))
    apply_schema(whirl.GetPrim(), "force", kind="radial", actsOn="solids", radialAcceleration=-2.0)

    pebble = add_mesh(stage, "/World/Pebble", box_mesh(8, on_ellipsoid(0.05, 0.04, 0.045)), (0.45, 0.45, 0.5))
    pebble.AddTranslateOp().Set(Gf.Vec3d(0.15, 0.07, 0.0))
    apply_schema(pebble.GetPrim(), "solid", youngsModulus=3e4, poissonsRatio=0.3)
    set_density(pebble.GetPrim(), 2500.0)
    spring = add_cube(stage, "/World/Spring", (0.08, 0.0, -0.07), (0.14, 0.3, 0.14))
    lift = {"acceleration": Gf.Vec3d(0.0, 9.0, 0.0), "enabled": {1: True, 13: False, 31: True, 43: False}}
    apply_schema(spring, "force", kind="constant", actsOn="solids", **lift)
    add_carpet(stage, lower, size)
    add_camera(stage, (0.2, 0.35, 1.3), (0.0, 0.24, 0.0))
    return stage


MAKERS: dict[str, Callable[[], Usd.Stage]] = {"dandelion.usda": make_dandelion, "jellyfish.usda": make_jellyfish}
