"""Checks of a scene: units, schemas, values, domain, solids, emitters, forces.

`check_stage` is what the batch tool calls; `eulerfsi_usd.validators` offers the same checks to UsdValidation. Every
fault is an `Issue` that names prim, field, value and limit.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable

from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdVol

from .deformable_checks import check_deformables, check_elastic
from .deformables import body_at, kinematic_bodies, simulated_bodies
from .foreign import check_foreign, physics_colliders
from .given import check_collider as check_given_collider
from .given import check_pins
from .gprims import dimensions
from .issues import Issue, all_prims, domain_box, first_time, is_enabled, is_ever_enabled, make_issue, read, scopes_of
from .parameters import (
    API_SCHEMAS,
    DENSITY_SCALE,
    NAMESPACE,
    Parameter,
    load,
    prim_types,
    stage_attributes,
    stage_relationships,
)
from .passengers import check_passengers, check_scale
from .physics import check_density, check_friction
from .standard_types import check_types
from .surface import check_animation, check_cages, check_inside, check_skinning, check_surface

AXES = ("X", "Y", "Z")


def check_stage(stage: Usd.Stage) -> list[Issue]:
    """All issues of a scene: first those of the stage, then prim by prim in traversal order."""
    if issues := check_types(stage):
        return issues
    issues = check_scene(stage)
    checks = {
        "domain": check_domain,
        "solid": check_solid,
        "emitter": check_emitter,
        "force": check_force,
        "collider": check_collider,
    }
    for prim in all_prims(stage):
        for scope in scopes_of(prim):
            issues += checks[scope](prim)
    return issues


def uses_eulerfsi(stage: Usd.Stage) -> bool:
    """True when a prim has one of the schemas or an attribute of the namespace."""
    return any(scopes_of(prim) or prim.GetAuthoredPropertiesInNamespace("eulerfsi") for prim in all_prims(stage))


def check_scene(stage: Usd.Stage) -> list[Issue]:
    """Units of the stage, number of domains, names of schemas and attributes, solids inside the domain."""
    if issues := check_types(stage):
        return issues
    issues = check_units(stage) + _check_range(stage) + _check_defined(stage) + _check_ignored(stage)
    prims: dict[str, list[Usd.Prim]] = {scope: [] for scope in API_SCHEMAS}
    for prim in all_prims(stage):
        issues += check_names(prim)
        for scope in scopes_of(prim):
            if scope == "domain" or (is_ever_enabled if scope == "emitter" else is_enabled)(prim):
                prims[scope].append(prim)
    if not prims["domain"]:
        issues.append(make_issue(None, "domain", None, "exactly one prim with EulerFsiDomainAPI", "MissingDomain"))
    for prim in prims["domain"][1:]:
        hint = f"the first is {prims['domain'][0].GetPath()}"
        issues.append(make_issue(prim, "apiSchemas", "EulerFsiDomainAPI", "on one prim only", "ManyDomains", hint))
    bodies = simulated_bodies(stage)
    prims["solid"] = [prim for prim in prims["solid"] if not body_at(prim)]
    prims["collider"] += physics_colliders(stage) + [body.sim for body in kinematic_bodies(stage)]
    if not prims["solid"] and not prims["emitter"] and not bodies:
        limit = (
            "at least one prim with EulerFsiSolidAPI or EulerFsiEmitterAPI, enabled, or a volume body of the standard"
        )
        issues.append(make_issue(None, "content", None, limit, "EmptyScene", severity="warning"))
    issues += check_cages([*prims["solid"], *prims["collider"], *prims["emitter"]])
    issues += check_foreign(stage) + check_deformables(stage)
    issues += check_passengers([*prims["solid"], *(body.prim for body in bodies)], prims["collider"])
    for prim in [*prims["solid"], *(body.sim for body in bodies)]:
        issues += check_scale(prim)
    if len(prims["domain"]) == 1:
        domain = prims["domain"][0]
        if read(domain, "eulerfsi:ambientFluid") is False:
            for prim in prims["emitter"]:
                hint = f"{domain.GetPath()}.eulerfsi:ambientFluid is off: smoke needs a fluid"
                issue = make_issue(prim, "eulerfsi:enabled", True, "false", "NoFluid", hint, severity="warning")
                issues.append(issue)
        issues += _check_outflow(domain, prims["emitter"])
        if not _box_fault(domain):
            for prim in prims["solid"]:
                issues += check_inside(prim, domain)
    return issues


def _check_defined(stage: Usd.Stage) -> list[Issue]:
    """Warns of schemas on prims that only overs speak of: a path that is misspelt, or a file that is missing."""
    issues = []
    for prim in Usd.PrimRange.Stage(stage, Usd.PrimAllPrimsPredicate):
        scopes = scopes_of(prim) if prim.IsActive() and not prim.IsDefined() and not prim.IsAbstract() else ()
        for scope in scopes:
            value, limit = f"an over with {API_SCHEMAS[scope]}", "defined; it is ignored by the simulation"
            hint = "check its path and the references of the prims above it"
            issues.append(make_issue(prim, "specifier", value, limit, "UndefinedPrim", hint, severity="warning"))
    return issues


def _check_ignored(stage: Usd.Stage) -> list[Issue]:
    """Warns of what is authored below an instance, where USD ignores it."""
    issues = []
    for instance in (prim for prim in stage.Traverse() if prim.IsInstance()):
        for layer in stage.GetLayerStack():
            spec = layer.GetPrimAtPath(instance.GetPath())
            for part in _specs_below(spec) if spec else ():
                schemas = part.GetInfo("apiSchemas").GetAddedOrExplicitItems()
                names = [name for name in (*schemas, *part.properties.keys()) if name.lower().startswith("eulerfsi")]
                if names:
                    limit = f"false: USD ignores {names[0]} on {part.path}, inside the instance"
                    issues.append(make_issue(instance, "instanceable", True, limit, "IgnoredOver", severity="warning"))
    return issues


def _specs_below(spec: Sdf.PrimSpec) -> Iterable[Sdf.PrimSpec]:
    for child in spec.nameChildren:
        yield child
        yield from _specs_below(child)


def _check_outflow(domain: Usd.Prim, emitters: list[Usd.Prim]) -> list[Issue]:
    """What a jet brings in has to leave."""
    walls = [read(domain, f"eulerfsi:wall{axis}{side}") for axis in AXES for side in ("Min", "Max")]
    if "open" in walls or read(domain, "eulerfsi:ambientFluid") is False:
        return []
    limit = f"false, or one of the walls of {domain.GetPath()} open"
    hint = "the box has no open side: the jet adds no volume and acts as a fan"
    return [
        make_issue(prim, "eulerfsi:emitVelocity", True, limit, "ClosedJet", hint, severity="warning")
        for prim in emitters
        if read(prim, "eulerfsi:emitVelocity") and read(prim, "eulerfsi:mode") != "initial"
    ]


def check_units(stage: Usd.Stage) -> list[Issue]:
    """metersPerUnit is authored, and all units are positive numbers."""
    issues = []
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        limit = "authored (1 for metres, 0.01 for centimetres)"
        issues.append(make_issue(None, "metersPerUnit", None, limit, "MissingUnits"))
    units = {
        "metersPerUnit": UsdGeom.GetStageMetersPerUnit(stage),
        "kilogramsPerUnit": UsdPhysics.GetStageKilogramsPerUnit(stage),
        "timeCodesPerSecond": stage.GetTimeCodesPerSecond(),
    }
    for name, value in units.items():
        if not (math.isfinite(value) and value > 0.0):
            issues.append(make_issue(None, name, value, "> 0", "BadUnits"))
    return issues


def _check_range(stage: Usd.Stage) -> list[Issue]:
    """The time codes do not end before they start."""
    start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    if not stage.HasAuthoredTimeCodeRange() or not end < start:
        return []
    hint = "exchange them, or choose other frames by --start-frame and --frames"
    return [make_issue(None, "startTimeCode", start, f"at most endTimeCode = {end:g}", "BackwardRange", hint)]


def check_names(prim: Usd.Prim) -> list[Issue]:
    """Names of schemas and attributes are known, and a prim plays one part only."""
    issues = []
    scopes = scopes_of(prim)
    for schema in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
        if schema.startswith("EulerFsi") and schema not in API_SCHEMAS.values():
            hint = _did_you_mean(schema, API_SCHEMAS.values())
            limit = f"one of {', '.join(API_SCHEMAS.values())}"
            issues.append(make_issue(prim, "apiSchemas", schema, limit, "UnknownSchema", hint))
    if len(scopes) > 1:
        names = ", ".join(API_SCHEMAS[scope] for scope in scopes)
        issues.append(make_issue(prim, "apiSchemas", names, "one schema of eulerfsi per prim", "ManySchemas"))
    known = {name for scope in scopes for name in (*stage_attributes(scope), *stage_relationships(scope))}
    for prop in prim.GetAuthoredPropertiesInNamespace("eulerfsi"):
        name = prop.GetName()
        if name not in known and not (name == DENSITY_SCALE and prim.IsA(UsdVol.Volume)):
            issues.append(_unknown_attribute(prim, name, known))
    return issues


def _unknown_attribute(prim: Usd.Prim, name: str, known: set[str]) -> Issue:
    physics = {NAMESPACE + row.name: row for rows in load().values() for row in rows.values() if row.usd_physics}
    elsewhere = [
        API_SCHEMAS[scope]
        for scope in API_SCHEMAS
        if name in stage_attributes(scope) or name in stage_relationships(scope)
    ]
    if name in physics:
        hint = f"use {physics[name].attribute}"
    elif elsewhere:
        hint = f"it belongs to {' and '.join(elsewhere)}, not applied to this prim"
    else:
        every = known or {attribute for scope in API_SCHEMAS for attribute in stage_attributes(scope)}
        hint = _did_you_mean(name, every)
    value = prim.GetAttribute(name).Get() if prim.GetAttribute(name) else "a relationship"
    return make_issue(prim, name, value, "an attribute of the applied schemas", "UnknownAttribute", hint)


def _did_you_mean(name: str, known) -> str:
    nearest = difflib.get_close_matches(name, sorted(known), 1, 0.6)
    return f"did you mean {nearest[0]}?" if nearest else ""


def check_values(prim: Usd.Prim, scope: str) -> list[Issue]:
    """Prim type, and type, tokens and hard limits of every authored attribute of one schema."""
    issues = []
    types = prim_types()[scope]
    if not any(prim.IsA(getattr(UsdGeom, name)) for name in types):
        hint = f"{API_SCHEMAS[scope]} applies to {' and '.join(types)}"
        limit = " or ".join(types)
        issues.append(make_issue(prim, "typeName", prim.GetTypeName() or "none", limit, "WrongPrimType", hint))
    for name, row in stage_attributes(scope).items():
        attribute = prim.GetAttribute(name)
        if not attribute or not attribute.HasAuthoredValue():
            continue
        counts = samples_count(prim, row)
        for time in [first_time(prim.GetStage()), *(attribute.GetTimeSamples() if counts else ())]:
            fault = value_fault(row, attribute.Get(time))
            if fault:
                limit, code = fault
                value = attribute.Get(time)
                if code == "WrongType" and isinstance(value, str):
                    issues.append(make_issue(prim, name, f'"{value}"', limit, code, _names_of(row)))
                else:
                    issues.append(make_issue(prim, name, value, limit, code))
                break
        if attribute.GetNumTimeSamples() > 1 and not counts:
            hint = "only the value at the first time code is used"
            number = f"{attribute.GetNumTimeSamples()} time samples"
            issues.append(make_issue(prim, name, number, "constant", "Animated", hint, severity="warning"))
    return issues


def _names_of(row: Parameter) -> str:
    """What a parameter's names stand for: a stage has the numbers, `--set` takes both."""
    return ", ".join(f"{name}: {value:g}" for name, value in row.names.items())


