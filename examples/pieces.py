"""Pieces of the example scenes: surface meshes, and what every stage holds. All lengths are metres, y is up."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "usd_plugin"))

from eulerfsi_usd.parameters import API_SCHEMAS, stage_attributes  # noqa: E402
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics, UsdShade, UsdSkel, Vt  # noqa: E402

WALLS = ("wallXMin", "wallXMax", "wallYMin", "wallYMax", "wallZMin", "wallZMax")
DIGITS = 6  # decimals of mesh coordinates
# The Stanford bunny of Debian's package glmark2-data: closed, y up, 2 x 1.98 x 1.55 units.
BUNNY_FILE = "/usr/share/glmark2/models/bunny.obj"


# ---------------------------------------------------------------------------------------------------- surface meshes


def box_mesh(divisions: int, place: Callable[[Gf.Vec3d], Gf.Vec3d]) -> dict[str, list]:
    """Quad mesh of the cube [-1,1]^3 with `divisions`^2 quads a side, every vertex moved by `place`.

    Returns points (n, 3), counts, indices (outward faces), st (one per corner: each side fills the unit square).
    """
    points: list[Gf.Vec3d] = []
    numbers: dict[tuple[int, int, int], int] = {}
    indices, st = [], []

    def vertex(corner: tuple[int, int, int]) -> int:
        if corner not in numbers:
            numbers[corner] = len(points)
            points.append(place(Gf.Vec3d(*(2.0 * x / divisions - 1.0 for x in corner))))
        return numbers[corner]

    for axis, end in itertools.product(range(3), (0, divisions)):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for i, j in itertools.product(range(divisions), repeat=2):
            quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            for a, b in quad if end else reversed(quad):
                corner = [0, 0, 0]
                corner[axis], corner[u], corner[v] = end, a, b
                indices.append(vertex(tuple(corner)))
                st.append((a / divisions, b / divisions))
    return {"points": points, "counts": [4] * (len(indices) // 4), "indices": indices, "st": st}


def eased(frame: float, first: float, last: float) -> float:
    """0 up to frame `first`, 1 from `last` on, between them half a cosine."""
    return 0.5 - 0.5 * math.cos(math.pi * min(max(frame - first, 0), last - first) / (last - first))


def on_sphere(radius: float) -> Callable[[Gf.Vec3d], Gf.Vec3d]:
    """Maps the cube to a sphere with quads of nearly equal angle."""

    def place(p: Gf.Vec3d) -> Gf.Vec3d:
        return Gf.Vec3d(*(math.tan(0.25 * math.pi * x) for x in p)).GetNormalized() * radius

    return place


def on_ellipsoid(x: float, y: float, z: float) -> Callable[[Gf.Vec3d], Gf.Vec3d]:
    """Maps the cube to an ellipsoid of these half axes."""
    sphere = on_sphere(1.0)
    return lambda p: Gf.CompMult(sphere(p), Gf.Vec3d(x, y, z))


def on_cylinder(radius: float, half: float) -> Callable[[Gf.Vec3d], Gf.Vec3d]:
    """Maps the cube to a cylinder along z, whose ends are at -half and half: a disc of a 2-D scene."""

    def place(p: Gf.Vec3d) -> Gf.Vec3d:
        x, y, z = p
        return Gf.Vec3d(x * math.sqrt(1.0 - 0.5 * y * y) * radius, y * math.sqrt(1.0 - 0.5 * x * x) * radius, z * half)

    return place


def on_hairpin(half: float, gap: float, leg: float) -> Callable[[Gf.Vec3d], Gf.Vec3d]:
    """Maps the cube to a rod of half edge `half` bent to a U: legs of length `leg` along y, `gap` apart in x; the
    middle of the bend is the origin."""
    radius = half + gap / 2
    bend = math.pi * radius

    def place(p: Gf.Vec3d) -> Gf.Vec3d:
        way = p[2] * (leg + bend / 2)  # along the rod, from the middle of the bend
        turn = max(-math.pi / 2, min(math.pi / 2, way / radius))
        straight = max(0.0, abs(way) - bend / 2)
        out = radius + half * p[0]
        return Gf.Vec3d(out * math.sin(turn), straight - out * math.cos(turn), -half * p[1])

    return place


def checker(radius: float, side: float, z: float) -> dict[str, list]:
    """Every other square of a lattice of squares in the plane at z, as far as they lie in a circle around the axis."""
    count = math.ceil(radius / side)
    points, st = [], []
    for i, j in itertools.product(range(-count, count), repeat=2):
        square = [Gf.Vec3d(side * (i + a), side * (j + b), z) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        if (i + j) % 2 == 0 and all(math.hypot(p[0], p[1]) < radius for p in square):
            points += square
            st += [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    return {"points": points, "counts": [4] * (len(points) // 4), "indices": list(range(len(points))), "st": st}


def on_rounded_box(half: float, bevel: float) -> Callable[[Gf.Vec3d], Gf.Vec3d]:
    """Maps the cube to a cube of half edge `half` with rounded edges of radius `bevel`."""

    def place(p: Gf.Vec3d) -> Gf.Vec3d:
        p = p * half
        core = Gf.Vec3d(*(max(-(half - bevel), min(half - bevel, x)) for x in p))
        offset = p - core
        return core + offset.GetNormalized() * bevel if offset.GetLength() > 0.0 else p

    return place


# -------------------------------------------------------------------------------------------------- pieces of a scene


def new_stage(title: str, frames: int) -> Usd.Stage:
    """Stage with units, frame range, gravity 9.8 m/s^2 and lights."""
    stage = Usd.Stage.CreateInMemory(Usd.Stage.LoadNone)  # a payload beside the file is not found from memory
    layer = stage.GetRootLayer()
    layer.documentation = title
    layer.comment = "Written by examples/make_scenes.py. CC0."
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(24)
    stage.SetFramesPerSecond(24)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(frames)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    Usd.ModelAPI(world).SetKind(Kind.Tokens.component)

    gravity = UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    gravity.CreateGravityDirectionAttr(Gf.Vec3f(0, -1, 0))
    gravity.CreateGravityMagnitudeAttr(9.8)
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(2.0)
    sun.CreateAngleAttr(2.0)
    sun.CreateNormalizeAttr(True)  # as bright at any angle, in every renderer
    sun.AddRotateXYZOp().Set(Gf.Vec3f(-50, 30, 0))
    UsdLux.DomeLight.Define(stage, "/World/Sky").CreateIntensityAttr(0.4)
    return stage


def apply_schema(prim: Usd.Prim, scope: str, **values: object) -> None:
    """Applies one schema of eulerfsi and authors attributes, a dictionary as time samples.

    Raises KeyError for an unknown name.
    """
    prim.AddAppliedSchema(API_SCHEMAS[scope])
    table = stage_attributes(scope)
    for name, value in values.items():
        row = table[f"eulerfsi:{name}"]
        type_name = Sdf.ValueTypeNames.Find(row.usd_type)
        variability = Sdf.VariabilityVarying if row.animated else Sdf.VariabilityUniform
        attribute = prim.CreateAttribute(row.attribute, type_name, False, variability)
        for time, now in value.items() if isinstance(value, dict) else [(Usd.TimeCode.Default(), value)]:
            attribute.Set(now, time)


def add_cube(stage: Usd.Stage, path: str, lower: tuple, size: tuple) -> Usd.Prim:
    """Guide cube from a lower corner and edge lengths."""
    cube = UsdGeom.Cube.Define(stage, path)
    cube.CreateSizeAttr(1.0)
    cube.CreateExtentAttr(Vt.Vec3fArray([(-0.5,) * 3, (0.5,) * 3]))
    cube.CreatePurposeAttr(UsdGeom.Tokens.guide)
    center = Gf.Vec3d(*(round(a + 0.5 * b, 9) for a, b in zip(lower, size, strict=True)))
    cube.AddTranslateOp().Set(center)
    # Double precision: 0.6 as a float is more than 60 voxels of 0.01.
    cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*size))
    return cube.GetPrim()


def add_mesh(stage: Usd.Stage, path: str, surface: dict[str, list], color: tuple) -> UsdGeom.Mesh:
    """Polygon mesh with normals, texture coordinates and a preview material of its own."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = [Gf.Vec3f(*(round(x, DIGITS) for x in p)) for p in surface["points"]]
    normals = [Gf.Vec3d(0.0) for _ in points]
    for quad in _quads(surface["indices"]):
        a, b, c, d = (surface["points"][i] for i in quad)
        normal = Gf.Cross(c - a, d - b)
        for i in quad:
            normals[i] += normal
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreatePointsAttr(points)
    mesh.CreateNormalsAttr([Gf.Vec3f(*(round(x, DIGITS) for x in n.GetNormalized())) for n in normals])
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateFaceVertexCountsAttr(surface["counts"])
    mesh.CreateFaceVertexIndicesAttr(surface["indices"])
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    unique = {uv: number for number, uv in enumerate(sorted(set(surface["st"])))}
    st.Set(Vt.Vec2fArray([Gf.Vec2f(*(round(x, DIGITS) for x in uv)) for uv in unique]))
    st.SetIndices(Vt.IntArray([unique[uv] for uv in surface["st"]]))
    bind_material(stage, mesh.GetPrim(), color)
    return mesh


