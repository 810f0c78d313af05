"""Free oscillation of an elastic ball: the spheroidal mode l = 2 about the x axis (Lamb 1882).

u = A grad(j_2(a r) Y) + B curl curl(r j_2(b r) Y), a = omega / c_p, b = omega / c_s, without traction at r = R.
Below R = c_s = 1, so that b is the root x = omega R / c_s.
"""

from __future__ import annotations

import functools

import numpy as np

STEP = 1e-6  # of the differences that give the gradient of the displacement, over the radius


def bessel(x: np.ndarray) -> np.ndarray:
    """Spherical Bessel function j_2, by its series below 1/2."""
    x = np.asarray(x, float)
    far = np.where(x < 0.5, 1.0, x)
    closed = (3 / far**3 - 1 / far) * np.sin(far) - 3 / far**2 * np.cos(far)
    return np.where(x < 0.5, x**2 / 15 * (1 - x**2 / 14 * (1 - x**2 / 36 * (1 - x**2 / 66))), closed)


def bessel_slope(x: np.ndarray) -> np.ndarray:
    """x times the derivative of j_2, that is x j_1 - 3 j_2; by its series below 1/2."""
    x = np.asarray(x, float)
    far = np.where(x < 0.5, 1.0, x)
    closed = np.sin(far) / far - np.cos(far) - 3 * bessel(far)
    series = x**2 / 15 * (2 - x**2 / 14 * (4 - x**2 / 36 * (6 - x**2 / 66 * 8)))
    return np.where(x < 0.5, series, closed)


def speeds(poissons_ratio: float) -> float:
    """Speed of shear over that of pressure."""
    return float(np.sqrt((1 - 2 * poissons_ratio) / (2 * (1 - poissons_ratio))))


def tractions(b: float, poissons_ratio: float) -> np.ndarray:
    """Normal and tangential traction over 2 mu at r = 1, columns A and B, second derivatives by Bessel's equation."""
    ratio = speeds(poissons_ratio)
    a, l2 = ratio * b, 6.0  # l (l + 1)
    ja, jb, da, db = bessel(a), bessel(b), bessel_slope(a), bessel_slope(b)
    normal = [-(b**2) / 2 * ja * (1 - 2 * ratio**2) - 2 * da + (l2 - a**2) * ja, l2 * (db - jb)]
    return np.array([normal, [da - ja, -db - (b**2 / 2 - l2 + 1) * jb]], float)


@functools.cache
def root(poissons_ratio: float) -> float:
    """Lowest x = omega R / c_s."""
    determinant = lambda b: np.linalg.det(tractions(b, poissons_ratio))  # noqa: E731
    grid = np.linspace(1.0, 4.0, 3001)
    values = [determinant(b) for b in grid]
    at = next(k for k in range(len(grid) - 1) if values[k] * values[k + 1] < 0)
    low, high = grid[at], grid[at + 1]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if determinant(low) * determinant(middle) > 0 else (low, middle)
    return float(low)


def displacement(points: np.ndarray, radius: float, poissons_ratio: float) -> np.ndarray:
    """Of the mode at points about the centre, (n, 3); 1 where the x axis leaves the ball, unit of the points'."""
    b = root(poissons_ratio)
    weights = np.linalg.svd(tractions(b, poissons_ratio))[2][-1]  # A, B
    pole = _field(np.array([[1.0, 0.0, 0.0]]), b, weights, poissons_ratio)[0, 0]
    return _field(np.asarray(points, float) / radius, b, weights, poissons_ratio) / pole


def gradient(points: np.ndarray, radius: float, poissons_ratio: float) -> np.ndarray:
    """Of the displacement, times the radius, (n, 3, 3); the last index is the derivative's."""
    columns = []
    for axis in range(3):
        step = STEP * radius * np.eye(3)[axis]
        ahead, behind = (displacement(points + s * step, radius, poissons_ratio) for s in (1, -1))
        columns.append((ahead - behind) / (2 * STEP))
    return np.stack(columns, axis=-1)


def _field(x: np.ndarray, b: float, weights: np.ndarray, poissons_ratio: float) -> np.ndarray:
    """A grad(g H) + B (grad(h H) + b^2 x g_b H), H = x^2 - (y^2 + z^2) / 2, the curls by their identity."""
    a = speeds(poissons_ratio) * b
    r = np.maximum(np.linalg.norm(x, axis=-1), 1e-3)
    harmonic = x[..., 0] ** 2 - (x[..., 1] ** 2 + x[..., 2] ** 2) / 2
    slope = x * np.array([2.0, -1.0, -1.0])

    def gradient_of(value: np.ndarray, rise: np.ndarray) -> np.ndarray:
        """grad(g H) of g = value / r^2, rise = r d value / dr."""
        inner = (rise - 2 * value) / r**4
        return (value / r**2)[..., None] * slope + (inner * harmonic)[..., None] * x

    pressure = gradient_of(bessel(a * r), bessel_slope(a * r))
    jb, db = bessel(b * r), bessel_slope(b * r)
    bend = (6 - (b * r) ** 2) * jb - db  # (r d/dr)^2 j_2 by Bessel's equation
    shear = gradient_of(jb + db, db + bend) + b**2 * (jb / r**2 * harmonic)[..., None] * x
    return weights[0] * pressure + weights[1] * shear
