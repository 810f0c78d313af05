"""What is checked before anything is simulated: the stage (eulerfsi_usd) and what only the library can tell."""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from eulerfsi_usd.checks import check_stage
from eulerfsi_usd.issues import Issue, listed
from pxr import Usd

from ..command import command_line
from ..errors import CacheIOError, SceneError
from ..files import TEMPORARY_PREFIX
from ..solver import binding
from ..solver.simulation import Surface, slab_axis
from ..usd_messages import composition_faults
from . import memory
from .idle import check_idle
from .parts import Collider, Emitter, Scene, Solid, face_name, open_faces

__all__ = ["Issue", "check_output", "check_scene", "check_stage", "notes", "raise_errors", "stage_issues"]

# Part of the box by which a solid may reach out of it through rounding.
_TOLERANCE = 1e-6
# Voxels by which solids may overlap where they start; the library refuses more.
_MOST_OVERLAP = 0.5
# Voxels that a collider is thick at least: less lies between the cells that carry contact.
_LEAST_COLLIDER = 1.5
# Of the volume of a solid where it starts; the library refuses others.
_GROWTH = (0.1, 10.0)


def stage_issues(stage: Usd.Stage) -> list[Issue]:
    """Issues of the stage alone; first what it refers to and could not be brought in.

    That is a warning while the rest is sound and the cause a file that is missing or of a kind that USD has no plug-in
    for: a scene may refer to what a run does not need. A file that is there and broken cannot be copied into a cache.
    """
    issues = [_with_way_out(stage, issue) for issue in check_stage(stage)]
    unsound = any(issue.severity == "error" for issue in issues)
    faults = []
    for message, broken in composition_faults(stage):
        severity = "error" if broken or unsound else "warning"
        faults.append(Issue("/", "references", "unresolved", "a layer that USD opens", message, severity, "Unresolved"))
    return faults + issues


def _with_way_out(stage: Usd.Stage, issue: Issue) -> Issue:
    """The command that adds a domain, where there is none."""
    file = stage.GetRootLayer().realPath
    if issue.code != "MissingDomain" or not file:
        return issue
    name = Path(os.path.relpath(file))
    command = command_line("new", name.with_name(f"{name.stem}_fsi.usda"), "--from-usd", name)
    return dataclasses.replace(issue, message=f"{issue.message}; to add one: {command}")


def raise_errors(issues: Iterable[Issue]) -> list[Issue]:
    """Raises SceneError with all errors, one a line; returns the warnings."""
    issues = list(issues)
    errors = [issue for issue in issues if issue.severity == "error"]
    if errors:
        raise SceneError("\n".join(issue.message for issue in errors), errors)
    return issues


def notes(scene: Scene) -> list[str]:
    """What a user should know of a scene in which nothing is wrong."""
    preset, tolerance, texts = scene.domain["preset"], scene.domain["step_tolerance"], []
    if preset == binding.PRESETS["fast"] and not tolerance:
        texts.append("the preset fast is for layout: its long steps damp solids, above all where they meet something")
    if preset == binding.PRESETS["paper2016"] and tolerance:
        texts.append("eulerfsi:stepTolerance has no effect with the preset paper2016")
    return [f"{scene.domain_path}: {text}" for text in texts]


def check_scene(scene: Scene) -> list[Issue]:
    """Issues that need the library's view of the meshes: repairs, thin features, size."""
    issues = _check_walls(scene) + _check_numbers(scene) + _check_colliders(scene)
    for solid in scene.solids:
        issues += _check_flat(scene, solid)
        issues += _check_mesh(scene, solid)
        issues += _check_inside(scene, solid)
        issues += _check_periodic(scene, solid)
        issues += _check_stretch(scene, solid)
        issues += _check_compressible(scene, solid)
    for first, second in itertools.combinations(scene.solids, 2):
        issues += _check_apart(scene, first, second)
    for collider in scene.colliders:
        issues += _check_closed(collider)
        issues += _check_periodic(scene, collider)
        for solid in scene.solids:
            issues += _check_apart(scene, collider, solid)
    for emitter in scene.emitters:
        issues += _check_emitter(scene, emitter)
    return issues + check_idle(scene)