def _quads(indices: list[int]) -> list[list[int]]:
    return [indices[i : i + 4] for i in range(0, len(indices), 4)]


def bind_material(stage: Usd.Stage, prim: Usd.Prim, color: tuple) -> None:
    """Binds a plain UsdPreviewSurface. Looks lie as their prims do: that of /World/A/Ball is /World/Looks/A/Ball."""
    root = prim.GetPath().GetPrefixes()[0]
    looks = root.AppendChild("Looks")
    path = prim.GetPath().ReplacePrefix(root, looks)
    for scope in [looks, *(p for p in path.GetParentPath().GetPrefixes() if p.HasPrefix(looks))]:
        if not stage.GetPrimAtPath(scope):
            UsdGeom.Scope.Define(stage, scope)
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, material.GetPath().AppendChild("Surface"))
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.4)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def set_density(prim: Usd.Prim, density: float) -> None:
    """Mass density in kg/m^3, by UsdPhysics."""
    UsdPhysics.MassAPI.Apply(prim).CreateDensityAttr(density)


def add_camera(stage: Usd.Stage, eye: tuple, target: tuple) -> None:
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    view = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*target), Gf.Vec3d(0, 1, 0))
    inverse = view.GetInverse()
    rounded = Gf.Matrix4d(*(round(inverse[i][j], 9) + 0.0 for i in range(4) for j in range(4)))
    camera.AddTransformOp().Set(rounded)
    camera.CreateFocalLengthAttr(35.0)
    camera.CreateHorizontalApertureAttr(32.0)
    camera.CreateVerticalApertureAttr(18.0)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 100.0))


