"""Writes the characters of the example scenes in examples/assets/: smooth unions of signed distances.

    pip install scikit-image usd-core
    python examples/assets/make_characters.py [FOLDER]

Each file holds one closed mesh /<Name>, 1 unit tall or long, y up, facing +z, and below it its eyes, which ride along
with the solid. Written once and committed: neither the library nor its tests need scikit-image. The shapes are CC0.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Usd, UsdGeom, Vt
from skimage.measure import marching_cubes

ASSETS = Path(__file__).resolve().parent
sys.path.insert(0, str(ASSETS.parent))

from pieces import bind_material  # noqa: E402

SPACING = 0.03  # of the grid on which a shape is sampled
DIGITS = 5  # decimals of coordinates
BLEND = 0.06  # radius of the fillets between parts

Distance = Callable[[np.ndarray], np.ndarray]  # points (..., 3) -> signed distance (...)


# ------------------------------------------------------------------------------------------------------- primitives


def ball(center: tuple, radius: float) -> Distance:
    return lambda x: np.linalg.norm(x - center, axis=-1) - radius


def ellipsoid(center: tuple, radii: tuple, turn: tuple = (0, 0, 0)) -> Distance:
    """Near the surface the distance, to first order. turn: degrees about x, y, z, in this order."""
    axes = _rotation(turn)

    def distance(x: np.ndarray) -> np.ndarray:
        local = (x - center) @ axes
        k0 = np.linalg.norm(local / radii, axis=-1)
        k1 = np.linalg.norm(local / np.square(radii), axis=-1)
        return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)

    return distance


def capsule(start: tuple, end: tuple, radius: float) -> Distance:
    a, axis = np.array(start, float), np.subtract(end, start)

    def distance(x: np.ndarray) -> np.ndarray:
        t = np.clip((x - a) @ axis / (axis @ axis), 0.0, 1.0)
        return np.linalg.norm(x - a - t[..., None] * axis, axis=-1) - radius

    return distance


def union(*parts: Distance, blend: float = BLEND) -> Distance:
    """Parts joined by fillets of radius `blend` (a polynomial minimum)."""

    def distance(x: np.ndarray) -> np.ndarray:
        result = parts[0](x)
        for part in parts[1:]:
            other = part(x)
            overlap = np.maximum(blend - np.abs(result - other), 0.0) / blend
            result = np.minimum(result, other) - 0.25 * blend * overlap**2
        return result

    return distance


def both_sides(part: Callable[[float], Distance]) -> list[Distance]:
    """A part on the left and on the right: `part` gets the sign of x."""
    return [part(1.0), part(-1.0)]


def _rotation(turn: tuple) -> np.ndarray:
    matrix = np.eye(3)
    for axis, degrees in enumerate(turn):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        i, j = (axis + 1) % 3, (axis + 2) % 3
        one = np.eye(3)
        one[i, i] = one[j, j] = c
        one[i, j], one[j, i] = -s, s
        matrix = one @ matrix
    return matrix


# -------------------------------------------------------------------------------------------------------- characters


def cheb() -> Distance:
    """A furry fellow with big round ears."""
    return union(
        ellipsoid((0, 0.31, 0), (0.2, 0.25, 0.18)),
        ball((0, 0.7, 0), 0.22),
        *both_sides(lambda s: ellipsoid((0.36 * s, 0.8, 0), (0.19, 0.19, 0.085))),
        *both_sides(lambda s: capsule((0.17 * s, 0.42, 0.02), (0.33 * s, 0.26, 0.07), 0.075)),
        *both_sides(lambda s: ellipsoid((0.12 * s, 0.09, 0.05), (0.1, 0.075, 0.14))),
        ball((0, 0.66, 0.2), 0.05),
    )


def duck() -> Distance:
    """A bath duck."""
    return union(
        ellipsoid((0, 0.3, -0.05), (0.29, 0.25, 0.4)),
        ball((0, 0.68, 0.2), 0.21),
        ellipsoid((0, 0.64, 0.44), (0.13, 0.075, 0.13)),
        ellipsoid((0, 0.42, -0.4), (0.14, 0.085, 0.17), (35, 0, 0)),
        *both_sides(lambda s: ellipsoid((0.3 * s, 0.35, -0.06), (0.085, 0.14, 0.23), (0, 0, -14 * s))),
    )


def penguin() -> Distance:
    """A stout penguin."""
    return union(
        ellipsoid((0, 0.4, 0), (0.27, 0.38, 0.24)),
        ball((0, 0.78, 0.02), 0.2),
        ellipsoid((0, 0.75, 0.23), (0.075, 0.06, 0.13)),
        *both_sides(lambda s: ellipsoid((0.3 * s, 0.42, 0.02), (0.08, 0.25, 0.12), (0, 0, 18 * s))),
        *both_sides(lambda s: ellipsoid((0.13 * s, 0.07, 0.12), (0.11, 0.07, 0.17))),
        ellipsoid((0, 0.1, -0.22), (0.11, 0.08, 0.13), (-25, 0, 0)),
    )


def whale() -> Distance:
    """A whale with a raised tail."""
    return union(
        ellipsoid((0, 0.3, 0.1), (0.29, 0.28, 0.42)),
        capsule((0, 0.3, -0.2), (0, 0.47, -0.5), 0.11),
        *both_sides(lambda s: ellipsoid((0.15 * s, 0.56, -0.56), (0.17, 0.07, 0.11), (20, 0, 22 * s))),
        *both_sides(lambda s: ellipsoid((0.33 * s, 0.2, 0.1), (0.17, 0.07, 0.12), (0, 25 * s, -25 * s))),
    )


def octopus() -> Distance:
    """A round head on six short arms."""
    around = [np.radians(60 * i + 30) for i in range(6)]
    arms = [
        union(
            capsule((0.16 * np.cos(a), 0.2, 0.16 * np.sin(a)), (0.36 * np.cos(a), 0.08, 0.36 * np.sin(a)), 0.085),
            ball((0.43 * np.cos(a), 0.1, 0.43 * np.sin(a)), 0.075),
        )
        for a in around
    ]
    return union(ellipsoid((0, 0.56, 0), (0.31, 0.36, 0.3)), ellipsoid((0, 0.22, 0), (0.22, 0.14, 0.22)), *arms)


# Shape, colour, and per eye: its centre and radius.
CHARACTERS: dict[str, tuple[Callable[[], Distance], tuple, list[tuple[tuple, float]]]] = {
    "Cheb": (cheb, (0.55, 0.33, 0.18), [((0.09, 0.75, 0.19), 0.05), ((-0.09, 0.75, 0.19), 0.05)]),
    "Duck": (duck, (0.95, 0.78, 0.15), [((0.11, 0.75, 0.36), 0.045), ((-0.11, 0.75, 0.36), 0.045)]),
    "Penguin": (penguin, (0.16, 0.2, 0.3), [((0.09, 0.84, 0.185), 0.045), ((-0.09, 0.84, 0.185), 0.045)]),
    "Whale": (whale, (0.3, 0.55, 0.75), [((0.17, 0.37, 0.43), 0.045), ((-0.17, 0.37, 0.43), 0.045)]),
    "Octopus": (octopus, (0.75, 0.3, 0.45), [((0.11, 0.58, 0.265), 0.06), ((-0.11, 0.58, 0.265), 0.06)]),
}
WHITE, BLACK = (0.95, 0.95, 0.92), (0.04, 0.04, 0.06)


# ------------------------------------------------------------------------------------------------------------- writing


def surface(distance: Distance) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and triangles (m, 3), faces outwards."""
    low, high = np.array([-0.7537, -0.1519, -0.8523]), np.array([0.7463, 1.2481, 0.8477])
    count = np.round((high - low) / SPACING).astype(int) + 1
    grid = np.stack(np.meshgrid(*(low[a] + SPACING * np.arange(count[a]) for a in range(3)), indexing="ij"), axis=-1)
    points, faces, *_ = marching_cubes(distance(grid), 0.0, spacing=(SPACING,) * 3, gradient_direction="descent")
    return weld(points + low, faces)


