"""Checks of bodies written to the proposed standard: what cannot be simulated, and what is ignored, by name."""

from __future__ import annotations

import math

import numpy as np
from pxr import Usd, UsdGeom

from . import standard, tets
from .attachments import check_attachments
from .deformables import (
    Body,
    body_prim,
    collision_geometry,
    find_bodies,
    has_default_points,
    idle_sims,
    kinematic_bodies,
    masses_of,
    material_at,
    members,
    owned_by_others,
    points_now,
    rest_arrays,
    rest_of_points,
    simulated_bodies,
    subset_materials,
    tet_indices,
)
from .issues import Issue, all_prims, first_time, instance_above, listed, make_issue
from .pose import transform_drivers

_FLAT = 1e-9  # of the volume of a cube as long as the longest edge: a tetrahedron without a volume
_UNEVEN = 1.01  # largest over smallest density of a body that still counts as even
LARGEST_POISSON, LEAST_POISSON = 0.499, -0.9


def check_deformables(stage: Usd.Stage) -> list[Issue]:
    """All issues of the standard's prims."""
    issues = _check_ignored(stage)
    for body in find_bodies(stage):
        if owned_by_others(body.prim):
            limit = "the first PhysicsScene, whose gravity counts; the body is not simulated"
            issues.append(_warn(body.prim, f"physics:{standard.OWNER}", "another scene", limit, "OtherScene"))
    for body in simulated_bodies(stage):
        issues += _check_body(body)
    for body in kinematic_bodies(stage):
        issues += _check_schemas(body) + (_check_mesh(body) or _check_constant(body))
    return issues + check_attachments(stage)


def _warn(prim: Usd.Prim, field: str, value: object, limit: str, code: str, hint: str = "") -> Issue:
    return make_issue(prim, field, value, limit, code, hint, "warning")


def _check_body(body: Body) -> list[Issue]:
    if body.sim.IsInstanceProxy():
        limit = f"false: {body.sim.GetPath()} inside it is a solid and needs its own points"
        return [make_issue(instance_above(body.sim), "instanceable", True, limit, "InstanceSolid")]
    issues = _check_schemas(body) + _check_mesh(body)
    if not issues:
        issues = _check_rest(body) + _check_poses(body) + _check_velocities(body.sim)
    issues += _check_masses(body) + check_elastic(body.sim)
    if not collision_geometry(body):
        limit = f"applied where {body.path} takes part in collisions; here it does all the same"
        issues.append(_warn(body.sim, "apiSchemas", f"no {standard.COLLISION}", limit, "NoCollisionAPI"))
    if standard.value(body.prim, standard.ASLEEP, first_time(body.prim.GetStage()), False):
        issues.append(_warn(body.prim, f"physics:{standard.ASLEEP}", True, "false: it is awake", "Asleep"))
    return issues + _check_animation(body)


def _check_schemas(body: Body) -> list[Issue]:
    if len(body.schemas) > 1:
        limit = f"on one prim of the body; {body.schemas[0].GetPath()} has it too"
        return [make_issue(body.sim, "apiSchemas", "EulerFsiSolidAPI", limit, "ManySchemas")]
    return []


def _check_mesh(body: Body) -> list[Issue]:
    """Points, tetrahedra, their volumes where the scene starts."""
    sim = body.sim
    points = points_now(sim)
    raw = UsdGeom.TetMesh(sim).GetTetVertexIndicesAttr().Get(first_time(sim.GetStage()))
    if not len(points) or raw is None or not len(raw):
        field = "points" if not len(points) else "tetVertexIndices"
        return [make_issue(sim, field, "empty", "the points and tetrahedra of a body", "MissingMesh")]
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        value = tuple(float(x) for x in points[bad[0]])
        limit = f"finite ({len(bad)} of {len(points)} points are not)"
        return [make_issue(sim, f"points[{bad[0]}]", value, limit, "NonFinitePoints")]
    corners = tet_indices(sim)
    issue = _check_indices(sim, "tetVertexIndices", corners, len(points))
    return [issue] if issue else _check_volumes(sim, "tetVertexIndices", points, corners)


