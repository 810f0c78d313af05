"""Colliders that deform: their points over time, whether those can be followed, and what they come from."""

from __future__ import annotations

import hashlib

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from .gprims import surface_of
from .issues import Issue, make_issue
from .pose import Pose, PoseError
from .transforms import first_change, frames_of, key_frames, motion_text, motions, moves, place_attributes, stretched

SAME = 1e-6  # of the extent of a mesh: points that move less stay where they are


def points_move(prim: Usd.Prim) -> bool:
    """Whether its points move in its own space. Raises PoseError."""
    if not _may_deform(prim):
        return False
    first, *frames = _key_frames(prim)
    pose = Pose(prim, True)
    start = pose.points(Usd.TimeCode(first))
    least = SAME * np.ptp(start, axis=0).max()

    def moved(frame: float) -> bool:
        """What cannot be posed is looked at where it is simulated."""
        try:
            points = pose.points(Usd.TimeCode(frame))
        except PoseError:
            return False
        return len(points) == len(start) and bool(np.abs(points - start).max() > least)

    return any(moved(frame) for frame in frames)


def stretches(prim: Usd.Prim) -> bool:
    """Whether its transform is not rigid from the first frame on."""
    first, *frames = key_frames(prim.GetStage(), place_attributes(prim))
    return moves(prim) and bool(stretched(motions(prim, frames, first)).any())


def points_at(prim: Usd.Prim, frame: float) -> np.ndarray:
    """(n, 3) in its local space. Raises PoseError."""
    if prim.IsA(UsdGeom.TetMesh):
        return np.asarray(UsdGeom.TetMesh(prim).GetPointsAttr().Get(frame), float)
    return surface_of(prim, Usd.TimeCode(frame))[0]


def _may_deform(prim: Usd.Prim) -> bool:
    if prim.IsA(UsdGeom.TetMesh):
        return UsdGeom.TetMesh(prim).GetPointsAttr().ValueMightBeTimeVarying()
    if not prim.IsA(UsdGeom.Mesh):
        return False
    return UsdGeom.Mesh(prim).GetPointsAttr().ValueMightBeTimeVarying() or bool(Pose(prim, True).skeleton)


def _key_frames(prim: Usd.Prim) -> list[float]:
    """The first frame, and those that show how its points move, whatever frames are simulated."""
    sources = _sources(prim)
    own = [attribute for source in sources for attribute in source.GetAuthoredAttributes()]
    return key_frames(prim.GetStage(), [*own, *(part for source in sources for part in place_attributes(source))])


def shape_digest(prim: Usd.Prim) -> bytes:
    """Of all values that its points follow from: equal ones are equal points, whatever frames are simulated."""
    digest = hashlib.sha256(motion_text(prim).encode())
    for source in _sources(prim):
        digest.update(motion_text(source).encode())
        for attribute in source.GetAuthoredAttributes():
            for time in attribute.GetTimeSamples() or [Usd.TimeCode.Default()]:
                value = attribute.Get(time)
                digest.update(f"{attribute.GetPath()} {time} {type(value).__name__}".encode())
                digest.update(np.asarray(value).tobytes() if hasattr(value, "__len__") else str(value).encode())
    return digest.digest()


def _sources(prim: Usd.Prim) -> list[Usd.Prim]:
    """The prim; of a skinned mesh also its skeleton, the animation of that, and its blend shapes."""
    pose = Pose(prim, True) if prim.IsA(UsdGeom.Mesh) else None
    if pose is None or not pose.skeleton:
        return [prim]
    stage = prim.GetStage()
    skeleton = stage.GetPrimAtPath(pose.skeleton)
    animation = UsdSkel.BindingAPI(skeleton).GetInheritedAnimationSource()
    shapes = UsdSkel.BindingAPI(prim).GetBlendShapeTargetsRel().GetTargets()
    found = [prim, skeleton, animation, *(stage.GetPrimAtPath(shape) for shape in shapes)]
    return [source for source in found if source]


