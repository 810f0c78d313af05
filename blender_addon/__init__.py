# SPDX-License-Identifier: GPL-3.0-or-later
"""Euler FSI for Blender: soft solids and smoke that push each other (docs/blender.md)."""

from __future__ import annotations

from . import bake, operators, panels, preferences, properties, set_up

_PARTS = (preferences, properties, set_up, operators, panels, bake)


def register() -> None:
    for part in _PARTS:
        part.register()


def unregister() -> None:
    for part in reversed(_PARTS):
        part.unregister()