def samples_count(prim: Usd.Prim, row: Parameter) -> bool:
    """Whether the time samples of an attribute count: not where an emitter acts at the start only."""
    return row.animated and not (row.scope == "emitter" and read(prim, "eulerfsi:mode") == "initial")


def value_fault(row: Parameter, value: object) -> tuple[str, str] | None:
    """(limit, code) when a value is not allowed for a parameter, else None. Also checks values of --set."""
    if row.type == "double":
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return "a number", "WrongType"
        unset = row.depends_on_stage_units and value == -math.inf
        return None if unset or row.allows(float(value)) else (row.limit_text(), "OutOfRange")
    if row.type == "vector":
        is_vector = isinstance(value, (Gf.Vec3d, Gf.Vec3f, Gf.Vec3h, Gf.Vec3i))
        if not (is_vector or (isinstance(value, (tuple, list)) and len(value) == 3)):
            return "three numbers", "WrongType"
        limit = f"{row.limit_text()} in every component"
        return None if all(row.allows(float(x)) for x in value) else (limit, "OutOfRange")
    if row.type == "bool":
        return None if isinstance(value, bool) or value in (0, 1) else ("true or false", "WrongType")
    if row.type == "token":
        return None if value in row.tokens else (f"one of {', '.join(row.tokens)}", "BadToken")
    return None if isinstance(value, (str, Sdf.AssetPath)) else ("a file path", "WrongType")


