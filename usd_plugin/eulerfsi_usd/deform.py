"""Colliders that deform: their points over time, whether those can be followed, and what they come from."""

from __future__ import annotations

import hashlib

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from .gprims import surface_of
from .issues import Issue, make_issue
from .pose import Pose, PoseError
from .transforms import first_change, frames_of, key_frames, motion, motion_text, moves, place_attributes, stretch

SAME = 1e-6  # of the extent of a mesh: points that move less stay where they are


def deforms(prim: Usd.Prim) -> bool:
    """Whether its points move in a way that its transform, as far as that is rigid, does not explain."""
    return stretches(prim) or points_move(prim)


def points_move(prim: Usd.Prim) -> bool:
    """Whether its points move in its own space. Raises PoseError."""
    if not _may_deform(prim):
        return False
    first, *frames = _key_frames(prim)
    start = Pose(prim, True).points(Usd.TimeCode(first))
    least = SAME * np.ptp(start, axis=0).max()

    def moved(frame: float) -> bool:
        """What cannot be posed is looked at where it is simulated."""
        try:
            points = Pose(prim, True).points(Usd.TimeCode(frame))
        except PoseError:
            return False
        return len(points) == len(start) and bool(np.abs(points - start).max() > least)

    return any(moved(frame) for frame in frames)


def stretches(prim: Usd.Prim) -> bool:
    """Whether its transform is not rigid from the first frame on."""
    first, *frames = key_frames(prim.GetStage(), place_attributes(prim))
    return moves(prim) and any(stretch(motion(prim, frame, first)) is not None for frame in frames)


def points_at(prim: Usd.Prim, frame: float) -> np.ndarray:
    """(n, 3) in its local space. Raises PoseError."""
    return surface_of(prim, Usd.TimeCode(frame))[0]


def _may_deform(prim: Usd.Prim) -> bool:
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
    start = Pose(prim, True).points(Usd.TimeCode(first))
    faces = surface_of(prim, Usd.TimeCode(first))[1:]
    for frame in frames:
        issue = _check_frame(prim, frame, first, start, faces)
        if issue:
            return [issue]
    return []


def _check_frame(
    prim: Usd.Prim, frame: float, first: float, start: np.ndarray, faces: tuple[np.ndarray, np.ndarray]
) -> Issue | None:
    authored = UsdGeom.Mesh(prim).GetPointsAttr().Get(frame)
    if len(authored or ()) != len(start):  # looked at first: no skinning fits another number
        value = f"{len(authored or ())} points at frame {frame:g}, {len(start)} at frame {first:g}"
        limit = "as many in all frames: the points of a collider may move, their number may not change"
        return _named(prim, "points", value, limit, "ChangingCollider")
    try:
        points = points_at(prim, frame)
    except PoseError as error:
        limit = f"a skinning that UsdSkel can compute at frame {frame:g}"
        return _named(prim, "skel:skeleton", Pose(prim, True).skeleton, limit, "BadSkinning", str(error))
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        value = tuple(float(x) for x in points[bad[0]])
        limit = f"finite at frame {frame:g} ({len(bad)} of {len(points)} points are not)"
        return _named(prim, f"points[{bad[0]}]", value, limit, "NonFinitePoints")
    volumes = [_volume(shape, *faces) for shape in (points, start)]
    if not volumes[0] * volumes[1] > 0.0:
        value = f"a volume of {volumes[0]:.4g} at frame {frame:g}, {volumes[1]:.4g} at frame {first:g}"
        limit = "a volume of the same sign in all frames: a collider cannot vanish or turn inside out"
        return _named(prim, "points", value, limit, "InvertedCollider")
    return None


def check_stretch(prim: Usd.Prim) -> list[Issue]:
    """The transform of a collider may stretch it, but not mirror or flatten it."""
    first, *frames = frames_of(prim.GetStage())
    for frame in frames if moves(prim) else ():
        determinant = float(np.linalg.det(motion(prim, frame, first)[:3, :3]))
        if not determinant > 0.0:
            value = f"a volume of {determinant:.4g} at frame {frame:g} over that at frame {first:g}"
            limit = "> 0: a collider cannot vanish or turn inside out"
            return [_named(prim, "xformOpOrder", value, limit, "InvertedCollider")]
    return []


def _named(prim: Usd.Prim, field: str, value: object, limit: str, code: str, hint: str = "") -> Issue:
    """An issue that names the file in which the attribute is authored."""
    attribute = prim.GetAttribute(field.partition("[")[0])
    stack = attribute.GetPropertyStack() if attribute else []
    file = stack[0].layer.GetDisplayName() if stack else prim.GetStage().GetRootLayer().GetDisplayName()
    return make_issue(prim, field, value, limit, code, f"{hint}; in {file}" if hint else f"in {file}")


def _volume(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> float:
    """Signed, of the fans of the faces."""
    first = np.repeat(np.cumsum(counts) - counts, counts - 2)
    step = np.concatenate([np.arange(1, count - 1) for count in counts]) if len(counts) else np.zeros(0, int)
    a, b, c = (points[indices[first + offset]] for offset in (0 * step, step, step + 1))
    return float(np.einsum("ij,ij->", a - points[0], np.cross(b - points[0], c - points[0]))) / 6.0