def add_joints(figure: UsdSkel.Root, places: list[Gf.Vec3d], turns: dict[int, list[float]]) -> None:
    """A chain of joints for the meshes of a figure, bound at `places` [m], each the parent of the next.

    turns: per frame the angles of the joints about z, against their parents' [degrees].
    """
    stage, path = figure.GetPrim().GetStage(), figure.GetPath()
    names = ["/".join(f"joint{i}" for i in range(n + 1)) for n in range(len(places))]
    steps = [b - a for a, b in zip([Gf.Vec3d(0.0), *places], places, strict=False)]
    skeleton = UsdSkel.Skeleton.Define(stage, path.AppendChild("Skeleton"))
    skeleton.CreateJointsAttr(names)
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d().SetTranslate(place) for place in places])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d().SetTranslate(step) for step in steps])
    animation = UsdSkel.Animation.Define(stage, path.AppendChild("Animation"))
    animation.CreateJointsAttr(names)
    animation.CreateTranslationsAttr([Gf.Vec3f(step) for step in steps])
    animation.CreateScalesAttr([Gf.Vec3h(1)] * len(places))
    rotations = animation.CreateRotationsAttr()
    for frame, angles in turns.items():
        halves = [0.5 * math.radians(angle) for angle in angles]
        rotations.Set(
            [Gf.Quatf(round(math.cos(a), DIGITS), 0, 0, round(math.sin(a), DIGITS) + 0.0) for a in halves], frame
        )
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    UsdSkel.BindingAPI.Apply(figure.GetPrim()).CreateSkeletonRel().SetTargets([skeleton.GetPath()])


def skin(mesh: UsdGeom.Mesh, joints: int, along: Callable[[Gf.Vec3f], float]) -> None:
    """Binds a mesh to a chain of joints: along(point) 0 is the first joint, 1.5 is halfway between 1 and 2."""
    indices, weights = [], []
    for point in mesh.GetPointsAttr().Get():
        place = max(0.0, min(joints - 1.0, along(point)))
        lower = min(int(place), joints - 2)
        indices += [lower, lower + 1]
        weights += [round(1.0 - (place - lower), DIGITS), round(place - lower, DIGITS)]
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateJointIndicesPrimvar(False, 2).Set(Vt.IntArray(indices))
    binding.CreateJointWeightsPrimvar(False, 2).Set(Vt.FloatArray(weights))
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))


def add_domain(stage: Usd.Stage, lower: tuple, size: tuple, wall: str, **values: object) -> Usd.Prim:
    prim = add_cube(stage, "/World/Domain", lower, size)
    apply_schema(prim, "domain", **(dict.fromkeys(WALLS, wall) | values))
    return prim


def add_carpet(stage: Usd.Stage, lower: tuple, size: tuple) -> None:
    """Smoke on the floor: 0.06 m thick, density 0.8, there from the first frame."""
    carpet = add_cube(stage, "/World/Carpet", lower, (size[0], 0.06, size[2]))
    apply_schema(carpet, "emitter", mode="initial", smokeDensity=0.8)
