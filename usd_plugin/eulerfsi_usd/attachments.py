"""Attachments of the proposed standard: points of a body that are held by a prim with a transform."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from . import standard
from .deformables import Body, points_now, simulated_bodies, tet_indices
from .given import check_motion
from .issues import Issue, all_prims, first_time, make_issue, read, scopes_of

_CORNERS = {"point": 1, "face": 3, "tetrahedron": 4}


@dataclass(frozen=True)
class Attachment:
    """A hard attachment of a body to a prim. held: (n,) bool, the points of the sim mesh that it holds."""

    prim: Usd.Prim
    body: Body
    target: Usd.Prim
    held: np.ndarray


def find_attachments(stage: Usd.Stage) -> list[Attachment]:
    """Those that pin a simulated body; valid ones only."""
    bodies = {body.sim: body for body in simulated_bodies(stage)}
    found = []
    for prim in _enabled(stage):
        source, target = _ends(prim)
        pins = source in bodies and target and _is_anchor(prim, target) and _stiffness(prim) != 0.0
        if pins and not _check(prim, bodies[source], target):
            corners = _site_corners(prim, bodies[source])
            held = np.zeros(len(points_now(source)), bool)
            held[corners.ravel()] = True
            found.append(Attachment(prim, bodies[source], target, held))
    return found


def check_attachments(stage: Usd.Stage) -> list[Issue]:
    """Errors of those that pin a body, warnings of the others."""
    bodies = {body.sim: body for body in simulated_bodies(stage)}
    issues = []
    for prim in _enabled(stage):
        source, target = _ends(prim)
        field = f"physics:{standard.SOURCES[0]}"
        if source is None or target is None:
            missing = field if source is None else f"physics:{standard.SOURCES[1]}"
            issues.append(make_issue(prim, missing, "no such prim", "one prim that is there", "MissingTarget"))
        elif source not in bodies:
            limit = "the TetMesh of a volume body that is simulated; the attachment is ignored"
            issues.append(_warn(prim, field, source.GetPath(), limit))
        elif not _is_anchor(prim, target):
            limit = f"{target.GetPath()} must be a prim with a transform (type1 = xform); the attachment is ignored"
            issues.append(_warn(prim, f"physics:{standard.TYPES[1]}", _token(prim, 1), limit))
        elif _stiffness(prim) == 0.0:
            limit = "above 0, since it holds nothing; the attachment is ignored"
            issues.append(_warn(prim, f"physics:{standard.STIFFNESS}", 0, limit))
        else:
            issues += _check(prim, bodies[source], target) or _check_places(prim, bodies[source], target)
            issues += _check_soft(prim) + check_motion(target)
    return issues


def _warn(prim: Usd.Prim, field: str, value: object, limit: str, code: str = "IgnoredAttachment") -> Issue:
    return make_issue(prim, field, value, limit, code, "", "warning")


def _enabled(stage: Usd.Stage) -> list[Usd.Prim]:
    time = first_time(stage)
    found = [prim for prim in all_prims(stage) if str(prim.GetTypeName()) == standard.ATTACHMENT]
    return [prim for prim in found if standard.value(prim, standard.ATTACHED, time, True)]


def _ends(prim: Usd.Prim) -> tuple[Usd.Prim | None, Usd.Prim | None]:
    return tuple(next(iter(standard.targets(prim, name)), None) for name in standard.SOURCES)


def _token(prim: Usd.Prim, end: int) -> str:
    return str(standard.value(prim, standard.TYPES[end], None, "") or "")


def _is_anchor(prim: Usd.Prim, target: Usd.Prim) -> bool:
    return _token(prim, 1) == "xform" and target.IsA(UsdGeom.Xformable) and "solid" not in scopes_of(target)


def _array(prim: Usd.Prim, name: str) -> np.ndarray:
    return np.asarray(standard.value(prim, name, first_time(prim.GetStage()), ()))


def _check(prim: Usd.Prim, body: Body, target: Usd.Prim) -> list[Issue]:
    """Sites that are there, and a stiffness."""
    if not _stiffness(prim) >= 0.0:
        limit = "a number >= 0, or inf"
        return [make_issue(prim, f"physics:{standard.STIFFNESS}", _stiffness(prim), limit, "BadAttachment")]
    kind, indices = _token(prim, 0), _array(prim, standard.INDICES[0])
    if kind not in _CORNERS:
        limit = f"one of {', '.join(_CORNERS)}"
        return [make_issue(prim, f"physics:{standard.TYPES[0]}", kind or "empty", limit, "BadAttachment")]
    if not len(indices):
        return [make_issue(prim, f"physics:{standard.INDICES[0]}", "empty", "the sites that it holds", "BadAttachment")]
    most = len(_elements(body, kind))
    bad = indices[(indices < 0) | (indices >= most)]
    if len(bad):
        limit = f"between 0 and {most - 1}, a {kind} of {body.sim.GetPath()}"
        return [make_issue(prim, f"physics:{standard.INDICES[0]}", int(bad[0]), limit, "BadAttachment")]
    for end, needed in ((0, kind != "point"), (1, True)):
        count = len(_array(prim, standard.COORDS[end]))
        if needed and count not in ((len(indices), 0) if end else (len(indices),)):
            limit = f"{len(indices)}, one per site"
            return [make_issue(prim, f"physics:{standard.COORDS[end]}", f"{count} values", limit, "BadAttachment")]
    return []


def _elements(body: Body, kind: str) -> np.ndarray:
    """(n, corners) points of the sites of one kind."""
    if kind == "point":
        return np.arange(len(points_now(body.sim)))[:, None]
    if kind == "tetrahedron":
        return tet_indices(body.sim)
    faces = UsdGeom.TetMesh(body.sim).GetSurfaceFaceVertexIndicesAttr().Get(first_time(body.sim.GetStage()))
    return np.asarray(faces if faces is not None else (), np.int64).reshape(-1, 3)


def _site_corners(prim: Usd.Prim, body: Body) -> np.ndarray:
    return _elements(body, _token(prim, 0))[_array(prim, standard.INDICES[0])]


def _sites(prim: Usd.Prim, body: Body) -> np.ndarray:
    """(n, 3) in the space of the sim mesh."""
    kind, corners = _token(prim, 0), points_now(body.sim)[_site_corners(prim, body)]
    if kind == "point":
        return corners[:, 0]
    coords = np.asarray(_array(prim, standard.COORDS[0]), float).reshape(-1, 3)
    u, v, w = (coords[:, k : k + 1] for k in range(3))
    if kind == "tetrahedron":
        return u * corners[:, 0] + v * corners[:, 1] + w * corners[:, 2] + (1 - u - v - w) * corners[:, 3]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if UsdGeom.TetMesh(body.sim).GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        normal = -normal
    normal = normal / np.sqrt((normal * normal).sum(axis=1, keepdims=True))
    return u * corners[:, 0] + v * corners[:, 1] + (1 - u - v) * corners[:, 2] + w * normal


def _check_places(prim: Usd.Prim, body: Body, target: Usd.Prim) -> list[Issue]:
    """Each site is where its anchor is, to half a voxel: it is held there from the start."""
    stage = prim.GetStage()
    domains = [p for p in all_prims(stage) if "domain" in scopes_of(p)]
    voxel = read(domains[0], "eulerfsi:voxelSize") if len(domains) == 1 else None
    if not isinstance(voxel, (int, float)) or not 0.0 < voxel < math.inf:
        return []
    cache = UsdGeom.XformCache(first_time(stage))
    to_world = [np.array(cache.GetLocalToWorldTransform(p)) for p in (body.sim, target)]
    coords = np.asarray(_array(prim, standard.COORDS[1]), float).reshape(-1, 3)
    sites = _sites(prim, body)
    anchors = coords if len(coords) else np.zeros_like(sites)
    places = [x @ m[:3, :3] + m[3, :3] for x, m in zip((sites, anchors), to_world, strict=True)]
    apart = np.sqrt(((places[0] - places[1]) ** 2).sum(axis=1))
    worst = int(apart.argmax())
    if apart[worst] <= 0.5 * voxel:
        return []
    field, value = f"physics:{standard.COORDS[1]}[{worst}]", f"{apart[worst]:.4g} from its site"
    limit = f"at most half a voxel, {0.5 * voxel:g} (eulerfsi:voxelSize of {domains[0].GetPath()})"
    return [make_issue(prim, field, value, limit, "FarAnchor")]


def _stiffness(prim: Usd.Prim) -> float:
    return float(standard.value(prim, standard.STIFFNESS, first_time(prim.GetStage()), math.inf))


def _check_soft(prim: Usd.Prim) -> list[Issue]:
    """A warning of a soft attachment: it is held hard."""
    value = _stiffness(prim)
    if not 0.0 < value < math.inf:
        return []
    limit = "inf; soft attachments are not simulated, it holds hard, and its damping has no effect"
    return [_warn(prim, f"physics:{standard.STIFFNESS}", value, limit, "SoftAttachment")]