def _check_walls(scene: Scene) -> list[Issue]:
    """Velocities of the domain's faces have an effect, and what comes in can leave."""
    domain, unit = scene.domain, scene.units.meters_per_unit
    slab, kinds = slab_axis(domain), {number: name for name, number in binding.WALLS.items()}
    issues, net, gross, first = [], 0.0, 0.0, ""
    for face in range(6):
        normal, velocity = face // 2, domain[f"wall_velocity[{face}]"]
        field = f"eulerfsi:wallVelocity{face_name(face)}"
        wall = kinds[domain[f"wall[{face}]"]]
        across, along = velocity[normal] != 0.0, any(v != 0.0 for axis, v in enumerate(velocity) if axis != normal)
        limit = ""
        if (across or along) and not domain["ambient_fluid"]:
            limit = "0 without ambientFluid"
        elif (across or along) and wall in ("open", "periodic"):
            limit = f"0 on a face that is {wall}, not a wall"
        elif along and wall == "slip":
            limit = "0 along a slip wall, which does not drag the fluid (noSlip does)"
        elif across and normal == slab:
            limit = "0 across a 2-D domain"
        if limit:
            value = f"({', '.join(f'{v / unit:.4g}' for v in velocity)}) in the box's axes"
            message = f"{scene.domain_path}: {field} = {value}: must be {limit}"
            issues.append(Issue(scene.domain_path, field, value, limit, message, "error", "WallVelocity"))
        area = np.prod([edge for axis, edge in enumerate(domain["domain_size"]) if axis != normal])
        flux = (-1.0 if face % 2 else 1.0) * velocity[normal] * area
        net, gross, first = net + flux, gross + abs(flux), first or (field if flux else "")
    if not issues and abs(net) > 1e-6 * gross and not open_faces(domain):
        value = f"a net inflow of {net / unit**3:.4g}"
        limit = "0 in a box without an open face: open one, or add the opposite flux at another wall"
        message = f"{scene.domain_path}: {first}: {value} (volume per second): must be {limit}"
        issues.append(Issue(scene.domain_path, first, value, limit, message, "error", "TrappedInflow"))
    return issues


def _check_numbers(scene: Scene) -> list[Issue]:
    """Volumes can be read by every client that reads those of other frames."""
    first = scene.frames.first
    if first >= 0 or not scene.has_smoke:
        return []
    limit = ">= 0 for smoke in Blender, whose volume sequences do not support a sign in file names"
    message = f"stage: first frame {first}: must be {limit}"
    return [Issue("/", "startTimeCode", str(first), limit, message, "warning", "NegativeFrames")]


def _check_flat(scene: Scene, solid: Solid) -> list[Issue]:
    """In a 2-D scene nothing starts across the domain."""
    slab, issues = slab_axis(scene.domain), []
    if slab is None:
        return issues
    for name, field, axes in (
        ("velocity", "eulerfsi:velocity", [slab]),
        ("angular_velocity", "eulerfsi:angularVelocity", [axis for axis in range(3) if axis != slab]),
    ):
        values = np.array(solid.values[name], float)
        worst = max(axes, key=lambda axis: abs(values[axis]))
        if abs(values[worst]) <= _TOLERANCE * np.linalg.norm(values):
            continue
        scale = 1 / scene.units.meters_per_unit if name == "velocity" else 180 / np.pi
        value = f"{values[worst] * scale:.4g} along the box's {'xyz'[worst]}"
        limit = f"0 in a 2-D domain, one voxel thick along its {'xyz'[slab]}"
        message = f"{solid.path}: {field} = {value}: must be {limit}"
        issues.append(Issue(solid.path, field, value, limit, message, "error", "NotFlat"))
    return issues


