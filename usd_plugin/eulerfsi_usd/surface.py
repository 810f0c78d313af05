"""Checks of a solid's surface: points, topology, surface file, place inside the domain."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .gprims import dimensions
from .issues import Issue, domain_box, first_time, make_issue, read, slab_axis
from .pose import Pose, PoseError, transform_drivers
from .subdivide import is_smooth, scheme_of

# Part of the box by which points may stick out of it through rounding of the transforms.
TOLERANCE = 1e-6


def surface_file(prim: Usd.Prim) -> Sdf.AssetPath | None:
    """eulerfsi:surfaceFile where it is authored and not empty."""
    value = read(prim, "eulerfsi:surfaceFile")
    return value if isinstance(value, Sdf.AssetPath) and value.path else None


def check_surface(prim: Usd.Prim) -> list[Issue]:
    """A surface file that exists, or a mesh with finite points and consistent topology."""
    asset = surface_file(prim)
    if asset:
        missing = not asset.resolvedPath
        limit = "a file that exists"
        return [make_issue(prim, "eulerfsi:surfaceFile", asset, limit, "MissingFile")] if missing else []
    if not prim.IsA(UsdGeom.Mesh):
        limit = "the path of a mesh file, because the prim is not a Mesh"
        return [make_issue(prim, "eulerfsi:surfaceFile", None, limit, "MissingMesh")]
    try:
        points, counts, indices = mesh_arrays(prim)
    except PoseError as error:
        limit = "a skinning that UsdSkel can compute"
        return [make_issue(prim, "skel:skeleton", Pose(prim, True).skeleton, limit, "BadSkinning", str(error))]
    if len(points) == 0 or len(counts) == 0:
        field = "points" if len(points) == 0 else "faceVertexCounts"
        limit = "the points and faces of a surface, or eulerfsi:surfaceFile"
        return [make_issue(prim, field, "empty", limit, "MissingMesh")]
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        value = tuple(float(x) for x in points[bad[0]])
        limit = f"finite ({len(bad)} of {len(points)} points are not)"
        return [make_issue(prim, f"points[{bad[0]}]", value, limit, "NonFinitePoints")]
    if counts.min() < 3:
        face = int(counts.argmin())
        return [make_issue(prim, f"faceVertexCounts[{face}]", int(counts[face]), ">= 3", "BadTopology")]
    if counts.sum() != len(indices):
        limit = f"{counts.sum()} indices, the sum of faceVertexCounts"
        return [make_issue(prim, "faceVertexIndices", f"{len(indices)} indices", limit, "BadTopology")]
    if indices.min() < 0 or indices.max() >= len(points):
        corner = int(np.flatnonzero((indices < 0) | (indices >= len(points)))[0])
        limit = f"between 0 and {len(points) - 1}"
        return [make_issue(prim, f"faceVertexIndices[{corner}]", int(indices[corner]), limit, "BadTopology")]
    return []


def mesh_arrays(prim: Usd.Prim) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 3) in local space as they are posed, face vertex counts (f,) and indices (k,), at the first time.

    Raises PoseError.
    """
    mesh, time = UsdGeom.Mesh(prim), first_time(prim.GetStage())
    points = Pose(prim, True).points(time)
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(time) or (), dtype=np.int64)
    indices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(time) or (), dtype=np.int64)
    return points, counts, indices