def weld(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points that are one when written become one; faces that have shrunk to nothing go."""
    points, numbers = np.unique(np.round(points, DIGITS), axis=0, return_inverse=True)
    faces = numbers.ravel()[faces]
    kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return points, faces[kept]


def add_mesh(stage: Usd.Stage, path: str, points: np.ndarray, faces: np.ndarray, color: tuple) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    places = Vt.Vec3fArray([Gf.Vec3f(*(round(float(x), DIGITS) for x in p)) for p in points])
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreatePointsAttr(places)
    mesh.CreateFaceVertexCountsAttr([3] * len(faces))
    mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(places))
    bind_material(stage, mesh.GetPrim(), color)
    return mesh


def make(name: str) -> Usd.Stage:
    """The stage of one character: /<Name>/Body and its eyes beside it, which solids that use it name as carried."""
    shape, color, eyes = CHARACTERS[name]
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().comment = "Written by examples/assets/make_characters.py. CC0."
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    root = UsdGeom.Xform.Define(stage, f"/{name}").GetPrim()
    stage.SetDefaultPrim(root)
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    add_mesh(stage, f"/{name}/Body", *surface(shape()), color)
    for side, (center, radius) in zip(("Left", "Right"), eyes, strict=True):
        outer = 0.55 * radius
        for part, place, size, tone in (
            (f"Eye{side}", center, radius, WHITE),
            (f"Pupil{side}", np.add(center, (0, 0, radius - 0.35 * outer)), outer, BLACK),
        ):
            points, faces = round_ball(size)
            add_mesh(stage, f"/{name}/Eyes/{part}", points + place, faces, tone)
    UsdGeom.Xform.Define(stage, f"/{name}/Eyes")
    return stage


def round_ball(radius: float) -> tuple[np.ndarray, np.ndarray]:
    """A ball of a few triangles."""
    step = radius / 4.0
    line = np.arange(-radius - 2.3 * step, radius + 2.5 * step, step)
    grid = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1)
    points, faces, *_ = marching_cubes(
        np.linalg.norm(grid, axis=-1) - radius, 0.0, spacing=(step,) * 3, gradient_direction="descent"
    )
    return points + line[0], faces


def main(folder: Path = ASSETS) -> None:
    for name in CHARACTERS:
        stage = make(name)
        stage.GetRootLayer().Export(str(folder / f"{name.lower()}.usda"))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ASSETS)
