"""The rigid motion that fits two poses of a surface best."""

from __future__ import annotations

import math

import numpy as np


def volume_center(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(3,) centre of the volume inside a surface; of one that encloses nothing the mean of its corners.

    points: (n, 3), triangles: (m, 3). The library's center_of_volume, about which a solid turns.
    """
    corners = np.asarray(points, float)[triangles]
    mean = corners.reshape(-1, 3).mean(axis=0)
    a, b, c = (corners[:, k] - mean for k in range(3))
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    total = volumes.sum()
    if abs(total) <= 1e-9 * np.abs(volumes).sum():
        return mean
    return mean + (volumes[:, None] * (a + b + c)).sum(axis=0) / (4.0 * total)


def fit_rigid_motion(
    before: np.ndarray, after: np.ndarray, triangles: np.ndarray, seconds: float, about: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity [m/s] of the point `about` and angular velocity [rad/s] of the steady screw motion between two poses.

    before, after: (n, 3) [m], `seconds` apart; points count by the area around them. The rotation is Kabsch's (1976).
    Rounded to nine digits of the fastest point's speed, so that the last bits of linear algebra libraries do not show.
    """
    weights = _areas(before, triangles)
    start, end = (weights @ x / weights.sum() for x in (before, after))
    u, _, vt = np.linalg.svd((after - end).T @ (weights[:, None] * (before - start)))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    turn = _rotation_vector(rotation)
    translation = end - rotation @ start
    # Translation of a screw motion, undone: t = (integral of the rotation over the way) v.
    angle, cross = float(np.sqrt(turn @ turn)), _cross_matrix(turn)
    factor = 1.0 / 12.0 if angle < 1e-4 else (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / angle**2
    velocity = translation - 0.5 * cross @ translation + factor * cross @ cross @ translation + np.cross(turn, about)
    size = float(np.abs(before).max())
    fastest = max(float(np.abs(velocity).max()), float(np.abs(turn).max()) * size, 1e-5 * size)
    digits = 9 - math.ceil(math.log10(fastest / seconds))
    turn_digits = digits + math.ceil(math.log10(size))
    return np.round(velocity / seconds, digits) + 0.0, np.round(turn / seconds, turn_digits) + 0.0


def _areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) a third of the area around each point; equal weights on a surface without area."""
    a, b, c = (np.asarray(points, float)[triangles[:, k]] for k in range(3))
    area = np.sqrt((np.cross(b - a, c - a) ** 2).sum(axis=1)) / 6.0
    weights = sum(np.bincount(triangles[:, k], area, len(points)) for k in range(3))
    return weights if weights.sum() > 0 else np.ones(len(points))


def _rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Axis times angle in [0, pi)."""
    axis = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine = float(np.sqrt(axis @ axis))
    angle = math.atan2(sine, 0.5 * (float(np.trace(rotation)) - 1.0))
    return axis * (angle / sine if sine > 1e-12 else 1.0)


def _cross_matrix(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
