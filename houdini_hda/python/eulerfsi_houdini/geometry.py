"""Polygons of SOPs in world space: where they come from, their pieces, and how a piece moves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import hou
import numpy as np

from .faults import Fault

# A piece whose points stay within this part of its size of a rigid motion is rigid; points have single precision.
RIGID, SINGLE = 1e-5, 4e-7


@dataclass
class Source:
    """Where polygons come from: an input of the node, or a SOP that a parameter names."""

    label: str
    geometry: Callable[[float], hou.Geometry | None]
    place: Callable[[float], np.ndarray]  # 4 x 4, for row vectors, as in USD
    _points: dict[int, np.ndarray] = field(default_factory=dict)

    def cooked(self, frame: float) -> hou.Geometry:
        geometry = self.geometry(frame)
        if geometry is None:
            raise Fault(f"{self.label}: does not cook at frame {frame:g}")
        return geometry

    def points(self, frame: int) -> np.ndarray:
        """World space, n x 3."""
        if frame not in self._points:
            local = np.reshape(self.cooked(frame).pointFloatAttribValues("P"), (-1, 3))
            matrix = self.place(frame)
            self._points[frame] = local @ matrix[:3, :3] + matrix[3, :3]
        return self._points[frame]


@dataclass(eq=False)
class Piece:
    """Polygons that belong together. vertices: their points in the source, in ascending order."""

    name: str
    source: Source
    vertices: np.ndarray
    counts: list[int]
    indices: list[int]
    solids: str = ""  # the primitive attribute "solid": patterns of names

    def points(self, frame: int) -> np.ndarray:
        everything = self.source.points(frame)
        if len(everything) <= self.vertices[-1]:
            raise Fault(
                f"{self.source.label}: has {len(everything)} points at frame {frame}: its points must not change"
            )
        return everything[self.vertices]


def object_of(node: hou.OpNode) -> hou.ObjNode:
    """The object that a SOP is in."""
    parent = node.parent()
    while parent is not None and not isinstance(parent, hou.ObjNode):
        parent = parent.parent()
    if parent is None:
        raise Fault(f"{node.path()}: is in no object")
    return parent


def place_of(obj: hou.ObjNode) -> Callable[[float], np.ndarray]:
    """World transform of an object by frame."""
    return lambda frame: np.reshape(obj.worldTransformAtTime(hou.frameToTime(frame)).asTuple(), (4, 4))


def input_of(node: hou.SopNode, index: int) -> Source | None:
    """What is connected to an input, None where nothing is."""
    if node.input(index) is None:
        return None
    label = f"{node.path()}, input {index + 1}"
    return Source(label, lambda frame: node.inputGeometryAtFrame(frame, index), place_of(object_of(node)))


def sop_of(node: hou.SopNode, parameter: str, path: str) -> Source | None:
    """The SOP of a path, None for an empty one."""
    if not path:
        return None
    sop = node.node(path)
    if not isinstance(sop, hou.SopNode):
        raise Fault(f"{node.path()}.{parameter} = {path}: is no SOP")
    return Source(sop.path(), sop.geometryAtFrame, place_of(object_of(sop)))


def faces_of(source: Source, frame: float) -> list[list[int]]:
    """Numbers of points of each polygon, counter-clockwise from outside, as in USD; Houdini's turn clockwise."""
    faces = []
    for prim in source.cooked(frame).prims():
        if not isinstance(prim, hou.Polygon) or not prim.isClosed():
            raise Fault(f"{source.label}: primitive {prim.number()} is no closed polygon: convert it to polygons first")
        faces.append([vertex.point().number() for vertex in prim.vertices()][::-1])
    return faces


def pieces_of(source: Source, frame: int) -> list[Piece]:
    """A piece for each value of the primitive attribute "name", in order of appearance; without it one for each set of
    connected polygons, with no name."""
    faces, geometry = faces_of(source, frame), source.cooked(frame)
    named = geometry.findPrimAttrib("name") is not None
    labels: Iterable[object] = geometry.primStringAttribValues("name") if named else _connected(faces)
    belongs = geometry.primStringAttribValues("solid") if geometry.findPrimAttrib("solid") is not None else None
    groups: dict[object, list[int]] = {}
    for number, label in enumerate(labels):
        groups.setdefault(label, []).append(number)
    result = []
    for label, numbers in groups.items():
        members = [faces[number] for number in numbers]
        vertices, indices = np.unique([index for face in members for index in face], return_inverse=True)
        solids = belongs[numbers[0]] if belongs else ""
        counts = [len(face) for face in members]
        result.append(Piece(str(label) if named else "", source, vertices, counts, indices.tolist(), solids))
    return result


def _connected(faces: list[list[int]]) -> list[int]:
    """A number for each polygon that those have in common which share points, directly or by others."""
    parent: dict[int, int] = {}

    def root(point: int) -> int:
        while parent.setdefault(point, point) != point:
            parent[point] = parent[parent[point]]
            point = parent[point]
        return point

    for face in faces:
        for point in face[1:]:
            parent[root(point)] = root(face[0])
    return [root(face[0]) for face in faces]


def merged(pieces: list[Piece], name: str) -> Piece:
    """All pieces of one source as one."""
    vertices = np.unique(np.concatenate([piece.vertices for piece in pieces]))
    indices: list[int] = []
    for piece in pieces:
        indices += np.searchsorted(vertices, piece.vertices)[piece.indices].tolist()
    return Piece(name, pieces[0].source, vertices, [n for piece in pieces for n in piece.counts], indices)


def rigid_motion(start: np.ndarray, now: np.ndarray) -> np.ndarray | None:
    """The 4 x 4 matrix that moves points rigidly from one place to another, None where no rigid motion does."""
    middle, there = start.mean(axis=0), now.mean(axis=0)
    u, _, v = np.linalg.svd((start - middle).T @ (now - there))
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = rotation, there - middle @ rotation
    size = float(np.ptp(start, axis=0).max())
    error = float(np.abs(start @ rotation + matrix[3, :3] - now).max())
    return matrix if error <= RIGID * size + SINGLE * float(np.abs(now).max()) else None


@dataclass
class Motion:
    """Of a piece: by transforms where every frame is a rigid motion of the first, else by its points."""

    transforms: dict[int, np.ndarray]  # empty: it is at rest
    points: dict[int, np.ndarray]  # empty: it is rigid
    bent: int | None = None  # the first frame that is no rigid motion


def motion_of(piece: Piece, frames: range) -> Motion:
    start = piece.points(frames[0])
    places = {frame: piece.points(frame) for frame in frames}
    if all(np.array_equal(points, start) for points in places.values()):
        return Motion({}, {})
    transforms = {}
    for frame, points in places.items():
        matrix = rigid_motion(start, points)
        if matrix is None:
            return Motion({}, places, frame)
        transforms[frame] = matrix
    return Motion(transforms, {})
