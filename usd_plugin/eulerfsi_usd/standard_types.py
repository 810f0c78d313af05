"""Types of the attributes of UsdPhysics and the proposed standard: USD checks none of a schema that it lacks."""

from __future__ import annotations

from pxr import Usd

from . import standard
from .issues import Issue, all_prims, make_issue

_NUMBER, _NUMBERS = ("float", "double", "half", "int"), ("float[]", "double[]", "half[]")
_VECTORS = (*(f"{kind}3{end}[]" for kind in ("point", "vector", "normal") for end in "fdh"), "float3[]", "double3[]")
_WORD, _INDICES, _TETS = ("token", "string"), ("int[]",), ("int4[]", "int[]")
_TYPES = {
    **dict.fromkeys((standard.MASS, standard.DENSITY, standard.YOUNGS_MODULUS, standard.POISSONS_RATIO), _NUMBER),
    **dict.fromkeys((standard.STIFFNESS, "dynamicFriction", "staticFriction"), _NUMBER),
    **dict.fromkeys((standard.BODY_ENABLED, standard.RIGID_ENABLED, standard.KINEMATIC, standard.ASLEEP), ("bool",)),
    **dict.fromkeys((standard.COLLISION_ENABLED, standard.ATTACHED), ("bool",)),
    **dict.fromkeys((standard.MASSES_OF, *standard.TYPES), _WORD),
    standard.MASSES: _NUMBERS,
    standard.REST_POINTS: _VECTORS,
    standard.REST_TETS: _TETS,
    **dict.fromkeys(standard.INDICES, _INDICES),
    **dict.fromkeys(standard.COORDS, _VECTORS),
}


def check_types(stage: Usd.Stage) -> list[Issue]:
    """Errors of values that are of another kind than what they are for; other checks must not read them."""
    issues = []
    for prim in all_prims(stage):
        for found in prim.GetAuthoredPropertiesInNamespace("physics"):
            kinds = _TYPES.get(found.GetName().removeprefix("physics:"))
            if kinds and isinstance(found, Usd.Attribute) and str(found.GetTypeName()) not in kinds:
                value = f"a value of type {found.GetTypeName()}"
                issues.append(make_issue(prim, found.GetName(), value, f"of type {kinds[0]}", "WrongType"))
        for name, points in standard.bind_poses(prim).items():
            if str(points.GetTypeName()) not in _VECTORS:
                field, value = f"deformablePose:{name}:points", f"a value of type {points.GetTypeName()}"
                issues.append(make_issue(prim, field, value, f"of type {_VECTORS[0]}", "WrongType"))
    return issues