def check_inside(prim: Usd.Prim, domain: Usd.Prim) -> list[Issue]:
    """All points of a mesh lie inside the domain's box. Surface files, cages and faulty meshes are not looked at."""
    if surface_file(prim) or not prim.IsA(UsdGeom.Mesh) or is_smooth(prim):
        return []
    try:
        points, _, _ = mesh_arrays(prim)
    except PoseError:
        return []
    if len(points) == 0 or not np.isfinite(points).all():
        return []
    edges, domain_to_world = domain_box(domain)
    solid_to_world = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(first_time(prim.GetStage()))
    matrix = np.array(solid_to_world * domain_to_world.GetInverse())  # acts on row vectors
    # In units of the box, where it reaches from -1/2 to 1/2.
    local = (points @ matrix[:3, :3] + matrix[3, :3]) / np.array(edges)
    low, high = local.min(axis=0), local.max(axis=0)
    slab = slab_axis(domain)
    if slab is not None:
        if low[slab] > -0.5 + TOLERANCE or high[slab] < 0.5 - TOLERANCE:
            length = edges[slab] * domain_to_world.GetRow3(slab).GetLength()
            value = f"{(low[slab] + 0.5) * length:g} to {(high[slab] + 0.5) * length:g} along the box's {'xyz'[slab]}"
            limit = f"through the 2-D domain {domain.GetPath()}, 0 to {length:g}"
            return [make_issue(prim, "points", value, limit, "NotThroughSlab")]
        low[slab], high[slab] = -0.5, 0.5  # what lies beyond a slab does not count
    if low.min() >= -0.5 - TOLERANCE and high.max() <= 0.5 + TOLERANCE:
        return []
    axis = int(np.argmax(np.maximum(-0.5 - low, high - 0.5)))
    length = edges[axis] * domain_to_world.GetRow3(axis).GetLength()
    value = f"{(low[axis] + 0.5) * length:g} to {(high[axis] + 0.5) * length:g} along the box's {'xyz'[axis]}"
    limit = f"inside the domain {domain.GetPath()}, 0 to {length:g}"
    return [make_issue(prim, "points", value, limit, "OutsideDomain")]


def check_cages(prims: Iterable[Usd.Prim]) -> list[Issue]:
    """The scheme loop is one of triangles."""
    issues = []
    for prim in prims:
        if scheme_of(prim) != "loop" or surface_file(prim):
            continue
        counts = np.asarray(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get(first_time(prim.GetStage())) or (3,))
        other = np.flatnonzero(counts != 3)
        if len(other):
            limit = "3 with subdivisionScheme = loop; use catmullClark"
            field = f"faceVertexCounts[{other[0]}]"
            issues.append(make_issue(prim, field, int(counts[other[0]]), limit, "LoopFaces"))
    return issues


def check_skinning(prim: Usd.Prim) -> list[Issue]:
    """Warns of joint weights and blend shapes that USD does not apply: what is simulated is the mesh without them."""
    if not prim.IsA(UsdGeom.Mesh) or surface_file(prim):
        return []
    reason = Pose(prim, True).idle_skinning()
    if not reason:
        return []
    limit = "a skinning that USD applies"
    message = f"{prim.GetPath()}: is not skinned, its joint weights or blend shapes have no effect: {reason}"
    return [Issue(str(prim.GetPath()), "skel:skeleton", reason, limit, message, "warning", "IdleSkinning")]


def check_animation(prim: Usd.Prim, scope: str) -> list[Issue]:
    """Warns of what animates a prim: its pose and motion at the first time count, what follows does not."""
    time = first_time(prim.GetStage())
    after = -math.inf if time.IsEarliestTime() else time.GetValue()
    if scope == "solid":
        drivers = Pose(prim, prim.IsA(UsdGeom.Mesh) and not surface_file(prim)).drivers(after)
        effect = "it starts from that pose and motion at frame {}; later animation is ignored"
    else:
        drivers = Pose(prim, True).drivers(after) if prim.IsA(UsdGeom.Mesh) else transform_drivers(prim, after)
        if scope == "emitter" and read(prim, "eulerfsi:mode") != "initial":  # follows its transform
            drivers = [driver for driver in drivers if driver not in transform_drivers(prim, after)]
        drivers += [f"its {name}" for name in dimensions(prim) if prim.GetAttribute(name).ValueMightBeTimeVarying()]
        effect = "it is as it is at frame {}" if scope == "emitter" else "it stays where it is at frame {}"
    if not drivers:
        return []
    effect = effect.format("1" if time.IsEarliestTime() else f"{time.GetValue():g}")
    value = " and ".join(drivers)
    message = f"{prim.GetPath()}: is animated by {value}: {effect}"
    return [Issue(str(prim.GetPath()), "xformOpOrder", value, "constant", message, "warning", "AnimatedPrim")]