def check_shape_over_time(prim: Usd.Prim) -> list[Issue]:
    """Faces and number of points of a collider's Mesh are the same in all frames, and it does not turn inside out."""
    first, *frames = frames_of(prim.GetStage())
    mesh = UsdGeom.Mesh(prim)
    changed = first_change(prim, (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()))
    if changed:
        limit = "the same in all frames: the points of a collider may move, its faces may not change"
        return [_named(prim, *changed, limit, "ChangingCollider")]
    if not _may_deform(prim):
        return []
    pose = Pose(prim, True)
    start, counts, indices = surface_of(prim, Usd.TimeCode(first))
    triangles = _fans(counts, indices)
    volume = _volume(start, triangles)
    for frame in frames:
        issue = _check_frame(pose, frame, first, len(start), triangles, volume)
        if issue:
            return [issue]
    return []


def _check_frame(
    pose: Pose, frame: float, first: float, count: int, triangles: np.ndarray, volume: float
) -> Issue | None:
    """count, volume: points and volume at the first frame."""
    prim = pose.prim
    authored = UsdGeom.Mesh(prim).GetPointsAttr().Get(frame)
    if len(authored or ()) != count:  # looked at first: no skinning fits another number
        value = f"{len(authored or ())} points at frame {frame:g}, {count} at frame {first:g}"
        limit = "the same number in all frames: the points of a collider may move, their number may not change"
        return _named(prim, "points", value, limit, "ChangingCollider")
    try:
        points = pose.points(Usd.TimeCode(frame))
    except PoseError as error:
        limit = f"a skinning that UsdSkel can compute at frame {frame:g}"
        return _named(prim, "skel:skeleton", pose.skeleton, limit, "BadSkinning", str(error))
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        value = tuple(float(x) for x in points[bad[0]])
        limit = f"finite at frame {frame:g} ({len(bad)} of {len(points)} points are not)"
        return _named(prim, f"points[{bad[0]}]", value, limit, "NonFinitePoints")
    now = _volume(points, triangles)
    if not now * volume > 0.0:
        value = f"a volume of {now:.4g} at frame {frame:g}, {volume:.4g} at frame {first:g}"
        limit = "a volume of the same sign in all frames: a collider cannot vanish or turn inside out"
        return _named(prim, "points", value, limit, "InvertedCollider")
    return None


def check_stretch(prim: Usd.Prim) -> list[Issue]:
    """The transform of a collider may stretch it, but not mirror or flatten it."""
    first, *frames = frames_of(prim.GetStage())
    determinants = np.linalg.det(motions(prim, frames if moves(prim) else (), first)[:, :3, :3])
    bad = np.flatnonzero(~(determinants > 0.0))
    if not len(bad):
        return []
    value = f"a volume of {determinants[bad[0]]:.4g} at frame {frames[bad[0]]:g} over that at frame {first:g}"
    limit = "> 0: a collider cannot vanish or turn inside out"
    return [_named(prim, "xformOpOrder", value, limit, "InvertedCollider")]


def _named(prim: Usd.Prim, field: str, value: object, limit: str, code: str, hint: str = "") -> Issue:
    """An issue that names the file in which the attribute is authored."""
    attribute = prim.GetAttribute(field.partition("[")[0])
    stack = attribute.GetPropertyStack() if attribute else []
    file = stack[0].layer.GetDisplayName() if stack else prim.GetStage().GetRootLayer().GetDisplayName()
    return make_issue(prim, field, value, limit, code, f"{hint}; in {file}" if hint else f"in {file}")


def _fans(counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """(m, 3) triangles of the faces, each a fan around its first corner."""
    first, before = (np.repeat(np.cumsum(sizes) - sizes, counts - 2) for sizes in (counts, counts - 2))
    step = np.arange(1, len(before) + 1) - before
    return indices[np.stack([first, first + step, first + step + 1], axis=1)]


def _volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Signed."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a - points[0], np.cross(b - points[0], c - points[0]))) / 6.0