def _check_mesh(scene: Scene, solid: Solid) -> list[Issue]:
    report, unit = solid.report, scene.units.meters_per_unit
    field = "eulerfsi:surfaceFile" if solid.surface_file else "points"
    where = f"{solid.path}{f' ({Path(solid.surface_file).name})' if solid.surface_file else ''}"
    issues = []
    if report["repaired"]:
        found = solid.surface.repairs
        message = f"{where}: the surface was repaired: {found}"
        if report["open_edges"]:
            message += f"; taken as a solid of volume {report['solid_volume'] / unit**3:.4g}"
        issues.append(Issue(solid.path, field, found, "a closed surface", message, "warning", "RepairedMesh"))
    if report["separate_pieces"] > 1:
        value, limit = str(report["separate_pieces"]), "one: give each piece a prim of its own"
        message = (
            f"{where}: the mesh has {value} pieces that do not touch: must be {limit}. Pieces of a solid share one map "
            "of the material, which is corrupted where they move relative to each other"
        )
        issues.append(Issue(solid.path, field, value, limit, message, "warning", "SeparatePieces"))
    thinnest = solid.start.report["thinnest_feature"]
    if 0 < thinnest < 2 * scene.domain["voxel_size"]:
        issues.append(_thin(scene, where, solid.path, field, thinnest, "two"))
    return issues


def _check_colliders(scene: Scene) -> list[Issue]:
    """What is thinner may lie between the cells that carry contact. One warning for all."""
    least = _LEAST_COLLIDER * scene.domain["voxel_size"]
    thin = [c for c in scene.colliders if 0 < c.report["thinnest_feature"] < least]
    if not thin:
        return []
    thin.sort(key=lambda collider: collider.report["thinnest_feature"])
    names, thinnest = listed([collider.path for collider in thin]), thin[0].report["thinnest_feature"]
    least, otherwise = f"{_LEAST_COLLIDER:g}", ", or solids may fall through"
    return [_thin(scene, names, thin[0].path, "points", thinnest, least, otherwise)]


def _thin(scene: Scene, where: str, path: str, field: str, thinnest: float, least: str, otherwise: str = "") -> Issue:
    """thinnest [m]; least: voxels that it must be."""
    unit = scene.units.meters_per_unit
    value, fitting = f"{thinnest / unit:.4g}", thinnest / 2 / unit
    limit = f"at least {least} voxels of {scene.domain['voxel_size'] / unit:.4g}{otherwise}"
    affordable = memory.cells(scene.domain, thinnest / 2) <= memory.MOST_CELLS
    advice = f"eulerfsi:voxelSize = {fitting:.3g} resolves it" if affordable else "too thin for a domain this large"
    message = f"{where}: the thinnest feature is {value}: must be {limit}; {advice}"
    return Issue(path, field, value, limit, message, "warning", "ThinFeature")


def _check_inside(scene: Scene, solid: Solid) -> list[Issue]:
    low, size = np.array(scene.domain["domain_min"]), np.array(scene.domain["domain_size"])
    start = np.subtract(solid.start.report["extent_min"], low)
    end = np.subtract(solid.start.report["extent_max"], low)
    if (start >= -_TOLERANCE * size).all() and (end <= (1 + _TOLERANCE) * size).all():
        return []
    unit, axis = scene.units.meters_per_unit, int(np.argmax(np.maximum(-start, end - size)))
    length, have = (end - start)[axis] / unit, size[axis] / unit
    value = f"{start[axis] / unit:.4g} to {end[axis] / unit:.4g} along the box's {'xyz'[axis]}"
    limit = f"inside the domain {scene.domain_path}, 0 to {have:.4g}"
    problem = f"the domain ({have:.4g}) is smaller than the solid ({length:.4g})" if length > have else "move it inside"
    message = f"{solid.path}: the solid reaches from {value}: must be {limit} ({problem})"
    field = "eulerfsi:surfaceFile" if solid.surface_file else "points"
    return [Issue(solid.path, field, value, limit, message, "error", "OutsideDomain")]


