"""Names of the proposed standard for deformable bodies, all of them: they may change.

OpenUSD-proposals, pull request 111, "Deformable Body Physics in USD", as of August 2026. USD does not register its
schemas, so that they are read by name: nothing has a fallback, and what is built into a schema does not follow it.
"""

from __future__ import annotations

from typing import Any

from pxr import Usd

# Applied API schemas.
BODY = "PhysicsDeformableBodyAPI"
VOLUME_SIM, SURFACE_SIM, CURVES_SIM = (f"Physics{kind}DeformableSimAPI" for kind in ("Volume", "Surface", "Curves"))
MATERIAL, VOLUME_MATERIAL = "PhysicsMaterialAPI", "PhysicsVolumeDeformableMaterialAPI"
MATERIALS = (MATERIAL, VOLUME_MATERIAL, "PhysicsSurfaceDeformableMaterialAPI", "PhysicsCurvesDeformableMaterialAPI")
POSE = "PhysicsDeformablePoseAPI"
COLLISION, RIGID_BODY, COLLISION_GROUP = "PhysicsCollisionAPI", "PhysicsRigidBodyAPI", "PhysicsCollisionGroup"
FILTERED_PAIRS = "PhysicsFilteredPairsAPI"
# Prim types.
ATTACHMENT, COLLISION_FILTER = "PhysicsAttachment", "PhysicsElementCollisionFilter"

# Attributes, all in the namespace "physics:".
BODY_ENABLED, RIGID_ENABLED, KINEMATIC, OWNER = "bodyEnabled", "rigidBodyEnabled", "kinematicEnabled", "simulationOwner"
ASLEEP, COLLISION_ENABLED = "startsAsleep", "collisionEnabled"
MASS, DENSITY, MASSES, MASSES_OF = "mass", "density", "masses", "masses:elementType"
REST_POINTS, REST_TETS = "restShapePoints", "restTetVertexIndices"
YOUNGS_MODULUS, POISSONS_RATIO = "youngsModulus", "poissonsRatio"
ATTACHED, STIFFNESS = "attachmentEnabled", "stiffness"
SOURCES, TYPES, INDICES, COORDS = (
    tuple(f"{name}{end}" for end in (0, 1)) for name in ("src", "type", "indices", "coords")
)
BIND_POSE = "bindPose"

# Fallbacks, in SI.
YOUNGS_MODULUS_FALLBACK, POISSONS_RATIO_FALLBACK, DENSITY_FALLBACK = 1e6, 0.3, 1000.0


def apis(prim: Usd.Prim) -> list[str]:
    """Applied schemas, registered or not."""
    return prim.GetPrimTypeInfo().GetAppliedAPISchemas()


def has(prim: Usd.Prim, api: str) -> bool:
    """Whether a schema is applied."""
    return api in apis(prim)


def attribute(prim: Usd.Prim, name: str) -> Usd.Attribute | None:
    """The attribute physics:<name> where it has a value that is authored."""
    found = prim.GetAttribute(f"physics:{name}")
    return found if found and found.HasAuthoredValue() else None


def value(prim: Usd.Prim, name: str, time: Usd.TimeCode | None = None, unset: Any = None) -> Any:
    """The authored value of physics:<name>, `unset` where there is none. time: None for the default value."""
    found = attribute(prim, name)
    got = found.Get(Usd.TimeCode.Default() if time is None else time) if found else None
    return unset if got is None else got


def number(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float | None:
    """A number that counts as authored: 0 and -inf say "unset" in the standard."""
    got = value(prim, name, time)
    return None if got is None or got in (0, float("-inf")) else float(got)


def targets(prim: Usd.Prim, name: str) -> list[Usd.Prim | None]:
    """The prims at which the relationship physics:<name> points; None for one that is not there."""
    relationship = prim.GetRelationship(f"physics:{name}")
    paths = relationship.GetTargets() if relationship else []
    return [prim.GetStage().GetPrimAtPath(path) or None for path in paths]


def pose_points(prim: Usd.Prim) -> Usd.Attribute | None:
    """The points of the pose of a prim that serves as its bind pose; None without one."""
    return next(iter(bind_poses(prim).values()), None)


def bind_poses(prim: Usd.Prim) -> dict[str, Usd.Attribute]:
    """{name: points} of all poses whose purposes hold "bindPose"; a valid prim has at most one."""
    found = {}
    for api in apis(prim):
        name = api.removeprefix(f"{POSE}:")
        purposes = prim.GetAttribute(f"deformablePose:{name}:purposes") if name != api else None
        if purposes and BIND_POSE in (purposes.Get() or ()):
            points = prim.GetAttribute(f"deformablePose:{name}:points")
            if points and points.HasAuthoredValue():
                found[name] = points
    return found
