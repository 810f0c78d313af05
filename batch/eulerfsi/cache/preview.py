"""preview.png: the last frame from the side, shaded solids in front of the smoke's optical depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import UsdGeom

from .. import files
from ..scene.parts import Collider, Passenger, Scene, Solid
from .usd_writer import vertex_normals

NAME = "preview.png"
# Fill colours of the solids, repeated when there are more.
_COLORS = ((0.86, 0.36, 0.22), (0.25, 0.55, 0.80), (0.93, 0.72, 0.25), (0.45, 0.68, 0.38), (0.66, 0.45, 0.74))
_COLLIDER = (0.45, 0.47, 0.50)
_PASSENGER = (0.93, 0.93, 0.90)
_BACKGROUND = (0.075, 0.085, 0.105)
_DOT = 0.005  # radius of a point without faces, of the longer edge of the picture
_LIGHT = np.array([-0.45, 0.75, 0.6]) / np.linalg.norm([-0.45, 0.75, 0.6])


def view_axes(gravity: np.ndarray) -> tuple[int, int, int]:
    """Axes of simulation space that point right, up and along the view; up is opposite to gravity's largest part."""
    up = int(np.argmax(np.abs(gravity))) if np.any(gravity) else 1
    right, depth = ((up + 2) % 3, (up + 1) % 3) if up != 2 else (0, 1)
    return right, up, depth


def _dots(view: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Points, and triangles of them, that draw a hexagon at each point of curves and clouds."""
    angle = np.arange(6) * np.pi / 3
    ring = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    corners = (view[:, None] + np.concatenate([np.zeros((1, 3)), ring])).reshape(-1, 3)
    fan = np.array([(0, 1 + i, 1 + (i + 1) % 6) for i in range(6)])
    return corners, (7 * np.arange(len(view))[:, None, None] + fan).reshape(-1, 3)


def _is_drawn(scene: Scene, part: Solid | Passenger) -> bool:
    """Not a cage, whose smooth surface is, nor what stands for something else, as a sim mesh for its graphics."""
    prim = scene.stage.GetPrimAtPath(part.output_path) if part.output_path else None
    stands_in = prim and UsdGeom.Imageable(prim).ComputePurpose() in (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide)
    return not getattr(part, "is_cage", False) and not stands_in


def write_preview(
    path: Path,
    scene: Scene,
    frame: int,
    surfaces: list[tuple[np.ndarray, np.ndarray]],
    smoke: np.ndarray | None,
    title: str,
) -> None:
    """Draws one frame. Raises ImportError without matplotlib.

    surfaces: of scene.simulated points [m] and velocities; smoke: (nx, ny, nz) density or None.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.collections import PolyCollection

    gravity = np.array(scene.domain["gravity"])
    right, up, depth = view_axes(gravity)
    flip = -1.0 if gravity[up] > 0 else 1.0  # simulation axes may stand on their head
    low = np.array(scene.domain["domain_min"])
    high = low + np.array(scene.domain["domain_size"])
    width, height = high[right] - low[right], high[up] - low[up]
    inches = 7.2 / max(width, height)
    figure = pyplot.figure(figsize=(width * inches, height * inches), dpi=100, facecolor=_BACKGROUND)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(low[right], high[right])
    axes.set_ylim(*sorted((flip * low[up], flip * high[up])))
    axes.set_axis_off()

    if smoke is not None and smoke.size:
        h = scene.domain["voxel_size"]
        # Light that is not let through along the line of sight, as a renderer would show thin smoke.
        thickness = np.moveaxis(smoke, (right, up, depth), (0, 1, 2)).sum(axis=2) * h
        alpha = 1 - np.exp(-2.5 * thickness / max(high[depth] - low[depth], h))
        image = np.ones((*alpha.T.shape, 4))
        image[..., :3] = (0.80, 0.84, 0.90)
        image[..., 3] = alpha.T
        top = low[up] + h * smoke.shape[up]
        end = low[right] + h * smoke.shape[right]
        axes.imshow(
            image,
            origin="lower",
            extent=(low[right], end, flip * low[up], flip * top),
            interpolation="bilinear",
            aspect="auto",
        )

    # The viewer looks against the third axis of a right-handed (right, up, towards) frame.
    toward = flip * (1.0 if (right, up, depth) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0)
    polygons, shades, distances = [], [], []
    shapes = [(solid, points) for solid, (points, _) in zip(scene.simulated, surfaces, strict=True)]
    shapes = [(part, points) for part, points in shapes if _is_drawn(scene, part)]
    shapes += [(body, body.points(frame)) for body in [*scene.riders, *scene.colliders]]
    for number, (solid, points) in enumerate(shapes):
        view = np.stack([points[:, right], flip * points[:, up], toward * points[:, depth]], axis=1).astype(float)
        triangles = solid.mesh.triangles()
        if not len(solid.mesh.counts):
            view, triangles = _dots(view, _DOT * max(width, height))
        corners = view[triangles]
        normal = vertex_normals(view, triangles, left_handed=False)[triangles].astype(float).mean(axis=1)
        length = np.sqrt((normal * normal).sum(axis=1, keepdims=True))
        normal = normal / np.where(length > 0, length, 1)
        normal *= np.where(normal[:, 2:] < 0, -1, 1)  # open or inverted faces are lit from the viewer's side
        light = 0.25 + 0.75 * np.clip(normal @ _LIGHT, 0, 1)
        shine = 0.35 * np.clip(normal @ ((_LIGHT + (0, 0, 1)) / np.linalg.norm(_LIGHT + (0, 0, 1))), 0, 1) ** 40
        rest = _COLLIDER if isinstance(solid, Collider) else _PASSENGER
        color = np.array(_COLORS[number % len(_COLORS)] if isinstance(solid, Solid) else rest)
        polygons.append(corners[:, :, :2])
        shades.append(np.clip(color * light[:, None] + shine[:, None], 0, 1))
        distances.append(corners[:, :, 2].mean(axis=1))
    if polygons:
        order = np.argsort(np.concatenate(distances), kind="stable")
        colors = np.concatenate(shades)[order]
        axes.add_collection(
            PolyCollection(np.concatenate(polygons)[order], facecolors=colors, edgecolors=colors, linewidths=0.4)
        )
    axes.text(0.02, 0.96, title, transform=axes.transAxes, color=(0.75, 0.78, 0.82), fontsize=9)
    with files.replacing(path) as temporary:
        figure.savefig(temporary, facecolor=_BACKGROUND)
    pyplot.close(figure)