def check_domain(prim: Usd.Prim) -> list[Issue]:
    """Values, walls and box of a prim with EulerFsiDomainAPI."""
    issues = check_values(prim, "domain") + check_animation(prim, "domain")
    for axis in AXES:
        low, high = (read(prim, f"eulerfsi:wall{axis}{side}") for side in ("Min", "Max"))
        if (low == "periodic") != (high == "periodic"):
            field, value = ("Max", high) if low == "periodic" else ("Min", low)
            limit = "periodic, as the opposite face is"
            issues.append(make_issue(prim, f"eulerfsi:wall{axis}{field}", value, limit, "UnpairedPeriodic"))
    fault = _box_fault(prim)
    if fault:
        return [*issues, fault]
    edges, matrix = domain_box(prim)
    shortest = min(edge * matrix.GetRow3(i).GetLength() for i, edge in enumerate(edges))
    voxel = read(prim, "eulerfsi:voxelSize")
    if voxel is None or voxel == -math.inf:
        voxel = load()["domain"]["voxelSize"].default / UsdGeom.GetStageMetersPerUnit(prim.GetStage())
    if isinstance(voxel, (int, float)) and shortest * (1.0 + 1e-6) < voxel < math.inf:
        limit = f"at most the shortest edge of the box, {shortest:g}"
        issues.append(make_issue(prim, "eulerfsi:voxelSize", float(voxel), limit, "VoxelTooLarge"))
    return issues


