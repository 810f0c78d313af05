# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials by name. Each sets rows of the table's solid; what it does not name has the table's default.

Moduli are for an object of SIZE metres and grow with it: what counts is the stiffness against the object's own weight.
"""

from __future__ import annotations

from typing import NamedTuple

SIZE = 0.2


class Preset(NamedTuple):
    """A material. behaves: one line for artists; values: {name of the Blender property: SI value}."""

    label: str
    behaves: str
    values: dict[str, float | bool]


PRESETS = {
    "RUBBER": Preset(
        "Rubber",
        "Bounces and keeps its shape; dents a little where it hits",
        {"density": 1100.0, "youngs_modulus": 80000.0, "poissons_ratio": 0.45, "friction": 0.6},
    ),
    "JELLY": Preset(
        "Jelly",
        "Wobbles long after it has landed; sags under its own weight",
        {"density": 1000.0, "youngs_modulus": 20000.0, "poissons_ratio": 0.45, "friction": 0.2},
    ),
    "FLESH": Preset(
        "Flesh",
        "Gives way like jelly, but stops wobbling soon",
        {
            "density": 1050.0,
            "youngs_modulus": 30000.0,
            "poissons_ratio": 0.45,
            "friction": 0.4,
            "rayleigh_alpha": 2.0,
            "rayleigh_beta": 0.002,
        },
    ),
    "FOAM": Preset(
        "Foam",
        "Light, is squeezed together without bulging, and springs back; needs an open wall or no ambient fluid",
        {
            "density": 60.0,
            "youngs_modulus": 8000.0,
            "poissons_ratio": 0.1,
            "compressible": True,
            "friction": 0.5,
            "rayleigh_alpha": 1.0,
        },
    ),
    "CLAY": Preset(
        "Clay",
        "Is dented for good: yields where it hits and does not bounce",
        {
            "density": 1600.0,
            "youngs_modulus": 100000.0,
            "poissons_ratio": 0.4,
            "friction": 0.7,
            "plastic_yield_stress": 5000.0,
            "plastic_flow_rate": 1000.0,
        },
    ),
}
