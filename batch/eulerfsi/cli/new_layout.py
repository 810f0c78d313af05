"""What `new` chooses: the box around solids, voxel size, frames and stiffness. Metres, y up, the floor at y = 0."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..parameters import table
from ..run import estimate
from ..scene.bodies import DEFAULT_DENSITY
from ..scene.read import EARTH_GRAVITY
from ..solver import simulation as solver

CELLS_ACROSS = 24  # of the smallest solid
CELLS_THROUGH = 3  # of the shortest edge of a solid's box
MAX_CELLS = 2e6
MAX_SECONDS = 60.0  # of the whole run on two cores, if it takes the most steps that it may
_FPS, _FRAMES, _MAX_FRAMES = 24, 48, 480
# A solid of length L moves in times of sqrt(L/g): a scene shows at most so many of them, and at least so many.
_MOST_TIMES, _LEAST_TIMES = 20.0, 2.5


@dataclasses.dataclass(frozen=True)
class Layout:
    """A scene around solids. size: of the box [m]; centers: (n, 3) of what is placed in it; moduli: of the solids [Pa];
    first: its first frame."""

    size: np.ndarray
    voxel: float
    fps: float
    frames: int
    centers: np.ndarray
    moduli: list[float]
    first: int = 1

    @property
    def cells(self) -> int:
        """Cells of the grid."""
        return int((self.size / self.voxel).round().prod())


def lay_out(blocks: np.ndarray, solids: np.ndarray | None = None) -> Layout:
    """Places blocks with bounding boxes of these edges, (n, 3) [m], side by side. solids: those of the solids in them.

    The voxel size gives the smallest solid 24 cells across and every box 3 through, unless the run would take too long.
    E = 20 rho g L: weight alone presses a solid by a few percent. A small scene is slow motion, a large one is longer.
    """
    solids = blocks if solids is None else solids
    margin = margin_of(blocks)
    gap = 0.6 * margin
    width = float(blocks[:, 0].sum()) + gap * (len(blocks) - 1)
    size = np.array([width, float(blocks[:, 1].max()), float(blocks[:, 2].max())]) + 2 * margin
    left = -width / 2 + np.concatenate([[0.0], np.cumsum(blocks[:-1, 0] + gap)])
    centers = np.stack([left + blocks[:, 0] / 2, margin + blocks[:, 1] / 2, np.zeros(len(blocks))], axis=1)
    time = math.sqrt(float(blocks.max()) / EARTH_GRAVITY)
    fps = _FPS
    while _FRAMES / fps > _MOST_TIMES * time:
        fps *= 2
    frames = min(max(_FRAMES, math.ceil(_LEAST_TIMES * time * fps)), _MAX_FRAMES)
    return refine(Layout(size, 0.0, fps, frames, centers, moduli_of(solids)), solids, margin)


def margin_of(edges: np.ndarray) -> float:
    """Room between solids with these boxes and the walls [m]."""
    return 0.7 * float(edges.mean(axis=1).max())


def moduli_of(edges: np.ndarray) -> list[float]:
    """E of solids with these boxes [Pa]."""
    return [two_digits(20 * DEFAULT_DENSITY * EARTH_GRAVITY * float(edge.max())) for edge in edges]


def refine(layout: Layout, edges: np.ndarray, drop: float) -> Layout:
    """With the finest voxel size that suits solids with these boxes and does not take too long; the box is rounded up.

    drop: their height above the floor [m].
    """
    size = layout.size
    wanted = min(float(edges.max(axis=1).min()) / CELLS_ACROSS, float(edges.min()) / CELLS_THROUGH)
    voxel = two_digits(max(wanted, float(size.prod() / MAX_CELLS) ** (1 / 3)))
    while True:
        layout = dataclasses.replace(layout, voxel=voxel, size=np.ceil(size / voxel) * voxel)
        if _seconds(layout, edges, drop) <= MAX_SECONDS:
            return layout
        voxel = two_digits(1.06 * voxel)


def _seconds(layout: Layout, edges: np.ndarray, drop: float) -> float:
    """What the run may take on two cores."""
    h, poisson = layout.voxel, table()["solid"]["poissonsRatio"].default
    limits = solver.step_limits({"voxel_size": h}, DEFAULT_DENSITY)
    meets = estimate.seconds_to_meet(drop - limits["contact_reach"] * h, 0.0, EARTH_GRAVITY)
    bodies = [
        estimate.Body(0.0, EARTH_GRAVITY, meets, math.sqrt(E / 2 / (1 + poisson) / DEFAULT_DENSITY), float(edge[1]))
        for E, edge in zip(layout.moduli, edges, strict=True)
    ]
    _, most = estimate.steps(estimate.Plan(h, 1 / layout.fps, max(layout.frames - 1, 1), bodies, limits))
    return most * layout.cells * estimate.SECONDS_PER_CELL_STEP


def two_digits(value: float) -> float:
    """Two significant digits."""
    digits = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{round(value / digits) * digits:.6g}")