def _check_indices(sim: Usd.Prim, field: str, corners: np.ndarray, count: int) -> Issue | None:
    bad = np.flatnonzero(((corners < 0) | (corners >= count)).any(axis=1))
    if not len(bad):
        return None
    value, limit = tuple(int(i) for i in corners[bad[0]]), f"between 0 and {count - 1}"
    return make_issue(sim, f"{field}[{bad[0]}]", value, limit, "BadTopology")


def _check_volumes(sim: Usd.Prim, field: str, points: np.ndarray, corners: np.ndarray) -> list[Issue]:
    length = np.sqrt((tets.edges(points, corners) ** 2).sum(axis=1)).max(axis=1)
    bad = np.flatnonzero(~(np.abs(tets.volumes(points, corners)) > _FLAT * length**3))
    if not len(bad):
        return []
    limit = f"a tetrahedron with a volume ({len(bad)} of {len(corners)} are flat)"
    return [make_issue(sim, f"{field}[{bad[0]}]", tuple(int(i) for i in corners[bad[0]]), limit, "FlatTet")]


def _check_rest(body: Body) -> list[Issue]:
    """A rest shape of as many tetrahedra, joined as they are, none turned inside out."""
    sim, own = body.sim, tet_indices(body.sim)
    points, corners = rest_arrays(sim)
    field = standard.REST_TETS if standard.attribute(sim, standard.REST_TETS) else standard.REST_POINTS
    if len(corners) != len(own):
        limit = f"{len(own)} tetrahedra, as many as the sim mesh has, in its order"
        return [make_issue(sim, f"physics:{field}", f"{len(corners)} tetrahedra", limit, "BadRestShape")]
    same = np.array_equal(corners, own)
    if same and len(points) != len(points_now(sim)):
        limit = f"{len(points_now(sim))} points, as many as the sim mesh has"
        return [make_issue(sim, f"physics:{standard.REST_POINTS}", f"{len(points)} points", limit, "BadRestShape")]
    if not np.isfinite(points).all():
        return [make_issue(sim, f"physics:{standard.REST_POINTS}", "not finite", "finite", "NonFinitePoints")]
    issue = _check_indices(sim, f"physics:{field}", corners, len(points))
    faults = [issue] if issue else _check_volumes(sim, f"physics:{field}", points, corners)
    if faults:
        return faults
    places, torn = rest_of_points(sim)
    if torn >= 0:
        value = f"several places at rest of point {torn} of the sim mesh"
        limit = "one place for each point: the body is one continuous material here"
        return [make_issue(sim, f"physics:{field}", value, limit, "TornRestShape")]
    turned = np.flatnonzero(~(tets.volumes(places, own) * tets.volumes(points_now(sim), own) > 0.0))
    if len(turned):
        limit = f"with the sign of the volume that it has at rest ({len(turned)} of {len(own)} are inverted)"
        return [make_issue(sim, f"tetVertexIndices[{turned[0]}]", "inverted", limit, "InvertedTet")]
    if not has_default_points(sim) and not standard.attribute(sim, standard.REST_POINTS):
        limit = "authored by default, too, for the rest shape; that of the first frame is taken"
        return [_warn(sim, "points", "time samples only", limit, "NoDefaultPoints")]
    return []


def _check_poses(body: Body) -> list[Issue]:
    issues = []
    for prim in [body.sim, *members(body)]:
        poses = standard.bind_poses(prim)
        if len(poses) > 1:
            limit = 'one pose with the purpose "bindPose"'
            issues.append(make_issue(prim, "apiSchemas", f"poses {', '.join(poses)}", limit, "ManyBindPoses"))
        for name, attribute in poses.items():
            count, points = len(attribute.Get(first_time(prim.GetStage())) or ()), len(points_now(prim))
            if count != points:
                field = f"deformablePose:{name}:points"
                issues.append(make_issue(prim, field, f"{count} points", f"{points} points", "BadBindPose"))
    return issues


