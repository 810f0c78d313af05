"""The painter: a frame from the side, shaded solids in front of the smoke's optical depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import UsdGeom

from ..scene.parts import Collider, Passenger, Scene, Solid
from .usd_writer import vertex_normals

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure
    from matplotlib.transforms import Affine2D

# Fill colours of the solids, repeated when there are more.
_COLORS = ((0.86, 0.36, 0.22), (0.25, 0.55, 0.80), (0.93, 0.72, 0.25), (0.45, 0.68, 0.38), (0.66, 0.45, 0.74))
_COLLIDER = (0.45, 0.47, 0.50)
_PASSENGER = (0.93, 0.93, 0.90)
_SMOKE = (204, 214, 230)
BACKGROUND = (0.075, 0.085, 0.105)
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


def paint(
    scene: Scene, frame: int, surfaces: list[tuple[np.ndarray, np.ndarray]], smoke: np.ndarray | None
) -> np.ndarray:
    """(height, width, 3) bytes: one frame. Raises ImportError without matplotlib.

    surfaces: of scene.simulated points [m] and velocities; smoke: (nx, ny, nz) density or None.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.transforms import Affine2D

    gravity = np.array(scene.domain["gravity"])
    right, up, depth = view_axes(gravity)
    flip = -1.0 if gravity[up] > 0 else 1.0  # simulation axes may stand on their head
    low = np.array(scene.domain["domain_min"])
    high = low + np.array(scene.domain["domain_size"])
    width, height = high[right] - low[right], high[up] - low[up]
    inches = 7.2 / max(width, height)
    figure = Figure(figsize=(width * inches, height * inches), dpi=100)
    figure.patch.set_visible(False)
    # Axes, with ticks that nobody sees, would take half of the time.
    to_pixels = Affine2D().translate(-low[right], -min(flip * low[up], flip * high[up]))
    to_pixels.scale(figure.bbox.width / width, figure.bbox.height / height)
    _paint_surfaces(figure, to_pixels, scene, frame, surfaces, (right, up, depth), flip)
    title = f"{scene.name}  frame {frame}"
    figure.text(0.02, 0.96, title, color=(0.75, 0.78, 0.82), fontsize=9)
    renderer = FigureCanvasAgg(figure).get_renderer()
    pixels = np.asarray(renderer.buffer_rgba())
    pixels[...] = (*(round(255 * part) for part in BACKGROUND), 255)
    if smoke is not None and smoke.size:
        _paint_smoke(pixels, to_pixels, scene, smoke, (right, up, depth), flip)
    figure.draw(renderer)
    return pixels[..., :3].copy()


def _paint_smoke(
    pixels: np.ndarray, to_pixels: Affine2D, scene: Scene, smoke: np.ndarray, order: tuple[int, int, int], flip: float
) -> None:
    """order: axes that point right, up and along the view."""
    from PIL import Image

    right, up, depth = order
    low, h = np.array(scene.domain["domain_min"]), scene.domain["voxel_size"]
    # Light that is not let through along the line of sight, as a renderer would show thin smoke.
    thickness = np.moveaxis(smoke, order, (0, 1, 2)).sum(axis=2) * h
    alpha = 1 - np.exp(-2.5 * thickness / max(scene.domain["domain_size"][depth], h))
    top = low[up] + h * smoke.shape[up]
    end = low[right] + h * smoke.shape[right]
    ends = to_pixels.transform([(low[right], flip * low[up]), (end, flip * top)])
    (left, bottom), (width, height) = ends.min(axis=0).round().astype(int), np.ptp(ends, axis=0).round().astype(int)
    rows = np.rint(255 * alpha.T).astype(np.uint8)[:: -int(flip)]  # the upper ones first
    shown = np.asarray(Image.fromarray(rows).resize((width, height), Image.Resampling.BILINEAR))
    shares = np.arange(256)[:, None] / 255
    colors = np.rint((1 - shares) * 255 * np.array(BACKGROUND) + shares * _SMOKE).astype(np.uint8)
    first = len(pixels) - bottom - height  # row of the picture; the last cell may reach out of it
    shown = shown[max(-first, 0) :, : pixels.shape[1] - left]
    place = pixels[max(first, 0) :, left : left + shown.shape[1], :3]
    place[: len(shown)] = colors[shown[: len(place)]]


def _paint_surfaces(
    figure: Figure,
    to_pixels: Affine2D,
    scene: Scene,
    frame: int,
    surfaces: list[tuple[np.ndarray, np.ndarray]],
    order: tuple[int, int, int],
    flip: float,
) -> None:
    right, up, depth = order
    # The viewer looks against the third axis of a right-handed (right, up, towards) frame.
    toward = flip * (1.0 if order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0)
    corners, shades = [], []
    shapes = [(solid, points) for solid, (points, _) in zip(scene.simulated, surfaces, strict=True)]
    shapes = [(part, points) for part, points in shapes if _is_drawn(scene, part)]
    shapes += [(body, body.points(frame)) for body in [*scene.riders, *scene.colliders]]
    for number, (solid, points) in enumerate(shapes):
        view = np.stack([points[:, right], flip * points[:, up], toward * points[:, depth]], axis=1).astype(float)
        triangles = solid.mesh.triangles()
        if not len(solid.mesh.counts):
            size = scene.domain["domain_size"]
            view, triangles = _dots(view, _DOT * max(size[right], size[up]))
        rest = _COLLIDER if isinstance(solid, Collider) else _PASSENGER
        color = np.array(_COLORS[number % len(_COLORS)] if isinstance(solid, Solid) else rest)
        corners.append(view[triangles])
        shades.append(np.repeat(_shade(view, triangles, color)[:, None], 3, axis=1))
    if corners:
        places = np.concatenate(corners)
        nearest_last = np.argsort(places[:, :, 2].mean(axis=1), kind="stable")
        colors = np.concatenate(shades)[nearest_last]
        opaque = np.concatenate([colors, np.ones((*colors.shape[:2], 1))], axis=2)
        figure.add_artist(_triangles(places[nearest_last, :, :2], opaque, to_pixels))


def _triangles(places: np.ndarray, colors: np.ndarray, to_pixels: Affine2D) -> Artist:
    """An artist that draws triangles (n, 3, 2) with colours (n, 3, 4) at their corners, one over the other."""
    from matplotlib.artist import Artist

    class Triangles(Artist):
        def draw(self, renderer: Any) -> None:
            context = renderer.new_gc()
            renderer.draw_gouraud_triangles(context, places, colors, to_pixels)
            context.restore()

    return Triangles()


def _shade(view: np.ndarray, triangles: np.ndarray, color: np.ndarray) -> np.ndarray:
    """(n, 3) colours of the triangles."""
    normal = vertex_normals(view, triangles, left_handed=False)[triangles].astype(float).mean(axis=1)
    length = np.sqrt((normal * normal).sum(axis=1, keepdims=True))
    normal = normal / np.where(length > 0, length, 1)
    normal *= np.where(normal[:, 2:] < 0, -1, 1)  # open or inverted faces are lit from the viewer's side
    light = 0.25 + 0.75 * np.clip(normal @ _LIGHT, 0, 1)
    shine = 0.35 * np.clip(normal @ ((_LIGHT + (0, 0, 1)) / np.linalg.norm(_LIGHT + (0, 0, 1))), 0, 1) ** 40
    return np.clip(color * light[:, None] + shine[:, None], 0, 1)
