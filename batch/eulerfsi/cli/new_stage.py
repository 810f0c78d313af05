"""What `new` writes: prims in the units and axes of a stage, with a comment on every value that says what it does."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from eulerfsi_usd import parameters
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from ..parameters import table
from ..scene.read import EARTH_GRAVITY
from ..scene.values import DOMAIN_API, EMITTER_API
from ..solver.simulation import Mesh
from .new_layout import Layout

_KINDS = {"double": Sdf.ValueTypeNames.Double, "token": Sdf.ValueTypeNames.Token, "bool": Sdf.ValueTypeNames.Bool}
_RESERVED = {"Domain", "Carpet", "PhysicsScene"}


class NewStage:
    """A stage that is written. unit: metres per unit; up: "y" or "z". Arguments in metres, y up."""

    def __init__(self, stage: Usd.Stage, unit: float, up: str, root: str = "/World") -> None:
        self.stage, self.unit, self.up, self.root = stage, unit, up, root
        self._names: set[str] = set()

    def world(self, vector: Sequence[float]) -> Gf.Vec3d:
        """A length or place of the layout in the stage's units and axes."""
        x, y, z = (float(c) / self.unit for c in vector)
        return Gf.Vec3d(x, -z, y) if self.up == "z" else Gf.Vec3d(x, y, z)

    def layout(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) the other way round: metres, y up."""
        points = np.asarray(points, float) * self.unit
        return points[..., [0, 2, 1]] * [1, 1, -1] if self.up == "z" else points

    def set_up(self, layout: Layout, comment: str) -> None:
        """Units, frames, gravity."""
        stage = self.stage
        stage.GetRootLayer().comment = comment
        UsdGeom.SetStageUpAxis(stage, self.up.upper())
        UsdGeom.SetStageMetersPerUnit(stage, self.unit)
        UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
        self.set_frames(layout)
        world = UsdGeom.Xform.Define(stage, self.root)
        stage.SetDefaultPrim(world.GetPrim())
        Usd.ModelAPI(world.GetPrim()).SetKind("component")
        self.add_gravity()

    def set_frames(self, layout: Layout) -> None:
        """Time codes."""
        self.stage.SetTimeCodesPerSecond(layout.fps)
        self.stage.SetFramesPerSecond(layout.fps)
        self.stage.SetStartTimeCode(layout.first)
        self.stage.SetEndTimeCode(layout.first + layout.frames - 1)

    def add_gravity(self) -> None:
        """Of the earth, downwards."""
        gravity = UsdPhysics.Scene.Define(self.stage, f"{self.root}/PhysicsScene")
        down = self.world((0, -1, 0)).GetNormalized()
        comment(gravity.CreateGravityDirectionAttr(Gf.Vec3f(down)), "Direction of gravity.")
        attribute = gravity.CreateGravityMagnitudeAttr(EARTH_GRAVITY / self.unit)
        comment(attribute, "Gravity in stage units per second squared; 0 for none.")

    def add_domain(self, layout: Layout, center: Sequence[float]) -> None:
        """The box that is simulated."""
        text = "The box that is simulated: fluid, and walls around it. Everything starts inside."
        domain = self._box("Domain", center, layout.size, DOMAIN_API, text)
        author(domain, "domain", voxelSize=layout.voxel / self.unit)

    def add_carpet(self, layout: Layout, floor: Sequence[float]) -> None:
        """A layer of smoke on the floor. floor: its middle [m]."""
        height = max(3 * layout.voxel, 0.06 * layout.size[1])
        center = np.array(floor, float) + [0, height / 2, 0]
        size = (layout.size[0], height, layout.size[2])
        text = "A layer of smoke on the floor, which shows how the fluid moves."
        author(self._box("Carpet", center, size, EMITTER_API, text), "emitter", mode="initial", smokeDensity=0.8)

    def add_mesh(self, parent: Sdf.Path, name: str, mesh: Mesh) -> Usd.Prim:
        """A Mesh of polygons, its points as they are. name: any text, shown where the prim has to have another."""
        taken = {child.GetName() for child in self.stage.GetPrimAtPath(parent).GetAllChildren()}
        valid = _distinct(_identifier(name, "_"), taken | _RESERVED)
        prim = UsdGeom.Mesh.Define(self.stage, parent.AppendChild(valid))
        prim.CreatePointsAttr([Gf.Vec3f(*map(float, point)) for point in mesh.points])
        prim.CreateFaceVertexCountsAttr(mesh.counts.tolist())
        prim.CreateFaceVertexIndicesAttr(mesh.indices.tolist())
        prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        prim.CreateExtentAttr(UsdGeom.Mesh.ComputeExtent(prim.GetPointsAttr().Get()))
        if valid != name:
            prim.GetPrim().SetDisplayName(name)
        return prim.GetPrim()

    def unique(self, name: str) -> str:
        """A name below the root that is not taken."""
        result = _distinct(_identifier(name.title(), "Solid_"), self._names | _RESERVED)
        self._names.add(result)
        return result

    def _box(self, name: str, center: Sequence[float], size: Sequence[float], api: str, text: str) -> Usd.Prim:
        """A guide Cube of edge 1, scaled to a box."""
        cube = UsdGeom.Cube.Define(self.stage, f"{self.root}/{name}")
        cube.CreateSizeAttr(1.0)
        cube.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
        cube.CreatePurposeAttr(UsdGeom.Tokens.guide)
        cube.AddTranslateOp().Set(self.world(center))
        scale = self.world(size)
        cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*(abs(edge) for edge in scale)))
        prim = cube.GetPrim()
        prim.AddAppliedSchema(api)
        comment(prim, text)
        return prim


def _identifier(name: str, prefix: str) -> str:
    """A name that USD takes; prefix: of one that begins with a digit."""
    valid = "".join(c if c.isalnum() and c.isascii() else "_" for c in name) or prefix.strip("_")
    return f"{prefix}{valid}" if valid[:1].isdigit() else valid


def _distinct(name: str, taken: set[str]) -> str:
    """The name itself, else with the first number from 2 on with which it is not taken."""
    numbered = (f"{name}{number}" for number in itertools.count(2))
    return next(one for one in itertools.chain([name], numbered) if one not in taken)


def author(prim: Usd.Prim, scope: str, **values: float | str | bool) -> None:
    """Attributes of a schema, each with the comment of the table."""
    for name, value in values.items():
        row = table()[scope][name]
        variability = Sdf.VariabilityVarying if row.animated else Sdf.VariabilityUniform
        attribute = prim.CreateAttribute(row.attribute, _KINDS[row.type], False, variability)
        attribute.Set(value)
        comment(attribute, parameters.load()[scope][name].doc)


def comment(thing: Usd.Prim | Usd.Property, text: str) -> None:
    """What people read beside the value."""
    thing.SetMetadata("comment", text)
