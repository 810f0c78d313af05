"""What of a scene can have no effect: emitters inside colliders, pins that leave the box."""

from __future__ import annotations

import numpy as np
from eulerfsi_usd.issues import Issue

from ..solver import binding
from ..solver.simulation import Mesh
from .parts import Collider, Emitter, Pin, Scene, domain_box

_SPLITS = 4  # of the edges of a triangle, at whose parts a surface is looked at
_MOST = 4000  # points of a surface that are looked at
_SHRUNK = 1e-3  # by which a region is made smaller: one as large as the collider lies inside it
_AT_ONCE = 2_000_000  # pairs of points and triangles


def check_idle(scene: Scene) -> list[Issue]:
    """Warns of emitters whose whole region is inside a collider, and of pins that let go as they leave the box."""
    issues = []
    for emitter in scene.emitters:
        issues += _check_emitter(scene, emitter)
    for pin in scene.pins:
        issues += _check_pin(scene, pin)
    return issues


def _check_emitter(scene: Scene, emitter: Emitter) -> list[Issue]:
    points = _region_points(scene, emitter.hull)
    for collider in scene.colliders:
        if not _stays(collider, emitter) or not _contains(collider.mesh, points):
            continue
        limit = f"at least partly outside the collider {collider.path}"
        message = (
            f"{emitter.path}: the whole region of the emitter lies inside {collider.path}: must be {limit}, where "
            "there is no fluid to carry smoke; move it or make it larger"
        )
        value = f"inside {collider.path}"
        return [Issue(emitter.path, "xformOpOrder", value, limit, message, "warning", "IdleEmitter")]
    return []


def _stays(collider: Collider, emitter: Emitter) -> bool:
    """Whether it is where it starts while the emitter is on."""
    once = emitter.values["mode"] == binding.EMITTER_MODES["initial"]
    return once or not (collider.motion.moves or collider.shape or emitter.stays)


def _region_points(scene: Scene, hull: Mesh) -> np.ndarray:
    """(n, 3) points all over the surface of a region, of what lies outside the box the nearest cell centres."""
    steps = range(_SPLITS + 1)
    weights = np.array([(i, j, _SPLITS - i - j) for i in steps for j in steps if i + j <= _SPLITS]) / _SPLITS
    corners = hull.points[hull.triangles()].astype(float)
    points = np.einsum("sk,tkc->tsc", weights, corners).reshape(-1, 3)
    points = points[:: 1 + len(points) // _MOST]
    middle = points.mean(axis=0)
    (low, high), half = domain_box(scene.domain), scene.domain["voxel_size"] / 2
    return np.clip(points + (middle - points) * _SHRUNK, low + half, high - half)


def _contains(mesh: Mesh, points: np.ndarray) -> bool:
    """Whether all points are inside a closed surface: its solid angle seen from there is that of a whole sphere."""
    if (points < mesh.points.min(axis=0)).any() or (points > mesh.points.max(axis=0)).any():
        return False
    corners = mesh.points[mesh.triangles()].astype(float)
    some = max(1, _AT_ONCE // len(corners))
    parts = (points[start : start + some] for start in range(0, len(points), some))
    return all((_solid_angles(corners, part) > 2.0 * np.pi).all() for part in parts)


def _solid_angles(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) of triangles (m, 3, 3) with normals that point away (van Oosterom and Strackee 1983)."""
    a, b, c = (corners[None, :, k] - points[:, None] for k in range(3))
    x, y, z = (np.sqrt((side * side).sum(axis=2)) for side in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=2)
    rest = x * y * z + (a * b).sum(axis=2) * z + (b * c).sum(axis=2) * x + (c * a).sum(axis=2) * y
    return 2.0 * np.arctan2(volume, rest).sum(axis=1)


def _check_pin(scene: Scene, pin: Pin) -> list[Issue]:
    """What it holds of its solid stays in the box, at least in part."""
    if not pin.motion.moves:
        return []
    solid = next(solid for solid in scene.solids if solid.path == pin.solid)
    points = solid.mesh.points if pin.vertices is None else solid.mesh.points[pin.vertices]
    ends = points.min(axis=0), points.max(axis=0)
    if pin.mesh:
        ends = np.maximum(ends[0], pin.mesh.points.min(axis=0)), np.minimum(ends[1], pin.mesh.points.max(axis=0))
    corners = np.array([[ends[at >> axis & 1][axis] for axis in range(3)] for at in range(8)], float)
    low, high = domain_box(scene.domain)
    for frame in scene.frames:
        pose = pin.motion.pose(frame)
        now = corners @ pose[:3, :3].T + pose[:3, 3]
        if (now.max(axis=0) < low).any() or (now.min(axis=0) > high).any():
            return [_let_go(scene, pin, frame)]
    return []


def _let_go(scene: Scene, pin: Pin, frame: int) -> Issue:
    what = "its pinned vertices are" if pin.vertices is not None else f"the volume of its pin {pin.path} is"
    limit = f"at least partly inside the domain {scene.domain_path}"
    message = (
        f"{pin.solid}: frame {frame}: {what} moved out of the box by {pin.motion.driver} and hold"
        f"{'s' if pin.mesh else ''} nothing from there on: must be {limit}; use a larger domain, or a shorter way"
    )
    field = "eulerfsi:pinTo" if pin.vertices is not None else "eulerfsi:pins"
    return Issue(pin.solid, field, f"outside at frame {frame}", limit, message, "warning", "PinLeavesDomain")
