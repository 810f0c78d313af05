"""The USD stage of a node (metre, kilogram, second; y up): its dialog, its inputs and the SOPs that it names."""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatchcase

import hou
from eulerfsi_usd.parameters import API_SCHEMAS, Parameter, load
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics

from . import values
from .faults import Fault
from .geometry import Piece, input_of, merged, motion_of, pieces_of, place_of, sop_of
from .prims import author_mesh, author_motion

SOLIDS, PINS, COLLIDERS = range(3)  # inputs
CONVERT = {"vector": lambda v: Gf.Vec3d(*v), "bool": bool, "asset": Sdf.AssetPath, "double": float, "token": str}
# Rows that the animation before the first frame takes the place of.
MOTION = ("velocity", "angularVelocity")


@dataclass
class Builder:
    """A stage that is being made. solids: prims, and the pieces they were made of."""

    node: hou.SopNode
    stage: Usd.Stage
    frames: range
    solids: list[tuple[Usd.Prim, Piece]] = field(default_factory=list)

    def path(self, name: str) -> str:
        """A path below /World that no prim has yet."""
        base = path = f"/World/{Tf.MakeValidIdentifier(name)}"
        number = 1
        while self.stage.GetPrimAtPath(path):
            number += 1
            path = f"{base}_{number}"
        return path


def make_stage(node: hou.SopNode) -> Usd.Stage:
    """The stage, in memory. Raises Fault."""
    frames = values.frames(node)
    if len(frames) < 2:
        raise Fault(f"{node.path()}.framerange: the last frame must be after the first")
    builder = Builder(node, Usd.Stage.CreateInMemory(), frames)
    _set_up(builder)
    _add_domain(builder)
    _add_solids(builder)
    _add_pins(builder)
    _add_colliders(builder)
    for number in range(1, values.whole(node, "emitters") + 1):
        _add_region(builder, "emitter", number)
    for number in range(1, values.whole(node, "forces") + 1):
        _add_region(builder, "force", number)
    return builder.stage


def _set_up(builder: Builder) -> None:
    stage, node = builder.stage, builder.node
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(hou.fps())
    stage.SetFramesPerSecond(hou.fps())
    stage.SetStartTimeCode(builder.frames[0])
    stage.SetEndTimeCode(builder.frames[-1])
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    gravity = UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    gravity.CreateGravityDirectionAttr(Gf.Vec3f(0.0, -1.0, 0.0))
    gravity.CreateGravityMagnitudeAttr(values.number(node, "gravity"))


def _add_domain(builder: Builder) -> None:
    domain = UsdGeom.Xform.Define(builder.stage, "/World/Domain")
    domain.AddTranslateOp().Set(Gf.Vec3d(*values.vector(builder.node, "center")))
    author_rows(builder, domain.GetPrim(), "domain", "")


def author_rows(builder: Builder, prim: Usd.Prim, scope: str, prefix: str, without: tuple[str, ...] = ()) -> None:
    """Applies the schema of one scope and authors every row of the dialog, keyframes where rows may have them."""
    prim.AddAppliedSchema(API_SCHEMAS[scope])
    node = builder.node
    for row in load()[scope].values():
        name = prefix + row.name
        if row.name in without or (row.type == "asset" and not values.text(node, name)):
            continue
        if row.usd_physics:
            UsdPhysics.MassAPI.Apply(prim)
            prim.GetAttribute(row.attribute).Set(values.number(node, name))
            continue
        variability = Sdf.VariabilityVarying if row.animated else Sdf.VariabilityUniform
        kind = Sdf.ValueTypeNames.Find(row.usd_type)
        attribute = prim.CreateAttribute(row.attribute, kind, False, variability)
        if row.animated and values.is_animated(node, name):
            for frame in builder.frames:
                attribute.Set(_value(node, row, name, frame), frame)
        else:
            attribute.Set(_value(node, row, name, None))


def _value(node: hou.SopNode, row: Parameter, name: str, frame: float | None) -> object:
    """By the menu above it, where that names one, else of the row."""
    if row.names and (named := row.names.get(values.text(node, f"{name}Name"))) is not None:
        return named
    if row.type == "vector":
        return CONVERT["vector"](values.vector(node, name, frame))
    if row.type in ("token", "asset"):
        return CONVERT[row.type](values.text(node, name))
    return CONVERT[row.type](values.number(node, name, frame))


def matches(name: str, patterns: str) -> bool:
    """Whether one of the patterns, as Houdini writes them, is that of a name; "*" is that of no name, too."""
    return any(fnmatchcase(name, pattern) for pattern in patterns.split())