def _check_periodic(scene: Scene, body: Solid | Collider) -> list[Issue]:
    """A voxel lies between a body and periodic faces: their nodes are the same ones."""
    domain, unit = scene.domain, scene.units.meters_per_unit
    voxel, size = domain["voxel_size"], np.array(domain["domain_size"])
    report = _at_start(body).report
    low, high = (np.subtract(report[end], domain["domain_min"]) for end in ("extent_min", "extent_max"))
    for axis in range(3):
        field = f"eulerfsi:wall{face_name(2 * axis + (low[axis] > voxel))}"
        if domain[f"wall[{2 * axis}]"] != binding.WALLS["periodic"]:
            continue
        if voxel < low[axis] and high[axis] < size[axis] - voxel:
            continue
        value = f"{low[axis] / unit:.4g} to {high[axis] / unit:.4g} along the box's {'xyz'[axis]}"
        between = f"{voxel / unit:.4g} to {(size[axis] - voxel) / unit:.4g}"
        limit = f"more than a voxel away from the periodic faces ({field} of {scene.domain_path}), within {between}"
        message = (
            f"{body.path}: the {type(body).__name__.lower()} reaches from {value}: must be {limit}; "
            "use a larger box, or walls there"
        )
        return [Issue(body.path, field, value, limit, message, "error", "AtPeriodicFace")]
    return []


def _check_compressible(scene: Scene, solid: Solid) -> list[Issue]:
    """What shall change its volume has room for that."""
    domain = scene.domain
    if not solid.values["compressible"] or not domain["ambient_fluid"] or open_faces(domain):
        return []
    field, value = "eulerfsi:compressible", "true"
    limit = f"false in a box of fluid without an open face ({scene.domain_path})"
    message = (
        f"{solid.path}: {field} = {value}: should be {limit}: the fluid is incompressible, so that the solid can "
        "hardly change its volume. Open a face of the domain (eulerfsi:wallYMax = open), or disable the fluid "
        "(eulerfsi:ambientFluid = false)"
    )
    return [Issue(solid.path, field, value, limit, message, "warning", "NoRoom")]


def _check_closed(body: Collider | Emitter) -> list[Issue]:
    edges = body.report["open_edges"]
    if not edges:
        return []
    kind = type(body).__name__
    limit = f"0: {'an' if kind == 'Emitter' else 'a'} {kind.lower()} is a closed mesh"
    limit += "; close it below, or use a Plane for a floor or a wall" if kind == "Collider" else "; close it"
    message = f"{body.path}: the mesh has {edges} open edges: must be {limit}"
    return [Issue(body.path, "faceVertexIndices", str(edges), limit, message, "error", f"Open{kind}")]


def _check_emitter(scene: Scene, emitter: Emitter) -> list[Issue]:
    """A closed region of which a part lies in the domain."""
    issues = _check_closed(emitter) if emitter.mesh else []
    low, size = np.array(scene.domain["domain_min"]), np.array(scene.domain["domain_size"])
    start, end = (corner - low for corner in emitter.extent())
    beside = np.maximum(start - size, -end)
    if (beside < 0).all():
        return issues
    unit, axis = scene.units.meters_per_unit, int(np.argmax(beside))
    value = f"{start[axis] / unit:.4g} to {end[axis] / unit:.4g} along the box's {'xyz'[axis]}"
    limit = f"at least partly inside the domain {scene.domain_path}, 0 to {size[axis] / unit:.4g}"
    message = f"{emitter.path}: the emitter reaches from {value}: must be {limit}"
    return [*issues, Issue(emitter.path, "xformOpOrder", value, limit, message, "error", "OutsideDomain")]