def _box_fault(prim: Usd.Prim) -> Issue | None:
    """The box of a domain has positive edges and a transform without shear."""
    if not (prim.IsA(UsdGeom.Cube) or prim.IsA(UsdGeom.Xform)):
        return make_issue(prim, "typeName", prim.GetTypeName(), "Cube or Xform", "WrongPrimType")
    edges, matrix = domain_box(prim)
    field = "size" if prim.IsA(UsdGeom.Cube) else "eulerfsi:size"
    if not all(math.isfinite(edge) and edge > 0.0 for edge in edges):
        value = edges[0] if field == "size" else edges
        return make_issue(prim, field, value, "> 0 in every component", "EmptyDomain")
    rows = [matrix.GetRow3(i) for i in range(3)]
    lengths = [row.GetLength() for row in rows]
    if not all(math.isfinite(length) and length > 0.0 for length in lengths):
        return make_issue(prim, "xformOpOrder", tuple(lengths), "a transform with scales other than 0", "EmptyDomain")
    shear = max(abs(Gf.Dot(rows[i], rows[i - 1])) / (lengths[i] * lengths[i - 1]) for i in range(3))
    if shear > 1e-5:
        return make_issue(prim, "xformOpOrder", f"shear {shear:.3g}", "a transform without shear", "ShearedDomain")
    return None


def check_solid(prim: Usd.Prim) -> list[Issue]:
    """Values, density, friction and surface of a prim with EulerFsiSolidAPI."""
    issues = check_values(prim, "solid")
    if not is_enabled(prim):
        return issues
    if body := body_at(prim):
        return issues + check_friction(body.prim) + check_pins(prim)
    issues += check_density(prim) + check_friction(prim) + check_surface(prim) + check_skinning(prim)
    issues += check_elastic(prim)
    return issues + check_animation(prim, "solid") + check_pins(prim)


def check_collider(prim: Usd.Prim) -> list[Issue]:
    """Values, shape and motion of a prim with EulerFsiColliderAPI."""
    issues = check_values(prim, "collider")
    if issues or not is_enabled(prim):
        return issues
    return check_friction(prim) + check_skinning(prim) + check_given_collider(prim)


def check_emitter(prim: Usd.Prim) -> list[Issue]:
    """Values, region and times of a prim with EulerFsiEmitterAPI."""
    issues = check_values(prim, "emitter") + check_animation(prim, "emitter") + _check_region(prim, "EmptyEmitter")
    return issues + (check_surface(prim) if prim.IsA(UsdGeom.Mesh) else [])


def check_force(prim: Usd.Prim) -> list[Issue]:
    """Values, region and times of a prim with EulerFsiForceAPI."""
    return check_values(prim, "force") + check_animation(prim, "force") + _check_region(prim, "EmptyForce")


def _check_region(prim: Usd.Prim, code: str) -> list[Issue]:
    """Size and times of a prim that is a region."""
    issues = []
    for field in dimensions(prim):
        extent = read(prim, field)
        if not (math.isfinite(extent) and extent > 0.0):
            issues.append(make_issue(prim, field, extent, "> 0", code))
    start, end = (read(prim, f"eulerfsi:{name}") for name in ("startTime", "endTime"))
    if isinstance(start, float) and isinstance(end, float) and end < start:
        limit = f">= eulerfsi:startTime = {start:g}"
        issues.append(make_issue(prim, "eulerfsi:endTime", end, limit, "EmptyInterval"))
    return issues
