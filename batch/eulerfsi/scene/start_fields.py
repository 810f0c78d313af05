"""Displacement and velocity at the nodes of a solid that starts deformed, or with a velocity of each point.

In a tetrahedron both are linear. Around them each layer of nodes continues what lies beside it: the mean of the linear
continuations from its neighbours that have a value.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from eulerfsi_usd import tets

from .tet_bodies import TetState


def start_fields(
    state: TetState, shape: tuple[int, ...], place: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray | None]:
    """Displacement (3, nx, ny, nz) [m], velocity likewise [m/s] or None. place: of the field, as the library says."""
    owner, weights, nodes = tets.locate_nodes(state.start, state.corners, place["origin"], place["spacing"], shape)
    at_points = [state.start - state.rest] if state.velocities is None else [state.start - state.rest, state.velocities]
    values = np.concatenate(at_points, axis=1)
    inside = owner >= 0
    corners = state.corners[owner[inside]]
    field, slopes = np.zeros((len(nodes), values.shape[1])), np.zeros((len(nodes), values.shape[1], 3), np.float32)
    field[inside] = sum(weights[inside, k : k + 1] * values[corners[:, k]] for k in range(4))
    slopes[inside] = _slopes(state, values)[owner[inside]]
    _continue(field, slopes, inside, shape, place["spacing"])
    parts = [np.moveaxis(field[:, k : k + 3].reshape(*shape, 3), -1, 0) for k in range(0, values.shape[1], 3)]
    return parts[0], parts[1] if len(parts) > 1 else None


def _slopes(state: TetState, values: np.ndarray) -> np.ndarray:
    """(m, c, 3) gradient of values at the points (n, c) in each tetrahedron, where the solid starts."""
    corners = state.corners
    change = np.stack([values[corners[:, k]] - values[corners[:, 0]] for k in (1, 2, 3)], axis=-1)
    inverse = tets.inverse(tets.edges(state.start, corners))
    return sum(change[:, :, k, None] * inverse[:, None, k, :] for k in range(3))


def _continue(field: np.ndarray, slopes: np.ndarray, known: np.ndarray, shape: tuple[int, ...], spacing: float) -> None:
    """Fills the nodes that are not known, in place, layer by layer from those that are."""
    steps = [(axis, sign) for axis in range(3) for sign in (-1, 1)]
    stride = (shape[1] * shape[2], shape[2], 1)
    known = known.copy()
    edge = np.flatnonzero(known)
    while len(edge):
        beside = [_neighbours(edge, axis, sign, shape, stride)[0] for axis, sign in steps]
        new = np.unique(np.concatenate(beside))
        new = new[~known[new]]
        count, total = np.zeros(len(new)), np.zeros((len(new), field.shape[1]))
        slope = np.zeros((len(new), *slopes.shape[1:]))
        for axis, sign in steps:
            there, which = _neighbours(new, axis, sign, shape, stride)
            held = known[there]
            there, which = there[held], which[held]
            total[which] += field[there] - sign * spacing * slopes[there, :, axis]
            slope[which] += slopes[there]
            count[which] += 1
        field[new] = total / count[:, None]
        slopes[new] = slope / count[:, None, None]
        known[new] = True
        edge = new


def _neighbours(
    nodes: np.ndarray, axis: int, sign: int, shape: tuple[int, ...], stride: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """The next nodes along an axis, and of which of the nodes they are the neighbours."""
    at = nodes // stride[axis] % shape[axis] + sign
    which = np.flatnonzero((at >= 0) & (at < shape[axis]))
    return nodes[which] + sign * stride[axis], which