def _check_apart(scene: Scene, first: Solid | Collider, second: Solid) -> list[Issue]:
    depth, volume = _at_start(first).overlap(_at_start(second))
    unit, most = scene.units.meters_per_unit, _MOST_OVERLAP * scene.domain["voxel_size"]
    if depth <= most:
        return []
    value, limit = f"{depth / unit:.4g}", f"at most half a voxel, {most / unit:.4g}"
    kinds = "solids" if isinstance(first, Solid) else "two"
    message = (
        f"{first.path} and {second.path}: the {kinds} overlap by {value} (a volume of {volume / unit**3:.4g}): "
        f"must be {limit}; {_apart(scene, first, second)}"
    )
    return [Issue(second.path, "points", value, limit, message, "error", "Overlap")]


def _apart(scene: Scene, first: Solid | Collider, second: Solid) -> str:
    """What to do about an overlap."""
    holds = any(pin.solid == second.path and pin.motion.driver == first.path for pin in scene.pins)
    if not holds:
        return "move them apart"
    return f"{first.path} holds {second.path}: attach it at the surface, or let it be no collider"


def _at_start(body: Solid | Collider) -> Surface:
    return body.start if isinstance(body, Solid) else body.surface


def _check_stretch(scene: Scene, solid: Solid) -> list[Issue]:
    factors = solid.values["stretch"]
    field, growth = "eulerfsi:stretch", math.prod(factors)
    if solid.tets and factors != [1.0, 1.0, 1.0]:
        field = "physics:restShapePoints: stretch at the start"
    value = f"({', '.join(f'{factor:g}' for factor in factors)})"
    if not _GROWTH[0] <= growth <= _GROWTH[1]:
        limit = f"a product from {_GROWTH[0]:g} to {_GROWTH[1]:g}"
        message = f"{solid.path}: {field} = {value}: the product is {growth:.3g}: must be {limit}"
        return [Issue(solid.path, field, value, limit, message, "error", "Stretch")]
    slab = slab_axis(scene.domain)
    if slab is not None and factors[slab] != 1.0:
        limit = f"1 along the box's {'xyz'[slab]} in a 2-D domain"
        message = f"{solid.path}: {field} = {value}: must be {limit}"
        return [Issue(solid.path, field, value, limit, message, "error", "Stretch")]
    if slab is not None and solid.tets and (solid.tets.deforms or solid.tets.velocities is not None):
        field, limit = "physics:restShapePoints, velocities", "those of a rigid body in a 2-D domain"
        message = f"{solid.path}: {field}: must be {limit}"
        return [Issue(solid.path, field, "a field", limit, message, "error", "NotFlat")]
    if set(factors) != {1.0} and any(pin.solid == solid.path for pin in scene.pins):
        limit = "(1, 1, 1) for a solid that is pinned"
        message = f"{solid.path}: {field} = {value}: must be {limit}"
        return [Issue(solid.path, field, value, limit, message, "error", "Stretch")]
    return []


def check_output(folder: Path) -> None:
    """Raises CacheIOError unless the folder, or the nearest parent that exists, can be written to."""
    place = folder
    while not place.exists():
        if place.is_symlink():
            raise CacheIOError(
                f"{folder}: output folder: {place} is a link to {place.readlink()}, which does not exist; make that "
                "folder, or choose another with -o"
            )
        if place.parent == place:
            raise CacheIOError(f"{folder}: output folder: {place} does not exist")
        place = place.parent
    if not place.is_dir():
        raise CacheIOError(f"{folder}: output folder: {place} is a file")
    if not os.access(place, os.W_OK | os.X_OK):
        raise CacheIOError(f"{folder}: output folder: {place} is not writable")
    probe = place / f"{TEMPORARY_PREFIX}{os.getpid()}"
    try:  # read-only file systems pass the question and fail the deed
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise CacheIOError(f"{folder}: output folder: {place} is not writable: {error.strerror}") from error
