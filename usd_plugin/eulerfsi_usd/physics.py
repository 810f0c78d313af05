"""What a body takes from UsdPhysics: its density, and the friction of its physics material."""

from __future__ import annotations

import math

from pxr import Usd

from . import standard
from .deformables import body_at, collision_geometry, material_at
from .issues import Issue, first_time, make_issue

FRICTION = "eulerfsi:friction"


def friction_of(prim: Usd.Prim) -> Usd.Attribute | None:
    """The attribute that gives a body's one coefficient of friction; None where none is authored.

    eulerfsi:friction, else physics:dynamicFriction of the physics material, else its physics:staticFriction. Of a body
    of the standard the material is that of what collides.
    """
    body = body_at(prim)
    material = material_at(next(iter(collision_geometry(body)), body.sim) if body else prim)
    named = [(body.ours if body else prim, FRICTION)]
    if material:
        named += [(material, "physics:dynamicFriction"), (material, "physics:staticFriction")]
    attributes = (owner.GetAttribute(name) for owner, name in named)
    return next((attribute for attribute in attributes if attribute and attribute.HasAuthoredValue()), None)


def check_friction(prim: Usd.Prim) -> list[Issue]:
    """Of a physics material, where it counts; eulerfsi:friction is checked with the other values of the prim."""
    attribute = friction_of(prim)
    if attribute is None or attribute.GetName() == FRICTION:
        return []
    value = float(attribute.Get(first_time(prim.GetStage())))
    if not (math.isfinite(value) and value >= 0.0):
        return [make_issue(attribute.GetPrim(), attribute.GetName(), value, ">= 0", "OutOfRange")]
    return []


def check_density(prim: Usd.Prim) -> list[Issue]:
    """physics:mass, physics:density, then the density of the bound physics material, in UsdPhysics' precedence."""
    mass = prim.GetAttribute("physics:mass")
    if mass and mass.HasAuthoredValue():
        value = float(mass.Get(first_time(prim.GetStage())))
        if not (math.isfinite(value) and value >= 0.0):
            return [make_issue(prim, "physics:mass", value, ">= 0 (0: from the density)", "OutOfRange")]
        if value > 0.0:
            return []
    density = prim.GetAttribute("physics:density")
    if density and density.HasAuthoredValue():
        value = float(density.Get(first_time(prim.GetStage())))
        bad = not (math.isfinite(value) and value > 0.0)
        return [make_issue(prim, "physics:density", value, "> 0", "OutOfRange")] if bad else []
    material = material_at(prim)
    if material:
        value = float(standard.value(material, standard.DENSITY, first_time(prim.GetStage()), 0.0))
        if not (math.isfinite(value) and value >= 0.0):
            return [make_issue(material, "physics:density", value, ">= 0 (0: the default)", "OutOfRange")]
    return []
