"""What a cache draws beside smoke: meshes, shapes, curves and points, with their places in every frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from eulerfsi_usd import gprims
from eulerfsi_usd.deform import points_at
from eulerfsi_usd.pose import PoseError
from eulerfsi_usd.subdivide import Refinement, is_smooth
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade

from ..errors import CacheIOError
from ..reasons import usd_reason
from ..scene.space import transform_points
from ..solver import Mesh

MOST_FACES = 24_000  # of a cage that is refined for the page
_TRANSFORM = "xformOp:transform:eulerfsi"  # of a shape in a frame's layer
_PALETTE = ((0.72, 0.13, 0.06), (0.05, 0.26, 0.60), (0.80, 0.45, 0.05), (0.16, 0.42, 0.12), (0.38, 0.16, 0.50))
_GRAY, _WHITE = (0.30, 0.32, 0.35), (0.80, 0.80, 0.76)
_ROUGHNESS = 0.45
_CREASE = 0.77  # cosine between faces above which an edge is drawn smooth
_MOST_TURNS = 8  # of the search for the faces of a corner that are smooth to each other
_THIN = 0.004  # radius of curves and points without a width, of the domain's longest edge


@dataclasses.dataclass
class Item:
    """A prim that is drawn. form: "mesh", "curves" or "dots".

    triangles: (n, 3) corners of the shading; corners: the point of each, None where every point has one;
    frames: (frames, points, 3) world space, one frame where nothing moves; visible: per frame.
    """

    path: str
    kind: str
    form: str
    color: tuple[float, ...]
    roughness: float
    frames: np.ndarray
    visible: list[bool]
    triangles: np.ndarray
    corners: np.ndarray | None = None
    counts: list[int] = dataclasses.field(default_factory=list)
    width: float = 0.0  # of curves and points, world space


class FrameLayer:
    """What a run has written of one frame."""

    def __init__(self, path: Path, frame: int) -> None:
        """Raises CacheIOError that names the file."""
        self.path, self._frame = path, frame
        try:
            self._layer = Sdf.Layer.FindOrOpen(str(path))
        except Tf.ErrorException as error:
            raise CacheIOError(f"{path}: cannot be read: {usd_reason(error)}") from error
        if self._layer is None:
            raise CacheIOError(f"{path}: cannot be read")

    def value(self, prim: Sdf.Path, name: str) -> Any:
        """An attribute of a prim in it; None where it has none."""
        path = prim.AppendProperty(name)
        return self._layer.QueryTimeSample(path, self._frame) if self._layer.GetPropertyAtPath(path) else None


def drawn_prims(stage: Usd.Stage, domain: str) -> list[Usd.Prim]:
    """Gprims that a renderer would draw in some frame, without the domain, volumes of pins, and smoke."""
    pins = set()
    found = []
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
        if pinned := prim.GetRelationship("eulerfsi:pins"):
            pins.update(pinned.GetTargets())
        drawable = prim.IsA(UsdGeom.PointBased) or gprims.is_shape(prim)
        if drawable and str(prim.GetPath()) != domain and not _in_prototype(prim):
            found.append(prim)
    kinds = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
    return [p for p in found if p.GetPath() not in pins and UsdGeom.Imageable(p).ComputePurpose() in kinds]


def _in_prototype(prim: Usd.Prim) -> bool:
    """Below a PointInstancer nothing is drawn where it stands."""
    while prim and not prim.IsA(UsdGeom.PointInstancer):
        prim = prim.GetParent()
    return bool(prim)


class Reader:
    """Reads items of a stage at frames, with what the frames' layers say in place of the stage's own points."""

    def __init__(self, stage: Usd.Stage, frames: Sequence[int], layers: Sequence[FrameLayer], kinds: dict) -> None:
        """kinds: {path: what it is in the simulation}"""
        self.stage, self.frames, self.layers, self.kinds = stage, frames, layers, kinds
        self._colors = 0

    def item(self, prim: Usd.Prim, hidden_from: int | None) -> Item | None:
        """None for a prim without points or faces. hidden_from: frame in which its solid has left."""
        kind = self.kinds.get(str(prim.GetPath()), "scenery")
        visible = [self._is_visible(prim, frame, hidden_from) for frame in self.frames]
        if not any(visible):
            return None
        form, counts, triangles, refinement = self._topology(prim)
        frames = np.stack(list(self._places(prim, visible))).astype(np.float32)
        if refinement:
            frames = np.stack([refinement.points(points.astype(float)) for points in frames]).astype(np.float32)
        points = frames.shape[1]
        if not points or (form == "mesh" and not len(triangles)):
            return None
        if (form == "mesh" and int(triangles.max()) >= points) or (form == "curves" and sum(counts) != points):
            raise CacheIOError(
                f"{self.layers[0].path}: {prim.GetPath()}: {points} points do not fit its faces or curves"
            )
        if (frames == frames[:1]).all():
            frames = frames[:1]
        color, roughness = self._look(prim, kind)
        corners = None
        if form == "mesh" and UsdGeom.Gprim(prim).GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
            triangles = triangles[:, ::-1]
        if form == "mesh" and not refinement:
            triangles, corners = split_creases(frames[0], triangles)
        return Item(
            str(prim.GetPath()), kind, form, color, roughness, frames, visible, triangles, corners, counts, _width(prim)
        )

    def _is_visible(self, prim: Usd.Prim, frame: int, hidden_from: int | None) -> bool:
        if hidden_from is not None and frame >= hidden_from:
            return False
        return UsdGeom.Imageable(prim).ComputeVisibility(frame) != UsdGeom.Tokens.invisible

    def _topology(self, prim: Usd.Prim) -> tuple[str, list[int], np.ndarray, Refinement | None]:
        """Form, points of every curve, triangles, and what refines a cage."""
        first = Usd.TimeCode(self.frames[0])
        none = np.zeros((0, 3), np.int64)
        if prim.IsA(UsdGeom.Curves):
            counts = UsdGeom.Curves(prim).GetCurveVertexCountsAttr().Get(first) or ()
            return "curves", [int(n) for n in counts], none, None
        if prim.IsA(UsdGeom.TetMesh):
            mesh = UsdGeom.TetMesh(prim)
            faces = mesh.GetSurfaceFaceVertexIndicesAttr().Get(first)
            faces = faces or UsdGeom.TetMesh.ComputeSurfaceFaces(mesh, first)
            return "mesh", [], np.array(faces, np.int64).reshape(-1, 3), None
        if not (prim.IsA(UsdGeom.Mesh) or gprims.is_shape(prim)):
            return "dots", [], none, None
        points, counts, indices = self._surface(prim, first)
        refinement = None
        if is_smooth(prim) and len(counts):
            levels = max((n for n in (1, 2, 3) if len(counts) * 4**n <= MOST_FACES), default=0)
            refinement = Refinement(prim, first, len(points), levels) if levels else None
        if refinement:
            counts, indices = refinement.counts, refinement.indices
        triangles = Mesh(np.zeros((0, 3)), counts, indices).triangles().astype(np.int64)
        if prim.IsA(UsdGeom.Plane):  # of the slab that stands for it the face that is the plane
            triangles = triangles[(points[triangles] == 0).any(axis=2).all(axis=1)]
        return "mesh", [], triangles, refinement

    def _surface(self, prim: Usd.Prim, time: Usd.TimeCode) -> gprims.Surface:
        try:
            return gprims.surface_of(prim, time)
        except PoseError as error:
            raise CacheIOError(f"{prim.GetPath()}: frame {time.GetValue():g}: {error}") from error

    def _places(self, prim: Usd.Prim, visible: list[bool]) -> Iterator[np.ndarray]:
        """(points, 3) in world space, frame by frame; where it is not drawn those of the frame before or after."""
        own, transforms = None, UsdGeom.XformCache()
        shown = [i for i, on in enumerate(visible) if on]
        at = [max((i for i in shown if i <= frame), default=shown[0]) for frame in range(len(visible))]
        for index in at:
            frame, layer = self.frames[index], self.layers[index]
            transforms.SetTime(Usd.TimeCode(frame))
            written = layer.value(prim.GetPath(), "points")
            turned = layer.value(prim.GetPath(), _TRANSFORM)
            if written is not None:
                points = np.asarray(written, float)
            elif own is None or self._varies(prim):
                points = own = self._own_points(prim, frame)
            else:
                points = own
            if turned is None:
                place = transforms.GetLocalToWorldTransform(prim)
            else:
                place = Gf.Matrix4d(turned) * transforms.GetLocalToWorldTransform(prim.GetParent())
            yield transform_points(points.reshape(-1, 3), np.array(place))

    def _own_points(self, prim: Usd.Prim, frame: int) -> np.ndarray:
        if prim.IsA(UsdGeom.Mesh) or gprims.is_shape(prim):
            try:
                return points_at(prim, frame)
            except PoseError as error:
                raise CacheIOError(f"{prim.GetPath()}: frame {frame}: {error}") from error
        return np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get(frame) or (), float)

    def _varies(self, prim: Usd.Prim) -> bool:
        """Whether its points may change on the stage: by samples, or by a skeleton."""
        skinned = prim.IsA(UsdGeom.Mesh) and prim.HasAttribute("primvars:skel:jointIndices")
        return skinned or (
            prim.IsA(UsdGeom.PointBased) and UsdGeom.PointBased(prim).GetPointsAttr().ValueMightBeTimeVarying()
        )

    def _look(self, prim: Usd.Prim, kind: str) -> tuple[tuple[float, ...], float]:
        """Colour (linear) and roughness: of the bound material, else displayColor, else of the kind."""
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shader = material.ComputeSurfaceSource()[0] if material else None
        rough = _constant(shader, "roughness")
        roughness = _ROUGHNESS if rough is None else min(max(float(rough), 0.05), 1.0)
        color = _constant(shader, "diffuseColor")
        if color is None:
            shown = UsdGeom.Gprim(prim).GetDisplayColorAttr().Get(self.frames[0])
            color = np.asarray(shown, float).mean(axis=0) if shown else None
        if color is not None:
            return tuple(float(min(max(c, 0.0), 1.0)) for c in color), roughness
        if kind != "solid":
            return _WHITE if kind == "passenger" else _GRAY, roughness
        self._colors += 1
        return _PALETTE[(self._colors - 1) % len(_PALETTE)], roughness


def _constant(shader: UsdShade.Shader | None, name: str) -> Any:
    """An input that no texture or node drives."""
    source = shader.GetInput(name) if shader else None
    return source.Get() if source and not source.HasConnectedSource() else None


def _width(prim: Usd.Prim) -> float:
    """Mean width of curves and points in world space; 0 where none is authored."""
    if not (prim.IsA(UsdGeom.Curves) or prim.IsA(UsdGeom.Points)):
        return 0.0
    widths = prim.GetAttribute("widths").Get()
    place = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    return float(np.mean(widths)) * abs(np.linalg.det(place[:3, :3])) ** (1 / 3) if widths else 0.0


def radius(item: Item, edge: float) -> float:
    """Of curves and points, as a share of the domain's longest edge."""
    return max(item.width / (2 * edge), _THIN / 2) if item.width else _THIN


def split_creases(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Triangles of shading corners, and the point of each corner; None where no edge is sharp.

    Corners of a point share their normal where their faces are smooth to each other.
    """
    p = points.astype(float)
    a, b, c = (p[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.sqrt((normals * normals).sum(axis=1, keepdims=True))
    normals = np.repeat(normals / np.where(length > 0, length, 1), 3, axis=0)
    owners = triangles.ravel()
    group, left = np.full(len(owners), -1), np.arange(len(owners))
    for turn in range(_MOST_TURNS):
        if not len(left):
            break
        first = np.full(len(p), len(owners))
        np.minimum.at(first, owners[left], left)
        near = (normals[left] * normals[first[owners[left]]]).sum(axis=1) > _CREASE
        near |= (left == first[owners[left]]) | (turn == _MOST_TURNS - 1)
        group[left[near]] = turn
        left = left[~near]
    if not group.any():
        return triangles, None
    keys, corner = np.unique(owners * _MOST_TURNS + group, return_inverse=True)
    return corner.reshape(-1, 3), keys // _MOST_TURNS