def _assigned(builder: Builder, scope: str, index: int) -> list[tuple[str, list[Piece]]]:
    """[(prefix of its parameters, its pieces)] of every entry of a tab: those of its SOP, or those of the input that no
    entry before takes and that its pattern matches."""
    node, first = builder.node, builder.frames[0]
    source = input_of(node, index)
    left = pieces_of(source, first) if source else []
    result = []
    for number in range(1, values.whole(node, f"{scope}s") + 1):
        prefix = f"{scope}{number}_"
        path, patterns = values.text(node, prefix + "path"), values.text(node, prefix + "name")
        own = sop_of(node, prefix + "path", path)
        taken = pieces_of(own, first) if own else [piece for piece in left if matches(piece.name, patterns)]
        if not own:
            left = [piece for piece in left if piece not in taken]
        result.append((prefix, taken))
    if left:
        names = ", ".join(sorted({piece.name or "without a name" for piece in left}))
        raise Fault(f"{node.path()}, input {index + 1}: no entry of the tab {scope.title()}s takes: {names}")
    return result


def _missing(builder: Builder, prefix: str, index: int) -> Fault:
    node = builder.node
    pattern = values.text(node, prefix + "name")
    text = f"no polygons: connect input {index + 1}, or name a SOP"
    if node.input(index) is not None:
        text = f"no piece of input {index + 1} is left for the pattern {pattern}"
    return Fault(f"{node.path()}.{prefix}path: {text}")


def _label(prefix: str, piece: Piece, number: int, count: int) -> str:
    """Name of a prim: that of the piece, else of the entry."""
    entry = prefix.rstrip("_").title()
    return piece.name or (entry if count == 1 else f"{entry}_{number}")


def _add_solids(builder: Builder) -> None:
    node = builder.node
    for prefix, pieces in _assigned(builder, "solid", SOLIDS):
        if not values.flag(node, prefix + "enabled"):
            continue
        if values.text(node, prefix + "surfaceFile"):
            prim = UsdGeom.Xform.Define(builder.stage, builder.path(prefix.rstrip("_").title())).GetPrim()
            author_rows(builder, prim, "solid", prefix)
            continue
        if not pieces:
            raise _missing(builder, prefix, SOLIDS)
        made = [_add_solid(builder, prefix, piece, n + 1, len(pieces)) for n, piece in enumerate(pieces)]
        _add_passengers(builder, prefix, made)


def _add_solid(builder: Builder, prefix: str, piece: Piece, number: int, count: int) -> Usd.Prim:
    node, first = builder.node, builder.frames[0]
    mesh = UsdGeom.Mesh.Define(builder.stage, builder.path(_label(prefix, piece, number, count)))
    author_mesh(mesh, piece, first)
    thrown = values.flag(node, prefix + "inherit")
    if thrown:
        before = motion_of(piece, range(first, first - 2, -1))
        if before.bent is not None:
            raise Fault(
                f"{piece.source.label}: bends between the frames {first - 1} and {first}: no velocity follows from it"
            )
        author_motion(mesh, before)
    author_rows(builder, mesh.GetPrim(), "solid", prefix, MOTION if thrown else ())
    _pin_points(builder, prefix, piece, mesh)
    builder.solids.append((mesh.GetPrim(), piece))
    return mesh.GetPrim()


def _pin_points(builder: Builder, prefix: str, piece: Piece, mesh: UsdGeom.Mesh) -> None:
    """The points of a group, which are held still or follow an object."""
    node = builder.node
    name = values.text(node, prefix + "pinGroup")
    group = piece.source.cooked(builder.frames[0]).findPointGroup(name) if name else None
    held = {point.number() for point in group.points()} if group else set()
    weights = [float(vertex in held) for vertex in piece.vertices.tolist()]
    if not any(weights):
        return
    kind = Sdf.ValueTypeNames.FloatArray
    UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("eulerfsi:pin", kind, UsdGeom.Tokens.vertex).Set(weights)
    path = values.text(node, prefix + "pinTo")
    if path:
        driver = node.node(path)
        if not isinstance(driver, hou.ObjNode):
            raise Fault(f"{node.path()}.{prefix}pinTo = {path}: is no object")
        hand = UsdGeom.Xform.Define(builder.stage, builder.path(f"{driver.name()}_holds_{mesh.GetPrim().GetName()}"))
        place, op = place_of(driver), hand.AddTransformOp()
        for frame in builder.frames:
            op.Set(Gf.Matrix4d(place(frame).tolist()), frame)
        mesh.GetPrim().CreateRelationship("eulerfsi:pinTo", False).SetTargets([hand.GetPath()])


def _add_passengers(builder: Builder, prefix: str, carriers: list[Usd.Prim]) -> None:
    """Pieces of a SOP that ride on the first prim of an entry."""
    node = builder.node
    source = sop_of(node, prefix + "passengers", values.text(node, prefix + "passengers"))
    if source is None:
        return
    if len(carriers) != 1:
        raise Fault(
            f"{node.path()}.{prefix}passengers: the entry has {len(carriers)} pieces: give it one by its pattern"
        )
    paths = []
    for piece in pieces_of(source, builder.frames[0]):
        mesh = UsdGeom.Mesh.Define(builder.stage, builder.path(piece.name or f"{carriers[0].GetName()}_Passenger"))
        author_mesh(mesh, piece, builder.frames[0])
        paths.append(mesh.GetPath())
    carriers[0].CreateRelationship("eulerfsi:passengers", False).SetTargets(paths)


