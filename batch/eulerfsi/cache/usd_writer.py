"""USD out: one layer per frame with what moves, and a root layer that joins them over the scene.

Frame layers hold points, velocities (local units per second), normals where the mesh is not subdivided, and extent:
one time sample each. The root layer has the copied scene as its sublayer and template value clips on every solid;
clips authored there win over points of the sublayer, so the scene's own layers stay as they were.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi_usd.parameters import DENSITY_SCALE
from eulerfsi_usd.transforms import places
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from .. import files
from ..frames import file_number
from ..scene.follow import nearest_rotation
from ..scene.instancers import instances_layer
from ..scene.parts import Passenger, Rider, Scene, Solid
from ..scene.space import transform_points, transform_vectors

_TYPES = {
    "points": Sdf.ValueTypeNames.Point3fArray,
    "velocities": Sdf.ValueTypeNames.Vector3fArray,
    "normals": Sdf.ValueTypeNames.Normal3fArray,
    "extent": Sdf.ValueTypeNames.Float3Array,
}
_OPTICAL_DEPTH = 10.0  # of smoke of density 1 along the longest edge of the box: thick, but not a block
_TRANSFORM = "xformOp:transform:eulerfsi"  # of a shape without points
_CLIP_SET = "eulerfsi"
_STAGE_METADATA = (
    "defaultPrim",
    "upAxis",
    "metersPerUnit",
    "kilogramsPerUnit",
    "timeCodesPerSecond",
    "framesPerSecond",
    "colorConfiguration",
    "renderSettingsPrimPath",
    "expressionVariables",
)
# Grid -> value type of its OpenVDBAsset and role of its vectors.
_GRIDS = {"density": ("float", None), "vel": ("float3", "Vector"), "temperature": ("float", None)}


def vertex_normals(points: np.ndarray, triangles: np.ndarray, left_handed: bool) -> np.ndarray:
    """(n, 3) float32 unit normals, faces weighted by area; (0, 0, 1) where a point has no face."""
    p = points.astype(float)
    a, b, c = (p[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a) * (-1.0 if left_handed else 1.0)
    normals = np.zeros_like(p)
    for k in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(triangles[:, k], face[:, axis], len(p))
    length = np.sqrt((normals * normals).sum(axis=1))
    normals[length == 0] = (0, 0, 1)
    length[length == 0] = 1
    return (normals / length[:, None]).astype(np.float32)


def _kinds(part: Solid | Passenger | Rider) -> dict[str, Sdf.ValueTypeName]:
    """Attributes that a part gets in every frame."""
    return {_TRANSFORM: Sdf.ValueTypeNames.Matrix4d} if part.rigid else _TYPES


def _values(part: Solid | Passenger | Rider, points: np.ndarray, velocities: np.ndarray) -> dict[str, np.ndarray]:
    """Values of the attributes of a prim, from what it has in its own space."""
    values = {"points": points.astype(np.float32), "velocities": velocities.astype(np.float32)}
    if part.subdivision == "none":
        values["normals"] = vertex_normals(values["points"], part.local.triangles(), part.left_handed)
    values["extent"] = np.stack([values["points"].min(axis=0), values["points"].max(axis=0)])
    return {name: np.ascontiguousarray(value) for name, value in values.items()}


class UsdWriter:
    """Writes the USD part of one cache. Paths in the layers are relative to the cache folder."""

    def __init__(self, folder: Path, scene: Scene) -> None:
        self.folder = folder
        self.scene = scene
        self.volume_path, self._new_root = _volume_place(scene.stage, scene.domain_path)

    def frame_name(self, frame: int) -> str:
        """Relative path of a frame layer."""
        return f"frames/{self.scene.name}.{file_number(frame)}.usdc"

    @property
    def manifest_name(self) -> str:
        """Relative path of the layer that tells which attributes the clips hold."""
        return f"frames/{self.scene.name}.manifest.usda"

    def vdb_name(self, frame: int) -> str:
        """Relative path of a frame's volume file."""
        return f"vdb/{self.scene.name}.{file_number(frame)}.vdb"

    def write_frame(self, frame: int, surfaces: list[tuple[np.ndarray, np.ndarray]]) -> str:
        """Writes one frame layer. surfaces: of scene.simulated, positions [m] and velocities [m/s] in simulation space.

        Returns the content hash: SHA-256 of prim paths, points and velocities as written.
        """
        layer = Sdf.Layer.CreateAnonymous(".usdc")
        content = hashlib.sha256()
        parts = [*zip(self.scene.simulated, surfaces, strict=True), *((rider, None) for rider in self.scene.riders)]
        for part, at in parts:
            if not part.output_path:
                continue
            prim = Sdf.CreatePrimInLayer(layer, part.output_path)
            content.update(part.output_path.encode())
            for name, value in self._frame_values(part, frame, at).items():
                spec = Sdf.AttributeSpec(prim, name, _kinds(part)[name])
                as_usd = Gf.Matrix4d(value) if part.rigid else Vt.Vec3fArray.FromNumpy(value)
                layer.SetTimeSample(spec.path, frame, as_usd)
                if name in ("points", "velocities", _TRANSFORM):
                    content.update(value.tobytes())
        with files.replacing(self.folder / self.frame_name(frame)) as temporary:
            files.export_layer(layer, temporary)
        return content.hexdigest()

    def _frame_values(
        self, part: Solid | Passenger | Rider, frame: int, at: tuple[np.ndarray, np.ndarray] | None
    ) -> dict[str, np.ndarray]:
        """Values by attribute. at: points and velocities in simulation space, None for riders."""
        if part.rigid:
            points = part.points(frame) if at is None else at[0]
            return {_TRANSFORM: self._transform(part, frame, self.scene.space.point_to_world(points.astype(float)))}
        own = part.in_own_space(frame) if at is None else self._in_own_space(part, frame, *at)
        return _values(part, *own)

    def _transform(self, part: Passenger | Rider, frame: int, now: np.ndarray) -> np.ndarray:
        """(4, 4) of a shape relative to its parent: its place at the start, moved as its surface (n, 3) has."""
        prim = self._source(part)
        start = self._local_to_world(prim, self.scene.frames.first)
        before = transform_points(part.local.points, start)
        center, middle = now.mean(axis=0), before.mean(axis=0)
        away, apart = now - center, before - middle
        moments = np.array([[(away[:, i] * apart[:, j]).sum() for j in range(3)] for i in range(3)])
        motion = np.eye(4)
        motion[:3, :3] = nearest_rotation(moments[None])[0].T
        motion[3, :3] = center - transform_vectors(middle, motion)
        parent = Gf.Matrix4d(self._local_to_world(prim.GetParent(), frame))
        return np.array(Gf.Matrix4d(start) * Gf.Matrix4d(motion) * parent.GetInverse())

    def _in_own_space(
        self, solid: Solid | Passenger, frame: int, points: np.ndarray, velocities: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points and velocities in the space of the prim."""
        prim = self._source(solid)
        to_world = self._local_to_world(prim, frame)
        to_local = np.array(Gf.Matrix4d(to_world).GetInverse())
        local = transform_points(self.scene.space.point_to_world(points), to_local)
        # A prim that is itself animated carries its points along in the frame that follows; that part is not theirs.
        step = 0.01
        rate = (self._local_to_world(prim, frame + step) - np.array(to_world)) * (self.scene.fps / step)
        world_velocities = self.scene.space.velocity_to_world(velocities) - transform_points(local, rate)
        return local, transform_vectors(world_velocities, to_local)

    def _source(self, part: Solid | Passenger | Rider) -> Usd.Prim:
        """The prim of the scene that receives the points; the solid's where that prim is made for the cache."""
        stage = self.scene.stage
        return stage.GetPrimAtPath(part.output_path) or stage.GetPrimAtPath(part.path)

    @staticmethod
    def _local_to_world(prim: Usd.Prim, frame: float) -> np.ndarray:
        return np.array(UsdGeom.XformCache(Usd.TimeCode(frame)).GetLocalToWorldTransform(prim))

    def write_manifest_layer(self) -> None:
        """Writes the layer that tells which attributes the clips hold."""
        layer = Sdf.Layer.CreateAnonymous(".usda")
        for solid in self.scene.drawn:
            prim = Sdf.CreatePrimInLayer(layer, solid.output_path)
            for name, kind in _kinds(solid).items():
                if name != "normals" or solid.subdivision == "none":
                    Sdf.AttributeSpec(prim, name, kind)
        with files.replacing(self.folder / self.manifest_name) as temporary:
            files.export_layer(layer, temporary)

    def write_root(
        self,
        sublayer: str,
        last: int,
        vdb_frames: list[int],
        grids: list[str],
        data: dict[str, Any],
        left: dict[str, int],
    ) -> None:
        """Writes <scene>.usda for frames first..last. sublayer: relative path of the copied scene.

        data: provenance, stored as customLayerData["eulerfsi"]. left: solids and the frames from which on they, and
        what rides along with them, are invisible.
        """
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.subLayerPaths.append(sublayer)
        if made := instances_layer(self.scene.stage):
            for prim in made.rootPrims:
                Sdf.CopySpec(made, prim.path, layer, prim.path)
        self._write_stage_metadata(layer, last, data)
        for solid in self.scene.drawn:
            self._write_clips(layer, solid, last)
        for part in self.scene.simulated:
            carrier = part.solid if isinstance(part, Passenger) else part.path
            if carrier in left and part.output_path:
                self._hide(layer, part, left[carrier])
        if vdb_frames:
            self._write_volume(layer, vdb_frames, grids)
        with files.replacing(self.folder / f"{self.scene.name}.usda") as temporary:
            files.export_layer(layer, temporary)

    def _write_stage_metadata(self, layer: Sdf.Layer, last: int, data: dict[str, Any]) -> None:
        source = self.scene.stage.GetRootLayer().pseudoRoot
        root = layer.pseudoRoot
        for key in _STAGE_METADATA:
            if source.HasInfo(key):
                root.SetInfo(key, source.GetInfo(key))
        if not layer.HasDefaultPrim():
            layer.defaultPrim = Sdf.Path(self.volume_path or self.scene.domain_path).GetPrefixes()[0].name
        root.SetInfo("upAxis", UsdGeom.GetStageUpAxis(self.scene.stage))
        root.SetInfo("metersPerUnit", self.scene.units.meters_per_unit)
        root.SetInfo("kilogramsPerUnit", self.scene.units.kilograms_per_unit)
        layer.timeCodesPerSecond = self.scene.fps
        layer.framesPerSecond = self.scene.stage.GetFramesPerSecond()
        layer.startTimeCode, layer.endTimeCode = self.scene.frames.first, last
        layer.customLayerData = {**source.GetInfo("customLayerData"), "eulerfsi": _usd_dictionary(data)}

    def _write_clips(self, layer: Sdf.Layer, solid: Solid | Passenger | Rider, last: int) -> None:
        prim = Sdf.CreatePrimInLayer(layer, solid.output_path)
        if solid.surface_file:
            prim.specifier, prim.typeName = Sdf.SpecifierDef, "Mesh"
            for name, value in (("faceVertexCounts", solid.local.counts), ("faceVertexIndices", solid.local.indices)):
                Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.IntArray).default = Vt.IntArray.FromNumpy(value)
            scheme = Sdf.AttributeSpec(prim, "subdivisionScheme", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform)
            scheme.default = "none"
        else:
            _block_deformers(prim, self._source(solid))
            if solid.rigid:
                order = Sdf.AttributeSpec(prim, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
                order.default = Vt.TokenArray([_TRANSFORM])
                Sdf.AttributeSpec(prim, _TRANSFORM, Sdf.ValueTypeNames.Matrix4d)  # its values are the clips'
            if solid.subdivision:
                self._hold_topology(prim, solid)
        if solid.subdivision == "none":
            Sdf.AttributeSpec(prim, "normals", _TYPES["normals"]).SetInfo("interpolation", "vertex")
            self._block(prim, solid, "primvars:normals")  # would win over `normals` and show the old shape's shading
        self._block(prim, solid, "accelerations")  # belong to the old points
        prim.SetInfo("clipSets", Sdf.StringListOp.CreateExplicit([_CLIP_SET]))  # the scene's own clips do not act
        prim.SetInfo(
            "clips",
            {
                _CLIP_SET: {
                    "primPath": solid.output_path,
                    "templateAssetPath": f"./frames/{self.scene.name}.####.usdc",
                    "templateStartTime": float(self.scene.frames.first),
                    "templateEndTime": float(last),
                    "templateStride": 1.0,
                    "manifestAssetPath": Sdf.AssetPath(f"./frames/{self.scene.name}.manifest.usda"),
                }
            },
        )

    def _hide(self, layer: Sdf.Layer, part: Solid | Passenger, frame: int) -> None:
        """Invisible from a frame on; before that as the scene has it."""
        spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, part.output_path), "visibility", Sdf.ValueTypeNames.Token)
        own = self.scene.stage.GetAttributeAtPath(f"{part.output_path}.visibility")
        before = None
        for shown in range(self.scene.frames.first, frame):
            value = own.Get(shown) if own else UsdGeom.Tokens.inherited
            if value != before:
                layer.SetTimeSample(spec.path, shown, value)
            before = value
        layer.SetTimeSample(spec.path, frame, UsdGeom.Tokens.invisible)

    def _block(self, spec: Sdf.PrimSpec, solid: Solid | Passenger | Rider, name: str) -> None:
        """Takes away an attribute that the scene authors."""
        attribute = self._source(solid).GetAttribute(name)
        if attribute and attribute.HasAuthoredValue():
            Sdf.AttributeSpec(spec, name, attribute.GetTypeName()).default = Sdf.ValueBlock()

    def _hold_topology(self, spec: Sdf.PrimSpec, solid: Solid | Passenger | Rider) -> None:
        """Faces that change over time stay those of the first frame, to which the simulated points belong."""
        mesh = UsdGeom.Mesh(self._source(solid))
        for attribute, value in (
            (mesh.GetFaceVertexCountsAttr(), solid.local.counts),
            (mesh.GetFaceVertexIndicesAttr(), solid.local.indices),
        ):
            if attribute.ValueMightBeTimeVarying():
                own = Sdf.AttributeSpec(spec, attribute.GetName(), Sdf.ValueTypeNames.IntArray)
                own.default = Vt.IntArray.FromNumpy(value)

    def _write_volume(self, layer: Sdf.Layer, frames: list[int], grids: list[str]) -> None:
        """A Volume in world space (the grids' transforms say where it is) with one OpenVDBAsset per grid."""
        path = Sdf.Path(self.volume_path)
        if self._new_root:
            root = Sdf.CreatePrimInLayer(layer, path.GetParentPath())
            root.specifier, root.typeName = Sdf.SpecifierDef, "Xform"
        volume = Sdf.CreatePrimInLayer(layer, path)
        volume.specifier, volume.typeName = Sdf.SpecifierDef, "Volume"
        self._write_world_transform(layer, volume)
        box = np.array(np.meshgrid(*[(0.0, 1.0)] * 3)).reshape(3, -1).T
        corners = np.array(self.scene.domain["domain_min"]) + box * np.array(self.scene.domain["domain_size"])
        world = self.scene.space.point_to_world(corners)
        extent = Sdf.AttributeSpec(volume, "extent", _TYPES["extent"])
        extent.default = Vt.Vec3fArray.FromNumpy(np.stack([world.min(axis=0), world.max(axis=0)]).astype(np.float32))
        scale = Sdf.AttributeSpec(volume, DENSITY_SCALE, Sdf.ValueTypeNames.Float, declaresCustom=True)
        scale.default = _OPTICAL_DEPTH / float(max(self.scene.domain["domain_size"]))
        for grid in grids:
            asset = Sdf.CreatePrimInLayer(layer, path.AppendChild(grid))
            asset.specifier, asset.typeName = Sdf.SpecifierDef, "OpenVDBAsset"
            kind, role = _GRIDS[grid]
            tokens = {"fieldName": grid, "fieldDataType": kind}
            if grid == "density" or grid == "temperature":
                tokens["fieldClass"] = "fogVolume"
            if role:
                tokens["vectorDataRoleHint"] = role
            for name, value in tokens.items():
                Sdf.AttributeSpec(asset, name, Sdf.ValueTypeNames.Token).default = value
            Sdf.AttributeSpec(asset, "fieldIndex", Sdf.ValueTypeNames.Int).default = 0
            file = Sdf.AttributeSpec(asset, "filePath", Sdf.ValueTypeNames.Asset)
            for frame in frames:
                layer.SetTimeSample(file.path, frame, Sdf.AssetPath(f"./{self.vdb_name(frame)}"))
            field = Sdf.RelationshipSpec(volume, f"field:{grid}", custom=False)
            field.targetPathList.explicitItems = [asset.path]

    def _write_world_transform(self, layer: Sdf.Layer, volume: Sdf.PrimSpec) -> None:
        """Undoes the parents' transform, frame by frame where it is animated."""
        parent = self.scene.stage.GetPrimAtPath(volume.path.GetParentPath())
        if not parent:
            return
        matrices = dict(zip(self.scene.frames, map(np.array, places(parent, self.scene.frames)), strict=True))
        first = matrices[self.scene.frames.first]
        animated = any((matrix != first).any() for matrix in matrices.values())
        if not animated and (first == np.eye(4)).all():
            return
        order = Sdf.AttributeSpec(volume, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
        order.default = Vt.TokenArray(["xformOp:transform"])
        op = Sdf.AttributeSpec(volume, "xformOp:transform", Sdf.ValueTypeNames.Matrix4d)
        if not animated:
            op.default = Gf.Matrix4d(first).GetInverse()
        else:
            for frame, matrix in matrices.items():
                layer.SetTimeSample(op.path, frame, Gf.Matrix4d(matrix).GetInverse())


def _block_deformers(spec: Sdf.PrimSpec, prim: Usd.Prim) -> None:
    """Keeps clients from deforming the simulated points of a mesh once more: no skinning, no blend shapes.

    Some clients look for a skeleton, which may be inherited, others for weights, others place the mesh by the bind
    transform. The schema must be there: without it no opinion on the mesh stops those that it inherits.
    """
    if not (UsdSkel.Root.Find(prim) or prim.HasAPI(UsdSkel.BindingAPI)):
        return
    if not prim.HasAPI(UsdSkel.BindingAPI):
        spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["SkelBindingAPI"]))
    for name in ("skel:skeleton", "skel:animationSource", "skel:blendShapeTargets"):
        targets = Sdf.RelationshipSpec(spec, name, custom=False).targetPathList
        targets.ClearEditsAndMakeExplicit()
    kinds = Sdf.ValueTypeNames
    for name, kind in (
        ("primvars:skel:jointIndices", kinds.IntArray),
        ("primvars:skel:jointWeights", kinds.FloatArray),
        ("primvars:skel:geomBindTransform", kinds.Matrix4d),
        ("skel:blendShapes", kinds.TokenArray),
    ):
        Sdf.AttributeSpec(spec, name, kind).default = Sdf.ValueBlock()


