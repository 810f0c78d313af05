# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an object is and how large, also where Blender has not evaluated it: what is hidden in a file just opened."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix


def of(obj: bpy.types.Object) -> Matrix:
    """In the world. matrix_world where a constraint, or a part of the parent, decides."""
    if obj.constraints or (obj.parent and obj.parent_type != "OBJECT"):
        return obj.matrix_world
    if obj.parent is None:
        return obj.matrix_basis
    return of(obj.parent) @ obj.matrix_parent_inverse @ obj.matrix_basis


def edges(obj: bpy.types.Object) -> list[float]:
    """Of its bounding box, along its own axes, in units of the scene."""
    lengths = np.ptp(np.array(obj.bound_box), axis=0).tolist()
    return [abs(length * scale) for length, scale in zip(lengths, of(obj).to_scale(), strict=True)]