def _check_velocities(sim: Usd.Prim) -> list[Issue]:
    got = UsdGeom.PointBased(sim).GetVelocitiesAttr().Get(first_time(sim.GetStage()))
    velocities = np.asarray(got if got is not None else (), float).reshape(-1, 3)
    count = len(points_now(sim))
    if len(velocities) not in (0, count):
        return [make_issue(sim, "velocities", f"{len(velocities)} values", f"{count}, one per point", "BadVelocities")]
    if not np.isfinite(velocities).all():
        return [make_issue(sim, "velocities", "not finite", "finite", "BadVelocities")]
    return []


def _check_masses(body: Body) -> list[Issue]:
    """What gives the mass is a number, above 0, and there are as many as it says."""
    time, issues = first_time(body.prim.GetStage()), []
    masses, kind = masses_of(body.sim)
    field = f"physics:{standard.MASSES}"
    counts = {"constant": 1, "tetrahedron": len(tet_indices(body.sim)), "point": len(points_now(body.sim))}
    if len(masses) and kind not in counts:
        limit = f"one of {', '.join(counts)} where physics:masses is authored"
        return [make_issue(body.sim, f"physics:{standard.MASSES_OF}", kind or "empty", limit, "BadMasses")]
    if len(masses) and len(masses) != counts[kind]:
        limit = f"{counts[kind]} ({kind})"
        return [make_issue(body.sim, field, f"{len(masses)} values", limit, "BadMasses")]
    if len(masses):
        least = float(masses.min())
        bad = not (np.isfinite(masses).all() and least > 0.0)
        return [make_issue(body.sim, field, least, "> 0 and finite", "OutOfRange")] if bad else []
    materials = [material_at(body.sim), *(material for _, material in subset_materials(body.sim))]
    for prim, name in [(body.prim, standard.MASS), (body.prim, standard.DENSITY)] + [
        (material, standard.DENSITY) for material in dict.fromkeys(materials) if material
    ]:
        value = standard.value(prim, name, time)
        if value is not None and not (math.isfinite(value) and value >= 0.0) and value != -math.inf:
            issues.append(make_issue(prim, f"physics:{name}", float(value), "finite and >= 0 (0: unset)", "OutOfRange"))
    return issues


def check_elastic(prim: Usd.Prim) -> list[Issue]:
    """E and nu of the materials bound to a solid, ours too."""
    time, issues = first_time(prim.GetStage()), []
    subsets = subset_materials(prim) if prim.IsA(UsdGeom.TetMesh) else []
    for material in dict.fromkeys([material_at(prim), *(material for _, material in subsets)]):
        for name in (standard.YOUNGS_MODULUS, standard.POISSONS_RATIO) if material else ():
            value = standard.value(material, name, time)
            if value is not None and value != -math.inf:
                issues += _check_modulus(material, name, float(value), prim)
    if subsets:
        value = listed([material.GetPath() for _, material in subsets])
        limit = "one material: the elastic values are those of the material of most tetrahedra"
        issues.append(_warn(prim, "material:binding", value, limit, "SubsetMaterials"))
    return issues


def _check_modulus(material: Usd.Prim, name: str, value: float, prim: Usd.Prim) -> list[Issue]:
    field = f"physics:{name}"
    if name == standard.YOUNGS_MODULUS:
        bad = not (math.isfinite(value) and value > 0.0)
        return [make_issue(material, field, value, "> 0", "OutOfRange")] if bad else []
    if not LEAST_POISSON <= value <= 0.5:
        return [make_issue(material, field, value, f"{LEAST_POISSON:g} to 0.5", "OutOfRange")]
    if value > LARGEST_POISSON:
        hint = f"{LARGEST_POISSON:g} is taken for {prim.GetPath()}"
        return [_warn(material, field, value, f"at most {LARGEST_POISSON:g}", "LargePoisson", hint)]
    return []