def _add_pins(builder: Builder) -> None:
    """Each piece of the second input holds the solids that its attribute "solid" names, else those whose box it meets.

    Raises Fault.
    """
    first = builder.frames[0]
    source = input_of(builder.node, PINS)
    held: dict[int, list[Sdf.Path]] = {}
    for piece in pieces_of(source, first) if source else []:
        low, high = (getattr(piece.points(first), end)(axis=0) for end in ("min", "max"))
        numbers = []
        for number, (prim, solid) in enumerate(builder.solids):
            points = solid.points(first)
            meets = bool((points.min(axis=0) <= high).all() and (points.max(axis=0) >= low).all())
            if matches(prim.GetName(), piece.solids) if piece.solids else meets:
                numbers.append(number)
        what = f"{piece.source.label}: the pin {piece.name or 'without a name'}"
        if not numbers:
            reach = f"no solid is {piece.solids}" if piece.solids else "meets no solid"
            raise Fault(f"{what}: {reach}")
        motion = motion_of(piece, builder.frames)
        if motion.bent is not None:
            raise Fault(f"{what} bends in frame {motion.bent}: pins must move rigidly")
        mesh = UsdGeom.Mesh.Define(builder.stage, builder.path(piece.name or "Pin"))
        author_mesh(mesh, piece, first)
        author_motion(mesh, motion)
        mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
        for number in numbers:
            held.setdefault(number, []).append(mesh.GetPath())
    for number, paths in held.items():
        builder.solids[number][0].CreateRelationship("eulerfsi:pins", False).SetTargets(paths)


def _add_colliders(builder: Builder) -> None:
    for prefix, pieces in _assigned(builder, "collider", COLLIDERS):
        if not values.flag(builder.node, prefix + "enabled"):
            continue
        if not pieces:
            if builder.node.input(COLLIDERS) is None and not values.text(builder.node, prefix + "path"):
                continue  # the entry that a new node has, for the input
            raise _missing(builder, prefix, COLLIDERS)
        made = []
        for number, piece in enumerate(pieces, start=1):
            path = builder.path(_label(prefix, piece, number, len(pieces)))
            mesh = UsdGeom.Mesh.Define(builder.stage, path)
            author_mesh(mesh, piece, builder.frames[0])
            author_motion(mesh, motion_of(piece, builder.frames))
            author_rows(builder, mesh.GetPrim(), "collider", prefix)
            made.append(mesh.GetPrim())
        _add_passengers(builder, prefix, made)


def _add_region(builder: Builder, scope: str, number: int) -> None:
    """An emitter or a force: a Cube of edge 1 or a Sphere of diameter 1, scaled to its size; of emitters also a SOP."""
    node, prefix = builder.node, f"{scope}{number}_"
    path = builder.path(f"{scope.title()}{number}")
    shape = values.text(node, prefix + "shape")
    if shape == "Mesh":
        source = sop_of(node, prefix + "path", values.text(node, prefix + "path"))
        if source is None:
            raise Fault(f"{node.path()}.{prefix}path: name a SOP with closed polygons, or choose another shape")
        piece = merged(pieces_of(source, builder.frames[0]), "")
        mesh = UsdGeom.Mesh.Define(builder.stage, path)
        author_mesh(mesh, piece, builder.frames[0])
        motion = motion_of(piece, builder.frames)
        if motion.bent is not None:
            raise Fault(f"{source.label}: bends in frame {motion.bent}: an emitter must move rigidly")
        author_motion(mesh, motion)
        prim = mesh.GetPrim()
    else:
        prim = _add_shape(builder, path, shape, prefix)
    UsdGeom.Imageable(prim).CreatePurposeAttr(UsdGeom.Tokens.guide)
    author_rows(builder, prim, scope, prefix)


def _add_shape(builder: Builder, path: str, shape: str, prefix: str) -> Usd.Prim:
    node = builder.node
    if shape == "Sphere":
        gprim = UsdGeom.Sphere.Define(builder.stage, path)
        gprim.CreateRadiusAttr(0.5)
    else:
        gprim = UsdGeom.Cube.Define(builder.stage, path)
        gprim.CreateSizeAttr(1.0)
    gprim.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
    center, place = prefix + "center", gprim.AddTranslateOp()
    moving = prefix.startswith("emitter") and values.is_animated(node, center)
    for frame in builder.frames if moving else builder.frames[:1]:
        where = Gf.Vec3d(*values.vector(node, center, frame))
        place.Set(where, frame) if moving else place.Set(where)
    gprim.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*values.vector(node, prefix + "size")))
    return gprim.GetPrim()


def size_of_entry(node: hou.SopNode, prefix: str) -> float | None:
    """Longest side of the largest piece of an entry of the tab Solids, None where it has none yet."""
    builder = Builder(node, Usd.Stage.CreateInMemory(), values.frames(node))
    for name, pieces in _assigned(builder, "solid", SOLIDS):
        if name == prefix and pieces:
            return max(
                float((p.max(axis=0) - p.min(axis=0)).max()) for p in (x.points(builder.frames[0]) for x in pieces)
            )
    return None