def _volume_place(stage: Usd.Stage, domain_path: str) -> tuple[str, bool]:
    """Path of the Volume, and whether a new root prim must be made for it.

    It lies below the default prim (else the domain's root prim), so that a reference to the cache brings it along; not
    below a Gprim, where nothing that is drawn may be nested.
    """
    for prim in (stage.GetDefaultPrim(), stage.GetPrimAtPath(Sdf.Path(domain_path).GetPrefixes()[0])):
        if prim and not prim.IsA(UsdGeom.Gprim) and not prim.IsInstance():
            return str(prim.GetPath().AppendChild(_free_name(stage, prim.GetPath(), "smoke"))), False
    root = Sdf.Path.absoluteRootPath.AppendChild(_free_name(stage, Sdf.Path.absoluteRootPath, "EulerFsiCache"))
    return str(root.AppendChild("smoke")), True


def _free_name(stage: Usd.Stage, parent: Sdf.Path, name: str) -> str:
    number, candidate = 1, name
    while stage.GetPrimAtPath(parent.AppendChild(candidate)):
        number, candidate = number + 1, f"{name}{number}"
    return candidate


def _usd_dictionary(data: dict[str, Any]) -> dict[str, Any]:
    """Python values as a USD dictionary holds them: lists of numbers become arrays."""
    result: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, dict):
            result[key] = _usd_dictionary(value)
        elif isinstance(value, (list, tuple)):
            result[key] = Vt.DoubleArray([float(v) for v in value])
        else:
            result[key] = value
    return result