def check_evenness(body: Body, masses: np.ndarray, volumes: np.ndarray) -> list[Issue]:
    """Warns of a body whose density is not the same everywhere: the solid's is one. masses [kg], volumes [m^3]."""
    densities = masses / volumes
    low, high = float(densities.min()), float(densities.max())
    if high <= _UNEVEN * low:
        return []
    value = f"a density of {low:.4g} to {high:.4g} kg/m^3"
    limit = f"even: the solid has the mean, {masses.sum() / volumes.sum():.4g}"
    return [_warn(body.sim, f"physics:{standard.MASSES}", value, limit, "UnevenMass")]


def _check_animation(body: Body) -> list[Issue]:
    time = first_time(body.prim.GetStage())
    after = -math.inf if time.IsEarliestTime() else time.GetValue()
    drivers = transform_drivers(body.sim, after)
    samples = UsdGeom.PointBased(body.sim).GetPointsAttr().GetTimeSamples()
    if len(samples) > 1 and samples[-1] > after:
        drivers.append("its points")
    if not drivers:
        return []
    value = " and ".join(drivers)
    limit = "constant: it starts from that state; later animation is ignored"
    return [_warn(body.sim, "points", f"animated by {value}", limit, "AnimatedPrim")]


def _check_constant(body: Body) -> list[Issue]:
    """The tetrahedra of a kinematic body, and the number of its points, are the same in all frames."""
    mesh = UsdGeom.TetMesh(body.sim)
    stage, field = body.sim.GetStage(), "tetVertexIndices"
    if mesh.GetTetVertexIndicesAttr().GetNumTimeSamples() > 1:
        return [make_issue(body.sim, field, "time samples", "constant", "ChangingCollider")]
    count = len(points_now(body.sim))
    for time in mesh.GetPointsAttr().GetTimeSamples():
        now = len(mesh.GetPointsAttr().Get(time) or ())
        if now != count:
            value = f"{now} points at {time:g}, {count} at frame {stage.GetStartTimeCode():g}"
            return [make_issue(body.sim, "points", value, "the same number in all frames", "ChangingCollider")]
    return []


# ------------------------------------------------------------------------------------------------------------- ignored


def _check_ignored(stage: Usd.Stage) -> list[Issue]:
    """Warns, once a kind, of what the standard has and the solver does not."""
    kinds: dict[str, list[Usd.Prim]] = {}
    for prim in all_prims(stage):
        applied = standard.apis(prim)
        for api, what in ((standard.SURFACE_SIM, "cloth"), (standard.CURVES_SIM, "cables and hair")):
            if api in applied:
                kinds.setdefault(f"{what} ({api})", []).append(prim)
        name = str(prim.GetTypeName())
        if name in (standard.COLLISION_FILTER, standard.COLLISION_GROUP) or standard.FILTERED_PAIRS in applied:
            kinds.setdefault("filters of collisions", []).append(prim)
    issues = []
    for what, prims in kinds.items():
        value = listed([prim.GetPath() for prim in prims])
        message = f"{value}: ignored: {what}: only volume bodies are simulated, and all bodies collide"
        issue = Issue(str(prims[0].GetPath()), "apiSchemas", value, "a volume body", message, "warning", "NotSimulated")
        issues.append(issue)
    for sim in idle_sims(stage):
        if not sim.IsA(UsdGeom.TetMesh):
            hint = f"{standard.VOLUME_SIM} is for tetrahedra; it is not simulated"
            issues.append(_warn(sim, "typeName", sim.GetTypeName() or "none", "TetMesh", "IdleSimMesh", hint))
            continue
        owner = body_prim(sim)
        limit = (
            f"one in a body; that of {owner.GetPath()} is another"
            if owner
            else (f"on a prim with {standard.BODY} and without {standard.RIGID_BODY}, or its child")
        )
        issues.append(_warn(sim, "apiSchemas", standard.VOLUME_SIM, limit, "IdleSimMesh", "it is not simulated"))
    return issues
